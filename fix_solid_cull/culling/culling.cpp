// The pipelines of a run's beginning, of a step, and between runs; looks and membership changes have files of their own. Each
// step of a pipeline has its own class.
#include "culling.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "body_changes.h"
#include "input_error.h"
#include "numbers.h"
#include "word_sum.h"

namespace solidcull {
namespace {

// in a run that starts with an empty box, steps between two tries to find granules to take the scales from
constexpr int first_granules_every = 50;

}  // namespace

void Culling::expect(std::initializer_list<Phase> phases, const char* where) const {
  if (std::find(phases.begin(), phases.end(), phase_) != phases.end()) return;
  static const char* names[] = {"between runs", "at the beginning of a run", "before the first step", "in a time step"};
  throw InternalError(std::string(where) + " was called " + names[static_cast<int>(phase_)]);
}

// ------------------------------------------------------------------------------------------------------------ a run begins

void Culling::begin_run() {
  const std::vector<bool> flips = p_.ports.contacts.flips();
  if (!p_.solid.set_histories(flips, p_.ports.contacts.vectors()))
    throw InputError("the contact model's history has changed from " + std::to_string(p_.solid.contacts().width()) + " to " +
                     std::to_string(flips.size()) + " numbers while granules are culled: unfix " + p_.ports.run.name +
                     " before the pair_style changes");
  if (!p_.solid.set_granules_turn(p_.ports.contacts.turn_granules))
    throw InputError(
        "the contact model has, or had, neither friction nor rolling friction, and changes while granules are culled: "
        "unfix " +
        p_.ports.run.name + " before the pair_style changes");
  p_.ports.ranks.update();
  Vec3 periods = p_.ports.run.edges();
  for (int d = 0; d < 3; ++d)
    if (!p_.ports.run.periodic[d]) periods[d] = 0;
  p_.solid.set_periods(periods);
  p_.report.membership_changed();  // the deck may have made granules, or deleted some
  p_.files.begin_run();
  phase_ = Phase::beginning;
}

void Culling::refuse_what_lies_too_far() const {
  // twice the way to the farthest corner: places wait in the frames of bodies that may have moved through the box
  const Vec3 corner = p_.ports.run.box.lo.cwiseAbs().cwiseMax(p_.ports.run.box.hi.cwiseAbs());
  const double far = 2 * corner.norm(), d = p_.scales.diameter();
  const double farthest = p_.scales.compact() ? GranuleStore::farthest * 2 * d : Sites(d).farthest();
  if (far <= farthest) return;
  char told[64];
  std::snprintf(told, sizeof told, "%.4g m from the origin, and the box reaches %.4g m", farthest / 2, far / 2);
  throw InputError("store " + std::string(p_.scales.compact() ? "compact keeps places" : "none has sites") + " up to " +
                   std::string(told) + ": move the origin to the granules, or use store exact");
}

void Culling::find_scales() {
  double diameter = p_.scales.diameter(), gravity = p_.scales.gravity();
  if (diameter == 0) {
    double sums[2] = {0, 0};
    const Atoms& atoms = p_.ports.atoms;
    for (int i = 0; i < atoms.owned; ++i)
      if (atoms.groups[i] & atoms.own_bit) {
        sums[0] += 2 * atoms.radius[i];
        sums[1] += 1;
      }
    p_.ports.ranks.sum(sums, 2);
    if (sums[1] > 0) diameter = sums[0] / sums[1];
  }
  const double g = p_.ports.run.gravity().norm();
  if (g > 0) gravity = g;
  if (gravity == 0) {
    gravity = Scales::standard_gravity;
    p_.ports.run.say("the deck has no fix gravity; 'speed' and 'tolerance' are measured with 9.81 m/s^2");
  }
  p_.scales.set(diameter, gravity);
  if (diameter == 0) return;  // an empty box: the first granules set the scale
  p_.scales.make_laws(p_.ports.run.dt);
  if (p_.solid.has_store()) return;
  if (p_.scales.image_by_place()) refuse_what_lies_too_far();
  p_.solid.open_store();
  if (Invariants::asked()) p_.solid.pack_contacts_from(0);  // so that small scenes try it too
}

void Culling::set_up_atoms() {
  expect({Phase::beginning}, "set_up_atoms");
  if (p_.shown.shown()) return;  // no run: a command of the deck sets up what it needs
  check_numbers(p_.ports.atoms);
  find_scales();
  if (!p_.solid.has_store()) return;
  // a restart file keeps groups: marks of granules that this fix does not hold would hide their contacts
  for (int i = 0; i < p_.ports.atoms.owned; ++i)
    if (!p_.shell[i].locked) p_.ports.atoms.mark_interface(i, false);
  if (p_.snapshot.waits()) {
    p_.snapshot.take_up();
    count_restored();
    // this deck may hold or drive what the one before did not
    p_.exchange.set_stored_groups(p_.claims.wake_claimed());
  }
  const bool other_walls = p_.walls.walls_are_others();
  if (other_walls) granules_may_change();
  take_changes(other_walls);
  p_.closure.begin_run(other_walls);
  change();
  p_.closure.run_has_begun();
  walls_are_felt_ = !other_walls;
}

void Culling::is_set_up() {
  expect({Phase::beginning}, "is_set_up");
  // other fixes add their forces later: the loads are taken at the start of the first step
  phase_ = Phase::ready;
  if (p_.solid.has_store()) p_.files.write_due();  // as the engine's dumps show where a run begins
}

void Culling::initial_step() {
  // `run … pre no` goes on without a setup
  expect({Phase::ready, Phase::stepping, Phase::between_runs}, "initial_step");
  const bool first = phase_ == Phase::ready;
  phase_ = Phase::stepping;
  if (!first || !p_.solid.has_store()) return;
  p_.meter.begin_run(p_.report.seconds());
  take_loads();
  p_.gravity.begin_run();
  see_walls(true);
  open_for_insertion(p_.ports.run.step);
  const std::int64_t step = p_.ports.run.step;
  if (p_.ports.ranks.any(p_.wake.any_here())) ask_for_build(step);
  p_.pacing.begin_run(step, p_.census.something_locked());
  if (p_.pacing.looks_at_once()) look_at_once();
  if (p_.ports.ranks.any(proposal_dropped_)) p_.pacing.look_earlier(step);
  proposal_dropped_ = false;
}

// ------------------------------------------------------------------------------------------------------------ a time step

void Culling::integrate() {
  expect({Phase::stepping}, "integrate");
  if (!p_.solid.has_store() || !p_.scales.rigid() || (p_.ports.ranks.count == 1 && p_.motion.active().empty())) return;
  const auto timed = p_.report.time(Part::load);
  p_.motion.kick_and_drift();
  p_.motion.place();
  // the engine looks at its atoms only: a body that has none would come near something unseen
  if ((p_.ports.ranks.count == 1 || bodies_are_fast_) && p_.ports.ranks.any(p_.motion.comes_too_far(0)))
    p_.ports.run.ask_for_reneighbouring(p_.ports.run.step);
}

void Culling::take_neighbours() {
  p_.motion.is_stale();
  lists_are_new();
  if (!p_.solid.has_store()) return;
  if (p_.census.something_locked())
    take_arrivals();
  else
    p_.groups.forget_ghosts();
  // the box followed the granules: stored ones go to the rank that has their place now, before anything comes near them
  if (p_.census.something_stored() && p_.ports.ranks.any(p_.ports.ranks.subdomain_changed()))
    p_.ports.run.ask_for_reneighbouring(p_.ports.run.step + 1);
  if (Invariants::asked()) p_.invariants.check();
}

/// Interface granules may have come from other ranks, or left the box.
void Culling::take_arrivals() {
  p_.lost.add(p_.handover.take_over());
  if (p_.lost.forget_lost()) settle_bodies();
  p_.groups.share();
}

void Culling::settle_bodies() {
  p_.groups.settle();
  p_.census.count_bodies();
  label_bodies(p_.ports.atoms, p_.shell, p_.groups);
  p_.motion.is_stale();
}

void Culling::leave_out_inner_pairs() {
  if (!inner_pairs_listed_) return;
  inner_pairs_listed_ = false;
  p_.meter.lists_are_new();
  if (!p_.census.something_locked()) return;
  const auto timed = p_.report.time(Part::load);
  std::vector<int> body(static_cast<std::size_t>(p_.ports.atoms.owned + p_.ports.atoms.ghosts));
  for (std::size_t i = 0; i < body.size(); ++i) body[i] = p_.groups.key_of_atom(static_cast<int>(i));
  p_.ports.contacts.leave_out_pairs_within(body);
}

/// A granule that goes to the store takes its loads on walls along: before that it is locked, or was chosen by a look.
bool Culling::may_ask_for_wall_loads() const {
  if (phase_ != Phase::stepping) return true;
  return p_.scales.sleeping() && (p_.census.something_locked() || proposal_.any_here() || p_.pacing.due(p_.ports.run.step));
}

void Culling::take_loads() {
  const auto timed = p_.report.time(Part::load);
  p_.motion.refresh();
  p_.freezing.rebase_thawed();
  p_.motion.take_loads();
  if (p_.scales.sleeping()) p_.grounding.press_on_walls();
}

void Culling::take_forces() {
  expect({Phase::stepping}, "take_forces");
  const std::int64_t step = p_.ports.run.step;
  if (!p_.solid.has_store()) {  // the run started with an empty box: the first granules that are poured set the scales
    if (step % first_granules_every == 0) find_scales();
    if (!p_.solid.has_store()) return;
    p_.pacing.begin_within_run(step);
  }
  p_.meter.count_step(p_.report.seconds());
  if (p_.census.something_locked() || !loads_are_none_) take_loads();
  loads_are_none_ = !p_.census.something_locked();
  store_what_feels_walls();
  collect_wakes();
  if (p_.pacing.due(step)) {
    look();
    if (p_.ports.ranks.any(p_.wake.any_here())) ask_for_build(step + 1);
  }
  open_for_insertion(step + 1);
}

/// What came out of the store because walls may be others feels them now, and goes back: there may be very many, and a look is
/// some steps away.
void Culling::store_what_feels_walls() {
  if (walls_are_felt_) return;
  walls_are_felt_ = true;
  const bool asked = p_.scales.sleeping() && p_.closure.ask_to_store(p_.motion.interface_atoms());
  if (p_.ports.ranks.any(asked)) ask_for_build(p_.ports.run.step + 1);
}

/// Gentle loads wait for each other; a blow does not.
void Culling::collect_wakes() {
  if (!p_.census.something_locked()) return;
  const Ranks& ranks = p_.ports.ranks;
  const int period = p_.pacing.wake_period();
  const bool blow = p_.motion.largest_excess() > Pacing::blow;
  if (!p_.pacing.wakes_now(p_.ports.run.step) && !ranks.any(blow)) return;
  bool waking = false;
  for (const int i : p_.motion.interface_atoms()) {
    const double excess = p_.shell.take_excess(i);
    if (excess <= 1) continue;
    p_.wake.ask_by_load(p_.ports.atoms.place(i), p_.scales.wake_up().radius(excess));
    waking = true;
  }
  const bool rigid = p_.scales.rigid();
  std::int64_t asked[2] = {waking || (rigid && p_.motion.comes_too_far(period + 1)), rigid && p_.motion.is_fast(period + 1)};
  ranks.largest(asked, 2);
  if (asked[0]) ask_for_build(p_.ports.run.step + 1);
  bodies_are_fast_ = asked[1] != 0;
}

void Culling::finish_step() {
  expect({Phase::stepping}, "finish_step");
  if (!p_.solid.has_store() || !p_.scales.rigid() || p_.motion.active().empty()) return;
  const auto timed = p_.report.time(Part::load);
  p_.motion.kick();
  p_.motion.give_velocities_to_riders();
}

void Culling::write_outputs() {
  expect({Phase::stepping}, "write_outputs");
  if (p_.solid.has_store()) p_.files.write_due();
}

void Culling::end_run() {
  p_.walls.remember_walls();
  if (p_.solid.has_store()) p_.run_end.tell();
  if (phase_ == Phase::stepping) phase_ = Phase::between_runs;  // after `run 0` the first step is still to come, if `pre no`
}

/// The only place where the rebuilds that this fix asks for are counted.
void Culling::ask_for_build(std::int64_t step) {
  if (p_.ports.run.ask_for_reneighbouring(step)) p_.pacing.count_build();
}

// ------------------------------------------------------------------------------------------------------------ between runs

/// Atoms come and go now: neighbour lists, which name them by their indices, and ghosts are void until the next run sets up.
void Culling::leave_lists() {
  p_.ports.contacts.bring_histories_up_to_date();
  p_.ports.contacts.forget_neighbours();
  p_.ports.atoms.drop_ghosts();
}

void Culling::show_bed() {
  if (!p_.solid.has_store() || !p_.census.something_locked() || p_.shown.shown()) return;
  leave_lists();
  p_.lost.remember();
  p_.shown.show();
  p_.ports.atoms.count_more(p_.census.stored());
  show_unfinished_ = true;
}

void Culling::finish_show() {
  if (!show_unfinished_) return;
  show_unfinished_ = false;
  p_.ports.ranks.update();
  p_.ports.atoms.publish_counts(0);
}

void Culling::lend_contacts() {
  p_.ports.memory.give_bins_back();
  p_.shown.give_contacts();
}

void Culling::take_contacts_back() {
  leave_lists();
  p_.shown.take_contacts();
  p_.ports.atoms.publish_counts(0);
}

void Culling::granules_may_change() {
  proposal_dropped_ = proposal_dropped_ || proposal_.any_here();
  proposal_ = {};
}

std::uint64_t Culling::sum_of_granules() const {
  WordSum sum;
  const Atoms& atoms = p_.ports.atoms;
  for (int i = 0; i < atoms.owned; ++i) {
    for (const Vec3& v : {atoms.place(i), atoms.velocity(i), atoms.spin(i)})
      for (int d = 0; d < 3; ++d) sum.add(v[d]);
    for (const double x : {atoms.radius[i], atoms.mass[i], double(atoms.type[i]), double(atoms.groups[i])}) sum.add(x);
  }
  return sum.value();
}

void Culling::remember_granules() {
  if (proposal_.any_here()) granules_sum_ = sum_of_granules();
}

void Culling::see_granules_again() {
  if (proposal_.any_here() && granules_sum_ != sum_of_granules()) granules_may_change();
}

bool Culling::culls_of(int groups) const {
  if (!p_.census.something_locked()) return false;
  int culled = p_.shown.shown() ? ~0 : p_.exchange.stored_groups();
  const Atoms& atoms = p_.ports.atoms;
  for (int i = 0; i < atoms.owned; ++i)
    if (p_.shell.locked(i)) culled |= atoms.groups[i];
  return p_.ports.ranks.any((culled & groups) != 0);
}

void Culling::hide_bed() {
  if (!p_.shown.shown()) return;
  finish_show();
  hide_guests();
  p_.ports.atoms.publish_counts(-p_.census.stored());
}

void Culling::hide_guests() {
  p_.shown.hide();
  p_.exchange.set_stored_groups(p_.shown.groups_of_guests());
}

/// What the deck did to culled granules between runs.
void Culling::take_changes(bool other_walls) {
  if (!p_.shown.changed()) return;
  if (p_.lost.forget_lost()) settle_bodies();
  p_.closure.begin_run(other_walls);
  change();
  p_.shown.give_changes();
  take_arrivals();
}

// ------------------------------------------------------------------------------------------------------------ insertion

/// Fixes that insert check for overlap with atoms only: where they put granules, stored ones become atoms in the change at this
/// step, the one before, so that ranks see each other's.
void Culling::open_for_insertion(std::int64_t step) {
  if (p_.census.something_stored() && p_.ports.insertions.any_due(step + 1 + p_.ports.run.reset_by))
    p_.ports.run.ask_for_reneighbouring(step);
}

/// What was made inside a stored granule cannot stay. Stored ones come back for each fix that inserts, so nothing that LIGGGHTS
/// does is known to come here; but between runs a deck may make granules anywhere, and fixes need not look for overlap. What was
/// culled there wakes before the first force: a blow is shared by two. Before anything comes out of the store.
void Culling::meet_new_granules() {
  if (p_.census.something_locked()) {
    const ShellClosure::Overlapped found = p_.closure.by_new_granules();
    if (found.in_stored && phase_ == Phase::stepping)
      throw InputError("granule " + std::to_string(found.in_stored) +
                       " was inserted into the place of a culled one: give the insertion a region above the bed, or unfix " +
                       p_.ports.run.name + " first");
    for (const Vec3& place : found.places) p_.wake.ask(place, p_.scales.wake_up().radius(1));
  }
  p_.closure.forget_new();
}

// ------------------------------------------------------------------------------------------------------------ state

double Culling::largest_radius(int type) const {
  const std::vector<double>& largest = p_.solid.largest_radius_by_type();
  return type >= 0 && type < static_cast<int>(largest.size()) ? largest[static_cast<std::size_t>(type)] : 0.0;
}

void Culling::hold_meshes() {
  interface_meshes();
  p_.meshes.hold();
}

const std::map<int, InterfaceMesh>& Culling::interface_meshes() {
  const bool stand_in = p_.shown.shown() && p_.meshes.behind();
  if (stand_in) p_.shown.stand_in_for_missing(p_.arrivals);
  const auto& meshes = p_.files.ask_meshes();
  if (stand_in) p_.arrivals.clear();
  return meshes;
}

std::vector<double> Culling::restart_state() {
  // the command write_restart exchanges atoms, and builds no neighbour lists
  if (phase_ == Phase::beginning && p_.solid.has_store()) take_arrivals();
  std::vector<double> state = p_.snapshot.write();
  const std::int64_t interior = state.empty() ? 0 : Snapshot::interior_of(state);
  if (interior > 0 && (phase_ == Phase::beginning || !told_of_file_))
    p_.ports.run.say("the restart file holds " + std::to_string(interior) +
                     " interior granules besides the atoms: a deck that reads it needs a fix solid/cull of the same ID");
  told_of_file_ = phase_ != Phase::beginning;
  return state;
}

void Culling::enclose_stored(Box& box) const {
  if (p_.solid.has_store()) p_.stored.enclose(box);
}

double Culling::memory_bytes() const { return static_cast<double>(p_.shell.bytes() + p_.solid.memory_bytes()); }

}  // namespace solidcull
