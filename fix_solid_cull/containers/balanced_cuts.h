// Where a box is to be cut so that all ranks along an axis have the same work.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace solidcull {

/// cuts: as they are (m), ascending, both ends of the box among them, which stay; work: in equal slices from end to end. The cuts
/// that part it evenly, as near as these hold: none goes past where a neighbouring one was, so that nothing changes over to a rank
/// that is no neighbour; no two are nearer than `thinnest` (m). As they were, where they cannot be that far apart, or there is no
/// work.
inline std::vector<double> balanced_cuts(const std::vector<double>& cuts, const std::vector<double>& work, double thinnest) {
  const std::size_t parts = cuts.size() - 1;
  const double lo = cuts.front(), edge = cuts.back() - lo, slice = edge / static_cast<double>(work.size());
  double all = 0;
  for (const double w : work) all += w;
  std::vector<double> moved = cuts;
  if (parts < 2 || !(all > 0)) return moved;
  double below = 0;
  std::size_t s = 0;
  for (std::size_t k = 1; k < parts; ++k) {
    const double wanted = all * static_cast<double>(k) / static_cast<double>(parts);
    while (s + 1 < work.size() && below + work[s] < wanted) below += work[s++];
    const double within = work[s] > 0 ? std::clamp((wanted - below) / work[s], 0.0, 1.0) : 0.0;
    moved[k] = std::clamp(lo + (static_cast<double>(s) + within) * slice, cuts[k - 1], cuts[k + 1]);
  }
  // apart, from both ends
  for (std::size_t k = 1; k < parts; ++k) moved[k] = std::max(moved[k], moved[k - 1] + thinnest);
  for (std::size_t k = parts - 1; k > 0; --k) moved[k] = std::min(moved[k], moved[k + 1] - thinnest);
  for (std::size_t k = 1; k <= parts; ++k) {
    const bool within = k == parts || (moved[k] >= cuts[k - 1] && moved[k] <= cuts[k + 1]);
    if (!within || moved[k] - moved[k - 1] < thinnest * (1 - 1e-9)) return cuts;
  }
  return moved;
}

}  // namespace solidcull
