// The section of a restart file that holds what is culled: it stands at the end, behind what the engine reads.
//
// All numbers are as the machine keeps them: words of 64 bits, doubles by their bits. The section is
//   its beginning: two words, the mark `begins` and the section's identity;
//   its chunks: a head of five words - kind, rank that wrote it, granules in it, bytes that follow (a multiple of 8), check sum
//     of those and of the four words before - and the bytes;
//   its end: eight words - the mark `ends`, the identity, how many bytes the section has (these eight words too), how many
//     chunks, how many interior granules, how many interface granules, how many contacts, and the check sum of the seven before.
// The identity stands in the fix's state in the file's head too (snapshot.h), so that a section of another file is known.
//
// A chunk's bytes are tables (packed_columns.h), one after the other, filled up with zeros. Each rank that wrote has one chunk of
// kind `part`, then its chunks of `interface_granules` and of `interior_granules`, ranks in their order. Tables of a part:
//   one row: the rank's subdomain (lowest x y z, highest), the observers of Cover (each: origin, quaternion x y z w);
//   one column: the characters of the texts of column layouts, one line each, in the order of their numbers;
//   one row for each body of the rank: its numbers, as doubles, in the order of SolidBody::each_number().
// Tables of granules:
//   interface granules: tag, body (its row in the part), their numbers in the order of StoredGranule::each_number(), the whole
//     ones and flags as whole numbers;
//   contacts: the lower tag, the higher one, body in whose frame the history is, whether it has a history, the history as the
//     lower tag sees it;
//   how many further tables follow (one word), each of interior granules whose engine records are equally long: the same, and
//     the record.
// A contact stands with the one of its granules that comes later in this rank's chunks, or with the one that is on this rank; a
// contact across ranks stands with either rank.
#pragma once

#include <cstdint>
#include <cstdio>
#include <string>
#include <vector>

#include "packed_columns.h"
#include "ports.h"

namespace solidcull {

struct SectionChunk {
  enum Kind : std::uint64_t { part = 1, interface_granules, interior_granules };
  std::uint64_t kind = part, rank = 0, granules = 0;
  std::vector<char> bytes;

  void begin(std::uint64_t of_kind, std::uint64_t of_rank, std::uint64_t so_many) {
    kind = of_kind;
    rank = of_rank;
    granules = so_many;
    bytes.clear();
  }
  void append(const WordTable& table) { pack_columns(table, bytes); }
  void append(std::uint64_t word) {
    const auto* const as_bytes = reinterpret_cast<const char*>(&word);
    bytes.insert(bytes.end(), as_bytes, as_bytes + sizeof word);
  }
};

struct SectionCounts {
  std::uint64_t chunks = 0, interior = 0, interface_granules = 0, contacts = 0;
};

/// Of n bytes, a multiple of 8: sees any word that is another, and words in another order.
std::uint64_t section_sum(const char* bytes, std::size_t n);

/// Appends a section to a file. Collective; rank 0 has the file.
class SectionWriter {
 public:
  SectionWriter(const Ranks& ranks, const std::string& file, std::uint64_t identity);
  ~SectionWriter();
  SectionWriter(const SectionWriter&) = delete;
  /// Of one rank; the others give an empty one.
  void put(const SectionChunk& chunk);
  /// The section is whole and in the file. InputError where it could not be written.
  void close(const SectionCounts& counts);

 private:
  void write(const void* from, std::size_t n);

  const Ranks& ranks_;
  std::FILE* file_ = nullptr;
  std::uint64_t identity_, bytes_ = 0, chunks_ = 0;
  int error_ = 0;
};

/// Reads it in a stream: rank 0 reads, all ranks see each chunk. Collective. InputError for a file that is not whole, is damaged,
/// or whose section is that of another file; alike on all ranks.
class SectionReader {
 public:
  SectionReader(const Ranks& ranks, const std::string& file, std::uint64_t identity);
  ~SectionReader();
  SectionReader(const SectionReader&) = delete;

  const SectionCounts& counts() const { return counts_; }
  /// The next chunk: false at the end. wanted(chunk without bytes) says whether its bytes are to be read, alike on all ranks;
  /// they are empty else.
  template <class Wanted>
  bool next(SectionChunk& chunk, Wanted wanted) {
    if (!head(chunk)) return false;
    body(chunk, wanted(chunk));
    return true;
  }
  bool next(SectionChunk& chunk) {
    return next(chunk, [](const SectionChunk&) { return true; });
  }

 private:
  bool head(SectionChunk& chunk);
  void body(SectionChunk& chunk, bool wanted);
  void agree(const std::string& wrong);

  const Ranks& ranks_;
  std::string name_;
  std::FILE* file_ = nullptr;
  std::uint64_t left_ = 0, size_ = 0, sum_ = 0;  // bytes of chunks that are still to come; of this chunk
  std::uint64_t head_[4] = {};
  SectionCounts counts_;
};

}  // namespace solidcull
