#include "snapshot.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <string>

#include "bits.h"
#include "input_error.h"
#include "section_delivery.h"
#include "word_sum.h"

namespace solidcull {
namespace {

constexpr double file_mark = 20261228;  // the format's version
/// The numbers in the file's head. The largest stored radius of each type and a check sum follow them.
enum Header {
  mark,
  size_again,
  interior,
  diameter,
  gravity,
  gravity_x,
  counters = gravity_x + 3,
  width = counters + Ledger::counters_size,
  ranks,
  step,
  no_places,
  has_section,
  clumps_in_shell,
  largest_clump,
  highest_clump,
  walls_high,
  walls_low,
  identity_high,
  identity_low,
  types,
  header_size
};
constexpr std::size_t check_sum_size = 2;
constexpr double most_types = 1e6;

/// Of the walls, and of how far they reach.
std::uint64_t sum_of_walls(const Bed& bed) {
  std::uint64_t sum = bits_of(bed.run.skin);
  for (const std::uint64_t part : bed.ranks.gather(std::vector<std::uint64_t>{bed.walls.part_of_sum()})) sum += part;
  return sum;
}

/// In two halves that doubles hold exactly.
std::array<double, 2> halves(std::uint64_t word) {
  return {static_cast<double>(word >> 32), static_cast<double>(word & 0xffffffffu)};
}
std::uint64_t joined(const double* halves) {
  return static_cast<std::uint64_t>(halves[0]) << 32 | static_cast<std::uint64_t>(halves[1]);
}
std::array<double, check_sum_size> check_sum(const double* numbers, std::size_t n) {
  WordSum sum;
  for (std::size_t k = 0; k < n; ++k) sum.add(numbers[k]);
  return halves(sum.value());
}

constexpr const char* damaged = "the restart file is damaged where it holds this fix's granules: use another one";

}  // namespace

// ------------------------------------------------------------------------------------------------------------ out

std::vector<double> Snapshot::write(bool run_begins) {
  bed_.index.index(bed_.atoms);
  const bool store = bed_.solid.has_store();
  Ledger::Counters sums = bed_.solid.ledger().counters();
  bed_.ranks.sum(sums.data(), Ledger::counters_size);
  std::int64_t held[2] = {store ? static_cast<std::int64_t>(bed_.solid.store().size()) : 0,
                          static_cast<std::int64_t>(bed_.locked_clumps.all().size())};
  bed_.ranks.sum(held, 2);
  const std::int64_t stored = held[0];
  double clumps[2] = {bed_.clumps.largest(), static_cast<double>(bed_.clumps.highest_number())};
  bed_.ranks.largest(clumps, 2);
  std::vector<double> radii = bed_.solid.largest_radius_by_type();
  bed_.ranks.largest(radii.data(), static_cast<int>(radii.size()));
  identity_ = store ? ChunkSource::identity(bed_) : 0;
  const std::uint64_t walls = sum_of_walls(bed_);
  if (bed_.ranks.me != 0) return {};
  std::vector<double> state(1 + header_size);
  state[0] = static_cast<double>(state.size() + radii.size() + check_sum_size);
  double* const h = &state[1];
  h[mark] = file_mark;
  h[size_again] = state[0];
  h[interior] = static_cast<double>(stored);
  h[diameter] = bed_.scales.diameter();
  h[gravity] = bed_.scales.gravity();
  set(h + gravity_x, gravity_.at_last_look());
  std::copy(sums.begin(), sums.end(), h + counters);
  h[width] = static_cast<double>(bed_.solid.contacts().width());
  h[ranks] = bed_.ranks.count;
  h[step] = static_cast<double>(bed_.run.step);
  h[no_places] = bed_.scales.refills();
  h[has_section] = store;
  const auto name = halves(identity_), of_walls = halves(walls);
  std::copy(name.begin(), name.end(), h + identity_high);
  std::copy(of_walls.begin(), of_walls.end(), h + walls_high);
  h[clumps_in_shell] = static_cast<double>(held[1]);
  h[largest_clump] = clumps[0];
  h[highest_clump] = clumps[1];
  h[types] = static_cast<double>(radii.size());
  state.insert(state.end(), radii.begin(), radii.end());
  const auto sum = check_sum(state.data(), state.size());
  state.insert(state.end(), sum.begin(), sum.end());
  if (stored > 0 && (run_begins || !told_))
    bed_.run.say("the restart file holds " + std::to_string(stored) +
                 " interior granules besides the atoms: a deck that reads it needs a fix solid/cull of the same ID");
  told_ = !run_begins;
  return state;
}

void Snapshot::append_to(const std::string& file) {
  if (!bed_.solid.has_store()) return;
  SectionWriter out(bed_.ranks, file, identity_);
  ChunkSource source(bed_, cover_);
  for (SectionChunk chunk; out.put(source.next(chunk) ? chunk : SectionChunk());) {
  }
  out.close(source.counts());
}

// ------------------------------------------------------------------------------------------------------------ in

std::vector<double> Snapshot::from_bytes(const char* bytes) {
  std::vector<double> state(1 + header_size);
  std::memcpy(state.data(), bytes, state.size() * sizeof(double));
  if (state[1 + mark] != file_mark)
    throw InputError("the restart file was written by another version of solidcull: write it again with this one");
  const double n = state[0];
  if (!(n >= 1 + header_size + check_sum_size && n <= most_types) || state[1 + size_again] != n ||
      n != 1 + header_size + state[1 + types] + check_sum_size)
    throw InputError(damaged);
  state.resize(static_cast<std::size_t>(n));
  std::memcpy(state.data(), bytes, state.size() * sizeof(double));
  const std::size_t size = state.size() - check_sum_size;
  const auto sum = check_sum(state.data(), size);
  if (!std::equal(sum.begin(), sum.end(), state.begin() + static_cast<std::ptrdiff_t>(size))) throw InputError(damaged);
  return state;
}

std::int64_t Snapshot::interior_of(const std::vector<double>& state) {
  return static_cast<std::int64_t>(state[1 + interior] + state[1 + clumps_in_shell]);
}

void Snapshot::read(const std::vector<double>& state, const std::string& file) {
  state_.assign(state.begin() + 1, state.end() - check_sum_size);
  file_ = file;
  const double* const h = state_.data();
  if (h[has_section] != 0) {
    const SectionReader section(bed_.ranks, file_, joined(h + identity_high));
    if (section.counts().interior != static_cast<std::uint64_t>(h[interior])) throw InputError(damaged);
  }
  bed_.scales.set(h[diameter], h[gravity]);
  gravity_.set_at_last_look(vec(h + gravity_x));
  const std::int64_t then = static_cast<std::int64_t>(h[step]);
  bed_.run.reset_by += bed_.run.step - then;
  bed_.run.step = then;
  Ledger::Counters counted{};
  for (int k = 0; k < Ledger::counters_size; ++k)
    if (bed_.ranks.me == 0) counted[k] = h[counters + k];
  bed_.solid.set_counters(counted);

  // the neighbour cut-off is set before the store is taken up: it must know the largest stored radius
  const int known =
      static_cast<int>(std::min<std::size_t>(bed_.solid.largest_radius_by_type().size(), static_cast<std::size_t>(h[types])));
  for (int type = 1; type < known; ++type) bed_.solid.know_radius(type, h[header_size + type]);
  bed_.clumps.know_largest(h[largest_clump]);
}

void Snapshot::take_up() {
  const std::vector<double> state = std::move(state_);
  state_.clear();
  taken_up_ = true;
  same_walls_ = false;
  const double* const h = state.data();
  if (static_cast<std::size_t>(h[width]) != bed_.solid.contacts().width())
    throw InputError("the restart file holds contact histories of " + std::to_string(static_cast<int>(h[width])) +
                     " numbers and this deck's contact model has " + std::to_string(bed_.solid.contacts().width()) +
                     ": use the contact model that the file was written with");
  if ((h[no_places] != 0) != bed_.scales.refills() && h[interior] > 0)
    throw InputError(std::string("the restart file was written with 'store ") +
                     (bed_.scales.refills() ? "exact' or 'compact" : "none") + "': read it with that store");
  if (h[largest_clump] > 0 && !bed_.clumps.possible)
    throw InputError("the restart file holds clumps: put the deck's fix multisphere before the first run");
  if (bed_.clumps.possible) bed_.clumps.keep_number(static_cast<int>(h[highest_clump]));
  if (h[has_section] == 0) return;
  const std::uint64_t identity = joined(h + identity_high);
  bed_.index.index(bed_.atoms);
  if (bed_.ranks.subdomains_changed()) bed_.ranks.update();
  same_walls_ = joined(h + walls_high) == sum_of_walls(bed_);
  SectionReader section(bed_.ranks, file_, identity);
  const bool as_it_was = static_cast<int>(h[ranks]) == bed_.ranks.count &&
                         section.parts().size() == static_cast<std::size_t>(bed_.ranks.count) && stands_as_it_was(section);
  const SectionCounts taken =
      as_it_was ? take_as_it_was(section) : SectionDelivery(bed_, parcels_, section, same_walls_).take_all();
  check_counts(section.counts(), taken);
}

/// Every chunk was read once, and every granule is there.
void Snapshot::check_counts(const SectionCounts& due, const SectionCounts& taken) const {
  std::int64_t all[] = {static_cast<std::int64_t>(taken.chunks), static_cast<std::int64_t>(taken.interior),
                        static_cast<std::int64_t>(taken.interface_granules),
                        static_cast<std::int64_t>(bed_.solid.store().size())};
  bed_.ranks.sum(all, 4);
  const auto is = [](std::int64_t n, std::uint64_t other) { return static_cast<std::uint64_t>(n) == other; };
  if (!is(all[0], due.chunks) || !is(all[1], due.interior) || !is(all[2], due.interface_granules)) throw InputError(damaged);
  if (!is(all[3], due.interior))
    throw InternalError("of " + std::to_string(due.interior) + " interior granules of the restart file " +
                        std::to_string(all[3]) + " were taken up");
}

/// Whether this rank holds what is in the parcel.
bool Snapshot::holds(const Parcel& p) const {
  return std::all_of(p.granules.begin(), p.granules.end(), [&](const Parcel::Granule& g) {
    return g.record ? bed_.ranks.owns(p.sender->bodies.at(static_cast<std::size_t>(g.body)).pose.to_world(g.home()))
                    : bed_.index.contains(g.tag);
  });
}

/// Whether each rank holds all that it wrote, and locked atoms that it wrote only. Keeps the chunks that it has read, all but
/// those of interior granules, so that they are not read again.
bool Snapshot::stands_as_it_was(SectionReader& section) const {
  std::int64_t locked = 0;
  for (int i = 0; i < bed_.atoms.owned; ++i) locked += bed_.shell[i].locked;
  bool same = true, moved = false, within = false;  // moved: the borders of the subdomain
  ChunkReader reader(bed_, same_walls_);
  SectionChunk chunk;
  const std::vector<ChunkPlace> chunks = section.list(static_cast<std::size_t>(bed_.ranks.me));
  for (const ChunkPlace& c : chunks) {
    if (c.kind == SectionChunk::interior_granules) continue;
    if (!section.read(c, chunk)) break;
    if (c.kind == SectionChunk::part) {
      const ChunkReader::Head& head = reader.part(chunk);
      const Box own = bed_.ranks.own(), &places = head.places;
      moved = head.own.lo != own.lo || head.own.hi != own.hi;
      within = (places.lo.array() >= own.lo.array()).all() && (places.hi.array() < own.hi.array()).all();
    } else {
      locked -= static_cast<std::int64_t>(c.granules);
      same = same && holds(reader.parcel(chunk));
    }
    section.keep(c, std::move(chunk));
  }
  section.agree();
  if (bed_.ranks.any(!same || locked != 0)) return false;
  if (bed_.ranks.count == 1 || !bed_.ranks.any(moved)) return true;
  for (const ChunkPlace& c : chunks) {
    if (within || !same) break;
    if (c.kind == SectionChunk::interior_granules && section.read(c, chunk)) same = holds(reader.parcel(chunk));
  }
  section.agree();
  return !bed_.ranks.any(!same);
}

SectionCounts Snapshot::take_as_it_was(SectionReader& section) {
  ChunkReader reader(bed_, same_walls_);
  SectionCounts taken;
  SectionChunk chunk;
  for (const ChunkPlace& c : section.list(static_cast<std::size_t>(bed_.ranks.me))) {
    if (!section.read(c, chunk)) break;
    taken.add(c.kind, c.granules);
    if (c.kind == SectionChunk::part)
      parcels_.begin_as_it_was(*reader.part(chunk).sender);
    else
      parcels_.take_as_it_was(reader.parcel(chunk));
  }
  section.agree();
  parcels_.end_as_it_was();
  return taken;
}

}  // namespace solidcull
