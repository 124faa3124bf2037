// A contact history in few bits, for granules that wait in a compact store (theory.md#granule-store).
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "sphere.h"
#include "word_view.h"

namespace solidcull {

/// Packs the history of a contact into words of 64 bits: 16 bits that tell the partner, and 24 for each vector or other number.
/// Of a vector what lies in the plane of contact is kept, to 1/256 of its largest component there; other numbers to 2^-16.
class PackedHistory {
 public:
  /// width: numbers of a history; vectors: first indices of those that are vectors of space.
  void set_layout(std::size_t width, const std::vector<int>& vectors);
  /// Words of a packed history.
  std::size_t words() const { return units_.size() <= 2 ? 1 : 1 + (units_.size() - 1) / 2; }

  /// Appends the history of a contact with `partner`, which lies in the direction `normal`, to `to`; nothing if it is all zero.
  void pack(std::int64_t partner, const double* history, const Vec3& normal, std::vector<std::uint64_t>& to) const;
  /// Writes it to `history`, as it was packed; in the frame of `normal`, which is that of its packing.
  void unpack(const std::uint64_t* packed, const Vec3& normal, double* history) const;
  /// Two partners whose packed histories find() would confuse.
  static bool alike(std::int64_t a, std::int64_t b);
  /// Where that of `partner` begins in a list of packed histories, its size if there is none.
  std::size_t find(WordView list, std::int64_t partner) const;

 private:
  struct Unit {
    int first;
    bool vector;
  };
  std::vector<Unit> units_;
};

}  // namespace solidcull
