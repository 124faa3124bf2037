// Rows of 64-bit words that are much alike, kept as what differs from a pattern: lossless, to the bit.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <utility>
#include <vector>

#include "chunked_array.h"
#include "word_view.h"

namespace solidcull {

/// Each row is kept as a mask of the words in which it differs from a pattern, and those words. A pattern's word is a number, or
/// "the same as key word k": the row's first `keys` words (a granule's tag, radius, mass) come back in its engine record. Word 0
/// is not kept at all: who asks for a row knows it. Masks are shared between rows, so that a row costs 8 bytes for the number of
/// its shape and of its place, and 8 for each word that differs. Behind a row may stand a tail, words that are like no others: 8
/// bytes each.
class PackedRows {
 public:
  struct Place {
    std::uint32_t shape, blob;
  };
  static constexpr int keys = 3;

  Place put(const std::uint64_t* row, int length, WordView tail) {
    Key key = length <= longest ? best_key(row, length) : Key{none, length, 0, {}};
    key.tail = static_cast<int>(tail.size());
    std::uint64_t* blob = nullptr;
    const Place place = new_place(key, blob);
    if (key.pattern == none)
      blob = std::copy(row + 1, row + length, blob);
    else
      each_bit(key.mask, [&](int i) { *blob++ = row[i]; });
    std::copy(tail.begin(), tail.end(), blob);
    return place;
  }

  /// Another tail, which is not that of this row, behind the same row: where that is now.
  Place with_tail(Place p, WordView tail) {
    Key key = shapes_[p.shape].key;
    const std::uint64_t* const old = blob_of(p);
    const int own = shapes_[p.shape].words - key.tail;
    key.tail = static_cast<int>(tail.size());
    std::uint64_t* blob = nullptr;
    const Place place = new_place(key, blob);
    std::copy(old, old + own, blob);
    std::copy(tail.begin(), tail.end(), blob + own);
    drop(p);
    return place;
  }

  int length(Place p) const { return shapes_[p.shape].key.length; }  ///< without the tail
  /// Stays where it is until the row is dropped.
  WordView tail(Place p) const {
    const Shape& shape = shapes_[p.shape];
    return {blob_of(p) + shape.words - shape.key.tail, static_cast<std::size_t>(shape.key.tail)};
  }

  /// The first `count` words; row[0] is the caller's and is read, all others are written.
  void get(Place p, std::uint64_t* row, int count) const {
    const Shape& shape = shapes_[p.shape];
    const std::uint64_t* blob = blob_of(p);
    if (shape.key.pattern == none) {
      std::copy(blob, blob + count - 1, row + 1);
      return;
    }
    const Pattern& pattern = patterns_[shape.key.pattern];
    for (int i = 1; i < count; ++i) row[i] = bit(shape.key.mask, i) ? *blob++ : pattern.words[i];
    for (const auto& [i, from] : pattern.repeats)
      if (i < count && !bit(shape.key.mask, i)) row[i] = row[from];
  }

  /// The words from `first` to before `last`, given word 0.
  void get_some(Place p, std::uint64_t word_0, int first, int last, std::uint64_t* out) const {
    const Shape& shape = shapes_[p.shape];
    const std::uint64_t* blob = blob_of(p);
    if (shape.key.pattern == none) {
      for (int i = first; i < last; ++i) out[i - first] = i == 0 ? word_0 : blob[i - 1];
      return;
    }
    const Mask& mask = shape.key.mask;
    const Pattern& pattern = patterns_[shape.key.pattern];
    blob += bits_below(mask, first);
    for (int i = first; i < last; ++i) out[i - first] = bit(mask, i) ? *blob++ : i == 0 ? word_0 : pattern.words[i];
    for (const auto& [i, from] : pattern.repeats)
      if (i >= first && i < last && !bit(mask, i)) get_some(p, word_0, from, from + 1, out + (i - first));
  }

  /// Word 1, without a look at the blob where the pattern has it.
  std::uint64_t word_1(Place p) const {
    const Shape& shape = shapes_[p.shape];
    if (shape.key.pattern == none || bit(shape.key.mask, 1)) return *pools_[shape.words].rows.row(p.blob);
    return patterns_[shape.key.pattern].words[1];
  }

  void drop(Place p) {
    Shape& shape = shapes_[p.shape];
    if (shape.words) {
      Pool& pool = pools_[shape.words];
      *pool.rows.row(p.blob) = pool.first_free;
      pool.first_free = p.blob;
    }
    if (shape.key.pattern != none) --patterns_[shape.key.pattern].uses;
    if (--shape.uses == 0) {
      number_of_.erase(shape.key);
      free_shapes_.push_back(p.shape);
    }
  }

  std::size_t memory_bytes() const {
    constexpr std::size_t node = sizeof(std::pair<const Key, std::uint32_t>) + 2 * sizeof(void*);  // of the map's usual make
    std::size_t bytes = shapes_.capacity() * sizeof(Shape) + free_shapes_.capacity() * sizeof(std::uint32_t) +
                        number_of_.size() * node + number_of_.bucket_count() * sizeof(void*) +
                        families_.capacity() * sizeof(Family) + patterns_.capacity() * sizeof(Pattern) +
                        pools_.capacity() * sizeof(Pool);
    for (const Family& f : families_) {
      bytes += f.patterns.capacity() * sizeof(f.patterns[0]) + f.recent.capacity() * sizeof(Row);
      for (const Row& row : f.recent) bytes += row.capacity() * sizeof(row[0]);
    }
    for (const Pattern& p : patterns_)
      bytes += p.words.capacity() * sizeof(p.words[0]) + p.repeats.capacity() * sizeof(p.repeats[0]);
    for (const Pool& p : pools_) bytes += p.rows.memory_bytes();
    return bytes;
  }

 private:
  static constexpr int longest = 256;  // words; a longer row is kept as it is
  static constexpr std::size_t patterns_per_length = 32;
  static constexpr unsigned look_at_all_every = 16;  // rows
  static constexpr std::size_t recent_rows = 4;
  static constexpr int none = -1;
  static constexpr std::size_t chunk_bytes = 2048;  // of the blobs of one length, of which there are many
  static constexpr std::uint32_t no_blob = UINT32_MAX;

  using Mask = std::array<std::uint64_t, longest / 64>;
  struct Key {
    int pattern = none, length = 0, tail = 0;
    Mask mask{};
    bool operator==(const Key& o) const { return pattern == o.pattern && length == o.length && tail == o.tail && mask == o.mask; }
  };
  struct HashOfKey {
    std::size_t operator()(const Key& key) const {
      std::uint64_t h = static_cast<std::uint64_t>(key.pattern) << 32 | static_cast<std::uint32_t>(key.length);
      h ^= static_cast<std::uint64_t>(key.tail) << 20;
      for (const std::uint64_t m : key.mask) h = (h ^ m ^ (h >> 29)) * 0x9e3779b97f4a7c15ULL;
      return static_cast<std::size_t>(h ^ (h >> 32));
    }
  };
  struct Shape {
    Key key;
    int words = 0;  // in the blob, its tail included
    std::uint32_t uses = 0;
  };
  struct Pattern {
    std::vector<std::uint64_t> words;
    std::vector<std::pair<std::uint16_t, std::uint16_t>> repeats;  // word, key word
    std::uint32_t uses = 0;
    std::uint32_t latest = 0;  // of its shapes
    int usual = 0;             // how many words of a row differ when it suits
  };
  using Row = std::vector<std::uint64_t>;
  /// Rows of one length.
  struct Family {
    std::vector<int> patterns;  // most recent first
    std::vector<Row> recent;    // in no order
    unsigned rows = 0;
  };
  struct Pool {
    explicit Pool(std::size_t words) : rows(words, chunk_bytes) {}
    ChunkedArray<std::uint64_t> rows;
    std::uint32_t first_free = no_blob;
  };

  static bool bit(const Mask& m, int i) { return m[i >> 6] >> (i & 63) & 1; }
  static int bits_below(const Mask& m, int i) {
    int n = 0;
    for (int w = 0; w < i >> 6; ++w) n += __builtin_popcountll(m[w]);
    return i & 63 ? n + __builtin_popcountll(m[i >> 6] & ((std::uint64_t{1} << (i & 63)) - 1)) : n;
  }
  static int bits(const Mask& m) {
    int n = 0;
    for (const std::uint64_t w : m) n += __builtin_popcountll(w);
    return n;
  }
  template <class Visit>
  static void each_bit(const Mask& m, Visit visit) {
    for (int w = 0; w < longest / 64; ++w)
      for (std::uint64_t left = m[w]; left; left &= left - 1) visit(64 * w + __builtin_ctzll(left));
  }

  static void make_pattern(Pattern& p, const std::uint64_t* row, int length) {
    p.words.assign(row, row + length);
    p.repeats.clear();
    for (int i = keys; i < length; ++i) {
      if (row[i] == 0) continue;
      int k = 0;
      while (k < keys && row[i] != row[k]) ++k;
      if (k < keys) p.repeats.emplace_back(i, k);
    }
  }
  static Mask difference(const Pattern& p, const std::uint64_t* row, int length) {
    Mask m{};
    for (int w = 0; 64 * w < length; ++w) {
      std::uint64_t differs = 0;
      for (int i = 64 * w; i < std::min(length, 64 * (w + 1)); ++i)
        differs |= static_cast<std::uint64_t>(row[i] != p.words[i]) << (i & 63);
      m[w] = differs;
    }
    m[0] &= ~std::uint64_t{1};
    for (const auto& [i, from] : p.repeats) {
      const std::uint64_t at = std::uint64_t{1} << (i & 63);
      m[i >> 6] = row[i] == row[from] ? m[i >> 6] & ~at : m[i >> 6] | at;
    }
    return m;
  }

  static Mask difference_all(int length) {
    Mask m{};
    for (int i = 1; i < length; ++i) m[i >> 6] |= std::uint64_t{1} << (i & 63);
    return m;
  }

  /// The first pattern that suits the row as well as it usually suits; else, and now and then, the best of all. A row that is
  /// more like a recent one than like any pattern makes that one a pattern: a new time step of locking, another kind of
  /// granule.
  Key best_key(const std::uint64_t* row, int length) {
    if (families_.size() <= static_cast<std::size_t>(length)) families_.resize(length + 1);
    Family& family = families_[length];
    const bool look_at_all = ++family.rows % look_at_all_every == 0;
    std::size_t best = 0;
    int fewest = length;
    Mask mask{};
    bool suits = false;
    for (std::size_t k = 0; k < family.patterns.size() && !suits; ++k) {
      const Pattern& p = patterns_[family.patterns[k]];
      const Mask m = difference(p, row, length);
      const int n = bits(m);
      if (n >= fewest) continue;
      best = k;
      fewest = n;
      mask = m;
      suits = n <= p.usual && !look_at_all;
    }
    if (suits) {
      patterns_[family.patterns[best]].usual = fewest;
    } else {
      Pattern candidate;
      Mask unlike = difference_all(length);
      for (const std::vector<std::uint64_t>& recent : family.recent) {
        Pattern like;
        make_pattern(like, recent.data(), length);
        const Mask m = difference(like, row, length);
        if (bits(m) >= bits(unlike)) continue;
        candidate = std::move(like);
        unlike = m;
      }
      if (2 * std::min(bits(unlike), fewest) > length) {
        make_pattern(candidate, row, length);
        unlike = Mask{};
      }
      if (bits(unlike) < fewest && room_in(family)) {
        take_up(family, std::move(candidate));
        best = 0;
        mask = unlike;
      } else {
        int& usual = patterns_[family.patterns[best]].usual;
        usual = std::min(fewest, usual + 1);
      }
    }
    std::rotate(family.patterns.begin(), family.patterns.begin() + best, family.patterns.begin() + best + 1);
    if (family.recent.size() < recent_rows)
      family.recent.emplace_back(row, row + length);
    else
      family.recent[family.rows % recent_rows].assign(row, row + length);
    return {family.patterns.front(), length, 0, mask};
  }
  bool room_in(const Family& family) const {
    return family.patterns.size() < patterns_per_length ||
           std::any_of(family.patterns.begin(), family.patterns.end(), [&](int p) { return patterns_[p].uses == 0; });
  }
  /// The new pattern becomes the first of its family, in place of one that nothing uses if there is one.
  void take_up(Family& family, Pattern&& pattern) {
    auto place = std::find_if(family.patterns.begin(), family.patterns.end(), [&](int p) { return patterns_[p].uses == 0; });
    if (place == family.patterns.end()) {
      place = family.patterns.insert(place, static_cast<int>(patterns_.size()));
      patterns_.emplace_back();
    }
    patterns_[*place] = std::move(pattern);
    std::rotate(family.patterns.begin(), place, place + 1);
  }

  std::uint32_t shape_of(const Key& key) {
    if (key.pattern != none) {
      const std::uint32_t latest = patterns_[key.pattern].latest;
      if (latest < shapes_.size() && shapes_[latest].uses && shapes_[latest].key == key) return latest;
    }
    const auto [found, fresh] = number_of_.emplace(key, 0);
    if (fresh) {
      if (free_shapes_.empty()) {
        found->second = static_cast<std::uint32_t>(shapes_.size());
        shapes_.emplace_back();
      } else {
        found->second = free_shapes_.back();
        free_shapes_.pop_back();
      }
      shapes_[found->second] = {key, key.tail + (key.pattern == none ? key.length - 1 : bits(key.mask)), 0};
    }
    if (key.pattern != none) patterns_[key.pattern].latest = found->second;
    return found->second;
  }
  /// Room for one more row of this shape; blob: where its words go, nullptr if it has none.
  Place new_place(const Key& key, std::uint64_t*& blob) {
    const std::uint32_t number = shape_of(key);
    Shape& shape = shapes_[number];
    ++shape.uses;
    if (key.pattern != none) ++patterns_[key.pattern].uses;
    const Place place{number, shape.words ? new_blob(shape.words) : 0};
    blob = blob_of(place);
    return place;
  }
  std::uint64_t* blob_of(Place p) {
    const int words = shapes_[p.shape].words;
    return words ? pools_[words].rows.row(p.blob) : nullptr;
  }
  const std::uint64_t* blob_of(Place p) const { return const_cast<PackedRows*>(this)->blob_of(p); }
  std::uint32_t new_blob(int words) {
    while (pools_.size() <= static_cast<std::size_t>(words)) pools_.emplace_back(pools_.size());
    Pool& pool = pools_[words];
    if (pool.first_free == no_blob) return static_cast<std::uint32_t>(pool.rows.append());
    const std::uint32_t blob = pool.first_free;
    pool.first_free = static_cast<std::uint32_t>(*pool.rows.row(blob));
    return blob;
  }

  std::vector<Shape> shapes_;
  std::vector<std::uint32_t> free_shapes_;
  std::unordered_map<Key, std::uint32_t, HashOfKey> number_of_;  // of the shapes in use
  std::vector<Pattern> patterns_;
  std::vector<Family> families_;  // by length
  std::vector<Pool> pools_;       // by words per blob
};

}  // namespace solidcull
