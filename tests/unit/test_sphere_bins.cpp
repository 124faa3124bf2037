#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "sphere_bins.h"

namespace solidcull {
namespace {

constexpr double reach_factor = 1.1, skin = 0.05, bin_edge = 0.17;  // of a bin
constexpr int across = 12;

/// Spheres in the middle of a grid, two bins from its sides.
struct Cloud {
  std::vector<double> coordinates, radii;
  std::vector<const double*> centres;
  std::vector<int> bin, offsets;

  Cloud(int n, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> place(2 * bin_edge, (across - 2) * bin_edge), radius(0.1, 0.13);
    for (int i = 0; i < n; ++i) {
      int b = 0;
      for (int d = 0; d < 3; ++d) {
        coordinates.push_back(place(random));
        b = across * b + static_cast<int>(coordinates.back() / bin_edge);
      }
      radii.push_back(radius(random));
      bin.push_back(b);
    }
    for (int i = 0; i < n; ++i) centres.push_back(&coordinates[3 * static_cast<std::size_t>(i)]);
    for (int i = -2; i <= 2; ++i)
      for (int j = -2; j <= 2; ++j)
        for (int k = -2; k <= 2; ++k) offsets.push_back((i * across + j) * across + k);
  }
  int size() const { return static_cast<int>(radii.size()); }
  double apart(int a, int b) const {
    double sum = 0;
    for (int d = 0; d < 3; ++d) sum += (centres[a][d] - centres[b][d]) * (centres[a][d] - centres[b][d]);
    return sum;
  }
  void build(SphereBins& into) const {
    into.build(size(), centres.data(), radii.data(), bin.data(), offsets.data(), static_cast<int>(offsets.size()), reach_factor,
               skin);
  }
};

TEST(SphereBins, finds_each_near_one_of_higher_index_once_by_bins_and_then_by_indices) {
  const Cloud cloud(1500, 5);
  SphereBins found;
  cloud.build(found);
  std::size_t pairs = 0;
  for (int i = 0; i < cloud.size(); ++i) {
    std::vector<int> near;
    for (int j = i + 1; j < cloud.size(); ++j) {
      const double reach = (cloud.radii[i] + cloud.radii[j]) * reach_factor + skin;
      if (cloud.apart(i, j) <= reach * reach) near.push_back(j);
    }
    std::stable_sort(near.begin(), near.end(), [&](int a, int b) { return cloud.bin[a] < cloud.bin[b]; });
    const std::vector<SphereBins::Near>& all = found.above(i, cloud.centres[i], cloud.radii[i], cloud.bin[i]);
    ASSERT_EQ(found.found(), near.size()) << "of sphere " << i;
    for (std::size_t k = 0; k < near.size(); ++k) {
      ASSERT_EQ(all[k].index, near[k]) << "of sphere " << i;
      ASSERT_EQ(all[k].apart, cloud.apart(i, near[k]));
    }
    pairs += near.size();
  }
  EXPECT_GT(pairs, 10000u);
}

TEST(SphereBins, is_built_anew) {
  SphereBins found;
  Cloud(700, 6).build(found);
  const Cloud cloud(300, 7);
  cloud.build(found);
  std::size_t pairs = 0, due = 0;
  for (int i = 0; i < cloud.size(); ++i) {
    found.above(i, cloud.centres[i], cloud.radii[i], cloud.bin[i]);
    pairs += found.found();
    for (int j = i + 1; j < cloud.size(); ++j) {
      const double reach = (cloud.radii[i] + cloud.radii[j]) * reach_factor + skin;
      due += cloud.apart(i, j) <= reach * reach;
    }
  }
  EXPECT_EQ(pairs, due);
  EXPECT_GT(pairs, 0u);
}

TEST(SphereBins, no_spheres) {
  SphereBins none;
  none.build(0, nullptr, nullptr, nullptr, nullptr, 0, reach_factor, skin);
  const double origin[3] = {0, 0, 0};
  none.above(0, origin, 1, 0);
  EXPECT_EQ(none.found(), 0u);
}

}  // namespace
}  // namespace solidcull
