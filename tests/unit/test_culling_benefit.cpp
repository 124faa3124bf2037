#include <gtest/gtest.h>

#include <vector>

#include "culling_benefit.h"

namespace solidcull {
namespace {

// granule steps, of one look
struct Look {
  double saved, spent;
  bool culling;
};
constexpr Look pays{1000, 10, true};
constexpr Look loses{10, 1000, true};  // granules are culled and woken in turns
constexpr Look idles{0, 10, false};    // nothing is calm: only the look itself is spent

int judged(CullingBenefit& worth, const Look& look) { return worth.judge(look.saved, look.spent, look.culling); }

/// Looks until it waits, that one included, at most `most`; 0 if it never does. `wait`: for how long.
int looks_until_wait(CullingBenefit& worth, const Look& look, int most, int* wait = nullptr) {
  for (int n = 1; n <= most; ++n) {
    const int looks = judged(worth, look);
    if (wait) *wait = looks;
    if (looks > 0) return n;
  }
  return 0;
}

/// The next `count` waits where each look is this one.
std::vector<int> waits(CullingBenefit& worth, const Look& look, int count) {
  std::vector<int> all(count, 0);
  for (int& wait : all) looks_until_wait(worth, look, 1000, &wait);
  return all;
}

TEST(CullingBenefit, goes_on_for_ever_where_it_pays) {
  CullingBenefit worth;
  EXPECT_EQ(looks_until_wait(worth, pays, 10000), 0);
  EXPECT_FALSE(worth.waits_long());
}

TEST(CullingBenefit, goes_on_where_it_costs_what_it_saves) {
  CullingBenefit worth;
  EXPECT_EQ(looks_until_wait(worth, {500, 500, true}, 1000), 0);
  EXPECT_GT(looks_until_wait(worth, {500, 501, true}, 1000), 0);
}

TEST(CullingBenefit, gives_it_a_trial_before_it_waits) {
  CullingBenefit worth, idle;
  const int culled = looks_until_wait(worth, loses, 1000), nothing = looks_until_wait(idle, idles, 1000);
  EXPECT_EQ(culled, 6);
  EXPECT_EQ(nothing, 4) << "to see that nothing can be culled takes less";
}

TEST(CullingBenefit, waits_twice_as_long_each_time_up_to_the_longest) {
  CullingBenefit worth;
  EXPECT_EQ(waits(worth, loses, 9), (std::vector<int>{4, 8, 16, 32, 64, 128, 256, 256, 256}));
}

TEST(CullingBenefit, waits_less_long_where_nothing_can_be_culled) {
  CullingBenefit worth;
  EXPECT_EQ(waits(worth, idles, 7), (std::vector<int>{4, 8, 16, 32, 64, 64, 64}));
}

TEST(CullingBenefit, does_not_keep_the_long_wait_once_nothing_is_culled_any_more) {
  CullingBenefit worth;
  EXPECT_EQ(waits(worth, loses, 7).back(), 256);
  EXPECT_EQ(waits(worth, idles, 2), (std::vector<int>{64, 64}));
}

TEST(CullingBenefit, one_look_at_which_something_was_culled_makes_the_whole_trial_one_of_culling) {
  CullingBenefit worth;
  judged(worth, loses);
  EXPECT_EQ(looks_until_wait(worth, idles, 1000), 5);
}

TEST(CullingBenefit, is_worth_a_line_from_16_looks_on) {
  for (const Look& look : {idles, loses}) {
    CullingBenefit worth;
    EXPECT_FALSE(worth.waits_long());
    EXPECT_EQ(waits(worth, look, 2).back(), 8);
    EXPECT_FALSE(worth.waits_long());
    EXPECT_EQ(waits(worth, look, 1).back(), 16);
    EXPECT_TRUE(worth.waits_long());
    waits(worth, look, 2);
    EXPECT_TRUE(worth.waits_long());
  }
}

TEST(CullingBenefit, begins_anew_after_a_wait) {
  CullingBenefit worth;
  const Look dear{0, 1e9, true};
  ASSERT_EQ(waits(worth, dear, 1).back(), 4);
  EXPECT_EQ(looks_until_wait(worth, pays, 10000), 0) << "what was spent before the wait is forgotten";
}

TEST(CullingBenefit, comes_back_to_short_waits_only_after_it_has_paid_for_long) {
  for (const bool long_enough : {false, true}) {
    CullingBenefit worth;
    ASSERT_EQ(waits(worth, loses, 2).back(), 8);
    const int good = long_enough ? 4 * 8 + 1 : 4 * 8;
    ASSERT_EQ(looks_until_wait(worth, pays, good), 0);
    int wait = 0;
    ASSERT_GT(looks_until_wait(worth, {0, 1e6, true}, 1000, &wait), 0);
    EXPECT_EQ(wait, long_enough ? 4 : 16);
  }
}

TEST(CullingBenefit, a_wake_up_now_and_then_does_not_stop_what_pays_on_the_whole) {
  CullingBenefit worth;
  for (int n = 0; n < 1000; ++n)
    ASSERT_EQ(judged(worth, n % 10 == 9 ? Look{0, 4000, true} : Look{1000, 10, true}), 0) << "look " << n;
}

TEST(CullingBenefit, stops_soon_where_it_paid_for_long_and_pays_no_more) {
  CullingBenefit worth;
  ASSERT_EQ(looks_until_wait(worth, pays, 10000), 0);
  const int looks = looks_until_wait(worth, loses, 1000);
  EXPECT_GE(looks, 2);
  EXPECT_LE(looks, 20) << "of what was saved long ago little counts";
}

TEST(CullingBenefit, does_not_hold_the_wait_for_calm_against_what_is_culled_then) {
  for (const bool begins : {false, true}) {
    CullingBenefit worth;
    for (int n = 0; n < 4; ++n) ASSERT_EQ(judged(worth, {10, 800, true}), 0);
    ASSERT_EQ(worth.judge(10, 800, true, begins), 0);
    EXPECT_EQ(looks_until_wait(worth, {1000, 500, true}, 1000), begins ? 0 : 1);
  }
}

TEST(CullingBenefit, a_trial_begins_once) {
  CullingBenefit worth;  // all is culled and woken in turns
  int looks = 0;
  while (worth.judge(10, 1000, true, looks % 2 == 0) == 0 && looks < 1000) ++looks;
  EXPECT_EQ(looks, 6);
}

TEST(CullingBenefit, a_granule_that_is_out_of_the_engine_saves_more_than_one_of_the_shell) {
  EXPECT_GT(CullingBenefit::interior, CullingBenefit::interface);
  EXPECT_GT(CullingBenefit::interface, 0);
  EXPECT_GT(CullingBenefit::wake, CullingBenefit::build);
}

}  // namespace
}  // namespace solidcull
