// What the culling does before and after a command of a deck, and before a variable is evaluated between runs (invariant I9).
#pragma once

#include <cstdint>
#include <string>

namespace LAMMPS_NS {
class LAMMPS;
}

namespace solidcull {

class FixSolidCull;
/// The deck's fix solid/cull; nullptr if it has none. Local.
FixSolidCull* fix_of(LAMMPS_NS::LAMMPS* lmp);

/// Lives while the engine works on a command. Collective.
class MetCommand {
 public:
  /// added: one of the engine's command styles. words, n: the engine's own, which a run loses `pre no` from where it must set up.
  MetCommand(LAMMPS_NS::LAMMPS* lmp, const char* command, bool added, char** words, int& n);
  ~MetCommand();
  MetCommand(const MetCommand&) = delete;

 private:
  LAMMPS_NS::LAMMPS* lmp_;
  std::int64_t step_ = 0;
  bool resets_ = false;
};

/// One line where the atoms of a restart file are not the whole bed until a fix has taken up the rest; else empty. Local.
std::string part_of_a_bed(LAMMPS_NS::LAMMPS* lmp, const FixSolidCull* fix, const std::string& where);
/// Stops the program with one line where the formula reads what a fix has measured of atoms only, see formulas.h. Collective.
void refuse_value_of_atoms(LAMMPS_NS::LAMMPS* lmp, const std::string& formula);
/// Stored granules are atoms until the next run, and numbers of the last step are of all; forces: theirs are computed. Between
/// runs only. Collective.
void show(LAMMPS_NS::LAMMPS* lmp, FixSolidCull& fix, bool forces);
/// Between runs only. Collective.
void met_formula(LAMMPS_NS::LAMMPS* lmp, const char* formula);
/// Before the engine sets up a run. Collective.
void run_begins(LAMMPS_NS::LAMMPS* lmp);

/// From here on what the engine's neighbour lists say is void, and contact histories are with the atoms, until the next run sets
/// up: culled granules have come out between runs.
void leave_lists(LAMMPS_NS::LAMMPS* lmp);
/// delete_atoms would take contact histories from the lists; asked once by it, says whether to leave them.
bool leaves_histories();

}  // namespace solidcull
