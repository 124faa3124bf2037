// A number as the word of its bits, and back.
#pragma once

#include <cstdint>
#include <cstring>

namespace solidcull {

inline std::uint64_t bits_of(double x) {
  std::uint64_t word;
  std::memcpy(&word, &x, sizeof word);
  return word;
}
inline double number_of(std::uint64_t word) {
  double x;
  std::memcpy(&x, &word, sizeof x);
  return x;
}

}  // namespace solidcull
