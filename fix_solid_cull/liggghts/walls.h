// LIGGGHTS's walls and meshes.
#pragma once

#include <string>
#include <vector>

#include "mesh_loads.h"
#include "ports.h"
#include "wall_contacts.h"

namespace solidcull {

class EngineWalls : public Walls {
 public:
  explicit EngineWalls(LAMMPS_NS::LAMMPS* lmp) : contacts_(lmp), loads_(lmp) {}

  /// A run begins: walls may be others. Local.
  void connect() {
    contacts_.connect();
    loads_.connect();
  }
  /// The engine begins to compute forces. Local.
  void begin_step(bool watch_loads) { loads_.begin_step(watch_loads); }

  std::vector<WallContact> contacts() const override { return contacts_.find(); }
  std::vector<WallTriangle> triangles() const override { return contacts_.triangles(); }
  bool near(const WallTriangle& t, const Sphere& s, double gap) const override { return contacts_.near(t, s, gap); }
  bool primitive_near(const Sphere& s, double gap) const override { return contacts_.primitive_near(s, gap); }
  std::vector<std::string> names() const override { return contacts_.names(); }
  std::vector<double> fingerprint() const override { return contacts_.fingerprint(); }
  std::uint64_t part_of_sum() const override { return contacts_.part_of_sum(); }
  const std::vector<std::string>& mesh_names() const override { return loads_.names(); }
  std::vector<WallLoad> loads_on(std::int64_t tag) override { return loads_.of(tag); }
  void press(int mesh, int element, const Vec3& force, const Vec3& torque) override {
    loads_.press(mesh, element, force, torque);
  }

 private:
  WallContacts contacts_;
  MeshLoads loads_;
};

}  // namespace solidcull
