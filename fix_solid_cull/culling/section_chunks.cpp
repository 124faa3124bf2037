#include "section_chunks.h"

#include <algorithm>
#include <cstring>
#include <string>

#include "bits.h"

namespace solidcull {
namespace {

constexpr int granules_per_chunk = 4096;

std::uint64_t whole(std::int64_t x) { return static_cast<std::uint64_t>(x); }

// columns of the tables
enum PartColumn { own_lo = 0, own_hi = 3, observer = 6, observed_then = 13, part_columns = 20 };
enum ContactColumn { c_low, c_high, c_body, c_known, c_history };
enum GranuleColumn { g_tag, g_body, g_numbers };

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

// ------------------------------------------------------------------------------------------------------------ out

ChunkSource::ChunkSource(const Bed& bed, const Cover& cover) : bed_(bed), cover_(cover), history_(bed.solid.contacts().width()) {
  for (const auto& body : bed_.solid.bodies().bodies()) bodies_.push_back(body.first);
  contacts_.clear(0);
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
  WordTable table;
  table.clear(part_columns);
  std::uint64_t* const row = table.add_row();
  put(row + own_lo, bed_.run.own.lo);
  put(row + own_hi, bed_.run.own.hi);
  put(row + observer, cover_.observer());
  put(row + observed_then, cover_.observed_then());
  chunk.append(table);
  table.clear(1);
  for (int l = 0; l < bed_.atoms.layouts(); ++l)
    for (const char c : bed_.atoms.layout_text(l) + "\n") *table.add_row() = static_cast<unsigned char>(c);
  chunk.append(table);
  std::vector<double> numbers;
  table.clear(0);
  for (const auto& body : bed_.solid.bodies().bodies()) {
    SolidBody b = body.second;
    numbers.clear();
    b.each_number([&](auto& x) { numbers.push_back(static_cast<double>(x)); });
    if (table.rows == 0) table.clear(numbers.size());
    std::transform(numbers.begin(), numbers.end(), table.add_row(), bits_of);
  }
  chunk.append(table);
}

void ChunkSource::begin_block() {
  contacts_before_ += contacts_.rows;
  contacts_.clear(c_history + bed_.solid.contacts().width());
  granules_.clear(granule_columns());
  by_length_.clear();
}

void ChunkSource::contact(std::int64_t low, std::int64_t high, const double* history) {
  const SolidBodies& living = bed_.solid.bodies();
  const int body = living.body_of(low) ? living.body_of(low) : living.body_of(high);
  const auto at = std::lower_bound(bodies_.begin(), bodies_.end(), body);
  if (!body || at == bodies_.end() || *at != body)
    throw InternalError("a frozen contact of granules " + std::to_string(low) + " and " + std::to_string(high) +
                        " is of no body of this rank");
  std::uint64_t* const row = contacts_.add_row();
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
  for (; atom_ < atoms.owned && granules_.rows < granules_per_chunk; ++atom_) {
    if (!bed_.shell[atom_].locked) continue;
    granule(granules_, bed_.interface_granule(atom_));
    contacts_of(atoms.tag[atom_]);
  }
  if (granules_.rows == 0) return;
  chunk.begin(SectionChunk::interface_granules, chunk.rank, granules_.rows);
  interface_ += granules_.rows;
  chunk.append(granules_);
  chunk.append(contacts_);
}

void ChunkSource::interior_block(SectionChunk& chunk) {
  begin_block();
  std::uint64_t granules = 0;
  const auto add = [&](const StoredGranule& g, const std::uint64_t* record, int length) {
    WordTable& table = by_length_[length];
    if (table.rows == 0) table.clear(granule_columns() + static_cast<std::size_t>(length));
    std::copy(record, record + length, granule(table, g));
    contacts_of(g.tag);
    ++granules;
  };
  slot_ = bed_.solid.store().visit_some(slot_, granules_per_chunk, add);
  if (granules == 0) return;
  chunk.begin(SectionChunk::interior_granules, chunk.rank, granules);
  interior_ += granules;
  chunk.append(granules_);
  chunk.append(contacts_);
  chunk.append(by_length_.size());
  for (const auto& table : by_length_) chunk.append(table.second);
}

// ------------------------------------------------------------------------------------------------------------ in

auto ChunkReader::part(const SectionChunk& chunk) -> const Head& {
  const char *at = chunk.bytes.data(), *const end = at + chunk.bytes.size();
  auto sender = std::make_shared<Sender>();
  WordTable table;
  at = unpack_columns(at, end, table);
  if (table.rows != 1 || table.columns != part_columns) throw InternalError("a part of a restart file has no head");
  head_.own = {vector_of(table.row(0) + own_lo), vector_of(table.row(0) + own_hi)};
  sender->rank = static_cast<int>(chunk.rank);
  sender->observer = pose_of(table.row(0) + observer);
  sender->observed_then = pose_of(table.row(0) + observed_then);
  at = unpack_columns(at, end, table);
  layout_.clear();
  std::string text;
  for (std::size_t r = 0; r < table.rows; ++r) {
    const char c = static_cast<char>(*table.row(r));
    if (c != '\n') {
      text += c;
      continue;
    }
    layout_.push_back(bed_.atoms.layout_from_text(text));
    text.clear();
  }
  unpack_columns(at, end, table);
  sender->bodies.resize(table.rows);
  for (std::size_t r = 0; r < table.rows; ++r) {
    std::size_t c = 0;
    sender->bodies[r].each_number([&](auto& x) {
      x = static_cast<std::decay_t<decltype(x)>>(number_of(table.row(r)[index_below(c, table.columns)]));
      ++c;
    });
  }
  head_.sender = sender;
  return head_;
}

const Parcel& ChunkReader::parcel(const SectionChunk& chunk) {
  if (!head_.sender || static_cast<std::uint64_t>(head_.sender->rank) != chunk.rank)
    throw InternalError("a chunk of a restart file stands before its part");
  const char *at = chunk.bytes.data(), *const end = at + chunk.bytes.size();
  parcel_.sender = head_.sender;
  parcel_.granules.clear();
  at = unpack_columns(at, end, interface_);
  read_granules(interface_, nullptr);
  at = unpack_columns(at, end, contacts_);
  read_contacts(contacts_);
  if (chunk.kind == SectionChunk::interior_granules) {
    std::uint64_t tables = 0;
    if (static_cast<std::size_t>(end - at) < sizeof tables) throw InternalError("a chunk of a restart file ends too early");
    std::memcpy(&tables, at, sizeof tables);
    at += sizeof tables;
    records_.resize(index_below(tables, chunk.bytes.size()));
    for (std::vector<double>& numbers : records_) {
      at = unpack_columns(at, end, interior_);
      numbers_of(interior_, numbers);
      read_granules(interior_, numbers.data());
    }
  }
  if (parcel_.granules.size() != chunk.granules) throw InternalError("a chunk of a restart file misses granules");
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
                             static_cast<int>(index_below(row[c_body], head_.sender->bodies.size())),
                             row[c_known] ? histories_.data() + r * table.columns + c_history : nullptr});
  }
}

/// numbers: the table's, of interior granules; none of interface granules.
void ChunkReader::read_granules(const WordTable& table, const double* numbers) {
  const std::size_t begin = granule_columns();
  if (table.rows && table.columns < begin) throw InternalError("a chunk of a restart file has no granules");
  for (std::size_t r = 0; r < table.rows; ++r) {
    const std::uint64_t* const row = table.row(r);
    Parcel::Granule g;
    g.tag = static_cast<std::int64_t>(row[g_tag]);
    g.body = static_cast<int>(index_below(row[g_body], head_.sender->bodies.size()));
    const std::uint64_t* at = row + g_numbers;
    g.each_number([&](auto& x) { read(x, *at++); });
    if (numbers) {
      g.layout = layout_[index_below(static_cast<std::uint64_t>(g.layout), layout_.size())];
      g.record = numbers + r * table.columns + begin;
      g.length = static_cast<int>(table.columns - begin);
    }
    parcel_.granules.push_back(g);
  }
}

}  // namespace solidcull
