// The granule store: interior granules, deleted from the engine, kept to the last bit (DESIGN section 9).
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <vector>

#include "flat_map.h"
#include "sphere.h"

namespace solidcull {

/// What the core must know of an interior granule. SI units, in the frame of its body.
struct StoredGranule {
  Vec3 position = Vec3::Zero();
  double radius = 0, mass = 0;
  std::int64_t tag = 0;
  int type = 0;
  int body = 0;
  int layout = 0;                   ///< which columns its record has; the adapter knows them
  std::int64_t lock_step = 0;       ///< time step at which it was locked
  double normal_load = 0;           ///< sum of its normal contact forces at locking (N)
  Vec3 load_change = Vec3::Zero();  ///< F_ext - F_ext(at locking) that it carried when it went in (N): kept for invariant I5
};

/// Granules with their engine records (opaque doubles), found by tag in O(1) and by body and place in O(neighbours): each body
/// has search cells in its own frame, so that a body that moves costs nothing here. Local to the rank.
class GranuleStore {
 public:
  /// cell: edge of the search cells in m; best near the largest contact distance. Throws std::invalid_argument if not > 0.
  explicit GranuleStore(double cell);

  /// Takes a granule in; a tag that is in the store already is a std::logic_error.
  void add(const StoredGranule& granule, const double* record, int length);
  /// Takes it out; `record` receives its doubles. A tag that is not there is a std::logic_error.
  StoredGranule take(std::int64_t tag, std::vector<double>& record);

  /// The granule belongs to another body now, at this place in that body's frame.
  void move(std::int64_t tag, int body, const Vec3& position);
  /// All granules of a body that was swallowed go to `kept`; place(granule) puts each where it is in its frame.
  template <class Place>
  void merge(int swallowed, int kept, Place place) {
    const auto grid = grids_.find(swallowed);
    if (grid == grids_.end()) return;
    std::vector<std::int64_t> tags;
    tags.reserve(grid->second.granules);
    grid->second.cells.for_each([&](std::int64_t, const Cell& cell) {
      for (int s = cell.head; s != none; s = slots_[s].next) tags.push_back(slots_[s].granule.tag);
    });
    for (const std::int64_t tag : tags) {
      const int s = *slot_of_.find(tag);
      unlink(s);
      place(slots_[s].granule);
      slots_[s].granule.body = kept;
      link(s);
    }
  }

  const StoredGranule* find(std::int64_t tag) const;
  /// The record of a stored granule; valid until the next add or take. `length` receives the number of doubles.
  const double* record(std::int64_t tag, int& length) const;

  std::size_t size() const { return slot_of_.size(); }
  double mass() const;                                       ///< sum over all, compensated (kg)
  double largest_radius() const { return largest_radius_; }  ///< of all that ever went in (m)

  /// Calls visit(granule) for each of this body whose surface is closer than `gap` to the surface of the sphere, given in the
  /// body's frame (gap may be negative).
  template <class Visit>
  void for_each_near(int body, const Sphere& s, double gap, Visit visit) const {
    const auto grid = grids_.find(body);
    if (grid == grids_.end() || surely_far(grid->second, s, gap)) return;
    const double reach = s.radius + gap + largest_radius_;
    for_each_in_box(body, s.centre - Vec3::Constant(reach), s.centre + Vec3::Constant(reach), [&](const StoredGranule& g) {
      const double touch = s.radius + g.radius + gap;
      if (touch > 0 && (g.position - s.centre).squaredNorm() < touch * touch) visit(g);
    });
  }
  /// Calls visit(granule) for each of this body whose centre is in the cells that overlap the box, given in the body's frame (a
  /// superset of those in the box).
  template <class Visit>
  void for_each_in_box(int body, const Vec3& lo, const Vec3& hi, Visit visit) const {
    const auto grid = grids_.find(body);
    if (grid == grids_.end()) return;
    const auto a = cell_of(lo.cwiseMax(grid->second.lo)), b = cell_of(hi.cwiseMin(grid->second.hi));
    for (std::int64_t i = a[0]; i <= b[0]; ++i)
      for (std::int64_t j = a[1]; j <= b[1]; ++j)
        for (std::int64_t k = a[2]; k <= b[2]; ++k)
          if (const Cell* cell = grid->second.cells.find(key(i, j, k)))
            for (int s = cell->head; s != none; s = slots_[s].next) visit(slots_[s].granule);
  }
  /// Calls visit(body, lo, hi) for each body that has granules here, with a box around their centres in its frame.
  template <class Visit>
  void for_each_body(Visit visit) const {
    for (const auto& grid : grids_) visit(grid.first, grid.second.lo, grid.second.hi);
  }
  template <class Visit>
  void for_each(Visit visit) const {
    slot_of_.for_each([&](std::int64_t, int s) { visit(slots_[s].granule); });
  }

  std::size_t memory_bytes() const;
  /// Heap and table bytes divided by granules, records included.
  double bytes_per_granule() const { return size() ? static_cast<double>(memory_bytes()) / static_cast<double>(size()) : 0.0; }

 private:
  static constexpr int none = -1;
  struct Slot {
    StoredGranule granule;
    std::size_t offset = 0;  // of the record in its pool
    int length = 0;
    int next = none;  // next granule in the cell, or next free slot
  };
  struct Cell {
    int head = none;
    int count_here = 0;
    int count_around = 0;  // granules in the 27 cells around: what lets most queries end after one look
  };
  struct Grid {
    FlatMap<Cell> cells;
    std::size_t granules = 0;
    Vec3 lo = Vec3::Constant(HUGE_VAL), hi = Vec3::Constant(-HUGE_VAL);  // of all that were here since it was last empty
  };
  /// Records of one length, packed; freed places are used again.
  struct Pool {
    std::vector<double> data;
    std::vector<std::size_t> free;
  };

  std::array<std::int64_t, 3> cell_of(const Vec3& p) const {
    return {static_cast<std::int64_t>(std::floor(p[0] * inverse_cell_)),
            static_cast<std::int64_t>(std::floor(p[1] * inverse_cell_)),
            static_cast<std::int64_t>(std::floor(p[2] * inverse_cell_))};
  }
  static std::int64_t key(std::int64_t i, std::int64_t j, std::int64_t k) {
    constexpr std::int64_t half = 1 << 20, range = 1 << 21;
    return ((i + half) * range + (j + half)) * range + (k + half);
  }
  bool surely_far(const Grid& grid, const Sphere& s, double gap) const {
    const double reach = s.radius + gap + largest_radius_;
    if (((s.centre - grid.hi).array() > reach).any() || ((grid.lo - s.centre).array() > reach).any()) return true;
    if (s.radius + gap + largest_radius_ > 1.0 / inverse_cell_) return false;
    const auto c = cell_of(s.centre);
    const Cell* cell = grid.cells.find(key(c[0], c[1], c[2]));
    return !cell || cell->count_around == 0;
  }
  void count_around(Grid& grid, const std::array<std::int64_t, 3>& c, int change);
  void link(int slot);
  void unlink(int slot);

  double inverse_cell_;
  double largest_radius_ = 0;
  std::vector<Slot> slots_;
  int first_free_ = none;
  std::vector<Pool> pools_;    // by record length
  FlatMap<int> slot_of_;       // tag -> slot
  std::map<int, Grid> grids_;  // by body
};

}  // namespace solidcull
