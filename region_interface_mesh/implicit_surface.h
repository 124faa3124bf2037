// Depth below the bed's outer surface: the distance to the union of implicit spheres, closed over the pores
// (theory.md#implicit-surface-and-depth; paper, section on finding interior granules).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "sphere.h"

namespace solidcull {

/// A voxel of the surface's grid; `none` where a query found no void.
struct Voxel {
  std::int32_t i, j, k;
  static constexpr std::int32_t none_mark = INT32_MIN;
  bool none() const { return i == none_mark; }
  static Voxel nothing() { return {none_mark, none_mark, none_mark}; }
};

/// Void is every point that lies at least `closing` outside every granule (so pores are no void); the depth of a point is its
/// distance to the nearest void, less `closing`. Sparse (a hash of blocks, each a mask of 8x8x8 voxels), lazy: a block is
/// evaluated when first asked for, and again after touch() named a change near it. Voxel (i, j, k) has its centre at
/// voxel * (i, j, k). Lengths in m, world frame; local to the rank.
class ImplicitSurface {
 public:
  /// Calls `visit` with every sphere (granule, halo granule, wall plug) that may overlap the box lo..hi. The visitor tests
  /// overlap itself, so giving more is allowed, giving less is not.
  using Gather = std::function<void(const Vec3& lo, const Vec3& hi, const std::function<void(const Sphere&)>& visit)>;

  /// voxel > 0, closing >= 0, in m; throws std::invalid_argument otherwise.
  ImplicitSurface(double voxel, double closing, Gather gather);
  ~ImplicitSurface();

  /// A sphere came, went, or is at this place now: the blocks that it can reach are evaluated anew when next asked for.
  void touch(const Sphere& s);
  void touch_all();

  /// The nearest void voxel whose centre lies within `depth + closing` of p, or Voxel::nothing() if p is deeper than `depth`.
  /// Exact; of equally near ones the smallest (i, j, k), so the answer does not depend on what was asked before.
  /// `hint`: a voxel found earlier for this point; if it is still void and in reach, it is returned after one look.
  Voxel void_within(const Vec3& p, double depth, const Voxel& hint = Voxel::nothing());

  bool is_void(const Voxel& v);       ///< evaluates the block if needed
  Vec3 centre(const Voxel& v) const;  ///< m, world frame

  /// Depth of p, or `max_depth` if it is deeper; negative outside the closed granules, down to -closing. Never less than the true
  /// depth; more by a voxel's diagonal at most where the void is wider than that, and by a quarter of a voxel on average.
  double depth(const Vec3& p, double max_depth);

  std::size_t blocks_evaluated() const;  ///< since construction: the work counter that benchmarks report
  std::size_t blocks_held() const;
  /// Whether a block within `reach` of p was touched since the last clear_touched(): whether its depth may have changed.
  bool touched_near(const Vec3& p, double reach) const;
  void clear_touched();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace solidcull
