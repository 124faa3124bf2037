#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "balanced_cuts.h"

namespace solidcull {
namespace {

using Cuts = std::vector<double>;

/// Work between two places, spread evenly in each slice.
double between(const Cuts& work, double edge, double lo, double hi) {
  const double slice = edge / static_cast<double>(work.size());
  double sum = 0;
  for (std::size_t s = 0; s < work.size(); ++s) {
    const double from = std::max(lo, static_cast<double>(s) * slice), to = std::min(hi, static_cast<double>(s + 1) * slice);
    if (to > from) sum += work[s] * (to - from) / slice;
  }
  return sum;
}

TEST(BalancedCuts, even_work_leaves_even_cuts_where_they_are) {
  const Cuts even = {0, 1, 2, 3, 4};
  const Cuts moved = balanced_cuts(even, Cuts(40, 1.0), 0.1);
  for (std::size_t k = 0; k < even.size(); ++k) EXPECT_NEAR(moved[k], even[k], 1e-12);
}

TEST(BalancedCuts, all_parts_get_the_same_work_after_a_few_moves) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> some(0, 1);
  for (int trial = 0; trial < 100; ++trial) {
    const std::size_t parts = 2 + trial % 6;
    Cuts work(100), cuts;
    for (double& w : work) w = some(random);
    for (std::size_t k = 0; k <= parts; ++k) cuts.push_back(10.0 * static_cast<double>(k) / static_cast<double>(parts));
    for (int move = 0; move < 20; ++move) {
      const Cuts before = cuts;
      cuts = balanced_cuts(cuts, work, 1e-3);
      for (std::size_t k = 1; k < parts; ++k) {
        EXPECT_GE(cuts[k], before[k - 1]);
        EXPECT_LE(cuts[k], before[k + 1]);
        EXPECT_LT(cuts[k - 1], cuts[k]);
      }
    }
    const double share = between(work, 10, 0, 10) / static_cast<double>(parts);
    for (std::size_t k = 0; k < parts; ++k) EXPECT_NEAR(between(work, 10, cuts[k], cuts[k + 1]), share, 1e-9 * share);
  }
}

TEST(BalancedCuts, a_heap_in_one_corner_draws_them_near_but_no_nearer_than_they_may_be) {
  Cuts work(100, 0.0);
  work[0] = 1;
  Cuts cuts = {0, 1, 2, 3, 4};
  for (int move = 0; move < 10; ++move) cuts = balanced_cuts(cuts, work, 0.2);
  const Cuts due = {0, 0.2, 0.4, 0.6, 4};
  for (std::size_t k = 0; k < due.size(); ++k) EXPECT_NEAR(cuts[k], due[k], 1e-12) << k;
}

TEST(BalancedCuts, what_cannot_be_cut_stays_as_it_is) {
  EXPECT_EQ(balanced_cuts({0, 1, 2}, {0, 0, 0}, 0.1), Cuts({0, 1, 2}));   // no work
  EXPECT_EQ(balanced_cuts({0, 1, 2}, {1, 0, 0}, 1.5), Cuts({0, 1, 2}));   // too thick
  EXPECT_EQ(balanced_cuts({0, 2}, {1, 0, 0}, 0.1), Cuts({0, 2}));         // one rank
}

}  // namespace
}  // namespace solidcull
