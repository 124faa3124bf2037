#include "balanced_cuts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

namespace solidcull {
namespace {

constexpr int sweeps = 8, samples = 16, narrowings = 12;
// What is made least is the sum of the ranks' works to this power: nearly the largest of them, but it also falls where a cut
// makes room for another one to relieve the most loaded rank. The largest alone does not, and cuts would stop half way.
constexpr int power = 8;

using Sums = std::vector<std::vector<double>>;  // of each column of cells along an axis: work up to each edge of its bins

/// The share of each bin that lies in each cell, as rows of (cell, share): nearly all bins lie in one.
std::vector<std::vector<std::pair<std::size_t, double>>> shares(const std::vector<double>& edges,
                                                                const std::vector<double>& cuts) {
  std::vector<std::vector<std::pair<std::size_t, double>>> all(edges.size() - 1);
  for (std::size_t b = 0; b + 1 < edges.size(); ++b)
    for (std::size_t c = 0; c + 1 < cuts.size(); ++c) {
      const double lo = std::max(edges[b], cuts[c]), hi = std::min(edges[b + 1], cuts[c + 1]);
      if (hi > lo) all[b].emplace_back(c, (hi - lo) / (edges[b + 1] - edges[b]));
    }
  return all;
}

/// For the cells as the two other axes cut them.
Sums sums_along(int axis, const Cuts& cuts, const WorkGrid& grid) {
  const int u = (axis + 1) % 3, v = (axis + 2) % 3;
  const auto in_u = shares(grid.edges[static_cast<std::size_t>(u)], cuts[static_cast<std::size_t>(u)]);
  const auto in_v = shares(grid.edges[static_cast<std::size_t>(v)], cuts[static_cast<std::size_t>(v)]);
  const std::size_t across = cuts[static_cast<std::size_t>(v)].size() - 1,
                    columns = (cuts[static_cast<std::size_t>(u)].size() - 1) * across;
  Sums sums(columns, std::vector<double>(grid.bins(axis) + 1, 0.0));
  std::array<std::size_t, 3> at{};
  std::size_t bin = 0;
  for (at[0] = 0; at[0] < grid.bins(0); ++at[0])
    for (at[1] = 0; at[1] < grid.bins(1); ++at[1])
      for (at[2] = 0; at[2] < grid.bins(2); ++at[2], ++bin) {
        if (grid.work[bin] == 0) continue;
        for (const auto& [a, part] : in_u[at[static_cast<std::size_t>(u)]])
          for (const auto& [b, of_it] : in_v[at[static_cast<std::size_t>(v)]])
            sums[a * across + b][at[static_cast<std::size_t>(axis)] + 1] += part * of_it * grid.work[bin];
      }
  for (std::vector<double>& s : sums) std::partial_sum(s.begin(), s.end(), s.begin());
  return sums;
}

double up_to(double x, const std::vector<double>& edges, const std::vector<double>& sum) {
  const auto above = std::upper_bound(edges.begin(), edges.end(), x);
  if (above == edges.begin()) return 0;
  if (above == edges.end()) return sum.back();
  const std::size_t b = static_cast<std::size_t>(above - edges.begin()) - 1;
  return sum[b] + (sum[b + 1] - sum[b]) * (x - edges[b]) / (edges[b + 1] - edges[b]);
}

/// Most work of a cell between two places, over all columns.
double most_between(double lo, double hi, const std::vector<double>& edges, const Sums& sums) {
  double most = 0;
  for (const std::vector<double>& s : sums) most = std::max(most, up_to(hi, edges, s) - up_to(lo, edges, s));
  return most;
}

/// Of the cells on both sides of a cut at x, between its neighbours.
double load_at(double x, double below, double above, const std::vector<double>& edges, const Sums& sums) {
  double load = 0;
  for (const std::vector<double>& s : sums) {
    const double here = up_to(x, edges, s);
    load += std::pow(here - up_to(below, edges, s), power) + std::pow(up_to(above, edges, s) - here, power);
  }
  return load;
}

/// Where cut k may go from and to; nothing has strayed in over the ends of the box.
std::array<double, 2> room(const std::vector<double>& before, std::size_t k, double strayed) {
  return {before[k - 1] + (k > 1 ? strayed : 0), before[k + 1] - (k + 2 < before.size() ? strayed : 0)};
}

/// One cut after the other goes where the load is least.
Cuts descend(Cuts cuts, const Cuts& before, const WorkGrid& grid, double thinnest, double strayed) {
  for (int sweep = 0; sweep < sweeps; ++sweep)
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::vector<double>& edges = grid.edges[axis];
      std::vector<double>& now = cuts[axis];
      if (now.size() <= 2) continue;
      const Sums sums = sums_along(static_cast<int>(axis), cuts, grid);
      for (std::size_t k = 1; k + 1 < now.size(); ++k) {
        const auto [from, to] = room(before[axis], k, strayed);
        double lo = std::max(now[k - 1] + thinnest, from), hi = std::min(now[k + 1] - thinnest, to);
        if (lo >= hi) continue;
        double best = now[k], least = load_at(best, now[k - 1], now[k + 1], edges, sums);
        for (int narrowing = 0; narrowing < narrowings; ++narrowing) {
          const double step = (hi - lo) / samples;
          for (int n = 0; n <= samples; ++n) {
            const double x = lo + n * step, load = load_at(x, now[k - 1], now[k + 1], edges, sums);
            if (load < least) best = x, least = load;
          }
          lo = std::max(lo, best - step);
          hi = std::min(hi, best + step);
        }
        now[k] = best;
      }
    }
  return cuts;
}

/// Cuts that give each slab along an axis the same, as far as they may go.
Cuts even_slabs(const Cuts& cuts, const WorkGrid& grid, double thinnest, double strayed) {
  Cuts even = cuts;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    Cuts one = {std::vector<double>{grid.edges[0].front(), grid.edges[0].back()},
                std::vector<double>{grid.edges[1].front(), grid.edges[1].back()},
                std::vector<double>{grid.edges[2].front(), grid.edges[2].back()}};
    const std::vector<double> sum = sums_along(static_cast<int>(axis), one, grid).front(), &edges = grid.edges[axis];
    std::vector<double>& now = even[axis];
    const std::size_t parts = now.size() - 1;
    for (std::size_t k = 1; k < parts; ++k) {
      const double wanted = sum.back() * static_cast<double>(k) / static_cast<double>(parts);
      const std::size_t b = static_cast<std::size_t>(std::upper_bound(sum.begin() + 1, sum.end() - 1, wanted) - sum.begin()) - 1;
      const double in_bin = sum[b + 1] - sum[b], at = in_bin > 0 ? std::clamp((wanted - sum[b]) / in_bin, 0.0, 1.0) : 0.5;
      const auto [from, to] = room(cuts[axis], k, strayed);
      now[k] = std::max(from, std::min(edges[b] + at * (edges[b + 1] - edges[b]), to));
    }
    for (std::size_t k = 1; k < parts; ++k) now[k] = std::max(now[k], now[k - 1] + thinnest);
    for (std::size_t k = parts - 1; k > 0; --k) now[k] = std::min(now[k], now[k + 1] - thinnest);
    for (std::size_t k = 1; k < parts; ++k) {
      const auto [from, to] = room(cuts[axis], k, strayed);
      if (now[k] < now[k - 1] + thinnest * (1 - 1e-9) || now[k] < from || now[k] > to) {
        now = cuts[axis];
        break;
      }
    }
  }
  return even;
}

}  // namespace

std::vector<double> even_edges(double lo, double hi, const std::vector<double>& slices, std::size_t bins) {
  const double thick = (hi - lo) / static_cast<double>(slices.size());
  const double all = std::accumulate(slices.begin(), slices.end(), 0.0);
  std::vector<double> edges{lo};
  double below = 0;
  std::size_t s = 0;
  for (std::size_t b = 1; b < bins && all > 0; ++b) {
    const double wanted = all * static_cast<double>(b) / static_cast<double>(bins);
    while (s + 1 < slices.size() && below + slices[s] < wanted) below += slices[s++];
    const double within = slices[s] > 0 ? std::clamp((wanted - below) / slices[s], 0.0, 1.0) : 0.0;
    const double edge = lo + (static_cast<double>(s) + within) * thick;
    if (edge > edges.back() && edge < hi) edges.push_back(edge);
  }
  edges.push_back(hi);
  return edges;
}

Cuts balanced_cuts(const Cuts& cuts, const WorkGrid& grid, double thinnest, double strayed) {
  const Cuts moved = descend(cuts, cuts, grid, thinnest, strayed);
  // where that ends in a valley of its own
  const Cuts anew = descend(even_slabs(cuts, grid, thinnest, strayed), cuts, grid, thinnest, strayed);
  return imbalance(anew, grid) < imbalance(moved, grid) ? anew : moved;
}

double imbalance(const Cuts& cuts, const WorkGrid& grid) {
  const double all = std::accumulate(grid.work.begin(), grid.work.end(), 0.0);
  if (!(all > 0)) return 1;
  const Sums sums = sums_along(0, cuts, grid);
  double most = 0;
  for (std::size_t k = 1; k < cuts[0].size(); ++k)
    most = std::max(most, most_between(cuts[0][k - 1], cuts[0][k], grid.edges[0], sums));
  std::size_t cells = 1;
  for (const std::vector<double>& c : cuts) cells *= c.size() - 1;
  return most * static_cast<double>(cells) / all;
}

}  // namespace solidcull
