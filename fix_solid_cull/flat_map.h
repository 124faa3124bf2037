// A hash map from 64-bit keys to small values with open addressing: tags to granules, cells to lists.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace solidcull {

/// Keys are any int64 but INT64_MIN. Look-up, insertion and removal are O(1); removal shifts back, so no tombstones pile up.
template <class Value>
class FlatMap {
 public:
  using Key = std::int64_t;

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
    if (2 * (size_ + 1) > slots_.size()) rehash(slots_.empty() ? 16 : 2 * slots_.size());
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
    for (std::size_t at = next(hole); slots_[at].first != empty_key; at = next(at)) {
      const std::size_t wanted = home(slots_[at].first);
      if (((at - wanted) & mask()) >= ((at - hole) & mask())) {
        slots_[hole] = std::move(slots_[at]);
        hole = at;
      }
    }
    slots_[hole] = {empty_key, Value{}};
    --size_;
    return true;
  }

  /// Makes room for n keys at once.
  void reserve(std::size_t n) {
    std::size_t slots = 16;
    while (slots < 2 * n) slots *= 2;
    if (slots > slots_.size()) rehash(slots);
  }
  /// Empties it; the memory stays for the next use.
  void clear() {
    if (size_ != 0) std::fill(slots_.begin(), slots_.end(), Slot{empty_key, Value{}});
    size_ = 0;
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
  static constexpr Key empty_key = INT64_MIN;

  std::size_t mask() const { return slots_.size() - 1; }
  std::size_t next(std::size_t at) const { return (at + 1) & mask(); }
  std::size_t home(Key key) const {
    std::uint64_t h = static_cast<std::uint64_t>(key);  // splitmix64's finaliser
    h = (h ^ (h >> 30)) * 0xbf58476d1ce4e5b9ULL;
    h = (h ^ (h >> 27)) * 0x94d049bb133111ebULL;
    return static_cast<std::size_t>(h ^ (h >> 31)) & mask();
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
