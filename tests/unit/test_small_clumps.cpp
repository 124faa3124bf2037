// The small world's own clumps, before anything is culled.
#include <gtest/gtest.h>

#include <map>
#include <mutex>

#include "small_world.h"

namespace solidcull {
namespace {

SmallDeck space_with_clumps() {
  SmallDeck deck = empty_space();
  deck.clumps = true;
  return deck;
}

/// No axis of it is like another.
std::vector<Sphere> odd_spheres(const Vec3& at) {
  return {{at, r}, {at + Vec3(1.4 * r, 0, 0), 0.8 * r}, {at + Vec3(0.2 * r, 1.1 * r, 0.3 * r), 0.6 * r}};
}

Vec3 angular_momentum_of(const Clump& c) { return c.angular_momentum + c.lies.centre.cross(c.mass * c.velocity); }

TEST(SmallClumps, in_free_flight_keep_momenta_energy_and_shape) {
  SmallWorld world(space_with_clumps());
  const Vec3 velocity(0.3, -0.2, 0.1), spin(20, 5, -30);
  const std::vector<Sphere> spheres = odd_spheres(Vec3(0.1, 0.2, 0.3));
  world.clumps.make(1, spheres, velocity, spin);
  const Clump before = world.clumps.clump(0);
  ASSERT_LT((before.spin() - spin).norm(), 1e-12 * spin.norm());
  world.begin_run(nullptr);
  world.steps(nullptr, 2000);
  const Clump after = world.clumps.clump(0);
  EXPECT_LT((after.lies.centre - before.lies.centre - 0.2 * velocity).norm(), 1e-13);  // of 2000 sums of numbers below 1
  EXPECT_EQ(after.velocity, velocity);
  EXPECT_EQ(after.angular_momentum, before.angular_momentum);
  EXPECT_LT((angular_momentum_of(after) - angular_momentum_of(before)).norm(), 1e-12 * angular_momentum_of(before).norm());
  EXPECT_GT((after.spin() - spin).norm(), 0.1 * spin.norm());  // it tumbles
  // of second order in the angle of a step, which is 0.0037
  EXPECT_NEAR(after.kinetic_energy(), before.kinetic_energy(), 1e-5 * before.kinetic_energy());
  for (int a = 0; a < 3; ++a) {
    const std::size_t k = static_cast<std::size_t>(a);
    const Vec3 arm = world.atoms.place(a) - after.lies.centre;
    EXPECT_LT((world.atoms.velocity(a) - velocity - after.spin().cross(arm)).norm(), 1e-14);
    EXPECT_EQ(world.atoms.spin(a), after.spin());
    EXPECT_EQ(world.atoms.mass[a], after.mass);
    for (int b = 0; b < a; ++b)
      EXPECT_NEAR((world.atoms.place(a) - world.atoms.place(b)).norm(),
                  (spheres[k].centre - spheres[static_cast<std::size_t>(b)].centre).norm(), 1e-15);
  }
  EXPECT_EQ(after.rest, before.rest);
}

/// As Euler says: its axis goes round the angular momentum at a rate that is this over the inertia across the axis.
TEST(SmallClumps, a_symmetric_top_precesses) {
  SmallWorld world(space_with_clumps());
  world.clumps.make(1, {{Vec3(-r, 0, 0), r}, {Vec3(r, 0, 0), r}}, Vec3::Zero(), Vec3(30, 0, 20));
  const Vec3 turning = world.clumps.clump(0).angular_momentum, axis(1, 0, 0);
  world.begin_run(nullptr);
  world.steps(nullptr, 2000);
  const double across = 2 * world.mass_of(r) * (0.4 * r * r + r * r), angle = 0.2 * turning.norm() / across;
  ASSERT_GT(angle, 2);
  const Vec3 due = Eigen::AngleAxisd(angle, turning.normalized()) * axis,
             is = (world.atoms.place(world.at(2)) - world.atoms.place(world.at(1))).normalized();
  EXPECT_LT((is - due).norm(), 1e-5 * angle);  // of second order in the angle of a step
}

/// Four spheres: one above that of three which stands at the origin, so that this one bears half of it.
TEST(SmallClumps, one_at_rest_on_the_ground_bears_on_it_as_its_lever_arms_say) {
  SmallDeck deck;
  deck.clumps = true;
  deck.planes = {SmallDeck::ground(0)};
  SmallWorld world(deck);
  world.clumps.make(1, {{Vec3(0, 0, r), r}, {Vec3(4 * r, 0, r), r}, {Vec3(0, 4 * r, r), r}, {Vec3(0, 0, 2.5 * r), r}});
  world.begin_run(nullptr);
  world.steps(nullptr, 4000);
  const double weight = 4 * 9.81 * world.mass_of(r);
  EXPECT_NEAR(world.clumps.clump(0).mass, 4 * world.mass_of(r), 1e-15);
  const std::map<int, double> share = {{1, 0.5}, {2, 0.25}, {3, 0.25}};
  // it leans by 1e-3 towards the one that bears more, and so its centre moves by that share of the arms
  for (const auto& [tag, part] : share)
    EXPECT_NEAR((r - world.atoms.place(world.at(tag))[2]) * deck.stiffness, part * weight, 1e-3 * weight) << tag;
  EXPECT_LT(world.clumps.clump(0).velocity.norm(), 1e-9);  // m/s: its springs have swung for 30 times their decay
}

TEST(SmallClumps, have_no_contacts_within_them) {
  SmallWorld world(space_with_clumps());
  world.clumps.make(1, {{Vec3(-0.5 * r, 0, 0), r}, {Vec3(0.5 * r, 0, 0), r}});
  world.clumps.make(3, {{Vec3(2.4 * r, 0, 0), r}, {Vec3(3.4 * r, 0, 0), r}});
  world.begin_run(nullptr);
  EXPECT_FALSE(world.contacts.listed(1, 2));
  EXPECT_FALSE(world.contacts.listed(3, 4));
  EXPECT_TRUE(world.contacts.listed(2, 3));
  EXPECT_GT(world.atoms.force(world.at(3))[0], 0);
}

/// What clumps and spheres do after a while in a box with periodic sides, by tag, and the momentum of all.
struct AfterAWhile {
  std::map<int, Vec3> places;
  Vec3 momentum = Vec3::Zero();
  int ranks_with_clumps = 0;
};
AfterAWhile after_a_while_with_clumps(const std::array<int, 3>& split) {
  SmallDeck deck;
  deck.clumps = true;
  deck.split = split;
  deck.box = {Vec3(-0.025, -0.025, 0), Vec3(0.025, 0.025, 0.1)};
  deck.periodic = {true, true, false};
  deck.planes = {SmallDeck::ground(0)};
  AfterAWhile all;
  std::mutex mutex;
  run_on_ranks(deck, [&](SmallWorld& world) {
    int tag = 1;
    for (int n = 0; n < 6; ++n, tag += 3)
      world.clumps.make(tag, odd_spheres(Vec3(0.016 * (n % 3) - 0.02, 0.024 * (n / 3) - 0.016, 0.008)),
                        Vec3(0.4, 0.2 * (n % 2), 0), Vec3(0, 3, n));
    for (int n = 0; n < 3; ++n) world.add(tag + n, Vec3(0.016 * n - 0.02, 0.003 * n, 0.022), r, Vec3(0.1, 0, -0.5));
    world.begin_run(nullptr);
    world.steps(nullptr, 250);
    world.exchange();
    const std::lock_guard<std::mutex> lock(mutex);
    for (int i = 0; i < world.atoms.owned; ++i) all.places[world.atoms.tag[i]] = world.atoms.place(i);
    all.momentum += world.momentum();
    all.ranks_with_clumps += world.clumps.count() > 0;
  });
  return all;
}

TEST(SmallClumps, move_alike_on_one_rank_and_on_four_through_periodic_sides) {
  const AfterAWhile one = after_a_while_with_clumps({1, 1, 1}), four = after_a_while_with_clumps({2, 2, 1});
  ASSERT_EQ(one.places.size(), 21u);
  ASSERT_EQ(four.places.size(), 21u);
  EXPECT_GE(four.ranks_with_clumps, 3);
  // forces are summed in another order, and 250 steps with collisions amplify that
  for (const auto& [tag, x] : one.places) EXPECT_LT((four.places.at(tag) - x).norm(), 1e-9) << tag;
  EXPECT_LT((one.momentum - four.momentum).norm(), 1e-9 * one.momentum.norm());
}

TEST(SmallClumps, one_that_loses_a_sphere_is_deleted_on_all_ranks) {
  for (const int ranks : {1, 2}) {
    SmallDeck deck = space_with_clumps();
    deck.box = {Vec3(-0.1, -0.1, -0.1), Vec3(0.1, 0.1, 0.1)};
    deck.split = {ranks, 1, 1};
    std::int64_t left[2] = {0, 0};
    std::mutex mutex;
    run_on_ranks(deck, [&](SmallWorld& world) {
      // the first sphere of each is on the one rank, the second on the other; one clump goes up through the side of the box
      world.clumps.make(1, {{Vec3(-0.6 * r, 0, 0.099), r}, {Vec3(0.6 * r, 0, 0.097), r}}, Vec3(0, 0, 1));
      world.clumps.make(3, {{Vec3(-0.6 * r, 0, 0), r}, {Vec3(0.6 * r, 0, 0), r}});
      world.begin_run(nullptr);
      world.steps(nullptr, 20);
      const std::lock_guard<std::mutex> lock(mutex);
      EXPECT_EQ(world.at(1), -1);
      EXPECT_EQ(world.at(2), -1);
      left[0] += world.atoms.owned;
      left[1] += world.clumps.count();
    });
    EXPECT_EQ(left[0], 2) << ranks;
    EXPECT_EQ(left[1], 1) << ranks;
  }
}

TEST(SmallClumps, that_are_taken_and_put_again_are_as_they_were) {
  SmallWorld world(space_with_clumps());
  const int first = world.clumps.make(1, odd_spheres(Vec3::Zero()), Vec3(1, 2, 3), Vec3(4, 5, 6)),
            second = world.clumps.make(4, odd_spheres(Vec3(0.1, 0, 0)));
  ASSERT_NE(first, second);
  const Clump before = world.clumps.clump(world.clumps.find(first));
  const Clump taken = world.clumps.take(first);
  EXPECT_EQ(world.clumps.find(first), -1);
  EXPECT_EQ(world.clumps.clump(world.clumps.find(second)).number, second);
  EXPECT_THROW(world.clumps.take(first), std::logic_error);
  world.clumps.put(taken, world.at(2));
  const Clump after = world.clumps.clump(world.clumps.find(first));
  EXPECT_EQ(after.lies.centre, before.lies.centre);
  EXPECT_EQ(after.angular_momentum, before.angular_momentum);
  EXPECT_EQ(after.rest, before.rest);
  EXPECT_NE(after.rest, world.clumps.clump(world.clumps.find(second)).rest);
  EXPECT_THROW(world.clumps.put(taken, world.at(2)), std::logic_error);
  EXPECT_EQ(world.clumps.highest_number(), second);
}

}  // namespace
}  // namespace solidcull
