#include "packed_columns.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <stdexcept>

namespace solidcull {
namespace {

enum Way : std::uint8_t { one, most, few, like, narrow, plain };
constexpr std::size_t word = sizeof(std::uint64_t), half = sizeof(std::uint32_t);
constexpr std::size_t most_different = 64;  // words of a column with few

template <class T>
void put(const T* from, std::size_t n, std::vector<char>& to) {
  const auto* bytes = reinterpret_cast<const char*>(from);
  to.insert(to.end(), bytes, bytes + n * sizeof(T));
}
template <class T>
void put(T x, std::vector<char>& to) {
  put(&x, 1, to);
}

/// What a column is most of the time, if it is anything most of the time (Boyer and Moore).
std::uint64_t usual_word(const std::vector<std::uint64_t>& column) {
  std::uint64_t usual = column.front();
  std::size_t votes = 0;
  for (const std::uint64_t w : column) {
    if (votes == 0) usual = w;
    w == usual ? ++votes : --votes;
  }
  return usual;
}

class Packer {
 public:
  Packer(const WordTable& table, std::vector<char>& to) : table_(table), to_(to), column_(table.rows) {
    put(static_cast<std::uint32_t>(table.rows), to);
    put(static_cast<std::uint32_t>(table.columns), to);
    for (std::size_t c = 0; c < table.columns; ++c) pack(c);
  }

 private:
  void pack(std::size_t c) {
    const std::size_t n = table_.rows;
    std::uint64_t all_bits = 0;
    for (std::size_t r = 0; r < n; ++r) all_bits |= column_[r] = table_.row(r)[c];
    const std::uint64_t usual = n ? usual_word(column_) : 0;
    const std::size_t others = n - static_cast<std::size_t>(std::count(column_.begin(), column_.end(), usual));
    if (others == 0) {
      put(one, to_);
      put(usual, to_);
      return;
    }
    std::size_t best = n * (all_bits >> 32 ? word : half);
    Way way = all_bits >> 32 ? plain : narrow;
    const std::size_t as_most = word + half + others * (half + word);
    if (as_most < best) {
      best = as_most;
      way = most;
    }
    if (n + word < best && has_few(n)) {
      const std::size_t as_few = 1 + different_.size() * word + n;
      if (as_few < best) {
        best = as_few;
        way = few;
      }
    }
    std::size_t twin = c;
    if (way != most) twin = earlier_twin(c);
    if (twin < c) way = like;
    put(way, to_);
    switch (way) {
      case most:
        put(usual, to_);
        put(static_cast<std::uint32_t>(others), to_);
        for (std::size_t r = 0; r < n; ++r)
          if (column_[r] != usual) put(static_cast<std::uint32_t>(r), to_);
        for (std::size_t r = 0; r < n; ++r)
          if (column_[r] != usual) put(column_[r], to_);
        break;
      case few:
        put(static_cast<std::uint8_t>(different_.size()), to_);
        put(different_.data(), different_.size(), to_);
        put(which_.data(), n, to_);
        break;
      case like:
        put(static_cast<std::uint32_t>(twin), to_);
        break;
      case narrow:
        for (std::size_t r = 0; r < n; ++r) put(static_cast<std::uint32_t>(column_[r]), to_);
        break;
      default:
        put(column_.data(), n, to_);
    }
  }
  bool has_few(std::size_t n) {
    different_.clear();
    which_.resize(n);
    for (std::size_t r = 0; r < n; ++r) {
      const std::size_t k =
          static_cast<std::size_t>(std::find(different_.begin(), different_.end(), column_[r]) - different_.begin());
      if (k == different_.size()) {
        if (k == most_different) return false;
        different_.push_back(column_[r]);
      }
      which_[r] = static_cast<std::uint8_t>(k);
    }
    return true;
  }
  /// c if there is none.
  std::size_t earlier_twin(std::size_t c) const {
    for (std::size_t k = 0; k < c; ++k) {
      std::size_t r = 0;
      while (r < table_.rows && table_.row(r)[k] == column_[r]) ++r;
      if (r == table_.rows) return k;
    }
    return c;
  }

  const WordTable& table_;
  std::vector<char>& to_;
  std::vector<std::uint64_t> column_, different_;
  std::vector<std::uint8_t> which_;
};

class Unpacker {
 public:
  Unpacker(const char* at, const char* end) : at_(at), end_(end) {}

  template <class T>
  T get() {
    T x;
    std::memcpy(&x, bytes(sizeof x), sizeof x);
    return x;
  }
  /// n numbers, which need not be aligned.
  const char* bytes(std::size_t n) {
    if (n > static_cast<std::size_t>(end_ - at_)) broken();
    at_ += n;
    return at_ - n;
  }
  template <class T>
  static T nth(const char* numbers, std::size_t n) {
    T x;
    std::memcpy(&x, numbers + n * sizeof x, sizeof x);
    return x;
  }
  [[noreturn]] static void broken() { throw std::runtime_error("a table of words is broken"); }
  const char* at() const { return at_; }

  void column(std::size_t c, WordTable& t) {
    const std::size_t n = t.rows;
    const auto way = get<std::uint8_t>();
    if (way == one || way == most) {
      const auto usual = get<std::uint64_t>();
      for (std::size_t r = 0; r < n; ++r) t.row(r)[c] = usual;
      if (way == one) return;
      const std::size_t others = get<std::uint32_t>();
      const char *const rows = bytes(others * half), *const words = bytes(others * word);
      for (std::size_t k = 0; k < others; ++k) {
        const std::size_t r = nth<std::uint32_t>(rows, k);
        if (r >= n) broken();
        t.row(r)[c] = nth<std::uint64_t>(words, k);
      }
    } else if (way == few) {
      const std::size_t different = get<std::uint8_t>();
      const char *const words = bytes(different * word), *const which = bytes(n);
      for (std::size_t r = 0; r < n; ++r) {
        const std::size_t k = nth<std::uint8_t>(which, r);
        if (k >= different) broken();
        t.row(r)[c] = nth<std::uint64_t>(words, k);
      }
    } else if (way == like) {
      const std::size_t twin = get<std::uint32_t>();
      if (twin >= c) broken();
      for (std::size_t r = 0; r < n; ++r) t.row(r)[c] = t.row(r)[twin];
    } else if (way == narrow) {
      const char* const words = bytes(n * half);
      for (std::size_t r = 0; r < n; ++r) t.row(r)[c] = nth<std::uint32_t>(words, r);
    } else if (way == plain) {
      const char* const words = bytes(n * word);
      for (std::size_t r = 0; r < n; ++r) t.row(r)[c] = nth<std::uint64_t>(words, r);
    } else {
      broken();
    }
  }

 private:
  const char *at_, *end_;
};

}  // namespace

void pack_columns(const WordTable& table, std::vector<char>& to) { Packer(table, to); }

const char* unpack_columns(const char* at, const char* end, WordTable& table) {
  Unpacker in(at, end);
  table.rows = in.get<std::uint32_t>();
  table.columns = in.get<std::uint32_t>();
  constexpr std::size_t most_words = std::size_t{1} << 28;
  if (table.columns && table.rows > most_words / table.columns) Unpacker::broken();
  table.words.resize(table.rows * table.columns);
  for (std::size_t c = 0; c < table.columns; ++c) in.column(c, table);
  return in.at();
}

}  // namespace solidcull
