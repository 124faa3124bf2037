#include "refill.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "near_walls.h"
#include "sphere_relaxation.h"

namespace solidcull {
namespace {

constexpr int sweeps_alone = 400;
// ranks show each other what they have packed so many times
constexpr int rounds_beside_others = 6, sweeps_in_a_round = 80;
constexpr double overlap_allowed = 1e-4;  // of the radii's sum
constexpr double longest_way = 1.5;       // diameters

}  // namespace

bool Refill::pack() {
  const std::vector<std::int64_t> came = exchange_.take_what_came_back();
  if (!ports_.ranks.any(!came.empty())) return false;
  newcomers_.insert(newcomers_.end(), came.begin(), came.end());
  std::sort(newcomers_.begin(), newcomers_.end());
  newcomers_.erase(std::unique(newcomers_.begin(), newcomers_.end()), newcomers_.end());
  if (!ports_.ranks.has_neighbours())
    pack(sweeps_alone);
  else
    for (int round = 0; round < rounds_beside_others; ++round) pack(sweeps_in_a_round);
  return true;
}

void Refill::pack(int sweeps) {
  const Atoms& atoms = ports_.atoms;
  struct Row {
    Triple at;
    double radius;
    int rank;
    bool newcomer;
  };
  std::vector<char> is_new(static_cast<std::size_t>(atoms.owned), 0);
  std::vector<int> movable;
  std::vector<Sphere> free;
  Vec3 lo = Vec3::Constant(HUGE_VAL), hi = Vec3::Constant(-HUGE_VAL);
  for (const std::int64_t tag : newcomers_) {
    const int* i = index_.find(tag);
    if (!i || shell_[*i].body <= 0) continue;  // it went to the store again, or has left its body
    is_new[static_cast<std::size_t>(*i)] = 1;
    movable.push_back(*i);
    free.push_back(atoms.sphere(*i));
    lo = lo.cwiseMin(free.back().centre);
    hi = hi.cwiseMax(free.back().centre);
  }
  const double way = longest_way * scales_.diameter(), reach = contact_reach(ports_, solid_) + way;
  std::vector<Sphere> fixed;
  const auto stands_near = [&](const Sphere& s) {
    if ((s.centre.array() > lo.array() - reach).all() && (s.centre.array() < hi.array() + reach).all()) fixed.push_back(s);
  };
  std::vector<Row> rows;
  for (int i = 0; i < atoms.owned; ++i) {
    const bool newcomer = is_new[static_cast<std::size_t>(i)];
    if (!newcomer) stands_near(atoms.sphere(i));
    rows.push_back({triple(atoms.place(i)), atoms.radius[i], ports_.ranks.me, newcomer});
  }
  if (ports_.ranks.has_neighbours())
    for (const Row& r : ports_.ranks.exchange(rows, reach))
      if (!r.newcomer || r.rank != ports_.ranks.me) stands_near({vec(r.at), r.radius});  // its own see each other across a side
  if (free.empty()) return;
  std::vector<Sphere> soft;
  std::set<std::int64_t> seen;
  for (const Sphere& s : free)
    stored_.for_each_near(s, scales_.diameter(), [&](const Resident& g) {
      if (seen.insert(g.tag).second) soft.push_back({solid_.nearest_image(solid_.in_world(g), s.centre), g.radius});
    });
  Vec3 periods = ports_.run.edges();
  for (int d = 0; d < 3; ++d)
    if (!ports_.run.periodic[d]) periods[d] = 0;
  const NearWalls walls(ports_.walls, free, way);
  const std::vector<Sphere> before = free;
  SphereRelaxation relaxation(std::move(free), std::move(fixed), std::move(soft), periods);
  relaxation.keep_to([&](std::size_t k, const Vec3& place) {
    return (place - before[k].centre).squaredNorm() < way * way && ports_.run.keeps(place) &&
           !walls.near(k, {place, before[k].radius}, 0);
  });
  largest_overlap_ = std::max(largest_overlap_, relaxation.relax(sweeps, overlap_allowed));
  place(movable, relaxation.spheres());
}

void Refill::place(const std::vector<int>& atoms, const std::vector<Sphere>& now) {
  for (std::size_t k = 0; k < atoms.size(); ++k) {
    const int i = atoms[k];
    const Vec3 by = now[k].centre - ports_.atoms.place(i);
    if (!by.isZero(0)) exchange_.relocate(i, shell_[i].place + solid_.bodies().pose(shell_[i].body).turned_to_frame(by));
  }
}

}  // namespace solidcull
