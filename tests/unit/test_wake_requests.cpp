#include <gtest/gtest.h>

#include <map>

#include "small_world.h"
#include "wake_requests.h"

namespace solidcull {
namespace {

constexpr double d = 0.01;  // m
const WakeUpLaw law{3.0, 0.0, 9.81, d, 4.0, d};

SmallDeck box(std::array<int, 3> split) {
  SmallDeck deck;
  deck.box = {Vec3::Zero(), Vec3(1, 2, 3)};
  deck.split = split;
  return deck;
}

constexpr double margin = 3 * d;

Wakes take(WakeRequests& wake, const SmallWorld& w) { return wake.take(w.ranks, law, w.any_woke(wake.asks_all()), margin); }

TEST(WakeRequests, every_rank_gets_the_balls_that_reach_what_it_may_hold) {
  run_on_ranks(box({3, 1, 1}), [](SmallWorld& w) {
    WakeRequests wake;
    EXPECT_FALSE(wake.any_here());
    if (w.ranks.me == 0) {
      wake.ask(Vec3(0.1, 0, 0), 0.01, Woke::load);
      wake.ask(Vec3(0.32, 0, 0), 0.02, Woke::wall);  // near the border at a third
      wake.ask_body(7);
      wake.ask_body(7);
      EXPECT_TRUE(wake.asks_body(7));
    }
    EXPECT_EQ(wake.any_here(), w.ranks.me == 0);
    const Wakes here = take(wake, w);
    EXPECT_EQ(here.carves, w.ranks.me == 0 ? 2u : 0u);
    ASSERT_EQ(here.balls.size(), w.ranks.me == 0 ? 2u : w.ranks.me == 1 ? 1u : 0u);
    if (w.ranks.me < 2) {
      EXPECT_EQ(here.balls.back().radius, 0.02);
      EXPECT_EQ(here.balls.back().centre, Vec3(0.32, 0, 0));
      EXPECT_EQ(here.in_balls(Vec3(0.33, 0, 0)), Woke::wall);
      EXPECT_EQ(here.in_balls(Vec3(0.35, 0, 0)), Woke::never);
    }
    EXPECT_EQ(here.wakes_body(7), w.ranks.me == 0);  // numbers are those of the rank
    EXPECT_FALSE(here.wakes_all());
    EXPECT_EQ(here.none(), w.ranks.me == 2);
    // and they are empty afterwards
    EXPECT_FALSE(wake.any_here());
    EXPECT_FALSE(wake.asks_body(7));
    EXPECT_TRUE(take(wake, w).none());
  });
}

TEST(WakeRequests, balls_have_their_periodic_images_which_count_as_no_carves) {
  SmallDeck deck = box({2, 1, 1});
  deck.periodic = {true, true, false};
  run_on_ranks(deck, [](SmallWorld& w) {
    WakeRequests wake;
    if (w.ranks.me == 1) wake.ask(Vec3(0.99, 0.01, 1.5), 0.1, Woke::load);
    const Wakes all = take(wake, w);
    EXPECT_EQ(all.carves, w.ranks.me == 1 ? 1u : 0u);
    EXPECT_EQ(all.balls.size(), 2u);  // both ranks have what is at the other side of y, rank 0 through the side of x
    EXPECT_EQ(all.in_ball(Vec3(0.05, 1.98, 1.5), 0), w.ranks.me == 0);  // through two sides
    EXPECT_FALSE(all.in_ball(Vec3(0.5, 1, 1.5), 0));
    EXPECT_FALSE(all.in_ball(Vec3(0.12, 0.01, 1.5), 0));
    EXPECT_EQ(all.in_ball(Vec3(0.12, 0.01, 1.5), 0.05), w.ranks.me == 0);  // with a margin
  });
}

struct Asked {
  Triple at;
  double radius;
};

TEST(WakeRequests, balls_are_larger_where_many_wake_beside_each_other_on_whatever_rank) {
  run_on_ranks(box({2, 1, 1}), [](SmallWorld& w) {
    WakeRequests wake;
    const Vec3 front(0.5, 1, 1);
    if (w.ranks.me == 0) {
      wake.ask(front, 0.011, Woke::load);
      wake.ask(front - Vec3(2.5 * d, 0, 0), 0.012, Woke::load);
      wake.ask(Vec3(0.1, 1, 1), 0.013, Woke::load);                          // alone
      for (int k = 0; k < 9; ++k) wake.ask(Vec3(0.1, 1, 1), d, Woke::wall);  // not by their loads
    } else {
      wake.ask(front + Vec3(0, d, 0), 0.014, Woke::load);
      wake.ask(front - Vec3(0, d, 0), 0.015, Woke::load);
      wake.ask(front + Vec3(2.5 * d, 0, 0), 0.016, Woke::load);  // three are within 3 d, the fourth is not
      wake.ask(front + Vec3(5 * d, 0, 0), 0.017, Woke::load);    // one is
    }
    std::map<double, double> larger;
    std::vector<Asked> rows;
    for (const Ball& b : take(wake, w).balls) rows.push_back({triple(b.centre), b.radius});
    for (const Asked& b : w.ranks.gather(rows))
      for (const double asked : {d, 0.011, 0.012, 0.013, 0.014, 0.015, 0.016, 0.017})
        if (b.radius == asked || b.radius == 2 * asked) larger[asked] = b.radius / asked;
    const std::map<double, double> due = {{d, 1},     {0.011, 2}, {0.012, 2}, {0.013, 1},
                                          {0.014, 2}, {0.015, 2}, {0.016, 2}, {0.017, 1}};
    EXPECT_EQ(larger, due);
  });
}

TEST(WakeRequests, who_asks_for_many_wakes_what_touches_them) {
  run_on_ranks(box({1, 1, 1}), [](SmallWorld& w) {
    WakeRequests wake;
    wake.ask_many(w.ranks, {Vec3(0.5, 1, 1)}, law, 100);
    const Wakes wakes = take(wake, w);
    EXPECT_FALSE(wakes.wakes_all());
    EXPECT_TRUE(wakes.in_ball(Vec3(0.5 + 1.2 * d, 1, 1), 0));
    EXPECT_FALSE(wakes.in_ball(Vec3(0.5 + 2.1 * d, 1, 1), 0));
    wake.ask_many(w.ranks, {Vec3(0.5, 1, 1)}, law, 3);
    EXPECT_EQ(take(wake, w).all, Woke::deck) << "a third of what is locked";
  });
}

TEST(WakeRequests, a_front_goes_on_through_periodic_sides) {
  SmallDeck deck = box({1, 1, 1});
  deck.periodic = {true, false, false};
  run_on_ranks(deck, [](SmallWorld& w) {
    WakeRequests wake;
    for (const double x : {0.002, 0.012, 0.988, 0.998}) wake.ask(Vec3(x, 1, 1), d, Woke::load);
    for (const Ball& b : take(wake, w).balls) EXPECT_EQ(b.radius, 2 * d) << b.centre.transpose();
  });
}

TEST(WakeRequests, all_is_for_all_ranks_whoever_asked) {
  run_on_ranks(box({2, 1, 1}), [](SmallWorld& w) {
    WakeRequests wake;
    if (w.ranks.me == 1) wake.ask_all(Woke::no_gain);
    EXPECT_FALSE(wake.any_here());  // no granule, no body: no rebuild of its own
    EXPECT_EQ(take(wake, w).all, Woke::no_gain);
    EXPECT_FALSE(take(wake, w).wakes_all());
  });
}

}  // namespace
}  // namespace solidcull
