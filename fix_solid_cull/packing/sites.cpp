#include "sites.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "flat_map.h"
#include "sphere_relaxation.h"

namespace solidcull {
namespace {

constexpr int sweeps_at_most = 4000;
constexpr double overlap_allowed = 1e-3;  // of a diameter

}  // namespace

PackedTile::PackedTile() : edge(std::cbrt(spheres * (M_PI / 6) / solid_fraction)) {
  std::vector<Sphere> scattered;
  for (int n = 0; n < spheres; ++n) {
    Vec3 centre;
    for (int d = 0; d < 3; ++d)
      centre[d] = edge * static_cast<double>(scrambled(static_cast<std::uint64_t>(3 * n + d + 1)) >> 11) * 0x1p-53;
    scattered.push_back({centre, 0.5});
  }
  SphereRelaxation relaxation({std::move(scattered), {}, {}, {}}, Vec3::Constant(edge));
  largest_overlap = relaxation.relax(sweeps_at_most, overlap_allowed);
  for (const Sphere& s : relaxation.spheres()) {
    Vec3 c = s.centre;
    for (int d = 0; d < 3; ++d) {
      c[d] -= edge * std::floor(c[d] / edge);
      if (!(c[d] < edge)) c[d] = 0;
    }
    centres.push_back(c);
  }
}

const PackedTile& PackedTile::one() {
  static const PackedTile tile;
  return tile;
}

Sites::Sites(double diameter)
    : diameter_(diameter),
      tile_(PackedTile::one()),
      cells_(static_cast<int>(tile_.edge)),
      cell_(static_cast<std::size_t>(cells_ * cells_ * cells_)) {
  if (!(diameter > 0) || !std::isfinite(diameter)) throw std::invalid_argument("sites: the diameter must be positive");
  for (int n = 0; n < PackedTile::spheres; ++n) {
    int at[3];
    for (int d = 0; d < 3; ++d)
      at[d] = std::min(cells_ - 1, static_cast<int>(tile_.centres[static_cast<std::size_t>(n)][d] / tile_.edge * cells_));
    cell_[static_cast<std::size_t>((at[0] * cells_ + at[1]) * cells_ + at[2])].push_back(n);
  }
}

int Sites::level_of(double radius) const {
  const double octaves = std::round(std::log2(2 * radius / diameter_));
  return static_cast<int>(std::clamp<double>(octaves, least_level, least_level + levels - 1)) - least_level;
}

double Sites::size(int level) const { return std::ldexp(diameter_, level + least_level); }

double Sites::farthest() const { return static_cast<double>(half - 2) * tile_.edge * size(0); }

Vec3 Sites::place(Number site) const {
  const int level = static_cast<int>(site & (levels - 1));
  const std::size_t sphere = site >> level_bits & (PackedTile::spheres - 1);
  Vec3 tile;
  for (int d = 0; d < 3; ++d) {
    const std::uint64_t word = site >> (level_bits + sphere_bits + d * tile_bits) & ((std::uint64_t{1} << tile_bits) - 1);
    tile[d] = static_cast<double>(static_cast<std::int64_t>(word) - half);
  }
  return size(level) * (tile_.edge * tile + tile_.centres[sphere]);
}

/// Calls visit(site, square of its distance in tile diameters) for those in the cells of a box, `at` given in tile diameters.
template <class Visit>
void Sites::for_each_near(const Vec3& at, double reach, int level, Visit visit) const {
  Cell lo, hi;
  for (int d = 0; d < 3; ++d) {
    const double a = std::floor((at[d] - reach) / tile_.edge * cells_), b = std::floor((at[d] + reach) / tile_.edge * cells_);
    if (!(std::max(std::abs(a), std::abs(b)) < static_cast<double>((half - 1) * cells_)))
      throw std::range_error("a granule at " + std::to_string(at[d] * size(level)) +
                             " is too far out for store none: use store exact");
    lo[d] = static_cast<std::int64_t>(a);
    hi[d] = static_cast<std::int64_t>(b);
  }
  for (std::int64_t i = lo[0]; i <= hi[0]; ++i)
    for (std::int64_t j = lo[1]; j <= hi[1]; ++j)
      for (std::int64_t k = lo[2]; k <= hi[2]; ++k) {
        Cell tile{i, j, k}, cell{};
        for (int d = 0; d < 3; ++d) {
          cell[d] = ((tile[d] % cells_) + cells_) % cells_;
          tile[d] = (tile[d] - cell[d]) / cells_;
        }
        const Vec3 corner(static_cast<double>(tile[0]), static_cast<double>(tile[1]), static_cast<double>(tile[2]));
        for (const int n : cell_[static_cast<std::size_t>((cell[0] * cells_ + cell[1]) * cells_ + cell[2])]) {
          Number site = static_cast<Number>(level) | static_cast<Number>(n) << level_bits;
          for (int d = 0; d < 3; ++d) site |= static_cast<Number>(tile[d] + half) << (level_bits + sphere_bits + d * tile_bits);
          visit(site, (tile_.edge * corner + tile_.centres[static_cast<std::size_t>(n)] - at).squaredNorm());
        }
      }
}

Sites::Number Sites::nearest(const Vec3& place, double radius) const {
  const int level = level_of(radius);
  const Vec3 at = place / size(level);
  Found best{0, HUGE_VAL};
  // most places are those of sites; and no hole of the tile is so large that none is found
  for (const double reach : {1e-6, 1.0, 2.0}) {
    for_each_near(at, reach, level, [&](Number site, double square) {
      if (square < best.square) best = {site, square};
    });
    if (best.square <= reach * reach) break;
  }
  return best.site;
}

std::vector<Vec3> Sites::around(const Vec3& place, double radius, double reach) const {
  const int level = level_of(radius);
  std::vector<Found> found;
  for_each_near(place / size(level), reach, level, [&](Number site, double square) {
    if (square < reach * reach) found.push_back({site, square});
  });
  std::sort(found.begin(), found.end(),
            [](const Found& a, const Found& b) { return a.square != b.square ? a.square < b.square : a.site < b.site; });
  std::vector<Vec3> places;
  for (const Found& f : found) places.push_back(this->place(f.site));
  return places;
}

}  // namespace solidcull
