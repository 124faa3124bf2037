// How much is culled over all ranks, as of the last time that it was counted.
#pragma once

#include <cstdint>
#include <utility>

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

  /// Bodies have changed: they may be several on several ranks, until they are counted. Local.
  void expect_several() { bodies_ = bed_.ranks.count > 1 ? 2 : static_cast<std::int64_t>(bed_.solid.bodies().size()); }
  /// As counted over all ranks; returns how many more are stored than the time before. Local.
  std::int64_t set(std::int64_t bodies, std::int64_t locked, std::int64_t stored) {
    bodies_ = bodies;
    locked_ = locked;
    return stored - std::exchange(stored_, stored);
  }
  /// The engine learns how many atoms there are, see Atoms::publish_counts(). Collective.
  void publish_atoms(std::int64_t returned) {
    std::int64_t all[3] = {bed_.atoms.owned, bed_.atoms.map_is_too_small(), bed_.clumps.count()};
    bed_.ranks.sum(all, 3);
    bed_.atoms.publish_counts(returned, all[0], all[1] != 0);
    if (bed_.clumps.possible) bed_.clumps.publish_count(all[2]);
  }
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
