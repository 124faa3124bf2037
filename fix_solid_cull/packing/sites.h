// Where granules of which no place is kept may be: the sites of a random packing, relaxed once and repeated through space
// (theory.md#refill).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "sphere.h"

namespace solidcull {

/// A periodic tile of random close-packed unit spheres (diameter 1), the same in each run on each machine.
struct PackedTile {
  static constexpr int spheres = 512;
  static constexpr double solid_fraction =
      0.625;  ///< a little denser than granules pack under their weight: some sites stay free
  static const PackedTile& one();
  PackedTile();
  double edge;  ///< in diameters
  std::vector<Vec3> centres;
  double largest_overlap;  ///< as a share of the diameter
};

/// The tile in the sizes that a deck has: one lattice of sites for each octave of radius, so that small granules have as many
/// sites as they need. m, in the frame of whatever body asks.
class Sites {
 public:
  using Number = std::uint64_t;

  /// diameter: the deck's mean one, for which the middle lattice is made.
  explicit Sites(double diameter);

  Vec3 place(Number site) const;
  /// The nearest one of the lattice for granules of this radius; std::range_error if it is farther out than farthest().
  Number nearest(const Vec3& place, double radius) const;
  /// All of that lattice that are closer than `reach` lattice diameters, nearest first.
  std::vector<Vec3> around(const Vec3& place, double radius, double reach) const;
  /// Diameter of the spheres of that lattice.
  double diameter_of(double radius) const { return size(level_of(radius)); }
  /// From the origin, along each axis.
  double farthest() const;

 private:
  struct Found {
    Number site;
    double square;  // of the distance, in tile diameters
  };
  static constexpr int least_level = -4, levels = 16;
  static constexpr int tile_bits = 17, sphere_bits = 9, level_bits = 4;
  static constexpr std::int64_t half = std::int64_t{1} << (tile_bits - 1);
  static_assert(3 * tile_bits + sphere_bits + level_bits == 64 && PackedTile::spheres == 1 << sphere_bits &&
                levels == 1 << level_bits);
  using Cell = std::array<std::int64_t, 3>;

  int level_of(double radius) const;
  double size(int level) const;
  template <class Visit>
  void for_each_near(const Vec3& at, double reach, int level, Visit visit) const;

  const double diameter_;
  const PackedTile& tile_;
  int cells_;                           // of a tile, along each edge
  std::vector<std::vector<int>> cell_;  // spheres of the tile by cell
};

}  // namespace solidcull
