#include "site_choice.h"

#include <algorithm>

namespace solidcull {
namespace {

constexpr double search = 1.5;          // in diameters of the sites
constexpr double weight_of_way = 0.02;  // of the way to a site in its diameters, squared, beside overlaps in shares, squared

std::vector<Sphere> spheres_of(const Atoms& atoms, const std::vector<int>& which) {
  std::vector<Sphere> spheres;
  for (const int i : which) spheres.push_back(atoms.sphere(i));
  return spheres;
}

double way_to_come(const std::vector<Sphere>& spheres, const Scales& scales) {
  double largest = scales.diameter();
  for (const Sphere& s : spheres) largest = std::max(largest, 2 * s.radius);
  return 1.5 * search * largest;  // an octave's sites are for granules of 0.7 to 1.4 of their size
}

double square_of_overlap(const Sphere& a, const Sphere& b, const Vec3& apart) {
  const double sum = a.radius + b.radius, share = 1 - apart.norm() / sum;
  return share > 0 ? share * share : 0.0;
}

}  // namespace

SiteChoice::SiteChoice(const Bed& bed, const std::vector<int>& going, double wall_gap, Clear clear)
    : bed_(bed),
      going_(going),
      wall_gap_(wall_gap),
      clear_(std::move(clear)),
      spheres_(spheres_of(bed.atoms, going)),
      walls_(bed.walls, spheres_, way_to_come(spheres_, bed.scales) + wall_gap) {
  std::vector<char> goes(static_cast<std::size_t>(bed.atoms.owned), 0);
  for (const int i : going) goes[static_cast<std::size_t>(i)] = 1;
  std::vector<Sphere> staying;
  for (int i = 0; i < bed.atoms.owned; ++i)
    if (bed.shell[i].locked && !goes[static_cast<std::size_t>(i)]) staying.push_back(bed.atoms.sphere(i));
  staying_.build(std::move(staying), 2 * bed.scales.diameter());
}

/// Sum of their squares, as shares of the radii's sums.
double SiteChoice::overlaps(const Sphere& there, const Sphere& in_frame, int frame) const {
  double sum = 0;
  bed_.solid.store().for_each_near(frame, in_frame, 0, [&](const Resident& g) {
    sum += square_of_overlap(in_frame, {g.position, g.radius}, g.position - in_frame.centre);
  });
  const Vec3 reach = Vec3::Constant(there.radius + staying_.largest_radius());
  staying_.for_each_in_box(there.centre - reach, there.centre + reach, [&](std::size_t, const Sphere& s) {
    sum += square_of_overlap(there, s, s.centre - there.centre);
    return true;
  });
  return sum;
}

std::optional<Vec3> SiteChoice::of(std::size_t k) const {
  const int i = going_[k];
  const Locked& e = bed_.shell[i];
  const Sphere& from = spheres_[k];
  const GranuleStore& store = bed_.solid.store();
  const Pose& pose = bed_.solid.bodies().pose(e.body);
  std::optional<Vec3> best;
  double least = HUGE_VAL;
  store.free_site(e.body, e.place, from.radius, search, [&](const Vec3& site) {
    const Vec3 by = pose.turned_to_world(site - e.place);
    const Sphere there{from.centre + by, from.radius};
    const double way = by.norm() / bed_.scales.diameter();
    double cost = weight_of_way * way * way;
    if (cost >= least) return false;
    cost += overlaps(there, {site, from.radius}, store.frame_of(e.body));
    if (cost >= least || walls_.near(k, there, wall_gap_) || walls_.between(k, from, there.centre) || !clear_(i, there))
      return false;
    best = site;
    least = cost;
    return false;  // look on
  });
  return best;
}

}  // namespace solidcull
