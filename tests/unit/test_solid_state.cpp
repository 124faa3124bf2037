#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "solid_state.h"

namespace solidcull {
namespace {

struct Touching {
  MovingSphere a, b;
};

/// Two touching spheres, carried and turned by one rigid motion.
Touching in_rigid_motion(std::mt19937& random) {
  std::normal_distribution<double> n;
  const auto vector = [&] {
    const double x = n(random), y = n(random), z = n(random);
    return Vec3(x, y, z);
  };
  const double ra = 0.5 + std::abs(n(random)), rb = 0.5 + std::abs(n(random));
  const Vec3 at = vector(), direction = vector().normalized(), velocity = vector(), turn = 5 * vector();
  const auto carried = [&](const Vec3& x, double r) { return MovingSphere{x, velocity + turn.cross(x), turn, r}; };
  return {carried(at, ra), carried(at + (ra + rb) * direction, rb)};
}

TEST(ContactVelocity, is_zero_in_any_rigid_motion_of_the_pair) {
  std::mt19937 random(1);
  for (int n = 0; n < 1000; ++n) {
    const Touching t = in_rigid_motion(random);
    const double scale = t.a.velocity.norm() + t.b.velocity.norm();
    EXPECT_LE(contact_velocity(t.a, t.b).norm(), 1e-12 * scale);
  }
}

TEST(ContactVelocity, is_zero_for_rolling_without_slip) {
  const Vec3 up(0, 0, 1), axis(0, 1, 0);
  const double r = 0.3, w = 4;
  const MovingSphere ground{Vec3::Zero(), Vec3::Zero(), Vec3::Zero(), 1.0};
  const MovingSphere rolling{(1.0 + r) * up, w * axis.cross(r * up), w * axis, r};
  EXPECT_LE(contact_velocity(ground, rolling).norm(), 1e-15);
  const MovingSphere spinning{(1.0 + r) * up, Vec3::Zero(), w * axis, r};
  EXPECT_NEAR(contact_velocity(ground, spinning).norm(), w * r, 1e-14);
}

TEST(ContactVelocity, is_zero_between_meshing_gears) {
  const Vec3 axis(0, 0, 1);
  const MovingSphere a{Vec3::Zero(), Vec3::Zero(), 2 * axis, 1.0};
  const MovingSphere b{Vec3(1.5, 0, 0), Vec3::Zero(), -4 * axis, 0.5};
  EXPECT_LE(contact_velocity(a, b).norm(), 1e-15);
}

TEST(ContactVelocity, is_not_zero_for_approach_and_for_slip) {
  const MovingSphere a{Vec3::Zero(), Vec3::Zero(), Vec3::Zero(), 1.0};
  const MovingSphere closing{Vec3(2, 0, 0), Vec3(-0.5, 0, 0), Vec3::Zero(), 1.0};
  const MovingSphere sliding{Vec3(2, 0, 0), Vec3(0, 0.5, 0), Vec3::Zero(), 1.0};
  EXPECT_EQ(contact_velocity(a, closing), Vec3(-0.5, 0, 0));
  EXPECT_EQ(contact_velocity(a, sliding), Vec3(0, 0.5, 0));
}

TEST(ContactVelocity, turns_its_sign_with_the_side) {
  std::mt19937 random(2);
  for (int n = 0; n < 100; ++n) {
    Touching t = in_rigid_motion(random);
    t.b.velocity += Vec3(1, 2, 3);
    EXPECT_LE((contact_velocity(t.a, t.b) + contact_velocity(t.b, t.a)).norm(), 1e-12);
  }
}

TEST(ContactVelocity, does_not_see_a_spin_about_the_line_of_centres) {
  const MovingSphere a{Vec3::Zero(), Vec3::Zero(), Vec3(7, 0, 0), 1.0};
  const MovingSphere b{Vec3(2, 0, 0), Vec3::Zero(), Vec3(-3, 0, 0), 1.0};
  EXPECT_EQ(contact_velocity(a, b), Vec3(Vec3::Zero()));
}

const SolidStateLaw law{0.01, 1.5, 10.0};

TEST(SolidStateLaw, a_contact_is_quiet_below_the_speed) {
  const MovingSphere a{Vec3::Zero(), Vec3::Zero(), Vec3::Zero(), 1.0};
  const auto at_speed = [&](double v) { return MovingSphere{Vec3(2, 0, 0), Vec3(0, v, 0), Vec3::Zero(), 1.0}; };
  EXPECT_TRUE(law.quiet_contact(a, at_speed(0.0099)));
  EXPECT_FALSE(law.quiet_contact(a, at_speed(0.0101)));
}

TEST(SolidStateLaw, a_falling_pair_is_quiet) {
  const MovingSphere a{Vec3::Zero(), Vec3(0, 0, -9), Vec3::Zero(), 1.0}, b{Vec3(2, 0, 0), Vec3(0, 0, -9), Vec3::Zero(), 1.0};
  EXPECT_TRUE(law.quiet_contact(a, b));
}

TEST(SolidStateLaw, balance_is_measured_in_granule_weights) {
  const double limit = 1.5 * 10.0;  // force out of balance in weights is acceleration in g
  const Vec3 rest = Vec3::Zero();
  EXPECT_TRUE(law.balanced(Vec3(0, 0, 0.999 * limit), rest));
  EXPECT_FALSE(law.balanced(Vec3(0, 1.001 * limit, 0), rest));
  EXPECT_TRUE(law.balanced(rest, rest));
}

TEST(SolidStateLaw, balance_is_that_in_the_frame_of_the_neighbours) {
  const Vec3 shaken(70, -20, 30), limit(0, 0, 1.5 * 10.0);
  EXPECT_TRUE(law.balanced(shaken, shaken));
  EXPECT_TRUE(law.balanced(shaken + 0.999 * limit, shaken));
  EXPECT_FALSE(law.balanced(shaken + 1.001 * limit, shaken));
  EXPECT_FALSE(law.balanced(shaken, -shaken));
}

// ------------------------------------------------------------------------------------------------------------ went on

const Vec3 none = Vec3::Zero();

TEST(SolidStateLaw, a_granule_goes_on_that_keeps_its_velocity) {
  EXPECT_TRUE(law.went_on(none, none, none, 0.1));
  EXPECT_TRUE(law.went_on(Vec3(0, 0.0099, 0), none, none, 0.1));
  EXPECT_FALSE(law.went_on(Vec3(0, 0.0101, 0), none, none, 0.1));
}

TEST(SolidStateLaw, a_granule_goes_on_that_follows_its_neighbours) {
  const Vec3 falling(0, 0, -10);
  EXPECT_TRUE(law.went_on(0.1 * falling, falling, falling, 0.1));
  EXPECT_TRUE(law.went_on(0.1 * falling + Vec3(0.0099, 0, 0), falling, falling, 0.1));
  EXPECT_FALSE(law.went_on(0.1 * falling + Vec3(0.0101, 0, 0), falling, falling, 0.1));
  EXPECT_FALSE(law.went_on(-0.1 * falling, falling, falling, 0.1)) << "thrown up";
  EXPECT_FALSE(law.went_on(0.1 * falling, falling, falling, 0.2)) << "it has fallen for half of the time only";
  EXPECT_FALSE(law.went_on(0.1 * falling, none, none, 0.1)) << "its neighbours rested";
}

TEST(SolidStateLaw, acceleration_that_comes_and_goes_within_the_time_counts_for_nothing) {
  // a granule in a bed that rings: the velocity of the end is that of the beginning
  EXPECT_TRUE(law.went_on(Vec3(0.005, 0, 0), Vec3(0, 0, 9), none, 0.1));
}

TEST(SolidStateLaw, a_granule_whose_frame_is_shaken_does_not_go_on) {
  const Vec3 limit(0, 1.5 * 10.0, 0), then(3, 4, 5);
  EXPECT_TRUE(law.went_on(none, then, then + 0.999 * limit, 0.1));
  EXPECT_FALSE(law.went_on(none, then, then + 1.001 * limit, 0.1));
  EXPECT_FALSE(law.went_on(0.1 * then, then, then + 1.001 * limit, 0.1));
}

TEST(SolidStateLaw, who_bears_little_must_be_calm_for_longer) {
  constexpr double weight = 2e-4;
  EXPECT_EQ(SolidStateLaw::patience(weight, 3 * weight), 1);
  EXPECT_EQ(SolidStateLaw::patience(weight, 100 * weight), 1);
  EXPECT_NEAR(SolidStateLaw::patience(weight, weight), std::sqrt(3.0), 1e-12);
  EXPECT_EQ(SolidStateLaw::patience(weight, 0.5 * weight), 2);
  EXPECT_EQ(SolidStateLaw::patience(weight, 0), 2);
  EXPECT_EQ(SolidStateLaw::patience(weight, -1), 1);  // not known
  EXPECT_EQ(SolidStateLaw::patience(0, 0), 1);        // no gravity: no scale to tell by
}

TEST(SolidStateLaw, who_spins_beside_a_neighbour_is_not_in_contact_with_it_as_long_as_neither_comes_nearer) {
  const SolidStateLaw law{0.01, 0.75, 9.81};
  const MovingSphere still{Vec3::Zero(), Vec3::Zero(), Vec3::Zero(), 1.0};
  MovingSphere other{Vec3(2.01, 0, 0), Vec3::Zero(), Vec3(0, 0, 0.5), 1.0};
  EXPECT_TRUE(law.spins_beside(still, other));
  EXPECT_TRUE(law.spins_beside(other, still));
  other.velocity = Vec3(-0.001, 0, 0);
  EXPECT_FALSE(law.spins_beside(still, other)) << "it comes nearer";
  other.velocity = other.spin = Vec3::Zero();
  EXPECT_FALSE(law.spins_beside(still, other)) << "at rest they are one solid";
}

}  // namespace
}  // namespace solidcull
