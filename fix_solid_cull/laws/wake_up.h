// When an interface granule wakes, and how much of the body it takes along (theory.md#wake-up).
#pragma once

#include <algorithm>

#include "sphere.h"

namespace solidcull {

/// The error control: an absolute and a relative tolerance, as in an ODE solver.
struct WakeUpLaw {
  double absolute;                       ///< A, in granule weights: at most
  double relative;                       ///< R, in normal loads at locking
  double gravity;                        ///< |g| in m/s^2
  double carve_radius;                   ///< r0 in m
  double carve_cap;                      ///< largest growth of r0
  double diameter;                       ///< d in m
  static constexpr double growth = 0.5;  ///< c of the carve law
  static constexpr double direction_share = 1.0 / 120,
                          size_share = 1.0 / 12;  ///< for A = 1: 2.5 % and 25 % at the default tolerance
  static constexpr double turning_share = 0.1;    ///< of the direction's share, where the deck turns gravity
  static constexpr double small_body = 300;       ///< granules: below, the shares grow, tenfold at most

  static constexpr double own_share = 0.5, least_share = 0.15;

  /// Largest load change (N) that a granule of this mass (kg) and normal load at locking (N; below 0: not known) sleeps through:
  /// A weights, but no more than half of what its contacts press with, for at a surface that is less than A weights and a
  /// granule there would sleep on when its support has gone; no less than 15 % of A weights, and R normal loads on top.
  double tolerance(double mass, double normal_load) const {
    const double most = absolute * mass * gravity;
    if (normal_load < 0) return most;
    return std::clamp(own_share * normal_load, least_share * most, most) + relative * normal_load;
  }

  /// |F_ext - F_ext(at locking)| over the tolerance; the granule wakes above 1.
  double excess(const Vec3& load, const Vec3& load_at_locking, double mass, double normal_load) const;

  /// Effective gravity (g less the body's acceleration, in the body's frame) against what it was at locking: beyond a share of
  /// |g| the whole body wakes. Direction counts ten times as much as size, for what a packing bears depends on the direction of
  /// its load. A body of a few granules has all of them at its shell, where each one's own load is watched: its share is larger.
  /// Where gravity itself turns, a tenth of the change in direction is enough (theory.md#effective-gravity).
  bool gravity_changed(const Vec3& now, const Vec3& at_locking, double granules, bool turns = false) const;

  /// Radius (m) of the ball that a waking granule carves: r0 (1 + c log2(excess)), at most cap r0 (theory.md#carve). excess >= 1.
  double radius(double excess) const;

  /// A granule that wakes beside this many others is in a front: a wave passes, or the support of many has gone. Balls around a
  /// front run ahead of it: with an r0 of one diameter a wave would lose a tenth of what it does to the floor, and a bed would
  /// fall late.
  static constexpr int front_size = 3;
  double front_reach() const { return 3 * diameter; }  ///< m: who is beside it
  /// By how much balls are larger there: r0 is two diameters at least.
  double front_growth() const { return std::max(1.0, 2 * diameter / carve_radius); }
  /// No ball is larger (m).
  double largest_radius() const { return std::max(1.0, carve_cap) * carve_radius * front_growth(); }
};

}  // namespace solidcull
