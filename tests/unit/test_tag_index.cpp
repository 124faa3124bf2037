#include <gtest/gtest.h>

#include <random>
#include <unordered_map>

#include "tag_index.h"

namespace solidcull {
namespace {

TEST(TagIndex, finds_what_was_set_among_many_tags_and_among_few) {
  for (const std::int64_t highest : {std::int64_t(2000), std::int64_t(2000000000)}) {
    TagIndex index;
    index.begin(1000, highest);
    std::unordered_map<std::int64_t, int> expected;
    std::mt19937 random(7);
    for (int k = 0; k < 5000; ++k) {
      const std::int64_t tag = static_cast<std::int64_t>(random() % static_cast<std::uint64_t>(highest + 500));  // beyond, too
      if (random() % 3 == 0) {
        index.erase(tag);
        expected.erase(tag);
      } else {
        index.set(tag, k);
        expected[tag] = k;
      }
      const std::int64_t other = static_cast<std::int64_t>(random() % static_cast<std::uint64_t>(highest + 500));
      const auto known = expected.find(other);
      ASSERT_EQ(index.contains(other), known != expected.end()) << other;
      if (known != expected.end()) {
        ASSERT_EQ(*index.find(other), known->second);
      }
    }
    for (const auto& [tag, at] : expected) ASSERT_EQ(*index.find(tag), at);
  }
}

TEST(TagIndex, begins_empty_whatever_it_held) {
  TagIndex index;
  for (const std::int64_t highest : {10, 1000000, 20, 30}) {
    index.begin(10, highest);
    for (const std::int64_t tag : {0, 5, 10, 25, 999999}) EXPECT_FALSE(index.contains(tag)) << tag << " of " << highest;
    index.set(5, 1);
    index.set(999999, 2);
    EXPECT_EQ(*index.find(5), 1);
    EXPECT_EQ(*index.find(999999), 2);
  }
}

TEST(TagIndex, of_no_atoms_holds_nothing) {
  TagIndex index;
  EXPECT_FALSE(index.contains(1));
  index.begin(0, -1);
  EXPECT_FALSE(index.contains(0));
}

}  // namespace
}  // namespace solidcull
