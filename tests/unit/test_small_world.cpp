#include <gtest/gtest.h>

#include <chrono>
#include <mutex>
#include <thread>

#include "small_world.h"

namespace solidcull {
namespace {

TEST(SmallWorld, a_granule_falls_as_galilei_says) {
  SmallWorld world{SmallDeck()};
  world.add(1, Vec3::Zero(), r);
  world.begin_run(nullptr);
  world.steps(nullptr, 1000);
  const double t = 1000 * world.run.dt;
  EXPECT_NEAR(world.atoms.place(0)[2], -0.5 * 9.81 * t * t, 1e-9);  // velocity-Verlet is exact for a parabola
}

TEST(SmallWorld, a_blow_keeps_momentum_and_angular_momentum) {
  SmallWorld world(empty_space());
  world.add(1, Vec3(-0.006, 0, 0), r, Vec3(0.5, 0, 0));
  world.add(2, Vec3(0.006, 0.004, 0), r, Vec3(-0.2, 0, 0), Vec3(0, 0, 30));
  const auto turning = [&] {
    Vec3 sum = Vec3::Zero();
    for (int i = 0; i < 2; ++i) {
      const double m = world.atoms.mass[i];
      sum += world.atoms.place(i).cross(m * world.atoms.velocity(i)) + 0.4 * m * r * r * world.atoms.spin(i);
    }
    return sum;
  };
  world.begin_run(nullptr);
  const Vec3 p = world.momentum(), l = turning(), v = world.atoms.velocity(0);
  world.steps(nullptr, 400);
  ASSERT_GT((world.atoms.velocity(0) - v).norm(), 0.1);  // they have met
  EXPECT_LT((world.momentum() - p).norm(), 1e-15);
  // torques act at the ends of the radii, which overlap by 1 % of them while they touch
  EXPECT_LT((turning() - l).norm(), 0.01 * l.norm());
}

TEST(SmallWorld, a_floor_of_two_triangles_bears_a_granule_once_even_on_their_common_edge) {
  SmallDeck deck;
  deck.meshes = {SmallDeck::floor(0, 0.2)};
  SmallWorld world(deck);
  world.add(1, Vec3(0, 0, r), r);
  world.add(2, Vec3(0.021, 0.02, r), r);  // and near it
  world.begin_run(nullptr);
  world.steps(nullptr, 4000);
  const double weight = 9.81 * world.mass_of(r);
  EXPECT_NEAR(world.walls.borne_by_meshes()[2], -2 * weight, 1e-3 * weight);
  EXPECT_NEAR(r - world.atoms.place(0)[2], weight / world.deck.stiffness, 1e-3 * weight / world.deck.stiffness);
  ASSERT_EQ(world.walls.loads_on(1).size(), 1u);
  ASSERT_EQ(world.walls.loads_on(2).size(), 1u);
  EXPECT_NEAR(world.walls.loads_on(2)[0].force[2], weight, 1e-3 * weight);
  EXPECT_EQ(world.walls.contacts().size(), 2u);
}

TEST(SmallWorld, pairs_of_owned_granules_stand_once_and_pairs_with_ghosts_on_each_side) {
  SmallDeck deck = empty_space();
  deck.split = {2, 1, 1};
  run_on_ranks(deck, [&](SmallWorld& world) {
    world.add(1, Vec3(-0.014, 0, 0), r);
    world.add(2, Vec3(-0.0045, 0, 0), r);
    world.add(3, Vec3(0.005, 0, 0), r);
    world.begin_run(nullptr);
    int pairs = 0;
    world.contacts.neighbours().for_each_pair(world.atoms.owned, [&](int, int, int) { ++pairs; });
    EXPECT_EQ(world.atoms.owned, world.ranks.me == 0 ? 2 : 1);
    EXPECT_EQ(pairs, world.ranks.me == 0 ? 2 : 1);
    EXPECT_TRUE(world.contacts.listed(2, 3));
  });
}

/// Where granules are after a while, by tag.
std::map<int, Vec3> after_a_while(const std::array<int, 3>& split) {
  SmallDeck deck;
  deck.split = split;
  deck.box = {Vec3(-0.02, -0.02, 0), Vec3(0.02, 0.02, 0.1)};
  deck.periodic = {true, true, false};
  deck.planes = {SmallDeck::ground(0)};
  std::map<int, Vec3> places;
  std::mutex mutex;
  run_on_ranks(deck, [&](SmallWorld& world) {
    for (int n = 0; n < 12; ++n)
      world.add(n + 1, Vec3(0.011 * (n % 3) - 0.015, 0.012 * (n / 3 % 2), 0.006 + 0.011 * (n / 6)), r,
                Vec3(0.2, 0.1 * (n % 2), 0));
    world.begin_run(nullptr);
    world.steps(nullptr, 500);
    const std::lock_guard<std::mutex> lock(mutex);
    for (int i = 0; i < world.atoms.owned; ++i) places[world.atoms.tag[i]] = world.run.wrapped(world.atoms.place(i));
  });
  return places;
}

TEST(SmallWorld, moves_alike_on_one_rank_and_on_four_through_periodic_sides) {
  const std::map<int, Vec3> one = after_a_while({1, 1, 1}), four = after_a_while({2, 2, 1});
  ASSERT_EQ(one.size(), 12u);
  ASSERT_EQ(four.size(), 12u);
  // forces are summed in another order, and 500 steps with collisions amplify that
  for (const auto& [tag, x] : one) EXPECT_LT((four.at(tag) - x).norm(), 1e-9) << tag;
}

TEST(SmallWorld, a_collective_that_one_rank_leaves_out_is_an_exception_and_no_hang) {
  SmallDeck deck = empty_space();
  deck.split = {2, 1, 1};
  EXPECT_THROW(run_on_ranks(deck,
                            [](SmallWorld& w) {
                              if (w.ranks.me == 0) w.ranks.any(true);
                            }),
               Meeting::Broken);
  EXPECT_THROW(run_on_ranks(deck,
                            [](SmallWorld& w) {
                              double x = 0;
                              w.ranks.me == 0 ? (void)w.ranks.any(true) : w.ranks.sum(&x, 1);
                            }),
               Meeting::Broken);
  // one rank does not end either
  EXPECT_THROW(run_on_ranks(
                   deck,
                   [](SmallWorld& w) {
                     if (w.ranks.me == 0)
                       w.ranks.any(true);
                     else
                       std::this_thread::sleep_for(std::chrono::milliseconds(300));
                   },
                   0.1),
               Meeting::Broken);
  EXPECT_THROW(run_on_ranks(deck,
                            [](SmallWorld& w) {
                              if (w.ranks.me == 1) throw InternalError("its own fault");
                              w.ranks.any(true);
                            }),
               InternalError);
}

TEST(SmallWorld, rows_reach_ranks_and_images_within_the_width_and_no_others) {
  SmallDeck deck = empty_space();
  deck.box = {Vec3::Zero(), Vec3(0.1, 0.1, 0.1)};
  deck.periodic = {true, false, false};
  deck.split = {2, 1, 1};
  struct Row {
    Triple at;
    int from;
  };
  run_on_ranks(deck, [](SmallWorld& w) {
    // rank 0 owns x < 0.05: one row near its right side, one near its left, which is the right side's periodic image
    std::vector<Row> mine;
    if (w.ranks.me == 0) mine = {{Triple{0.045, 0.05, 0.05}, 1}, {Triple{0.002, 0.05, 0.05}, 2}, {Triple{0.025, 0.05, 0.05}, 3}};
    std::vector<Row> in = w.ranks.exchange(mine, 0.01);
    if (w.ranks.me == 0) {
      EXPECT_TRUE(in.empty());
      return;
    }
    ASSERT_EQ(in.size(), 2u);
    std::sort(in.begin(), in.end(), [](const Row& a, const Row& b) { return a.from < b.from; });
    EXPECT_EQ(in[0].at[0], 0.045);
    EXPECT_NEAR(in[1].at[0], 0.102, 1e-15);
  });
}

}  // namespace
}  // namespace solidcull
