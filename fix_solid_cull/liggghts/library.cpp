// LIGGGHTS's library.h, for programs that drive it (C, the Python module, control loops): each function that tells of granules
// shows the whole bed first (invariant I9). A function that returns numbers shows it for this once. One that returns a pointer
// into the engine's arrays may be followed by reads at any time: from then on the bed is shown whenever the program has control.
//
// A program that is linked calls these, as this library comes first. One that looks symbols up in libliggghts.so, as Python's
// ctypes does, finds these too, see lookups.h. Where it does not, it calls the engine's, and the bed is shown after each
// command (register_styles.cpp).
#include "library.h"

#include <cstring>
#include <initializer_list>
#include <string>

#include "deck_commands.h"
#include "engine_access.h"
#include "fix_solid_cull.h"
#include "formulas.h"
#include "input.h"
#include "lammps.h"
#include "lookups.h"
#include "program_calls.h"
#include "variable.h"
#include "whole_bed_forces.h"

namespace solidcull {
namespace {

/// The engine's own function; looked for before lookups lead here. The engine's own program looks nothing up, and to lead it here
/// would take it a pass over the engine's symbols for each function.
template <class Function>
class Own {
 public:
  Own(const char* name, Function ours) : own_(reinterpret_cast<Function>(engine::found_symbol(name))) {
    if (own_ && !is_own_program())
      lookups_lead_to(reinterpret_cast<const void*>(own_), name, reinterpret_cast<const void*>(ours));
  }
  Function operator()() const { return own_; }

 private:
  Function own_;
};

#define SOLIDCULL_OWN(NAME) const Own<decltype(&NAME)> own_##NAME(#NAME, &NAME);
SOLIDCULL_OWN(lammps_close)
SOLIDCULL_OWN(lammps_file)
SOLIDCULL_OWN(lammps_command)
SOLIDCULL_OWN(lammps_extract_global)
SOLIDCULL_OWN(lammps_extract_atom)
SOLIDCULL_OWN(lammps_extract_compute)
SOLIDCULL_OWN(lammps_extract_fix)
SOLIDCULL_OWN(lammps_extract_variable)
SOLIDCULL_OWN(lammps_get_natoms)
SOLIDCULL_OWN(lammps_gather_atoms)
SOLIDCULL_OWN(lammps_scatter_atoms)
#undef SOLIDCULL_OWN

LAMMPS_NS::LAMMPS* engine_of(void* handle) { return static_cast<LAMMPS_NS::LAMMPS*>(handle); }

bool is_one_of(const char* name, std::initializer_list<const char*> names) {
  for (const char* n : names)
    if (std::strcmp(name, n) == 0) return true;
  return false;
}

bool is_of_forces(const char* name) { return is_one_of(name, {"f", "torque"}); }

constexpr int global_data = 0;  // a style of library.h: one number, vector or array; others are of each granule or contact

}  // namespace
}  // namespace solidcull

using namespace solidcull;

extern "C" {

void lammps_close(void* handle) {
  own_lammps_close()(handle);
  forget_program(engine_of(handle));
}

void lammps_file(void* handle, const char* file) {
  const ProgramCall call(engine_of(handle), ProgramCall::By::library);
  own_lammps_file()(handle, file);
}

char* lammps_command(void* handle, const char* command) {
  const ProgramCall call(engine_of(handle), ProgramCall::By::library);
  return own_lammps_command()(handle, command);
}

void* lammps_extract_global(void* handle, const char* name) {
  if (is_one_of(name, {"natoms"})) refuse_part(engine_of(handle), "lammps_extract_global");
  if (is_one_of(name, {"nlocal", "nghost"})) program_takes_pointer(engine_of(handle), "lammps_extract_global");
  return own_lammps_extract_global()(handle, name);
}

void* lammps_extract_atom(void* handle, const char* name) {
  if (is_of_forces(name)) {
    program_keeps_pointer(engine_of(handle), true);
    program_reads(engine_of(handle), true, "lammps_extract_atom");
  } else {
    program_takes_pointer(engine_of(handle), "lammps_extract_atom");
  }
  return own_lammps_extract_atom()(handle, name);
}

void* lammps_extract_compute(void* handle, const char* id, int style, int type) {
  LAMMPS_NS::LAMMPS* const lmp = engine_of(handle);
  program_keeps_pointer(lmp, false);
  program_reads(lmp, false, "lammps_extract_compute");
  FixSolidCull* const fix = fix_of(lmp);
  if (!fix || !fix->bed_is_shown() || !may_need_forces(lmp, id)) return own_lammps_extract_compute()(handle, id, style, type);
  const WholeBedForces forces(lmp, *fix);
  return own_lammps_extract_compute()(handle, id, style, type);
}

void* lammps_extract_fix(void* handle, const char* id, int style, int type, int i, int j) {
  LAMMPS_NS::LAMMPS* const lmp = engine_of(handle);
  if (style != global_data) {
    program_takes_pointer(lmp, "lammps_extract_fix");
  } else {
    refuse_value_of_atoms(lmp, std::string("f_") + id);
    if (fix_reads_granules(lmp, id)) program_reads(lmp, false, "lammps_extract_fix");
  }
  return own_lammps_extract_fix()(handle, id, style, type, i, j);
}

void* lammps_extract_variable(void* handle, char* name, char* group) {
  LAMMPS_NS::LAMMPS* const lmp = engine_of(handle);
  const int number = lmp->input->variable->find(name);
  if (number >= 0 && lmp->input->variable->atomstyle(number)) program_reads(lmp, false, "lammps_extract_variable");
  const ProgramCall call(lmp, ProgramCall::By::library);  // its formula may show the bed
  return own_lammps_extract_variable()(handle, name, group);
}

int lammps_get_natoms(void* handle) {
  refuse_part(engine_of(handle), "lammps_get_natoms");
  return own_lammps_get_natoms()(handle);
}

void lammps_gather_atoms(void* handle, const char* name, int type, int count, void* data) {
  program_reads(engine_of(handle), is_of_forces(name), "lammps_gather_atoms");
  own_lammps_gather_atoms()(handle, name, type, count, data);
}

void lammps_scatter_atoms(void* handle, const char* name, int type, int count, void* data) {
  program_reads(engine_of(handle), false, "lammps_scatter_atoms");
  program_changes(engine_of(handle));
  own_lammps_scatter_atoms()(handle, name, type, count, data);
}
}
