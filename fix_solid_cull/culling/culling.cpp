// The pipelines of a run's beginning and of a step; looks, membership changes and what happens between runs have classes of their
// own, and so has each step of a pipeline.
#include "culling.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "input_error.h"
#include "numbers.h"
#include "uneven_ranks.h"

namespace solidcull {
namespace {

// in a run that starts with an empty box, steps between two tries to find granules to take the scales from
constexpr int first_granules_every = 50;
// what a step has brought on any rank: a load change that does not wait, whether neighbour lists are to be built, and whether
// bodies that stand bear something else
constexpr unsigned blow_bit = 1, build_bit = 2, load_bit = 4;

}  // namespace

void Culling::expect(std::initializer_list<Phase> phases, const char* where) const {
  if (std::find(phases.begin(), phases.end(), phase_) != phases.end()) return;
  static const char* names[] = {"between runs", "at the beginning of a run", "before the first step", "in a time step"};
  throw InternalError(std::string(where) + " was called " + names[static_cast<int>(phase_)]);
}

// ------------------------------------------------------------------------------------------------------------ a run begins

void Culling::begin_run() {
  const std::vector<bool> flips = bed_.contacts.flips();
  if (!bed_.solid.set_histories(flips, bed_.contacts.vectors()))
    throw InputError("the contact model's history has changed from " + std::to_string(bed_.solid.contacts().width()) + " to " +
                     std::to_string(flips.size()) + " numbers while granules are culled: unfix " + bed_.run.name +
                     " before the pair_style changes");
  if (!bed_.solid.set_granules_turn(bed_.contacts.turn_granules))
    throw InputError(
        "the contact model has, or had, neither friction nor rolling friction, and changes while granules are culled: "
        "unfix " +
        bed_.run.name + " before the pair_style changes");
  if (bed_.clumps.possible && bed_.scales.refills())
    throw InputError("store none has sites for spheres, not for clumps: use store exact or store compact");
  bed_.ranks.update();
  Vec3 periods = bed_.run.edges();
  for (int d = 0; d < 3; ++d)
    if (!bed_.run.periodic[d]) periods[d] = 0;
  bed_.solid.set_periods(periods);
  if (p_.snapshot.waits() || bed_.census.something_stored()) {
    const std::vector<double>& by_type = bed_.solid.largest_radius_by_type();
    double largest = *std::max_element(by_type.begin(), by_type.end());
    bed_.ranks.largest(&largest, 1);  // a rank may have had none
    bed_.memory.expect_stored(largest);
  }
  p_.report.membership_changed();  // the deck may have made granules, or deleted some
  p_.files.begin_run();
  phase_ = Phase::beginning;
}

void Culling::refuse_what_lies_too_far() const {
  // twice the way to the farthest corner: places wait in the frames of bodies that may have moved through the box
  const Vec3 corner = bed_.run.box.lo.cwiseAbs().cwiseMax(bed_.run.box.hi.cwiseAbs());
  const double far = 2 * corner.norm(), d = bed_.scales.diameter();
  const double farthest = bed_.scales.compact() ? GranuleStore::farthest * 2 * d : Sites(d).farthest();
  if (far <= farthest) return;
  char told[64];
  std::snprintf(told, sizeof told, "%.4g m from the origin, and the box reaches %.4g m", farthest / 2, far / 2);
  throw InputError("store " + std::string(bed_.scales.compact() ? "compact keeps places" : "none has sites") + " up to " +
                   std::string(told) + ": move the origin to the granules, or use store exact");
}

void Culling::find_scales() {
  double diameter = bed_.scales.diameter(), gravity = bed_.scales.gravity();
  if (diameter == 0) {
    double sums[2] = {0, 0};
    const Atoms& atoms = bed_.atoms;
    for (int i = 0; i < atoms.owned; ++i)
      if (atoms.groups[i] & atoms.own_bit) {
        sums[0] += 2 * atoms.radius[i];
        sums[1] += 1;
      }
    bed_.ranks.sum(sums, 2);
    if (sums[1] > 0) diameter = sums[0] / sums[1];
  }
  const double g = bed_.run.gravity().norm();
  if (g > 0) gravity = g;
  if (gravity == 0) {
    gravity = Scales::standard_gravity;
    bed_.run.say("the deck has no fix gravity; 'speed' and 'tolerance' are measured with 9.81 m/s^2");
  }
  bed_.scales.set(diameter, gravity);
  if (diameter == 0) return;  // an empty box: the first granules set the scale
  bed_.scales.make_laws(bed_.run.dt);
  if (bed_.solid.has_store()) return;
  if (bed_.scales.image_by_place()) refuse_what_lies_too_far();
  bed_.solid.open_store();
  if (Invariants::asked()) bed_.solid.pack_contacts_from(0);  // so that small scenes try it too
}

void Culling::set_up_atoms() {
  expect({Phase::beginning}, "set_up_atoms");
  if (p_.shown.shown()) return;  // no run: a command of the deck sets up what it needs
  check_numbers(bed_.atoms);
  find_scales();
  if (!bed_.solid.has_store()) return;
  // a restart file keeps groups: marks of granules that this fix does not hold would hide their contacts
  for (int i = 0; i < bed_.atoms.owned; ++i)
    if (!bed_.shell[i].locked) bed_.atoms.mark_interface(i, false);
  bed_.see_largest_radius();
  bed_.ranks.expect_far_out(true);  // the deck may have moved anything anywhere
  if (p_.snapshot.waits()) {
    p_.snapshot.take_up();
    if (p_.snapshot.walls_are_as_they_were()) p_.walls.remember_walls();
    change_.count_restored();
    // this deck may hold or drive what the one before did not
    p_.exchange.set_stored_groups(p_.claims.wake_claimed());
  }
  const bool other_walls = p_.walls.walls_are_others();
  if (other_walls) look_.granules_may_change();
  between_.take_changes(other_walls);
  p_.closure.begin_run(other_walls);
  change();
  p_.closure.end_setup();
  tell_uneven_ranks();
}

void Culling::tell_uneven_ranks() {
  const std::string line = uneven_ranks(bed_);
  if (!line.empty() && told_.empty()) bed_.run.say(line);
  told_ = line;
}

void Culling::end_setup() {
  expect({Phase::beginning}, "end_setup");
  // other fixes add their forces later: the loads are taken at the start of the first step
  phase_ = Phase::ready;
  if (bed_.solid.has_store()) p_.files.write_due();  // as the engine's dumps show where a run begins
}

void Culling::initial_step() {
  // `run … pre no` goes on without a setup
  expect({Phase::ready, Phase::stepping, Phase::between_runs}, "initial_step");
  const bool first = phase_ == Phase::ready;
  phase_ = Phase::stepping;
  if (!first || !bed_.solid.has_store()) return;
  p_.meter.begin_run(p_.report.seconds());
  p_.forecaster.begin_run();
  p_.audit.begin_run();
  take_loads();
  if (p_.snapshot.take_taken_up()) p_.grounding.share_out_loads();
  p_.gravity.begin_run();
  look_.see_walls(true);
  open_for_insertion(bed_.run.step);
  const std::int64_t step = bed_.run.step;
  if (bed_.ranks.any(bed_.wake.any_here())) p_.ask_for_build(step);
  p_.pacing.begin_run(step, bed_.census.something_locked());
  if (p_.pacing.looks_at_once()) look_.look_at_once();
  if (bed_.ranks.any(look_.take_dropped())) p_.pacing.look_earlier(step);
}

// ------------------------------------------------------------------------------------------------------------ a time step

void Culling::integrate() {
  expect({Phase::stepping}, "integrate");
  if (!bed_.solid.has_store() || (!asked_others_ && p_.motion.active().empty())) return;
  const auto timed = p_.report.time(Part::load);
  p_.motion.kick_and_drift();
  p_.motion.place();
  hear_of_the_last_step(bed_.run.step);
  // the engine looks at its atoms only: a body that has none would come near something unseen
  if (bed_.ranks.count == 1 && p_.motion.comes_too_far(0)) bed_.run.ask_for_reneighbouring(bed_.run.step);
}

void Culling::take_neighbours() {
  p_.motion.begin_lists();
  note_new_lists();
  if (!bed_.solid.has_store()) return;
  if (bed_.census.something_locked())
    change_.take_arrivals();
  else
    bed_.groups.forget_ghosts();
  // the box followed the granules: stored ones go to the rank that has their place now, before anything comes near them
  if (bed_.census.something_stored() && bed_.ranks.subdomains_changed()) bed_.run.ask_for_reneighbouring(bed_.run.step + 1);
  if (Invariants::asked()) p_.invariants.check();
}

/// A granule that goes to the store takes its loads on walls along: before that it is locked, or was chosen by a look.
bool Culling::may_ask_for_wall_loads() const {
  if (phase_ != Phase::stepping) return true;
  return bed_.scales.sleeping() && (bed_.census.something_locked() || look_.chosen().any_here() || p_.pacing.due(bed_.run.step));
}

void Culling::take_loads() {
  const auto timed = p_.report.time(Part::load);
  p_.motion.refresh();
  p_.refill.count_energy_of_new_contacts();
  p_.freezing.rebase_thawed();
  p_.motion.take_loads();
  if (bed_.scales.sleeping()) p_.grounding.press_on_walls();
}

void Culling::take_forces() {
  expect({Phase::stepping}, "take_forces");
  const std::int64_t step = bed_.run.step;
  if (!bed_.solid.has_store()) {  // the run started with an empty box: the first granules that are poured set the scales
    if (step % first_granules_every == 0) find_scales();
    if (!bed_.solid.has_store()) return;
    p_.pacing.begin_within_run(step);
  }
  p_.meter.count_step(p_.report.seconds());
  if (bed_.census.something_locked() || !loads_are_none_) take_loads();
  loads_are_none_ = !bed_.census.something_locked();
  p_.audit.see_forces();
  collect_wakes();
  if (p_.pacing.due(step)) {
    look_.look();
    p_.motion.tell_next();
  }
  if (p_.balance.look(step)) p_.ask_for_build(step + 1);
  open_for_insertion(step + 1);
}

/// What came out of the store because walls may be others feels them now, and goes back: there may be very many, and a look is
/// some steps away. Whether so many go.
bool Culling::stores_what_feels_walls() {
  return p_.closure.take_walls_unfelt() && bed_.scales.sleeping() && p_.deep.ask_to_store(p_.motion.interface_atoms());
}

/// Gentle loads wait for each other; a blow does not. All ranks learn of it before the next step asks who builds lists.
void Culling::collect_wakes() {
  const std::int64_t step = bed_.run.step;
  const bool stores = stores_what_feels_walls();
  if (!bed_.census.something_locked()) return;
  const bool blow = p_.motion.largest_excess() > Pacing::blow;
  bool builds = stores || change_.is_unsettled();
  has_collected_ = blow || p_.pacing.wakes_now(step);
  if (has_collected_) builds = ask_for_those_that_wake() || p_.motion.comes_too_far(p_.pacing.wake_period() + 1) || builds;
  if (bed_.ranks.count > 1) {
    bed_.ranks.begin_any((blow ? blow_bit : 0) | (builds || p_.motion.comes_too_far(1) ? build_bit : 0) |
                         (p_.motion.differs_from_told() ? load_bit : 0));
    asked_others_ = true;
  } else if (builds) {
    p_.ask_for_build(step + 1);
  }
}

Label Culling::label_with_reasons(int i) const {
  const double body = bed_.shell.labels()[i];
  if (body != 0) return {body, 0, 0};  // of what is shown between runs, too
  const Survey::Reasons why = p_.survey.reasons(i);
  return {0, static_cast<double>(why.awake), static_cast<double>(why.woke)};
}

/// Whether any does.
bool Culling::ask_for_those_that_wake() {
  bool waking = false;
  for (const int i : p_.motion.interface_atoms()) {
    const double excess = bed_.shell.take_excess(i);
    if (excess <= 1) continue;
    bed_.wake.ask(bed_.atoms.place(i), bed_.scales.wake_up().radius(excess), Woke::load);
    waking = true;
  }
  return waking;
}

/// What it has brought on other ranks.
void Culling::hear_of_the_last_step(std::int64_t next_build) {
  if (!asked_others_) return;
  asked_others_ = false;
  const unsigned anywhere = bed_.ranks.end_any();
  if ((anywhere & blow_bit) && !has_collected_) ask_for_those_that_wake();
  if (anywhere & load_bit) p_.motion.tell_next();
  if (anywhere & (blow_bit | build_bit)) p_.ask_for_build(next_build);
}

void Culling::finish_step() {
  expect({Phase::stepping}, "finish_step");
  if (!bed_.solid.has_store() || p_.motion.active().empty()) return;
  const auto timed = p_.report.time(Part::load);
  p_.motion.kick();
  p_.motion.give_velocities_to_riders();
}

void Culling::write_outputs() {
  expect({Phase::stepping}, "write_outputs");
  if (bed_.solid.has_store()) p_.files.write_due();
}

void Culling::end_run() {
  hear_of_the_last_step(bed_.run.step + 1);
  p_.walls.remember_walls();
  if (bed_.solid.has_store()) p_.run_end.tell();
  if (phase_ == Phase::stepping) phase_ = Phase::between_runs;  // after `run 0` the first step is still to come, if `pre no`
}

// ------------------------------------------------------------------------------------------------------------ insertion

/// Fixes that insert check for overlap with atoms only: where they put granules, stored ones become atoms in the change at this
/// step, the one before, so that ranks see each other's.
void Culling::open_for_insertion(std::int64_t step) {
  const bool some = bed_.clumps.possible ? bed_.census.something_locked() : bed_.census.something_stored();
  if (some && bed_.insertions.any_due(step + 1 + bed_.run.reset_by)) bed_.run.ask_for_reneighbouring(step);
}

// ------------------------------------------------------------------------------------------------------------ state

double Culling::largest_radius(int type) const {
  const std::vector<double>& largest = bed_.solid.largest_radius_by_type();
  return type >= 0 && type < static_cast<int>(largest.size()) ? largest[static_cast<std::size_t>(type)] : 0.0;
}

std::vector<double> Culling::restart_state() {
  // the command write_restart exchanges atoms, and builds no neighbour lists
  if (phase_ == Phase::beginning && bed_.solid.has_store()) change_.take_arrivals();
  return p_.snapshot.write(phase_ == Phase::beginning);
}

void Culling::enclose_stored(Box& box) const {
  if (bed_.solid.has_store()) bed_.stored.enclose(box);
}

double Culling::memory_bytes() const { return static_cast<double>(bed_.shell.bytes() + bed_.solid.memory_bytes()); }

}  // namespace solidcull
