// Where a box is to be cut among a grid of ranks so that none of them has much more work than the others.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace solidcull {

/// Cuts along each axis, ascending, both ends of the box among them (m).
using Cuts = std::array<std::vector<double>, 3>;

/// Work in bins of a box, spread evenly in each.
struct WorkGrid {
  Cuts edges;                ///< of the bins
  std::vector<double> work;  ///< of bin (i, j, k) at (i * bins(1) + j) * bins(2) + k

  std::size_t bins(int axis) const { return edges[static_cast<std::size_t>(axis)].size() - 1; }
};

/// Edges that part what `slices`, equally thick from lo to hi, hold into `bins` of about the same.
std::vector<double> even_edges(double lo, double hi, const std::vector<double>& slices, std::size_t bins);

/// Cuts at which the most loaded rank has little more than the mean, as far as straight cuts can, and as these hold: nothing
/// changes over to a rank that is no neighbour, and no two cuts are nearer than `thinnest` (m). The ends stay. What a rank has
/// may lie `strayed` (m) beyond its cuts: so no cut comes nearer to where a neighbouring one was.
Cuts balanced_cuts(const Cuts& cuts, const WorkGrid& grid, double thinnest, double strayed);

/// Largest work of a rank over the mean.
double imbalance(const Cuts& cuts, const WorkGrid& grid);

}  // namespace solidcull
