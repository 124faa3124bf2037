// The section of a restart file that holds what is culled: it stands at the end, behind what the engine reads.
//
// All numbers are as the machine keeps them: words of 64 bits, doubles by their bits. The section is
//   its beginning: two words, the mark `begins` and the section's identity;
//   its chunks: a head of five words - kind, rank that wrote it, granules in it, bytes that follow (a multiple of 8), check sum
//     of those and of the four words before - and the bytes;
//   for each rank that wrote a list of its chunks: four words for each - where its head stands, bytes with the head, kind,
//     granules in it - and the check sum of these words;
//   the table of parts: four words for each rank that wrote - where its list stands, how many chunks, how many bytes these have,
//     how many granules;
//   its end: nine words - the mark `ends`, the identity, how many bytes the section has (these words too), how many parts,
//     chunks, interior granules, interface granules, contacts, and the check sum of the table of parts and the eight before.
// Where something stands is counted in bytes from the beginning of the section. The identity stands in the fix's state in the
// file's head too (snapshot.h), so that a section of another file is known.
//
// Each rank writes its own chunks and their list, all at once, round by round: so chunks of several ranks stand in turns. Who
// reads opens the table, then the lists of those parts that concern it, then chunks.
//
// A chunk's bytes are tables (packed_columns.h), one after the other, filled up with zeros. Each rank that wrote has one chunk of
// kind `part`, then its chunks of `interface_granules` and of `interior_granules`. Tables of a part:
//   one row: the rank's subdomain (lowest x y z, highest), the observers of Cover (each: origin, quaternion x y z w), a box in
//     the world that holds the centres of its interior granules (lowest x y z, highest);
//   one column: the characters of the texts of column layouts, one line each, in the order of their numbers;
//   one row for each body of the rank: its numbers, as doubles, in the order of SolidBody::each_number();
//   one column, where there are any: likewise the names of meshes that report their load.
// Tables of granules:
//   interface granules: tag, body (its row in the part), their numbers in the order of StoredGranule::each_number(), the whole
//     ones and flags as whole numbers;
//   contacts: the lower tag, the higher one, body in whose frame the history is, whether it has a history, the history as the
//     lower tag sees it;
//   how many further tables follow (one word), each of interior granules whose engine records are equally long: the same, and
//     the record;
//   with these, where there are any: what walls press on them: tag, mesh, element, force, torque, as in WallLoad; those of one
//     granule in a row, the last one first. The mesh by its place in the part's names.
// A contact stands with the one of its granules that comes later in this rank's chunks, or with the one that is on this rank; a
// contact across ranks stands with either rank.
#pragma once

#include <cstdint>
#include <cstdio>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "packed_columns.h"
#include "ports.h"

namespace solidcull {

struct SectionChunk {
  /// more_bodies: not in files; see ChunkShares.
  enum Kind : std::uint64_t { part = 1, interface_granules, interior_granules, more_bodies };
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

  /// With its head, at the end of `to`.
  void pack(std::vector<char>& to) const;
  /// The chunk that begins at `at`; returns where it ends, nullptr for what is none, or is damaged.
  const char* unpack(const char* at, const char* end);
};

struct SectionCounts {
  std::uint64_t chunks = 0, interior = 0, interface_granules = 0, contacts = 0;

  void add(std::uint64_t kind, std::uint64_t granules) {
    ++chunks;
    if (kind == SectionChunk::interior_granules) interior += granules;
    if (kind == SectionChunk::interface_granules) interface_granules += granules;
  }
};

/// Of n bytes, a multiple of 8: sees any word that is another, and words in another order.
std::uint64_t section_sum(const char* bytes, std::size_t n);

/// Where a chunk stands, a row of its rank's list. Bytes.
struct ChunkPlace {
  std::uint64_t at, size, kind, granules;
};

/// Appends a section to a file, all ranks at once. Collective.
class SectionWriter {
 public:
  SectionWriter(const Ranks& ranks, const std::string& file, std::uint64_t identity);
  /// The next one of this rank; an empty one where it has no more. False when no rank had one.
  bool put(const SectionChunk& chunk);
  /// The section is whole and on the disk; `counts`: of what this rank wrote. InputError where it could not be written.
  void close(const SectionCounts& counts);

 private:
  std::uint64_t write_in_turn(const std::vector<char>& bytes);

  const Ranks& ranks_;
  std::unique_ptr<SharedFile> file_;
  std::uint64_t identity_, written_ = 0;  // bytes, of all ranks
  std::vector<ChunkPlace> chunks_;        // of this rank
};

/// Reads it: each rank what it asks for. InputError for a file that is not whole, is damaged, or whose section is that of another
/// file; alike on all ranks, whichever of them finds it.
class SectionReader {
 public:
  /// file: rank 0 knows it. Collective.
  SectionReader(const Ranks& ranks, const std::string& file, std::uint64_t identity);
  ~SectionReader();
  SectionReader(const SectionReader&) = delete;

  struct Part {
    std::uint64_t list, chunks, bytes, granules;
  };
  const SectionCounts& counts() const { return counts_; }
  const std::vector<Part>& parts() const { return parts_; }

  /// A part's chunks. Empty where something is wrong, see agree(). Local.
  std::vector<ChunkPlace> list(std::size_t part);
  /// False, and an empty chunk, where something is wrong, see agree(). Local.
  bool read(const ChunkPlace& place, SectionChunk& chunk);
  /// The next read() of this place gives it again, without the file.
  void keep(const ChunkPlace& place, SectionChunk&& chunk) { kept_[place.at] = std::move(chunk); }
  /// Throws where any rank found something wrong. Collective.
  void agree();

  /// A chunk, and the part that it is of.
  struct Dealt {
    std::size_t part;
    ChunkPlace place;
    ChunkPlace of_part;  ///< the chunk with its bodies
  };
  /// All chunks of the section are dealt out to the ranks, about as many bytes to each: those of this one. Local, see agree().
  std::vector<Dealt> dealt();

 private:
  std::string open(std::uint64_t identity, std::vector<std::uint64_t>& words);
  bool fetch(std::uint64_t at, void* to, std::size_t n);

  const Ranks& ranks_;
  std::string name_, wrong_;
  std::FILE* file_ = nullptr;
  std::uint64_t begin_ = 0, end_of_chunks_ = 0;  // in the file; counted from there
  SectionCounts counts_;
  std::vector<Part> parts_;
  std::map<std::uint64_t, SectionChunk> kept_;  // by place
};

}  // namespace solidcull
