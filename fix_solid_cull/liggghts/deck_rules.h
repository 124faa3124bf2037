// Which decks the culling can run with: what is refused, and which groups stay exterior.
#pragma once

#include <set>
#include <string>

#include "atoms.h"
#include "pointers.h"
#include "ports.h"

namespace solidcull {

class DeckRules : protected LAMMPS_NS::Pointers {
 public:
  DeckRules(LAMMPS_NS::LAMMPS* lmp, const LAMMPS_NS::Fix* own) : Pointers(lmp), own_(own) {}

  /// When the fix is made; when a run begins. InputError says what to do. Local, alike on all ranks.
  void refuse_what_was_set_up_wrongly() const;
  void refuse_what_cannot_be_culled() const;
  /// Which groups of the deck may be culled: bits of `atoms`; true if they are others than before. Says where a group stays
  /// exterior for its fix.
  bool find_movable(EngineAtoms& atoms, const Run& run);

 private:
  void refuse_physics_that_would_miss_granules() const;
  void refuse_measures_of_other_physics() const;
  bool fills_solid_bodies(const LAMMPS_NS::Fix* fix) const;
  void say_what_sees_atoms_only(const Run& run);
  void say_once(const Run& run, const std::string& line);

  const LAMMPS_NS::Fix* own_;
  std::set<std::string> said_;
};

/// One line on granules in a restart file that no fix of the deck has taken up; empty where there are none. Local, alike on all
/// ranks.
std::string state_that_no_fix_has(LAMMPS_NS::Modify& modify);

}  // namespace solidcull
