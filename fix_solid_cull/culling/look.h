// A look: what rests, what of it is to be culled, what is exposed, and whether culling pays (theory.md#solid-state,
// theory.md#pacing).
#pragma once

#include <cstdint>
#include <utility>

#include "culling_parts.h"
#include "proposal.h"

namespace solidcull {

/// Keeps what the last look chose, until the next change takes it. Collective, unless a function says otherwise.
class Look {
 public:
  explicit Look(CullingParts& parts) : bed_(parts.bed), p_(parts) {}

  /// At a step at which one is due.
  void look();
  /// Before the first step of a run in which nothing is culled. What the deck has tilted since the last one begins to move now.
  void look_at_once();
  /// What granules know of walls.
  void see_walls(bool new_run);

  // --- what it chose; local
  const Proposal& chosen() const { return chosen_; }
  Proposal take() { return chosen_.take(); }
  /// It is not known to rest any more: a command may do anything to granules.
  void granules_may_change();
  /// A program may, until the second call: then they are known to rest where it has not.
  void remember_granules();
  void see_granules_again();
  /// Whether what a look chose was dropped since the last call.
  bool take_dropped() { return std::exchange(dropped_, false); }

 private:
  Proposal survey(bool may_cull, bool any_culled);
  bool are_worth_choosing(std::int64_t candidates) const;
  void ground_and_press();
  bool judge(bool may_cull);
  std::uint64_t sum_of_granules() const;

  Bed& bed_;
  CullingParts& p_;
  Proposal chosen_;
  bool dropped_ = false;
  bool surface_drawn_ = false;      // at the last look
  std::int64_t restored_then_ = 0;  // granules restored on this rank until culling was judged last
  std::uint64_t granules_sum_ = 0;  // see remember_granules()
};

}  // namespace solidcull
