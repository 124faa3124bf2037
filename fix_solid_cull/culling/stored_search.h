// Stored granules by place in the world, wherever their bodies are, through periodic sides too.
#pragma once

#include "bed_state.h"

namespace solidcull {

/// Largest distance (m) at which two granules, atoms or stored, may be neighbours: two largest radii and the skin. Local, alike
/// on all ranks.
inline double contact_reach(const BedState& bed) { return 2 * bed.largest_radius + bed.run.skin; }
/// Of what is on this rank (m). Local.
double largest_radius_here(const BedState& bed);

/// Local; m, world frame.
class StoredSearch {
 public:
  explicit StoredSearch(const BedState& bed) : bed_(bed) {}

  /// Those whose surface is closer than `gap` to the sphere's, but for those of bodies for which excluded(body) holds.
  template <class Visit, class Excluded>
  void for_each_near(const Sphere& s, double gap, Visit visit, Excluded excluded) const {
    bed_.solid.store().for_each_frame([&](int frame, const Vec3&, const Vec3&) {
      const bool shared = frame == GranuleStore::shared_frame;
      if (!shared && excluded(frame)) return;
      const Pose& pose = bed_.solid.pose_of_frame(frame);
      for (const Vec3& shift : bed_.ranks.image_shifts())
        bed_.solid.store().for_each_near(frame, {pose.to_frame(s.centre + shift), s.radius}, gap, [&](const Resident& g) {
          if (!shared || !excluded(g.body)) visit(g);
        });
    });
  }
  template <class Visit>
  void for_each_near(const Sphere& s, double gap, Visit visit) const {
    for_each_near(s, gap, visit, [](int) { return false; });
  }

  /// Those in the box, and some around it; of one frame, if one is given.
  template <class Visit>
  void for_each_in_box(const Vec3& lo, const Vec3& hi, Visit visit, int only = every_frame) const {
    const Vec3 middle = 0.5 * (lo + hi), half = 0.5 * (hi - lo);
    bed_.solid.store().for_each_frame([&](int frame, const Vec3&, const Vec3&) {
      if (only != every_frame && frame != only) return;
      const Pose& pose = bed_.solid.pose_of_frame(frame);
      const Vec3 reach = turned_half_box(pose.turn().transpose(), half);
      for (const Vec3& shift : bed_.ranks.image_shifts()) {
        const Vec3 at = pose.to_frame(middle + shift);
        bed_.solid.store().for_each_in_box(frame, at - reach, at + reach, visit);
      }
    });
  }

  /// The box grows until the centres of all are in it.
  void enclose(Box& box) const {
    bed_.solid.store().for_each_frame([&](int frame, const Vec3& lo, const Vec3& hi) {
      const Pose& pose = bed_.solid.pose_of_frame(frame);
      const Vec3 middle = pose.to_world(0.5 * (lo + hi)), half = turned_half_box(pose.turn(), 0.5 * (hi - lo));
      box.lo = box.lo.cwiseMin(middle - half);
      box.hi = box.hi.cwiseMax(middle + half);
    });
  }

  /// How far outside its subdomain a rank may hold a stored granule.
  double slack() const { return bed_.ranks.count > 1 ? bed_.scales.diameter() + bed_.largest_clump : 0.0; }

 private:
  static constexpr int every_frame = -1;

  const BedState& bed_;
};

}  // namespace solidcull
