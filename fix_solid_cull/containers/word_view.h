// Words that someone else keeps.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace solidcull {

class WordView {
 public:
  WordView() = default;
  WordView(const std::uint64_t* begin, std::size_t size) : begin_(begin), size_(size) {}
  WordView(const std::vector<std::uint64_t>& words) : WordView(words.data(), words.size()) {}
  const std::uint64_t* begin() const { return begin_; }
  const std::uint64_t* end() const { return begin_ + size_; }
  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  std::uint64_t operator[](std::size_t i) const { return begin_[i]; }

 private:
  const std::uint64_t* begin_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace solidcull
