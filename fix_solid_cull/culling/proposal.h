// What a look found: which exterior granules are to be culled at the next reneighbouring, and what ties them together.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "ports.h"

namespace solidcull {

/// Two bodies that have rested against each other for long enough: the contact of a and b joins them.
struct Join {
  Triple at;  // place of a (m)
  std::int64_t a, b;
};

struct Proposal {
  std::vector<std::int64_t> chosen;  ///< tags
  /// A granule with an owned interface granule in contact, and the force on the latter (N, world frame) across ranks, where it
  /// can not be asked for later.
  struct SideChange {
    std::int64_t interface_tag, other_tag;
    Vec3 force;
  };
  std::vector<SideChange> side_changes;
  struct Touch {
    std::int64_t a, b;
  };
  std::vector<Touch> touches;  ///< pairs that are locked, or will be, and touch
  std::vector<Join> joins;
  std::vector<std::int64_t> overdue_tags;  ///< of the chosen: they have waited for long

  bool any_here() const { return !chosen.empty() || !joins.empty(); }
  Proposal take() { return std::exchange(*this, Proposal{}); }
};

}  // namespace solidcull
