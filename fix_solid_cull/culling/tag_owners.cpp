#include "tag_owners.h"

#include <map>

namespace solidcull {

TagOwners::TagOwners(const Ranks& ranks, const std::vector<std::int64_t>& tags) : ranks_(ranks) {
  std::map<int, std::vector<std::int64_t>> here;
  for (const std::int64_t tag : tags) here[home(tag)].push_back(tag);
  for (const auto& [rank, there] : ranks_.deliver(here))
    for (const std::int64_t tag : there) owner_[tag] = rank;
}

std::vector<int> TagOwners::of(const std::vector<std::int64_t>& tags) const {
  std::map<int, std::vector<std::int64_t>> asked;
  for (const std::int64_t tag : tags) asked[home(tag)].push_back(tag);
  std::map<int, std::vector<int>> answers;
  for (const auto& [rank, those] : ranks_.deliver(asked))
    for (const std::int64_t tag : those) {
      const int* owner = owner_.find(tag);
      answers[rank].push_back(owner ? *owner : nobody);
    }
  answers = ranks_.deliver(answers);
  std::map<int, std::size_t> next;
  std::vector<int> owners;
  owners.reserve(tags.size());
  for (const std::int64_t tag : tags) owners.push_back(answers.at(home(tag)).at(next[home(tag)]++));
  return owners;
}

}  // namespace solidcull
