#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "rank_grid.h"

namespace solidcull {
namespace {

RankGrid grid_of(int x, int y, int z, bool periodic = false) {
  RankGrid g;
  const int n[] = {x, y, z};
  for (int d = 0; d < 3; ++d)
    for (int c = 0; c <= n[d]; ++c) g.cuts[d].push_back(static_cast<double>(c) / n[d]);
  if (periodic) {
    g.periods = Vec3::Ones();
  } else {
    for (auto& cuts : g.cuts) cuts.front() = -HUGE_VAL, cuts.back() = HUGE_VAL;
  }
  return g;
}

TEST(RankGrid, of_a_thousand_ranks_has_26_partners_at_most) {
  for (const bool periodic : {false, true}) {
    const RankGrid g = grid_of(10, 10, 10, periodic);
    EXPECT_EQ(g.around({4, 5, 6}, 0.05).size(), 26u);
    EXPECT_EQ(g.around({0, 0, 0}, 0.05).size(), periodic ? 26u : 7u);
    EXPECT_EQ(g.around({0, 5, 0}, 0.05).size(), periodic ? 26u : 11u);
  }
}

TEST(RankGrid, cells_beside_each_other_are_neighbours_over_corners_and_periodic_sides) {
  for (const bool periodic : {false, true}) {
    const RankGrid g = grid_of(8, 1, 2, periodic);
    EXPECT_TRUE(g.are_neighbours({3, 0, 0}, {3, 0, 0}));
    EXPECT_TRUE(g.are_neighbours({3, 0, 0}, {4, 0, 1}));
    EXPECT_FALSE(g.are_neighbours({3, 0, 0}, {5, 0, 0}));
    EXPECT_EQ(g.are_neighbours({0, 0, 0}, {7, 0, 1}), periodic);
    EXPECT_FALSE(g.are_neighbours({1, 0, 0}, {7, 0, 1}));
  }
}

TEST(RankGrid, each_place_is_in_one_cell) {
  for (const bool periodic : {false, true}) {
    const RankGrid g = grid_of(4, 3, 2, periodic);
    EXPECT_EQ(g.cell_of({0, 0, 0}), (RankGrid::Cell{0, 0, 0}));
    EXPECT_EQ(g.cell_of({0.25, 1.0 / 3, 0.5}), (RankGrid::Cell{1, 1, 1}));  // a border is the next one's
    EXPECT_EQ(g.cell_of({0.99, 0.99, 0.99}), (RankGrid::Cell{3, 2, 1}));
  }
  EXPECT_EQ(grid_of(4, 3, 2).cell_of({-5, 7, 0.2}), (RankGrid::Cell{0, 2, 0}));
}

TEST(RankGrid, two_cells_are_partners_of_each_other_by_opposite_shifts) {
  for (const bool periodic : {false, true})
    for (const double width : {0.01, 0.3, 0.6}) {
      const RankGrid g = grid_of(4, 3, 2, periodic);
      for (int x = 0; x < 4; ++x)
        for (int y = 0; y < 3; ++y)
          for (int z = 0; z < 2; ++z)
            for (const RankGrid::Partner& p : g.around({x, y, z}, width)) {
              bool back = false;
              for (const RankGrid::Partner& q : g.around(p.cell, width))
                if (q.cell == RankGrid::Cell{x, y, z}) {
                  back = true;
                  EXPECT_EQ(q.shifts.size(), p.shifts.size());
                  for (const Vec3& s : p.shifts)
                    EXPECT_TRUE(std::any_of(q.shifts.begin(), q.shifts.end(), [&](const Vec3& t) { return t == -s; }));
                }
              EXPECT_TRUE(back);
            }
    }
}

// Lattices, boxes and skins of round numbers are as far apart as they are wide: five ranks of 7.2 mm, granules of 3 mm and a skin
// of 0.6 mm waited for each other for ever.
TEST(RankGrid, cells_just_as_far_apart_as_the_width_are_partners_of_each_other_or_not_at_all) {
  int ties = 0;
  for (const bool periodic : {false, true})
    for (const double edge : {0.036, 0.05, 0.075, 1.0})
      for (int n = 2; n <= 12; ++n) {
        RankGrid g = grid_of(1, 1, 1, periodic);
        g.cuts[0].clear();
        for (int c = 0; c <= n; ++c) g.cuts[0].push_back(-0.0001 + static_cast<double>(c) / n * edge);
        if (periodic) g.periods[0] = edge;
        for (int k = 1; k < n; ++k) {
          const double width = k * (edge / n);
          const auto knows = [&](int a, int b) {
            const auto partners = g.around({a, 0, 0}, width);
            return std::any_of(partners.begin(), partners.end(), [&](const auto& p) {
              return p.cell == RankGrid::Cell{b, 0, 0};
            });
          };
          for (int a = 0; a < n; ++a)
            for (int b = 0; b < a; ++b) {
              ties += a - b == k + 1;
              EXPECT_EQ(knows(a, b), knows(b, a)) << n << " of " << edge << " m, " << a << " and " << b << ", width " << width;
            }
        }
      }
  EXPECT_GT(ties, 1000);
}

TEST(RankGrid, whoever_is_within_the_width_is_a_partner) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (const bool periodic : {false, true}) {
    const RankGrid g = grid_of(5, 4, 3, periodic);
    const double width = 0.21;
    for (int n = 0; n < 2000; ++n) {
      const Vec3 x(uniform(random), uniform(random), uniform(random));
      const RankGrid::Cell own{static_cast<int>(5 * x[0]), static_cast<int>(4 * x[1]), static_cast<int>(3 * x[2])};
      int due = 0, found = 0;
      const auto near = [&](const Vec3& y, const Vec3& lo, const Vec3& hi) {
        return (y.array() >= lo.array() - width).all() && (y.array() <= hi.array() + width).all();
      };
      for (int i = -1; i <= 1; ++i)
        for (int j = -1; j <= 1; ++j)
          for (int k = -1; k <= 1; ++k) {
            if (!periodic && (i || j || k)) continue;
            for (int c = 0; c < 60; ++c) {
              const RankGrid::Cell cell{c / 12, c / 3 % 4, c % 3};
              if (cell == own && !i && !j && !k) continue;
              due += near(x + Vec3(i, j, k), g.lo(cell), g.hi(cell));
            }
          }
      for (const RankGrid::Partner& p : g.around(own, width))
        for (const Vec3& s : p.shifts) found += near(x + s, p.lo, p.hi);
      EXPECT_EQ(found, due) << x.transpose();
    }
  }
}

TEST(RankGrid, a_wide_reach_takes_all_cells) {
  EXPECT_EQ(grid_of(3, 3, 3).around({0, 0, 0}, 10).size(), 26u);
  EXPECT_EQ(grid_of(1, 1, 1).around({0, 0, 0}, 10).size(), 0u);
  const auto itself = grid_of(1, 1, 1, true).around({0, 0, 0}, 0.1);
  ASSERT_EQ(itself.size(), 1u);
  EXPECT_EQ(itself[0].shifts.size(), 26u);
}

}  // namespace
}  // namespace solidcull
