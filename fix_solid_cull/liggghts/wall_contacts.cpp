#include "wall_contacts.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "fix_mesh_surface.h"
#include "fix_neighlist_mesh.h"
#include "fix_wall_gran.h"
#include "modify.h"
#include "neighbor.h"
#include "primitive_wall.h"
#include "tri_mesh.h"
#include "wall_sums.h"

namespace solidcull {

using LAMMPS_NS::FixMeshSurface;
using LAMMPS_NS::FixWallGran;
using LAMMPS_NS::TriMesh;

namespace {

std::int64_t made = 0;  // fixes that walls depend on, in this process

WallTriangle triangle(TriMesh* mesh, int number, int index) {
  WallTriangle t{number, index, {}, {Vec3::Constant(HUGE_VAL), Vec3::Constant(-HUGE_VAL)}, mesh->isMoving()};
  for (int k = 0; k < 3; ++k) {
    double node[3];
    mesh->node(index, k, node);
    t.corner[k] = Vec3(node[0], node[1], node[2]);
    t.box.lo = t.box.lo.cwiseMin(t.corner[k]);
    t.box.hi = t.box.hi.cwiseMax(t.corner[k]);
  }
  return t;
}

/// On the axis of a cylinder the engine says 0, whatever the radii: asked a little beside it.
double gap_to(LAMMPS_NS::PrimitiveWall& wall, const double* place, double radius, double* to_wall) {
  constexpr double beside = 1e-7;  // m; the engine takes 1e-8 for nothing
  double x[3] = {place[0], place[1], place[2]};
  const double gap = wall.resolveContact(x, radius, to_wall);
  const int axis = wall.axis();
  const bool on_axis = gap == 0 && axis >= 0 && to_wall[0] == 0 && to_wall[1] == 0 && to_wall[2] == 0;
  if (!on_axis) return gap;
  x[(axis + 1) % 3] += beside;
  const double gap_beside = wall.resolveContact(x, radius, to_wall);
  return gap_beside + beside;
}

}  // namespace

void WallContacts::connect() {
  walls_.clear();
  meshes_.clear();
  for (int i = 0; i < modify->n_fixes_style("wall/gran"); ++i)
    walls_.push_back(static_cast<FixWallGran*>(modify->find_fix_style("wall/gran", i)));
  for (FixWallGran* wall : walls_)
    for (int m = 0; wall->is_mesh_wall() && m < wall->n_meshes(); ++m) meshes_.push_back(wall->mesh_list()[m]->triMesh());
}

std::vector<WallContact> WallContacts::find() const {
  std::vector<WallContact> found;
  const double skin = neighbor->skin;
  const int owned = atom->nlocal;
  const int* mask = atom->mask;
  double to_wall[3];
  for (FixWallGran* wall : walls_) {
    if (!wall->is_mesh_wall()) {
      int* list = nullptr;
      const int n = wall->primitiveWall()->getNeighbors(list);
      for (int k = 0; k < n; ++k) {
        const int i = list[k];
        if (i >= owned || !(mask[i] & wall->groupbit)) continue;
        const double gap = gap_to(*wall->primitiveWall(), atom->x[i], atom->radius[i], to_wall);
        if (gap < skin) found.push_back({i, Vec3(to_wall[0], to_wall[1], to_wall[2]), gap, wall->is_moving() != 0});
      }
      continue;
    }
    for (int m = 0; m < wall->n_meshes(); ++m) {
      FixMeshSurface* fix = wall->mesh_list()[m];
      TriMesh* mesh = fix->triMesh();
      const bool moving = mesh->isMoving();
      const int triangles = mesh->sizeLocal() + mesh->sizeGhost();
      for (int t = 0; t < triangles; ++t)
        for (const int i : fix->meshNeighlist()->get_contact_list(t)) {
          if (i >= owned) continue;
          int side = 0;
          const double gap = mesh->resolveTriSphereContact(i, t, atom->radius[i], atom->x[i], to_wall, side);
          if (gap < skin) found.push_back({i, Vec3(to_wall[0], to_wall[1], to_wall[2]), gap, moving});
        }
    }
  }
  return found;
}

bool WallContacts::primitive_near(const Sphere& s, double gap) const {
  double to_wall[3];
  return std::any_of(walls_.begin(), walls_.end(), [&](FixWallGran* wall) {
    return !wall->is_mesh_wall() && gap_to(*wall->primitiveWall(), s.centre.data(), s.radius, to_wall) < gap;
  });
}

bool WallContacts::near(const WallTriangle& t, const Sphere& s, double gap) const {
  const Vec3 outside = (t.box.lo - s.centre).cwiseMax(s.centre - t.box.hi).cwiseMax(0.0);
  const double reach = s.radius + gap;
  if (reach < 0 || outside.squaredNorm() > reach * reach) return false;
  double x[3] = {s.centre[0], s.centre[1], s.centre[2]}, to_wall[3];
  int side = 0;
  return meshes_[static_cast<std::size_t>(t.mesh)]->resolveTriSphereContact(-1, t.index, s.radius, x, to_wall, side) < gap;
}

std::vector<WallTriangle> WallContacts::triangles() const {
  std::vector<WallTriangle> all;
  for (std::size_t m = 0; m < meshes_.size(); ++m) {
    const int count = meshes_[m]->sizeLocal() + meshes_[m]->sizeGhost();
    for (int t = 0; t < count; ++t) all.push_back(triangle(meshes_[m], static_cast<int>(m), t));
  }
  return all;
}

void WallContacts::fix_was_made(const char* style) {
  for (const char* of_walls : {"wall/", "mesh/", "move/mesh", "property/global"})
    if (std::strncmp(style, of_walls, std::strlen(of_walls)) == 0) ++made;
}

std::vector<double> WallContacts::fingerprint() const {
  std::vector<double> f = {static_cast<double>(made)};
  for (FixWallGran* wall : walls_) {
    f.insert(f.end(), {double(wall->groupbit), double(wall->is_moving())});
    if (wall->is_mesh_wall()) continue;
    for (int corner = 0; corner < 8; ++corner) {  // how far a primitive is from the corners of the box tells where it is
      double x[3], to_wall[3];
      for (int d = 0; d < 3; ++d) x[d] = corner >> d & 1 ? domain->boxhi[d] : domain->boxlo[d];
      f.push_back(wall->primitiveWall()->resolveContact(x, 0, to_wall));
    }
  }
  for (TriMesh* mesh : meshes_) {
    f.insert(f.end(), {double(mesh->isMoving()), double(mesh->sizeLocal() + mesh->sizeGhost())});
    for (int t = 0; !mesh->isMoving() && t < mesh->sizeLocal() + mesh->sizeGhost(); ++t)
      for (int k = 0; k < 3; ++k) {
        double node[3];
        mesh->node(t, k, node);
        f.insert(f.end(), node, node + 3);
      }
  }
  for (const std::string& name : names()) f.insert(f.end(), name.begin(), name.end());
  return f;
}

std::uint64_t WallContacts::part_of_sum() const {
  return (comm->me == 0 ? sum_of_materials(*modify) + sum_of_walls(walls_) : 0) + sum_of_triangles(meshes_, comm->me);
}

std::vector<std::string> WallContacts::names() const {
  std::vector<std::string> all;
  for (FixWallGran* wall : walls_) {
    all.emplace_back(wall->id);
    for (int m = 0; wall->is_mesh_wall() && m < wall->n_meshes(); ++m) all.emplace_back(wall->mesh_list()[m]->id);
  }
  std::sort(all.begin(), all.end());
  return all;
}

}  // namespace solidcull
