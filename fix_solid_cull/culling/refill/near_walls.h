// Walls around some spheres that may be moved a little.
#pragma once

#include <vector>

#include "ports.h"

namespace solidcull {

/// Found once for all spheres. Valid while triangles are. Local.
class NearWalls {
 public:
  /// reach: how far spheres will be moved, and the largest gap that will be asked for (m).
  NearWalls(const Walls& walls, const std::vector<Sphere>& spheres, double reach);
  /// Whether sphere k, at this place, is closer than `gap` to a wall.
  bool near(std::size_t k, const Sphere& there, double gap) const;
  /// Whether it overlaps a wall anywhere on the straight way to this place; with both ends clear, whether a wall lies between.
  bool between(std::size_t k, const Sphere& from, const Vec3& to) const;

 private:
  struct Around {
    std::vector<std::size_t> triangles;
    bool primitive = false;
  };
  const Walls& walls_;
  std::vector<WallTriangle> triangles_;
  std::vector<Around> around_;
};

}  // namespace solidcull
