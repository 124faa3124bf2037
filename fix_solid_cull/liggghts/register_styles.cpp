// Makes the two styles known to an unmodified LIGGGHTS. Fix styles stand in a table; region styles in an if-chain, so the
// engine's own Domain::add_region is interposed (interposed.h). So is the call by which a wall tells its mesh of a contact: loads
// of granules that are put away must be known.
#include <cstring>
#include <string>

#include "deck_commands.h"
#include "deck_rules.h"
#include "domain.h"
#include "engine_access.h"
#include "error.h"
#include "fix_mesh_surface.h"
#include "fix_solid_cull.h"
#include "input.h"
#include "lammps.h"
#include "memory.h"
#include "mesh_loads.h"
#include "mesh_regions.h"
#include "modify.h"
#include "program_calls.h"
#include "region_interface_mesh.h"
#include "restart_files.h"
#include "solidcull.h"
#include "update.h"
#include "variable.h"
#include "wall_contacts.h"
#include "whole_bed_forces.h"
#include "write_restart.h"

namespace {

LAMMPS_NS::Fix* make_fix(LAMMPS_NS::LAMMPS* lmp, int narg, char** arg) { return new solidcull::FixSolidCull(lmp, narg, arg); }

void add_interface_mesh(LAMMPS_NS::LAMMPS* lmp, int narg, char** arg) {
  LAMMPS_NS::Domain* domain = lmp->domain;
  if (domain->find_region(arg[0]) >= 0) lmp->error->all(FLERR, "Reuse of region ID");
  if (domain->nregion == domain->maxregion) {
    domain->maxregion += 4;
    domain->regions = static_cast<LAMMPS_NS::Region**>(lmp->memory->srealloc(
        domain->regions, static_cast<LAMMPS_NS::bigint>(domain->maxregion) * sizeof(LAMMPS_NS::Region*), "domain:regions"));
  }
  LAMMPS_NS::Region* region = new solidcull::RegInterfaceMesh(lmp, narg, arg);
  domain->regions[domain->nregion] = region;
  region->init();
  domain->nregion++;
}

}  // namespace

namespace LAMMPS_NS {

using solidcull::engine::Call;
using solidcull::engine::own;

void Modify::add_fix(int narg, char** arg, char* suffix) {
  using Original = void (*)(Modify*, int, char**, char*);
  static const auto original = own<Call::add_fix, Original>();
  solidcull::engine::fix_styles(*this)["solid/cull"] = make_fix;
  const std::string refused = solidcull::why_no_interface_mesh_for_fix(lmp, narg, arg);
  if (!refused.empty()) error->all(FLERR, refused.c_str());
  if (narg > 2) solidcull::WallContacts::fix_was_made(arg[2]);
  original(this, narg, arg, suffix);
}

/// The engine forgets here what a restart file holds for fixes that the deck has not made: culled granules would be lost.
/// Before anything of a run is set up.
void Modify::init() {
  using Original = void (*)(Modify*);
  static const auto original = own<Call::begin_run, Original>();
  const std::string lost = solidcull::state_that_no_fix_has(*this);
  if (!lost.empty()) error->all(FLERR, lost.c_str());
  constexpr int between_runs = 0;
  if (update->whichflag != between_runs) solidcull::run_begins(lmp);
  original(this);
}

/// delete_atoms asks whether there are contact histories, to take them from the neighbour lists.
int Modify::n_fixes_style_strict(const char* style) {
  using Original = int (*)(Modify*, const char*);
  static const auto original = own<Call::count_fixes, Original>();
  if (std::strcmp(style, "contacthistory") == 0 && solidcull::leaves_histories()) return 0;
  return original(this, style);
}

/// Each command of a deck, however it comes.
int Input::execute_command() {
  using Original = int (*)(Input*);
  static const auto original = own<Call::deck_command, Original>();
  const solidcull::MetCommand met(lmp, command, command_map->count(command) > 0, arg, narg);
  return original(this);
}

// How a program has commands done; the engine does too, within one of these.
char* Input::one(const char* command) {
  using Original = char* (*)(Input*, const char*);
  static const auto original = own<Call::one_command, Original>();
  const solidcull::ProgramCall call(lmp, solidcull::ProgramCall::By::classes);
  return original(this, command);
}

void Input::file(const char* name) {
  using Original = void (*)(Input*, const char*);
  static const auto original = own<Call::named_deck, Original>();
  const solidcull::ProgramCall call(lmp, solidcull::ProgramCall::By::classes);
  original(this, name);
}

void Input::file() {
  using Original = void (*)(Input*);
  static const auto original = own<Call::own_deck, Original>();
  using By = solidcull::ProgramCall::By;
  const solidcull::ProgramCall call(lmp, solidcull::is_own_program() ? By::library : By::classes);
  original(this);
}

/// Formulas are evaluated between runs too, where a command names a variable.
double Variable::evaluate(char* str, Tree** tree) {
  using Original = double (*)(Variable*, char*, Tree**);
  static const auto original = own<Call::formula, Original>();
  solidcull::met_formula(lmp, str);
  return original(this, str, tree);
}

void Domain::add_region(int narg, char** arg) {
  using Original = void (*)(Domain*, int, char**);
  static const auto original = own<Call::add_region, Original>();
  if (narg >= 2 && std::strcmp(arg[1], "interface/mesh") == 0)
    add_interface_mesh(lmp, narg, arg);
  else
    original(this, narg, arg);
  solidcull::region_was_made(lmp, narg, arg);
}

/// What is culled goes to the end of the file, which has its name when it is whole.
void WriteRestart::write(char* file) {
  using Original = void (*)(WriteRestart*, char*);
  static const auto original = own<Call::write_restart, Original>();
  solidcull::RestartFile whole(lmp, file);
  original(this, whole.name());
  whole.finish();
}

void FixMeshSurface::add_particle_contribution(int ip, double* frc, double* delta, int iTri, double* v_wall) {
  using Original = void (*)(FixMeshSurface*, int, double*, double*, int, double*);
  static const auto original = own<Call::mesh_contact, Original>();
  if (solidcull::WholeBedForces::at_work()) return;
  solidcull::MeshLoads::contact(this, ip, frc, delta, iTri);
  original(this, ip, frc, delta, iTri, v_wall);
}

}  // namespace LAMMPS_NS

extern "C" {

void solidcull_register(void* lammps) {
  auto* lmp = static_cast<LAMMPS_NS::LAMMPS*>(lammps);
  solidcull::engine::fix_styles(*lmp->modify)["solid/cull"] = make_fix;
}

const char* solidcull_version(void) { return SOLIDCULL_VERSION; }
}
