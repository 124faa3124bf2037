#include "contacts_in_store.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace solidcull {
namespace {

/// Calls visit(shift) for each whole number of periods that brings the place into the box, or as near to it as `reach`; frame of
/// the body, whose pose is given. Not for none at all.
template <class Visit>
void for_each_image(const Vec3& place, const Vec3& lo, const Vec3& hi, double reach, const Vec3& periods, const Pose& pose,
                    Visit visit) {
  std::array<int, 3> most{};  // periods that fit into the box, whatever way it is turned
  for (int d = 0; d < 3; ++d)
    if (periods[d] > 0) most[d] = static_cast<int>(std::ceil(((hi - lo).norm() + reach) / periods[d]));
  for (int i = -most[0]; i <= most[0]; ++i)
    for (int j = -most[1]; j <= most[1]; ++j)
      for (int k = -most[2]; k <= most[2]; ++k) {
        if (i == 0 && j == 0 && k == 0) continue;
        const Vec3 shift = pose.turned_to_frame(Vec3(i * periods[0], j * periods[1], k * periods[2]));
        const Vec3 there = place + shift;
        if ((there.array() >= lo.array() - reach).all() && (there.array() <= hi.array() + reach).all()) visit(shift);
      }
}

}  // namespace

void contacts_in_store(const GranuleStore& store, const SolidBodies& bodies, std::int64_t tag, double gap,
                       std::vector<std::int64_t>& partners) {
  const auto found = store.find(tag);
  if (!found) return;
  std::vector<Resident> near;
  contacts_in_store(store, bodies, *found, gap, near);
  for (const Resident& g : near) partners.push_back(g.tag);
}

void contacts_in_store(const GranuleStore& store, const SolidBodies& bodies, const Resident& granule, double gap,
                       std::vector<Resident>& partners) {
  const int body = bodies.root(granule.body), frame = store.frame_of(granule.body);
  if (!store.occupies(frame)) return;
  const double farthest = gap * (granule.radius + store.largest_radius());
  const auto look_around = [&](const Vec3& place) {
    store.for_each_near(frame, {place, granule.radius}, farthest, [&](const Resident& other) {
      const double reach = (1 + gap) * (granule.radius + other.radius);
      if (other.tag == granule.tag || (other.position - place).squaredNorm() > reach * reach || bodies.root(other.body) != body)
        return;
      const auto known = [&](const Resident& g) { return g.tag == other.tag; };
      if (std::none_of(partners.begin(), partners.end(), known)) partners.push_back(other);
    });
  };
  look_around(granule.position);
  if ((bodies.periods().array() > 0).any())
    for_each_image(granule.position, store.lowest(frame), store.highest(frame),
                   granule.radius + store.largest_radius() + farthest, bodies.periods(),
                   frame == GranuleStore::shared_frame ? Pose() : bodies.pose(granule.body),
                   [&](const Vec3& shift) { look_around(granule.position + shift); });
}

}  // namespace solidcull
