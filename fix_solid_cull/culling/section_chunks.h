// A rank's part of what is culled as chunks of a restart file's section, and the other way. The format is in store_section.h.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "bed.h"
#include "cover.h"
#include "parcels.h"
#include "store_section.h"

namespace solidcull {

/// Gives the chunks of this rank one by one. Nothing may change meanwhile. Local.
class ChunkSource {
 public:
  ChunkSource(const Bed& bed, const Cover& cover);
  /// False after the last one.
  bool next(SectionChunk& chunk);
  std::uint64_t interior() const { return interior_; }  ///< granules and contacts so far
  std::uint64_t interface_granules() const { return interface_; }
  std::uint64_t contacts() const { return contacts_.rows + contacts_before_; }
  /// A number that names what the chunks of this rank hold; costs a walk through all granules.
  static std::uint64_t identity(const Bed& bed);

 private:
  void part(SectionChunk& chunk);
  void interface_block(SectionChunk& chunk);
  void interior_block(SectionChunk& chunk);
  std::uint64_t* granule(WordTable& table, StoredGranule g) const;
  void begin_block();
  void contacts_of(std::int64_t tag);
  void contact(std::int64_t low, std::int64_t high, const double* history);

  const Bed& bed_;
  const Cover& cover_;
  bool part_given_ = false;
  int atom_ = 0, slot_ = 0;
  std::vector<int> bodies_;  // their numbers, ascending
  WordTable granules_, contacts_;
  std::map<int, WordTable> by_length_;  // of the record
  std::vector<double> history_;
  std::uint64_t interior_ = 0, interface_ = 0, contacts_before_ = 0, graph_contacts_ = 0;
};

/// Reads chunks in the order of the file. Local.
class ChunkReader {
 public:
  explicit ChunkReader(const Bed& bed) : bed_(bed) {}

  struct Head {
    Box own;  ///< the subdomain of the rank that wrote
    std::shared_ptr<const Sender> sender;
  };
  /// Of a chunk of kind `part`; those that follow are of this part.
  const Head& part(const SectionChunk& chunk);
  /// Of the other kinds; valid until the next chunk is read.
  const Parcel& parcel(const SectionChunk& chunk);

 private:
  void read_contacts(const WordTable& table);
  void read_granules(const WordTable& table, const double* numbers);

  const Bed& bed_;
  Head head_;
  std::vector<int> layout_;
  Parcel parcel_;
  WordTable interface_, contacts_, interior_;
  std::vector<double> histories_;
  std::vector<std::vector<double>> records_;  // of the tables of interior granules
};

}  // namespace solidcull
