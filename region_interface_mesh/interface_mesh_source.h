// What a region needs of whoever holds the interface meshes.
#pragma once

#include <map>
#include <memory>

#include "interface_mesh.h"

namespace solidcull {

class InterfaceMeshSource {
 public:
  virtual ~InterfaceMeshSource() = default;
  /// The meshes of the solid bodies on this rank, by body number, up to date with every cull and carve. Local; the reference
  /// stays valid until the next time step, and no longer than the source().
  virtual const std::map<int, InterfaceMesh>& interface_meshes() = 0;
  /// Expires with this source, and when bodies change: a region may be asked after its fix has gone.
  std::weak_ptr<const void> source() const { return alive_; }

 protected:
  /// Whoever has asked must ask again.
  void bodies_have_changed() { alive_ = std::make_shared<const char>(); }

 private:
  std::shared_ptr<const char> alive_ = std::make_shared<const char>();
};

}  // namespace solidcull
