// A box that is cut among a grid of ranks, and who is near one of them.
#pragma once

#include <algorithm>
#include <array>
#include <cstdlib>
#include <vector>

#include "sphere.h"

namespace solidcull {

/// Each rank owns one cell of the grid. m, world frame.
struct RankGrid {
  using Cell = std::array<int, 3>;
  /// A cell whose owner sees what is within some width of it; places of this rank are shifted by one of these into its
  /// neighbourhood.
  struct Partner {
    Cell cell;
    Vec3 lo, hi;
    std::vector<Vec3> shifts;
  };

  std::array<std::vector<double>, 3> cuts;  ///< along each axis, ascending, one more than cells; the outer ones may be infinite
  Vec3 periods = Vec3::Zero();              ///< edges of the box where it is periodic, else 0

  int cells(int axis) const { return static_cast<int>(cuts[axis].size()) - 1; }
  Vec3 lo(const Cell& c) const { return {cuts[0][at(c, 0)], cuts[1][at(c, 1)], cuts[2][at(c, 2)]}; }
  Vec3 hi(const Cell& c) const { return {cuts[0][at(c, 0) + 1], cuts[1][at(c, 1) + 1], cuts[2][at(c, 2) + 1]}; }

  /// That of a place within the box, or beyond a side that is not periodic.
  Cell cell_of(const Vec3& place) const {
    Cell c{};
    for (int d = 0; d < 3; ++d) {
      const auto inner = cuts[d].begin() + 1, last = cuts[d].end() - 1;
      c[static_cast<std::size_t>(d)] = static_cast<int>(std::upper_bound(inner, last, place[d]) - inner);
    }
    return c;
  }

  /// The same cell, or one beside it, over corners too.
  bool are_neighbours(const Cell& a, const Cell& b) const {
    for (int d = 0; d < 3; ++d) {
      const int apart = std::abs(a[static_cast<std::size_t>(d)] - b[static_cast<std::size_t>(d)]);
      if (apart > 1 && !(periods[d] > 0 && apart == cells(d) - 1)) return false;
    }
    return true;
  }

  /// The cells within `width` of cell `own`, or of one of its nearest periodic images; itself by its images alone. Shifts are in
  /// the order of Ranks::image_shifts().
  std::vector<Partner> around(const Cell& own, double width) const {
    // along each axis: which cells are near enough, with which image
    std::array<std::vector<std::array<int, 2>>, 3> near;
    for (int d = 0; d < 3; ++d)
      for (int c = 0; c < cells(d); ++c)
        for (const int image : {0, -1, 1}) {
          if (image && !(periods[d] > 0)) continue;
          // to the last digit as that cell's owner finds it, with the opposite image: else one waits for the other for ever
          const double by = image * periods[d], before = cuts[d][at(own, d)] - cuts[d][static_cast<std::size_t>(c) + 1],
                       after = cuts[d][static_cast<std::size_t>(c)] - cuts[d][at(own, d) + 1];
          if (before + by <= width && after - by <= width) near[d].push_back({c, image});
        }
    std::vector<Partner> all;
    std::vector<std::array<int, 7>> found;  // cell, first of all images, image
    for (const auto& x : near[0])
      for (const auto& y : near[1])
        for (const auto& z : near[2]) {
          const bool shifted = x[1] || y[1] || z[1];
          if (!shifted && x[0] == own[0] && y[0] == own[1] && z[0] == own[2]) continue;
          found.push_back({x[0], y[0], z[0], shifted, x[1], y[1], z[1]});
        }
    std::sort(found.begin(), found.end());
    for (const auto& f : found) {
      const Cell cell{f[0], f[1], f[2]};
      if (all.empty() || all.back().cell != cell) all.push_back({cell, lo(cell), hi(cell), {}});
      all.back().shifts.emplace_back(f[4] * periods[0], f[5] * periods[1], f[6] * periods[2]);
    }
    return all;
  }

 private:
  static std::size_t at(const Cell& c, int axis) { return static_cast<std::size_t>(c[static_cast<std::size_t>(axis)]); }
};

}  // namespace solidcull
