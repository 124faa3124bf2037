#include <gtest/gtest.h>

#include "run_work.h"

namespace solidcull {
namespace {

constexpr double of_granule = 100e-9, of_pair = 50e-9;  // s
constexpr double steps = 1000, neighbours = 10;

/// What a rank counts whose exterior granules each have so many neighbours, this share of them interface granules.
RunWork worked(double exterior, double interface, double interior, double share_of_interface = 0, double in_fix = 0) {
  RunWork w;
  w.steps = steps;
  w.exterior = steps * exterior;
  w.interface = steps * interface;
  w.interior = steps * interior;
  w.exterior_ends = neighbours * w.exterior;
  const double to_interface = share_of_interface * w.exterior_ends;
  w.pairs = to_interface + (w.exterior_ends - to_interface) / 2;
  w.in_pairs = of_pair * w.pairs;
  w.in_fix = in_fix;
  w.seconds = of_granule * w.computed() + w.in_pairs + in_fix;
  return w;
}

double unculled(double granules) { return steps * granules * (of_granule + of_pair * neighbours / 2); }

TEST(RunWork, where_nothing_is_culled_only_the_fix_is_left_out) {
  const RunWork w = worked(20000, 0, 0, 0, 0.3);
  EXPECT_NEAR(seconds_without({w}), w.seconds - 0.3, 1e-9);
}

TEST(RunWork, what_is_stored_would_have_cost_what_exterior_granules_cost) {
  EXPECT_NEAR(seconds_without({worked(5000, 0, 15000)}), unculled(20000), 1e-9);
}

TEST(RunWork, a_pair_with_an_interface_granule_is_no_dearer_without_the_fix) {
  const RunWork few = worked(5000, 3000, 12000, 0.6, 2.0);
  EXPECT_GT((few.seconds - few.in_fix) / few.exterior, unculled(1) / steps) << "an exterior granule costs more with the fix";
  EXPECT_NEAR(seconds_without({few}), unculled(20000), 1e-9);
}

TEST(RunWork, ranks_that_wait_for_the_busiest_say_nothing) {
  RunWork busy = worked(4000, 1000, 5000), idle = worked(0, 1000, 11000);
  idle.seconds = busy.seconds;
  for (const auto& ranks : {std::vector<RunWork>{busy, idle}, std::vector<RunWork>{idle, busy}})
    EXPECT_NEAR(seconds_without(ranks), unculled(12000), 1e-9) << "the rank with most granules would have been the busiest";
}

TEST(RunWork, says_nothing_where_too_little_was_measured) {
  EXPECT_GT(seconds_without({worked(5000, 0, 15000)}), 0);
  EXPECT_EQ(seconds_without({}), 0);
  EXPECT_EQ(seconds_without({RunWork()}), 0);
  EXPECT_EQ(seconds_without({worked(99, 5000, 15000)}), 0) << "hardly any exterior";
  EXPECT_EQ(seconds_without({worked(300, 100, 15000)}), 0) << "hardly any atoms";
  RunWork brief = worked(5000, 0, 15000);
  brief.steps = 99;
  EXPECT_EQ(seconds_without({brief}), 0) << "few steps";
  RunWork fast = worked(5000, 0, 15000);
  fast.seconds = 0.4;
  EXPECT_EQ(seconds_without({fast}), 0);
  RunWork apart = worked(5000, 0, 15000);
  apart.pairs = 0;
  EXPECT_EQ(seconds_without({apart}), 0) << "no pair";
}

TEST(RunWork, ranks_add_counts_and_share_steps_and_seconds) {
  RunWork a = worked(10, 20, 30), b = worked(1, 2, 3);
  a.restored = 5, b.restored = 6;
  a.in_vain = 1, b.in_vain = 2;
  a.awake[Awake::moving] = 7, b.awake[Awake::moving] = 8;
  a.awake.in_vain = 3, b.awake.in_vain = 4;
  b.seconds = a.seconds + 1;
  const RunWork sum = sum_of({a, b});
  EXPECT_EQ(sum.steps, steps);
  EXPECT_EQ(sum.mean(sum.exterior), 11);
  EXPECT_EQ(sum.mean(sum.computed()), 33);
  EXPECT_EQ(sum.mean(sum.all()), 66);
  EXPECT_EQ(sum.pairs, a.pairs + b.pairs);
  EXPECT_EQ(sum.exterior_ends, a.exterior_ends + b.exterior_ends);
  EXPECT_EQ(sum.seconds, b.seconds);
  EXPECT_EQ(sum.restored, 11);
  EXPECT_EQ(sum.in_vain, 3);
  EXPECT_EQ(sum.awake[Awake::moving], 15);
  EXPECT_EQ(sum.awake.in_vain, 7);
}

TEST(AwakeSteps, a_look_stands_for_the_steps_before_it) {
  AwakeSteps all, now;
  now[Awake::alone] = 2;
  now[Awake::settling] = 1;
  now.nearly_slow = 0.5;
  now.nearly_balanced = 0.25;
  now.in_vain = 1;
  all.add(now, 10);
  all.add(now, 20);
  EXPECT_EQ(all[Awake::alone], 60);
  EXPECT_EQ(all.all(), 90);
  EXPECT_EQ(all.nearly_slow, 15);
  EXPECT_EQ(all.nearly_balanced, 7.5);
  EXPECT_EQ(all.in_vain, 30);
}

}  // namespace
}  // namespace solidcull
