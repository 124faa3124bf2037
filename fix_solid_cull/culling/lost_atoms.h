// Interface granules that have left the box, or were deleted, are members of no body any more.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "body_changes.h"
#include "body_groups.h"
#include "census.h"
#include "flat_map.h"
#include "ports.h"
#include "shell.h"
#include "solid.h"

namespace solidcull {

class LostAtoms {
 public:
  LostAtoms(const Ports& ports, Solid& solid, Shell& shell, AtomIndex& index, const GranuleMasses& masses)
      : ports_(ports), solid_(solid), shell_(shell), index_(index), masses_(masses) {}

  /// The engine is given its atoms: what is in the shell now. Local.
  void remember() {
    before_.clear();
    if (solid_.bodies().locked() == 0) return;
    for (int i = 0; i < ports_.atoms.owned; ++i)
      if (shell_[i].in_body())
        before_.push_back({ports_.atoms.tag[i], {ports_.atoms.mass[i], shell_[i].place, ports_.atoms.radius[i], shell_[i].held}});
  }
  /// These did not come from the rank that they left.
  void add(const std::vector<LostGranule>& lost) { on_the_way_.insert(on_the_way_.end(), lost.begin(), lost.end()); }
  /// Those that are not there any more leave their bodies. True if there were any, on any rank; then bodies are to be settled
  /// anew. Collective.
  bool forget_lost() {
    std::size_t here = 0;
    for (int i = 0; i < ports_.atoms.owned; ++i) here += shell_[i].locked;
    std::vector<LostGranule> lost = std::move(on_the_way_);
    on_the_way_.clear();
    if (here != solid_.bodies().locked()) {
      FlatMap<char> present;
      for (int i = 0; i < ports_.atoms.owned; ++i) present[ports_.atoms.tag[i]] = 1;
      for (const LostGranule& b : before_)
        if (!present.contains(b.tag) && solid_.bodies().body_of(b.tag) && !solid_.store().contains(b.tag)) lost.push_back(b);
    }
    if (!ports_.ranks.any(!lost.empty())) return false;
    index_.index(ports_.atoms);
    for (const LostGranule& b : lost) solid_.unlock(b.tag, b.granule);
    for (const LostGranule& b : lost) solid_.thaw(b.tag);
    split_bodies(ports_.atoms, solid_, shell_, index_, masses_);
    return true;
  }
  void release_memory() { before_.shrink_to_fit(); }

 private:
  const Ports& ports_;
  Solid& solid_;
  Shell& shell_;
  AtomIndex& index_;
  const GranuleMasses& masses_;
  std::vector<LostGranule> before_;      // interface granules of this rank when the engine was last given its atoms
  std::vector<LostGranule> on_the_way_;  // announced by another rank
};

}  // namespace solidcull
