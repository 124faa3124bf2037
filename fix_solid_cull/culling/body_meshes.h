// Interface meshes of the bodies on this rank, kept once somebody has asked for them (theory.md#interface-mesh).
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "bed.h"
#include "interface_mesh.h"
#include "shown_bed.h"
#include "sphere_cells.h"

namespace solidcull {

/// Follows each granule that comes to a body or leaves it, and works on what has changed when it is asked. Local.
class BodyMeshes : public BodyFollower {
 public:
  BodyMeshes(Bed& bed, const ShownBed& shown) : bed_(bed), shown_(shown) {}

  /// The meshes by body number, as granules and bodies are now, or as hold() found them.
  const std::map<int, InterfaceMesh>& ask();
  /// Whether ask() has something to do.
  bool behind() const;

  /// World frame, with those of other ranks, and periodic images.
  std::vector<Sphere> exterior_granules() const;
  /// Those of them that may reach into the mesh, in its frame.
  static std::vector<Sphere> near(const InterfaceMesh& mesh, const SphereCells& exterior);

  /// What is told stays as it is now, whatever becomes of granules and bodies, until let_go().
  void hold();
  void let_go();

  void merged(int gone, int /*kept*/, bool /*same_frame*/) override { drop(gone); }
  void frame_changed(int body) override { drop(body); }
  void granule_changed(int body, const Sphere& granule) override;

 private:
  using Bodies = std::map<int, std::vector<Sphere>>;

  bool has_all() const;
  void drop(int body);
  void update();
  Bodies interface_granules() const;

  Bed& bed_;
  const ShownBed& shown_;
  bool wanted_ = false, held_ = false;
  bool lost_track_ = false;          // granules have changed while they were held
  bool changed_ = false;             // since they were brought up to date,
  std::int64_t up_to_date_at_ = -1;  // which was at this step
  std::map<int, InterfaceMesh> meshes_;
};

}  // namespace solidcull
