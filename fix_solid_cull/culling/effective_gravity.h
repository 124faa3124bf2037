// What a body feels as a whole: gravity less its own acceleration, in its own frame (theory.md#effective-gravity).
#pragma once

#include "bed.h"
#include "body_motion.h"

namespace solidcull {

/// Asks for bodies to wake that are tilted, shaken or let fall. Local.
class EffectiveGravity {
 public:
  EffectiveGravity(Bed& bed, const BodyMotion& motion) : bed_(bed), motion_(motion) {}

  /// At each look.
  void watch() {
    see_turn();
    watch_bodies(false);
    gravity_then_ = bed_.run.gravity();
  }
  /// At the start of a run: the deck may have changed gravity, all at once.
  void begin_run() {
    see_turn();
    if (bed_.run.gravity() != gravity_then_) watch_bodies(true);
    gravity_then_ = bed_.run.gravity();
  }
  /// The deck's gravity had another direction at the last look. A bed that is tilted yields in many small slips, each slow at
  /// first: none of it is solid until the tilting ends.
  bool turns() const { return turns_; }
  const Vec3& at_last_look() const { return gravity_then_; }               ///< m/s^2
  void set_at_last_look(const Vec3& gravity) { gravity_then_ = gravity; }  ///< as a restart file has it

 private:
  static constexpr double same_direction = 1e-9;  // sine

  void see_turn() {
    const Vec3 g = bed_.run.gravity();
    turns_ = g.cross(gravity_then_).norm() > same_direction * g.norm() * gravity_then_.norm();
  }
  void watch_bodies(bool at_once);
  void watch(const ActiveBody& a, const Vec3& g, bool at_once);

  Bed& bed_;
  const BodyMotion& motion_;
  Vec3 gravity_then_ = Vec3::Zero();  // at the last look
  bool turns_ = false;
};

}  // namespace solidcull
