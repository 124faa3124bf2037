#include "look.h"

#include <cstdint>
#include <string>

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
  const bool any_culled = bed_.ranks.any(!p_.motion.interface_atoms().empty() || bed_.solid.store().size() > 0);
  p_.gravity.watch();
  std::int64_t in_bodies[2] = {0, static_cast<std::int64_t>(bed_.solid.locked())};
  for (const auto& [number, body] : bed_.solid.bodies().bodies())
    if (bed_.wake.asks_body(bed_.groups.key_of(number))) in_bodies[0] += body.mass.count;
  bed_.ranks.sum(in_bodies, 2);
  p_.pacing.see_waking_bodies(in_bodies[0], in_bodies[1], step);
  if (p_.pacing.waits_for_calm(step)) p_.pacing.see_energy(p_.survey.kinetic_energy_of_exterior(), step);
  const bool may_cull = p_.pacing.may_cull(step) && !p_.gravity.turns();
  if (may_cull || any_culled) see_walls(false);
  chosen_ = survey(may_cull, any_culled);
  judge(may_cull);
  p_.pacing.schedule(step, bed_.census.something_locked(), bed_.census.something_stored());
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
  std::int64_t candidates[2] = {0, bed_.atoms.owned};  // of so many
  if (may_cull)
    candidates[0] = p_.survey.find_calm(patience, proposal);
  else
    p_.survey.forget_calm();
  bed_.ranks.sum(candidates, 2);
  const bool live = bed_.scales.needs_surface();
  const double few = (live ? Pacing::worth_share : Pacing::worth_watching) * static_cast<double>(candidates[1]);
  const bool some_candidates = candidates[0] > 0 && static_cast<double>(candidates[0]) >= few;
  if (!some_candidates && !any_culled) {
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
  if (bed_.ranks.any(!proposal.chosen.empty())) p_.survey.tie(proposal);
  p_.meter.see_awake(p_.survey.count_awake(patience, proposal));
  return proposal;
}

void Look::ground_and_press() {
  p_.grounding.update();
  if (bed_.ranks.any(p_.motion.stale())) {
    bed_.index.index(bed_.atoms);  // they were sorted since membership changed
    bed_.groups.settle();
    p_.motion.refresh_in_step();
    p_.motion.give_velocities();
  }
  p_.grounding.share_out_loads();
  const bool asked = p_.deep.ask_to_store(p_.motion.interface_atoms());
  if (bed_.ranks.any(p_.grounding.lets_go() || asked)) p_.ask_for_build(bed_.run.step + 1);
}

/// Is it worth a rebuild of the neighbour lists, and did culling pay since the last look?
void Look::judge(bool may_cull) {
  const std::int64_t step = bed_.run.step, restored = bed_.solid.ledger().granules_restored();
  const Ranks& ranks = bed_.ranks;
  std::int64_t counts[3] = {static_cast<std::int64_t>(chosen_.chosen.size()), p_.survey.exterior_here(),
                            static_cast<std::int64_t>(chosen_.overdue_tags.size())};
  ranks.sum(counts, 3);
  const std::int64_t chosen = counts[0], exterior = counts[1], overdue = counts[2];
  const bool many = static_cast<double>(chosen) >= Pacing::worth_share * static_cast<double>(exterior);
  if (chosen > 0 && (many || overdue > 0)) p_.ask_for_build(step + 1);
  if (ranks.any(!chosen_.joins.empty())) p_.ask_for_build(step + 1);
  const std::int64_t restored_here = restored - restored_then_;
  restored_then_ = restored;
  if (!p_.pacing.judges(may_cull)) {
    p_.pacing.forget_work();
    return;
  }
  std::int64_t work[4] = {static_cast<std::int64_t>(p_.motion.interface_atoms().size()),
                          static_cast<std::int64_t>(bed_.solid.store().size()), restored_here, bed_.atoms.owned};
  ranks.sum(work, 4);
  const Pacing::Verdict verdict = p_.pacing.judge({work[0], work[1], work[3], work[2], chosen, exterior, surface_drawn_}, step);
  if (verdict.wait == 0) return;
  p_.pacing.see_wait(verdict.wait, p_.survey.kinetic_energy_of_exterior(), step);
  if (verdict.give_back) {
    bed_.wake.ask_all();
    p_.ask_for_build(step + 1);
  }
  if (verdict.tell)
    bed_.run.say("among " + std::to_string(exterior) + " granules too few can be culled for it to pay; trying again every " +
                 std::to_string(verdict.wait * bed_.scales.look_every()) + " steps or more");
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
