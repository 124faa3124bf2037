// Forces of all granules between two runs: numbers of contacts can be asked for then, as of the unculled bed.
#pragma once

#include <vector>

#include "pointers.h"

namespace solidcull {

class FixSolidCull;

/// While it lives the engine's neighbour lists, ghosts and virials are those of all atoms, computed as a run's setup does:
/// contact histories do not advance, meshes feel nothing. The forces stay. What a program or a command has made larger since the
/// last run than lists reach, or has moved farther than ghosts do, has no contacts before the next one. Collective.
class WholeBedForces : protected LAMMPS_NS::Pointers {
 public:
  /// All granules are atoms: the bed of this fix is shown, or nothing is culled.
  WholeBedForces(LAMMPS_NS::LAMMPS* lmp, FixSolidCull& fix);
  ~WholeBedForces();
  WholeBedForces(const WholeBedForces&) = delete;

  /// Meshes are not to hear of contacts now.
  static bool at_work() { return computing_; }
  /// Of granules, as they are listed now, that have no contacts (m).
  static constexpr double radius_without_contacts = 1e-30;

 private:
  struct Out;
  std::vector<Out> take_out() const;
  void put_back(const std::vector<Out>& all) const;
  void list_pairs();
  void list_walls();
  void compute();

  FixSolidCull& fix_;
  static bool computing_;
};

/// Whether a number that was computed in the last step is of contacts or forces. Local.
bool some_current_number_needs_forces(LAMMPS_NS::LAMMPS* lmp);
/// Whether to compute this number now, by its ID, may need them: it is not of the last step, and of contacts or made of others.
/// Local.
bool may_need_forces(LAMMPS_NS::LAMMPS* lmp, const char* compute);
/// What was computed in the last step is computed again, of all atoms. Such numbers of forces need a WholeBedForces. Collective.
void compute_again(LAMMPS_NS::LAMMPS* lmp);

}  // namespace solidcull
