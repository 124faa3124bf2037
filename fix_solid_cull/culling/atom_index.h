// Where on this rank is the atom of this tag?
#pragma once

#include <algorithm>
#include <cstdint>

#include "ports.h"
#include "release.h"
#include "tag_index.h"

namespace solidcull {

/// Valid from index() until the engine sorts or exchanges its atoms; StoreExchange keeps it so while membership changes. Local.
class AtomIndex {
 public:
  void index(const Atoms& atoms) {
    int highest = 0;
    for (int i = 0; i < atoms.owned; ++i) highest = std::max(highest, atoms.tag[i]);
    index_.begin(static_cast<std::size_t>(atoms.owned), highest);
    for (int i = 0; i < atoms.owned; ++i) index_.set(atoms.tag[i], i);
  }
  const int* find(std::int64_t tag) const { return index_.find(tag); }
  int at(std::int64_t tag) const {
    const int* i = index_.find(tag);
    if (!i) throw InternalError("granule " + std::to_string(tag) + " is no atom of this rank");
    return *i;
  }
  bool contains(std::int64_t tag) const { return index_.contains(tag); }
  void set(std::int64_t tag, int i) { index_.set(tag, i); }
  void erase(std::int64_t tag) { index_.erase(tag); }
  void release_memory() { release(index_); }

 private:
  TagIndex index_;
};

}  // namespace solidcull
