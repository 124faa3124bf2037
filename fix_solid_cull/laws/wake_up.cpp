#include "wake_up.h"

#include <algorithm>
#include <cmath>

namespace solidcull {

double WakeUpLaw::excess(const Vec3& load, const Vec3& load_at_locking, double mass, double normal_load) const {
  return (load - load_at_locking).norm() / tolerance(mass, normal_load);
}

bool WakeUpLaw::gravity_changed(const Vec3& now, const Vec3& at_locking, double granules, bool turns) const {
  const double scale = gravity * std::clamp(small_body / granules, 1.0, 10.0);
  const Vec3 change = now - at_locking;
  const double before = at_locking.norm();
  // where nothing was felt there is no direction to change
  const double along = before > size_share * scale ? change.dot(at_locking) / before : change.norm();
  const double across = std::sqrt(std::max(0.0, change.squaredNorm() - along * along));
  const double direction = (direction_share * absolute + relative) * (turns ? turning_share : 1.0);
  return across > direction * scale || std::abs(along) > (size_share * absolute + relative) * scale;
}

double WakeUpLaw::radius(double excess) const {
  const double factor = 1.0 + growth * std::log2(std::max(1.0, excess));
  return carve_radius * std::min(carve_cap, factor);
}

}  // namespace solidcull
