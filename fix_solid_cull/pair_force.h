// The engine's own contact law, asked for the force of a single contact.
#pragma once

#include <vector>

#include "pointers.h"
#include "sphere.h"

namespace solidcull {

/// Valid while the neighbour lists are (from the pair computation to the end of the step). Leaves forces and histories as they
/// are: works on copies. Local.
class PairForce : protected LAMMPS_NS::Pointers {
 public:
  explicit PairForce(LAMMPS_NS::LAMMPS* lmp) : Pointers(lmp) {}

  /// Force (N) on granule i by its neighbour number `at` in its neighbour list.
  Vec3 on_first(int i, int at);

 private:
  std::vector<double*> force_rows_, torque_rows_;
};

}  // namespace solidcull
