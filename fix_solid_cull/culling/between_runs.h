// What a deck or a program finds between two runs: the whole bed (invariant I9, theory.md#invariants).
#pragma once

#include <cstdint>
#include <map>

#include "change.h"
#include "culling_parts.h"
#include "look.h"
#include "phase.h"

namespace solidcull {

/// Collective, unless a function says otherwise.
class BetweenRuns {
 public:
  BetweenRuns(CullingParts& parts, Change& change, Look& look) : bed_(parts.bed), p_(parts), change_(change), look_(look) {}

  /// All granules are atoms, as in the unculled deck, until hide_bed(); nothing if they are already, or none is culled. Local;
  /// finish_show() follows before the next collective function.
  void show_bed();
  /// What show_bed() leaves for later where it was called on one rank alone: the engine's map of tags, for one.
  void finish_show();
  /// The engine is about to compute forces of all granules, and has. Between them it has the contacts within bodies too.
  void lend_contacts();
  void take_contacts_back();
  /// Whether a culled granule may be in one of these engine groups (bits).
  bool culls_of(int groups) const;
  /// What was culled and not changed is culled again; what was changed wakes in take_changes().
  void hide_bed();
  /// A run begins: what the deck did to culled granules.
  void take_changes(bool other_walls);
  /// By body, as the last run left them. Local.
  const std::map<int, InterfaceMesh>& interface_meshes();
  /// All granules become exterior. Returns how many were not, over all ranks.
  std::int64_t restore_all(Phase phase);

 private:
  void leave_lists();

  Bed& bed_;
  CullingParts& p_;
  Change& change_;
  Look& look_;
  bool show_unfinished_ = false;  // the bed is shown on this rank, and other ranks may not know
};

}  // namespace solidcull
