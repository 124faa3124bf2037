// Numbers in fewer bits than a double has, for granules that wait in a compact store (theory.md#granule-store).
#pragma once

#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>

#include "sphere.h"

namespace solidcull {

/// A number in 16 bits: sign, 7 bits of exponent, 8 of fraction. To 2^-9 of itself between 3e-20 and 9e18; smaller ones are 0.
struct HalfWord {
  static std::uint16_t pack(double x) {
    int exponent = 0;
    const double fraction = std::frexp(std::abs(x), &exponent);  // in [1/2, 1)
    int steps = static_cast<int>(std::lround(512 * fraction));
    if (steps == 512) steps = 256, ++exponent;
    if (x == 0 || exponent < least) return 0;
    if (exponent > least + 126) exponent = least + 126, steps = 511;
    return static_cast<std::uint16_t>((std::signbit(x) ? 0x8000 : 0) | (exponent - least + 1) << 8 | (steps & 0xff));
  }
  static double unpack(std::uint16_t bits) {
    if ((bits & 0x7fff) == 0) return 0;
    const double size = std::ldexp(256 + (bits & 0xff), (bits >> 8 & 0x7f) - 1 + least - 9);
    return bits & 0x8000 ? -size : size;
  }

 private:
  static constexpr int least = -64;  // exponent
};

/// A place in four words of 32 bits: three numbers of 42 bits, in multiples of `step`.
struct FixedPlace {
  static constexpr int words = 4;
  static constexpr double half = 2199023255552.0;  ///< 2^41: steps
  /// Throws std::range_error for a place farther out than 2^41 steps.
  static void pack(const Vec3& place, double step, std::uint32_t* to) {
    std::uint64_t n[3];
    for (int d = 0; d < 3; ++d) {
      const double steps = std::nearbyint(place[d] / step) + half;
      if (!(steps >= 0 && steps < 2 * half))
        throw std::range_error("a granule at " + std::to_string(place[d]) +
                               " is too far out for a compact store: use store exact");
      n[d] = static_cast<std::uint64_t>(steps);
    }
    for (int d = 0; d < 3; ++d) to[d] = static_cast<std::uint32_t>(n[d]);
    to[3] = static_cast<std::uint32_t>(n[0] >> 32 | n[1] >> 32 << 10 | n[2] >> 32 << 20);
  }
  static Vec3 unpack(const std::uint32_t* from, double step) {
    Vec3 place;
    for (int d = 0; d < 3; ++d) {
      const std::uint64_t high = from[3] >> (10 * d) & 0x3ff;
      place[d] = (static_cast<double>(high << 32 | from[d]) - half) * step;
    }
    return place;
  }
};

}  // namespace solidcull
