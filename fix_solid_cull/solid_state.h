// Solid state: a granule and its neighbours move as one rigid piece, in force balance, for long enough (DESIGN section 5).
#pragma once

#include "sphere.h"

namespace solidcull {

struct MovingSphere {
  Vec3 position, velocity, spin;  // m, m/s, rad/s; world frame
  double radius;                  // m
};

/// Velocity of b's surface against a's at their point of contact, spins included (m/s): zero for any rigid motion of the pair.
inline Vec3 contact_velocity(const MovingSphere& a, const MovingSphere& b) {
  const Vec3 n = (b.position - a.position).normalized();
  return (b.velocity + b.spin.cross(-b.radius * n)) - (a.velocity + a.spin.cross(a.radius * n));
}

struct SolidStateLaw {
  double speed;                     ///< largest relative velocity at a contact, and in a fixed body of the granule itself (m/s)
  double force;                     ///< largest out-of-balance force in granule weights
  double gravity;                   ///< |g| in m/s^2
  int looks;                        ///< looks in a row
  static constexpr double gap = 0.01;                 ///< touching within this share of the radii's sum counts as contact
  static constexpr double out_of_balance_share = 0.25; ///< of the wake-up tolerance A

  bool quiet_contact(const MovingSphere& a, const MovingSphere& b) const {
    return contact_velocity(a, b).squaredNorm() < speed * speed;
  }
  /// A fixed body rests in the world: granule at rest in translation and at its surface.
  bool at_rest(const Vec3& velocity, const Vec3& spin, double radius) const {
    return velocity.squaredNorm() < speed * speed && spin.squaredNorm() * radius * radius < speed * speed;
  }
  bool balanced(const Vec3& total_force, double mass) const {
    const double limit = force * mass * gravity;
    return total_force.squaredNorm() < limit * limit;
  }
};

}  // namespace solidcull
