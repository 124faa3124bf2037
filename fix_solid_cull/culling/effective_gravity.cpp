#include "effective_gravity.h"

#include <algorithm>
#include <cmath>

namespace solidcull {
namespace {

// a body feels a force as a whole once the wave has crossed it: steps for one granule
constexpr double steps_per_granule = 10;

}  // namespace

void EffectiveGravity::watch_bodies(bool at_once) {
  const Vec3 g = bed_.run.gravity();
  if (g != gravity_then_)  // what stands still feels gravity alone
    for (const auto& [number, b] : bed_.solid.bodies().bodies())
      if (b.grounded && bed_.scales.wake_up().gravity_changed(b.pose.turned_to_frame(g), b.felt_known ? b.felt : gravity_then_,
                                                              static_cast<double>(b.mass.count), turns_))
        bed_.wake.ask_body(number);
  for (const ActiveBody& a : motion_.active()) watch(a, g, at_once);
}

/// The mean acceleration over the time in which a wave crosses the body is what it feels as a whole.
void EffectiveGravity::watch(const ActiveBody& a, const Vec3& g, bool at_once) {
  const WakeUpLaw& law = bed_.scales.wake_up();
  const std::int64_t now = bed_.run.step;
  SolidBody& b = *a.body;
  const double granules = b.granules();
  const auto wakes_if = [&](bool changed) {
    if (changed) bed_.wake.ask_body(a.number);
  };
  if (b.grounded) {
    b.feel_first(b.pose.turned_to_frame(g));
    return;
  }
  if (at_once) {
    wakes_if(b.felt_known && law.gravity_changed(b.pose.turned_to_frame(g - b.acceleration), b.felt, granules, turns_));
    b.begin_window(now);
    return;
  }
  if (b.step_then < 0) {
    b.begin_window(now);
    return;
  }
  const double window = std::max<double>(bed_.scales.look_every(), steps_per_granule * std::cbrt(granules));
  const double steps = static_cast<double>(now - b.step_then);
  if (steps < window) return;
  b.end_window(steps * bed_.run.dt);
  const Vec3 feels = b.pose.turned_to_frame(g - b.acceleration);
  wakes_if(b.felt_known && law.gravity_changed(feels, b.felt, granules, turns_));
  b.feel_first(feels);
  b.begin_window(now);
}

}  // namespace solidcull
