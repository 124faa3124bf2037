#include <gtest/gtest.h>

#include "run_summary.h"

namespace solidcull {
namespace {

constexpr double steps_told = 8000;

RunSummary impact() {
  RunSummary run;
  RunWork& w = run.work;
  w.steps = steps_told;
  w.exterior = steps_told * 2100;
  w.interface = steps_told * 1500;
  w.interior = steps_told * 16400;
  w.seconds = 11.6;
  w.in_fix = 1.2;
  w.awake[Awake::moving] = 0.62 * w.exterior;
  w.awake[Awake::settling] = 0.33 * w.exterior;
  w.awake[Awake::alone] = 0.05 * w.exterior;
  run.seconds_without = 51;
  run.runs = 1;
  run.times_less = 51 / 11.6;
  return run;
}

std::string said_of(const RunSummary& run) { return text_of(run, Settings()); }

bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

TEST(RunSummary, is_a_short_block) {
  EXPECT_EQ(said_of(impact()),
            "8000 steps, 20000 granules\n"
            "  exterior      = 2100 (10.5 %) on average\n"
            "  interface     = 1500 (7.5 %)\n"
            "  left out      = 16400 (82.0 %)\n"
            "  granule-steps = 2.88e+07 computed, 1.31e+08 saved\n"
            "  time          = 11.6 s, of it 1.2 s in the fix: about 4.4 times less work than without it\n"
            "  kept awake    = move faster than 'speed' 62 %, calm, but not for long enough 33 %");
}

TEST(RunSummary, says_how_much_more_work_it_was) {
  RunSummary run = impact();
  run.seconds_without = 10;
  EXPECT_TRUE(has(said_of(run), "in the fix: about 1.2 times more work than without it"));
  run.seconds_without = 11.5;
  EXPECT_TRUE(has(said_of(run), "in the fix: about as much work as without it"));
}

TEST(RunSummary, says_nothing_of_what_is_not_known) {
  RunSummary run = impact();
  run.seconds_without = 0;
  run.runs = 3;
  run.work.awake = {};
  const std::string text = said_of(run);
  EXPECT_FALSE(has(text, "work"));
  EXPECT_FALSE(has(text, "all runs"));
  EXPECT_FALSE(has(text, "awake"));
  EXPECT_TRUE(has(text, "  time          = 11.6 s, of it 1.2 s in the fix"));
}

TEST(RunSummary, where_nothing_was_left_out_there_is_no_line_of_it) {
  RunSummary run = impact();
  run.work.exterior = run.work.all();
  run.work.interface = run.work.interior = 0;
  const std::string text = said_of(run);
  EXPECT_TRUE(has(text, "  exterior      = 20000 (100.0 %) on average"));
  EXPECT_FALSE(has(text, "left out") || has(text, "interface"));
  EXPECT_TRUE(has(text, "1.6e+08 computed, 0 saved"));
}

TEST(RunSummary, later_runs_say_what_all_of_them_gained) {
  RunSummary run = impact();
  EXPECT_FALSE(has(said_of(run), "all runs"));
  run.runs = 2;
  run.times_less = 2.04;
  EXPECT_TRUE(has(said_of(run), "\n  all runs      = about 2 times less work than without it\n"));
}

TEST(RunSummary, tells_the_two_main_reasons_the_first_one_first) {
  for (int k = 0; k < static_cast<int>(Awake::count); ++k) {
    RunSummary run = impact();
    run.work.awake = {};
    run.work.awake[static_cast<Awake>(k)] = 1;
    const std::string text = said_of(run);
    EXPECT_TRUE(has(text, "kept awake    = ") && has(text, " 100 %")) << text;
  }
  RunSummary run = impact();
  run.work.awake = {};
  run.work.awake[Awake::held] = 20;
  run.work.awake[Awake::paused] = 71;
  run.work.awake[Awake::unsteady] = 9;
  EXPECT_TRUE(has(said_of(run), "kept awake    = culling pauses 71 %, held by the deck, or not of the group 20 %"));
  run.work.awake[Awake::paused] = 300;
  EXPECT_FALSE(has(said_of(run), "held")) << "less than a tenth";
}

TEST(RunSummary, tells_what_woke_granules_and_how_many) {
  EXPECT_FALSE(has(said_of(impact()), "woken by")) << "none was";
  for (int k = 1; k < static_cast<int>(Woke::count); ++k) {
    RunSummary run = impact();
    run.work.woken[static_cast<Woke>(k)] = 7;
    const std::string text = said_of(run);
    EXPECT_TRUE(has(text, "\n  woken by      = ") && has(text, " 100 %, of 7")) << text;
    EXPECT_FALSE(has(text, "=  100 %")) << "a reason without words: " << k;
  }
  RunSummary run = impact();
  run.work.woken[Woke::load] = 880;
  run.work.woken[Woke::wall] = 115;
  run.work.woken[Woke::insertion] = 5;
  EXPECT_TRUE(has(said_of(run), "woken by      = loads that changed 88 %, a wall has gone 12 %, of 1000")) << said_of(run);
}

// ------------------------------------------------------------------------------------------------------------- advice

/// A run in which nothing limits.
RunWork driven() {
  RunWork w = impact().work;
  w.awake = {};
  w.awake[Awake::moving] = 100;
  w.restored = 1000;
  w.in_vain = 0;
  return w;
}

std::string advice(const RunWork& w, const Settings& settings = {}) { return advice_on(w, settings); }

TEST(Advice, is_none_where_granules_move) { EXPECT_EQ(advice(driven()), ""); }

TEST(Advice, names_the_tolerance_where_most_woke_in_vain) {
  RunWork w = driven();
  w.awake.in_vain = 50;
  EXPECT_EQ(advice(w), "") << "what woke may yet have moved";
  w.in_vain = 900;
  EXPECT_EQ(
      advice(w),
      "a larger 'tolerance' than 3 0 lets more sleep: 50 % of what is awake woke and has not moved; twin.py shows the error");
  w.awake.in_vain = 30;
  EXPECT_EQ(advice(w), "") << "a few";
  w.awake.in_vain = 50;
  Settings live;
  live.exterior = Exterior::live;
  EXPECT_EQ(advice(w, live), "") << "what is exposed wakes, too";
}

TEST(Advice, names_it_where_many_are_nearly_in_balance) {
  RunWork w = driven();
  w.awake.nearly_balanced = 40;
  Settings settings;
  settings.tolerance_absolute = 0.3;
  settings.tolerance_relative = 0.1;
  EXPECT_EQ(
      advice(w, settings),
      "a larger 'tolerance' than 0.3 0.1 lets more sleep: 40 % of what is awake is out of balance by less than twice what it "
      "allows; twin.py shows the error");
}

TEST(Advice, names_the_speed_where_many_are_nearly_slow_enough) {
  RunWork w = driven();
  w.awake.nearly_slow = 40;
  EXPECT_EQ(
      advice(w),
      "a larger 'speed' than 0.01 lets more sleep: 40 % of what is awake moves less than twice as fast; twin.py shows the error");
}

TEST(Advice, names_what_covers_granules_at_rest) {
  RunWork w = driven();
  w.awake = {};
  w.awake[Awake::moving] = 30;
  w.awake[Awake::covered] = 70;
  Settings settings;
  settings.exterior = Exterior::live;
  settings.depth = 2;
  EXPECT_EQ(advice(w, settings),
            "'exterior sleep' lets more sleep: 70 % of what is awake rests, but near the surface; twin.py shows the error");
  settings.exterior = Exterior::sleep;
  EXPECT_EQ(
      advice(w, settings),
      "a smaller 'depth' than 2 lets more sleep: 70 % of what is awake rests, but near what does not; twin.py shows the error");
}

TEST(Advice, is_one_line_of_the_largest) {
  RunWork w = driven();
  w.awake.nearly_slow = 40;
  w.awake.in_vain = 60;
  w.in_vain = 1000;
  EXPECT_TRUE(has(advice(w), "'tolerance'"));
  w.awake.nearly_slow = 61;
  EXPECT_TRUE(has(advice(w), "'speed'"));
  RunSummary run = impact();
  run.work = w;
  EXPECT_TRUE(has(said_of(run), "\n  advice        = a larger 'speed' than 0.01 lets more sleep: "));
}

TEST(Advice, is_none_where_little_is_to_be_gained) {
  RunWork w = driven();
  w.awake.nearly_slow = 100;
  EXPECT_NE(advice(w), "");
  RunWork few = w;
  few.interior = 60 * w.exterior;
  EXPECT_EQ(advice(few), "") << "hardly any is awake";
  w.steps = 99;
  EXPECT_EQ(advice(w), "") << "a short run";
}

}  // namespace
}  // namespace solidcull
