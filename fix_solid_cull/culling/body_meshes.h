// Interface meshes of the bodies on this rank, kept once somebody has asked for them (DESIGN section 10).
#pragma once

#include <map>
#include <vector>

#include "granule_masses.h"
#include "interface_mesh.h"
#include "solid.h"
#include "wake_requests.h"

namespace solidcull {

/// Local.
class BodyMeshes {
 public:
  BodyMeshes(const Scales& scales, const Solid& solid, const GranuleMasses& masses)
      : scales_(scales), solid_(solid), masses_(masses) {}

  bool wanted() const { return wanted_; }
  /// Whether each body has its mesh, and nothing else has.
  bool follow_bodies() const;
  /// The meshes by body number, where their bodies are now; made where they are missing, for which atoms must be indexed.
  const std::map<int, InterfaceMesh>& ask();

  // --- a membership change, in this order
  /// A ball took granules out of a body.
  void carve(int body, const Ball& ball);
  void merged(std::vector<Solid::Merge> merges) { merges_ = std::move(merges); }
  /// Made anew: bodies that came apart, and what came off them; grown: bodies with these granules, locked just now.
  void follow(const std::vector<int>& came_apart, const std::vector<std::int64_t>& locked_now);

 private:
  void unite_merged();
  void update(const std::vector<std::int64_t>& locked_now);
  const Pose& pose_of_merged(int body) const;

  const Scales& scales_;
  const Solid& solid_;
  const GranuleMasses& masses_;
  bool wanted_ = false;
  std::map<int, InterfaceMesh> meshes_;
  std::vector<Solid::Merge> merges_;  // in the change under way
};

}  // namespace solidcull
