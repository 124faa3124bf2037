#include <gtest/gtest.h>

#include "small_world.h"
#include "wake_requests.h"

namespace solidcull {
namespace {

SmallDeck box(std::array<int, 3> split) {
  SmallDeck deck;
  deck.box = {Vec3::Zero(), Vec3(1, 2, 3)};
  deck.split = split;
  return deck;
}

TEST(WakeRequests, every_rank_gets_the_balls_and_bodies_of_all) {
  run_on_ranks(box({3, 1, 1}), [](SmallWorld& w) {
    WakeRequests wake;
    EXPECT_FALSE(wake.any_here());
    if (w.ranks.me == 0) wake.ask(Vec3(0.1, 0, 0), 0.01);
    if (w.ranks.me == 2) {
      wake.ask(Vec3(0.9, 0, 0), 0.02);
      wake.ask_body(7);
      wake.ask_body(7);
      EXPECT_TRUE(wake.asks_body(7));
    }
    EXPECT_EQ(wake.any_here(), w.ranks.me != 1);
    const Wakes all = wake.take(w.ranks);
    EXPECT_EQ(all.carves, 2u);
    ASSERT_EQ(all.balls.size(), 2u);
    EXPECT_EQ(all.balls[0].radius, 0.01);
    EXPECT_EQ(all.balls[1].centre, Vec3(0.9, 0, 0));
    EXPECT_TRUE(all.wakes_body(7));
    EXPECT_EQ(all.bodies.size(), 1u);
    EXPECT_FALSE(all.all);
    EXPECT_FALSE(all.none());
    // and they are empty afterwards
    EXPECT_FALSE(wake.any_here());
    EXPECT_FALSE(wake.asks_body(7));
    EXPECT_TRUE(wake.take(w.ranks).none());
  });
}

TEST(WakeRequests, balls_have_their_periodic_images_which_count_as_no_carves) {
  SmallDeck deck = box({2, 1, 1});
  deck.periodic = {true, true, false};
  run_on_ranks(deck, [](SmallWorld& w) {
    WakeRequests wake;
    if (w.ranks.me == 1) wake.ask(Vec3(0.99, 0.01, 1.5), 0.1);
    const Wakes all = wake.take(w.ranks);
    EXPECT_EQ(all.carves, 1u);
    EXPECT_EQ(all.balls.size(), 9u);
    EXPECT_TRUE(all.in_ball(Vec3(0.05, 1.98, 1.5), 0));  // through two sides
    EXPECT_FALSE(all.in_ball(Vec3(0.5, 1, 1.5), 0));
    EXPECT_FALSE(all.in_ball(Vec3(0.12, 0.01, 1.5), 0));
    EXPECT_TRUE(all.in_ball(Vec3(0.12, 0.01, 1.5), 0.05));  // with a margin
  });
}

TEST(WakeRequests, all_is_for_all_ranks_whoever_asked) {
  run_on_ranks(box({2, 1, 1}), [](SmallWorld& w) {
    WakeRequests wake;
    if (w.ranks.me == 1) wake.ask_all();
    EXPECT_FALSE(wake.any_here());  // no granule, no body: no rebuild of its own
    EXPECT_TRUE(wake.take(w.ranks).all);
    EXPECT_FALSE(wake.take(w.ranks).all);
  });
}

}  // namespace
}  // namespace solidcull
