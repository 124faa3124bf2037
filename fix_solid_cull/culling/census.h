// How much is culled over all ranks, as of the last time that it was counted.
#pragma once

#include <cstdint>

#include "bed_state.h"

namespace solidcull {

class Census {
 public:
  explicit Census(const BedState& bed) : bed_(bed) {}

  bool something_stored() const { return stored_ > 0; }
  std::int64_t stored() const { return stored_; }
  bool something_locked() const { return locked_ > 0; }
  std::int64_t locked() const { return locked_; }
  bool several_bodies() const { return bodies_ > 1; }  ///< with one alone, none can come near another

  /// Collective.
  void count_bodies() {
    std::int64_t counts[2] = {static_cast<std::int64_t>(bed_.solid.bodies().size()),
                              static_cast<std::int64_t>(bed_.solid.locked())};
    bed_.ranks.sum(counts, 2);
    bodies_ = counts[0];
    locked_ = counts[1];
  }
  /// Returns how many more are stored than the time before. Collective.
  std::int64_t count_stored() {
    const std::int64_t before = stored_;
    stored_ = static_cast<std::int64_t>(bed_.solid.store().size());
    bed_.ranks.sum(&stored_, 1);
    return stored_ - before;
  }

 private:
  const BedState& bed_;
  std::int64_t stored_ = 0;  // interior granules
  std::int64_t locked_ = 0;  // interface and interior granules
  std::int64_t bodies_ = 0;  // parts of bodies, on all ranks
};

}  // namespace solidcull
