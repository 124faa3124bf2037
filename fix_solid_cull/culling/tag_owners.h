// Which rank has a granule, for ranks that know its tag alone.
#pragma once

#include <cstdint>
#include <vector>

#include "flat_map.h"
#include "ports.h"

namespace solidcull {

/// Each tag has a home among the ranks, which all know: there whoever has the granule says so, and whoever looks for it asks.
/// What a rank receives goes with what it has and what it asks for, not with the number of ranks.
class TagOwners {
 public:
  /// tags: what this rank has. Collective.
  TagOwners(const Ranks& ranks, const std::vector<std::int64_t>& tags);
  static constexpr int nobody = -1;
  /// The rank that has each of these. Collective.
  std::vector<int> of(const std::vector<std::int64_t>& tags) const;

 private:
  int home(std::int64_t tag) const { return static_cast<int>(tag % ranks_.count); }

  const Ranks& ranks_;
  FlatMap<int> owner_;  // of tags that are at home here
};

}  // namespace solidcull
