#include "chunk_shares.h"

#include <algorithm>
#include <iterator>

#include "bits.h"
#include "tag_owners.h"

namespace solidcull {
namespace {

using namespace chunk_columns;

std::uint64_t* append_row(const std::uint64_t* row, std::size_t columns, WordTable& to) {
  if (to.rows == 0) to.clear(columns);
  return std::copy_n(row, columns, to.add_row()) - columns;
}

}  // namespace

void ChunkShares::begin(const SectionChunk& part) {
  part_.read(part);
  reader_.part(part_, part.rank);
  known_.clear();
}

std::vector<std::int64_t> ChunkShares::interface_tags() const {
  std::vector<std::int64_t> tags;
  for (std::size_t r = 0; r < chunk_.interface_granules.rows; ++r)
    tags.push_back(static_cast<std::int64_t>(chunk_.interface_granules.row(r)[granule_tag]));
  return tags;
}

int ChunkShares::owner(const std::uint64_t* g) const {
  return bed_.ranks.owner(reader_.sender().bodies.at(g[granule_body]).pose.to_world(granule_home(g)));
}

/// The body's number as this rank knows it; the body goes along if it does not.
std::uint64_t ChunkShares::body_number(int rank, std::uint64_t body) {
  Known& known = known_[rank];
  ChunkShare& share = shares_[rank];
  if (!known.begun) {
    share.begins = true;
    share.part.head = part_.head;
    share.part.layouts = part_.layouts;
    share.part.meshes = part_.meshes;
    known.begun = true;
  }
  int& number = known.bodies[static_cast<std::int64_t>(body)];
  if (number == 0) {
    if (body >= part_.bodies.rows) throw InternalError("a chunk of a restart file names a body that is not there");
    append_row(part_.bodies.row(body), part_.bodies.columns, share.part.bodies);
    number = static_cast<int>(known.bodies.size());
  }
  return static_cast<std::uint64_t>(number - 1);
}

void ChunkShares::share_granule(const std::uint64_t* row, std::size_t columns, int rank, WordTable& to) {
  append_row(row, columns, to)[granule_body] = body_number(rank, row[granule_body]);
  rank_of_[static_cast<std::int64_t>(row[granule_tag])] = rank;
}

std::map<int, ChunkShare> ChunkShares::shares(const std::vector<int>& atoms_on) {
  shares_.clear();
  rank_of_ = FlatMap<int>();
  for (std::size_t r = 0; r < chunk_.interface_granules.rows; ++r) {
    const std::uint64_t* const row = chunk_.interface_granules.row(r);
    const int rank = atoms_on[r] == TagOwners::nobody ? owner(row) : atoms_on[r];
    share_granule(row, chunk_.interface_granules.columns, rank, shares_[rank].granules.interface_granules);
  }
  for (const WordTable& table : chunk_.interior)
    for (std::size_t r = 0; r < table.rows; ++r) {
      const int rank = owner(table.row(r));
      std::vector<WordTable>& tables = shares_[rank].granules.interior;
      if (tables.empty() || tables.back().columns != table.columns) {
        tables.emplace_back();
        tables.back().clear(table.columns);
      }
      share_granule(table.row(r), table.columns, rank, tables.back());
    }
  share_contacts();
  for (std::size_t r = 0; r < chunk_.wall_loads.rows; ++r) {
    const std::uint64_t* const row = chunk_.wall_loads.row(r);
    if (const int* rank = rank_of_.find(static_cast<std::int64_t>(row[load_tag])))
      append_row(row, chunk_.wall_loads.columns, shares_[*rank].granules.wall_loads);
  }
  return std::move(shares_);
}

void ChunkShares::share_contacts() {
  const WordTable& contacts = chunk_.contacts;
  for (std::size_t r = 0; r < contacts.rows; ++r) {
    const std::uint64_t* const row = contacts.row(r);
    const int *a = rank_of_.find(static_cast<std::int64_t>(row[low])), *b = rank_of_.find(static_cast<std::int64_t>(row[high]));
    const auto to = [&](int rank) {
      append_row(row, contacts.columns, shares_[rank].granules.contacts)[contact_body] = body_number(rank, row[contact_body]);
    };
    if (a) to(*a);
    if (b && !(a && *a == *b)) to(*b);
    if (!a && !b) without_granules_.push_back(loose(row));
  }
}

auto ChunkShares::loose(const std::uint64_t* row) const -> Loose {
  const std::size_t width = bed_.solid.contacts().width();
  Loose contact{static_cast<double>(row[low]), static_cast<double>(row[high]), static_cast<double>(row[known])};
  std::transform(row + history, row + history + width, std::back_inserter(contact), number_of);
  if (row[known]) bed_.solid.contacts().turn(contact.data() + 3, reader_.sender().bodies.at(row[contact_body]).pose.turn());
  return contact;
}

std::vector<char> packed(const ChunkShare& share, std::uint64_t of_rank) {
  std::vector<char> message;
  SectionChunk chunk;
  chunk.begin(share.begins ? SectionChunk::part : SectionChunk::more_bodies, of_rank, 0);
  share.part.append_to(chunk);
  chunk.pack(message);
  chunk.begin(SectionChunk::interior_granules, of_rank, share.granules.granules());
  share.granules.append_to(chunk);
  chunk.pack(message);
  return message;
}

std::uint64_t unpack(const std::vector<char>& message, ChunkShare& share) {
  SectionChunk chunk;
  const char *at = message.data(), *const end = at + message.size();
  at = chunk.unpack(at, end);
  if (!at) throw InternalError("granules of a restart file came wrong from another rank");
  share.begins = chunk.kind == SectionChunk::part;
  share.part.read(chunk);
  if (chunk.unpack(at, end) != end) throw InternalError("granules of a restart file came wrong from another rank");
  share.granules.read(chunk);
  return chunk.rank;
}

}  // namespace solidcull
