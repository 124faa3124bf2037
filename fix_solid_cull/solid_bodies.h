// Solid bodies: connected groups of locked granules, each one rigid body with its granules' mass properties (DESIGN section 7).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <map>
#include <vector>

#include "flat_map.h"
#include "frozen_contacts.h"
#include "sphere.h"

namespace solidcull {

/// Sums over granules that add and subtract exactly as granules come and go. SI units, about the world's origin.
struct MassProperties {
  std::int64_t count = 0;
  double mass = 0;                                    ///< kg
  Vec3 first = Vec3::Zero();                          ///< sum of m x
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();   ///< sum of m x x^T
  double spin = 0;                                    ///< sum of 2/5 m r^2, each granule's own inertia

  void add(double m, const Vec3& x, double r, int sign = 1);
  void add(const MassProperties& other, int sign = 1);
  Vec3 centre() const { return first / mass; }        ///< m; undefined for no mass
  Eigen::Matrix3d inertia() const;                    ///< about the centre of mass, kg m^2
};

struct GranuleMass {
  double mass;
  Vec3 position;
  double radius;
};

/// Which locked granule belongs to which body. Bodies are numbered from 1; numbers are not used again. Local to the rank: a body
/// that spans ranks has a number on each, joined by unite_across (the adapter's, collective).
class SolidBodies {
 public:
  /// What split() must know of a granule, by tag.
  using MassOf = std::function<GranuleMass(std::int64_t)>;

  /// A granule is locked: it joins the bodies of its frozen contacts (which merge if they were several), or founds one.
  void lock(std::int64_t tag, const GranuleMass& granule, const FrozenContacts& contacts);

  /// A granule is unlocked. Call before its contacts are erased; afterwards call split() once for all that were unlocked together.
  void unlock(std::int64_t tag, const GranuleMass& granule, const FrozenContacts& contacts);

  /// Bodies that came apart through the unlock() calls since the last split() become several. Searches all cut edges at once and
  /// stops when one search is left, so its cost goes with the smaller parts. Returns the numbers of the new bodies.
  std::vector<int> split(const FrozenContacts& contacts, const MassOf& mass_of);

  /// Bodies that lost a part in the last split().
  const std::vector<int>& split_parents() const { return split_parents_; }

  int body_of(std::int64_t tag) const;                 ///< 0 if not locked on this rank
  const MassProperties& properties(int body) const { return bodies_.at(body); }
  const std::map<int, MassProperties>& bodies() const { return bodies_; }
  std::size_t size() const { return bodies_.size(); }
  std::size_t locked() const { return member_.size(); }
  template <class Visit>
  void for_each_member(Visit visit) const {
    member_.for_each([&](std::int64_t tag, int body) { visit(tag, root(body)); });
  }

  /// Pairs (kept, swallowed) of the merges since the last call, in their order: what happened to the interface meshes.
  std::vector<std::pair<int, int>> take_merges();

 private:
  int root(int body) const;
  int merge(int a, int b);

  FlatMap<int> member_;                    // tag -> body, to be resolved by root()
  mutable std::vector<int> parent_{0};     // union-find over body numbers; 0 is no body
  std::map<int, MassProperties> bodies_;   // living bodies only
  std::vector<std::int64_t> cut_;          // locked neighbours of unlocked granules
  std::vector<std::pair<int, int>> merges_;
  std::vector<int> split_parents_;
};

}  // namespace solidcull
