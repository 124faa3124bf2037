// Spheres that overlap are moved off each other (a packing relaxed by projecting overlaps away, as position-based dynamics does).
#pragma once

#include <array>
#include <functional>
#include <vector>

#include "sphere.h"

namespace solidcull {

/// Free spheres move, fixed ones stay; what is known of soft ones is a guess: they push less and less, and in the end not at all.
/// Pairs of free spheres see each other through periodic sides. m, one frame. Deterministic. Local.
class SphereRelaxation {
 public:
  /// Whether a free sphere may be at this place: else it stays where it was.
  using Allowed = std::function<bool(std::size_t index, const Vec3& place)>;

  /// periods: edges of the periodic box, 0 where it is not periodic.
  SphereRelaxation(std::vector<Sphere> free, std::vector<Sphere> fixed, std::vector<Sphere> soft, const Vec3& periods);
  void keep_to(Allowed allowed) { allowed_ = std::move(allowed); }

  /// So many sweeps over all pairs, fewer once no overlap is larger than `enough` of the radii's sum. Returns the largest overlap
  /// with free and fixed spheres, as a share of the radii's sum.
  double relax(int sweeps, double enough);
  /// The same, measured now.
  double largest_overlap();

  const std::vector<Sphere>& spheres() const { return free_; }

 private:
  struct Pair {
    std::size_t free, other;  // other: in free_, or in fixed_ with soft ones behind
    bool other_is_free;
    Vec3 shift;  // of the other
  };
  void list_pairs();
  double sweep(double soft_share);
  void move(std::size_t k, const Vec3& by);
  double overlap(const Pair& p, Vec3& away) const;

  std::vector<Sphere> free_, fixed_;
  const std::size_t soft_from_;  // in fixed_
  const Vec3 periods_;
  Allowed allowed_;
  double margin_ = 0;
  std::vector<Vec3> listed_at_;
  std::vector<Pair> pairs_;
};

}  // namespace solidcull
