#include "body_meshes.h"

#include <algorithm>
#include <map>
#include <utility>

#include "box.h"

namespace solidcull {

const std::map<int, InterfaceMesh>& BodyMeshes::ask() {
  if (held_ || !bed_.solid.has_store()) return meshes_;  // before the first run nothing is culled
  wanted_ = true;
  if (behind()) update();
  for (auto& [body, mesh] : meshes_) mesh.set_pose(bed_.solid.bodies().pose(body));
  return meshes_;
}

bool BodyMeshes::behind() const { return !held_ && (changed_ || up_to_date_at_ != bed_.run.step || !has_all()); }

/// Each body has its mesh, and nothing else has.
bool BodyMeshes::has_all() const {
  return meshes_.size() == bed_.solid.bodies().size() &&
         std::all_of(meshes_.begin(), meshes_.end(), [&](const auto& mesh) { return bed_.solid.exists(mesh.first); });
}

void BodyMeshes::hold() {
  ask();
  held_ = true;
}

/// Exterior granules may be others, too.
void BodyMeshes::let_go() {
  up_to_date_at_ = -1;
  if (lost_track_) meshes_.clear();
  held_ = lost_track_ = false;
}

void BodyMeshes::drop(int body) {
  if (held_)
    lost_track_ = true;
  else
    meshes_.erase(body);
}

void BodyMeshes::granule_changed(int body, const Sphere& granule) {
  if (!wanted_) return;
  if (held_) {
    lost_track_ = true;
    return;
  }
  changed_ = true;
  const auto mesh = meshes_.find(body);
  if (mesh != meshes_.end()) mesh->second.touch(granule);
}

void BodyMeshes::update() {
  for (auto mesh = meshes_.begin(); mesh != meshes_.end();)
    mesh = bed_.solid.exists(mesh->first) ? std::next(mesh) : meshes_.erase(mesh);
  for (const auto& body : bed_.solid.bodies().bodies())
    meshes_.try_emplace(body.first, bed_.scales.voxel(), bed_.scales.closing());

  const Bodies shell = interface_granules();
  SphereCells exterior;
  exterior.build(exterior_granules(), 2 * bed_.scales.diameter());
  const GranuleStore& store = bed_.solid.store();
  // a mesh that is made as a whole asks for all of space: what is in the box of its own body will do
  std::map<int, Box> stored;
  store.for_each_body([&](int body, const Vec3& lo, const Vec3& hi) { stored[body] = {lo, hi}; });
  for (auto& [body, mesh] : meshes_) {
    mesh.set_pose(bed_.solid.bodies().pose(body));
    SphereCells interface;
    const auto found = shell.find(body);
    if (found != shell.end()) interface.build(found->second, 2 * bed_.scales.diameter());
    const InterfaceMesh::Gather members = [&, body = body](const Vec3& lo, const Vec3& hi, const auto& visit) {
      if (const auto own = stored.find(body); own != stored.end())
        store.for_each_in_box(store.frame_of(body), lo.cwiseMax(own->second.lo), hi.cwiseMin(own->second.hi),
                              [&](const Resident& g) {
                                if (g.body == body) visit({g.position, g.radius});
                              });
      interface.for_each_in_box(lo, hi, [&](std::size_t, const Sphere& s) {
        visit(s);
        return true;
      });
    };
    const double largest = std::max(store.largest_radius(), interface.largest_radius());
    mesh.update(members, largest);
    mesh.leave_out(near(mesh, exterior), members, largest);
  }
  changed_ = false;
  up_to_date_at_ = bed_.run.step;
}

/// By body, in its frame.
BodyMeshes::Bodies BodyMeshes::interface_granules() const {
  bed_.index.index(bed_.atoms);
  Bodies all;
  bed_.solid.bodies().for_each_member([&](std::int64_t tag, int body) {
    const GranuleMass g = bed_.masses(tag);
    all[body].push_back({g.position, g.radius});
  });
  return all;
}

std::vector<Sphere> BodyMeshes::exterior_granules() const {
  const Atoms& atoms = bed_.atoms;
  std::vector<Sphere> all;
  for (int i = 0; i < atoms.owned + atoms.ghosts; ++i) {
    const bool in_a_body = i < atoms.owned ? bed_.shell.locked(i) || shown_.is_guest(i) : atoms.is_interface(i);
    if (!in_a_body) all.push_back(atoms.sphere(i));
  }
  const Vec3& periods = bed_.solid.bodies().periods();
  for (int d = 0; d < 3; ++d) {
    if (periods[d] == 0) continue;
    const std::size_t here = all.size();
    for (const double side : {-1.0, 1.0})
      for (std::size_t k = 0; k < here; ++k) {
        all.push_back(all[k]);
        all.back().centre[d] += side * periods[d];
      }
  }
  return all;
}

std::vector<Sphere> BodyMeshes::near(const InterfaceMesh& mesh, const SphereCells& exterior) {
  Vec3 lo, hi;
  if (!mesh.grid_box(lo, hi)) return {};
  const Pose& pose = mesh.pose();
  const Vec3 centre = pose.to_world(0.5 * (lo + hi));
  const Vec3 half = turned_half_box(pose.turn(), 0.5 * (hi - lo)) + Vec3::Constant(exterior.largest_radius());
  std::vector<Sphere> found;
  exterior.for_each_in_box(centre - half, centre + half, [&](std::size_t, const Sphere& s) {
    found.push_back({pose.to_frame(s.centre), s.radius});
    return true;
  });
  return found;
}

}  // namespace solidcull
