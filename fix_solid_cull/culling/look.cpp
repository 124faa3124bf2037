#include "look.h"

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "numbers.h"
#include "word_sum.h"

namespace solidcull {

void Look::see_walls(bool new_run) {
  if (new_run) p_.cover.begin_run(p_.walls.take_gone());
  const std::vector<WallContact> contacts = bed_.walls.contacts();
  if (bed_.scales.needs_surface()) p_.cover.close_behind_walls(contacts, [&](int i) { return p_.survey[i].calm > 0; });
  p_.walls.update(contacts, new_run);
}

void Look::look() {
  const auto timed = p_.report.time(Part::look);
  const std::int64_t step = bed_.run.step;
  check_numbers(bed_.atoms);
  const bool any_culled = bed_.census.something_locked();
  p_.gravity.watch();
  std::int64_t waking = 0;
  for (const auto& [number, body] : bed_.solid.bodies().bodies())
    if (bed_.wake.asks_body(number)) waking += body.mass.count;
  bed_.ranks.sum(&waking, 1);
  p_.pacing.see_waking_bodies(waking, bed_.census.locked(), step);
  if (p_.pacing.waits_for_calm(step)) p_.pacing.see_energy(p_.survey.kinetic_energy_of_exterior(), step);
  const bool may_cull = p_.pacing.may_cull(step) && !p_.gravity.turns();
  if (may_cull || any_culled) see_walls(false);
  chosen_ = survey(may_cull, any_culled);
  p_.audit.see_look();
  if (judge(may_cull)) p_.ask_for_build(step + 1);
  p_.pacing.schedule(step, bed_.census.something_locked(), bed_.census.something_stored());
  p_.forecaster.see_look();
}

/// Before the first step of a run in which nothing is culled. What the deck has tilted since the last one begins to move now.
void Look::look_at_once() {
  const auto timed = p_.report.time(Part::look);
  check_numbers(bed_.atoms);
  if (!p_.gravity.turns()) chosen_ = survey(true, false);
  p_.pacing.has_looked_at_once();
  if (bed_.ranks.any(!chosen_.chosen.empty())) p_.ask_for_build(bed_.run.step);
}

/// What is to be culled; what is exposed, or stands at walls that hold it, is seen on the way.
Proposal Look::survey(bool may_cull, bool any_culled) {
  const Patience patience = p_.pacing.patience(bed_.census.something_locked());
  surface_drawn_ = false;
  Proposal proposal;
  std::int64_t candidates = 0;
  if (may_cull)
    candidates = p_.survey.find_calm(patience, proposal);
  else
    p_.survey.forget_calm();
  const bool live = bed_.scales.needs_surface();
  if (!any_culled && !are_worth_choosing(candidates)) {
    p_.survey.leave_out_unsteady(patience, proposal);
  } else if (!live) {
    p_.survey.leave_out_unsteady(patience, proposal);
    p_.survey.choose_asleep(patience, proposal);
    ground_and_press();
  } else {
    const auto timed = p_.report.time(Part::depth);
    p_.cover.draw();
    surface_drawn_ = true;
    p_.survey.choose_deep(patience, p_.cover, proposal);
    p_.survey.leave_out_unsteady(patience, proposal);
    p_.cover.wake_exposed();
  }
  if (p_.survey.some_chosen_near(proposal) || bed_.clumps.possible) p_.survey.tie(proposal);
  p_.meter.see_awake(p_.survey.see_awake(patience, proposal));
  return proposal;
}

/// Where nothing is culled yet, a few are left alone. Collective.
bool Look::are_worth_choosing(std::int64_t candidates) const {
  std::int64_t all[2] = {candidates, bed_.atoms.owned};
  bed_.ranks.sum(all, 2);
  const double few = (bed_.scales.needs_surface() ? Pacing::worth_share : Pacing::worth_watching) * static_cast<double>(all[1]);
  return all[0] > 0 && static_cast<double>(all[0]) >= few;
}

void Look::ground_and_press() {
  const std::vector<char> grounded_over_ranks = p_.grounding.update();
  const bool stale = p_.motion.stale();
  if (stale) bed_.index.index(bed_.atoms);  // they were sorted since membership changed
  bed_.groups.settle_grounded(stale, grounded_over_ranks);
  if (stale) {
    p_.motion.refresh_in_step();
    p_.motion.give_velocities();
  }
  p_.grounding.share_out_loads();
  p_.deep.ask_to_store(p_.motion.interface_atoms());
}

/// Is it worth a rebuild of the neighbour lists, and did culling pay since the last look? Whether something is to wake, on any
/// rank.
bool Look::judge(bool may_cull) {
  const std::int64_t step = bed_.run.step, restored = bed_.solid.ledger().granules_restored();
  const std::int64_t restored_here = restored - std::exchange(restored_then_, restored);
  enum { chosen, exterior, overdue, builds, wakes, interface_granules, interior_granules, restored_anywhere, atoms, numbers };
  std::int64_t all[numbers] = {};
  all[chosen] = static_cast<std::int64_t>(chosen_.chosen.size());
  all[exterior] = p_.survey.exterior_here();
  all[overdue] = static_cast<std::int64_t>(chosen_.overdue_tags.size());
  all[builds] = !chosen_.joins.empty() || p_.grounding.lets_go() || p_.deep.asked();
  all[wakes] = bed_.wake.any_here();
  all[interface_granules] = static_cast<std::int64_t>(p_.motion.interface_atoms().size());
  all[interior_granules] = static_cast<std::int64_t>(bed_.solid.store().size());
  all[restored_anywhere] = restored_here;
  all[atoms] = bed_.atoms.owned;
  bed_.ranks.sum(all, numbers);
  const bool many = static_cast<double>(all[chosen]) >= Pacing::worth_share * static_cast<double>(all[exterior]);
  if (all[builds] || (all[chosen] > 0 && (many || all[overdue] > 0))) p_.ask_for_build(step + 1);
  if (!p_.pacing.judges(may_cull)) {
    p_.pacing.forget_work();
    return all[wakes] != 0;
  }
  const Pacing::Verdict verdict = p_.pacing.judge({all[interface_granules], all[interior_granules], all[atoms],
                                                   all[restored_anywhere], all[chosen], all[exterior], surface_drawn_},
                                                  step);
  if (verdict.wait == 0) return all[wakes] != 0;
  p_.pacing.see_wait(verdict.wait, p_.survey.kinetic_energy_of_exterior(), step);
  if (verdict.give_back) {
    bed_.wake.ask_all(Woke::no_gain);
    p_.ask_for_build(step + 1);
  }
  if (verdict.tell)
    bed_.run.say("among " + std::to_string(all[exterior]) + " granules too few can be culled for it to pay; trying again every " +
                 std::to_string(verdict.wait * bed_.scales.look_every()) + " steps or more");
  return all[wakes] != 0;
}

void Look::granules_may_change() {
  dropped_ = dropped_ || chosen_.any_here();
  chosen_ = {};
}

std::uint64_t Look::sum_of_granules() const {
  WordSum sum;
  const Atoms& atoms = bed_.atoms;
  for (int i = 0; i < atoms.owned; ++i) {
    for (const Vec3& v : {atoms.place(i), atoms.velocity(i), atoms.spin(i)})
      for (int d = 0; d < 3; ++d) sum.add(v[d]);
    for (const double x : {atoms.radius[i], atoms.mass[i], double(atoms.type[i]), double(atoms.groups[i])}) sum.add(x);
  }
  return sum.value();
}

void Look::remember_granules() {
  if (chosen_.any_here()) granules_sum_ = sum_of_granules();
}

void Look::see_granules_again() {
  if (chosen_.any_here() && granules_sum_ != sum_of_granules()) granules_may_change();
}

}  // namespace solidcull
