// Loads on mesh elements: who presses on them in this step, and what stored granules press in addition.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "frozen_wall_loads.h"
#include "pointers.h"

namespace LAMMPS_NS {
class FixMeshSurface;
class MeshModuleStress;
}  // namespace LAMMPS_NS

namespace solidcull {

/// The meshes of the deck's walls that report their load (mesh/surface/stress). Local to the rank.
class MeshLoads : protected LAMMPS_NS::Pointers {
 public:
  explicit MeshLoads(LAMMPS_NS::LAMMPS* lmp);
  ~MeshLoads();
  MeshLoads(const MeshLoads&) = delete;

  /// Finds the deck's meshes again; they come and go between runs, and keep their numbers.
  void connect();
  /// IDs of the meshes, by number.
  const std::vector<std::string>& names() const { return names_; }
  /// The engine begins to compute forces: what was seen before is over. `watch`: whether of() may be asked about these forces.
  void begin_step(bool watch) {
    seen_.clear();
    watches_ = watch;
  }
  /// What still elements did to the granule in this step.
  std::vector<WallLoad> of(std::int64_t tag);

  /// A mesh element bears this in addition (N, N m about the mesh's point of reference); where another rank has it, the mesh as a
  /// whole does; one that has gone bears nothing. After the engine's wall forces and before it sums them.
  void press(int mesh, int element, const Vec3& force, const Vec3& torque);

  /// A wall granule's contact, told by the engine's own call, see register_styles.cpp.
  static void contact(LAMMPS_NS::FixMeshSurface* fix, int granule, const double* force, const double* to_wall, int element);

 private:
  struct Mesh {
    LAMMPS_NS::FixMeshSurface* fix = nullptr;
    LAMMPS_NS::MeshModuleStress* stress = nullptr;
    Vec3 reference = Vec3::Zero();
    bool still = false;
    std::vector<int> last;  // by element: its index here when it was pressed last
  };
  static int index_of(Mesh& mesh, int element);

  struct Seen {
    std::int64_t tag;
    WallLoad load;
  };
  std::vector<Mesh> meshes_;        // by number
  std::vector<std::string> names_;  // their IDs
  std::vector<Seen> seen_;
  bool sorted_ = false, watches_ = true;
};

}  // namespace solidcull
