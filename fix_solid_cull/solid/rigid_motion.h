// Free and forced motion of one rigid body, in step with the engine's velocity-Verlet integrator (theory.md#body-integrator).
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>

#include "pose.h"

namespace solidcull {

/// A rigid velocity field: velocity (m/s) at `point` (m) and spin (rad/s); world frame.
struct Twist {
  Vec3 point = Vec3::Zero(), velocity = Vec3::Zero(), spin = Vec3::Zero();
  Vec3 at(const Vec3& x) const { return velocity + spin.cross(x - point); }
};

/// A piece of rigid matter, a granule or a body: mass (kg), centre (m), inertia about it (kg m^2), motion of the centre and spin.
/// World frame.
struct RigidPart {
  double mass = 0;
  Vec3 centre = Vec3::Zero();
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
  Vec3 velocity = Vec3::Zero(), spin = Vec3::Zero();

  /// A ball: 2/5 m r^2 about any axis.
  static RigidPart granule(double mass, double radius, const Vec3& position, const Vec3& velocity, const Vec3& spin);
  /// Angular momentum about a point of the world (kg m^2/s).
  Vec3 angular_momentum(const Vec3& about) const { return inertia * spin + (centre - about).cross(mass * velocity); }
  double kinetic_energy() const { return 0.5 * mass * velocity.squaredNorm() + 0.5 * spin.dot(inertia * spin); }
};

/// Several pieces, tied together: what of them adds up. Momentum (kg m/s) and angular momentum (kg m^2/s) are about their centre
/// of mass. World frame.
struct RigidSum {
  double mass = 0;
  Vec3 centre = Vec3::Zero();
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
  Vec3 momentum = Vec3::Zero(), angular_momentum = Vec3::Zero();

  RigidSum(double m, const Vec3& x, const Eigen::Matrix3d& about_centre, const Vec3& p, const Vec3& turning)
      : mass(m), centre(x), inertia(about_centre), momentum(p), angular_momentum(turning) {}
  explicit RigidSum(const RigidPart& part)
      : RigidSum(part.mass, part.centre, part.inertia, part.mass * part.velocity, part.inertia * part.spin) {}
  void add(const RigidSum& other);
};

/// Turning about these world axes is possible; a body that is tied to its own periodic image cannot turn freely.
using FreeAxes = std::array<bool, 3>;

class RigidMotion {
 public:
  RigidMotion() = default;
  /// The rigid body that the parts become when they are tied together: momentum and angular momentum are kept (those about axes
  /// that are not free go to what ties the body). At least one part with mass.
  explicit RigidMotion(const RigidPart* parts, int count, const FreeAxes& free = {true, true, true});
  explicit RigidMotion(const RigidSum& sum, const FreeAxes& free = {true, true, true});

  /// Momentum changes by force (N) and torque about the centre (N m) over dt (s).
  void kick(const Vec3& force, const Vec3& torque, double dt);
  /// Moves over dt (s) with the momentum that it has: translation exact, rotation by the midpoint rule for the free top, of
  /// second order, which keeps the angular momentum to the last bit. Returns what was done to space.
  RigidStep drift(double dt);
  void shift(const Vec3& by) { centre_ += by; }
  /// What holds it takes its momentum.
  void stop() { velocity_ = angular_momentum_ = Vec3::Zero(); }

  /// Calls visit(number) with a reference to each number of the state, in one order: to write it to a file and to read it back.
  template <class Visit>
  void each_number(Visit visit) {
    visit(mass_);
    for (Vec3* v : {&centre_, &velocity_, &angular_momentum_})
      for (int d = 0; d < 3; ++d) visit((*v)[d]);
    for (int k = 0; k < 9; ++k) visit(inverse_inertia_.data()[k]);
    for (int k = 0; k < 4; ++k) visit(turned_.coeffs()[k]);
    for (bool& f : free_) visit(f);
    visit(all_free_);
  }

  double mass() const { return mass_; }
  const Vec3& centre() const { return centre_; }
  const Vec3& velocity() const { return velocity_; }
  const Vec3& angular_momentum() const { return angular_momentum_; }  ///< about the centre
  Vec3 spin() const { return spin_at(turned_); }
  Twist twist() const { return {centre_, velocity_, spin()}; }
  /// Acceleration (m/s^2) of the body's point x under force and torque about the centre.
  Vec3 acceleration(const Vec3& x, const Vec3& force, const Vec3& torque) const;
  double kinetic_energy() const { return 0.5 * mass_ * velocity_.squaredNorm() + 0.5 * spin().dot(angular_momentum_); }

 private:
  Vec3 spin_at(const Eigen::Quaterniond& turned) const { return spin_of(turned, angular_momentum_); }
  Vec3 spin_of(const Eigen::Quaterniond& turned, const Vec3& angular_momentum) const;
  void set_inertia(const Eigen::Matrix3d& inertia);
  void keep_free_axes();

  double mass_ = 0;
  Vec3 centre_ = Vec3::Zero(), velocity_ = Vec3::Zero(), angular_momentum_ = Vec3::Zero();
  Eigen::Matrix3d inverse_inertia_ = Eigen::Matrix3d::Zero();   // as it stood when the body was tied together
  Eigen::Quaterniond turned_ = Eigen::Quaterniond::Identity();  // since then
  FreeAxes free_{true, true, true};
  bool all_free_ = true;
};

/// The rotation by the vector `angle` (rad).
Eigen::Quaterniond rotation(const Vec3& angle);

}  // namespace solidcull
