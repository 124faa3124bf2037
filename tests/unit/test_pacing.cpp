#include <gtest/gtest.h>

#include "pacing.h"

namespace solidcull {
namespace {

/// Looks are 16 steps apart in this deck: a twentieth of (d/g)^(1/2) = 32 ms at 0.1 ms a step.
struct Deck {
  explicit Deck(int every = 0) : scales(settings(every)), pacing(scales) {
    scales.set(0.01, 9.81);
    scales.make_laws(1e-4);
  }
  static Settings settings(int every) {
    Settings s;
    s.every = every;
    return s;
  }
  /// Steps of the looks until `last`, with nothing culled.
  std::vector<std::int64_t> looks(std::int64_t from, std::int64_t last) {
    std::vector<std::int64_t> steps;
    for (std::int64_t step = from; step <= last; ++step)
      if (pacing.due(step)) {
        steps.push_back(step);
        pacing.schedule(step, false, false);
      }
    return steps;
  }
  Scales scales;
  Pacing pacing;
};

using Steps = std::vector<std::int64_t>;

TEST(Pacing, a_run_begins_with_quick_looks_and_goes_on_at_multiples_of_the_interval) {
  Deck deck;
  ASSERT_EQ(deck.scales.look_every(), 16);
  deck.pacing.begin_run(1, false);
  // as many quick ones as a granule must be calm for (4), five steps apart, and one in the time of the next; then every 16
  EXPECT_EQ(deck.looks(1, 70), (Steps{1, 6, 11, 16, 21, 32, 48, 64}));
}

TEST(Pacing, the_first_look_decides_alone_and_asks_for_the_least_motion) {
  Deck deck;
  deck.pacing.begin_run(1, false);
  ASSERT_TRUE(deck.pacing.looks_at_once());
  const Patience first = deck.pacing.patience(false);
  EXPECT_TRUE(first.at_once());
  EXPECT_EQ(first.looks, 1);
  deck.pacing.has_looked_at_once();
  const Patience next = deck.pacing.patience(false);
  EXPECT_FALSE(next.at_once());
  EXPECT_GT(first.speed_divisor, next.speed_divisor);
  EXPECT_GT(first.force_divisor, next.force_divisor);
  EXPECT_EQ(next.force_divisor, 1);
  for (const bool named : {true, false}) {
    Deck other(named ? 10 : 0);
    other.pacing.begin_run(1, !named);  // where the user names the interval, or something is culled already
    EXPECT_FALSE(other.pacing.looks_at_once());
  }
}

TEST(Pacing, quick_looks_ask_for_less_calm_and_less_motion) {
  Deck deck;
  deck.pacing.begin_run(1, false);
  deck.pacing.has_looked_at_once();
  const Patience quick = deck.pacing.patience(false);
  EXPECT_TRUE(quick.quick);
  EXPECT_EQ(quick.looks, 3);
  EXPECT_EQ(quick.speed_divisor, 5);
  EXPECT_FALSE(deck.pacing.judges(true));             // too early to say whether culling pays
  const Patience usual = deck.pacing.patience(true);  // once something is culled
  EXPECT_FALSE(usual.quick);
  EXPECT_EQ(usual.looks, 4);
  EXPECT_EQ(usual.speed_divisor, 1);
  deck.looks(1, 21);
  EXPECT_FALSE(deck.pacing.patience(false).quick);
  EXPECT_TRUE(deck.pacing.judges(true));
  EXPECT_FALSE(deck.pacing.judges(false));
}

TEST(Pacing, no_quick_looks_where_the_user_names_the_interval_or_something_is_culled_already) {
  Deck named(10);
  named.pacing.begin_run(1, false);
  EXPECT_EQ(named.looks(1, 35), (Steps{10, 20, 30}));
  Deck culled;
  culled.pacing.begin_run(1, true);
  EXPECT_EQ(culled.looks(1, 35), (Steps{16, 32}));
}

TEST(Pacing, a_look_in_time_for_what_is_culled_at_the_end_of_the_quick_ones) {
  Deck deck;
  deck.pacing.begin_run(1, false);
  deck.pacing.has_looked_at_once();
  ASSERT_TRUE(deck.pacing.due(1));
  deck.pacing.schedule(1, true, false);  // something was locked: no more quick ones
  EXPECT_TRUE(deck.pacing.due(16));
  EXPECT_FALSE(deck.pacing.patience(true).quick);
}

TEST(Pacing, a_second_run_keeps_its_distance_from_the_last_look_of_the_first) {
  Deck deck;
  deck.pacing.begin_run(1, false);
  EXPECT_EQ(deck.looks(1, 48), (Steps{1, 6, 11, 16, 21, 32, 48}));
  deck.pacing.begin_run(49, false);
  EXPECT_EQ(deck.looks(49, 60), (Steps{53, 58}));
  deck.pacing.begin_run(3, false);  // the deck has set time back
  EXPECT_EQ(deck.looks(3, 9), (Steps{3, 8}));
}

TEST(Pacing, the_first_look_is_an_interval_away_where_the_scales_are_found_within_a_run) {
  Deck deck;
  deck.pacing.begin_within_run(50);
  EXPECT_TRUE(deck.pacing.due(66));
}

// ------------------------------------------------------------------------------------------------------------ waking together

TEST(Pacing, looks_are_among_the_steps_at_which_granules_wake_or_the_other_way_round) {
  for (int every = 1; every <= 300; ++every) {
    Deck deck(every);
    int wakes = 0, looks = 0, both = 0;
    std::int64_t last = 0, longest = 0;
    for (std::int64_t step = 1; step <= 200 * every; ++step) {
      const bool wake = deck.pacing.wakes_now(step), look = step % every == 0;
      wakes += wake;
      looks += look;
      both += wake && look;
      if (!wake) continue;
      longest = std::max(longest, step - last);
      last = step;
    }
    EXPECT_EQ(both, std::min(wakes, looks)) << every;        // one rebuild does for both
    EXPECT_LE(longest, 30) << every;                         // about 20 steps
    EXPECT_EQ(longest, deck.pacing.wake_period()) << every;  // what callers look ahead by
  }
}

// ------------------------------------------------------------------------------------------------------------ pauses

TEST(Pacing, a_scene_that_is_shaken_again_and_again_waits_twice_as_long_each_time) {
  Deck deck(10);
  deck.pacing.begin_run(1, false);
  std::int64_t step = 10;
  for (const int looks : {2, 4, 8, 16, 32, 32}) {
    ASSERT_TRUE(deck.pacing.may_cull(step)) << looks;
    deck.pacing.see_waking_bodies(51, 100, step);  // more than half of what is culled
    EXPECT_FALSE(deck.pacing.may_cull(step + 10 * looks - 1)) << looks;
    step += 10 * looks;
    EXPECT_TRUE(deck.pacing.may_cull(step)) << looks;
  }
}

TEST(Pacing, a_few_bodies_that_wake_do_not_stop_culling) {
  Deck deck(10);
  deck.pacing.begin_run(1, false);
  deck.pacing.see_waking_bodies(50, 100, 10);
  EXPECT_TRUE(deck.pacing.may_cull(10));
  deck.pacing.see_waking_bodies(0, 0, 20);
  EXPECT_TRUE(deck.pacing.may_cull(20));
}

TEST(Pacing, the_pause_is_short_again_after_a_long_quiet_time) {
  Deck deck(10);
  deck.pacing.begin_run(1, false);
  deck.pacing.see_waking_bodies(100, 100, 10);  // until 30
  deck.pacing.see_waking_bodies(100, 100, 30);  // until 70
  deck.pacing.see_waking_bodies(0, 100, 70 + 4 * 4 * 10);
  deck.pacing.see_waking_bodies(100, 100, 240);  // not four times the pause yet: eight looks
  EXPECT_FALSE(deck.pacing.may_cull(319));
  EXPECT_TRUE(deck.pacing.may_cull(320));
  deck.pacing.see_waking_bodies(0, 100, 320 + 4 * 8 * 10 + 1);
  deck.pacing.see_waking_bodies(100, 100, 1000);
  EXPECT_FALSE(deck.pacing.may_cull(1019));
  EXPECT_TRUE(deck.pacing.may_cull(1020));
}

// ------------------------------------------------------------------------------------------------------------ benefit

/// Judges looks 10 steps apart, from `step` on, until culling is to wait; then the step of that look.
std::int64_t judge_until_it_waits(Pacing& pacing, const Work& w, std::int64_t step, Pacing::Verdict& verdict, int builds = 0) {
  for (int look = 0; look < 100; ++look, step += 10) {
    for (int b = 0; b < builds; ++b) pacing.count_build();
    verdict = pacing.judge(w, step);
    if (verdict.wait) return step;
  }
  return -1;
}

TEST(Pacing, culling_waits_where_looks_cost_more_than_it_saves) {
  Deck deck(10);
  deck.pacing.begin_run(1, false);
  Pacing::Verdict v;
  // 1000 atoms looked at, none culled
  const std::int64_t step = judge_until_it_waits(deck.pacing, {0, 0, 1000, 0, 0, 1000}, 10, v);
  EXPECT_EQ(step, 40);  // four looks are a fair trial where nothing was ever culled
  EXPECT_EQ(v.wait, 4);
  EXPECT_FALSE(v.give_back);  // there is nothing
  EXPECT_FALSE(v.tell);       // too short a wait for a line
  deck.pacing.see_wait(v.wait, 1.0, step);
  EXPECT_FALSE(deck.pacing.may_cull(79));
  EXPECT_TRUE(deck.pacing.may_cull(80));
}

TEST(Pacing, culling_goes_on_where_it_pays) {
  Deck deck(10);
  deck.pacing.begin_run(1, false);
  Pacing::Verdict v;
  // ten steps of 300 interior granules against two for each of 1000 atoms
  EXPECT_EQ(judge_until_it_waits(deck.pacing, {0, 300, 1000, 0, 0, 1000}, 10, v), -1);
}

TEST(Pacing, rebuilds_that_only_culling_asked_for_are_counted_against_it) {
  Deck deck(10);
  deck.pacing.begin_run(1, false);
  Pacing::Verdict v;
  // the same with a rebuild for each look: (2 + 3) 1000 > 10 300
  EXPECT_EQ(judge_until_it_waits(deck.pacing, {0, 300, 1000, 0, 0, 1000}, 10, v, 1), 60);  // six looks are a trial
  EXPECT_EQ(v.wait, 4);
}

TEST(Pacing, a_look_that_draws_the_surface_is_dearer) {
  Deck deck(10);
  deck.pacing.begin_run(1, false);
  Pacing::Verdict v;
  // (2 + 1) 1000 > 10 290 > 2 1000
  EXPECT_EQ(judge_until_it_waits(deck.pacing, {0, 290, 1000, 0, 0, 1000, true}, 10, v), 60);
  EXPECT_EQ(v.wait, 4);
  Deck undrawn(10);
  undrawn.pacing.begin_run(1, false);
  EXPECT_EQ(judge_until_it_waits(undrawn.pacing, {0, 290, 1000, 0, 0, 1000, false}, 10, v), -1);
}

TEST(Pacing, so_little_that_is_culled_is_given_back) {
  Deck deck(10);
  deck.pacing.begin_run(1, false);
  Pacing::Verdict v;
  judge_until_it_waits(deck.pacing, {9, 0, 1009, 0, 0, 1000}, 10, v);
  EXPECT_TRUE(v.give_back);  // 9 of 1000 exterior ones: less than 1 %
  Deck more(10);
  more.pacing.begin_run(1, false);
  judge_until_it_waits(more.pacing, {10, 0, 1010, 0, 0, 1000}, 10, v);
  EXPECT_FALSE(v.give_back);
}

TEST(Pacing, the_user_is_told_once_when_the_wait_grows_long) {
  Deck deck(10);
  deck.pacing.begin_run(1, false);
  std::int64_t step = 10;
  int told = 0;
  std::vector<int> waits;
  for (int n = 0; n < 6; ++n) {
    Pacing::Verdict v;
    step = judge_until_it_waits(deck.pacing, {0, 0, 1000, 0, 0, 1000}, step, v);
    waits.push_back(v.wait);
    told += v.tell;
    EXPECT_EQ(told, n >= 2 ? 1 : 0) << n;  // at the third, of 16 looks
    step += 10 * v.wait;
  }
  EXPECT_EQ(waits, (std::vector<int>{4, 8, 16, 32, 64, 64}));
  EXPECT_EQ(told, 1);
}

TEST(Pacing, the_wait_ends_early_when_the_scene_has_calmed) {
  Deck deck(10);
  deck.pacing.begin_run(1, false);
  deck.pacing.see_wait(50, 1.0, 100);
  ASSERT_TRUE(deck.pacing.waits_for_calm(110));
  deck.pacing.see_energy(0.3, 110);
  EXPECT_FALSE(deck.pacing.may_cull(110));  // still lively
  deck.pacing.see_energy(0.2, 120);
  EXPECT_TRUE(deck.pacing.may_cull(120));
  EXPECT_FALSE(deck.pacing.waits_for_calm(120));
}

TEST(Pacing, calm_alone_does_not_end_a_wait_after_a_shake) {
  Deck deck(10);
  deck.pacing.begin_run(1, false);
  deck.pacing.see_wait(50, 1.0, 100);
  deck.pacing.see_waking_bodies(100, 100, 100);
  EXPECT_FALSE(deck.pacing.waits_for_calm(110));
}

TEST(Pacing, looks_rest_while_culling_waits_but_for_a_glance_now_and_then) {
  Deck deck(10);
  deck.pacing.begin_run(1, false);
  deck.pacing.see_wait(50, 1.0, 100);
  deck.pacing.schedule(100, false, false);
  EXPECT_TRUE(deck.pacing.due(260));  // the next look and 15 more: has it calmed?
  deck.pacing.see_wait(50, 1.0, 1000);
  deck.pacing.schedule(1000, true, false);
  EXPECT_TRUE(deck.pacing.due(1010));  // what is culled is watched
}

TEST(Pacing, where_a_choice_was_dropped_a_look_comes_early_in_the_run) {
  Deck deck(16);
  deck.pacing.begin_run(17, true);
  deck.pacing.look_earlier(17);
  EXPECT_EQ(deck.looks(17, 64), (Steps{25, 32, 48, 64}));
}

}  // namespace
}  // namespace solidcull
