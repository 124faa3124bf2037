// The granule store: interior granules, deleted from the engine, their records kept to the last bit (theory.md#granule-store).
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <map>
#include <optional>
#include <vector>

#include "chunked_array.h"
#include "exact_sum.h"
#include "few_bits.h"
#include "flat_map.h"
#include "packed_rows.h"
#include "sites.h"
#include "sphere.h"
#include "stored_granule.h"

namespace solidcull {

/// What questions of place see of a stored granule; get() has the rest.
struct Resident {
  Vec3 position;  ///< frame of its body (m)
  double radius;  ///< m
  std::int64_t tag;
  int body;
  int slot = -1;  ///< where the store has it, for as long as nothing goes in or out; below 0: not known
};

/// Granules with their engine records (opaque doubles), found by tag in O(1) and by place in O(neighbours). Each body has a grid
/// of search cells in its own frame, so that a body that moves costs nothing here; bodies that stand still in the world share
/// one grid, frame 0, so that many small ones cost no more than a large one. Some 85 bytes per granule of a few kinds, 45 to
/// 55 rounded. Local to the rank.
class GranuleStore {
 public:
  static constexpr int shared_frame = 0;  ///< that of all bodies that share(); any other frame has the number of its body

  /// All comes back to the bit; or normal_load and load_change are rounded to 0.2 %, and places to 2^-27 of the search cells'
  /// edge, as by rounded(). A place more than 32,768 cells from the origin of its frame is a std::range_error then. Or no place
  /// is kept but the number of the nearest site, and of the loads normal_load alone.
  enum class Precision { exact, rounded, sites };
  static constexpr double farthest = 32768;  ///< cells
  StoredGranule rounded(StoredGranule granule) const;

  /// cell: edge of the search cells in m; best near the largest contact distance. Throws std::invalid_argument if not > 0.
  explicit GranuleStore(double cell, Precision precision = Precision::exact);
  /// One that keeps sites; they outlive it.
  GranuleStore(double cell, const Sites& sites);

  /// The nearest site to a place in this body's frame that no granule here has, those around it that suits(place) rejects left
  /// out; nothing if there is none within `reach` diameters of the lattice. Only of a store that keeps sites.
  template <class Suits>
  std::optional<Vec3> free_site(int body, const Vec3& place, double radius, double reach, Suits suits) const {
    for (const Vec3& site : sites_->around(place, radius, reach))
      if (!is_taken(frame_of(body), site) && suits(site)) return site;
    return std::nullopt;
  }

  /// Takes a granule in. A tag that is in the store already, or that is no 32-bit number, is a std::logic_error. The words of
  /// the record at the indices `transient` are kept until forget_transient() and are 0.0 afterwards. tail: see tail().
  void add(const StoredGranule& granule, const double* record, int length, const std::vector<int>& transient = {},
           WordView tail = {});
  /// Takes it out; `record` receives its doubles. A tag that is not there is a std::logic_error.
  StoredGranule take(std::int64_t tag, std::vector<double>& record);

  bool contains(std::int64_t tag) const { return slot_of(tag) != none; }
  std::optional<Resident> find(std::int64_t tag) const;
  int body_of(std::int64_t tag) const {  ///< 0 if it is not there
    const int s = slot_of(tag);
    return s == none ? 0 : body_at(s);
  }
  StoredGranule get(std::int64_t tag) const;                      ///< std::logic_error if it is not there
  void record(std::int64_t tag, std::vector<double>& out) const;  ///< likewise
  /// Another record for a granule that stays as it is; the words at the indices `transient` become 0.0, unless they are known
  /// still. Likewise.
  void set_record(std::int64_t tag, int layout, std::vector<double> record, const std::vector<int>& transient);
  /// Some words more, none at first; they go with it and are lost when it is taken out. They stay where they are until they are
  /// set anew. Likewise.
  WordView tail(const Resident& g) const { return rows_.tail(row_at(slot_of(g))); }
  void set_tail(const Resident& g, WordView tail) {
    const int s = slot_of(g);
    set_row(s, rows_.with_tail(row_at(s), tail));
  }
  bool transient_known(std::int64_t tag) const;          ///< it has transient words that are not forgotten yet
  void forget_transient() { transient_ = Transient(); }  ///< costs what was added since the last call

  /// The granule belongs to another body now, at this place in that body's frame.
  void move(std::int64_t tag, int body, const Vec3& position);
  /// The clump whose mass this granule has, if it has one, is by so much elsewhere in the frame of its body.
  void shift_clump(std::int64_t tag, const Vec3& by);
  /// All granules of a body that was swallowed go to `kept`, into its frame; place(StoredGranule&) puts each where it is there,
  /// and may change what else is a matter of the frame. What share() said of the swallowed body is forgotten.
  template <class Place>
  void merge(int swallowed, int kept, Place place) {
    if (swallowed == kept) return;
    for (const int s : slots_of(swallowed)) {
      const StoredGranule before = granule(s);
      StoredGranule g = before;
      place(g);
      change(s, before, g);
      relocate(s, kept, g.position);
    }
    bodies_.erase(swallowed);
  }

  /// From here on the body's granules, present ones too, are in the shared grid or in the body's own; their places stay as they
  /// are. Holds for a body that has no granules, before the first and after the last, until forget() or merge(). Costs what is
  /// in the body's box.
  void share(int body, bool on);
  /// What share() said of the body is forgotten: now, or once it has no granules.
  void forget(int body);
  int frame_of(int body) const;
  /// Whether it has granules here.
  bool holds(int body) const {
    const auto found = bodies_.find(body);
    return found != bodies_.end() && found->second.granules > 0;
  }

  std::size_t size() const { return size_; }
  double mass() const { return mass_.value(); }              ///< kg; a running sum, compensated
  double mass_recounted() const;                             ///< the same from the granules, O(all): for checks
  double largest_radius() const { return largest_radius_; }  ///< of all that ever went in (m)

  /// Calls visit(const Resident&) for each in this frame whose surface is closer than `gap` to the surface of the sphere, given
  /// in that frame (gap may be negative).
  template <class Visit>
  void for_each_near(int frame, const Sphere& s, double gap, Visit visit) const {
    const auto grid = grids_.find(frame);
    if (grid == grids_.end() || surely_far(grid->second, s, gap)) return;
    const Vec3 reach = Vec3::Constant(s.radius + gap + largest_radius_);
    for_each_slot_in_box(grid->second, s.centre - reach, s.centre + reach, [&](int slot) {
      const double apart = (position(slot) - s.centre).squaredNorm();
      if (apart >= reach[0] * reach[0]) return;  // most, and their radii need not be read
      const Resident g = resident(slot);
      const double touch = s.radius + g.radius + gap;
      if (touch > 0 && apart < touch * touch) visit(g);
    });
  }
  /// Calls visit(const Resident&) for each in this frame whose centre is in the cells that overlap the box, given in that frame
  /// (a superset of those in the box).
  template <class Visit>
  void for_each_in_box(int frame, const Vec3& lo, const Vec3& hi, Visit visit) const {
    const auto grid = grids_.find(frame);
    if (grid != grids_.end()) for_each_slot_in_box(grid->second, lo, hi, [&](int slot) { visit(resident(slot)); });
  }
  /// Calls visit(const StoredGranule&, record, whether its transient words are known) for all, in no order.
  template <class Visit>
  void for_each_record(Visit visit) const {
    std::vector<double> record;
    for (int s = 0; s < static_cast<int>(slots_.size()); ++s) {
      if (tag_at(s) == free_mark) continue;
      read_record(s, record);
      visit(granule(s), record, transient_.of_tag.contains(tag_at(s)));
    }
  }
  /// Calls visit(const StoredGranule&, record, its length) for as many as `most` from slot `from` on; the record's transient
  /// words are 0. Returns the slot to go on from, slots() at the end.
  template <class Visit>
  int visit_some(int from, int most, Visit visit) const {
    const int all = slots();
    for (; from < all && most > 0; ++from) {
      if (tag_at(from) == free_mark) continue;
      const std::vector<std::uint64_t> row = row_of(from);
      const StoredGranule g = granule(from);
      visit(g, row.data() + record_begin, static_cast<int>(row.size() - record_begin - words_of_clump(g)));
      --most;
    }
    return from;
  }
  int slots() const { return static_cast<int>(slots_.size()); }
  /// Of two that are there: visit_some() comes to the first of them before the second.
  bool comes_before(std::int64_t tag, std::int64_t other) const { return slot_of(tag) < slot_of(other); }
  /// Calls visit(const Resident&) for each granule of this body; costs what is in its box.
  template <class Visit>
  void for_each_of_body(int body, Visit visit) const {
    for_each_slot_of(body, [&](int slot) { visit(resident(slot)); });
  }
  /// Calls visit(frame, lo, hi) for each frame that has granules, with a box around their centres.
  template <class Visit>
  void for_each_frame(Visit visit) const {
    for (const auto& grid : grids_) visit(grid.first, grid.second.box.lo, grid.second.box.hi);
  }
  bool occupies(int frame) const { return grids_.count(frame) != 0; }  ///< it has granules
  /// Corners of the box around the centres in this frame, which has granules.
  const Vec3& lowest(int frame) const { return grids_.at(frame).box.lo; }
  const Vec3& highest(int frame) const { return grids_.at(frame).box.hi; }
  /// Calls visit(body, lo, hi) for each body that has granules here, with a box around their centres in its frame; larger than
  /// need be where granules have left.
  template <class Visit>
  void for_each_body(Visit visit) const {
    for (const auto& body : bodies_)
      if (body.second.granules) visit(body.first, body.second.box.lo, body.second.box.hi);
  }
  /// Calls visit(const Resident&) for all.
  template <class Visit>
  void for_each(Visit visit) const {
    for (int s = 0; s < static_cast<int>(slots_.size()); ++s)
      if (tag_at(s) != free_mark) visit(resident(s));
  }

  std::size_t memory_bytes() const;
  /// All memory, unused room included, divided by granules.
  double bytes_per_granule() const { return size() ? static_cast<double>(memory_bytes()) / static_cast<double>(size()) : 0.0; }

 private:
  static constexpr int none = -1;
  static constexpr std::int32_t free_mark = INT32_MIN;
  /// A granule's row: its head, then its engine record, then the numbers of its clump, if it has one; its tail stands behind.
  /// Tag, radius and mass come first, as key words; small numbers stand in pairs.
  enum Word {
    tag_word,
    radius_word,
    mass_word,
    step_word,
    normal_load_word,
    load_change_word,
    small_words = load_change_word + 3
  };
  static constexpr int record_begin = small_words + (SmallNumbers::count() + 1) / 2;
  using Head = std::array<std::uint64_t, record_begin>;
  static std::size_t words_of_clump(const StoredGranule& g) { return g.has_clump ? StoredGranule::clump_numbers : 0; }
  static void append_clump(StoredGranule g, std::vector<std::uint64_t>& row);
  static void number_by_tag(StoredGranule& g);
  static void number_by_clump(StoredGranule& g);
  /// The words of a slot: 44, 36 or 28 bytes.
  enum Field {
    tag_field,
    next_field,  // next granule in the cell, or next free slot
    body_field,
    shape_field,  // with blob_field: the row, everything else
    blob_field,
    place_field  // the bits of three doubles, or as FixedPlace packs them, or the number of a site
  };
  struct Cell {
    int head = none;
    int around = 0;  // cells that hold granules among the 27 around: what lets most queries end after one look
  };
  /// Holds the centres of all that were there since it was last empty.
  struct Box {
    Vec3 lo = Vec3::Constant(HUGE_VAL), hi = Vec3::Constant(-HUGE_VAL);
    void enclose(const Vec3& p) {
      lo = lo.cwiseMin(p);
      hi = hi.cwiseMax(p);
    }
  };
  struct Grid {
    FlatMap<Cell> cells;
    std::size_t granules = 0;
    Box box;
  };
  struct Body {
    std::size_t granules = 0;
    bool shared = false;
    bool remembered = false;  // without granules, too
    Box box;
  };
  struct Transient {
    struct Words {
      std::size_t first = 0;  // in `words`
      std::uint32_t indices = 0;
    };
    FlatMap<Words, std::int32_t> of_tag;
    ChunkedArray<double> words;
    std::vector<std::vector<int>> indices;  // a few different ones
  };
  using CellPlace = std::array<std::int64_t, 3>;

  CellPlace cell_of(const Vec3& p) const {
    return {static_cast<std::int64_t>(std::floor(p[0] * inverse_cell_)),
            static_cast<std::int64_t>(std::floor(p[1] * inverse_cell_)),
            static_cast<std::int64_t>(std::floor(p[2] * inverse_cell_))};
  }
  /// Wraps for places more than 2^20 cells away: two cells may share a key then, which the visitors of places do not mind.
  static std::int64_t key(std::int64_t i, std::int64_t j, std::int64_t k) {
    constexpr std::uint64_t half = 1 << 20, range = 1 << 21;
    const auto at = [](std::int64_t c) { return static_cast<std::uint64_t>(c) + half; };
    return static_cast<std::int64_t>((at(i) * range + at(j)) * range + at(k));
  }
  bool surely_far(const Grid& grid, const Sphere& s, double gap) const {
    const double reach = s.radius + gap + largest_radius_;
    if (!(((s.centre - grid.box.hi).array() <= reach).all() && ((grid.box.lo - s.centre).array() <= reach).all())) return true;
    if (reach > 1.0 / inverse_cell_) return false;
    const auto c = cell_of(s.centre);
    return !grid.cells.contains(key(c[0], c[1], c[2]));
  }
  template <class Visit>
  void for_each_slot_in_box(const Grid& grid, const Vec3& lo, const Vec3& hi, Visit visit) const {
    // nor is anything in a box whose corners are no numbers
    if (!((lo.array() <= grid.box.hi.array()).all() && (hi.array() >= grid.box.lo.array()).all())) return;
    const auto a = cell_of(lo.cwiseMax(grid.box.lo)), b = cell_of(hi.cwiseMin(grid.box.hi));
    double cells = 1;
    for (int d = 0; d < 3; ++d) {
      if (b[d] < a[d]) return;
      cells *= static_cast<double>(b[d] - a[d] + 1);
    }
    if (cells > static_cast<double>(grid.cells.size())) {  // a large box with little in it
      grid.cells.for_each([&](std::int64_t, const Cell& cell) {
        for (int s = cell.head; s != none; s = next_at(s)) {
          const auto c = cell_of(position(s));
          if (c[0] >= a[0] && c[1] >= a[1] && c[2] >= a[2] && c[0] <= b[0] && c[1] <= b[1] && c[2] <= b[2]) visit(s);
        }
      });
      return;
    }
    for (std::int64_t i = a[0]; i <= b[0]; ++i)
      for (std::int64_t j = a[1]; j <= b[1]; ++j)
        for (std::int64_t k = a[2]; k <= b[2]; ++k)
          if (const Cell* cell = grid.cells.find(key(i, j, k)))
            for (int s = cell->head; s != none; s = next_at(s)) visit(s);
  }
  template <class Visit>
  void for_each_slot_of(int body, Visit visit) const {
    const auto found = bodies_.find(body);
    if (found == bodies_.end() || found->second.granules == 0) return;
    for_each_slot_in_box(grids_.at(frame_of(body)), found->second.box.lo, found->second.box.hi, [&](int s) {
      if (body_at(s) == body) visit(s);
    });
  }
  std::vector<int> slots_of(int body) const;

  int field(int s, Field f) const { return static_cast<int>(slots_.row(static_cast<std::size_t>(s))[f]); }
  void set_field(int s, Field f, int value) { slots_.row(static_cast<std::size_t>(s))[f] = static_cast<std::uint32_t>(value); }
  std::int32_t tag_at(int s) const { return field(s, tag_field); }
  int next_at(int s) const { return field(s, next_field); }
  int body_at(int s) const { return field(s, body_field); }
  PackedRows::Place row_at(int s) const {
    const std::uint32_t* slot = slots_.row(static_cast<std::size_t>(s));
    return {slot[shape_field], slot[blob_field]};
  }
  void set_row(int s, PackedRows::Place row) {
    std::uint32_t* slot = slots_.row(static_cast<std::size_t>(s));
    slot[shape_field] = row.shape;
    slot[blob_field] = row.blob;
  }
  Vec3 position(int s) const {
    const std::uint32_t* place = slots_.row(static_cast<std::size_t>(s)) + place_field;
    if (precision_ == Precision::rounded) return FixedPlace::unpack(place, step_);
    if (precision_ == Precision::sites) {
      Sites::Number site;
      std::memcpy(&site, place, sizeof site);
      return sites_->place(site);
    }
    Vec3 p;
    std::memcpy(p.data(), place, sizeof p);
    return p;
  }
  void set_position(int s, const Vec3& p, double radius) {
    std::uint32_t* place = slots_.row(static_cast<std::size_t>(s)) + place_field;
    if (precision_ == Precision::exact) {
      std::memcpy(place, p.data(), sizeof p);
    } else if (precision_ == Precision::rounded) {
      FixedPlace::pack(p, step_, place);
    } else {
      const Sites::Number site = sites_->nearest(p, radius);
      std::memcpy(place, &site, sizeof site);
    }
  }
  bool is_taken(int frame, const Vec3& site) const;
  Resident resident(int s) const;
  Head head_of_row(StoredGranule g) const;
  std::vector<std::uint64_t> row_of(int s) const;
  Vec3 rounded(const Vec3& place, double radius) const;
  StoredGranule granule(int s) const;
  void read_record(int s, std::vector<double>& out) const;
  void change(int s, const StoredGranule& before, const StoredGranule& after);
  void replace_row(int s, const std::vector<std::uint64_t>& row);
  void give_room_back();

  // in and out of a grid; a body's count and box
  void seat(int s, int frame);
  void unseat(int s, int frame);
  void join(int body, const Vec3& position);
  void leave(int body);
  void relocate(int s, int body, const Vec3& place);

  // the table of tags
  int slot_of(std::int64_t tag) const;
  int slot_or_throw(std::int64_t tag) const;
  int slot_of(const Resident& g) const { return g.slot < 0 ? slot_or_throw(g.tag) : g.slot; }
  std::size_t index_place(std::int32_t tag) const;
  void index(int s);
  void unindex(std::int32_t tag);
  void rebuild_index(std::size_t entries);

  double inverse_cell_, step_;
  Precision precision_;
  const Sites* sites_ = nullptr;
  double largest_radius_ = 0;
  std::size_t size_ = 0;
  ExactSum mass_;
  ChunkedArray<std::uint32_t> slots_;
  int first_free_ = none;
  PackedRows rows_;
  std::vector<std::uint64_t> scratch_;  // one row, as it goes in
  Transient transient_;
  // tag -> slot by open addressing: the slot's number in the low bits, bits of the tag's hash above, so that few wrong slots are
  // looked at
  std::vector<std::uint32_t> index_;
  int slot_bits_ = 0;
  std::map<int, Grid> grids_;   // by frame
  std::map<int, Body> bodies_;  // with granules, or remembered
};

}  // namespace solidcull
