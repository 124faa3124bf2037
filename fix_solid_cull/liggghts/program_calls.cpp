#include "program_calls.h"

#include <errno.h>
#include <mpi.h>

#include <cstring>
#include <map>
#include <string>

#include "atom.h"
#include "deck_commands.h"
#include "error.h"
#include "fix_solid_cull.h"
#include "lammps.h"

namespace solidcull {
namespace {

struct Program {
  int calls = 0;                  // of it that are at work
  bool keeps_pointers = false;    // to granules, or to how many there are
  bool keeps_forces = false;      // some of them to forces
  LAMMPS_NS::bigint told_of = 0;  // stored granules, in the engine's count of atoms
};

std::map<LAMMPS_NS::LAMMPS*, Program>& programs() {
  static std::map<LAMMPS_NS::LAMMPS*, Program> all;
  return all;
}
Program& program_of(LAMMPS_NS::LAMMPS* lmp) { return programs()[lmp]; }

/// The fix whose bed the program is to find; nullptr: there is none, or the engine is at work.
FixSolidCull* fix_to_ask(LAMMPS_NS::LAMMPS* lmp) {
  if (program_of(lmp).calls > 0) return nullptr;
  FixSolidCull* fix = fix_of(lmp);
  return fix && !fix->in_run() ? fix : nullptr;
}

/// The program counts all granules, also those that are no atoms. Local.
void count_stored(LAMMPS_NS::LAMMPS* lmp, const FixSolidCull& fix) {
  Program& program = program_of(lmp);
  program.told_of = fix.bed_is_shown() ? 0 : fix.stored();
  lmp->atom->natoms += program.told_of;
}

/// The engine counts its atoms; where the bed was shown since, it has.
void count_atoms_alone(LAMMPS_NS::LAMMPS* lmp) {
  Program& program = program_of(lmp);
  const FixSolidCull* fix = fix_of(lmp);
  if (fix && !fix->bed_is_shown()) lmp->atom->natoms -= program.told_of;
  program.told_of = 0;
}

/// One rank may have been asked without the others.
void agree(LAMMPS_NS::LAMMPS* lmp, FixSolidCull* fix) {
  Program& program = program_of(lmp);
  const int here[3] = {fix && fix->bed_is_shown(), program.keeps_pointers, program.keeps_forces};
  int anywhere[3];
  MPI_Allreduce(here, anywhere, 3, MPI_INT, MPI_MAX, lmp->world);
  program.keeps_pointers = anywhere[1] != 0;
  program.keeps_forces = anywhere[2] != 0;
  if (fix && program.keeps_pointers) fix->keep_arrays();
  if (anywhere[0]) show(lmp, *fix, false);
}

}  // namespace

void refuse_part(LAMMPS_NS::LAMMPS* lmp, const char* asks) {
  if (!lmp->modify) return;
  const std::string why = part_of_a_bed(lmp, fix_of(lmp), std::string("before '") + asks + "'");
  if (!why.empty()) lmp->error->one(FLERR, why.c_str());
}

void forget_program(LAMMPS_NS::LAMMPS* lmp) { programs().erase(lmp); }

bool is_own_program() {
  for (const char* name : {"liggghts", "lmp"})
    if (std::strncmp(program_invocation_short_name, name, std::strlen(name)) == 0) return true;
  return false;
}

ProgramCall::ProgramCall(LAMMPS_NS::LAMMPS* lmp, By by) : lmp_(lmp), by_(by) {
  if (program_of(lmp).calls == 0) {
    count_atoms_alone(lmp);
    FixSolidCull* const fix = fix_to_ask(lmp);
    if (fix && program_of(lmp).keeps_pointers) fix->see_granules_again();
    agree(lmp, fix);
  }
  ++program_of(lmp).calls;
}

ProgramCall::~ProgramCall() {
  Program& program = program_of(lmp_);
  if (--program.calls > 0) return;
  FixSolidCull* const fix = fix_to_ask(lmp_);
  if (!fix || fix->waits_for_run()) return;
  if (by_ == By::classes) program.keeps_pointers = program.keeps_forces = true;
  if (program.keeps_pointers) show(lmp_, *fix, program.keeps_forces);
  if (program.keeps_pointers) fix->remember_granules();
  count_stored(lmp_, *fix);
}

void program_reads(LAMMPS_NS::LAMMPS* lmp, bool forces, const char* asks) {
  refuse_part(lmp, asks);
  FixSolidCull* const fix = fix_to_ask(lmp);
  if (!fix) return;
  count_atoms_alone(lmp);
  show(lmp, *fix, forces);
  count_stored(lmp, *fix);
}

void program_takes_pointer(LAMMPS_NS::LAMMPS* lmp, const char* asks) {
  refuse_part(lmp, asks);
  program_keeps_pointer(lmp, false);
  FixSolidCull* const fix = fix_to_ask(lmp);
  if (!fix || fix->bed_is_shown()) return;
  count_atoms_alone(lmp);
  fix->show_bed_here();
  count_stored(lmp, *fix);
}

void program_changes(LAMMPS_NS::LAMMPS* lmp) {
  if (FixSolidCull* const fix = fix_to_ask(lmp)) fix->granules_may_change();
}

void program_keeps_pointer(LAMMPS_NS::LAMMPS* lmp, bool forces) {
  Program& program = program_of(lmp);
  FixSolidCull* const fix = fix_to_ask(lmp);
  if (fix && !program.keeps_pointers) fix->remember_granules();
  program.keeps_pointers = true;
  program.keeps_forces = program.keeps_forces || forces;
}

}  // namespace solidcull
