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

/// Some direction, the same for the same numbers.
Vec3 direction_of(std::size_t a, std::size_t b) {
  const std::uint64_t hash = scrambled(static_cast<std::uint64_t>(a) << 32 ^ static_cast<std::uint64_t>(b));
  const auto share = [&](int bit) { return static_cast<double>(hash >> bit & 0xfffff) / 0xfffff - 0.5; };
  return Vec3(share(0), share(20), share(40) + 1e-3).normalized();
}

std::vector<Sphere> joined(std::vector<Sphere> a, const std::vector<Sphere>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

}  // namespace

SphereRelaxation::SphereRelaxation(std::vector<Sphere> free, std::vector<Sphere> fixed, std::vector<Sphere> soft,
                                   const Vec3& periods)
    : free_(std::move(free)), fixed_(joined(fixed, soft)), soft_from_(fixed.size()), periods_(periods) {
  double mean = 0;
  for (const Sphere& s : free_) mean += s.radius;
  margin_ = free_.empty() ? 0 : margin_in_radii * mean / static_cast<double>(free_.size());
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
  std::array<int, 3> images{};
  for (int d = 0; d < 3; ++d) images[d] = periods_[d] > 0 ? 1 : 0;
  const auto visit = [&](const SphereCells& cells, bool free, const Vec3& shift) {
    for (std::size_t k = 0; k < free_.size(); ++k) {
      const Sphere& s = free_[k];
      const Vec3 at = s.centre - shift, reach = Vec3::Constant(s.radius + cells.largest_radius() + margin_);
      cells.for_each_in_box(at - reach, at + reach, [&](std::size_t j, const Sphere& other) {
        const double near = s.radius + other.radius + margin_;
        if (free && (j < k || (j == k && shift.isZero()))) return true;
        if ((other.centre - at).squaredNorm() < near * near) pairs_.push_back({k, j, free, shift});
        return true;
      });
    }
  };
  for (int i = -images[0]; i <= images[0]; ++i)
    for (int j = -images[1]; j <= images[1]; ++j)
      for (int k = -images[2]; k <= images[2]; ++k) visit(moving, true, Vec3(i * periods_[0], j * periods_[1], k * periods_[2]));
  visit(standing, false, Vec3::Zero());
}

/// As a share of the radii's sum, not positive where they do not touch; `away`: the push that parts them (m), on the free one.
double SphereRelaxation::overlap(const Pair& p, Vec3& away) const {
  const Sphere &a = free_[p.free], &b = p.other_is_free ? free_[p.other] : fixed_[p.other];
  const Vec3 from = a.centre - b.centre - p.shift;
  const double sum = a.radius + b.radius, apart = from.norm();
  if (apart >= sum) return 0;
  away = apart > coincident * sum ? Vec3((sum / apart - 1) * from) : Vec3(sum * direction_of(p.free, p.other));
  return 1 - apart / sum;
}

void SphereRelaxation::move(std::size_t k, const Vec3& by) {
  const double most = largest_step * free_[k].radius, length = by.norm();
  const Vec3 to = free_[k].centre + (length > most ? Vec3(most / length * by) : by);
  if (!allowed_ || allowed_(k, to)) free_[k].centre = to;
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
      // the lighter one gives way
      const double a = std::pow(free_[p.free].radius, 3), b = std::pow(free_[p.other].radius, 3);
      move(p.free, b / (a + b) * away);
      if (p.other != p.free) move(p.other, -a / (a + b) * away);
    } else {
      move(p.free, soft ? Vec3(soft_share * away) : away);
    }
  }
  for (std::size_t k = 0; k < free_.size(); ++k)
    strayed = std::max(strayed, (free_[k].centre - listed_at_[k]).squaredNorm());
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

double SphereRelaxation::largest_overlap() {
  list_pairs();
  double largest = 0;
  Vec3 away;
  for (const Pair& p : pairs_)
    if (p.other_is_free || p.other < soft_from_) largest = std::max(largest, overlap(p, away));
  return largest;
}

}  // namespace solidcull
