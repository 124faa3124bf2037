// Where on this rank is the atom of this tag? A table by tag where most tags are atoms here, a hash map where few are.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "flat_map.h"

namespace solidcull {

/// Tags are >= 0. Takes at most 4 * sparse bytes per atom as a table, else what a FlatMap takes. Local to the rank.
class TagIndex {
 public:
  /// Empty, and ready for so many atoms with tags up to `highest`.
  void begin(std::size_t atoms, std::int64_t highest) {
    few_.clear();
    if (highest < 0 || static_cast<double>(highest) >= sparse * static_cast<double>(atoms)) {
      table_.clear();
      few_.reserve(atoms);
    } else {
      table_.assign(static_cast<std::size_t>(highest) + 1, absent);
    }
  }
  const int* find(std::int64_t tag) const {
    if (static_cast<std::uint64_t>(tag) >= table_.size()) return few_.find(tag);
    const int* at = &table_[static_cast<std::size_t>(tag)];
    return *at == absent ? nullptr : at;
  }
  bool contains(std::int64_t tag) const { return find(tag) != nullptr; }
  void set(std::int64_t tag, int index) {
    if (static_cast<std::uint64_t>(tag) < table_.size())
      table_[static_cast<std::size_t>(tag)] = index;
    else
      few_[tag] = index;
  }
  void erase(std::int64_t tag) {
    if (static_cast<std::uint64_t>(tag) < table_.size())
      table_[static_cast<std::size_t>(tag)] = absent;
    else
      few_.erase(tag);
  }

 private:
  static constexpr int absent = -1;
  static constexpr double sparse = 8;
  std::vector<int> table_;
  FlatMap<int> few_;
};

}  // namespace solidcull
