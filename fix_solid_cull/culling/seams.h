// Where ranks meet, each has granules of one body, and none can close the pores between them. Seams are meshes that do.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "bed.h"
#include "body_meshes.h"
#include "interface_mesh.h"

namespace solidcull {

class Seams {
 public:
  Seams(Bed& bed, const BodyMeshes& meshes) : bed_(bed), meshes_(meshes) {}

  /// By number of the body: its surface near other ranks, as far as it lies in this rank's subdomain; world frame. Meshes are
  /// kept, and made anew where granules have come or gone. Collective.
  std::map<BodyGroups::Key, InterfaceMesh> ask();

 private:
  struct Kept {
    InterfaceMesh mesh;
    std::vector<Sphere> granules;  // in order
  };
  using Granules = std::map<BodyGroups::Key, std::vector<Sphere>>;

  double width() const;
  Granules granules_near_others() const;
  void bring_up_to_date(Kept& kept, std::vector<Sphere> granules) const;

  Bed& bed_;
  const BodyMeshes& meshes_;
  std::map<BodyGroups::Key, Kept> kept_;
};

}  // namespace solidcull
