// The scales of a deck, and the laws measured in them (theory.md#scales).
#pragma once

#include <algorithm>
#include <cmath>

#include "settings.h"
#include "solid_state.h"
#include "wake_up.h"

namespace solidcull {

/// What the user sets, and what it is in SI units in this deck. Written at the start of runs only.
class Scales {
 public:
  explicit Scales(const Settings& settings) : settings_(settings) {}

  /// Mean granule diameter (m) and size of gravity (m/s^2), as found or as a restart file has them; 0: not known yet.
  void set(double diameter, double gravity) {
    diameter_ = diameter;
    gravity_ = gravity;
  }
  /// The laws follow, for a time step of dt (s). Needs both scales.
  void make_laws(double dt) {
    look_every_ = settings_.every ? settings_.every : look_interval(diameter_, gravity_, dt);
    solid_state_ = {settings_.speed * std::sqrt(gravity_ * diameter_),
                    SolidStateLaw::out_of_balance_share * std::max(settings_.tolerance_absolute, 1.0), gravity_};
    wake_up_ = {settings_.tolerance_absolute,       settings_.tolerance_relative, gravity_,
                settings_.carve_radius * diameter_, settings_.carve_cap,          diameter_};
  }

  const Settings& settings() const { return settings_; }
  double diameter() const { return diameter_; }  ///< mean, m
  double gravity() const { return gravity_; }    ///< |g|, m/s^2; the standard one where the deck has none
  int look_every() const { return look_every_; }
  const SolidStateLaw& solid_state() const { return solid_state_; }
  const WakeUpLaw& wake_up() const { return wake_up_; }

  bool sleeping() const { return settings_.exterior == Exterior::sleep; }
  bool compact() const { return settings_.store == Store::compact; }
  /// No place of a stored granule is kept: what comes back is put into a new packing.
  bool refills() const { return settings_.store == Store::none; }
  /// The place of a stored granule is all that tells in which periodic image it is.
  bool image_by_place() const { return compact() || refills(); }
  bool needs_surface() const { return settings_.exterior == Exterior::live; }
  double depth() const { return settings_.depth * diameter_; }  ///< m
  double voxel() const { return settings_.voxel * diameter_; }  ///< m
  /// Radius of the ball that fits into no pore of a packing; a hole that holds one is open to the outside (m).
  double closing() const { return closing_diameters * diameter_; }

  static constexpr double standard_gravity = 9.81;  ///< m/s^2

 private:
  static constexpr double closing_diameters = 0.6;

  const Settings settings_;
  double diameter_ = 0, gravity_ = 0;
  int look_every_ = 0;
  SolidStateLaw solid_state_{};
  WakeUpLaw wake_up_{};
};

}  // namespace solidcull
