#include "inner_contacts.h"

#include "solid_state.h"

namespace solidcull {

Vec3 InnerContacts::apart(const Resident& a, const Resident& b) const {
  const Vec3 there = b.position - a.position;
  const double reach = (1 + SolidStateLaw::gap) * (a.radius + b.radius);
  if ((bodies_.periods().array() == 0).all() || there.squaredNorm() <= reach * reach) return there;
  const Pose& pose = bodies_.pose(a.body);
  return pose.turned_to_frame(bodies_.nearest_image(pose.turned_to_world(there), Vec3::Zero()));
}

}  // namespace solidcull
