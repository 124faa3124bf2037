// One granule as geometry sees it.
#pragma once

#include <Eigen/Geometry>

namespace solidcull {

using Vec3 = Eigen::Vector3d;

/// A sphere in world coordinates: centre and radius in m.
struct Sphere {
  Vec3 centre = Vec3::Zero();
  double radius = 0;
};

}  // namespace solidcull
