// Which stored granules can be seen: what a picture of a large bed needs of them (fix_solid_cull.md, keyword `bed`).
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "bed.h"
#include "implicit_surface.h"
#include "sphere_cells.h"

namespace solidcull {

/// A stored granule can be seen if its centre is no deeper than `depth_diameters` below the surface of all granules, closed over
/// the pores, from any side, walls or none. Made for one moment: nothing may move between the first question and the last.
class SeenGranules {
 public:
  /// Learns what other ranks and periodic images have near this rank. Collective.
  explicit SeenGranules(const Bed& bed);
  /// world: where it is now. Local.
  bool sees(const Vec3& world) { return !surface_.void_within(world, depth_).none(); }

  /// More than two layers. What lies deeper is less than 1 % of any picture, at the bottom of gaps (test_pictures.py counts).
  static constexpr double depth_diameters = 2.0;

 private:
  using Visit = std::function<void(const Sphere&)>;
  void gather(const Vec3& lo, const Vec3& hi, const Visit& visit) const;

  const Bed& bed_;
  const double depth_;
  SphereCells atoms_and_neighbours_;
  ImplicitSurface surface_;
};

}  // namespace solidcull
