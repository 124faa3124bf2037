// Spheres sorted into cells, built at once from a list: who is near this place? Local to the rank.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "sphere.h"

namespace solidcull {

class SphereCells {
 public:
  /// cell: least edge of a cell (m). The grid is coarsened so that it has at most four cells per sphere.
  void build(std::vector<Sphere> spheres, double cell) {
    spheres_ = std::move(spheres);
    largest_ = 0;
    if (spheres_.empty()) return;
    lo_ = hi_ = spheres_.front().centre;
    for (const Sphere& s : spheres_) {
      lo_ = lo_.cwiseMin(s.centre);
      hi_ = hi_.cwiseMax(s.centre);
      largest_ = std::max(largest_, s.radius);
    }
    Vec3 extent = hi_ - lo_;
    if (!extent.allFinite()) extent = Vec3::Zero();  // one cell
    do {
      inverse_ = 1.0 / cell;
      for (int d = 0; d < 3; ++d) n_[d] = static_cast<int>(std::min(1e6, extent[d] * inverse_)) + 1;
      cell *= 1.5;
    } while (static_cast<double>(n_[0]) * n_[1] * n_[2] > 4.0 * static_cast<double>(spheres_.size()) + 64);
    start_.assign(static_cast<std::size_t>(n_[0]) * n_[1] * n_[2] + 1, 0);
    std::vector<std::size_t> cell_of(spheres_.size());
    for (std::size_t s = 0; s < spheres_.size(); ++s) ++start_[(cell_of[s] = index(spheres_[s].centre)) + 1];
    for (std::size_t c = 1; c < start_.size(); ++c) start_[c] += start_[c - 1];
    order_.resize(spheres_.size());
    std::vector<std::size_t> at(start_.begin(), start_.end() - 1);
    for (std::size_t s = 0; s < spheres_.size(); ++s) order_[at[cell_of[s]]++] = s;
  }

  /// Calls visit(index, sphere) for each sphere whose centre's cell overlaps the box; stops when visit returns false.
  template <class Visit>
  bool for_each_in_box(const Vec3& lo, const Vec3& hi, Visit visit) const {
    if (spheres_.empty() || (hi.array() < lo_.array()).any() || (lo.array() > hi_.array()).any()) return true;
    const auto a = clamped(lo), b = clamped(hi);
    for (int i = a[0]; i <= b[0]; ++i)
      for (int j = a[1]; j <= b[1]; ++j) {
        const std::size_t row = (static_cast<std::size_t>(i) * n_[1] + j) * n_[2];
        for (std::size_t at = start_[row + a[2]]; at < start_[row + b[2] + 1]; ++at)
          if (!visit(order_[at], spheres_[order_[at]])) return false;
      }
    return true;
  }

  /// Whether any sphere's surface is closer than gap to the surface of s.
  bool any_near(const Sphere& s, double gap) const {
    return any_near(s, gap, [](std::size_t) { return true; });
  }
  /// The same among those for which counts(index) holds.
  template <class Counts>
  bool any_near(const Sphere& s, double gap, Counts counts) const {
    const Vec3 reach = Vec3::Constant(s.radius + gap + largest_);
    return !for_each_in_box(s.centre - reach, s.centre + reach, [&](std::size_t index, const Sphere& other) {
      const double touch = s.radius + other.radius + gap;
      return touch <= 0 || !((other.centre - s.centre).squaredNorm() < touch * touch) || !counts(index);
    });
  }

  double largest_radius() const { return largest_; }
  std::size_t size() const { return spheres_.size(); }

 private:
  std::array<int, 3> clamped(const Vec3& p) const {
    std::array<int, 3> c;
    for (int d = 0; d < 3; ++d) {
      const double x = std::floor((p[d] - lo_[d]) * inverse_);
      c[d] = !(x > 0) ? 0 : x >= n_[d] ? n_[d] - 1 : static_cast<int>(x);  // what is no number is somewhere, too
    }
    return c;
  }
  std::size_t index(const Vec3& p) const {
    const auto c = clamped(p);
    return (static_cast<std::size_t>(c[0]) * n_[1] + c[1]) * n_[2] + c[2];
  }

  std::vector<Sphere> spheres_;
  std::vector<std::size_t> start_, order_;
  Vec3 lo_ = Vec3::Zero(), hi_ = Vec3::Zero();
  std::array<int, 3> n_{1, 1, 1};
  double inverse_ = 1, largest_ = 0;
};

}  // namespace solidcull
