#include "membership_change.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

namespace solidcull {

MembershipChange::MembershipChange(Bed& bed, const Parts& parts, Wakes wakes, Proposal proposal)
    : bed_(bed), p_(parts), wakes_(std::move(wakes)), proposal_(std::move(proposal)) {
  bed_.solid.count_carves(wakes_.carves);
  changes_.joins = proposal_.joins;
}

// ------------------------------------------------------------------------------------------------------ exterior <-> interface

void MembershipChange::free_and_lock() {
  free_what_wakes();
  if (!wakes_.all) lock_what_was_chosen();
  tell_neighbours();
}

void MembershipChange::lock(int i) {
  Atoms& atoms = bed_.atoms;
  bed_.shell.lock(atoms, i, bed_.run.step, p_.survey[i].normal_load, bed_.scales.sleeping() && p_.survey.stands_at_wall(i));
  const Survey::Rested rested = p_.survey.note_lock(i);
  if (rested != Survey::Rested::first_time) bed_.solid.count_locked_again(rested == Survey::Rested::moved);
  bed_.solid.count_locked();
}

void MembershipChange::unlock(int i) {
  bed_.shell.unlock(bed_.atoms, i);
  p_.survey.note_wake(i);
  p_.closure.unlocked(i);
}

void MembershipChange::free_what_wakes() {
  if (wakes_.none()) return;
  std::set<int> whole;  // bodies of this rank that wake as a whole
  for (const auto& b : bed_.solid.bodies().bodies())
    if (wakes_.all || wakes_.wakes_body(b.first)) whole.insert(b.first);
  const Atoms& atoms = bed_.atoms;
  for (int i = 0; i < atoms.owned; ++i)
    if (bed_.shell[i].locked && (whole.count(bed_.shell[i].body) || wakes_.in_ball(atoms.place(i), 0))) {
      unlock(i);
      changes_.freed.push_back(atoms.tag[i]);
    }
  std::vector<std::int64_t> stored;
  for (const int body : whole) bed_.solid.store().for_each_of_body(body, [&](const Resident& g) { stored.push_back(g.tag); });
  for (const Ball& b : wakes_.balls)
    bed_.stored.for_each_in_box(b.centre - Vec3::Constant(b.radius), b.centre + Vec3::Constant(b.radius), [&](const Resident& g) {
      if (!whole.count(g.body) && b.holds(bed_.solid.nearest_image(bed_.solid.in_world(g), b.centre), 0)) stored.push_back(g.tag);
    });
  std::sort(stored.begin(), stored.end());
  stored.erase(std::unique(stored.begin(), stored.end()), stored.end());
  for (const std::int64_t tag : stored) {
    unlock(p_.exchange.bring_back(tag));
    changes_.freed.push_back(tag);
  }
  for (const std::int64_t tag : changes_.freed) changes_.freed_anywhere[tag] = 1;
}

/// Since the look it may have been struck or moved.
bool MembershipChange::still_rests(int i) const {
  const SolidStateLaw& law = bed_.scales.solid_state();
  const Atoms& atoms = bed_.atoms;
  const AtRest& r = p_.survey[i];
  const double passed = static_cast<double>(bed_.run.step - r.since) * bed_.run.dt;
  return law.went_on(atoms.velocity(i) - r.velocity, r.acceleration_around, r.acceleration_around, passed);
}

void MembershipChange::lock_what_was_chosen() {
  for (const std::int64_t tag : proposal_.chosen) {
    const int* i = bed_.index.find(tag);
    // it may have left this rank or the simulation, too, or something wakes beside it
    if (!i || bed_.shell[*i].locked || wakes_.in_ball(bed_.atoms.place(*i), bed_.scales.diameter()) || !still_rests(*i)) continue;
    lock(*i);
    changes_.locked.push_back(tag);
    changes_.locked_anywhere[tag] = 1;
  }
}

void MembershipChange::tell_neighbours() {
  if (!bed_.ranks.has_neighbours()) return;
  struct Row {
    Triple at;
    std::int64_t tag;
    bool locked;
  };
  std::vector<Row> rows;
  const auto tell = [&](const std::vector<std::int64_t>& tags, bool locked) {
    for (const std::int64_t tag : tags) rows.push_back({triple(bed_.atoms.place(bed_.index.at(tag))), tag, locked});
  };
  tell(changes_.freed, false);
  tell(changes_.locked, true);
  const double reach = contact_reach(bed_);
  for (const Row& r : bed_.ranks.exchange(rows, reach))
    (r.locked ? changes_.locked_anywhere : changes_.freed_anywhere)[r.tag] = 1;
  const std::vector<Join> joins = bed_.ranks.exchange(changes_.joins, reach);
  changes_.joins.insert(changes_.joins.end(), joins.begin(), joins.end());
}

// ------------------------------------------------------------------------------------------------------------ bodies

void MembershipChange::change_bodies() {
  thaw_and_unlock();
  freeze_and_lock();
  bed_.groups.settle();
  p_.freezing.freeze_between_merged();
  bed_.solid.turn_frozen();
  bed_.census.expect_several();
}

/// Contacts go back to the engine.
void MembershipChange::thaw_and_unlock() {
  p_.freezing.thaw(changes_);
  for (const std::int64_t tag : changes_.freed) leave_body(tag);
  changes_.freed_anywhere.for_each([&](std::int64_t tag, char) { bed_.solid.thaw(tag); });
  bed_.split_bodies();
  for (const std::int64_t tag : changes_.freed) {
    const int i = bed_.index.at(tag), body = bed_.shell[i].body;
    if (bed_.scales.sleeping() && body && !bed_.solid.exists(body)) bed_.solid.forget(body);
    bed_.shell.left_body(i);
  }
}

void MembershipChange::leave_body(std::int64_t tag) {
  const int body = bed_.solid.bodies().body_of(tag), i = bed_.index.at(tag);
  Atoms& atoms = bed_.atoms;
  const Vec3 x = bed_.solid.bodies().pose(body).to_world(bed_.shell[i].place);
  // nothing has moved since it was locked: it goes on as if it had never been; else it starts from its body's motion
  const bool back = bed_.shell[i].lock_step == bed_.run.step;
  const Twist twist = bed_.solid.bodies().body(body).twist;
  atoms.set_velocity(i, back ? bed_.shell[i].velocity : twist.at(x));
  if (bed_.contacts.turn_granules) atoms.set_spin(i, back ? bed_.shell[i].spin : twist.spin);
  const double radius = bed_.solid.bodies().turning_radius(atoms.radius[i]);
  const MovingGranule given{atoms.mass[i], atoms.radius[i], x, atoms.velocity(i), atoms.spin(i)};
  const double before = bed_.solid.kinetic_energy(body);
  bed_.solid.unlock(tag, bed_.masses(tag), back ? &given : nullptr);
  const double after =
      bed_.solid.kinetic_energy(body) + RigidPart::granule(given.mass, radius, x, given.velocity, given.spin).kinetic_energy();
  bed_.solid.count_restored(after - before);
  bed_.solid.thaw(tag);
}

void MembershipChange::freeze_and_lock() {
  p_.freezing.freeze(changes_, proposal_);
  lock_into_bodies();
  bed_.adopt_places();
}

void MembershipChange::lock_into_body(std::int64_t tag) {
  const int i = bed_.index.at(tag);
  const Atoms& atoms = bed_.atoms;
  const Locked& e = bed_.shell[i];
  // it has the motion that it had before it was locked
  const MovingGranule granule{atoms.mass[i], atoms.radius[i], atoms.place(i), e.velocity, e.spin, e.held};
  bed_.shell.set_place(i, bed_.solid.lock(tag, granule, bed_.masses.by_tag()));
}

/// From neighbour to neighbour, so that what hangs together becomes one body without many that merge.
void MembershipChange::lock_into_bodies() {
  FlatMap<char, std::int32_t> waits;
  waits.reserve(changes_.locked.size());
  for (const std::int64_t tag : changes_.locked) waits[static_cast<std::int32_t>(tag)] = 1;
  std::vector<std::int64_t> queue;
  for (const std::int64_t first : changes_.locked) {
    if (!waits.erase(static_cast<std::int32_t>(first))) continue;
    queue.assign(1, first);
    for (std::size_t at = 0; at < queue.size(); ++at) {
      const std::int64_t tag = queue[at];
      lock_into_body(tag);
      bed_.solid.contacts().for_each_partner(tag, [&](std::int64_t partner) {
        if (waits.erase(static_cast<std::int32_t>(partner))) queue.push_back(partner);
      });
    }
  }
  for (const Join& j : changes_.joins) bed_.solid.tie(j.a, j.b, bed_.masses.by_tag());
}

}  // namespace solidcull
