// A chunk of a restart file's section, shared out among the ranks that own its granules now.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "bed.h"
#include "flat_map.h"
#include "section_chunks.h"

namespace solidcull {

/// What one rank gets of a chunk.
struct ChunkShare {
  bool begins = false;  ///< a part: its head is with it
  PartTables part;      ///< bodies that this rank has not got yet
  ChunkTables granules;
};

/// Shares out chunk by chunk. A granule goes to one rank. A contact goes with it, and with its partner if that is in the same
/// chunk. A body goes once to each rank that gets granules of it, where it is known by the order in which bodies came. Local.
class ChunkShares {
 public:
  explicit ChunkShares(const Bed& bed) : bed_(bed), reader_(bed, false) {}

  /// A chunk of kind `part`; those that follow are of it.
  void begin(const SectionChunk& part);
  /// One of granules.
  void open(const SectionChunk& chunk) { chunk_.read(chunk); }
  std::vector<std::int64_t> interface_tags() const;
  /// atoms_on: for each of these, the rank that has its atom; TagOwners::nobody where its place decides, as it does for interior
  /// granules.
  std::map<int, ChunkShare> shares(const std::vector<int>& atoms_on);

  /// A contact whose history is in the world, as the lower tag sees it: numbers of low, high, whether it has one, the history.
  using Loose = std::vector<double>;
  /// Contacts of which no granule is in its chunk, since the beginning.
  const std::vector<Loose>& without_granules() const { return without_granules_; }

 private:
  struct Known {
    bool begun = false;
    FlatMap<int> bodies;  // of the part: their numbers there, counted from 1
  };
  int owner(const std::uint64_t* granule) const;
  void share_granule(const std::uint64_t* row, std::size_t columns, int rank, WordTable& to);
  void share_contacts();
  std::uint64_t body_number(int rank, std::uint64_t body);
  Loose loose(const std::uint64_t* row) const;

  const Bed& bed_;
  ChunkReader reader_;
  PartTables part_;
  ChunkTables chunk_;
  std::map<int, Known> known_;  // by rank
  std::map<int, ChunkShare> shares_;
  FlatMap<int> rank_of_;  // granules of this chunk, by tag
  std::vector<Loose> without_granules_;
};

/// As one message, and back. of_rank: that wrote the part.
std::vector<char> packed(const ChunkShare& share, std::uint64_t of_rank);
/// Returns the rank that wrote the part.
std::uint64_t unpack(const std::vector<char>& message, ChunkShare& share);

}  // namespace solidcull
