// A growing array of equal rows that never copies what it holds: a large store grows without slack and without a second copy.
#pragma once

#include <cstddef>
#include <vector>

namespace solidcull {

/// Rows of `width` elements each, numbered from 0, in chunks of one size (at most 32 kB, or as given). A row lies in one piece
/// and stays where it is until clear(). T is a plain type.
template <class T>
class ChunkedArray {
 public:
  explicit ChunkedArray(std::size_t width = 1, std::size_t chunk_bytes = 32768) : width_(width) {
    while (shift_ > 0 && (width << shift_) * sizeof(T) > chunk_bytes) --shift_;
  }

  std::size_t size() const { return size_; }
  T* row(std::size_t i) { return chunks_[i >> shift_].data() + (i & mask()) * width_; }
  const T* row(std::size_t i) const { return chunks_[i >> shift_].data() + (i & mask()) * width_; }
  T& operator[](std::size_t i) { return *row(i); }
  const T& operator[](std::size_t i) const { return *row(i); }

  /// A new row at the end, made of T{}; returns its number.
  std::size_t append() {
    if (size_ == chunks_.size() << shift_) chunks_.emplace_back(width_ << shift_);
    return size_++;
  }
  void clear() {
    chunks_.clear();
    size_ = 0;
  }
  std::size_t memory_bytes() const {
    return chunks_.capacity() * sizeof(chunks_[0]) + chunks_.size() * (width_ << shift_) * sizeof(T);
  }

 private:
  std::size_t mask() const { return (std::size_t{1} << shift_) - 1; }

  std::size_t width_, size_ = 0;
  unsigned shift_ = 12;
  std::vector<std::vector<T>> chunks_;
};

}  // namespace solidcull
