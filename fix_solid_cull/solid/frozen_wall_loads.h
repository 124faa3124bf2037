// What stored granules press on walls that stand still: frozen when they were put away, so that each mesh element goes on
// feeling it (theory.md#wall-loads).
#pragma once

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "flat_map.h"
#include "sphere.h"

namespace solidcull {

/// The force of one wall element on one granule. SI units, world frame.
struct WallLoad {
  static constexpr int no_mesh = -1;
  int mesh = 0, element = 0;   ///< the adapter's numbers, on all ranks the same; no_mesh: of a wall that reports no load
  Vec3 force = Vec3::Zero();   ///< on the granule (N)
  Vec3 torque = Vec3::Zero();  ///< of that force about the mesh's point of reference (N m)
};

/// Sums per body and element, kept as granules come and go. Local to the rank.
class FrozenWallLoads {
 public:
  struct Element {
    int granules = 0;
    Vec3 force = Vec3::Zero(), torque = Vec3::Zero();  ///< on the granules, summed
    double share = 0;  ///< of what presses on the body from elsewhere: the part that this element bears, see share_out()
  };
  using Place = std::pair<int, int>;  // mesh, element
  using Elements = std::map<Place, Element>;

  /// The granule of this body is put away with these loads (none: nothing happens).
  void add(std::int64_t tag, int body, const std::vector<WallLoad>& loads);
  /// It comes back: its loads are the engine's again.
  void erase(std::int64_t tag, int body);
  /// It belongs to another body now.
  void move(std::int64_t tag, int from, int to);
  /// All granules of a body that was swallowed.
  void merge(int swallowed, int kept);
  void clear();

  bool empty() const { return bodies_.empty(); }
  bool holds(int body) const { return bodies_.count(body) != 0; }
  const Vec3& force(int body) const;  ///< of all walls on the stored granules of this body (N). Each step asks for it

  /// Weights by which the walls bear a load on the body (N) in addition to what is frozen: each as much as it bears along that
  /// line already. What pushes against the load pushes more, what pushes along with it less. Returns their sum on this rank;
  /// share_out() then divides by the sum over all ranks.
  double weigh(int body, const Vec3& load);
  void share_out(int body, double sum);

  template <class Visit>
  void for_each(Visit visit) const {  // visit(body, mesh, element, sums)
    for (const auto& body : bodies_)
      for (const auto& e : body.second.elements) visit(body.first, e.first.first, e.first.second, e.second);
  }
  struct Bearing {
    Place place;
    double share;
    Vec3 at;  ///< where the element bears what is frozen, from the mesh's point of reference (m)
  };
  /// Elements of meshes with a share of what presses on a body from elsewhere: each step asks for them. Valid until something
  /// changes.
  const std::vector<Bearing>& bearing(int body) const;
  /// Summed over all bodies; without shares.
  const Elements& of_all() const { return all_; }
  struct OnMesh {
    Place place;
    Vec3 force, torque;  ///< on the granules, summed over all bodies
  };
  /// The same of meshes alone, in one row: each step asks for it. Valid until something changes.
  const std::vector<OnMesh>& on_meshes() const;
  /// Calls visit(load) with each of a granule that was put away.
  template <class Visit>
  void for_each_of(std::int64_t tag, Visit visit) const {
    const int* head = heads_.find(tag);
    for (int e = head ? *head : none; e != none; e = entries_[static_cast<std::size_t>(e)].next)
      visit(entries_[static_cast<std::size_t>(e)].load);
  }
  std::size_t memory_bytes() const;

 private:
  struct Entry {
    WallLoad load;
    int next;
  };
  static constexpr int none = -1;
  void book(int body, const WallLoad& load, int sign);
  static void book(Elements& elements, const WallLoad& load, int sign);

  struct Sums {
    Elements elements;
    // of these elements, made anew when a step asks for them
    mutable Vec3 force = Vec3::Zero();
    mutable std::vector<Bearing> bearing;
    mutable bool force_known = false, bearing_known = false;

    void changed() { force_known = bearing_known = false; }
  };
  std::map<int, Sums> bodies_;
  Elements all_;  // what a step asks for must not go with the number of bodies
  mutable std::vector<OnMesh> on_meshes_;
  mutable bool on_meshes_known_ = false;
  FlatMap<int> heads_;  // tag -> first entry
  std::vector<Entry> entries_;
  int free_ = none;
};

}  // namespace solidcull
