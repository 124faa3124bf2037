// Spheres that overlap are moved off each other (a packing relaxed by projecting overlaps away, as position-based dynamics does;
// theory.md#refill).
#pragma once

#include <array>
#include <functional>
#include <vector>

#include "sphere.h"

namespace solidcull {

/// Free spheres move, fixed ones stay; stiff ones give way to free ones, but hardly, and keep the overlaps that they have with
/// others that do not move freely. What is known of soft ones is a guess: they push less and less, and in the end not at all.
/// Free and stiff ones see each other through periodic sides. m, one frame. Deterministic. Local.
class SphereRelaxation {
 public:
  /// Whether a sphere may be at this place: else it stays where it was. Free ones are numbered first, then stiff ones.
  using Allowed = std::function<bool(std::size_t index, const Vec3& place)>;

  /// periods: edges of the periodic box, 0 where it is not periodic.
  struct Spheres {
    std::vector<Sphere> free, stiff, fixed, soft;
  };
  SphereRelaxation(Spheres spheres, const Vec3& periods);
  void keep_to(Allowed allowed) { allowed_ = std::move(allowed); }

  /// So many sweeps over all pairs, fewer once no overlap is larger than `enough` of the radii's sum. Returns the largest overlap
  /// that is not with a soft one, as a share of the radii's sum; what stiff ones had at first is not counted.
  double relax(int sweeps, double enough);
  /// Free spheres that overlap others, but soft ones, by more than `most` of the radii's sum are caught where there is no room:
  /// each goes where it overlaps least, of places beside those where free spheres closer than `reach` (m) began, on a way that is
  /// allowed all along. Returns how many went.
  std::size_t reseat(double most, double reach);
  /// The same, measured now.
  double largest_overlap();

  /// The free ones, then the stiff ones.
  const std::vector<Sphere>& spheres() const { return free_; }

 private:
  struct Pair {
    std::size_t free, other;  // other: in free_, or in fixed_ with soft ones behind
    bool other_is_free;
    Vec3 shift;    // of the other
    double touch;  // no nearer than this (m)
  };
  template <class Visit>
  void for_each_image(Visit visit) const;
  void list_pairs();
  double sweep(double soft_share);
  void move(std::size_t k, const Vec3& by);
  double gives_way(std::size_t k) const;
  bool way_is_allowed(std::size_t k, const Vec3& to) const;
  double overlap(const Pair& p, Vec3& away) const;
  std::vector<double> worst_overlaps() const;

  std::vector<Sphere> free_, fixed_;  // free_: stiff ones from stiff_from_ on; fixed_: soft ones from soft_from_ on
  const std::size_t stiff_from_, soft_from_;
  const std::vector<Sphere> first_;  // where the free ones began
  const Vec3 periods_;
  Allowed allowed_;
  double margin_ = 0;
  std::vector<Vec3> listed_at_;
  std::vector<Pair> pairs_;
  std::size_t reseated_ = 0;
};

}  // namespace solidcull
