#include "body_meshes.h"

#include <algorithm>
#include <utility>

namespace solidcull {

const std::map<int, InterfaceMesh>& BodyMeshes::ask() {
  if (!follow_bodies()) {
    wanted_ = true;
    merges_.clear();
    update({});
  }
  for (auto& mesh : meshes_) mesh.second.set_pose(solid_.bodies().pose(mesh.first));
  return meshes_;
}

/// Bodies come and go without a change of membership when granules go to another rank or leave the box.
bool BodyMeshes::follow_bodies() const {
  return wanted_ && meshes_.size() == solid_.bodies().size() &&
         std::all_of(meshes_.begin(), meshes_.end(), [&](const auto& mesh) { return solid_.exists(mesh.first); });
}

void BodyMeshes::carve(int body, const Ball& ball) {
  const auto mesh = meshes_.find(body);
  if (mesh != meshes_.end()) mesh->second.carve({ball.centre, ball.radius});
}

void BodyMeshes::follow(const std::vector<int>& came_apart, const std::vector<std::int64_t>& locked_now) {
  if (!wanted_) return;
  for (const int body : came_apart) meshes_.erase(body);
  update(locked_now);
}

const Pose& BodyMeshes::pose_of_merged(int body) const {
  for (const Solid::Merge& m : merges_)
    if (m.swallowed == body) return m.pose;
  return solid_.bodies().pose(body);
}

void BodyMeshes::unite_merged() {
  for (const Solid::Merge& merge : merges_) {
    const auto swallowed = meshes_.find(merge.swallowed);
    if (swallowed == meshes_.end()) continue;
    const auto kept = meshes_.find(merge.kept);
    if (kept != meshes_.end()) {
      // in a chain of merges the kept one may be swallowed by now
      kept->second.set_pose(pose_of_merged(merge.kept));
      swallowed->second.set_pose(merge.pose);
      kept->second.merge(std::move(swallowed->second));
    }
    meshes_.erase(swallowed);
  }
  merges_.clear();
}

void BodyMeshes::update(const std::vector<std::int64_t>& locked_now) {
  unite_merged();
  for (auto mesh = meshes_.begin(); mesh != meshes_.end();)
    mesh = solid_.exists(mesh->first) ? std::next(mesh) : meshes_.erase(mesh);

  // granules of each body that its mesh does not have: all of a body without a mesh, else those locked just now
  const SolidBodies& bodies = solid_.bodies();
  std::map<int, std::vector<Sphere>> added;
  const auto place = [&](std::int64_t tag) {
    const GranuleMass g = masses_(tag);
    return Sphere{g.position, g.radius};
  };
  const bool whole =
      std::any_of(bodies.bodies().begin(), bodies.bodies().end(), [&](const auto& body) { return !meshes_.count(body.first); });
  if (whole) {
    std::vector<std::pair<std::int64_t, int>> members;
    bodies.for_each_member([&](std::int64_t tag, int body) {
      if (!meshes_.count(body)) members.emplace_back(tag, body);
    });
    solid_.store().for_each([&](const Resident& g) {
      const int body = bodies.root(g.body);
      if (!meshes_.count(body)) members.emplace_back(g.tag, body);
    });
    std::sort(members.begin(), members.end());
    for (const auto& m : members) added[m.second].push_back(place(m.first));
  }
  for (const std::int64_t tag : locked_now) {
    const int body = bodies.body_of(tag);
    if (meshes_.count(body)) added[body].push_back(place(tag));
  }
  for (const auto& a : added) {
    const auto mesh = meshes_.try_emplace(a.first, scales_.voxel(), scales_.closing()).first;
    mesh->second.set_pose(bodies.pose(a.first));
    mesh->second.add(a.second);
  }
}

}  // namespace solidcull
