// After most granules went into the store: the engine's arrays, which only ever grow, are cut to what is left.
#pragma once

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
};

}  // namespace solidcull
