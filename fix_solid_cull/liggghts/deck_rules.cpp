#include "deck_rules.h"

#include <array>
#include <cstring>

#include "atom.h"
#include "domain.h"
#include "engine_access.h"
#include "fix_insert.h"
#include "fix_styles.h"
#include "force.h"
#include "input_error.h"
#include "modify.h"
#include "pair_gran.h"
#include "snapshot.h"
#include "update.h"

namespace solidcull {
namespace {

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
  constexpr int minimizing = 2;
  if (update->whichflag == minimizing) refuse("minimize would move atoms only: unfix " + std::string(own_->id) + " first");
  if (std::strstr(update->integrate_style, "verlet") == nullptr)
    refuse("run_style '" + std::string(update->integrate_style) + "' is not supported: use run_style verlet");
  if (!force->pair || std::strncmp(force->pair_style, "gran", 4) != 0)
    refuse("pair_style '" + std::string(force->pair_style) + "' is not granular: use pair_style gran");
  if (static_cast<const LAMMPS_NS::PairGran*>(force->pair)->storeContactForces())
    refuse("contact forces are stored per contact (store_force_contact): those of culled granules would be missing");
  refuse_physics_that_would_miss_granules();
}

void DeckRules::refuse_physics_that_would_miss_granules() const {
  for (int f = 0; f < modify->nfix; ++f) {
    const LAMMPS_NS::Fix* fix = modify->fix[f];
    const std::string name = "fix " + std::string(fix->id) + " " + fix->style + ": ";
    const FixStyle& style = treatment_of(fix->style);
    if (style.treatment == Treatment::refused) refuse(name + style.why + "; leave one of the two fixes out");
    if (fix->box_change_size || fix->box_change_shape)  // a style that is not LIGGGHTS's own
      refuse(name + "it changes the size of the box, and a culled bed cannot follow; leave one of the two fixes out");
    const auto* insertion = dynamic_cast<const LAMMPS_NS::FixInsert*>(fix);
    if (insertion && engine::compresses_tags(*insertion))
      refuse(name + "compress_tags would renumber granules that are culled; say 'compress_tags no'");
  }
}

/// Only what an integrator moves and gravity pulls can be part of a solid body; what another fix holds or drives stays exterior.
bool DeckRules::find_movable(EngineAtoms& atoms, const Run& run) {
  const auto bits = [&] { return std::array<int, 4>{atoms.movable_bits, atoms.held_bits, atoms.gravity_bits, atoms.own_bit}; };
  const auto before = bits();
  atoms.movable_bits = atoms.held_bits = atoms.gravity_bits = 0;
  for (int f = 0; f < modify->nfix; ++f) {
    const LAMMPS_NS::Fix* fix = modify->fix[f];
    if (std::strcmp(fix->style, own_->style) == 0) continue;
    if (std::strcmp(fix->style, "gravity") == 0) atoms.gravity_bits |= fix->groupbit;
    const FixStyle& style = treatment_of(fix->style);
    switch (style.treatment) {
      case Treatment::integrates:
        atoms.movable_bits |= fix->groupbit;
        break;
      case Treatment::drives:
        if (told_.insert(fix->id).second)
          run.say("fix " + std::string(fix->id) + " (" + fix->style + ") " + style.why + ": granules of its group are not culled");
        atoms.held_bits |= fix->groupbit;
        break;
      case Treatment::holds:
        atoms.held_bits |= fix->groupbit;
        break;
      default:
        break;
    }
  }
  return bits() != before;
}

std::string state_that_no_fix_has(LAMMPS_NS::Modify& modify) {
  for (const engine::RestartState& state : engine::restart_states(modify)) {
    if (state.style != "solid/cull") continue;
    const int f = modify.find_fix(state.id.c_str());
    if (f >= 0 && state.style == modify.fix[f]->style) continue;
    const std::string name = "fix " + state.id + " solid/cull: ";
    try {
      const std::int64_t interior = Snapshot::interior_of(Snapshot::from_bytes(state.bytes));
      if (interior > 0)
        return name + "the restart file holds " + std::to_string(interior) +
               " granules of this fix besides the atoms, and they would be lost now: put 'fix " + state.id +
               " GROUP solid/cull ...' right after read_restart and the pair_style";
    } catch (const InputError& e) {
      return name + e.what();
    }
  }
  return "";
}

}  // namespace solidcull
