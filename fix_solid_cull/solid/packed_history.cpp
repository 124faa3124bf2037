#include "packed_history.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstring>

#include "flat_map.h"

namespace solidcull {
namespace {

constexpr int unit_bits = 24;
constexpr std::uint64_t unit_mask = (std::uint64_t{1} << unit_bits) - 1;

std::uint64_t key_of(std::int64_t tag) { return scrambled(static_cast<std::uint64_t>(tag)) >> 48; }

struct Plane {
  Vec3 u, v;
  explicit Plane(const Vec3& normal) {
    int least = 0;
    normal.cwiseAbs().minCoeff(&least);
    u = normal.cross(Vec3(Vec3::Unit(least))).normalized();
    v = normal.normalized().cross(u);
  }
};

/// Two numbers with one exponent: 8 bits for it, 0 for no length at all, and 8 with the sign for each.
std::uint64_t pack_pair(double a, double b) {
  int exponent = 0;
  constexpr double rounding = 1 + 1e-9;  // what was unpacked gets the exponent that it had
  std::frexp(rounding * std::max(std::abs(a), std::abs(b)), &exponent);
  if ((a == 0 && b == 0) || exponent < -127) return 0;
  exponent = std::min(exponent, 127);
  const auto share = [&](double x) {
    const double of_128 = std::clamp(std::round(std::ldexp(x, 7 - exponent)), -127.0, 127.0);
    return static_cast<std::uint64_t>(static_cast<std::uint8_t>(static_cast<std::int8_t>(of_128)));
  };
  return static_cast<std::uint64_t>(exponent + 128) << 16 | share(a) << 8 | share(b);
}
double of_pair(std::uint64_t unit, int shift) {
  const int exponent = static_cast<int>(unit >> 16) - 128;
  return unit == 0 ? 0.0 : std::ldexp(static_cast<double>(static_cast<std::int8_t>(unit >> shift & 0xff)), exponent - 7);
}

/// A float without its last 8 bits, rounded.
std::uint64_t pack_number(double x) {
  const float f = static_cast<float>(x);
  std::uint32_t bits;
  std::memcpy(&bits, &f, sizeof bits);
  return std::min<std::uint64_t>((std::uint64_t{bits} + 0x80) >> 8, unit_mask);
}
double of_number(std::uint64_t unit) {
  const std::uint32_t bits = static_cast<std::uint32_t>(unit) << 8;
  float f;
  std::memcpy(&f, &bits, sizeof f);
  return f;
}

/// Two units a word, those of the first one behind the key.
std::uint64_t unit_in(const std::uint64_t* packed, std::size_t n) {
  return packed[n / 2] >> (n % 2 ? 64 - unit_bits : 64 - 2 * unit_bits) & unit_mask;
}

}  // namespace

void PackedHistory::set_layout(std::size_t width, const std::vector<int>& vectors) {
  units_.clear();
  for (int d = 0; d < static_cast<int>(width); ++d) {
    const bool vector = std::find(vectors.begin(), vectors.end(), d) != vectors.end();
    units_.push_back({d, vector});
    if (vector) d += 2;
  }
}

void PackedHistory::pack(std::int64_t partner, const double* history, const Vec3& normal, std::vector<std::uint64_t>& to) const {
  const Plane plane(normal);
  const std::size_t begin = to.size();
  to.resize(begin + words());
  bool some = false;
  for (std::size_t n = 0; n < units_.size(); ++n) {
    const double* h = history + units_[n].first;
    std::uint64_t unit;
    if (units_[n].vector) {
      const Vec3 vector(h[0], h[1], h[2]);
      unit = pack_pair(vector.dot(plane.u), vector.dot(plane.v));
    } else {
      unit = pack_number(*h);
    }
    some = some || unit != 0;
    to[begin + n / 2] |= unit << (n % 2 ? 64 - unit_bits : 64 - 2 * unit_bits);
  }
  if (some)
    to[begin] |= key_of(partner);
  else
    to.resize(begin);
}

void PackedHistory::unpack(const std::uint64_t* packed, const Vec3& normal, double* history) const {
  const Plane plane(normal);
  for (std::size_t n = 0; n < units_.size(); ++n) {
    const std::uint64_t unit = unit_in(packed, n);
    double* h = history + units_[n].first;
    if (units_[n].vector) {
      const Vec3 vector = of_pair(unit, 8) * plane.u + of_pair(unit, 0) * plane.v;
      std::copy(vector.data(), vector.data() + 3, h);
    } else {
      *h = of_number(unit);
    }
  }
}

bool PackedHistory::alike(std::int64_t a, std::int64_t b) { return key_of(a) == key_of(b); }

std::size_t PackedHistory::find(WordView list, std::int64_t partner) const {
  const std::uint64_t key = key_of(partner);
  for (std::size_t at = 0; at < list.size(); at += words())
    if ((list[at] & 0xffff) == key) return at;
  return list.size();
}

}  // namespace solidcull
