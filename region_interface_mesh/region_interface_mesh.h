// region ID interface/mesh FIX-ID [side in|out]: the solid bodies of a fix solid/cull as a dynamic LIGGGHTS region.
#pragma once

#include <map>
#include <memory>
#include <string>

#include "interface_mesh.h"
#include "region.h"

namespace solidcull {

class RegInterfaceMesh : public LAMMPS_NS::Region {
 public:
  RegInterfaceMesh(LAMMPS_NS::LAMMPS* lmp, int narg, char** arg);
  ~RegInterfaceMesh() override;

  int inside(double x, double y, double z) override;
  int surface_interior(double* x, double cutoff) override;
  int surface_exterior(double* x, double cutoff) override;
  void shape_update() override;

 private:
  /// Level set of the nearest body at p and that body (nullptr if there is none).
  double distance(const Vec3& p, const InterfaceMesh*& nearest);
  int contact_with(double* x, double distance, double cutoff, const InterfaceMesh* body);

  [[noreturn]] void refuse() const;

  std::string fix_;
  bool made_ = false;  // the command is done
  std::weak_ptr<const void> source_;
  const std::map<int, InterfaceMesh>* meshes_ = nullptr;
};

}  // namespace solidcull
