#include "section_chunks.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <string>
#include <utility>

#include "bits.h"
#include "store_exchange.h"

namespace solidcull {
namespace {

constexpr int granules_per_chunk = 4096;

std::uint64_t whole(std::int64_t x) { return static_cast<std::uint64_t>(x); }

// columns of the tables
enum PartColumn { own_lo = 0, own_hi = 3, observer = 6, observed_then = 13, places_lo = 20, places_hi = 23, part_columns = 26 };
enum ContactColumn { c_low, c_high, c_body, c_known, c_history };
enum GranuleColumn { g_tag, g_body, g_numbers };
using namespace chunk_columns;
static_assert(int{c_history} == chunk_columns::history, "the same columns");

std::uint64_t word(double x) { return bits_of(x); }
template <class Whole>
std::uint64_t word(Whole x) {
  return static_cast<std::uint64_t>(static_cast<std::int64_t>(x));
}
void read(double& x, std::uint64_t word) { x = number_of(word); }
template <class Whole>
void read(Whole& x, std::uint64_t word) {
  x = static_cast<Whole>(static_cast<std::int64_t>(word));
}
/// Columns of a granule before its record.
std::size_t granule_columns() {
  std::size_t n = g_numbers;
  StoredGranule().each_number([&](auto&) { ++n; });
  return n;
}

void put(std::uint64_t* to, const Vec3& v) {
  for (int d = 0; d < 3; ++d) to[d] = bits_of(v[d]);
}
Vec3 vector_of(const std::uint64_t* from) { return {number_of(from[0]), number_of(from[1]), number_of(from[2])}; }
void put(std::uint64_t* to, const Pose& p) {
  put(to, p.origin());
  for (int k = 0; k < 4; ++k) to[3 + k] = bits_of(p.quaternion().coeffs()[k]);
}
Pose pose_of(const std::uint64_t* from) {
  return Pose(vector_of(from),
              Eigen::Quaterniond(number_of(from[6]), number_of(from[3]), number_of(from[4]), number_of(from[5])));
}

void add_line(const std::string& text, WordTable& to) {
  for (const char c : text + "\n") *to.add_row() = static_cast<unsigned char>(c);
}
std::vector<std::string> lines_of(const WordTable& table) {
  std::vector<std::string> lines;
  std::string text;
  for (std::size_t r = 0; r < table.rows; ++r) {
    const char c = static_cast<char>(*table.row(r));
    if (c == '\n')
      lines.push_back(std::exchange(text, {}));
    else
      text += c;
  }
  return lines;
}

/// One that is left out where it is empty: then nothing follows, but zeros of less than a word.
void unpack_last(const char* at, const char* end, WordTable& table) {
  table.clear(0);
  if (static_cast<std::size_t>(end - at) >= sizeof(std::uint64_t)) unpack_columns(at, end, table);
}

/// Mixes a word into a sum that does not depend on the order in which granules come.
std::uint64_t mixed(std::uint64_t sum, std::uint64_t word) {
  sum = (sum ^ word) * 0x9e3779b97f4a7c15u;
  return sum ^ (sum >> 32);
}
std::uint64_t mixed(std::uint64_t tag, int body, const Vec3& place) {
  std::uint64_t sum = mixed(mixed(1, tag), whole(body));
  for (int d = 0; d < 3; ++d) sum = mixed(sum, bits_of(place[d]));
  return sum;
}

/// The table's words as the numbers whose bits they are.
void numbers_of(const WordTable& table, std::vector<double>& numbers) {
  static_assert(sizeof(double) == sizeof(std::uint64_t), "a number is a word");
  numbers.resize(table.words.size());
  if (!numbers.empty()) std::memcpy(numbers.data(), table.words.data(), numbers.size() * sizeof(double));
}

std::size_t index_below(std::uint64_t x, std::size_t n) {
  if (x >= n) throw InternalError("a chunk of a restart file names something that is not there");
  return static_cast<std::size_t>(x);
}

}  // namespace

Vec3 granule_home(const std::uint64_t* row) {
  StoredGranule g;
  const std::uint64_t* at = row + g_numbers;
  g.each_number([&](auto& x) { read(x, *at++); });
  return g.home();
}

// ------------------------------------------------------------------------------------------------------------ tables

void PartTables::read(const SectionChunk& chunk) {
  const char *at = chunk.bytes.data(), *const end = at + chunk.bytes.size();
  if (chunk.kind == SectionChunk::part) {
    at = unpack_columns(at, end, head);
    at = unpack_columns(at, end, layouts);
    if (head.rows != 1 || head.columns != part_columns) throw InternalError("a part of a restart file has no head");
  }
  at = unpack_columns(at, end, bodies);
  unpack_last(at, end, meshes);
}

void PartTables::append_to(SectionChunk& chunk) const {
  if (chunk.kind == SectionChunk::part) {
    chunk.append(head);
    chunk.append(layouts);
  }
  chunk.append(bodies);
  if (meshes.rows) chunk.append(meshes);
}

void ChunkTables::read(const SectionChunk& chunk) {
  const char *at = chunk.bytes.data(), *const end = at + chunk.bytes.size();
  at = unpack_columns(at, end, interface_granules);
  at = unpack_columns(at, end, contacts);
  std::uint64_t more = 0;
  if (chunk.kind == SectionChunk::interior_granules) {
    if (static_cast<std::size_t>(end - at) < sizeof more) throw InternalError("a chunk of a restart file ends too early");
    std::memcpy(&more, at, sizeof more);
    at += sizeof more;
  }
  interior.resize(index_below(more, chunk.bytes.size()));
  for (WordTable& table : interior) at = unpack_columns(at, end, table);
  unpack_last(at, end, wall_loads);
  if (wall_loads.rows && wall_loads.columns != load_columns)
    throw InternalError("a chunk of a restart file has other loads on walls");
  if (granules() != chunk.granules) throw InternalError("a chunk of a restart file misses granules");
}

void ChunkTables::append_to(SectionChunk& chunk) const {
  chunk.append(interface_granules);
  chunk.append(contacts);
  if (chunk.kind != SectionChunk::interior_granules) return;
  chunk.append(interior.size());
  for (const WordTable& table : interior) chunk.append(table);
  if (wall_loads.rows) chunk.append(wall_loads);
}

std::size_t ChunkTables::granules() const {
  std::size_t n = interface_granules.rows;
  for (const WordTable& table : interior) n += table.rows;
  return n;
}

// ------------------------------------------------------------------------------------------------------------ out

ChunkSource::ChunkSource(const Bed& bed, const Cover& cover) : bed_(bed), cover_(cover), history_(bed.solid.contacts().width()) {
  for (const auto& body : bed_.solid.bodies().bodies()) bodies_.push_back(body.first);
  tables_.contacts.clear(0);
}

std::uint64_t ChunkSource::identity(const Bed& bed) {
  std::uint64_t sum = mixed(whole(bed.run.step), whole(bed.ranks.count));
  bed.solid.store().for_each([&](const Resident& g) { sum += mixed(whole(g.tag), g.body, g.position); });
  for (int i = 0; i < bed.atoms.owned; ++i)
    if (bed.shell[i].locked) sum += mixed(whole(bed.atoms.tag[i]), bed.shell[i].body, bed.shell[i].place);
  std::uint64_t all = 0;
  for (const std::uint64_t one : bed.ranks.gather(std::vector<std::uint64_t>{sum})) all = mixed(all, one);
  return all;
}

bool ChunkSource::next(SectionChunk& chunk) {
  chunk.begin(SectionChunk::part, static_cast<std::uint64_t>(bed_.ranks.me), 0);
  if (!part_given_) {
    part(chunk);
    part_given_ = true;
    return true;
  }
  if (atom_ < bed_.atoms.owned) interface_block(chunk);
  if (!chunk.bytes.empty()) return true;
  if (slot_ < bed_.solid.store().slots()) interior_block(chunk);
  if (!chunk.bytes.empty()) return true;
  if (graph_contacts_ != bed_.solid.contacts().size())
    throw InternalError(std::to_string(bed_.solid.contacts().size()) + " contacts are frozen and " +
                        std::to_string(graph_contacts_) + " were written");
  return false;
}

void ChunkSource::part(SectionChunk& chunk) {
  PartTables part;
  part.head.clear(part_columns);
  std::uint64_t* const row = part.head.add_row();
  put(row + own_lo, bed_.ranks.own().lo);
  put(row + own_hi, bed_.ranks.own().hi);
  put(row + observer, cover_.observer());
  put(row + observed_then, cover_.observed_then());
  constexpr double nowhere = std::numeric_limits<double>::infinity();
  Box places{Vec3::Constant(nowhere), Vec3::Constant(-nowhere)};
  bed_.solid.store().for_each([&](const Resident& g) {
    const Vec3 x = bed_.solid.in_world(g);
    places.lo = places.lo.cwiseMin(x);
    places.hi = places.hi.cwiseMax(x);
  });
  put(row + places_lo, places.lo);
  put(row + places_hi, places.hi);
  part.layouts.clear(1);
  for (int l = 0; l < bed_.atoms.layouts(); ++l) add_line(bed_.atoms.layout_text(l), part.layouts);
  part.meshes.clear(1);
  for (const std::string& name : bed_.walls.mesh_names()) add_line(name, part.meshes);
  std::vector<double> numbers;
  part.bodies.clear(0);
  for (const auto& body : bed_.solid.bodies().bodies()) {
    SolidBody b = body.second;
    numbers.clear();
    b.each_number([&](auto& x) { numbers.push_back(static_cast<double>(x)); });
    if (part.bodies.rows == 0) part.bodies.clear(numbers.size());
    std::transform(numbers.begin(), numbers.end(), part.bodies.add_row(), bits_of);
  }
  part.append_to(chunk);
}

void ChunkSource::begin_block() {
  contacts_before_ += tables_.contacts.rows;
  tables_.contacts.clear(c_history + bed_.solid.contacts().width());
  tables_.interface_granules.clear(granule_columns());
  tables_.wall_loads.clear(0);
  tables_.interior.clear();
  by_length_.clear();
}

void ChunkSource::contact(std::int64_t low, std::int64_t high, const double* history) {
  const SolidBodies& living = bed_.solid.bodies();
  const int body = living.body_of(low) ? living.body_of(low) : living.body_of(high);
  const auto at = std::lower_bound(bodies_.begin(), bodies_.end(), body);
  if (!body || at == bodies_.end() || *at != body)
    throw InternalError("a frozen contact of granules " + std::to_string(low) + " and " + std::to_string(high) +
                        " is of no body of this rank");
  std::uint64_t* const row = tables_.contacts.add_row();
  row[c_low] = whole(low);
  row[c_high] = whole(high);
  row[c_body] = static_cast<std::uint64_t>(at - bodies_.begin());
  row[c_known] = history != nullptr;
  if (history) std::transform(history, history + history_.size(), row + c_history, bits_of);
}

/// With granules that came before, and with those that are not on this rank.
void ChunkSource::contacts_of(std::int64_t tag) {
  const GranuleStore& store = bed_.solid.store();
  const bool stored = store.contains(tag);
  const auto comes_later = [&](std::int64_t partner) {
    if (store.contains(partner)) return !stored || store.comes_before(tag, partner);
    const int* i = stored ? nullptr : bed_.index.find(partner);
    return i && bed_.shell[*i].locked && *i > bed_.index.at(tag);
  };
  bed_.solid.contacts().for_each(tag, [&](std::int64_t partner, const double* history) {
    if (comes_later(partner)) return;
    const std::int64_t low = std::min(tag, partner), high = std::max(tag, partner);
    if (history) {
      history_.assign(history, history + history_.size());
      if (tag != low) bed_.solid.contacts().change_side(history_.data());
    }
    bool known = history != nullptr;
    if (bed_.solid.contacts().contains(low, high))
      ++graph_contacts_;
    else
      known = bed_.solid.inner_history(*store.find(low), high, history_.data());
    contact(low, high, known ? history_.data() : nullptr);
  });
}

/// Returns where its record goes.
std::uint64_t* ChunkSource::granule(WordTable& table, StoredGranule g) const {
  std::uint64_t* const row = table.add_row();
  row[g_tag] = whole(g.tag);
  row[g_body] = static_cast<std::uint64_t>(std::lower_bound(bodies_.begin(), bodies_.end(), g.body) - bodies_.begin());
  std::uint64_t* at = row + g_numbers;
  g.each_number([&](auto& x) { *at++ = word(x); });
  return at;
}

void ChunkSource::interface_block(SectionChunk& chunk) {
  begin_block();
  const Atoms& atoms = bed_.atoms;
  for (; atom_ < atoms.owned && tables_.interface_granules.rows < granules_per_chunk; ++atom_) {
    if (!bed_.shell[atom_].locked) continue;
    granule(tables_.interface_granules, bed_.interface_granule(atom_));
    contacts_of(atoms.tag[atom_]);
  }
  give(SectionChunk::interface_granules, chunk);
}

void ChunkSource::interior_block(SectionChunk& chunk) {
  begin_block();
  const auto add = [&](StoredGranule g, const std::uint64_t* record, int length) {
    if (g.clump && !g.has_clump) g.of_clump.centre = bed_.solid.home_of(g.tag);
    const auto known = by_length_.emplace(length, tables_.interior.size());
    if (known.second) {
      tables_.interior.emplace_back();
      tables_.interior.back().clear(granule_columns() + static_cast<std::size_t>(length));
    }
    std::copy(record, record + length, granule(tables_.interior[known.first->second], g));
    contacts_of(g.tag);
    bed_.solid.wall_loads().for_each_of(g.tag, [&](const WallLoad& load) {
      if (tables_.wall_loads.rows == 0) tables_.wall_loads.clear(load_columns);
      std::uint64_t* const row = tables_.wall_loads.add_row();
      row[load_tag] = whole(g.tag);
      row[load_mesh] = word(load.mesh);
      row[load_element] = word(load.element);
      put(row + load_force, load.force);
      put(row + load_torque, load.torque);
    });
  };
  slot_ = bed_.solid.store().visit_some(slot_, granules_per_chunk, add);
  std::sort(tables_.interior.begin(), tables_.interior.end(),
            [](const WordTable& a, const WordTable& b) { return a.columns < b.columns; });
  give(SectionChunk::interior_granules, chunk);
}

/// Nothing, where there are no granules.
void ChunkSource::give(std::uint64_t kind, SectionChunk& chunk) {
  if (tables_.granules() == 0) return;
  chunk.begin(kind, chunk.rank, tables_.granules());
  counts_.add(kind, chunk.granules);
  tables_.append_to(chunk);
}

// ------------------------------------------------------------------------------------------------------------ in

auto ChunkReader::part(const SectionChunk& chunk) -> const Head& {
  PartTables tables;
  tables.read(chunk);
  return part(tables, chunk.rank);
}

auto ChunkReader::part(const PartTables& tables, std::uint64_t rank) -> const Head& {
  const std::uint64_t* const row = tables.head.row(0);
  head_.own = {vector_of(row + own_lo), vector_of(row + own_hi)};
  head_.places = {vector_of(row + places_lo), vector_of(row + places_hi)};
  sender_ = std::make_shared<Sender>();
  sender_->rank = static_cast<int>(rank);
  sender_->observer = pose_of(row + observer);
  sender_->observed_then = pose_of(row + observed_then);
  layout_.clear();
  for (const std::string& text : lines_of(tables.layouts)) layout_.push_back(bed_.atoms.layout_from_text(text));
  mesh_.clear();
  const std::vector<std::string>& names = bed_.walls.mesh_names();
  for (const std::string& name : lines_of(tables.meshes))
    mesh_.push_back(static_cast<int>(std::find(names.begin(), names.end(), name) - names.begin()));
  head_.sender = sender_;
  more_bodies(tables.bodies);
  return head_;
}

void ChunkReader::more_bodies(const WordTable& table) {
  if (!sender_) throw InternalError("bodies of a restart file come before their part");
  for (std::size_t r = 0; r < table.rows; ++r) {
    std::size_t c = 0;
    sender_->bodies.emplace_back();
    sender_->bodies.back().each_number([&](auto& x) {
      x = static_cast<std::decay_t<decltype(x)>>(number_of(table.row(r)[index_below(c, table.columns)]));
      ++c;
    });
  }
}

const Parcel& ChunkReader::parcel(const SectionChunk& chunk) {
  if (!sender_ || static_cast<std::uint64_t>(sender_->rank) != chunk.rank)
    throw InternalError("a chunk of a restart file stands before its part");
  tables_.read(chunk);
  return parcel(tables_);
}

const Parcel& ChunkReader::parcel(const ChunkTables& tables) {
  parcel_.sender = sender_;
  parcel_.granules.clear();
  read_granules(tables.interface_granules, nullptr);
  read_contacts(tables.contacts);
  index_wall_loads(tables.wall_loads);
  records_.resize(tables.interior.size());
  for (std::size_t t = 0; t < tables.interior.size(); ++t) {
    numbers_of(tables.interior[t], records_[t]);
    read_granules(tables.interior[t], records_[t].data());
  }
  return parcel_;
}

void ChunkReader::read_contacts(const WordTable& table) {
  parcel_.edges.clear();
  parcel_.edges.reserve(table.rows);
  if (table.rows && table.columns != c_history + bed_.solid.contacts().width())
    throw InternalError("a chunk of a restart file has other histories");
  numbers_of(table, histories_);
  for (std::size_t r = 0; r < table.rows; ++r) {
    const std::uint64_t* const row = table.row(r);
    parcel_.edges.push_back({static_cast<std::int64_t>(row[c_low]), static_cast<std::int64_t>(row[c_high]),
                             static_cast<int>(index_below(row[c_body], sender_->bodies.size())),
                             row[c_known] ? histories_.data() + r * table.columns + c_history : nullptr});
  }
}

/// Those of one granule stand in a row.
void ChunkReader::index_wall_loads(const WordTable& table) {
  loads_ = &table;
  first_load_ = FlatMap<int>();
  for (std::size_t r = table.rows; same_walls_ && r-- > 0;)
    first_load_[static_cast<std::int64_t>(table.row(r)[load_tag])] = static_cast<int>(r);
}

std::vector<WallLoad> ChunkReader::wall_loads_of(std::int64_t tag) const {
  std::vector<WallLoad> loads;
  const int* const first = first_load_.find(tag);
  if (!first) return loads;
  for (std::size_t r = static_cast<std::size_t>(*first); r < loads_->rows; ++r) {
    const std::uint64_t* const row = loads_->row(r);
    if (row[load_tag] != whole(tag)) break;
    WallLoad load;
    read(load.mesh, row[load_mesh]);
    read(load.element, row[load_element]);
    if (load.mesh != WallLoad::no_mesh) load.mesh = mesh_[index_below(row[load_mesh], mesh_.size())];
    load.force = vector_of(row + load_force);
    load.torque = vector_of(row + load_torque);
    loads.push_back(load);
  }
  std::reverse(loads.begin(), loads.end());  // they are kept the last one first
  return loads;
}

/// numbers: the table's, of interior granules; none of interface granules.
void ChunkReader::read_granules(const WordTable& table, const double* numbers) {
  const std::size_t begin = granule_columns();
  if (table.rows && table.columns < begin) throw InternalError("a chunk of a restart file has no granules");
  for (std::size_t r = 0; r < table.rows; ++r) {
    const std::uint64_t* const row = table.row(r);
    Parcel::Granule g;
    g.tag = static_cast<std::int64_t>(row[g_tag]);
    g.body = static_cast<int>(index_below(row[g_body], sender_->bodies.size()));
    const std::uint64_t* at = row + g_numbers;
    g.each_number([&](auto& x) { read(x, *at++); });
    if (numbers) {
      // the file does not have the motion that it had, to be given back in that step
      if (g.lock_step == bed_.run.step) g.lock_step = StoreExchange::locked_long_ago;
      g.layout = layout_[index_below(static_cast<std::uint64_t>(g.layout), layout_.size())];
      g.record = numbers + r * table.columns + begin;
      g.length = static_cast<int>(table.columns - begin);
      g.wall_loads = wall_loads_of(g.tag);
    }
    parcel_.granules.push_back(g);
  }
}

}  // namespace solidcull
