#include <gtest/gtest.h>

#include <map>
#include <mutex>

#include "world_parts.h"

namespace solidcull {
namespace {

SmallDeck ranks_along_x(int ranks, double length = 0.12) {
  SmallDeck deck;
  deck.gravity = Vec3::Zero();
  deck.box = {Vec3(-0.5 * length, -0.1, -0.1), Vec3(0.5 * length, 0.1, 0.1)};
  deck.split = {ranks, 1, 1};
  return deck;
}

/// A row of granules along x, with these velocities, locked.
struct Row {
  Row(SmallWorld& w, const std::vector<Vec3>& velocities, double from, double y = 0)
      : world(w), parts(w, sleeping_settings(), 2 * r) {
    add(1, velocities, from, y);
    lock();
  }
  void add(int first, const std::vector<Vec3>& velocities, double from, double y) {
    for (std::size_t n = 0; n < velocities.size(); ++n) {
      world.add(first + static_cast<int>(n), Vec3(from + static_cast<double>(n) * apart, y, 0), r, velocities[n]);
      tags.push_back(first + static_cast<int>(n));
    }
  }
  void lock() {
    world.reneighbour();
    world.compute_forces();
    parts.lock(tags);
  }
  const SolidBody* body() const {
    const auto& all = parts.bed.solid.bodies().bodies();
    return all.empty() ? nullptr : &all.begin()->second;
  }
  SmallWorld& world;
  WorldParts parts;
  std::vector<std::int64_t> tags;
};

std::vector<Vec3> some_velocities(int n) {
  std::vector<Vec3> v;
  for (int k = 0; k < n; ++k) v.emplace_back(1e-3 * (k % 3), 5e-4 * (k % 2) - 2e-4 * k, 1e-4 * k * k);
  return v;
}

TEST(BodyGroups, parts_that_touch_across_borders_have_one_key_and_one_motion_which_keeps_all_momentum) {
  const std::vector<Vec3> v = some_velocities(8);
  for (const int ranks : {1, 2, 3}) {
    // borders of two ranks at 0, of three at +-0.02: the row from -0.035 to 0.035 crosses them
    std::mutex mutex;
    std::vector<std::int64_t> keys;
    run_on_ranks(ranks_along_x(ranks), [&](SmallWorld& w) {
      Row row(w, v, -0.035);
      ASSERT_TRUE(row.body()) << ranks;
      ASSERT_EQ(row.parts.bed.solid.bodies().size(), 1u);
      const int number = row.parts.bed.solid.bodies().bodies().begin()->first;
      EXPECT_EQ(row.parts.bed.groups.spans(number), ranks > 1);
      EXPECT_EQ(row.parts.bed.groups.spanning_parts(), ranks > 1 ? 1u : 0u);
      const double m = w.mass_of(r);
      Vec3 momentum = Vec3::Zero(), centre = Vec3::Zero(), turning = Vec3::Zero();
      for (int k = 0; k < 8; ++k) {
        momentum += m * v[static_cast<std::size_t>(k)];
        centre += Vec3(-0.035 + k * apart, 0, 0) / 8;
      }
      for (int k = 0; k < 8; ++k) turning += (Vec3(-0.035 + k * apart, 0, 0) - centre).cross(m * v[static_cast<std::size_t>(k)]);
      const RigidMotion& motion = row.body()->motion;
      EXPECT_NEAR(motion.mass(), 8 * m, 1e-15);
      EXPECT_LT((motion.centre() - centre).norm(), 1e-15);
      EXPECT_LT((motion.mass() * motion.velocity() - momentum).norm(), 1e-12 * momentum.norm());
      EXPECT_LT((motion.angular_momentum() - turning).norm(), 1e-9 * turning.norm());
      const std::lock_guard<std::mutex> lock(mutex);
      keys.push_back(row.parts.bed.groups.key_of(number));
    });
    ASSERT_EQ(keys.size(), static_cast<std::size_t>(ranks));
    for (const std::int64_t key : keys) EXPECT_EQ(key, keys.front());
    EXPECT_GT(keys.front(), 0);
  }
}

/// One goes back as it was in the step in which it was locked. The others have rested: on one rank they do so again.
TEST(BodyGroups, what_leaves_with_one_that_goes_back_has_the_motion_of_its_body) {
  for (const int ranks : {1, 2})
    run_on_ranks(ranks_along_x(ranks), [&](SmallWorld& w) {
      const Vec3 own(0, 1e-2, 0);
      w.add(21, Vec3(-0.005, apart, 0), r, own);
      Row row(w, std::vector<Vec3>(6, Vec3::Zero()), -0.005);  // of two ranks the first has one of them
      WorldParts& parts = row.parts;
      parts.reneighbour();
      ++w.run.step;
      parts.lock({21});
      EXPECT_EQ(parts.body_of(21), parts.body_of(1));
      std::map<int, Vec3> due;
      for (const std::int64_t tag : row.tags)
        if (const int body = parts.body_of(tag)) {
          const int i = static_cast<int>(tag);
          due[i] = ranks == 1 ? Vec3(Vec3::Zero()) : parts.bed.solid.bodies().body(body).twist.at(w.atoms.place(w.at(i)));
        }
      EXPECT_FALSE(due.empty());
      Wakes all;
      all.all = Woke::deck;
      parts.change(all, {});
      for (const auto& [tag, velocity] : due) EXPECT_LE((w.atoms.velocity(w.at(tag)) - velocity).norm(), 1e-15) << tag;
      if (w.at(21) >= 0) {
        EXPECT_EQ(w.atoms.velocity(w.at(21)), own);
      }
    });
}

TEST(BodyGroups, each_body_is_counted_once_over_all_ranks_and_ghosts_know_their_body) {
  run_on_ranks(ranks_along_x(2), [](SmallWorld& w) {
    Row row(w, some_velocities(4), -1.5 * apart);  // two on either side of the border
    row.add(11, some_velocities(2), 0.03, 0.03);   // all on rank 1
    row.lock();
    std::int64_t first_parts = 0;
    for (const auto& b : row.parts.bed.solid.bodies().bodies())
      first_parts += row.parts.bed.groups.has_key_of_first_part(b.first);
    w.ranks.sum(&first_parts, 1);
    EXPECT_EQ(first_parts, 2);
    row.parts.reneighbour();
    const std::int64_t key = row.parts.bed.groups.key_of(row.parts.body_of(w.ranks.me == 0 ? 2 : 3));
    const std::int64_t* ghost = row.parts.bed.groups.ghost(w.ranks.me == 0 ? 3 : 2);
    ASSERT_TRUE(ghost);
    EXPECT_EQ(*ghost, key);
    // so the pair across the border leaves the lists, as those within ranks do
    EXPECT_FALSE(w.contacts.listed(2, 3));
  });
}

TEST(BodyGroups, parts_feel_one_gravity_the_mean_by_mass_of_those_that_know_theirs) {
  for (const bool known : {true, false})
    run_on_ranks(ranks_along_x(2), [&](SmallWorld& w) {
      Row row(w, some_velocities(4), -2.5 * apart);  // three on rank 0, one on rank 1
      const bool first = w.ranks.me == 0;
      SolidBody& body = row.parts.bed.solid.bodies_in_motion().begin()->second;
      ASSERT_EQ(body.mass.count, first ? 3 : 1);
      body.feel(Vec3(0, 0, first ? -9 : -11));
      body.felt_known = first || known;
      row.parts.bed.groups.settle();
      EXPECT_TRUE(body.felt_known);
      EXPECT_LT((body.felt - Vec3(0, 0, known ? -9.5 : -9)).norm(), 1e-14);
    });
}

TEST(BodyGroups, what_comes_to_a_part_and_leaves_it_accelerates_nothing) {
  run_on_ranks(ranks_along_x(2), [](SmallWorld& w) {
    Row row(w, std::vector<Vec3>(4, Vec3(0, 1e-3, 0)), -1.5 * apart);
    SolidBody& body = row.parts.bed.solid.bodies_in_motion().begin()->second;
    const auto expect_no_acceleration = [&](const Vec3& before) {
      EXPECT_NEAR((body.motion.velocity() - before).norm(), 1e-3, 1e-12) << "the test shows nothing";
      body.end_window(1e-3);
      EXPECT_LT(body.acceleration.norm(), 1e-12);
    };
    body.begin_window(0);
    Vec3 before = body.motion.velocity();
    row.add(5, {Vec3(0, 6e-3, 0)}, 2.5 * apart, 0);  // on rank 1, faster than the row
    row.lock();
    expect_no_acceleration(before);
    body.begin_window(0);
    before = body.motion.velocity();
    Wakes one;  // it goes on with its own velocity
    one.balls.push_back({Vec3(2.5 * apart, 0, 0), 0.5 * r});
    row.parts.change(one, {});
    expect_no_acceleration(before);
  });
}

TEST(BodyGroups, ranks_that_hold_no_part_take_part_in_what_is_collective) {
  run_on_ranks(ranks_along_x(3), [](SmallWorld& w) {
    Row row(w, some_velocities(4), -0.04);  // across the border at -0.02; rank 2 has nothing
    EXPECT_EQ(row.body() == nullptr, w.ranks.me == 2);
    EXPECT_EQ(row.parts.bed.groups.spanning_parts(), w.ranks.me == 2 ? 0u : 1u);
    row.parts.bed.groups.settle();
    row.parts.reneighbour();
    row.parts.compute_forces();
    EXPECT_EQ(row.parts.bed.groups.spanning_parts(), w.ranks.me == 2 ? 0u : 1u);
  });
}

TEST(BodyGroups, the_load_on_a_body_over_ranks_is_the_sum_over_its_parts) {
  run_on_ranks(ranks_along_x(2), [](SmallWorld& w) {
    Row row(w, std::vector<Vec3>(4, Vec3::Zero()), -1.5 * apart);
    row.parts.reneighbour();
    w.compute_forces();
    // a couple: rank 0's end is pressed down, rank 1's up
    for (const int tag : {1, 4})
      if (const int i = w.at(tag); i >= 0) set(w.atoms.f + 3 * i, Vec3(0, 0, tag == 1 ? -1.0 : 3.0));
    row.parts.motion.refresh();
    row.parts.motion.take_loads();
    ASSERT_EQ(row.parts.motion.active().size(), 1u);
    const ActiveBody& a = row.parts.motion.active()[0];
    EXPECT_LT((a.force - Vec3(0, 0, 2)).norm(), 1e-12);
    EXPECT_LT((a.torque - Vec3(0, -1.5 * apart * 4, 0)).norm(), 1e-12);
  });
}

/// A row that is as long as the periodic box, or a granule short of it; then it is pushed to turn about z and x.
Vec3 spin_after_a_push(int ranks, int granules) {
  Vec3 spin = Vec3::Zero();
  std::mutex mutex;
  SmallDeck deck = ranks_along_x(ranks, 8 * apart);
  deck.periodic = {true, false, false};
  run_on_ranks(deck, [&](SmallWorld& w) {
    Row row(w, std::vector<Vec3>(static_cast<std::size_t>(granules), Vec3(0, 1e-3, 0)), -3.5 * apart);
    ASSERT_TRUE(row.body());
    SolidBody& body = row.parts.bed.solid.bodies_in_motion().begin()->second;
    EXPECT_LT((body.motion.velocity() - Vec3(0, 1e-3, 0)).norm(), 1e-15);
    body.kick(Vec3::Zero(), Vec3(1e-6, 0, 1e-6), 1e-3);
    const std::lock_guard<std::mutex> lock(mutex);
    spin = body.motion.spin();
  });
  return spin;
}

TEST(BodyGroups, a_body_that_is_tied_to_its_own_periodic_image_turns_about_that_axis_alone) {
  for (const int ranks : {1, 2}) {
    const Vec3 tied = spin_after_a_push(ranks, 8), loose = spin_after_a_push(ranks, 7);
    EXPECT_EQ(tied[2], 0) << ranks;
    EXPECT_GT(tied[0], 0) << ranks;
    EXPECT_GT(loose[2], 0) << ranks;
  }
}

TEST(BodyGroups, a_contact_ties_two_ranks_where_only_one_of_them_sees_the_other_end) {
  run_on_ranks(ranks_along_x(2, 0.4), [](SmallWorld& w) {
    Row row(w, some_velocities(8), -3.5 * apart);
    BedState& bed = row.parts.bed;
    if (const int at_border = w.at(5); at_border >= 0) {  // it went to another site, out of the other rank's sight
      const Locked& e = bed.shell[at_border];
      bed.shell.set_place(at_border, {e.body, Vec3(e.place + Vec3(0.1, 0, 0))});
    }
    row.parts.bed.groups.settle();
    ASSERT_EQ(bed.solid.bodies().size(), 1u);
    const int number = bed.solid.bodies().bodies().begin()->first;
    EXPECT_TRUE(row.parts.bed.groups.spans(number));
    std::int64_t keys[] = {row.parts.bed.groups.key_of(number), -row.parts.bed.groups.key_of(number)};
    w.ranks.largest(keys, 2);
    EXPECT_EQ(keys[0], -keys[1]) << "one body";
    EXPECT_NEAR(row.body()->motion.mass(), 8 * w.mass_of(r), 1e-15);
  });
}

TEST(BodyGroups, what_came_apart_at_a_border_is_two_bodies_again_each_with_its_own_motion) {
  run_on_ranks(ranks_along_x(2), [](SmallWorld& w) {
    Row row(w, some_velocities(8), -3.5 * apart);
    const RigidMotion whole = row.body()->motion;
    // the two at the border wake, a step later
    ++w.run.step;
    Wakes wakes;
    wakes.balls.push_back({Vec3::Zero(), 0.9 * apart});
    row.parts.change(wakes, {});
    ASSERT_EQ(row.parts.bed.solid.bodies().size(), 1u);
    const int number = row.parts.bed.solid.bodies().bodies().begin()->first;
    EXPECT_FALSE(row.parts.bed.groups.spans(number));
    EXPECT_EQ(row.parts.bed.groups.spanning_parts(), 0u);
    EXPECT_EQ(row.body()->mass.count, 3);
    // it goes on with the velocity field that it had as a part
    EXPECT_LT((row.body()->motion.velocity() - whole.twist().at(row.body()->motion.centre())).norm(), 1e-12);
    EXPECT_LT((row.body()->motion.spin() - whole.spin()).norm(), 1e-9 * whole.spin().norm());
  });
}

}  // namespace
}  // namespace solidcull
