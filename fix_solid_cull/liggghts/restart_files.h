// Restart files on their way out and in: the engine's part first, what is culled at the end.
#pragma once

#include <string>

namespace LAMMPS_NS {
class LAMMPS;
}

namespace solidcull {

class FixSolidCull;

/// A restart file that is being written. It has its name when it is whole; until then there is the file of that name that was
/// there before. Collective.
class RestartFile {
 public:
  /// name: as the engine knows it, with a % where each rank writes a file of its own.
  RestartFile(LAMMPS_NS::LAMMPS* lmp, const char* name);
  /// What the engine is to write to, and may change while it does.
  char* name() { return &part_[0]; }
  /// The engine has written its part.
  void finish();

 private:
  LAMMPS_NS::LAMMPS* lmp_;
  FixSolidCull* fix_;  // without one there is nothing to be done
  std::string name_, part_;
};

/// The deck reads this file, as read_restart names it: * the highest number, % the base file.
void remember_read(LAMMPS_NS::LAMMPS* lmp, const std::string& name);
/// The file itself, of which rank 0 alone knows the name; empty if none was read.
std::string file_that_was_read(const LAMMPS_NS::LAMMPS* lmp);

}  // namespace solidcull
