#include "wall_sums.h"

#include <utility>

#include "fix.h"
#include "fix_mesh_surface.h"
#include "fix_wall_gran.h"
#include "modify.h"
#include "primitive_wall.h"
#include "tri_mesh.h"
#include "word_sum.h"

namespace solidcull {

using LAMMPS_NS::FixMeshSurface;
using LAMMPS_NS::FixWallGran;
using LAMMPS_NS::TriMesh;

namespace {

/// Which contact models the wall has, of those that Debian's engine knows.
void add_models(WordSum& sum, FixWallGran& wall) {
  const std::pair<const char*, std::vector<const char*>> kinds[] = {
      {"normal", {"hertz", "hooke", "hertz/stiffness", "hooke/stiffness", "hooke/hysteresis"}},
      {"tangential", {"off", "no_history", "history"}},
      {"rolling_friction", {"off", "cdt", "epsd", "epsd2", "epsd3", "luding"}},
      {"cohesion", {"off", "sjkr", "sjkr2", "washino/capillary/viscous", "easo/capillary/viscous"}},
      {"surface", {"default", "multicontact", "superquadric"}}};
  for (const auto& [kind, models] : kinds)
    for (const char* model : models) sum.add(wall.contact_match(kind, model));
}

void add_text(WordSum& sum, const char* name) {
  for (const char* c = name; *c; ++c) sum.add(*c);
  sum.add(0);
}

/// How far it is from the corners of a cube around the origin tells where it is.
void add_place(WordSum& sum, LAMMPS_NS::PrimitiveWall& wall) {
  for (int corner = 0; corner < 8; ++corner) {
    double x[3], to_wall[3];
    for (int d = 0; d < 3; ++d) x[d] = corner >> d & 1 ? 1.0 : -1.0;
    sum.add(wall.resolveContact(x, 0, to_wall));
  }
}

}  // namespace

std::uint64_t sum_of_materials(LAMMPS_NS::Modify& modify) {
  std::uint64_t sum = 0;
  for (int i = 0; i < modify.n_fixes_style("property/global"); ++i) {
    LAMMPS_NS::Fix* fix = modify.find_fix_style("property/global", i);
    WordSum one;
    add_text(one, fix->id);
    if (fix->scalar_flag) one.add(fix->compute_scalar());
    for (int k = 0; fix->vector_flag && k < fix->size_vector; ++k) one.add(fix->compute_vector(k));
    for (int r = 0; fix->array_flag && r < fix->size_array_rows; ++r)
      for (int c = 0; c < fix->size_array_cols; ++c) one.add(fix->compute_array(r, c));
    sum += one.value();
  }
  return sum;
}

std::uint64_t sum_of_walls(const std::vector<FixWallGran*>& walls) {
  std::uint64_t sum = 0;
  for (FixWallGran* wall : walls) {
    WordSum one;
    add_text(one, wall->id);
    one.add(wall->groupbit);
    one.add(wall->is_moving());
    one.add(wall->dnum());
    add_models(one, *wall);
    if (!wall->is_mesh_wall()) {
      one.add(wall->atom_type_wall());
      add_place(one, *wall->primitiveWall());
    }
    for (int m = 0; wall->is_mesh_wall() && m < wall->n_meshes(); ++m) {
      FixMeshSurface* fix = wall->mesh_list()[m];
      add_text(one, fix->id);
      one.add(fix->groupbit);
      one.add(fix->atomTypeWall());
      one.add(fix->triMesh()->isMoving());
    }
    sum += one.value();
  }
  return sum;
}

std::uint64_t sum_of_triangles(const std::vector<TriMesh*>& meshes, int rank) {
  std::uint64_t sum = 0;
  for (TriMesh* mesh : meshes) {
    const bool all_have_it = mesh->sizeGlobal() == 0;  // before the first run sets up
    if (mesh->isMoving() || (all_have_it && rank != 0)) continue;
    auto* const belt = mesh->prop().getElementProperty<LAMMPS_NS::MultiVectorContainer<double, 3, 3>>("v");
    for (int t = 0; t < mesh->sizeLocal(); ++t) {
      WordSum one;
      one.add(mesh->id(t));
      for (int k = 0; k < 3; ++k) {
        double node[3];
        mesh->node(t, k, node);
        for (const double x : node) one.add(x);
        for (int d = 0; belt && d < 3; ++d) one.add((*belt)(t)[k][d]);
      }
      sum += one.value();
    }
  }
  return sum;
}

}  // namespace solidcull
