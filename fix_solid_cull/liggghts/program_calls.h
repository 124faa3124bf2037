// A program that drives the engine finds the whole bed whenever it has control (invariant I9).
#pragma once

namespace LAMMPS_NS {
class LAMMPS;
}

namespace solidcull {

/// Lives while a call of the program works on commands. At the end of the outermost one the program has control again: it is told
/// of all granules, and finds them as atoms as soon as it may look at them. Collective.
class ProgramCall {
 public:
  enum class By {
    library,  ///< library.h: the program asks for granules by functions that are met, see library.cpp
    classes   ///< the engine's own classes: it may read them at any time
  };
  ProgramCall(LAMMPS_NS::LAMMPS* lmp, By by);
  ~ProgramCall();
  ProgramCall(const ProgramCall&) = delete;

 private:
  LAMMPS_NS::LAMMPS* lmp_;
  By by_;
};

/// This engine is no more; another may take its place in memory. Local.
void forget_program(LAMMPS_NS::LAMMPS* lmp);
/// Whether this program is the engine's own, which only runs the deck of its command line. Local.
bool is_own_program();

// --- the program has control, and asks
/// One line where the atoms of a restart file are not the whole bed yet. Local.
void refuse_part(LAMMPS_NS::LAMMPS* lmp, const char* asks);
/// It will read granules, with their forces or without. Nothing while a command is at work. Collective.
void program_reads(LAMMPS_NS::LAMMPS* lmp, bool forces, const char* asks);
/// Likewise on one rank alone, without forces; and it keeps what it gets, to read at any time. Local.
void program_takes_pointer(LAMMPS_NS::LAMMPS* lmp, const char* asks);
/// It changes granules now. Local.
void program_changes(LAMMPS_NS::LAMMPS* lmp);
/// It keeps what it gets. Local.
void program_keeps_pointer(LAMMPS_NS::LAMMPS* lmp, bool forces);

}  // namespace solidcull
