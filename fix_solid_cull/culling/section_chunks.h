// A rank's part of what is culled as chunks of a restart file's section, and the other way. The format is in store_section.h.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "bed.h"
#include "cover.h"
#include "flat_map.h"
#include "parcels.h"
#include "store_section.h"

namespace solidcull {

/// The tables of a chunk of kind `part`, and of `more_bodies` (see ChunkShares), which has the bodies alone.
struct PartTables {
  WordTable head, layouts, meshes, bodies;
  void read(const SectionChunk& chunk);
  void append_to(SectionChunk& chunk) const;
};

/// The tables of a chunk of granules.
struct ChunkTables {
  WordTable interface_granules, contacts, wall_loads;
  std::vector<WordTable> interior;
  void read(const SectionChunk& chunk);
  void append_to(SectionChunk& chunk) const;
  std::size_t granules() const;
};

/// What others must know of the columns of these tables.
namespace chunk_columns {
constexpr std::size_t granule_tag = 0, granule_body = 1;
constexpr std::size_t low = 0, high = 1, contact_body = 2, known = 3, history = 4;
constexpr std::size_t load_tag = 0, load_mesh = 1, load_element = 2, load_force = 3, load_torque = 6, load_columns = 9;
}  // namespace chunk_columns

/// Of a row of interface or interior granules: see StoredGranule::home().
Vec3 granule_home(const std::uint64_t* row);

/// Gives the chunks of this rank one by one. Nothing may change meanwhile. Local.
class ChunkSource {
 public:
  ChunkSource(const Bed& bed, const Cover& cover);
  /// False after the last one.
  bool next(SectionChunk& chunk);
  /// Granules and contacts so far.
  SectionCounts counts() const {
    SectionCounts so_far = counts_;
    so_far.contacts = tables_.contacts.rows + contacts_before_;
    return so_far;
  }
  /// A number that names what the chunks of this rank hold; costs a walk through all granules.
  static std::uint64_t identity(const Bed& bed);

 private:
  void part(SectionChunk& chunk);
  void interface_block(SectionChunk& chunk);
  void interior_block(SectionChunk& chunk);
  void give(std::uint64_t kind, SectionChunk& chunk);
  std::uint64_t* granule(WordTable& table, StoredGranule g) const;
  void begin_block();
  void contacts_of(std::int64_t tag);
  void contact(std::int64_t low, std::int64_t high, const double* history);

  const Bed& bed_;
  const Cover& cover_;
  bool part_given_ = false;
  int atom_ = 0, slot_ = 0;
  std::vector<int> bodies_;  // their numbers, ascending
  ChunkTables tables_;
  std::map<int, std::size_t> by_length_;  // of the record: which table
  std::vector<double> history_;
  SectionCounts counts_;
  std::uint64_t contacts_before_ = 0, graph_contacts_ = 0;
};

/// Reads the chunks of one part. Local.
class ChunkReader {
 public:
  /// same_walls: what granules press on walls is read too.
  ChunkReader(const Bed& bed, bool same_walls) : bed_(bed), same_walls_(same_walls) {}

  struct Head {
    Box own;     ///< the subdomain of the rank that wrote
    Box places;  ///< holds its interior granules
    std::shared_ptr<const Sender> sender;
  };
  const Head& part(const SectionChunk& chunk);
  const Head& part(const PartTables& tables, std::uint64_t rank);
  /// Behind those that are known.
  void more_bodies(const WordTable& table);
  /// Valid until the next chunk is read.
  const Parcel& parcel(const SectionChunk& chunk);
  const Parcel& parcel(const ChunkTables& tables);
  const Sender& sender() const { return *sender_; }

 private:
  void read_contacts(const WordTable& table);
  void read_granules(const WordTable& table, const double* numbers);
  void index_wall_loads(const WordTable& table);
  std::vector<WallLoad> wall_loads_of(std::int64_t tag) const;

  const Bed& bed_;
  const bool same_walls_;
  Head head_;
  std::shared_ptr<Sender> sender_;
  std::vector<int> layout_;
  std::vector<int> mesh_;             // of the file: its number here
  FlatMap<int> first_load_;           // of a granule: its row
  const WordTable* loads_ = nullptr;  // of this chunk
  Parcel parcel_;
  ChunkTables tables_;
  std::vector<double> histories_;
  std::vector<std::vector<double>> records_;  // of the tables of interior granules
};

}  // namespace solidcull
