#include "seen_granules.h"

#include <utility>

namespace solidcull {
namespace {

constexpr double voxel_diameters = 0.5;

struct Row {
  Triple at;
  double radius;
};

}  // namespace

SeenGranules::SeenGranules(const Bed& bed)
    : bed_(bed),
      depth_(depth_diameters * bed.scales.diameter()),
      surface_(voxel_diameters * bed.scales.diameter(), bed.scales.closing(),
               [this](const Vec3& lo, const Vec3& hi, const Visit& visit) { gather(lo, hi, visit); }) {
  std::vector<Row> here;
  std::vector<Sphere> spheres;
  for (int i = 0; i < bed_.atoms.owned; ++i) spheres.push_back(bed_.atoms.sphere(i));
  if (bed_.ranks.has_neighbours()) {
    for (const Sphere& s : spheres) here.push_back({triple(s.centre), s.radius});
    bed_.solid.store().for_each([&](const Resident& g) {
      here.push_back({triple(bed_.run.wrapped(bed_.solid.in_world(g))), g.radius});
    });
    // how far a granule can change another one's depth, and how far outside one may be held
    const double reach = depth_ + 2 * bed_.scales.closing() + bed_.largest_radius + bed_.stored.slack();
    for (const Row& r : bed_.ranks.exchange(here, reach)) spheres.push_back({vec(r.at), r.radius});
  }
  atoms_and_neighbours_.build(std::move(spheres), 2 * bed_.scales.diameter());
}

/// All spheres that may overlap the box, grown by the closing.
void SeenGranules::gather(const Vec3& lo, const Vec3& hi, const Visit& visit) const {
  const Vec3 reach = Vec3::Constant(bed_.largest_radius + bed_.scales.closing());
  atoms_and_neighbours_.for_each_in_box(lo - reach, hi + reach, [&](std::size_t, const Sphere& s) {
    visit(s);
    return true;
  });
  const Vec3 middle = 0.5 * (lo + hi);
  bed_.stored.for_each_in_box(lo - reach, hi + reach, [&](const Resident& g) {
    visit({bed_.solid.nearest_image(bed_.solid.in_world(g), middle), g.radius});
  });
}

}  // namespace solidcull
