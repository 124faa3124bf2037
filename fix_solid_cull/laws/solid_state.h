// Solid state: a granule and its neighbours move as one rigid piece, in force balance, for long enough (theory.md#solid-state).
#pragma once

#include <algorithm>
#include <cmath>

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
  double speed;    ///< largest relative velocity at a contact, and in a fixed body of the granule itself (m/s)
  double force;    ///< largest out-of-balance force in granule weights
  double gravity;  ///< |g| in m/s^2
  static constexpr double gap = 0.01;                   ///< touching within this share of the radii's sum counts as contact
  static constexpr double drift_share = 0.05;           ///< of `speed`, for granules without a loaded contact
  static constexpr double out_of_balance_share = 0.25;  ///< of the wake-up tolerance A

  /// How many times as long a granule must be calm for what its contacts press with (normal_load; below 0: not known). What
  /// presses on granules sets the time in which they change places, d (density / pressure)^(1/2), the time in the inertial
  /// number of dense flow: one at a surface, with little above it, takes longer to show that it still creeps. Forces in the
  /// same unit.
  static double patience(double weight, double normal_load) {
    constexpr double confined = 3, longest = 2;  // normal load in weights beyond which no more time is needed
    if (normal_load < 0 || normal_load >= confined * weight) return 1;
    return normal_load == 0 ? longest : std::min(longest, std::sqrt(confined * weight / normal_load));
  }

  bool quiet_contact(const MovingSphere& a, const MovingSphere& b) const {
    return contact_velocity(a, b).squaredNorm() < speed * speed;
  }
  /// The same for granules that nothing presses together: no friction stops what drifts apart, so it must hardly do so at all.
  bool still_neighbour(const MovingSphere& a, const MovingSphere& b) const {
    return contact_velocity(a, b).squaredNorm() < drift_share * drift_share * speed * speed;
  }
  /// It spins beside the other one: where neither presses on the other nothing passes between them, as long as they keep their
  /// distance.
  bool spins_beside(const MovingSphere& a, const MovingSphere& b) const {
    return (b.velocity - a.velocity).squaredNorm() < drift_share * drift_share * speed * speed && !quiet_contact(a, b);
  }
  /// Since calm began it has kept its velocity, or changed it as its neighbours' acceleration of then makes it: nothing has
  /// struck it, and the frame in which it rests is not shaken.
  bool went_on(const Vec3& velocity_change, const Vec3& acceleration_then, const Vec3& acceleration_now, double seconds) const {
    return balanced(acceleration_now, acceleration_then) &&
           (velocity_change.squaredNorm() < speed * speed ||
            (velocity_change - seconds * acceleration_then).squaredNorm() < speed * speed);
  }
  /// In balance in the frame that moves with its neighbours: its acceleration against theirs (m/s^2).
  bool balanced(const Vec3& acceleration, const Vec3& of_neighbours) const {
    const double limit = force * gravity;
    return (acceleration - of_neighbours).squaredNorm() < limit * limit;
  }
};

}  // namespace solidcull
