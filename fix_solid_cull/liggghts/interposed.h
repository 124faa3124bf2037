// The engine's functions that this library puts its own in place of: it comes first in the search for symbols, and asks for the
// next. This is the one list of those that a run rests on. An interposer finds the engine's own function through it; the fix
// refuses an engine whose calls do not arrive here (interpositions.h); and engine.cmake reads the symbols when an engine is
// chosen.
#pragma once

#include <stdexcept>

namespace solidcull::engine {

enum class Call {
  add_fix,
  begin_run,
  count_fixes,
  deck_command,
  one_command,
  named_deck,
  own_deck,
  formula,
  add_region,
  mesh_contact,
  neighbor_build,
  write_restart
};

struct Interposed {
  Call call;
  const char* symbol;  // as the linker knows it
  const char* name;    // as a user may read it
};

inline constexpr Interposed interposed[] = {
    {Call::add_fix, "_ZN9LAMMPS_NS6Modify7add_fixEiPPcS1_", "Modify::add_fix"},
    {Call::begin_run, "_ZN9LAMMPS_NS6Modify4initEv", "Modify::init"},
    {Call::count_fixes, "_ZN9LAMMPS_NS6Modify20n_fixes_style_strictEPKc", "Modify::n_fixes_style_strict"},
    {Call::deck_command, "_ZN9LAMMPS_NS5Input15execute_commandEv", "Input::execute_command"},
    {Call::one_command, "_ZN9LAMMPS_NS5Input3oneEPKc", "Input::one"},
    {Call::named_deck, "_ZN9LAMMPS_NS5Input4fileEPKc", "Input::file(name)"},
    {Call::own_deck, "_ZN9LAMMPS_NS5Input4fileEv", "Input::file"},
    {Call::formula, "_ZN9LAMMPS_NS8Variable8evaluateEPcPPNS0_4TreeE", "Variable::evaluate"},
    {Call::add_region, "_ZN9LAMMPS_NS6Domain10add_regionEiPPc", "Domain::add_region"},
    {Call::mesh_contact, "_ZN9LAMMPS_NS14FixMeshSurface25add_particle_contributionEiPdS1_iS1_",
     "FixMeshSurface::add_particle_contribution"},
    {Call::neighbor_build, "_ZN9LAMMPS_NS8Neighbor22granular_bin_no_newtonEPNS_9NeighListE", "Neighbor::granular_bin_no_newton"},
    {Call::write_restart, "_ZN9LAMMPS_NS12WriteRestart5writeEPc", "WriteRestart::write"},
};

/// Where it is asked for in a constant expression, a call that is not in the list does not compile.
constexpr const char* symbol_of(Call call) {
  for (const Interposed& row : interposed)
    if (row.call == call) return row.symbol;
  throw std::logic_error("not in the list of interposed calls");
}

}  // namespace solidcull::engine
