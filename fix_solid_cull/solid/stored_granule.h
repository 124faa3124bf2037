// What the core must know of a stored granule, and in which order stores, other ranks and files hold it.
#pragma once

#include <cstdint>
#include <optional>

#include "clump_mass.h"
#include "sphere.h"

namespace solidcull {

/// Whole numbers of 32 bits, and flags.
struct SmallNumbers {
  int type = 0;
  int layout = 0;          ///< which columns its record has; the adapter knows them
  int walls = 0;           ///< walls and triangles that it touched when it was put away
  int clump = 0;           ///< number of the clump that it is a sphere of; 0: none
  int spheres = 0;         ///< of that clump, all of them
  bool held = false;       ///< it touches a wall that stands still
  bool has_clump = false;  ///< it has the clump's mass

  template <class Visit>
  constexpr void each_small(Visit visit) {
    visit(type);
    visit(layout);
    visit(walls);
    visit(clump);
    visit(spheres);
    visit(held);
    visit(has_clump);
  }
  static constexpr int count() {
    int n = 0;
    SmallNumbers().each_small([&n](auto&) { ++n; });
    return n;
  }
};

/// SI units, in the frame of its body. A new number stands here and in one of the two lists: a small one in each_small(), for
/// which nothing else is to be done; any other in each_number(), and in the head of the store's rows.
struct StoredGranule : SmallNumbers {
  std::int64_t tag = 0;
  int body = 0;
  Vec3 position = Vec3::Zero();
  double radius = 0, mass = 0;
  std::int64_t lock_step = 0;       ///< time step at which it was locked
  double normal_load = 0;           ///< sum of its normal contact forces at locking (N)
  Vec3 load_change = Vec3::Zero();  ///< F_ext - F_ext(at locking) that it carried when it went in (N): kept for invariant I5
  ClumpMass of_clump{Vec3::Zero(), Eigen::Quaterniond::Identity(), Vec3::Zero()};  ///< if it has the clump's mass

  /// The place by which a rank has it: of a clump all are where the sphere is that has its mass. Where that is not this one, the
  /// store does not keep it: it is told in `of_clump` on the way.
  const Vec3& home() const { return clump && !has_clump ? of_clump.centre : position; }
  std::optional<ClumpMass> clump_mass() const { return has_clump ? std::optional<ClumpMass>(of_clump) : std::nullopt; }

  /// Numbers of `of_clump`.
  template <class Visit>
  void each_of_clump(Visit visit) {
    for (int d = 0; d < 3; ++d) visit(of_clump.centre[d]);
    for (int k = 0; k < 4; ++k) visit(of_clump.turn.coeffs()[k]);
    for (int d = 0; d < 3; ++d) visit(of_clump.inertia[d]);
  }
  static constexpr int clump_numbers = 10;
  /// Calls visit(number) for all but tag and body, whose meaning is another on another rank.
  template <class Visit>
  void each_number(Visit visit) {
    for (int d = 0; d < 3; ++d) visit(position[d]);
    visit(radius);
    visit(mass);
    visit(lock_step);
    visit(normal_load);
    for (int d = 0; d < 3; ++d) visit(load_change[d]);
    each_of_clump(visit);
    each_small(visit);
  }
};

}  // namespace solidcull
