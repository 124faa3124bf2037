#include "contact_tail.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "bits.h"

namespace solidcull {
namespace {

using Words = ContactTail::Words;

// the words: how many partners, each partner's tag and whether it has a history, the histories
constexpr int count_bits = 16, tag_bits = 32, partner_bits = tag_bits + 1;
// a vector that is not 0: how long its third number is, exponent, its two numbers in the plane, the third
constexpr int length_bits = 6, exponent_bits = 11, number_bits = 44;
constexpr int least_exponent = -1022;  // a vector that is smaller yet is 0

std::uint64_t mask_of(int n) { return n < 64 ? (std::uint64_t{1} << n) - 1 : ~std::uint64_t{0}; }

/// The n bits from `at` on, which is behind them afterwards.
std::uint64_t take(WordView words, std::size_t& at, int n) {
  const std::size_t word = at / 64, from = at % 64;
  std::uint64_t bits = words[word] >> from;
  if (from + static_cast<std::size_t>(n) > 64) bits |= words[word + 1] << (64 - from);
  at += static_cast<std::size_t>(n);
  return bits & mask_of(n);
}
/// The number whose two's complement these n bits are.
std::int64_t whole(std::uint64_t bits, int n) {
  const std::uint64_t sign = n > 0 ? std::uint64_t{1} << (n - 1) : 0;
  return static_cast<std::int64_t>((bits ^ sign) - sign);
}
int length_of(std::int64_t x) { return x == 0 ? 0 : 65 - __builtin_clzll(static_cast<std::uint64_t>(x < 0 ? ~x : x) | 1); }

/// Writes behind `at`, into room that is there; what was behind is lost.
class Writer {
 public:
  explicit Writer(Words& words, std::size_t at = 0) : words_(words.data()), at_(at) {}
  std::size_t at() const { return at_; }
  void put(std::uint64_t bits, int n) {
    const std::size_t word = at_ / 64, from = at_ % 64;
    bits &= mask_of(n);
    words_[word] = (words_[word] & mask_of(static_cast<int>(from))) | bits << from;
    if (from + static_cast<std::size_t>(n) > 64) words_[word + 1] = bits >> (64 - from);
    at_ += static_cast<std::size_t>(n);
  }
  void copy(const Words& from, std::size_t begin, std::size_t end) {
    while (begin < end) {
      const int n = static_cast<int>(std::min<std::size_t>(64, end - begin));
      put(take(from, begin, n), n);
    }
  }

 private:
  std::uint64_t* words_;
  std::size_t at_;
};

/// Two directions in the plane of contact, and its normal.
struct Axes {
  Vec3 axis[3];
  explicit Axes(const Vec3& normal) {
    int least = 0;
    normal.cwiseAbs().minCoeff(&least);
    axis[0] = normal.cross(Vec3(Vec3::Unit(least))).normalized();
    axis[2] = normal.normalized();
    axis[1] = axis[2].cross(axis[0]);
  }
};

void put_vector(const Vec3& vector, const Axes& axes, Writer& to) {
  double x[3], largest = 0;
  for (int d = 0; d < 3; ++d) {
    x[d] = vector.dot(axes.axis[d]);
    largest = std::max(largest, std::abs(x[d]));
  }
  int exponent = 0;
  std::frexp(largest, &exponent);
  if (largest == 0 || exponent <= least_exponent) {
    to.put(0, 1);
    return;
  }
  const auto steps = [&](double number) { return std::llround(std::ldexp(number, number_bits - 1 - exponent)); };
  if (steps(largest) >> (number_bits - 1)) ++exponent;
  const std::int64_t third = steps(x[2]);
  const int length = length_of(third);
  to.put(1, 1);
  to.put(static_cast<std::uint64_t>(length), length_bits);
  to.put(static_cast<std::uint64_t>(exponent - least_exponent), exponent_bits);
  for (int d = 0; d < 2; ++d) to.put(static_cast<std::uint64_t>(steps(x[d])), number_bits);
  to.put(static_cast<std::uint64_t>(third), length);
}

Vec3 take_vector(WordView words, std::size_t& at, const Axes& axes) {
  const int length = static_cast<int>(take(words, at, length_bits));
  const int exponent = static_cast<int>(take(words, at, exponent_bits)) + least_exponent;
  Vec3 vector = Vec3::Zero();
  for (int d = 0; d < 3; ++d) {
    const int n = d < 2 ? number_bits : length;
    const auto steps = static_cast<double>(whole(n ? take(words, at, n) : 0, n));
    vector += std::ldexp(steps, exponent + 1 - number_bits) * axes.axis[d];
  }
  return vector;
}

}  // namespace

void HistoryBits::set_layout(std::size_t width, const std::vector<int>& vectors) {
  units_.clear();
  for (int d = 0; d < static_cast<int>(width); ++d) {
    const bool vector = std::find(vectors.begin(), vectors.end(), d) != vectors.end();
    units_.push_back({d, vector});
    if (vector) d += 2;
  }
  std::size_t bits = 0;
  for (const Unit& unit : units_) bits += unit.vector ? 1 + length_bits + exponent_bits + 3 * number_bits : 1 + 64;
  most_words_ = (bits + 63) / 64 + 1;
}

void ContactTail::read(WordView words) {
  clear();
  histories_.assign(words.begin(), words.end());
  if (words.empty()) return;
  std::size_t at = 0;
  partners_.resize(take(words, at, count_bits));
  for (Partner& p : partners_) {
    p.tag = static_cast<std::int32_t>(whole(take(words, at, tag_bits), tag_bits));
    p.known = take(words, at, 1) != 0;
  }
  for (Partner& p : partners_) {
    p.begin = at;
    if (p.known)
      for (const HistoryBits::Unit& unit : bits_.units()) {
        if (!take(words, at, 1)) continue;
        if (unit.vector)
          at += exponent_bits + 2 * number_bits + take(words, at, length_bits);
        else
          at += 64;
      }
    p.end = at;
  }
  end_ = at;
}

void ContactTail::write(Words& words) const {
  if (partners_.empty()) {
    words.clear();
    return;
  }
  std::size_t bits = count_bits + partners_.size() * partner_bits;
  for (const Partner& p : partners_) bits += p.end - p.begin;
  words.resize((bits + 63) / 64);
  Writer to(words);
  to.put(partners_.size(), count_bits);
  for (const Partner& p : partners_) {
    to.put(static_cast<std::uint32_t>(p.tag), tag_bits);
    to.put(p.known, 1);
  }
  for (const Partner& p : partners_) to.copy(histories_, p.begin, p.end);
}

bool ContactTail::add(std::int64_t partner, const double* history, const Vec3& normal) {
  if (partners_.size() == most || !(normal.squaredNorm() > 0)) return false;
  histories_.resize(std::max(histories_.size(), end_ / 64 + 1 + bits_.most_words()));
  Writer to(histories_, end_);
  if (history) {
    const Axes axes(normal);
    for (const HistoryBits::Unit& unit : bits_.units()) {
      const double* h = history + unit.first;
      if (unit.vector) {
        const Vec3 vector(h[0], h[1], h[2]);
        if (!vector.allFinite()) return false;
        put_vector(vector, axes, to);
      } else {
        to.put(bits_of(*h) != 0, 1);
        if (bits_of(*h) != 0) to.put(bits_of(*h), 64);
      }
    }
  }
  partners_.push_back({narrow_tag(partner), history != nullptr, end_, to.at()});
  end_ = to.at();
  return true;
}

void ContactTail::erase(std::size_t at) { partners_.erase(partners_.begin() + static_cast<std::ptrdiff_t>(at)); }

std::size_t ContactTail::find(std::int64_t partner) const {
  for (std::size_t at = 0; at < partners_.size(); ++at)
    if (partners_[at].tag == partner) return at;
  return none;
}

bool ContactTail::history(std::size_t number, const Vec3& normal, double* history) const {
  const Partner& p = partners_[number];
  if (!p.known) return false;
  const Axes axes(normal);
  std::size_t at = p.begin;
  for (const HistoryBits::Unit& unit : bits_.units()) {
    double* h = history + unit.first;
    const bool some = take(histories_, at, 1) != 0;
    if (unit.vector) {
      const Vec3 vector = some ? take_vector(histories_, at, axes) : Vec3(Vec3::Zero());
      std::copy(vector.data(), vector.data() + 3, h);
    } else {
      *h = some ? number_of(take(histories_, at, 64)) : 0.0;
    }
  }
  return true;
}

std::size_t ContactTail::count_in(WordView words) {
  std::size_t at = 0;
  return words.empty() ? 0 : take(words, at, count_bits);
}

std::int32_t ContactTail::partner_in(WordView words, std::size_t number) {
  std::size_t at = count_bits + number * partner_bits;
  return static_cast<std::int32_t>(whole(take(words, at, tag_bits), tag_bits));
}

bool ContactTail::names(WordView words, std::int64_t partner) {
  for (std::size_t at = 0, n = count_in(words); at < n; ++at)
    if (partner_in(words, at) == partner) return true;
  return false;
}

}  // namespace solidcull
