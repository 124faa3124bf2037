#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>
#include <vector>

#include "sphere_levels.h"

namespace solidcull {
namespace {

struct LevelCloud {
  std::vector<double> coordinates, radii;
  std::vector<const double*> centres;

  /// n spheres in a box of these edges; sizes spread evenly over so many decades below the largest radius.
  LevelCloud(int n, double x, double y, double z, double largest, double decades, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> part(0, 1);
    for (int s = 0; s < n; ++s) {
      for (const double edge : {x, y, z}) coordinates.push_back(edge * part(random));
      radii.push_back(largest * std::pow(10, -decades * part(random)));
    }
    for (int s = 0; s < n; ++s) centres.push_back(&coordinates[3 * s]);
  }
  int size() const { return static_cast<int>(radii.size()); }
  double apart(int a, int b) const {
    const double dx = centres[a][0] - centres[b][0], dy = centres[a][1] - centres[b][1], dz = centres[a][2] - centres[b][2];
    return dx * dx + dy * dy + dz * dz;
  }
};

void expect_the_near_ones(const LevelCloud& cloud, double factor, double skin) {
  SphereLevels levels;
  levels.build(cloud.size(), cloud.centres.data(), cloud.radii.data(), factor, skin);
  long pairs = 0;
  for (int i = 0; i < cloud.size(); ++i) {
    std::set<int> found, near;
    levels.for_each_near(cloud.centres[i], cloud.radii[i], [&](int j, double apart) {
      EXPECT_TRUE(found.insert(j).second) << i << " meets " << j << " twice";
      EXPECT_EQ(apart, cloud.apart(i, j));
    });
    for (int j = 0; j < cloud.size(); ++j) {
      const double reach = (cloud.radii[i] + cloud.radii[j]) * factor + skin;
      if (cloud.apart(i, j) <= reach * reach) near.insert(j);
    }
    ASSERT_EQ(found, near) << "of sphere " << i;
    pairs += static_cast<long>(near.size()) - 1;
  }
  EXPECT_GT(pairs, cloud.size());
}

TEST(SphereLevels, nothing_is_near_in_no_spheres) {
  SphereLevels levels;
  levels.build(0, nullptr, nullptr, 1, 1);
  const double origin[3] = {0, 0, 0};
  levels.for_each_near(origin, 100, [](int, double) { FAIL(); });
  EXPECT_EQ(levels.levels(), 0u);
}

TEST(SphereLevels, equal_spheres_have_one_level_and_find_their_neighbours) {
  const LevelCloud cloud(800, 1, 1, 1, 0.05, 0, 1);
  SphereLevels levels;
  levels.build(cloud.size(), cloud.centres.data(), cloud.radii.data(), 1, 0.01);
  EXPECT_EQ(levels.levels(), 1u);
  expect_the_near_ones(cloud, 1, 0.01);
}

TEST(SphereLevels, sizes_over_three_decades_find_their_neighbours) {
  const LevelCloud cloud(1500, 1, 1, 1, 0.3, 3, 2);
  SphereLevels levels;
  levels.build(cloud.size(), cloud.centres.data(), cloud.radii.data(), 1, 0);
  EXPECT_GE(levels.levels(), 9u);
  EXPECT_LE(levels.levels(), 11u);
  expect_the_near_ones(cloud, 1, 0);
}

TEST(SphereLevels, flat_and_long_clouds_and_a_contact_factor) {
  expect_the_near_ones(LevelCloud(900, 1, 1, 0, 0.05, 1, 3), 1.1, 0.002);
  expect_the_near_ones(LevelCloud(900, 20, 0.1, 0.1, 0.05, 1, 4), 1.1, 0.002);
}

TEST(SphereLevels, a_far_sphere_does_not_hide_the_others) {
  LevelCloud cloud(500, 1, 1, 1, 0.1, 0.5, 5);
  cloud.coordinates[0] = 1e7;  // needs far more cells than are made
  expect_the_near_ones(cloud, 1, 0.01);
}

TEST(SphereLevels, places_that_are_no_numbers_lead_nowhere) {
  for (const double bad : {std::nan(""), HUGE_VAL, -HUGE_VAL})
    for (const int of : {0, 7}) {
      LevelCloud cloud(20, 1, 1, 1, 0.1, 0.2, 5);
      cloud.coordinates[3 * static_cast<std::size_t>(of) + 1] = bad;
      SphereLevels levels;
      levels.build(cloud.size(), cloud.centres.data(), cloud.radii.data(), 1, 0.01);
      int found = 0;
      levels.for_each_near(cloud.centres[of], cloud.radii[of], [&](int, double) { ++found; });
      EXPECT_EQ(found, 0);
      const int other = of + 1;
      levels.for_each_near(cloud.centres[other], cloud.radii[other], [&](int j, double) { found += j == other; });
      EXPECT_EQ(found, 1);
    }
}

}  // namespace
}  // namespace solidcull
