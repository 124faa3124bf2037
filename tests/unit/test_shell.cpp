#include <gtest/gtest.h>

#include <cmath>

#include "world_parts.h"

namespace solidcull {
namespace {

constexpr double r = 0.005;         // m
constexpr double tolerance = 0.02;  // N
constexpr double weight = 0.05;     // of a step in the running average

/// A granule that is locked in step 0, with a load of its own then.
struct OneLocked {
  OneLocked() : parts(world, sleeping_settings(), 2 * r) {
    world.add(1, Vec3::Zero(), r);
    world.reneighbour();
    parts.shell.lock(world.atoms, 0, 0, 1.0, false);
    EXPECT_EQ(take(Vec3::Zero()), 0.0);
  }
  /// In tolerances, on top of what it bore at locking.
  double take(const Vec3& change) { return parts.shell.take_load(0, at_locking + tolerance * change, tolerance, weight); }

  const Vec3 at_locking = Vec3(0.1, 0, -0.3);  // N
  SmallWorld world{SmallDeck()};
  WorldParts parts;
};

TEST(Shell, a_load_change_counts_as_far_as_it_lasts) {
  OneLocked one;
  double lasting = 0;
  for (int n = 1; n <= 100; ++n) {
    lasting += weight * (4 - lasting);
    EXPECT_NEAR(one.take(Vec3(0, 4, 0)), lasting, 1e-12) << n;
  }
  EXPECT_GT(lasting, 3.97);
}

TEST(Shell, a_shake_there_and_back_does_not_count) {
  OneLocked one;
  double largest = 0;
  for (int n = 0; n < 400; ++n) largest = one.take(Vec3(0, 0, n % 10 < 5 ? 4 : -4));
  EXPECT_LT(largest, 1);
}

TEST(Shell, a_slow_ramp_counts_in_the_end_as_a_sudden_load) {
  OneLocked one;
  double largest = 0;
  for (int n = 0; n < 2000; ++n) largest = one.take(Vec3(2e-3 * n, 0, 0));
  EXPECT_NEAR(largest, 4, 0.05);
}

TEST(Shell, a_blow_counts_at_once) {
  OneLocked one;
  EXPECT_NEAR(one.take(Vec3(WakeUpLaw::blow + 1, 0, 0)), WakeUpLaw::blow + 1, 1e-12);
  EXPECT_NEAR(one.parts.shell.take_excess(0), WakeUpLaw::blow + 1, 1e-12);
  EXPECT_LT(one.take(Vec3::Zero()), 1) << "and is over: what lasts of it is a step's share";
}

TEST(Shell, what_lasts_goes_with_the_granule_and_turns_with_its_frame) {
  OneLocked one;
  for (int n = 0; n < 100; ++n) one.take(Vec3(0, 2, 0));
  std::vector<double> packed(static_cast<std::size_t>(one.parts.shell.packed_size()));
  one.parts.shell.pack(0, packed.data());
  OneLocked other;
  other.parts.shell.unpack(0, packed.data());
  EXPECT_EQ(other.parts.shell[0].lasting, one.parts.shell[0].lasting);
  one.parts.shell.reframe(0, Pose(), Pose(Vec3::Zero(), Eigen::Quaterniond(Eigen::AngleAxisd(M_PI / 2, Vec3::UnitZ()))));
  const Vec3 turned = one.parts.shell[0].lasting;
  EXPECT_NEAR(turned[0], other.parts.shell[0].lasting[1], 1e-15);
  EXPECT_NEAR(turned[1], 0, 1e-15);
}

}  // namespace
}  // namespace solidcull
