#include "insertions.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "domain.h"
#include "engine_access.h"
#include "fix_insert_pack.h"
#include "fix_insert_stream.h"
#include "fix_mesh_surface.h"
#include "modify.h"
#include "region.h"
#include "tri_mesh.h"
#include "update.h"

namespace solidcull {
namespace {

/// Where a fix puts the centres of granules; false: all that is known of that is here.
bool find_extent(const LAMMPS_NS::FixInsertPack& fix, Box& box) {
  const LAMMPS_NS::Region* region = engine::insertion_region(fix);
  if (!region || !region->bboxflag || region->varshape) return false;
  box = {{region->extent_xlo, region->extent_ylo, region->extent_zlo},
         {region->extent_xhi, region->extent_yhi, region->extent_zhi}};
  return true;
}

/// A face, and what is behind it as seen along the velocity: each granule is put there so far behind the face that it comes out
/// of it when its time is over. The engine itself knows how far that is from the set-up of a run on.
bool find_extent(LAMMPS_NS::FixInsertStream& fix, double dt, Box& box) {
  LAMMPS_NS::TriMesh* face = fix.face();
  if (!face || face->sizeLocal() + face->sizeGhost() == 0) return false;
  const engine::Stream stream = engine::stream_of(fix);
  double normal[3];
  face->surfaceNorm(0, normal);
  const double speed = vec(normal).dot(stream.velocity);
  const int steps = stream.duration > 0 ? stream.duration : fix.ins_every();
  double length = stream.length > 0 ? stream.length : steps * dt * std::abs(speed);
  length += stream.offset + fix.max_r_bound();
  double lo[3], hi[3];
  face->getGlobalBoundingBox().getBoxBounds(lo, hi);
  box = Box{vec(lo), vec(hi)}.swept_along((speed < 0 ? length : -length) * vec(normal));
  return true;
}

bool find_extent(LAMMPS_NS::FixInsert* fix, double dt, Box& box) {
  if (const auto* pack = dynamic_cast<const LAMMPS_NS::FixInsertPack*>(fix)) return find_extent(*pack, box);
  if (auto* stream = dynamic_cast<LAMMPS_NS::FixInsertStream*>(fix)) return find_extent(*stream, dt, box);
  return false;
}

template <class Visit>
void for_each_insertion(const LAMMPS_NS::Modify& modify, Visit visit) {
  for (int f = 0; f < modify.nfix; ++f)
    if (auto* fix = dynamic_cast<LAMMPS_NS::FixInsert*>(modify.fix[f])) visit(fix);
}

}  // namespace

bool EngineInsertions::any_due(std::int64_t step) const {
  bool due = false;
  for_each_insertion(*modify, [&](const LAMMPS_NS::FixInsert* fix) { due |= fix->next_reneighbor == step; });
  return due;
}

std::vector<Box> EngineInsertions::due_boxes(double largest) const {
  std::vector<Box> boxes;
  for_each_insertion(*modify, [&](LAMMPS_NS::FixInsert* fix) {
    const std::int64_t steps = fix->next_reneighbor - update->ntimestep;
    if (steps != 0 && steps != 1) return;
    Box box{vec(domain->boxlo), vec(domain->boxhi)};
    find_extent(fix, update->dt, box);
    boxes.push_back(box.grown_by(fix->max_r_bound() + largest));
  });
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
