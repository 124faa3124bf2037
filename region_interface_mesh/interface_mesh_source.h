// What a region needs of whoever holds the interface meshes.
#pragma once

#include <map>

#include "interface_mesh.h"

namespace solidcull {

class InterfaceMeshSource {
 public:
  virtual ~InterfaceMeshSource() = default;
  /// The meshes of the solid bodies on this rank, by body number, up to date with every cull and carve. Local; the reference
  /// stays valid until the next time step.
  virtual const std::map<int, InterfaceMesh>& interface_meshes() = 0;
};

}  // namespace solidcull
