#include "wake_up.h"

#include <algorithm>
#include <cmath>

namespace solidcull {

double WakeUpLaw::excess(const Vec3& load, const Vec3& load_at_locking, double mass, double normal_load) const {
  return (load - load_at_locking).norm() / tolerance(mass, normal_load);
}

double WakeUpLaw::radius(double excess) const {
  const double factor = 1.0 + growth * std::log2(std::max(1.0, excess));
  return carve_radius * std::min(carve_cap, factor);
}

bool gravity_changed(const Vec3& now, const Vec3& at_locking) {
  return (now - at_locking).norm() > effective_gravity_fraction * at_locking.norm();
}

}  // namespace solidcull
