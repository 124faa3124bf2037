// Motions and forces that are no numbers any more: the run ends with a line that names the granule, and no search loses its way.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "numbers.h"
#include "run_failure.h"
#include "world_parts.h"

namespace solidcull {
namespace {

constexpr double inf = std::numeric_limits<double>::infinity();
const double nan = std::nan("");

template <class Work>
std::string failure(Work work) {
  try {
    work();
  } catch (const RunFailure& e) {
    return e.what();
  }
  return "";
}

/// Three granules in a row; the first two are one body.
struct ThreeGranules {
  ThreeGranules() : world(empty_space()), parts(world, sleeping_settings(), 2 * r) {
    for (int n = 0; n < 3; ++n) world.add(n + 1, Vec3(0.999 * 2 * r * n, 0, 0), r);
    world.reneighbour();
    world.compute_forces();
    parts.lock({1, 2});
    ++world.run.step;
    parts.reneighbour();
    parts.compute_forces();
  }
  SmallWorld world;
  WorldParts parts;
};

TEST(Numbers, a_granule_whose_motion_is_no_number_is_named) {
  ThreeGranules three;
  SmallAtoms& atoms = three.world.atoms;
  EXPECT_EQ(failure([&] { check_numbers(atoms); }), "");
  const int i = three.world.at(3);
  for (const double bad : {nan, inf, -inf}) {
    const Vec3 x = atoms.place(i);
    atoms.set_place(i, Vec3(x[0], bad, x[2]));
    EXPECT_EQ(failure([&] { check_numbers(atoms); }).find("the place of granule 3 is no number (0.01998 "), 0u);
    atoms.set_place(i, x);
    atoms.set_velocity(i, Vec3(0, 0, bad));
    EXPECT_EQ(failure([&] { check_numbers(atoms); }).find("the velocity of granule 3 is no number (0 0 "), 0u);
    atoms.set_velocity(i, Vec3::Zero());
    atoms.set_spin(i, Vec3(bad, 0, 0));
    EXPECT_EQ(failure([&] { check_numbers(atoms); }).find("the spin of granule 3 is no number ("), 0u);
    atoms.set_spin(i, Vec3::Zero());
  }
  atoms.set_velocity(i, Vec3::Constant(1e308));  // large, but a number: the sum of the three is none
  EXPECT_EQ(failure([&] { check_numbers(atoms); }), "");
}

TEST(Numbers, a_load_that_is_no_number_is_not_taken_for_calm) {
  for (const double bad : {nan, inf}) {
    ThreeGranules three;
    SmallAtoms& atoms = three.world.atoms;
    atoms.f[3 * three.world.at(2) + 1] = bad;
    EXPECT_EQ(failure([&] { three.parts.motion.take_loads(); }).find("the load of granule 2 is no number ("), 0u);
    three.parts.compute_forces();
    atoms.torque[3 * three.world.at(1)] = bad;
    EXPECT_EQ(failure([&] { three.parts.motion.take_loads(); }).find("the load of granule 1 is no number ("), 0u);
  }
}

TEST(Numbers, a_body_that_a_load_throws_out_of_all_numbers_ends_the_run) {
  ThreeGranules three;
  SmallAtoms& atoms = three.world.atoms;
  set(atoms.f + 3 * three.world.at(2), Vec3(0, 1e307, 0));
  const std::string told = failure([&] {
    three.parts.motion.take_loads();
    for (int step = 0; step < 3; ++step) three.parts.motion.kick_and_drift();
  });
  EXPECT_NE(told.find(" of granule "), std::string::npos) << told;
  EXPECT_NE(told.find(" is no number ("), std::string::npos) << told;
}

TEST(Numbers, a_look_ends_the_run_before_it_searches) {
  SmallWorld world(empty_space());
  Culling culling(world.ports(), sleeping_settings(), 1);
  world.follow(culling);
  for (int n = 0; n < 3; ++n) world.add(n + 1, Vec3(0.999 * 2 * r * n, 0, 0), r);
  world.begin_run(&culling);
  world.steps(&culling, 5);
  world.atoms.set_velocity(world.at(3), Vec3(nan, 0, 0));
  EXPECT_NE(failure([&] { world.steps(&culling, 2000); }).find(" of granule 3 is no number ("), std::string::npos);
}

}  // namespace
}  // namespace solidcull
