#include "wake_up.h"

#include <cmath>

#include <gtest/gtest.h>

namespace solidcull {
namespace {

constexpr double mass = 2.3e-5, g = 9.81, r0 = 5e-3;  // kg, m/s^2, m
const WakeUpLaw law{3.0, 0.1, g, r0, 4.0};

TEST(WakeUpLaw, tolerance_is_absolute_plus_relative) {
  EXPECT_DOUBLE_EQ(law.tolerance(mass, 0), 3 * mass * g);
  EXPECT_DOUBLE_EQ(law.tolerance(mass, 0.05), 3 * mass * g + 0.1 * 0.05);
  const WakeUpLaw absolute{3.0, 0.0, g, r0, 4.0}, relative{0.0, 0.1, g, r0, 4.0};
  EXPECT_EQ(absolute.tolerance(mass, 1e6), absolute.tolerance(mass, 0));
  EXPECT_DOUBLE_EQ(relative.tolerance(mass, 2.0), 0.2);
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
  const WakeUpLaw no_growth{3.0, 0.0, g, r0, 1.0};
  EXPECT_DOUBLE_EQ(no_growth.radius(1000), r0);
}

TEST(WakeUpLaw, the_carved_ball_never_shrinks_below_r0) {
  EXPECT_DOUBLE_EQ(law.radius(0.5), r0);
  EXPECT_DOUBLE_EQ(law.radius(0), r0);
}

TEST(GravityChanged, by_size) {
  const Vec3 down(0, 0, -g);
  EXPECT_FALSE(gravity_changed(down, down));
  EXPECT_FALSE(gravity_changed(1.049 * down, down));
  EXPECT_TRUE(gravity_changed(1.051 * down, down));
  EXPECT_FALSE(gravity_changed(0.951 * down, down));
  EXPECT_TRUE(gravity_changed(0.949 * down, down));
  EXPECT_TRUE(gravity_changed(Vec3::Zero(), down));
}

TEST(GravityChanged, by_direction) {
  const Vec3 down(0, 0, -g);
  const auto tilted = [](double degrees) {
    const double a = degrees * M_PI / 180;
    return Vec3(g * std::sin(a), 0, -g * std::cos(a));
  };
  EXPECT_FALSE(gravity_changed(tilted(2.8), down));  // 2 sin(a/2) = 0.05 at 2.87 degrees
  EXPECT_TRUE(gravity_changed(tilted(2.9), down));
  EXPECT_TRUE(gravity_changed(tilted(180), down));
}

TEST(GravityChanged, from_none) {
  EXPECT_FALSE(gravity_changed(Vec3::Zero(), Vec3::Zero()));
  EXPECT_TRUE(gravity_changed(Vec3(0, 0, -1e-3), Vec3::Zero()));
}

}  // namespace
}  // namespace solidcull
