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
  if (!wakes_.wakes_all()) lock_what_was_chosen();
  tell_neighbours();
}

void MembershipChange::lock(int i) {
  Atoms& atoms = bed_.atoms;
  bed_.shell.lock(atoms, i, bed_.run.step, p_.survey[i].normal_load, bed_.scales.sleeping() && p_.survey.stands_at_wall(i));
  const Survey::Rested rested = p_.survey.note_lock(i);
  if (rested != Survey::Rested::first_time) bed_.solid.count_locked_again(rested == Survey::Rested::moved);
  bed_.solid.count_locked();
}

void MembershipChange::unlock(int i, Woke by) {
  if (const int clump = bed_.shell[i].clump) bed_.clumps.set_clump(i, clump);
  bed_.shell.unlock(bed_.atoms, i);
  p_.survey.note_wake(i, by);
  bed_.solid.count_woken(by);
  p_.closure.unlocked(i);
}

void MembershipChange::free_what_wakes() {
  if (wakes_.none() && !bed_.clumps.possible) return;
  std::set<int> whole;  // bodies of this rank that wake as a whole
  for (const auto& b : bed_.solid.bodies().bodies())
    if (wakes_.wakes_all() || wakes_.wakes_body(b.first)) whole.insert(b.first);
  const Woke with_body = wakes_.wakes_all() ? wakes_.all : Woke::shaken;
  const Atoms& atoms = bed_.atoms;
  std::vector<Woke> wakes(static_cast<std::size_t>(atoms.owned), Woke::never);
  for (int i = 0; i < atoms.owned; ++i)
    if (bed_.shell[i].locked) wakes[i] = whole.count(bed_.shell[i].body) ? with_body : wakes_.in_balls(atoms.place(i));
  bed_.clump_spheres.unite(wakes, [](Woke& one, Woke other) { one = std::max(one, other); });
  for (int i = 0; i < atoms.owned; ++i)
    if (wakes[i] != Woke::never) {
      unlock(i, wakes[i]);
      changes_.freed.push_back(atoms.tag[i]);
    }
  std::vector<std::int64_t> stored;
  FlatMap<Woke> by;
  const auto wake_stored = [&](const Resident& g, Woke why) {
    stored.push_back(g.tag);
    by[g.tag] = why;
  };
  for (const int body : whole) bed_.solid.store().for_each_of_body(body, [&](const Resident& g) { wake_stored(g, with_body); });
  for (const Ball& b : wakes_.balls)
    bed_.stored.for_each_in_box(b.centre - Vec3::Constant(b.radius), b.centre + Vec3::Constant(b.radius), [&](const Resident& g) {
      if (!whole.count(g.body) && b.holds(bed_.solid.nearest_image(bed_.solid.in_world(g), b.centre), 0)) wake_stored(g, b.by);
    });
  if (bed_.clumps.possible) {
    bed_.solid.add_rest_of_clumps(stored);
    name_rest_of_clumps(stored, by);
  }
  std::sort(stored.begin(), stored.end());
  stored.erase(std::unique(stored.begin(), stored.end()), stored.end());
  for (const std::int64_t tag : stored) {
    unlock(p_.exchange.bring_back(tag), by[tag]);
    changes_.freed.push_back(tag);
  }
  if (bed_.clumps.possible) p_.exchange.join_images(stored);
  for (const std::int64_t tag : changes_.freed) changes_.freed_anywhere[tag] = 1;
}

/// What a sphere wakes by, the others of its clump do.
void MembershipChange::name_rest_of_clumps(const std::vector<std::int64_t>& stored, FlatMap<Woke>& by) const {
  FlatMap<Woke> of_clump;
  const auto clump_of = [&](std::int64_t tag) { return bed_.solid.store().get(tag).clump; };
  by.for_each([&](std::int64_t tag, Woke why) { of_clump[clump_of(tag)] = why; });
  for (const std::int64_t tag : stored)
    if (!by.contains(tag)) by[tag] = of_clump[clump_of(tag)];
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
  // what fixes count there they count as clumps, or as spheres
  std::vector<Box> counted;
  if (bed_.clumps.possible) counted = p_.closure.opened(bed_.run.skin);
  const auto is_counted = [&](int i) {
    return bed_.clumps.of(i) &&
           std::any_of(counted.begin(), counted.end(), [&](const Box& box) { return box.holds(bed_.atoms.place(i)); });
  };
  std::vector<int> chosen;
  for (const std::int64_t tag : proposal_.chosen) {
    const int* i = bed_.index.find(tag);
    // it may have left this rank or the simulation, too, or something wakes beside it
    if (i && !bed_.shell[*i].locked && !is_counted(*i) && !wakes_.in_ball(bed_.atoms.place(*i), bed_.scales.diameter()) &&
        still_rests(*i))
      chosen.push_back(*i);
  }
  if (bed_.clumps.possible) bed_.clump_spheres.keep_whole(chosen);
  std::vector<int> of_clumps;
  for (const int i : chosen) {
    if (bed_.clumps.of(i)) of_clumps.push_back(i);
    lock(i);
    changes_.locked.push_back(bed_.atoms.tag[i]);
    changes_.locked_anywhere[bed_.atoms.tag[i]] = 1;
  }
  if (bed_.clumps.possible) lock_clumps(of_clumps);
}

/// Their spheres are granules of their own to the engine from here on, and tied to the one with the lowest tag, which has what
/// was known of the clump.
void MembershipChange::lock_clumps(const std::vector<int>& locked) {
  const Atoms& atoms = bed_.atoms;
  struct Spheres {
    std::int64_t first;  // the lowest tag
    int count;
  };
  std::vector<Spheres> spheres(static_cast<std::size_t>(atoms.owned), Spheres{0, 0});
  for (const int i : locked) {
    bed_.shell.set_clump(i, bed_.clumps.of(i), 0);
    spheres[i] = {atoms.tag[i], 1};
  }
  bed_.clump_spheres.unite(spheres, [](Spheres& one, const Spheres& other) {
    if (other.count == 0) return;
    one.first = one.count ? std::min(one.first, other.first) : other.first;
    one.count += other.count;
  });
  std::vector<std::pair<int, int>> whole;  // clumps whose first sphere is here
  for (const int i : locked) {
    const Spheres& s = spheres[i];
    if (s.first == atoms.tag[i])
      whole.emplace_back(bed_.shell[i].clump, i);
    else
      changes_.joins.push_back({triple(atoms.place(i)), atoms.tag[i], s.first});
    bed_.shell.set_clump(i, bed_.shell[i].clump, s.count);
    bed_.clumps.set_clump(i, 0);
  }
  std::vector<Clump> clumps = bed_.clump_spheres.take(whole);
  for (std::size_t k = 0; k < whole.size(); ++k) {
    const int i = whole[k].second;
    Clump& c = clumps[k];
    c.lies.move(bed_.solid.nearest_image(c.lies.centre, atoms.place(i)) - c.lies.centre);
    bed_.locked_clumps.put(atoms.tag[i], std::move(c));
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
  const double reach = std::max(contact_reach(bed_), bed_.clump_spheres.reach());
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
  if (bed_.clumps.possible)  // what has mass goes last
    std::stable_partition(changes_.freed.begin(), changes_.freed.end(),
                          [&](std::int64_t tag) { return bed_.locked_clumps.find(tag) == nullptr; });
  // what those that go back as they were do not take stays with the rest of their body, so they leave first; but over ranks a
  // rank would leave it with its own part of the rest
  const bool back_first = bed_.ranks.count == 1;
  std::stable_partition(changes_.freed.begin(), changes_.freed.end(),
                        [&](std::int64_t tag) { return goes_back(bed_.index.at(tag)) == back_first; });
  for (const std::int64_t tag : changes_.freed) leave_body(tag);
  changes_.freed_anywhere.for_each([&](std::int64_t tag, char) { bed_.solid.thaw(tag); });
  bed_.split_bodies();
  for (const std::int64_t tag : changes_.freed) {
    const int i = bed_.index.at(tag), body = bed_.shell[i].body;
    if (bed_.scales.sleeping() && body && !bed_.solid.exists(body)) bed_.solid.forget(body);
    bed_.shell.left_body(i);
  }
}

/// Nothing has moved since it was locked: it goes on as if it had never been; else it starts from its body's motion.
bool MembershipChange::goes_back(int i) const { return bed_.shell[i].lock_step == bed_.run.step; }

void MembershipChange::leave_body(std::int64_t tag) {
  const int body = bed_.solid.bodies().body_of(tag), i = bed_.index.at(tag);
  Atoms& atoms = bed_.atoms;
  const Vec3 x = bed_.solid.bodies().pose(body).to_world(bed_.shell[i].place);
  const bool back = goes_back(i);
  const Twist twist = bed_.solid.bodies().body(body).twist;
  atoms.set_velocity(i, back ? bed_.shell[i].velocity : twist.at(x));
  if (bed_.contacts.turn_granules) atoms.set_spin(i, back ? bed_.shell[i].spin : twist.spin);
  const GranuleMass mass = bed_.masses(tag);
  MovingGranule given{mass.mass, mass.radius, x, atoms.velocity(i), atoms.spin(i)};
  if (mass.clump) give_clump_back(i, body, back, given);
  const double before = bed_.solid.kinetic_energy(body);
  bed_.solid.unlock(tag, mass, back ? &given : nullptr);
  const double radius = bed_.solid.bodies().turning_radius(given.radius);
  const RigidPart free =
      given.clump ? bed_.solid.bodies().part_of(given) : RigidPart::granule(given.mass, radius, x, given.velocity, given.spin);
  bed_.solid.count_restored(bed_.solid.kinetic_energy(body) + free.kinetic_energy() - before);
  bed_.solid.thaw(tag);
}

/// The engine moves the clump again whose mass the sphere has: with the motion that it had, or that of its body.
void MembershipChange::give_clump_back(int sphere, int body, bool as_it_was, MovingGranule& given) {
  Clump c = bed_.locked_clumps.take(bed_.atoms.tag[sphere]);
  c.lies.to_world(bed_.solid.bodies().pose(body));
  const Twist& twist = bed_.solid.bodies().body(body).twist;
  if (!as_it_was) c.move_as(twist.at(c.lies.centre), twist.spin);
  given.velocity = c.velocity;
  given.spin = c.spin();
  given.clump = c.lies;
  bed_.clumps.put(c, sphere);
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
  MovingGranule granule{atoms.mass[i], atoms.radius[i], atoms.place(i), e.velocity, e.spin, e.held, std::nullopt};
  if (e.clump) {
    const Clump* const c = bed_.locked_clumps.find(tag);
    granule.mass = c ? c->mass : 0;
    if (c) {
      granule.velocity = c->velocity;
      granule.spin = c->spin();
      granule.clump = c->lies;
    }
  }
  const SolidBodies::Place at = bed_.solid.lock(tag, granule, bed_.masses.by_tag());
  bed_.shell.set_place(i, at);
  if (granule.clump) {
    const Pose& pose = bed_.solid.bodies().pose(at.body);
    bed_.locked_clumps.shift(tag, pose.to_world(at.position) - atoms.place(i));  // it may stand in another periodic image
    bed_.locked_clumps.to_frame(tag, pose);
  }
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
