// A hash map from integer keys to small values with open addressing: tags to granules, cells to lists.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace solidcull {

/// splitmix64's finaliser: each bit of the result depends on all bits of h.
inline std::uint64_t scrambled(std::uint64_t h) {
  h = (h ^ (h >> 30)) * 0xbf58476d1ce4e5b9ULL;
  h = (h ^ (h >> 27)) * 0x94d049bb133111ebULL;
  return h ^ (h >> 31);
}
/// The place in a table of n < 2^32 slots that the hash names: high half times n, without a division.
inline std::size_t slot_of_hash(std::uint64_t hash, std::size_t n) { return static_cast<std::size_t>(((hash >> 32) * n) >> 32); }

/// The engine's tags are ints; the tables hold them as such. Throws std::logic_error for what is none (INT32_MIN is kept free).
inline std::int32_t narrow_tag(std::int64_t tag) {
  if (tag <= INT32_MIN || tag > INT32_MAX)
    throw std::logic_error("tag " + std::to_string(tag) + " does not fit in the engine's 32 bits");
  return static_cast<std::int32_t>(tag);
}

/// Keys are any Key but its smallest. Look-up, insertion and removal are O(1); removal shifts back, so no tombstones pile up.
/// A map of 32-bit keys to 32-bit values takes 10.7 to 16 bytes per element, 13 on average.
template <class Value, class Key = std::int64_t>
class FlatMap {
 public:
  Value* find(Key key) { return const_cast<Value*>(std::as_const(*this).find(key)); }
  const Value* find(Key key) const {
    if (size_ == 0) return nullptr;
    for (std::size_t at = home(key);; at = next(at)) {
      if (slots_[at].first == key) return &slots_[at].second;
      if (slots_[at].first == empty_key) return nullptr;
    }
  }
  bool contains(Key key) const { return find(key) != nullptr; }

  /// The value of `key`, made from Value{} if it is new.
  Value& operator[](Key key) {
    if (4 * (size_ + 1) > 3 * slots_.size()) rehash(slots_.empty() ? smallest : slots_.size() + slots_.size() / 2);
    std::size_t at = home(key);
    for (; slots_[at].first != key; at = next(at)) {
      if (slots_[at].first != empty_key) continue;
      slots_[at] = {key, Value{}};
      ++size_;
      break;
    }
    return slots_[at].second;
  }

  bool erase(Key key) {
    if (size_ == 0) return false;
    std::size_t hole = home(key);
    while (slots_[hole].first != key) {
      if (slots_[hole].first == empty_key) return false;
      hole = next(hole);
    }
    for (std::size_t at = next(hole); slots_[at].first != empty_key; at = next(at))
      if (distance(home(slots_[at].first), at) >= distance(hole, at)) {
        slots_[hole] = std::move(slots_[at]);
        hole = at;
      }
    slots_[hole] = {empty_key, Value{}};
    --size_;
    return true;
  }

  /// Makes room for n keys at once.
  void reserve(std::size_t n) {
    const std::size_t slots = std::max(smallest, n + n / 3 + 1);
    if (slots > slots_.size()) rehash(slots);
  }
  /// Empties it; the memory stays for the next use unless it is much more than what was in use now.
  void clear() {
    if (slots_.size() > kept_always && size_ < slots_.size() / 16)
      std::vector<Slot>().swap(slots_);
    else if (size_ != 0)
      std::fill(slots_.begin(), slots_.end(), Slot{empty_key, Value{}});
    size_ = 0;
  }
  /// Gives room back that was needed once: at most twice what its elements need stays.
  void fit() {
    const std::size_t due = std::max(smallest, size_ + size_ / 3 + 1);
    if (slots_.size() > 2 * due) rehash(due);
  }
  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  std::size_t memory_bytes() const { return slots_.capacity() * sizeof(Slot); }

  template <class Visit>
  void for_each(Visit visit) const {
    for (const Slot& s : slots_)
      if (s.first != empty_key) visit(s.first, s.second);
  }

 private:
  using Slot = std::pair<Key, Value>;
  static constexpr Key empty_key = std::numeric_limits<Key>::min();
  static constexpr std::size_t smallest = 16, kept_always = 64;  // slots

  std::size_t next(std::size_t at) const { return at + 1 == slots_.size() ? 0 : at + 1; }
  std::size_t distance(std::size_t from, std::size_t to) const { return to >= from ? to - from : to + slots_.size() - from; }
  /// The order of the keys is another one for each table size: else what is copied from a large table, in its order, into a
  /// small one that grows would heap up at one end of it.
  std::size_t home(Key key) const {
    const std::uint64_t salt = slots_.size() * 0x9e3779b97f4a7c15ULL;
    return slot_of_hash(scrambled(static_cast<std::uint64_t>(key) ^ salt), slots_.size());
  }
  void rehash(std::size_t n) {
    std::vector<Slot> old(n, Slot{empty_key, Value{}});
    old.swap(slots_);
    for (Slot& s : old) {
      if (s.first == empty_key) continue;
      std::size_t at = home(s.first);
      while (slots_[at].first != empty_key) at = next(at);
      slots_[at] = std::move(s);
    }
  }

  std::vector<Slot> slots_;
  std::size_t size_ = 0;
};

}  // namespace solidcull
