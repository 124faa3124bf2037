#include "mesh_loads.h"

#include <algorithm>

#include "atom.h"
#include "fix_mesh_surface.h"
#include "fix_wall_gran.h"
#include "mesh_module_stress.h"
#include "modify.h"
#include "ports.h"
#include "tri_mesh.h"

namespace solidcull {

using LAMMPS_NS::FixMeshSurface;
using LAMMPS_NS::FixWallGran;
using LAMMPS_NS::MeshModuleStress;

namespace {

std::vector<MeshLoads*>& listeners() {
  static std::vector<MeshLoads*> all;
  return all;
}

}  // namespace

MeshLoads::MeshLoads(LAMMPS_NS::LAMMPS* lmp) : Pointers(lmp) { listeners().push_back(this); }

MeshLoads::~MeshLoads() { listeners().erase(std::find(listeners().begin(), listeners().end(), this)); }

void MeshLoads::connect() {
  for (Mesh& m : meshes_) m.fix = nullptr;
  seen_.clear();
  for (int i = 0; i < modify->n_fixes_style("wall/gran"); ++i) {
    auto* wall = static_cast<FixWallGran*>(modify->find_fix_style("wall/gran", i));
    for (int m = 0; wall->is_mesh_wall() && m < wall->n_meshes(); ++m) {
      FixMeshSurface* fix = wall->mesh_list()[m];
      auto* stress = dynamic_cast<MeshModuleStress*>(fix->get_module("stress"));
      if (!stress || !stress->trackStress()) continue;
      Vec3 reference;
      for (int d = 0; d < 3; ++d) reference[d] = stress->compute_vector(6 + d);
      const std::size_t number = std::find(names_.begin(), names_.end(), fix->id) - names_.begin();
      if (number == names_.size()) {
        names_.emplace_back(fix->id);
        meshes_.emplace_back();
      }
      meshes_[number] = {fix, stress, reference, !fix->triMesh()->isMoving(), {}};
    }
  }
}

void MeshLoads::contact(FixMeshSurface* fix, int granule, const double* force, const double* to_wall, int element) {
  for (MeshLoads* l : listeners())
    for (std::size_t m = 0; l->watches_ && m < l->meshes_.size(); ++m) {
      const Mesh& mesh = l->meshes_[m];
      if (mesh.fix != fix || !mesh.still || !(l->atom->mask[granule] & fix->groupbit)) continue;
      WallLoad load;
      load.mesh = static_cast<int>(m);
      load.element = fix->triMesh()->id(element);  // indices are others on another rank, and after elements were exchanged
      load.force = vec(force);
      load.torque = (vec(l->atom->x[granule]) + vec(to_wall) - mesh.reference).cross(load.force);
      l->seen_.push_back({l->atom->tag[granule], load});
      l->sorted_ = false;
    }
}

std::vector<WallLoad> MeshLoads::of(std::int64_t tag) {
  if (!sorted_) std::stable_sort(seen_.begin(), seen_.end(), [](const Seen& a, const Seen& b) { return a.tag < b.tag; });
  sorted_ = true;
  std::vector<WallLoad> loads;
  for (auto s = std::lower_bound(seen_.begin(), seen_.end(), tag, [](const Seen&a, std::int64_t t) { return a.tag < t; });
       s != seen_.end() && s->tag == tag; ++s)
    loads.push_back(s->load);
  return loads;
}

/// -1: this rank does not have it.
int MeshLoads::index_of(Mesh& mesh, int element) {
  LAMMPS_NS::TriMesh& triangles = *mesh.fix->triMesh();
  const std::size_t k = static_cast<std::size_t>(element);
  if (k >= mesh.last.size()) mesh.last.resize(k + 1, -1);
  int& last = mesh.last[k];
  const int count = triangles.sizeLocal() + triangles.sizeGhost();
  if (last < 0 || last >= count || triangles.id(last) != element) last = triangles.map(element, 0);
  return last;
}

void MeshLoads::press(int mesh, int element, const Vec3& force, const Vec3& torque) {
  if (static_cast<std::size_t>(mesh) >= meshes_.size() || !meshes_[mesh].fix) return;  // taken out of the deck since
  Mesh& m = meshes_[static_cast<std::size_t>(mesh)];
  if (element < 0 || element >= m.fix->triMesh()->sizeGlobal()) return;
  double f[3], t[3];
  set(f, force);
  set(t, torque);
  m.stress->add_global_external_contribution(f, t);
  const int i = index_of(m, element);
  if (i < 0) return;
  auto* on_element = m.fix->triMesh()->prop().getElementProperty<LAMMPS_NS::VectorContainer<double, 3>>("f");
  for (int d = 0; d < 3; ++d) (*on_element)(i)[d] += f[d];
}

}  // namespace solidcull
