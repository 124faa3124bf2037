// Contacts of a granule as words behind its row in an exact store: partners, and histories in fewer bits than they had
// (theory.md#granule-store).
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "flat_map.h"
#include "sphere.h"
#include "word_view.h"

namespace solidcull {

/// How a history becomes bits. A vector of space takes some 18 bits and 44 for each of its numbers in the plane of contact; what
/// stands out of that plane takes as many as it needs, none for what a contact model keeps in the plane. Each number is off by
/// 2e-13 of the vector's size at most, and comes back to the last bit when it is packed again. Numbers that are no vectors come
/// back to the bit. What is 0 takes one bit.
class HistoryBits {
 public:
  struct Unit {
    int first;
    bool vector;
  };
  /// width: numbers of a history; vectors: first indices of those that are vectors of space.
  void set_layout(std::size_t width, const std::vector<int>& vectors);
  const std::vector<Unit>& units() const { return units_; }
  std::size_t most_words() const { return most_words_; }

 private:
  std::vector<Unit> units_;
  std::size_t most_words_ = 0;  // of a history
};

/// A list of partners, in the order in which they were added, each with its history or without one. `normal` is the direction
/// of contact, from either side, in the frame of the history; the same one for the way out as for the way in.
class ContactTail {
 public:
  using Words = std::vector<std::uint64_t>;
  static constexpr std::size_t none = SIZE_MAX;
  static constexpr std::size_t most = UINT16_MAX;  ///< partners

  explicit ContactTail(const HistoryBits& bits) : bits_(bits) {}
  ContactTail(const HistoryBits& bits, WordView words) : bits_(bits) { read(words); }
  void clear() {
    partners_.clear();
    end_ = 0;
  }
  void read(WordView words);
  void write(Words& words) const;  ///< none without partners

  /// history: as set_layout() said, or nullptr. False, and nothing is added, if it holds numbers that are none, `normal` has no
  /// direction, or the list is full.
  bool add(std::int64_t partner, const double* history, const Vec3& normal);
  void erase(std::size_t at);
  std::size_t size() const { return partners_.size(); }
  std::int64_t partner(std::size_t at) const { return partners_[at].tag; }
  /// Where the partner stands, `none` if it does not.
  std::size_t find(std::int64_t partner) const;
  /// False if it has none.
  bool history(std::size_t number, const Vec3& normal, double* history) const;

  /// Whether, and which, partners stand in the words; cheaper than to read them.
  static bool names(WordView words, std::int64_t partner);
  template <class Visit>
  static void for_each(WordView words, Visit visit) {
    for (std::size_t at = 0; at < count_in(words); ++at) visit(partner_in(words, at));
  }

 private:
  struct Partner {
    std::int32_t tag;
    bool known;
    std::size_t begin, end;  // of its history's bits
  };
  static std::size_t count_in(WordView words);
  static std::int32_t partner_in(WordView words, std::size_t number);

  const HistoryBits& bits_;
  std::vector<Partner> partners_;
  Words histories_;
  std::size_t end_ = 0;  // of their bits
};

}  // namespace solidcull
