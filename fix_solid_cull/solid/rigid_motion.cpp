#include "rigid_motion.h"

#include <Eigen/Eigenvalues>
#include <cmath>

namespace solidcull {
namespace {

/// About an axis on which all of it lies nothing turns, as where granules are points to their body.
Eigen::Matrix3d inverse_of(const Eigen::Matrix3d& inertia) {
  constexpr double none = 1e-12;
  const double size = inertia.trace();
  if (inertia.determinant() > none * size * size * size) return inertia.inverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(inertia);
  Vec3 inverse = Vec3::Zero();
  for (int d = 0; d < 3; ++d)
    if (axes.eigenvalues()[d] > none * size) inverse[d] = 1 / axes.eigenvalues()[d];
  return axes.eigenvectors() * inverse.asDiagonal() * axes.eigenvectors().transpose();
}

}  // namespace

Eigen::Quaterniond rotation(const Vec3& angle) {
  const double half = 0.5 * angle.norm();
  // sin(h)/h, by its series where h is small
  const double ratio = half > 1e-4 ? std::sin(half) / half : 1.0 - half * half / 6.0;
  const Vec3 v = 0.5 * ratio * angle;
  return Eigen::Quaterniond(std::cos(half), v[0], v[1], v[2]);
}

RigidPart RigidPart::granule(double mass, double radius, const Vec3& position, const Vec3& velocity, const Vec3& spin) {
  return {mass, position, 0.4 * mass * radius * radius * Eigen::Matrix3d::Identity(), velocity, spin};
}

void RigidSum::add(const RigidSum& other) {
  const double all = mass + other.mass;
  const Vec3 apart = other.centre - centre;
  const double between = mass * other.mass / all;  // of two points that turn about their common centre
  inertia += other.inertia + between * (apart.squaredNorm() * Eigen::Matrix3d::Identity() - apart * apart.transpose());
  angular_momentum += other.angular_momentum + between * apart.cross(other.momentum / other.mass - momentum / mass);
  centre += other.mass / all * apart;
  momentum += other.momentum;
  mass = all;
}

RigidMotion::RigidMotion(const RigidPart* parts, int count, const FreeAxes& free)
    : free_(free), all_free_(free[0] && free[1] && free[2]) {
  // about the first part's centre and motion, so that nothing is lost to a far origin or a fast frame
  const Vec3 origin = parts[0].centre, frame = parts[0].velocity;
  Vec3 first = Vec3::Zero(), momentum = Vec3::Zero();
  for (int p = 0; p < count; ++p) {
    mass_ += parts[p].mass;
    first += parts[p].mass * (parts[p].centre - origin);
    momentum += parts[p].mass * (parts[p].velocity - frame);
  }
  const Vec3 to_centre = first / mass_;
  centre_ = origin + to_centre;
  velocity_ = frame + momentum / mass_;
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
  for (int p = 0; p < count; ++p) {
    const Vec3 arm = (parts[p].centre - origin) - to_centre;
    inertia += parts[p].inertia + parts[p].mass * (arm.squaredNorm() * Eigen::Matrix3d::Identity() - arm * arm.transpose());
    angular_momentum_ += parts[p].inertia * parts[p].spin + parts[p].mass * arm.cross(parts[p].velocity - velocity_);
  }
  set_inertia(inertia);
}

RigidMotion::RigidMotion(const RigidSum& sum, const FreeAxes& free)
    : mass_(sum.mass),
      centre_(sum.centre),
      velocity_(sum.momentum / sum.mass),
      angular_momentum_(sum.angular_momentum),
      free_(free),
      all_free_(free[0] && free[1] && free[2]) {
  set_inertia(sum.inertia);
}

void RigidMotion::set_inertia(const Eigen::Matrix3d& inertia) {
  if (all_free_) {
    inverse_inertia_ = inverse_of(inertia);
    return;
  }
  for (int d = 0; d < 3; ++d) inverse_inertia_(d, d) = free_[d] && inertia(d, d) > 0 ? 1.0 / inertia(d, d) : 0.0;
  keep_free_axes();
}

void RigidMotion::keep_free_axes() {
  for (int d = 0; d < 3; ++d)
    if (!free_[d]) angular_momentum_[d] = 0;
}

Vec3 RigidMotion::spin_of(const Eigen::Quaterniond& turned, const Vec3& angular_momentum) const {
  if (!all_free_) return inverse_inertia_ * angular_momentum;  // about one axis at most, which the turning leaves where it is
  return turned * (inverse_inertia_ * (turned.conjugate() * angular_momentum));
}

Vec3 RigidMotion::acceleration(const Vec3& x, const Vec3& force, const Vec3& torque) const {
  const Vec3 arm = x - centre_, w = spin();
  const Vec3 turning = spin_of(turned_, torque - w.cross(angular_momentum_));
  return force / mass_ + turning.cross(arm) + w.cross(w.cross(arm));
}

void RigidMotion::kick(const Vec3& force, const Vec3& torque, double dt) {
  velocity_ += dt / mass_ * force;
  angular_momentum_ += dt * torque;
  if (!all_free_) keep_free_axes();
}

RigidStep RigidMotion::drift(double dt) {
  RigidStep step{centre_, centre_ + dt * velocity_, Eigen::Quaterniond::Identity()};
  centre_ = step.to;
  if (angular_momentum_.isZero(0)) return step;
  const Eigen::Quaterniond halfway = rotation(0.5 * dt * spin_at(turned_)) * turned_;
  step.turn = rotation(dt * spin_at(halfway));
  turned_ = (step.turn * turned_).normalized();
  return step;
}

}  // namespace solidcull
