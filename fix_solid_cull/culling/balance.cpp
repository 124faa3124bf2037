#include "balance.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "culling_benefit.h"

namespace solidcull {
namespace {

// of an interface granule, and of a stored one, which costs memory and now and then a look: in exterior granules
constexpr double interface_work = 1 - CullingBenefit::interface, interior_work = 0.01;
constexpr int slices = 100, bins = 12;  // along each axis
// a move by less than this share of a subdomain's edge is none
constexpr double least_move = 0.01;

/// Calls visit(place, work) for all granules of this rank.
template <class Visit>
void for_each_granule(const Bed& bed, Visit visit) {
  for (int i = 0; i < bed.atoms.owned; ++i)
    visit(bed.run.wrapped(bed.atoms.place(i)), bed.shell.locked(i) ? interface_work : 1.0);
  bed.solid.store().for_each([&](const Resident& g) { visit(bed.run.wrapped(bed.solid.in_world(g)), interior_work); });
}

}  // namespace

double Balance::measure() const {
  double interface_granules = 0;
  for (int i = 0; i < bed_.atoms.owned; ++i) interface_granules += bed_.shell.locked(i);
  const double work = bed_.atoms.owned - (1 - interface_work) * interface_granules +
                      interior_work * static_cast<double>(bed_.solid.store().size());
  double sum = work, largest = work;
  bed_.ranks.sum(&sum, 1);
  bed_.ranks.largest(&largest, 1);
  return sum > 0 ? largest * bed_.ranks.count / sum : 1.0;
}

bool Balance::look(std::int64_t step) {
  const Settings& s = bed_.scales.settings();
  if (s.balance_every == 0 || bed_.ranks.count == 1 || step % s.balance_every != 0) return false;
  imbalance_ = measure();
  ++compared_;
  sum_ += imbalance_;
  largest_ = std::max(largest_, imbalance_);
  due_ = imbalance_ > s.balance_threshold;
  return due_;
}

std::string Balance::end_run() {
  due_ = false;  // a deck may send granules anywhere before the next run; cuts move by one neighbour
  if (compared_ == 0) return {};
  char text[160];
  std::snprintf(
      text, sizeof text,
      "cuts between ranks moved %d times; %s the most loaded rank had %.2f times the mean work on average, %.2f at most", moves_,
      moves_ ? "after the first time" : "so far", sum_ / compared_, largest_);
  moves_ = compared_ = 0;
  sum_ = largest_ = 0;
  return text;
}

/// Of all ranks, in bins that hold about the same along each axis: what moves is a small part of the box as a rule.
WorkGrid Balance::work_in(const Cuts& cuts) const {
  WorkGrid grid;
  const auto place_in = [&](const Vec3& x, int d, const std::vector<double>& edges) {
    const auto above = std::upper_bound(edges.begin() + 1, edges.end() - 1, x[d]);
    return static_cast<std::size_t>(above - (edges.begin() + 1));
  };
  for (int d = 0; d < 3; ++d) {
    const double lo = cuts[d].front(), hi = cuts[d].back();
    std::vector<double> work(slices, 0.0);
    for_each_granule(bed_, [&](const Vec3& x, double w) {
      work[static_cast<std::size_t>(std::clamp((x[d] - lo) / (hi - lo) * slices, 0.0, slices - 1.0))] += w;
    });
    bed_.ranks.sum(work.data(), slices);
    grid.edges[d] = even_edges(lo, hi, work, bins);
  }
  grid.work.assign(grid.bins(0) * grid.bins(1) * grid.bins(2), 0.0);
  for_each_granule(bed_, [&](const Vec3& x, double w) {
    const std::size_t i = place_in(x, 0, grid.edges[0]), j = place_in(x, 1, grid.edges[1]), k = place_in(x, 2, grid.edges[2]);
    grid.work[(i * grid.bins(1) + j) * grid.bins(2) + k] += w;
  });
  bed_.ranks.sum(grid.work.data(), static_cast<int>(grid.work.size()));
  return grid;
}

/// How far atoms lie beyond the cuts of their rank (m): the engine has not sent them on since they moved, or the box has.
double Balance::strayed(const Cuts& cuts) const {
  const Box own = bed_.ranks.own();
  double farthest = 0;
  for (int d = 0; d < 3; ++d) {
    const bool ends_below = own.lo[d] == cuts[d].front(), ends_above = own.hi[d] == cuts[d].back();
    for (int i = 0; i < bed_.atoms.owned; ++i) {
      const double x = bed_.atoms.place(i)[d];
      if (!ends_below) farthest = std::max(farthest, own.lo[d] - x);
      if (!ends_above) farthest = std::max(farthest, x - own.hi[d]);
    }
  }
  bed_.ranks.largest(&farthest, 1);
  return farthest;
}

bool Balance::move() {
  if (!due_) return false;
  due_ = false;
  const Cuts before = bed_.ranks.cuts();
  const WorkGrid grid = work_in(before);
  const Cuts cuts = balanced_cuts(before, grid, bed_.ranks.thinnest(), strayed(before));
  double farthest = 0;  // in subdomains
  for (int d = 0; d < 3; ++d)
    for (std::size_t k = 1; k + 1 < cuts[d].size(); ++k)
      farthest = std::max(farthest, std::abs(cuts[d][k] - before[d][k]) * static_cast<double>(cuts[d].size() - 1) /
                                        (before[d].back() - before[d].front()));
  if (farthest < least_move) return false;
  bed_.ranks.move_cuts(cuts);
  if (++moves_ == 1) {
    compared_ = 0;
    sum_ = largest_ = 0;
  }
  char text[160];
  std::snprintf(text, sizeof text,
                "step %lld: the most loaded rank had %.2f times the mean work; cuts moved by up to %.0f %% of a rank",
                static_cast<long long>(bed_.run.deck_step()), imbalance_, 100 * farthest);
  bed_.run.say(text);
  return true;
}

}  // namespace solidcull
