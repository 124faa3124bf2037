#include "wall_contacts.h"

#include <algorithm>
#include <cmath>

#include "atom.h"
#include "fix_mesh_surface.h"
#include "fix_neighlist_mesh.h"
#include "fix_wall_gran.h"
#include "modify.h"
#include "neighbor.h"
#include "primitive_wall.h"
#include "tri_mesh.h"

namespace solidcull {

using LAMMPS_NS::FixMeshSurface;
using LAMMPS_NS::FixWallGran;
using LAMMPS_NS::TriMesh;

namespace {

WallContacts::Box box_of(TriMesh* mesh, int triangle) {
  WallContacts::Box box{Vec3::Constant(HUGE_VAL), Vec3::Constant(-HUGE_VAL)};
  for (int corner = 0; corner < 3; ++corner) {
    double node[3];
    mesh->node(triangle, corner, node);
    box.lo = box.lo.cwiseMin(Vec3(node[0], node[1], node[2]));
    box.hi = box.hi.cwiseMax(Vec3(node[0], node[1], node[2]));
  }
  return box;
}

}  // namespace

void WallContacts::connect() {
  walls_.clear();
  for (int i = 0; i < modify->n_fixes_style("wall/gran"); ++i)
    walls_.push_back(static_cast<FixWallGran*>(modify->find_fix_style("wall/gran", i)));
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
        const double gap = wall->primitiveWall()->resolveContact(atom->x[i], atom->radius[i], to_wall);
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
  double x[3] = {s.centre[0], s.centre[1], s.centre[2]}, to_wall[3];
  return std::any_of(walls_.begin(), walls_.end(), [&](FixWallGran* wall) {
    return !wall->is_mesh_wall() && wall->primitiveWall()->resolveContact(x, s.radius, to_wall) < gap;
  });
}

bool WallContacts::mesh_near(TriMesh* mesh, const Sphere& s, double gap) const {
  double x[3] = {s.centre[0], s.centre[1], s.centre[2]}, to_wall[3];
  const int triangles = mesh->sizeLocal() + mesh->sizeGhost();
  for (int t = 0; t < triangles; ++t) {
    const Box box = box_of(mesh, t);
    const Vec3 outside = (box.lo - s.centre).cwiseMax(s.centre - box.hi).cwiseMax(0.0);
    const double reach = s.radius + gap;
    if (reach < 0 || outside.squaredNorm() > reach * reach) continue;
    int side = 0;
    if (mesh->resolveTriSphereContact(-1, t, s.radius, x, to_wall, side) < gap) return true;
  }
  return false;
}

bool WallContacts::near(const Sphere& s, double gap, bool moving_only) const {
  if (!moving_only && primitive_near(s, gap)) return true;
  for (FixWallGran* wall : walls_) {
    if (!wall->is_mesh_wall()) continue;
    for (int m = 0; m < wall->n_meshes(); ++m) {
      TriMesh* mesh = wall->mesh_list()[m]->triMesh();
      if ((!moving_only || mesh->isMoving()) && mesh_near(mesh, s, gap)) return true;
    }
  }
  return false;
}

std::vector<WallContacts::Box> WallContacts::boxes(bool moving_only) const {
  std::vector<Box> all;
  for (FixWallGran* wall : walls_) {
    if (!wall->is_mesh_wall()) continue;
    for (int m = 0; m < wall->n_meshes(); ++m) {
      TriMesh* mesh = wall->mesh_list()[m]->triMesh();
      if (moving_only && !mesh->isMoving()) continue;
      const int triangles = mesh->sizeLocal() + mesh->sizeGhost();
      for (int t = 0; t < triangles; ++t) all.push_back(box_of(mesh, t));
    }
  }
  return all;
}

std::vector<WallContacts::Box> WallContacts::moving_triangle_boxes() const { return boxes(true); }
std::vector<WallContacts::Box> WallContacts::triangle_boxes() const { return boxes(false); }

}  // namespace solidcull
