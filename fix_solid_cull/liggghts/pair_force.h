// The engine's own contact law, asked for the force of a single contact.
#pragma once

#include <vector>

#include "pointers.h"
#include "sphere.h"

namespace solidcull {

/// Leaves forces and histories as they are: works on copies. Local.
class PairForce : protected LAMMPS_NS::Pointers {
 public:
  explicit PairForce(LAMMPS_NS::LAMMPS* lmp) : Pointers(lmp) {}

  /// Force (N) on atom i by its neighbour number `at` in its neighbour list; valid while the lists are (from the pair computation
  /// to the end of the step).
  Vec3 on_first(int i, int at);

  /// Force (N) on owned atom i by owned atom j with this contact history (nullptr: none); valid wherever both are atoms.
  Vec3 on_first(int i, int j, const double* history);

  /// Gives its scratch memory back.
  void release();

 private:
  Vec3 compute(int i, int neighbour, int flag, std::vector<double> history);

  std::vector<double*> force_rows_, torque_rows_, history_rows_;
  std::vector<int> counts_;
  std::vector<int*> neighbour_rows_, flag_rows_;
};

}  // namespace solidcull
