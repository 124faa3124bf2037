#include <gtest/gtest.h>

#include "forecast.h"
#include "run_summary.h"

namespace solidcull {
namespace {

/// Of a rank: 1,000 granules in a quarter of which the engine still works, at 1 ms a step.
RunWork work(double steps, double seconds) {
  RunWork w;
  w.steps = steps;
  w.exterior = 250 * steps;
  w.interface = 500 * steps;
  w.interior = 9250 * steps;
  w.pairs = 2000 * steps;
  w.exterior_ends = 1500 * steps;
  w.seconds = seconds;
  w.in_fix = 0.2 * seconds;
  w.in_pairs = 0.5 * seconds;
  w.awake[Awake::moving] = 70 * steps;
  w.awake[Awake::alone] = 30 * steps;
  w.awake[Awake::settling] = 150 * steps;
  return w;
}

TEST(Forecast, goes_on_as_it_did_lately) {
  const RunWork lately = work(400, 1.0);
  const double without = seconds_without({lately});
  ASSERT_GT(without, 1);
  RunWork so_far = work(800, 6.0);  // the first cull took four seconds more
  const Forecast f = forecast({so_far}, {lately}, 8000);
  EXPECT_NEAR(f.times_less, without * 20 / (6.0 + 18 * 1.0), 1e-12);
  EXPECT_NEAR(f.awake, 0.025, 1e-12);
  EXPECT_NEAR(f.moving, 0.01, 1e-12);
  // a long run forgets its beginning
  EXPECT_NEAR(forecast({so_far}, {lately}, 1e9).times_less, without, 1e-3);
}

TEST(Forecast, is_not_known_where_too_little_was_measured) {
  EXPECT_EQ(forecast({work(90, 1)}, {work(90, 1)}, 1000).times_less, 0);
  EXPECT_EQ(forecast({work(800, 0.4)}, {work(400, 0.2)}, 8000).times_less, 0);
  EXPECT_EQ(forecast({RunWork()}, {RunWork()}, 1000).times_less, 0);
  EXPECT_EQ(forecast({}, {}, 1000).times_less, 0);
}

TEST(Forecast, over_ranks_the_busiest_one_counts) {
  RunWork idle = work(400, 1.0);
  idle.in_pairs = 0.01;
  const Forecast one = forecast({work(400, 1.0)}, {work(400, 1.0)}, 4000);
  const Forecast two = forecast({work(400, 1.0), idle}, {work(400, 1.0), idle}, 4000);
  EXPECT_NEAR(two.times_less, one.times_less, 1e-12);
  EXPECT_NEAR(two.awake, one.awake, 1e-12);
}

TEST(ForecastTimes, three_tenths_of_the_run_or_fifteen_looks_after_the_first_cull) {
  for (const double look : {20.0, 300.0}) {
    ForecastTimes t(10000, look);
    EXPECT_FALSE(t.begun());
    t.begin(300);
    EXPECT_TRUE(t.begun());
    const double least = look == 20 ? 3000 : 4500;
    EXPECT_FALSE(t.is_marked(300 + least * 2 / 3 - 1));
    EXPECT_TRUE(t.is_marked(300 + least * 2 / 3));
    EXPECT_FALSE(t.is_due(300 + least - 1));
    EXPECT_TRUE(t.is_due(300 + least));
    t.wait();
    EXPECT_FALSE(t.is_due(300 + least));
    EXPECT_TRUE(t.is_due(300 + 2 * least));
    EXPECT_FALSE(t.too_late(6000));
    EXPECT_TRUE(t.too_late(6001));
  }
}

TEST(ForecastText, says_gain_shares_and_advice_in_one_line) {
  const Forecast f{2.6, 0.21, 0.098};
  RunWork lately = work(400, 1);
  lately.awake = {};
  lately.awake[Awake::moving] = 100;
  EXPECT_EQ(text_of(f, lately, Settings()),
            "if it goes on like this, the run will be about 2.6 times less work than without it: 21 % of the granules are "
            "exterior, 9.8 % move");
  lately.awake.nearly_slow = 90;
  EXPECT_NE(text_of(f, lately, Settings()).find("move; a larger 'speed'"), std::string::npos);
  EXPECT_EQ(text_of({0.5, 1, 1}, RunWork(), Settings()).substr(0, 82),
            "if it goes on like this, the run will be about 2 times more work than without it: ");
}

}  // namespace
}  // namespace solidcull
