// Interface meshes of granules that a test has in a list.
#pragma once

#include <algorithm>
#include <vector>

#include "interface_mesh.h"

namespace solidcull {

constexpr double voxel = 1e-3;  // m

/// A lattice of n^3 touching granules of diameter d, its first centre at `corner`.
inline std::vector<Sphere> lattice(int n, double d, const Vec3& corner = Vec3::Zero()) {
  std::vector<Sphere> spheres;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      for (int k = 0; k < n; ++k) spheres.push_back({corner + d * Vec3(i, j, k), d / 2});
  return spheres;
}

inline InterfaceMesh::Gather granules_of(const std::vector<Sphere>& granules) {
  return [&granules](const Vec3& lo, const Vec3& hi, const std::function<void(const Sphere&)>& visit) {
    for (const Sphere& s : granules)
      if ((s.centre.array() >= lo.array()).all() && (s.centre.array() <= hi.array()).all()) visit(s);
  };
}

inline double largest_of(const std::vector<Sphere>& granules) {
  double largest = 0;
  for (const Sphere& s : granules) largest = std::max(largest, s.radius);
  return largest;
}

inline InterfaceMesh mesh_of(const std::vector<Sphere>& granules, double voxel, double closing, const Pose& pose = Pose()) {
  InterfaceMesh mesh(voxel, closing);
  mesh.update(granules_of(granules), largest_of(granules));
  mesh.set_pose(pose);
  return mesh;
}

/// Those that do not lie in the ball.
inline std::vector<Sphere> without(std::vector<Sphere> granules, const Sphere& ball) {
  granules.erase(std::remove_if(granules.begin(), granules.end(),
                                [&](const Sphere& s) { return (s.centre - ball.centre).norm() <= ball.radius; }),
                 granules.end());
  return granules;
}

}  // namespace solidcull
