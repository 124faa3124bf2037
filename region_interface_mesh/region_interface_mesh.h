// region ID interface/mesh FIX-ID [side in|out]: the solid bodies of a fix solid/cull as a dynamic LIGGGHTS region.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

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
  /// A body's mesh, and the box in which its level set is less than it is far away.
  struct Reach {
    const InterfaceMesh* mesh;
    Vec3 lo, hi;
  };

  /// Level set of the nearest body at p, that body (nullptr if there is none near), and the periodic image of p at which it is.
  double distance(const Vec3& p, const InterfaceMesh*& nearest, Vec3& image);
  int contact_with(double distance, double cutoff, const InterfaceMesh* body, const Vec3& image);

  [[noreturn]] void refuse() const;

  std::string fix_;
  bool made_ = false;  // the command is done
  std::weak_ptr<const void> source_;
  const std::map<int, InterfaceMesh>* meshes_ = nullptr;
  std::vector<Reach> reach_;
};

}  // namespace solidcull
