#include "deck_rules.h"

#include <cstring>

#include "atom.h"
#include "domain.h"
#include "engine_access.h"
#include "fix_insert.h"
#include "force.h"
#include "input_error.h"
#include "modify.h"
#include "pair_gran.h"
#include "update.h"

namespace solidcull {
namespace {

bool begins(const LAMMPS_NS::Fix* fix, const char* style) { return std::strncmp(fix->style, style, std::strlen(style)) == 0; }

struct Physics {
  const char* style;
  const char* why;
};
// physics that culled granules would miss; the styles are prefixes
constexpr Physics missed[] = {
    {"heat/gran", "heat conduction would miss the culled granules"},
    {"couple/", "a coupled solver would miss the culled granules"},
    {"sph/", "SPH would miss the culled granules"},
    {"adapt", "radii that change (fix adapt) would leave the culled granules behind"},
    {"multisphere", "multisphere clumps are not supported yet"},
    {"rigid", "rigid clumps of granules are not supported yet"},
    {"nve/asphere", "aspherical granules are not supported"},
    {"nve/superquadric", "superquadric granules are not supported"},
    {"deform", "the box changes its size: a culled bed cannot follow"},
    {"bond", "bonds would miss the culled granules"},
};
// what these hold stays where they hold it; what those drive would miss its force
constexpr const char* holding[] = {"freeze", "setforce", "move", "planeforce", "lineforce", "aveforce"};
constexpr const char* driving[] = {"addforce", "drag", "efield", "spring", "buoyancy"};

constexpr const char* newton_on = "newton is on: put 'newton off' at the top of the deck";

[[noreturn]] void refuse(const std::string& why) { throw InputError(why); }

}  // namespace

void DeckRules::refuse_what_was_set_up_wrongly() const {
  if (domain->triclinic) refuse("the box is triclinic: use an orthogonal one");
  if (force->newton_pair) refuse(newton_on);
  if (!atom->radius_flag || !atom->rmass_flag || !atom->omega_flag || !atom->sphere_flag)
    refuse("atom style '" + std::string(atom->atom_style) + "' has no granules: use atom_style granular");
  if (!atom->tag_enable) refuse("atoms have no tags: use an atom style that has them, as granular does");
  for (int f = 0; f < modify->nfix; ++f) {
    const LAMMPS_NS::Fix* fix = modify->fix[f];
    if (fix && std::strcmp(fix->style, own_->style) == 0 && std::strcmp(fix->id, own_->id) != 0)
      refuse("fix " + std::string(fix->id) + " is a solid/cull already: give one fix a group that holds all granules");
  }
}

void DeckRules::refuse_what_cannot_be_culled() const {
  if (force->newton_pair) refuse(newton_on);
  if (std::strstr(update->integrate_style, "verlet") == nullptr)
    refuse("run_style '" + std::string(update->integrate_style) + "' is not supported: use run_style verlet");
  if (!force->pair || std::strncmp(force->pair_style, "gran", 4) != 0)
    refuse("pair_style '" + std::string(force->pair_style) + "' is not granular: use pair_style gran");
  if (domain->box_change_size || domain->box_change_shape)
    refuse("the box changes its size (fix deform, press/berendsen, ...): a culled bed cannot follow; leave that fix out");
  if (static_cast<const LAMMPS_NS::PairGran*>(force->pair)->storeContactForces())
    refuse("contact forces are stored per contact (store_force_contact): those of culled granules would be missing");
  refuse_physics_that_would_miss_granules();
}

void DeckRules::refuse_physics_that_would_miss_granules() const {
  for (int f = 0; f < modify->nfix; ++f) {
    const LAMMPS_NS::Fix* fix = modify->fix[f];
    const std::string name = "fix " + std::string(fix->id) + " " + fix->style + ": ";
    for (const Physics& p : missed)
      if (begins(fix, p.style)) refuse(name + p.why + "; leave one of the two fixes out");
    if (begins(fix, "insert/") && engine::compresses_tags(*static_cast<const LAMMPS_NS::FixInsert*>(fix)))
      refuse(name + "compress_tags would renumber granules that are culled; say 'compress_tags no'");
  }
}

/// Only what an integrator moves and gravity pulls can be part of a solid body; what another fix holds or drives stays exterior.
void DeckRules::find_movable(EngineAtoms& atoms, const Run& run) const {
  atoms.movable_bits = atoms.held_bits = atoms.gravity_bits = 0;
  for (int f = 0; f < modify->nfix; ++f) {
    const LAMMPS_NS::Fix* fix = modify->fix[f];
    if (begins(fix, "nve")) atoms.movable_bits |= fix->groupbit;
    if (begins(fix, "gravity")) atoms.gravity_bits |= fix->groupbit;
    for (const char* style : holding)
      if (begins(fix, style) && !begins(fix, "move/mesh")) atoms.held_bits |= fix->groupbit;
    for (const char* style : driving)
      if (begins(fix, style)) {
        atoms.held_bits |= fix->groupbit;
        run.say("fix " + std::string(fix->id) + " (" + fix->style +
                ") adds forces that culled granules would miss: granules of its group are not culled");
      }
  }
}

}  // namespace solidcull
