#include "deck_rules.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <vector>

#include "atom.h"
#include "compute.h"
#include "compute_styles.h"
#include "domain.h"
#include "engine_access.h"
#include "fix_insert_pack.h"
#include "fix_multisphere.h"
#include "fix_styles.h"
#include "force.h"
#include "input_error.h"
#include "modify.h"
#include "pair_gran.h"
#include "region.h"
#include "snapshot.h"
#include "update.h"

namespace solidcull {
namespace {

constexpr const char* newton_on = "newton is on: put 'newton off' at the top of the deck";

[[noreturn]] void refuse(const std::string& why) { throw InputError(why); }

/// LIGGGHTS makes some itself, for thermo output.
bool is_of_the_deck(const LAMMPS_NS::Compute* compute) { return std::strncmp(compute->id, "thermo_", 7) != 0; }

std::string named(const LAMMPS_NS::Fix* fix) { return "fix " + std::string(fix->id) + " (" + fix->style + ")"; }
std::string named(const LAMMPS_NS::Compute* compute) {
  return "compute " + std::string(compute->id) + " (" + compute->style + ")";
}

/// f_ID in a line, with the ID that the deck gave.
std::string with_id(std::string line, const std::string& id) {
  for (std::size_t at = line.find("f_ID"); at != std::string::npos; at = line.find("f_ID", at)) line.replace(at, 4, "f_" + id);
  return line;
}

/// Names, of which a line gives the first few.
class Names {
 public:
  void add(const std::string& name) {
    if (++count_ <= most) text_ += (count_ > 1 ? ", " : "") + name;
  }
  bool empty() const { return count_ == 0; }
  std::string text() const { return count_ > most ? text_ + " and " + std::to_string(count_ - most) + " more" : text_; }

 private:
  static constexpr int most = 5;
  int count_ = 0;
  std::string text_;
};

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
  if (!force->pair || std::strcmp(force->pair_style, "gran") != 0)
    refuse("pair_style '" + std::string(force->pair_style) + "' is not granular: use pair_style gran");
  auto* const pair = static_cast<LAMMPS_NS::PairGran*>(force->pair);
  for (const char* model : {"easo/capillary/viscous", "washino/capillary/viscous"})
    if (pair->contact_match("cohesion", model))
      refuse("the liquid of cohesion model " + std::string(model) + " would be lost with the culled granules: use sjkr or sjkr2");
  if (pair->storeContactForces())
    refuse("contact forces are stored per contact (store_force_contact): those of culled granules would be missing");
  refuse_physics_that_would_miss_granules();
  refuse_measures_of_other_physics();
}

bool DeckRules::fills_solid_bodies(const LAMMPS_NS::Fix* fix) const {
  const auto* pack = dynamic_cast<const LAMMPS_NS::FixInsertPack*>(fix);
  const LAMMPS_NS::Region* region = pack ? engine::insertion_region(*pack) : nullptr;
  if (!region) return false;
  const std::vector<const LAMMPS_NS::Region*> parts = engine::parts_of(region, *domain);
  return std::any_of(parts.begin(), parts.end(),
                     [](const LAMMPS_NS::Region* part) { return std::strcmp(part->style, "interface/mesh") == 0; });
}

void DeckRules::refuse_measures_of_other_physics() const {
  for (int c = 0; c < modify->ncompute; ++c) {
    const ComputeStyle& style = measure_of(modify->compute[c]->style);
    if (style.measure == Measure::refused)
      refuse(named(modify->compute[c]) + ": " + style.why + "; leave the compute or the fix out");
  }
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
    if (fills_solid_bodies(fix))
      refuse(name +
             "a region interface/mesh changes while the deck runs, and each rank knows its own part; give the insertion a " +
             "region that stands, it finds room by the granules there");
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
    const bool moves_clumps_alone = dynamic_cast<const LAMMPS_NS::FixMultisphere*>(fix) != nullptr;
    if (style.treatment == Treatment::integrates && !moves_clumps_alone) atoms.movable_bits |= fix->groupbit;
    if (style.treatment == Treatment::holds || style.treatment == Treatment::drives) atoms.held_bits |= fix->groupbit;
    if (style.treatment == Treatment::drives)
      say_once(run, named(fix) + " " + style.why + ": granules of its group are not culled");
  }
  for (int c = 0; c < modify->ncompute; ++c) {
    const LAMMPS_NS::Compute* compute = modify->compute[c];
    const ComputeStyle& style = measure_of(compute->style);
    if (style.measure != Measure::whole || !is_of_the_deck(compute)) continue;
    atoms.held_bits |= compute->groupbit;
    say_once(run, named(compute) + " " + with_id(style.why, own_->id) + ": granules of its group are not culled");
  }
  say_what_sees_atoms_only(run);
  return bits() != before;
}

void DeckRules::say_what_sees_atoms_only(const Run& run) {
  Names of_atoms, of_contacts;
  for (int c = 0; c < modify->ncompute; ++c) {
    const LAMMPS_NS::Compute* compute = modify->compute[c];
    if (!is_of_the_deck(compute)) continue;
    const Measure measure = measure_of(compute->style).measure;
    if (measure == Measure::atoms_only) of_atoms.add(named(compute));
    if (measure == Measure::contacts) of_contacts.add(named(compute));
  }
  for (int f = 0; f < modify->nfix; ++f)
    if (treatment_of(modify->fix[f]->style).treatment == Treatment::atoms_only) of_atoms.add(named(modify->fix[f]));
  if (!of_atoms.empty()) say_once(run, "interior granules are missing in what these measure: " + of_atoms.text());
  if (!of_contacts.empty())
    say_once(run, "contacts inside solid bodies are missing in what these measure: " + of_contacts.text());
}

void DeckRules::say_once(const Run& run, const std::string& line) {
  if (said_.insert(line).second) run.say(line);
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
