// `store none`: which site an interface granule takes when it goes to the store (theory.md#refill).
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "bed.h"
#include "near_walls.h"
#include "sphere_cells.h"

namespace solidcull {

/// Of the free sites around a granule the one that overlaps least with what its body has there, and of those the nearest. None
/// that is near a wall, an exterior granule or another body. Made once for all that go; local.
class SiteChoice {
 public:
  /// Whether owned atom i could be stored at this place of the world (as far as other granules go).
  using Clear = std::function<bool(int atom, const Sphere& there)>;

  /// going: atoms that are to go, `wall_gap`: how far from walls they must be (m).
  SiteChoice(const Bed& bed, const std::vector<int>& going, double wall_gap, Clear clear);
  /// In the frame of its body, for going[k], which is an atom still; nothing if no site will do.
  std::optional<Vec3> of(std::size_t k) const;

 private:
  double overlaps(const Sphere& there, const Sphere& in_frame, int frame) const;

  const Bed& bed_;
  const std::vector<int> going_;
  const double wall_gap_;
  const Clear clear_;
  std::vector<Sphere> spheres_;
  SphereCells staying_;  // the shell's
  NearWalls walls_;
};

}  // namespace solidcull
