#include "sphere_relaxation.h"

#include <algorithm>
#include <cmath>

#include "flat_map.h"
#include "sphere_cells.h"

namespace solidcull {
namespace {

constexpr double margin_in_radii = 0.4;  // pairs so near to touching are listed, too
constexpr double largest_step = 0.2;     // of a radius, in one push
constexpr double coincident = 1e-9;      // of the radii's sum: no direction is known
constexpr double share_of_stiff = 0.2;   // how readily they give way
constexpr int tries_at_a_place = 12;
constexpr double share_of_free = 0.5;  // of an overlap, where both can give way

/// Some place in a cube of edge 2 around the origin, the same for the same numbers.
Vec3 some_place(std::size_t a, std::size_t b) {
  const std::uint64_t hash = scrambled(scrambled(static_cast<std::uint64_t>(a)) + static_cast<std::uint64_t>(b));
  const auto share = [&](int bit) { return 2 * (static_cast<double>(hash >> bit & 0xfffff) / 0xfffff) - 1; };
  return Vec3(share(0), share(20), share(40));
}
Vec3 direction_of(std::size_t a, std::size_t b) { return (some_place(a, b) + Vec3(0, 0, 1e-3)).normalized(); }

std::vector<Sphere> joined(std::vector<Sphere> a, const std::vector<Sphere>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

}  // namespace

SphereRelaxation::SphereRelaxation(Spheres s, const Vec3& periods)
    : free_(joined(s.free, s.stiff)),
      fixed_(joined(s.fixed, s.soft)),
      stiff_from_(s.free.size()),
      soft_from_(s.fixed.size()),
      first_(free_),
      periods_(periods) {
  double mean = 0;
  for (const Sphere& s : free_) mean += s.radius;
  margin_ = free_.empty() ? 0 : margin_in_radii * mean / static_cast<double>(free_.size());
}

/// Calls visit(shift) for no shift and those to the periodic images around.
template <class Visit>
void SphereRelaxation::for_each_image(Visit visit) const {
  std::array<int, 3> images{};
  for (int d = 0; d < 3; ++d) images[d] = periods_[d] > 0 ? 1 : 0;
  for (int i = -images[0]; i <= images[0]; ++i)
    for (int j = -images[1]; j <= images[1]; ++j)
      for (int k = -images[2]; k <= images[2]; ++k) visit(Vec3(i * periods_[0], j * periods_[1], k * periods_[2]));
}

void SphereRelaxation::list_pairs() {
  pairs_.clear();
  listed_at_.clear();
  double mean = 0;
  for (const Sphere& s : free_) {
    listed_at_.push_back(s.centre);
    mean += s.radius / static_cast<double>(free_.size());
  }
  SphereCells moving, standing;
  moving.build(free_, 2 * mean + margin_);
  standing.build(fixed_, 2 * mean + margin_);
  const auto visit = [&](const SphereCells& cells, bool free, const Vec3& shift) {
    for (std::size_t k = 0; k < free_.size(); ++k) {
      const Sphere& s = free_[k];
      const Vec3 at = s.centre - shift, reach = Vec3::Constant(s.radius + cells.largest_radius() + margin_);
      cells.for_each_in_box(at - reach, at + reach, [&](std::size_t j, const Sphere& other) {
        const double near = s.radius + other.radius + margin_;
        if (free && (j < k || (j == k && shift.isZero()))) return true;
        if ((other.centre - at).squaredNorm() > near * near) return true;
        double touch = s.radius + other.radius;
        if (k >= stiff_from_ && (!free || j >= stiff_from_)) {  // what they have between them they keep
          if (!free && j >= soft_from_) return true;
          touch = std::min(touch, (first_[k].centre - shift - (free ? first_[j].centre : other.centre)).norm());
        }
        pairs_.push_back({k, j, free, shift, touch});
        return true;
      });
    }
  };
  for_each_image([&](const Vec3& shift) { visit(moving, true, shift); });
  visit(standing, false, Vec3::Zero());
}

/// As a share of the radii's sum, not positive where they do not touch; `away`: the push that parts them (m), on the free one.
double SphereRelaxation::overlap(const Pair& p, Vec3& away) const {
  const Sphere &a = free_[p.free], &b = p.other_is_free ? free_[p.other] : fixed_[p.other];
  const Vec3 from = a.centre - b.centre - p.shift;
  const double apart = from.norm();
  if (apart >= p.touch) return 0;
  away = apart > coincident * p.touch ? Vec3((p.touch / apart - 1) * from) : Vec3(p.touch * direction_of(p.free, p.other));
  return (p.touch - apart) / (a.radius + b.radius);
}

void SphereRelaxation::move(std::size_t k, const Vec3& by) {
  const double most = largest_step * free_[k].radius, length = by.norm();
  const Vec3 to = free_[k].centre + (length > most ? Vec3(most / length * by) : by);
  if (!allowed_ || allowed_(k, to)) free_[k].centre = to;
}

/// The lighter one gives way.
double SphereRelaxation::gives_way(std::size_t k) const {
  const double r = free_[k].radius;
  return (k < stiff_from_ ? 1.0 : share_of_stiff) / (r * r * r);
}

/// In steps that no wall fits between.
bool SphereRelaxation::way_is_allowed(std::size_t k, const Vec3& to) const {
  if (!allowed_) return true;
  const Vec3 way = to - free_[k].centre;
  const int steps = 1 + static_cast<int>(way.norm() / (0.5 * free_[k].radius));
  for (int n = 1; n <= steps; ++n)
    if (!allowed_(k, free_[k].centre + static_cast<double>(n) / steps * way)) return false;
  return true;
}

double SphereRelaxation::sweep(double soft_share) {
  double largest = 0, strayed = 0;
  Vec3 away;
  for (const Pair& p : pairs_) {
    const bool soft = !p.other_is_free && p.other >= soft_from_;
    if (soft && soft_share == 0) continue;
    const double share = overlap(p, away);
    if (share <= 0) continue;
    if (!soft) largest = std::max(largest, share);
    if (p.other_is_free) {
      const double a = gives_way(p.free), b = gives_way(p.other);
      move(p.free, a / (a + b) * away);
      if (p.other != p.free) move(p.other, -b / (a + b) * away);
    } else {
      move(p.free, soft ? Vec3(soft_share * away) : away);
    }
  }
  for (std::size_t k = 0; k < free_.size(); ++k) strayed = std::max(strayed, (free_[k].centre - listed_at_[k]).squaredNorm());
  if (strayed > 0.25 * margin_ * margin_) list_pairs();
  return largest;
}

double SphereRelaxation::relax(int sweeps, double enough) {
  if (free_.empty()) return 0;
  list_pairs();
  constexpr double soft_at_first = 0.5, soft_until = 0.6;  // shares of a push, and of the sweeps
  for (int n = 0; n < sweeps; ++n) {
    const double past = static_cast<double>(n) / (soft_until * sweeps);
    const double soft_share = fixed_.size() > soft_from_ && past < 1 ? soft_at_first * (1 - past) : 0;
    if (sweep(soft_share) <= enough && soft_share == 0) break;
  }
  return largest_overlap();
}

/// Of each free sphere with free and fixed ones.
std::vector<double> SphereRelaxation::worst_overlaps() const {
  std::vector<double> worst(free_.size(), 0);
  Vec3 away;
  for (const Pair& p : pairs_) {
    if (!p.other_is_free && p.other >= soft_from_) continue;
    worst[p.free] = std::max(worst[p.free], overlap(p, away));
  }
  return worst;
}

std::size_t SphereRelaxation::reseat(double most, double reach) {
  list_pairs();
  const std::vector<double> worst = worst_overlaps();
  const double cell = 2 * margin_ / margin_in_radii;
  SphereCells moving, standing, first;
  moving.build(free_, cell);
  standing.build({fixed_.begin(), fixed_.begin() + static_cast<std::ptrdiff_t>(soft_from_)}, cell);
  first.build({first_.begin(), first_.begin() + static_cast<std::ptrdiff_t>(stiff_from_)}, cell);
  const auto worst_at = [&](std::size_t k, const Vec3& place) {
    double largest = 0;
    const auto look = [&](const SphereCells& cells, const Vec3& at, double share, std::size_t self) {
      const Vec3 box = Vec3::Constant(free_[k].radius + cells.largest_radius());
      cells.for_each_in_box(at - box, at + box, [&](std::size_t j, const Sphere& s) {
        if (j != self) largest = std::max(largest, share * (1 - (s.centre - at).norm() / (s.radius + free_[k].radius)));
        return true;
      });
    };
    for_each_image([&](const Vec3& shift) { look(moving, place - shift, share_of_free, k); });
    look(standing, place, 1, free_.size() + fixed_.size());
    return largest;
  };
  std::size_t went = 0;
  for (std::size_t k = 0; k < stiff_from_; ++k) {
    if (worst[k] <= most) continue;
    const Vec3 from = free_[k].centre, around = Vec3::Constant(reach);
    std::vector<Vec3> begun;
    first.for_each_in_box(from - around, from + around, [&](std::size_t, const Sphere& s) {
      if ((s.centre - from).squaredNorm() < reach * reach) begun.push_back(s.centre);
      return true;
    });
    Vec3 best = from;
    double least = HUGE_VAL;
    for (const Vec3& place : begun)
      for (int n = 0; n < tries_at_a_place; ++n) {
        const Vec3 to = place + free_[k].radius * some_place(k, ++reseated_);
        if ((to - from).squaredNorm() < free_[k].radius * free_[k].radius) continue;  // there it comes back
        const double there = worst_at(k, to);
        if (there >= least || !way_is_allowed(k, to)) continue;
        least = there;
        best = to;
      }
    went += best != from;
    free_[k].centre = best;
  }
  return went;
}

double SphereRelaxation::largest_overlap() {
  list_pairs();
  double largest = 0;
  Vec3 away;
  for (const Pair& p : pairs_)
    if (p.other_is_free || p.other < soft_from_) largest = std::max(largest, overlap(p, away));
  return largest;
}

}  // namespace solidcull
