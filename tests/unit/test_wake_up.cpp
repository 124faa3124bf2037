#include <gtest/gtest.h>

#include <cmath>

#include "wake_up.h"

namespace solidcull {
namespace {

constexpr double mass = 2.3e-5, g = 9.81, d = 2.5e-3, r0 = 2 * d;  // kg, m/s^2, m
const WakeUpLaw law{3.0, 0.1, g, r0, 4.0, d};

TEST(WakeUpLaw, tolerance_is_absolute_plus_relative) {
  EXPECT_DOUBLE_EQ(law.tolerance(mass, 0.05), 3 * mass * g + 0.1 * 0.05);
  const WakeUpLaw absolute{3.0, 0.0, g, r0, 4.0, d}, relative{0.0, 0.1, g, r0, 4.0, d};
  EXPECT_DOUBLE_EQ(absolute.tolerance(mass, 1e6), 3 * mass * g);
  EXPECT_DOUBLE_EQ(relative.tolerance(mass, 2.0), 0.2);
}

TEST(WakeUpLaw, who_bears_little_sleeps_through_half_of_that) {
  const WakeUpLaw absolute{3.0, 0.0, g, r0, 4.0, d};
  const double weight = mass * g;
  EXPECT_DOUBLE_EQ(absolute.tolerance(mass, 1.2 * weight), 0.6 * weight);  // its support goes: a change of a whole weight
  EXPECT_GT(absolute.excess(Vec3(0, 0, 0), Vec3(0, 0, weight), mass, 1.2 * weight), 1);
  EXPECT_DOUBLE_EQ(absolute.tolerance(mass, 6 * weight), 3 * weight);  // from here on A
  EXPECT_DOUBLE_EQ(absolute.tolerance(mass, 7 * weight), 3 * weight);
  EXPECT_DOUBLE_EQ(absolute.tolerance(mass, 0), 0.45 * weight);  // in free flight
  EXPECT_DOUBLE_EQ(absolute.tolerance(mass, -1), 3 * weight);    // not known
  EXPECT_DOUBLE_EQ(law.tolerance(mass, -1), 3 * weight);
}

TEST(WakeUpLaw, excess_is_the_load_change_in_tolerances_whatever_its_direction) {
  const Vec3 locked(0.1, -0.2, 0.3);
  const double t = law.tolerance(mass, 0.01);
  for (const Vec3& direction : {Vec3(1, 0, 0), Vec3(0, 0, -1), Vec3(Vec3(1, 2, 2) / 3)}) {
    EXPECT_NEAR(law.excess(locked + 0.5 * t * direction, locked, mass, 0.01), 0.5, 1e-9);
    EXPECT_NEAR(law.excess(locked + 8 * t * direction, locked, mass, 0.01), 8, 1e-9);
  }
  EXPECT_EQ(law.excess(locked, locked, mass, 0.01), 0.0);
}

TEST(WakeUpLaw, a_load_taken_away_counts_as_one_put_on) {
  const Vec3 locked(0, 0, -0.2);
  EXPECT_DOUBLE_EQ(law.excess(Vec3(Vec3::Zero()), locked, mass, 0), 0.2 / law.tolerance(mass, 0));
}

TEST(WakeUpLaw, the_carved_ball_grows_with_the_logarithm_of_the_excess) {
  EXPECT_DOUBLE_EQ(law.radius(1), r0);
  EXPECT_DOUBLE_EQ(law.radius(2), 1.5 * r0);
  EXPECT_DOUBLE_EQ(law.radius(4), 2.0 * r0);
  EXPECT_DOUBLE_EQ(law.radius(10), r0 * (1 + 0.5 * std::log2(10.0)));
}

TEST(WakeUpLaw, the_carved_ball_is_capped) {
  EXPECT_DOUBLE_EQ(law.radius(64), 4 * r0);  // 1 + 0.5 * 6: where the cap begins
  EXPECT_DOUBLE_EQ(law.radius(65), 4 * r0);
  EXPECT_DOUBLE_EQ(law.radius(1e300), 4 * r0);
  EXPECT_DOUBLE_EQ(law.radius(HUGE_VAL), 4 * r0);
  const WakeUpLaw no_growth{3.0, 0.0, g, r0, 1.0, d};
  EXPECT_DOUBLE_EQ(no_growth.radius(1000), r0);
}

TEST(WakeUpLaw, in_a_front_the_ball_of_two_diameters_is_the_least) {
  const auto growth = [](double diameters) { return WakeUpLaw{3.0, 0.0, g, diameters * d, 4.0, d}.front_growth(); };
  EXPECT_DOUBLE_EQ(growth(1), 2);
  EXPECT_DOUBLE_EQ(growth(0.5), 4);
  EXPECT_DOUBLE_EQ(growth(2), 1);
  EXPECT_DOUBLE_EQ(growth(3), 1);
  EXPECT_DOUBLE_EQ(law.front_reach(), 3 * d);
}

TEST(WakeUpLaw, the_carved_ball_never_shrinks_below_r0) {
  EXPECT_DOUBLE_EQ(law.radius(0.5), r0);
  EXPECT_DOUBLE_EQ(law.radius(0), r0);
}

// A = 3: 25 % of |g| by size, 2.5 % by direction, for a body of some hundred granules or more
const WakeUpLaw three_weights{3.0, 0.0, g, r0, 4.0, d};
constexpr double granules = 1000;
const Vec3 down(0, 0, -g);

bool gravity_changed(const Vec3& now, const Vec3& at_locking) { return three_weights.gravity_changed(now, at_locking, granules); }

Vec3 tilted(double degrees) {
  const double a = degrees * M_PI / 180;
  return Vec3(g * std::sin(a), 0, -g * std::cos(a));
}

TEST(GravityChanged, by_size) {
  EXPECT_FALSE(gravity_changed(down, down));
  EXPECT_FALSE(gravity_changed(1.249 * down, down));
  EXPECT_TRUE(gravity_changed(1.251 * down, down));
  EXPECT_FALSE(gravity_changed(0.751 * down, down));
  EXPECT_TRUE(gravity_changed(0.749 * down, down));
  EXPECT_TRUE(gravity_changed(Vec3::Zero(), down));
}

TEST(GravityChanged, by_direction) {
  EXPECT_FALSE(gravity_changed(tilted(1.40), down));  // sin(a) = 0.025 at 1.43 degrees
  EXPECT_TRUE(gravity_changed(tilted(1.46), down));
  EXPECT_TRUE(gravity_changed(tilted(180), down));
  for (const Vec3& across : {Vec3(1, 0, 0), Vec3(0, -1, 0), Vec3(-0.6, 0.8, 0)}) {
    EXPECT_FALSE(gravity_changed(down + 0.0249 * g * across, down));
    EXPECT_TRUE(gravity_changed(down + 0.0251 * g * across, down));
  }
}

TEST(GravityChanged, where_the_deck_turns_gravity_a_tenth_is_enough) {
  EXPECT_FALSE(three_weights.gravity_changed(tilted(0.140), down, granules, true));  // sin(a) = 0.0025 at 0.143 degrees
  EXPECT_TRUE(three_weights.gravity_changed(tilted(0.146), down, granules, true));
  EXPECT_FALSE(three_weights.gravity_changed(1.249 * down, down, granules, true));
  EXPECT_TRUE(three_weights.gravity_changed(1.251 * down, down, granules, true));
}

TEST(GravityChanged, by_size_and_direction_each_on_its_own) {
  EXPECT_FALSE(gravity_changed(1.249 * down + Vec3(0.0249 * g, 0, 0), down));
  EXPECT_TRUE(gravity_changed(1.249 * down + Vec3(0.0251 * g, 0, 0), down));
}

TEST(GravityChanged, by_shares_that_go_with_the_tolerance) {
  const WakeUpLaw twice{6.0, 0.0, g, r0, 4.0, d}, relative{0.0, 0.1, g, r0, 4.0, d};
  EXPECT_FALSE(twice.gravity_changed(1.499 * down, down, granules));
  EXPECT_TRUE(twice.gravity_changed(1.501 * down, down, granules));
  EXPECT_FALSE(twice.gravity_changed(down + Vec3(0.0499 * g, 0, 0), down, granules));
  EXPECT_TRUE(twice.gravity_changed(down + Vec3(0.0501 * g, 0, 0), down, granules));
  EXPECT_FALSE(relative.gravity_changed(1.0999 * down, down, granules));
  EXPECT_TRUE(relative.gravity_changed(1.1001 * down, down, granules));
  EXPECT_FALSE(relative.gravity_changed(down + Vec3(0.0999 * g, 0, 0), down, granules));
  EXPECT_TRUE(relative.gravity_changed(down + Vec3(0.1001 * g, 0, 0), down, granules));
}

TEST(GravityChanged, by_larger_shares_for_small_bodies_tenfold_at_most) {
  const auto size_share = [](double n) {  // by bisection
    double lo = 0, hi = 100;
    for (int k = 0; k < 60; ++k) {
      const double middle = 0.5 * (lo + hi);
      (three_weights.gravity_changed((1 + middle) * down, down, n) ? hi : lo) = middle;
    }
    return lo;
  };
  for (const double n : {300.0, 301.0, 1e6, 1e12}) EXPECT_NEAR(size_share(n), 0.25, 1e-12) << n;
  EXPECT_NEAR(size_share(150), 0.5, 1e-12);
  EXPECT_NEAR(size_share(60), 1.25, 1e-12);
  for (const double n : {30.0, 29.0, 2.0, 1.0}) EXPECT_NEAR(size_share(n), 2.5, 1e-12) << n;
  EXPECT_FALSE(three_weights.gravity_changed(down + Vec3(0.249 * g, 0, 0), down, 10));
  EXPECT_TRUE(three_weights.gravity_changed(down + Vec3(0.251 * g, 0, 0), down, 10));
}

TEST(GravityChanged, from_none) {
  // in free fall: nothing has a direction that could change, so any is judged by its size
  EXPECT_FALSE(gravity_changed(Vec3::Zero(), Vec3::Zero()));
  for (const Vec3& direction : {Vec3(0, 0, -1), Vec3(0.6, 0, 0.8), Vec3(0, 1, 0)}) {
    EXPECT_FALSE(gravity_changed(0.249 * g * direction, Vec3::Zero()));
    EXPECT_TRUE(gravity_changed(0.251 * g * direction, Vec3::Zero()));
  }
  EXPECT_TRUE(gravity_changed(down, Vec3::Zero()));
  const WakeUpLaw weightless{3.0, 0.0, 0.0, r0, 4.0, d};
  EXPECT_FALSE(weightless.gravity_changed(Vec3::Zero(), Vec3::Zero(), granules));
  EXPECT_TRUE(weightless.gravity_changed(Vec3(0, 0, -1e-3), Vec3::Zero(), granules));
}

TEST(GravityChanged, does_not_depend_on_how_the_body_stands) {
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(1.2, Vec3(1, -2, 2) / 3).toRotationMatrix();
  int changed = 0;
  for (int n = 0; n < 400; ++n) {
    const double a = 0.7 * n;
    const Vec3 now = down + 0.3 * g * std::sin(0.31 * n) * Vec3(std::cos(a) * 0.2, std::sin(a) * 0.2, std::cos(0.17 * n));
    EXPECT_EQ(gravity_changed(turn * now, turn * down), gravity_changed(now, down));
    changed += gravity_changed(now, down);
  }
  EXPECT_GT(changed, 50);
  EXPECT_LT(changed, 350);
}

}  // namespace
}  // namespace solidcull
