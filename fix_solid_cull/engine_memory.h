// After most granules went into the store: the engine's arrays, which only ever grow, are cut to what is left.
#pragma once

#include <cstddef>

#include "engine_access.h"
#include "pointers.h"

namespace solidcull {

/// Local to the rank. Only in pre_exchange, after the contact histories are in the partner lists: the neighbour lists that are
/// there are given up.
class EngineMemory : protected LAMMPS_NS::Pointers {
 public:
  explicit EngineMemory(LAMMPS_NS::LAMMPS* lmp) : Pointers(lmp) {}

  /// Whether the arrays are far larger than the atoms need.
  bool too_large() const;
  void fit();
  /// So many bytes more were freed: what lies between living blocks goes back to the system once it is much.
  void trim(std::size_t freed);

  /// The engine fills all bins of the box at each build, some ten for each granule of a bed, atoms or not. While few atoms are
  /// left and some granules are stored, bins are wider, but for those whose width the deck gives. The engine lists pairs by bins,
  /// so sums of forces may differ in their last bit. Same times as fit(); not at the start of a run.
  void fit_bins(bool some_stored);
  /// They are again as the engine makes them.
  void give_bins_back();

 private:
  std::size_t freed_ = 0;  // since the last trim
  bool wide_ = false;
  engine::BinEdges ours_{};  // while they are wide (m)
};

}  // namespace solidcull
