#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "balanced_cuts.h"

namespace solidcull {
namespace {

std::vector<double> evenly(double lo, double hi, int parts) {
  std::vector<double> at;
  for (int k = 0; k <= parts; ++k) at.push_back(lo + (hi - lo) * k / parts);
  return at;
}

/// work(x, y, z) at the middle of each of n^3 bins of a box of edge 1.
template <class Work>
WorkGrid grid_of(int n, Work work) {
  WorkGrid grid;
  for (auto& e : grid.edges) e = evenly(0, 1, n);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      for (int k = 0; k < n; ++k) grid.work.push_back(work((i + 0.5) / n, (j + 0.5) / n, (k + 0.5) / n));
  return grid;
}

Cuts even_cuts(int x, int y, int z) { return {evenly(0, 1, x), evenly(0, 1, y), evenly(0, 1, z)}; }

/// As a run would, a few times.
Cuts settled(Cuts cuts, const WorkGrid& grid, double thinnest) {
  for (int move = 0; move < 10; ++move) {
    const Cuts before = cuts;
    cuts = balanced_cuts(cuts, grid, thinnest, 0);
    for (int d = 0; d < 3; ++d)
      for (std::size_t k = 1; k + 1 < cuts[d].size(); ++k) {
        EXPECT_GE(cuts[d][k], before[d][k - 1]);
        EXPECT_LE(cuts[d][k], before[d][k + 1]);
        EXPECT_GE(cuts[d][k] - cuts[d][k - 1], thinnest * (1 - 1e-9));
      }
  }
  return cuts;
}

TEST(BalancedCuts, even_work_leaves_even_cuts_where_they_are) {
  const WorkGrid even = grid_of(12, [](double, double, double) { return 1.0; });
  const Cuts cuts = even_cuts(4, 3, 1), moved = balanced_cuts(cuts, even, 0.01, 0);
  for (int d = 0; d < 3; ++d)
    for (std::size_t k = 0; k < cuts[d].size(); ++k) EXPECT_NEAR(moved[d][k], cuts[d][k], 1e-9);
  EXPECT_NEAR(imbalance(cuts, even), 1, 1e-12);
}

TEST(BalancedCuts, along_one_axis_all_ranks_get_the_same) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> some(0.1, 1);
  for (int parts = 2; parts < 8; ++parts) {
    std::vector<double> of(16);
    for (double& w : of) w = some(random);
    const WorkGrid grid = grid_of(16, [&](double x, double, double) { return of[static_cast<std::size_t>(x * 16)]; });
    EXPECT_NEAR(imbalance(settled(even_cuts(parts, 1, 1), grid, 1e-3), grid), 1, 0.01) << parts;
  }
}

TEST(BalancedCuts, a_blow_in_a_corner_is_shared_by_eight_ranks) {
  const WorkGrid grid =
      grid_of(16, [](double x, double y, double z) { return std::hypot(x - 0.2, y - 0.2, z - 0.9) < 0.5 ? 1.0 : 0.02; });
  const Cuts cuts = even_cuts(2, 2, 2);
  EXPECT_GT(imbalance(cuts, grid), 2);
  EXPECT_LT(imbalance(settled(cuts, grid, 0.05), grid), 1.1);
}

TEST(BalancedCuts, work_along_a_diagonal_is_shared_as_well_as_cuts_through_the_box_can) {
  // halves of equal work along x and y leave all of it to two of four ranks: no straight cuts do better than that by much
  const WorkGrid grid = grid_of(16, [](double x, double y, double) { return std::abs(x - y) < 0.1 ? 1.0 : 0.0; });
  EXPECT_LT(imbalance(settled(even_cuts(2, 2, 1), grid, 0.05), grid), 2.01);
}

TEST(BalancedCuts, no_two_are_nearer_than_they_may_be) {
  const WorkGrid heap = grid_of(20, [](double x, double, double) { return x < 0.05 ? 1.0 : 0.0; });
  const Cuts cuts = settled(even_cuts(4, 1, 1), heap, 0.04);
  for (std::size_t k = 1; k < cuts[0].size(); ++k) EXPECT_GE(cuts[0][k] - cuts[0][k - 1], 0.04 * (1 - 1e-9));
  EXPECT_LT(cuts[0][1], 0.05);
  const Cuts thick = even_cuts(4, 1, 1);
  EXPECT_EQ(balanced_cuts(thick, heap, 0.3, 0)[0], thick[0]) << "they are nearer than that already";
}

// a granule that has crossed a cut since the engine sent granules on is two ranks away where the next cut comes to meet it: lost
TEST(BalancedCuts, what_has_strayed_over_a_cut_goes_to_a_neighbour_at_most) {
  constexpr double strayed = 0.03;
  std::mt19937 random(8);
  std::uniform_real_distribution<double> some(0, 1);
  int moved = 0;
  for (int trial = 0; trial < 60; ++trial) {
    const double heap = some(random), wide = 0.05 + 0.2 * some(random);
    const WorkGrid grid = grid_of(20, [&](double x, double, double) { return std::abs(x - heap) < wide ? 1.0 : 0.01; });
    Cuts cuts = even_cuts(8, 1, 1);
    for (int move = 0; move < 4; ++move) {
      const std::vector<double> before = cuts[0];
      cuts = balanced_cuts(cuts, grid, 0.05, strayed);
      moved += cuts[0] != before;
      for (int j = 0; j < 8; ++j)
        for (const double x : {before[j] - (j > 0 ? strayed : 0), before[j + 1] + (j < 7 ? strayed : 0) - 1e-12}) {
          const auto above = std::upper_bound(cuts[0].begin() + 1, cuts[0].end() - 1, x);
          EXPECT_LE(std::abs(above - (cuts[0].begin() + 1) - j), 1) << "heap at " << heap << ", " << x << " of rank " << j;
        }
    }
  }
  EXPECT_GT(moved, 180);
}

TEST(BalancedCuts, edges_of_bins_part_the_work_evenly) {
  const std::vector<double> edges = even_edges(1, 2, {0, 0, 4, 4, 0, 0, 0, 0, 0, 0}, 4);
  const std::vector<double> due = {1, 1.25, 1.3, 1.35, 2};
  ASSERT_EQ(edges.size(), due.size());
  for (std::size_t k = 0; k < due.size(); ++k) EXPECT_NEAR(edges[k], due[k], 1e-12);
  EXPECT_EQ(even_edges(0, 1, {0, 0}, 4), (std::vector<double>{0, 1}));
}

}  // namespace
}  // namespace solidcull
