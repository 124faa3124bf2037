// A check sum of numbers by their bits (FNV-1a by words).
#pragma once

#include <cstdint>

#include "bits.h"

namespace solidcull {

class WordSum {
 public:
  void add(double x) {
    sum_ = (sum_ ^ bits_of(x)) * 1099511628211u;
    sum_ ^= sum_ >> 32;
  }
  std::uint64_t value() const { return sum_; }

 private:
  std::uint64_t sum_ = 14695981039346656037u;
};

}  // namespace solidcull
