// A check sum of numbers by their bits (FNV-1a by words).
#pragma once

#include <cstdint>
#include <cstring>

namespace solidcull {

class WordSum {
 public:
  void add(double x) {
    std::uint64_t word;
    std::memcpy(&word, &x, sizeof word);
    sum_ = (sum_ ^ word) * 1099511628211u;
    sum_ ^= sum_ >> 32;
  }
  std::uint64_t value() const { return sum_; }

 private:
  std::uint64_t sum_ = 14695981039346656037u;
};

}  // namespace solidcull
