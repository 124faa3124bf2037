// Interface granules that have left the box, or were deleted, are members of no body any more.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "bed.h"
#include "flat_map.h"

namespace solidcull {

class LostAtoms {
 public:
  explicit LostAtoms(Bed& bed) : bed_(bed) {}

  /// The engine is given its atoms: what is in the shell now. Local.
  void remember() {
    before_.clear();
    if (bed_.solid.bodies().locked() == 0) return;
    for (int i = 0; i < bed_.atoms.owned; ++i)
      if (bed_.shell[i].in_body())
        before_.push_back(
            {bed_.atoms.tag[i], {bed_.atoms.mass[i], bed_.shell[i].place, bed_.atoms.radius[i], bed_.shell[i].held}});
  }
  /// These did not come from the rank that they left.
  void add(const std::vector<LostGranule>& lost) { on_the_way_.insert(on_the_way_.end(), lost.begin(), lost.end()); }
  /// Those that are not there any more leave their bodies. True if there were any, on any rank; then bodies are to be settled
  /// anew. Collective.
  bool forget_lost() {
    std::size_t here = 0;
    for (int i = 0; i < bed_.atoms.owned; ++i) here += bed_.shell[i].locked;
    std::vector<LostGranule> lost = std::move(on_the_way_);
    on_the_way_.clear();
    if (here != bed_.solid.bodies().locked()) {
      FlatMap<char> present;
      for (int i = 0; i < bed_.atoms.owned; ++i) present[bed_.atoms.tag[i]] = 1;
      for (const LostGranule& b : before_)
        if (!present.contains(b.tag) && bed_.solid.bodies().body_of(b.tag) && !bed_.solid.store().contains(b.tag))
          lost.push_back(b);
    }
    if (!bed_.ranks.any(!lost.empty())) return false;
    bed_.index.index(bed_.atoms);
    for (const LostGranule& b : lost) bed_.solid.unlock(b.tag, b.granule);
    for (const LostGranule& b : lost) bed_.solid.thaw(b.tag);
    bed_.split_bodies();
    return true;
  }
  void release_memory() { before_.shrink_to_fit(); }

 private:
  Bed& bed_;
  std::vector<LostGranule> before_;      // interface granules of this rank when the engine was last given its atoms
  std::vector<LostGranule> on_the_way_;  // announced by another rank
};

}  // namespace solidcull
