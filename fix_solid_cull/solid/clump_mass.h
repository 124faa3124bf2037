// What a clump has of mass: several spheres, one granule (theory.md#clumps).
#pragma once

#include <Eigen/Geometry>

#include "pose.h"

namespace solidcull {

/// How the mass of a clump lies, in the frame of its body or in the world.
struct ClumpMass {
  Vec3 centre;              ///< of mass (m)
  Eigen::Quaterniond turn;  ///< of its principal axes
  Vec3 inertia;             ///< about them (kg m^2)

  /// About the centre (kg m^2).
  Eigen::Matrix3d tensor() const { return about_axes(inertia); }
  /// Sum of m x x^T about the centre (kg m^2).
  Eigen::Matrix3d second() const { return about_axes(Vec3::Constant(0.5 * inertia.sum()) - inertia); }
  void move(const Vec3& by) { centre += by; }
  void to_world(const Pose& pose) { *this = in_world(pose); }
  void to_frame(const Pose& pose) { *this = in_frame(pose); }
  void reframe(const Pose& from, const Pose& to) { *this = seen_from(from, to); }
  ClumpMass in_world(const Pose& pose) const { return {pose.to_world(centre), pose.quaternion() * turn, inertia}; }
  ClumpMass in_frame(const Pose& pose) const { return {pose.to_frame(centre), pose.quaternion().conjugate() * turn, inertia}; }
  ClumpMass seen_from(const Pose& here, const Pose& there) const { return in_world(here).in_frame(there); }

 private:
  Eigen::Matrix3d about_axes(const Vec3& along) const {
    const Eigen::Matrix3d axes = turn.toRotationMatrix();
    return axes * along.asDiagonal() * axes.transpose();
  }
};

}  // namespace solidcull
