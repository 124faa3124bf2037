// What is culled in a restart file, to the ranks that own it now, whoever wrote it.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "bed.h"
#include "chunk_shares.h"
#include "parcels.h"
#include "section_chunks.h"
#include "store_section.h"
#include "tag_owners.h"

namespace solidcull {

/// Chunks are dealt out evenly. Round by round each rank reads one of its own, and sends each granule in it to its owner: the
/// rank that has its atom, or its place. So each chunk is read once, and no rank gets more than is its own. Contacts go with
/// their granules; those between ranks of which only one has heard so far follow at the end.
class SectionDelivery {
 public:
  /// same_walls: what granules press on walls is taken up too.
  SectionDelivery(Bed& bed, Parcels& parcels, SectionReader& section, bool same_walls);
  /// Returns what this rank read. InputError for a damaged file. Collective.
  SectionCounts take_all();

 private:
  using Loose = ChunkShares::Loose;
  void read(const SectionReader::Dealt& next);
  void exchange_shares();
  void take(int from, const ChunkShare& share, std::uint64_t part);
  void exchange_contacts();

  Bed& bed_;
  const bool same_walls_;
  Parcels& parcels_;
  SectionReader& section_;
  TagOwners atoms_;
  ChunkShares shares_;
  SectionCounts read_;
  std::size_t part_ = none;  // of the chunk that was read last
  bool has_granules_ = false;
  std::map<int, ChunkReader> readers_;  // by the rank that reads and sends
  static constexpr std::size_t none = static_cast<std::size_t>(-1);
};

}  // namespace solidcull
