// Where a rigid body is: its own frame, seen from the world (theory.md#frames-and-signs).
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "sphere.h"

namespace solidcull {

/// One rigid motion of space: x goes to `to + turn (x - from)`. World frame, m.
struct RigidStep {
  Vec3 from, to;
  Eigen::Quaterniond turn;
};

/// A body's frame: world = turn * frame + origin. The identity maps to the last bit. Lengths in m.
class Pose {
 public:
  Pose() = default;
  Pose(const Vec3& origin, const Eigen::Quaterniond& turn) : origin_(origin), quaternion_(turn), turn_(turn.toRotationMatrix()) {}

  Vec3 to_world(const Vec3& place) const { return turn_ * place + origin_; }
  Vec3 to_frame(const Vec3& position) const { return turn_.transpose() * (position - origin_); }
  Vec3 turned_to_world(const Vec3& v) const { return turn_ * v; }
  Vec3 turned_to_frame(const Vec3& v) const { return turn_.transpose() * v; }

  const Vec3& origin() const { return origin_; }
  const Eigen::Quaterniond& quaternion() const { return quaternion_; }
  const Eigen::Matrix3d& turn() const { return turn_; }

  /// The frame moves with the body; the quaternion is kept normal.
  void advance(const RigidStep& s) {
    const Vec3 origin = s.to + s.turn * (origin_ - s.from);
    *this = Pose(origin, (s.turn * quaternion_).normalized());
  }
  void shift(const Vec3& by) { origin_ += by; }

  bool operator==(const Pose& o) const { return origin_ == o.origin_ && quaternion_.coeffs() == o.quaternion_.coeffs(); }
  bool operator!=(const Pose& o) const { return !(*this == o); }

 private:
  Vec3 origin_ = Vec3::Zero();
  Eigen::Quaterniond quaternion_ = Eigen::Quaterniond::Identity();
  Eigen::Matrix3d turn_ = Eigen::Matrix3d::Identity();
};

/// Largest way (m) that a point of the box, given in the frame, has gone from one pose to the other: at a corner, for the way is
/// convex.
inline double largest_way(const Pose& then, const Pose& now, const Vec3& lo, const Vec3& hi) {
  double square = 0;
  for (int c = 0; c < 8; ++c) {
    const Vec3 corner(c & 1 ? hi[0] : lo[0], c & 2 ? hi[1] : lo[1], c & 4 ? hi[2] : lo[2]);
    square = std::max(square, (now.to_world(corner) - then.to_world(corner)).squaredNorm());
  }
  return std::sqrt(square);
}

/// Half the edges of the axis-aligned box in the target frame that holds a turned box with half edges `half`.
inline Vec3 turned_half_box(const Eigen::Matrix3d& turn, const Vec3& half) { return turn.cwiseAbs() * half; }

}  // namespace solidcull
