#include "granule_store.h"

#include <algorithm>
#include <cstring>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "bits.h"

namespace solidcull {
namespace {

constexpr std::uint32_t empty_entry = UINT32_MAX;

/// As the engine packs it.
std::uint64_t word_of_tag(std::int64_t tag) { return static_cast<std::uint64_t>(tag); }

/// Four numbers in one word.
std::uint64_t word_of(const std::array<double, 4>& numbers) {
  std::uint64_t word = 0;
  for (int k = 0; k < 4; ++k) word |= static_cast<std::uint64_t>(HalfWord::pack(numbers[k])) << 16 * k;
  return word;
}
std::array<double, 4> numbers_of(std::uint64_t word) {
  std::array<double, 4> numbers;
  for (int k = 0; k < 4; ++k) numbers[k] = HalfWord::unpack(static_cast<std::uint16_t>(word >> 16 * k));
  return numbers;
}

constexpr double steps_per_cell = 1 << 26;  // of a rounded place
static_assert(GranuleStore::farthest * steps_per_cell == FixedPlace::half);

/// Of a place (32-bit words).
int place_words(GranuleStore::Precision precision) {
  switch (precision) {
    case GranuleStore::Precision::rounded:
      return FixedPlace::words;
    case GranuleStore::Precision::sites:
      return sizeof(Sites::Number) / sizeof(std::uint32_t);
    default:
      return sizeof(Vec3) / sizeof(std::uint32_t);
  }
}

}  // namespace

GranuleStore::GranuleStore(double cell, Precision precision)
    : inverse_cell_(1.0 / cell),
      step_(cell / steps_per_cell),
      precision_(precision),
      slots_(static_cast<std::size_t>(place_field + place_words(precision))) {
  if (!(cell > 0) || !std::isfinite(cell)) throw std::invalid_argument("granule store: the cell size must be positive");
}

GranuleStore::GranuleStore(double cell, const Sites& sites) : GranuleStore(cell, Precision::sites) { sites_ = &sites; }

Vec3 GranuleStore::rounded(const Vec3& place, double radius) const {
  if (precision_ == Precision::exact) return place;
  if (precision_ == Precision::sites) return sites_->place(sites_->nearest(place, radius));
  std::uint32_t packed[FixedPlace::words];
  FixedPlace::pack(place, step_, packed);
  return FixedPlace::unpack(packed, step_);
}

StoredGranule GranuleStore::rounded(StoredGranule granule) const {
  if (precision_ == Precision::exact) return granule;
  granule.position = rounded(granule.position, granule.radius);
  if (precision_ == Precision::sites) granule.load_change = Vec3::Zero();
  const auto rounded =
      numbers_of(word_of({granule.normal_load, granule.load_change[0], granule.load_change[1], granule.load_change[2]}));
  granule.normal_load = rounded[0];
  granule.load_change = Vec3(rounded[1], rounded[2], rounded[3]);
  return granule;
}

/// Engines number the clumps of a kind in the order of their spheres' tags: what a tag is beyond that is the same for many, and
/// costs nothing in a row. Where that would be too large, the number itself; told by the sign.
void GranuleStore::number_by_tag(StoredGranule& g) {
  const std::int64_t before = std::int64_t{g.spheres} * g.clump;
  if (before <= INT32_MAX)
    g.clump = static_cast<int>(g.tag - before);
  else
    g.spheres = -g.spheres;
}
void GranuleStore::number_by_clump(StoredGranule& g) {
  if (g.spheres > 0)
    g.clump = static_cast<int>((g.tag - g.clump) / g.spheres);
  else
    g.spheres = -g.spheres;
}

auto GranuleStore::head_of_row(StoredGranule g) const -> Head {
  Head head{};
  if (g.spheres) number_by_tag(g);
  head[tag_word] = word_of_tag(g.tag);
  head[radius_word] = bits_of(g.radius);
  head[mass_word] = bits_of(g.mass);
  head[step_word] = static_cast<std::uint64_t>(g.lock_step);
  if (precision_ == Precision::exact) {
    head[normal_load_word] = bits_of(g.normal_load);
    for (int d = 0; d < 3; ++d) head[load_change_word + d] = bits_of(g.load_change[d]);
  } else {
    head[normal_load_word] = word_of({g.normal_load, g.load_change[0], g.load_change[1], g.load_change[2]});
  }
  int k = 0;
  g.each_small([&](auto& x) {
    head[small_words + k / 2] |= static_cast<std::uint64_t>(static_cast<std::uint32_t>(x)) << 32 * (k % 2);
    ++k;
  });
  return head;
}

void GranuleStore::append_clump(StoredGranule g, std::vector<std::uint64_t>& row) {
  if (g.has_clump) g.each_of_clump([&](double& x) { row.push_back(bits_of(x)); });
}

// ------------------------------------------------------------------------------------------------------------------ in and out

void GranuleStore::add(const StoredGranule& granule, const double* record, int length, const std::vector<int>& transient,
                       WordView tail) {
  const std::int32_t tag = narrow_tag(granule.tag);
  if (contains(tag)) throw std::logic_error("granule " + std::to_string(tag) + " went into the store twice");
  for (const int i : transient)
    if (i < 0 || i >= length)
      throw std::logic_error("a record of " + std::to_string(length) + " has no word " + std::to_string(i));

  const Vec3 place = rounded(granule.position, granule.radius);
  int s = first_free_;
  if (s == none)
    s = static_cast<int>(slots_.append());
  else
    first_free_ = next_at(s);

  const auto head = head_of_row(granule);
  std::vector<std::uint64_t>& row = scratch_;
  row.resize(record_begin + static_cast<std::size_t>(length));
  std::copy(head.begin(), head.end(), row.begin());
  if (length) std::memcpy(row.data() + record_begin, record, static_cast<std::size_t>(length) * sizeof(double));
  append_clump(granule, row);
  if (!transient.empty()) {
    auto& lists = transient_.indices;
    auto list = std::find(lists.begin(), lists.end(), transient);
    if (list == lists.end()) list = lists.insert(list, transient);
    transient_.of_tag[tag] = {transient_.words.size(), static_cast<std::uint32_t>(list - lists.begin())};
    for (const int i : transient) {
      transient_.words[transient_.words.append()] = record[i];
      row[record_begin + i] = 0;
    }
  }

  set_position(s, place, granule.radius);
  set_field(s, tag_field, tag);
  set_field(s, body_field, granule.body);
  set_row(s, rows_.put(row.data(), static_cast<int>(row.size()), tail));
  join(granule.body, place);
  seat(s, frame_of(granule.body));
  ++size_;
  index(s);
  mass_ += granule.mass;
  largest_radius_ = std::max(largest_radius_, granule.radius);
}

StoredGranule GranuleStore::take(std::int64_t tag, std::vector<double>& record) {
  const int s = slot_or_throw(tag);
  const StoredGranule g = granule(s);
  read_record(s, record);
  transient_.of_tag.erase(tag_at(s));
  unindex(tag_at(s));
  unseat(s, frame_of(g.body));
  leave(g.body);
  rows_.drop(row_at(s));
  set_field(s, tag_field, free_mark);
  set_field(s, next_field, first_free_);
  first_free_ = s;
  mass_ -= g.mass;
  if (--size_ == 0) give_room_back();
  return g;
}

/// Of a store that is empty: when a large bed is restored its contacts need that room.
void GranuleStore::give_room_back() {
  mass_ = ExactSum();
  slots_.clear();
  first_free_ = none;
  rows_ = PackedRows();
  index_ = {};
}

Resident GranuleStore::resident(int s) const {
  return {position(s), number_of(rows_.word_1(row_at(s))), tag_at(s), body_at(s), s};
}

StoredGranule GranuleStore::granule(int s) const {
  std::uint64_t row[record_begin];
  row[tag_word] = word_of_tag(tag_at(s));
  rows_.get(row_at(s), row, record_begin);
  StoredGranule g;
  g.position = position(s);
  g.radius = number_of(row[radius_word]);
  g.mass = number_of(row[mass_word]);
  g.tag = tag_at(s);
  g.body = body_at(s);
  g.lock_step = static_cast<std::int64_t>(row[step_word]);
  if (precision_ == Precision::exact) {
    g.normal_load = number_of(row[normal_load_word]);
    for (int d = 0; d < 3; ++d) g.load_change[d] = number_of(row[load_change_word + d]);
  } else {
    const auto loads = numbers_of(row[normal_load_word]);
    g.normal_load = loads[0];
    g.load_change = Vec3(loads[1], loads[2], loads[3]);
  }
  int k = 0;
  g.each_small([&](auto& x) {
    x = static_cast<std::decay_t<decltype(x)>>(static_cast<std::uint32_t>(row[small_words + k / 2] >> 32 * (k % 2)));
    ++k;
  });
  if (g.spheres) number_by_clump(g);
  if (!g.has_clump) return g;
  const std::vector<std::uint64_t> all = row_of(s);
  auto word = all.end() - StoredGranule::clump_numbers;
  g.each_of_clump([&](double& x) { x = number_of(*word++); });
  return g;
}

std::vector<std::uint64_t> GranuleStore::row_of(int s) const {
  const int length = rows_.length(row_at(s));
  std::vector<std::uint64_t> row(static_cast<std::size_t>(length));
  row[tag_word] = word_of_tag(tag_at(s));
  rows_.get(row_at(s), row.data(), length);
  return row;
}

void GranuleStore::read_record(int s, std::vector<double>& out) const {
  const std::vector<std::uint64_t> row = row_of(s);
  out.resize(row.size() - record_begin - words_of_clump(granule(s)));
  if (!out.empty()) std::memcpy(out.data(), row.data() + record_begin, out.size() * sizeof(double));
  if (const auto* known = transient_.of_tag.find(tag_at(s))) {
    std::size_t word = known->first;
    for (const int i : transient_.indices[known->indices]) out[i] = transient_.words[word++];
  }
}

/// Keeps what has changed but for place and body.
void GranuleStore::change(int s, const StoredGranule& before, const StoredGranule& after) {
  const auto head = head_of_row(after);
  if (head == head_of_row(before) && !after.has_clump) return;
  std::vector<std::uint64_t> row = row_of(s);
  std::copy(head.begin() + 1, head.end(), row.begin() + 1);
  row.resize(row.size() - words_of_clump(before));
  append_clump(after, row);
  replace_row(s, row);
  mass_ -= before.mass;
  mass_ += after.mass;
}

std::optional<Resident> GranuleStore::find(std::int64_t tag) const {
  const int s = slot_of(tag);
  if (s == none) return std::nullopt;
  return resident(s);
}

StoredGranule GranuleStore::get(std::int64_t tag) const { return granule(slot_or_throw(tag)); }

void GranuleStore::record(std::int64_t tag, std::vector<double>& out) const { read_record(slot_or_throw(tag), out); }

void GranuleStore::set_record(std::int64_t tag, int layout, std::vector<double> record, const std::vector<int>& transient) {
  const int s = slot_or_throw(tag);
  const auto* known = transient_.of_tag.find(tag_at(s));
  for (const int i : known ? transient_.indices[known->indices] : transient) record.at(static_cast<std::size_t>(i)) = 0;
  std::vector<std::uint64_t> row(record_begin + record.size());
  StoredGranule g = granule(s);
  g.layout = layout;
  const auto head = head_of_row(g);
  std::copy(head.begin(), head.end(), row.begin());
  if (!record.empty()) std::memcpy(row.data() + record_begin, record.data(), record.size() * sizeof(double));
  append_clump(g, row);
  replace_row(s, row);
}

/// It keeps its tail.
void GranuleStore::replace_row(int s, const std::vector<std::uint64_t>& row) {
  const PackedRows::Place old = row_at(s);
  const PackedRows::Place place = rows_.put(row.data(), static_cast<int>(row.size()), rows_.tail(old));
  rows_.drop(old);
  set_row(s, place);
}

bool GranuleStore::transient_known(std::int64_t tag) const { return transient_.of_tag.contains(narrow_tag(tag)); }

// --------------------------------------------------------------------------------------------------------- bodies and grids

int GranuleStore::frame_of(int body) const {
  const auto found = bodies_.find(body);
  return found != bodies_.end() && found->second.shared ? shared_frame : body;
}

bool GranuleStore::is_taken(int frame, const Vec3& site) const {
  const auto grid = grids_.find(frame);
  bool taken = false;
  if (grid != grids_.end())
    for_each_slot_in_box(grid->second, site, site, [&](int slot) { taken = taken || position(slot) == site; });
  return taken;
}

std::vector<int> GranuleStore::slots_of(int body) const {
  std::vector<int> slots;
  for_each_slot_of(body, [&](int s) { slots.push_back(s); });
  return slots;
}

void GranuleStore::seat(int s, int frame) {
  Grid& grid = grids_[frame];
  const auto c = cell_of(position(s));
  Cell* cell = grid.cells.find(key(c[0], c[1], c[2]));
  if (!cell || cell->head == none) {
    for (std::int64_t i = c[0] - 1; i <= c[0] + 1; ++i)
      for (std::int64_t j = c[1] - 1; j <= c[1] + 1; ++j)
        for (std::int64_t k = c[2] - 1; k <= c[2] + 1; ++k) ++grid.cells[key(i, j, k)].around;
    cell = grid.cells.find(key(c[0], c[1], c[2]));
  }
  set_field(s, next_field, cell->head);
  cell->head = s;
  ++grid.granules;
  grid.box.enclose(position(s));
}

void GranuleStore::unseat(int s, int frame) {
  const auto found = grids_.find(frame);
  Grid& grid = found->second;
  const auto c = cell_of(position(s));
  Cell& cell = *grid.cells.find(key(c[0], c[1], c[2]));
  if (cell.head == s) {
    cell.head = next_at(s);
  } else {
    int before = cell.head;
    while (next_at(before) != s) before = next_at(before);
    set_field(before, next_field, next_at(s));
  }
  if (--grid.granules == 0) {
    grids_.erase(found);
    return;
  }
  if (cell.head != none) return;
  for (std::int64_t i = c[0] - 1; i <= c[0] + 1; ++i)
    for (std::int64_t j = c[1] - 1; j <= c[1] + 1; ++j)
      for (std::int64_t k = c[2] - 1; k <= c[2] + 1; ++k)
        if (--grid.cells.find(key(i, j, k))->around == 0) grid.cells.erase(key(i, j, k));
}

void GranuleStore::join(int body, const Vec3& position) {
  Body& b = bodies_[body];
  ++b.granules;
  b.box.enclose(position);
}

void GranuleStore::leave(int body) {
  const auto found = bodies_.find(body);
  if (--found->second.granules != 0) return;
  if (found->second.remembered)
    found->second.box = Box();
  else
    bodies_.erase(found);
}

void GranuleStore::relocate(int s, int body, const Vec3& place) {
  const double radius = precision_ == Precision::sites ? resident(s).radius : 0;  // else it does not matter
  const Vec3 to = rounded(place, radius);
  const int from = body_at(s);
  const int old_frame = frame_of(from), new_frame = frame_of(body);
  const bool same_cell = old_frame == new_frame && cell_of(position(s)) == cell_of(to);
  if (!same_cell) unseat(s, old_frame);
  set_field(s, body_field, body);
  set_position(s, to, radius);
  if (same_cell)
    grids_.find(new_frame)->second.box.enclose(to);
  else
    seat(s, new_frame);
  join(body, to);  // before it leaves: a body that it leaves for itself must not be forgotten
  leave(from);
}

void GranuleStore::move(std::int64_t tag, int body, const Vec3& position) { relocate(slot_or_throw(tag), body, position); }

void GranuleStore::shift_clump(std::int64_t tag, const Vec3& by) {
  const int s = slot_or_throw(tag);
  const StoredGranule before = granule(s);
  if (!before.has_clump) return;
  StoredGranule after = before;
  after.of_clump.move(by);
  change(s, before, after);
}

void GranuleStore::share(int body, bool on) {
  const int from = frame_of(body);
  Body& b = bodies_[body];
  b.shared = b.remembered = on;
  if (b.granules == 0) {
    if (!on) bodies_.erase(body);
    return;
  }
  const int to = frame_of(body);
  if (from == to) return;
  if (grids_.at(from).granules == b.granules && !grids_.count(to)) {  // the whole grid
    auto grid = grids_.extract(from);
    grid.key() = to;
    grids_.insert(std::move(grid));
    return;
  }
  b.shared = !on;
  const std::vector<int> slots = slots_of(body);
  b.shared = on;
  for (const int s : slots) {
    unseat(s, from);
    seat(s, to);
  }
}

void GranuleStore::forget(int body) {
  const auto found = bodies_.find(body);
  if (found == bodies_.end()) return;
  found->second.remembered = false;
  if (found->second.granules == 0) bodies_.erase(found);
}

// ----------------------------------------------------------------------------------------------------------- the table of tags

/// The entry of the tag, or the empty one where it would go.
std::size_t GranuleStore::index_place(std::int32_t tag) const {
  const std::uint64_t hash = scrambled(static_cast<std::uint64_t>(tag));
  const std::uint32_t slot_mask = (std::uint32_t{1} << slot_bits_) - 1, mark = static_cast<std::uint32_t>(hash) & ~slot_mask;
  std::size_t at = slot_of_hash(hash, index_.size());
  while (index_[at] != empty_entry &&
         ((index_[at] & ~slot_mask) != mark || tag_at(static_cast<int>(index_[at] & slot_mask)) != tag))
    at = at + 1 == index_.size() ? 0 : at + 1;
  return at;
}

int GranuleStore::slot_of(std::int64_t tag) const {
  if (size_ == 0) return none;
  const std::uint32_t entry = index_[index_place(narrow_tag(tag))];
  return entry == empty_entry ? none : static_cast<int>(entry & ((std::uint32_t{1} << slot_bits_) - 1));
}

int GranuleStore::slot_or_throw(std::int64_t tag) const {
  const int s = slot_of(tag);
  if (s == none) throw std::logic_error("granule " + std::to_string(tag) + " is not in the store");
  return s;
}

/// The slot is in the table from here on; it has its tag.
void GranuleStore::index(int s) {
  if (5 * size_ > 4 * index_.size()) {
    rebuild_index(std::max<std::size_t>(16, index_.size() + index_.size() / 4));
    return;
  }
  const std::uint64_t hash = scrambled(static_cast<std::uint64_t>(tag_at(s)));
  const std::uint32_t slot_mask = (std::uint32_t{1} << slot_bits_) - 1;
  std::size_t at = slot_of_hash(hash, index_.size());
  while (index_[at] != empty_entry) at = at + 1 == index_.size() ? 0 : at + 1;
  index_[at] = (static_cast<std::uint32_t>(hash) & ~slot_mask) | static_cast<std::uint32_t>(s);
}

void GranuleStore::unindex(std::int32_t tag) {
  const std::size_t n = index_.size();
  const std::uint32_t slot_mask = (std::uint32_t{1} << slot_bits_) - 1;
  const auto distance = [n](std::size_t from, std::size_t to) { return to >= from ? to - from : to + n - from; };
  std::size_t hole = index_place(tag);
  for (std::size_t at = hole;;) {
    at = at + 1 == n ? 0 : at + 1;
    if (index_[at] == empty_entry) break;
    const std::int32_t other = tag_at(static_cast<int>(index_[at] & slot_mask));
    if (distance(slot_of_hash(scrambled(static_cast<std::uint64_t>(other)), n), at) < distance(hole, at)) continue;
    index_[hole] = index_[at];
    hole = at;
  }
  index_[hole] = empty_entry;
}

/// With all slots that hold a granule. New slots come only while all are taken, so none gets a number above `most` before the
/// table grows again.
void GranuleStore::rebuild_index(std::size_t entries) {
  const std::size_t most = std::max(entries, slots_.size()) + 1;
  slot_bits_ = 0;
  while (most >> slot_bits_) ++slot_bits_;
  if (slot_bits_ > 31) throw std::length_error("the granule store of a rank is full: use more ranks");
  index_.assign(entries, empty_entry);
  index_.shrink_to_fit();
  const std::size_t n = index_.size();
  const std::uint32_t slot_mask = (std::uint32_t{1} << slot_bits_) - 1;
  for (int s = 0; s < static_cast<int>(slots_.size()); ++s) {
    if (tag_at(s) == free_mark) continue;
    const std::uint64_t hash = scrambled(static_cast<std::uint64_t>(tag_at(s)));
    std::size_t at = slot_of_hash(hash, n);
    while (index_[at] != empty_entry) at = at + 1 == n ? 0 : at + 1;
    index_[at] = (static_cast<std::uint32_t>(hash) & ~slot_mask) | static_cast<std::uint32_t>(s);
  }
}

// -------------------------------------------------------------------------------------------------------------------- figures

double GranuleStore::mass_recounted() const {
  ExactSum sum;
  for (int s = 0; s < static_cast<int>(slots_.size()); ++s)
    if (tag_at(s) != free_mark) sum += granule(static_cast<int>(s)).mass;
  return sum.value();
}

std::size_t GranuleStore::memory_bytes() const {
  constexpr std::size_t node = 4 * sizeof(void*);  // of a std::map, besides what it holds
  std::size_t bytes = slots_.memory_bytes() + rows_.memory_bytes() + index_.capacity() * sizeof(index_[0]) +
                      transient_.of_tag.memory_bytes() + transient_.words.memory_bytes();
  bytes += bodies_.size() * (sizeof(std::pair<const int, Body>) + node);
  for (const auto& grid : grids_) bytes += sizeof(grid) + node + grid.second.cells.memory_bytes();
  return bytes;
}

}  // namespace solidcull
