// A table of 64-bit words for a file, kept column by column in few bytes: lossless, to the bit.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace solidcull {

/// rows x columns words, row by row.
struct WordTable {
  std::size_t rows = 0, columns = 0;
  std::vector<std::uint64_t> words;

  const std::uint64_t* row(std::size_t r) const { return words.data() + r * columns; }
  std::uint64_t* row(std::size_t r) { return words.data() + r * columns; }
  /// An empty table of so many columns.
  void clear(std::size_t n) {
    rows = 0;
    columns = n;
    words.clear();
  }
  /// A new row at the end, of zeros.
  std::uint64_t* add_row() {
    words.resize(++rows * columns);
    return row(rows - 1);
  }
};

/// In the file: rows and columns (32 bits each), then each column: one byte for how it is kept, and
///   0, one word for all: the word;
///   1, one word for most: the word, how many rows differ (32 bits), their numbers (32 bits each), their words;
///   2, few words: how many (8 bits), the words, one byte for each row that says which;
///   3, like an earlier column: its number (32 bits);
///   4, narrow: the lower 32 bits of each row's word, the others are 0;
///   5, plain: the words.
/// Numbers are as this machine keeps them, without gaps. Which way a column is kept is the writer's choice.
void pack_columns(const WordTable& table, std::vector<char>& to);

/// Reads one table of what lies from `at` to `end`; returns where it ends. std::runtime_error for what is none.
const char* unpack_columns(const char* at, const char* end, WordTable& table);

}  // namespace solidcull
