#include "insertions.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "engine_access.h"
#include "fix_insert.h"
#include "fix_mesh_surface.h"
#include "modify.h"
#include "region.h"
#include "tri_mesh.h"
#include "update.h"

namespace solidcull {
namespace {

bool begins(const LAMMPS_NS::Fix* fix, const char* style) { return std::strncmp(fix->style, style, std::strlen(style)) == 0; }

template <class Test>
bool any_insertion(const LAMMPS_NS::Modify& modify, Test test) {
  return std::any_of(modify.fix, modify.fix + modify.nfix,
                     [&](LAMMPS_NS::Fix* fix) { return begins(fix, "insert/") && test(fix); });
}

}  // namespace

bool EngineInsertions::any() const {
  return any_insertion(*modify, [](LAMMPS_NS::Fix*) { return true; });
}

bool EngineInsertions::any_due(std::int64_t step) const {
  return any_insertion(*modify, [&](LAMMPS_NS::Fix* fix) { return fix->next_reneighbor == step; });
}

bool EngineInsertions::has_inserted() const {
  return any_insertion(*modify, [](LAMMPS_NS::Fix* fix) { return static_cast<LAMMPS_NS::FixInsert*>(fix)->has_inserted(); });
}

std::vector<Box> EngineInsertions::boxes(bool soon, double margin) const {
  std::vector<Box> boxes;
  const Vec3 reach = Vec3::Constant(margin);
  for (int f = 0; f < modify->nfix; ++f) {
    const LAMMPS_NS::Fix* fix = modify->fix[f];
    if (!begins(fix, "insert/pack") && !begins(fix, "insert/rate")) continue;
    const std::int64_t steps = fix->next_reneighbor - update->ntimestep;
    if (soon && steps != 0 && steps != 1) continue;
    const LAMMPS_NS::Region* region = engine::insertion_region(fix);
    if (region && region->bboxflag)
      boxes.push_back({Vec3(region->extent_xlo, region->extent_ylo, region->extent_zlo) - reach,
                       Vec3(region->extent_xhi, region->extent_yhi, region->extent_zhi) + reach});
  }
  return boxes;
}

std::vector<Box> EngineInsertions::counting(double margin) const {
  std::vector<Box> boxes;
  for (int f = 0; f < modify->nfix; ++f) {
    LAMMPS_NS::FixMeshSurface* mesh = engine::counting_mesh(modify->fix[f]);
    if (!mesh) continue;
    LAMMPS_NS::TriMesh* triangles = mesh->triMesh();
    Box box{Vec3::Constant(HUGE_VAL), Vec3::Constant(-HUGE_VAL)};
    for (int t = 0; t < triangles->sizeLocal() + triangles->sizeGhost(); ++t)
      for (int k = 0; k < 3; ++k) {
        double node[3];
        triangles->node(t, k, node);
        box.lo = box.lo.cwiseMin(vec(node));
        box.hi = box.hi.cwiseMax(vec(node));
      }
    if (box.lo[0] <= box.hi[0]) boxes.push_back({box.lo - Vec3::Constant(margin), box.hi + Vec3::Constant(margin)});
  }
  return boxes;
}

}  // namespace solidcull
