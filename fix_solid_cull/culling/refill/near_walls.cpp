#include "near_walls.h"

#include <algorithm>

#include "sphere_cells.h"

namespace solidcull {

NearWalls::NearWalls(const Walls& walls, const std::vector<Sphere>& spheres, double reach)
    : walls_(walls), triangles_(walls.triangles()), around_(spheres.size()) {
  if (spheres.empty()) return;
  SphereCells cells;
  double edge = reach;
  for (const Sphere& s : spheres) edge = std::max(edge, 2 * s.radius);
  cells.build(spheres, edge);
  const Vec3 around = Vec3::Constant(cells.largest_radius() + reach);
  for (std::size_t t = 0; t < triangles_.size(); ++t) {
    // by the box: an engine may leave an edge to the triangle beyond it, so that a sphere that is not over this one is not near
    // it
    const Box& box = triangles_[t].box;
    cells.for_each_in_box(box.lo - around, box.hi + around, [&](std::size_t k, const Sphere& s) {
      const Vec3 outside = (box.lo - s.centre).cwiseMax(s.centre - box.hi).cwiseMax(0.0);
      if (outside.norm() < s.radius + reach) around_[k].triangles.push_back(t);
      return true;
    });
  }
  for (std::size_t k = 0; k < spheres.size(); ++k) around_[k].primitive = walls_.primitive_near(spheres[k], reach);
}

bool NearWalls::near(std::size_t k, const Sphere& there, double gap) const {
  const Around& around = around_[k];
  return std::any_of(around.triangles.begin(), around.triangles.end(),
                     [&](std::size_t t) { return walls_.near(triangles_[t], there, gap); }) ||
         (around.primitive && walls_.primitive_near(there, gap));
}

bool NearWalls::between(std::size_t k, const Sphere& from, const Vec3& to) const {
  const Vec3 way = to - from.centre;
  const int steps = 1 + static_cast<int>(way.norm() / (0.5 * from.radius));
  for (int n = 1; n < steps; ++n)
    if (near(k, {from.centre + static_cast<double>(n) / steps * way, from.radius}, 0)) return true;
  return false;
}

}  // namespace solidcull
