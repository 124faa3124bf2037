#include <gtest/gtest.h>

#include <random>

#include "packed_columns.h"

namespace solidcull {
namespace {

WordTable table_of(std::size_t rows, const std::vector<std::vector<std::uint64_t>>& columns) {
  WordTable t;
  t.clear(columns.size());
  for (std::size_t r = 0; r < rows; ++r) {
    std::uint64_t* const row = t.add_row();
    for (std::size_t c = 0; c < columns.size(); ++c) row[c] = columns[c][r];
  }
  return t;
}

std::size_t packed_size(const WordTable& t) {
  std::vector<char> bytes = {'x'};  // what is there stays
  pack_columns(t, bytes);
  WordTable back;
  const char* const end = bytes.data() + bytes.size();
  EXPECT_EQ(unpack_columns(bytes.data() + 1, end, back), end);
  EXPECT_EQ(back.rows, t.rows);
  EXPECT_EQ(back.columns, t.columns);
  EXPECT_EQ(back.words, t.words);
  return bytes.size() - 1;
}

TEST(PackedColumns, all_ways_give_back_what_was_packed_and_take_little) {
  constexpr std::size_t n = 1000;
  std::mt19937_64 random(7);
  std::vector<std::uint64_t> plain(n), narrow(n), few(n), most(n, 5), one(n, ~std::uint64_t{0});
  for (std::size_t r = 0; r < n; ++r) {
    plain[r] = random();
    narrow[r] = random() >> 32;
    few[r] = random() % 9 * 0x123456789abcdefu;
  }
  most[3] = random();
  most[n - 1] = random();
  const std::size_t head = 8;
  EXPECT_EQ(packed_size(table_of(n, {plain})), head + 1 + 8 * n);
  EXPECT_EQ(packed_size(table_of(n, {narrow})), head + 1 + 4 * n);
  EXPECT_EQ(packed_size(table_of(n, {few})), head + 1 + 1 + 9 * 8 + n);
  EXPECT_EQ(packed_size(table_of(n, {most})), head + 1 + 8 + 4 + 2 * 12);
  EXPECT_EQ(packed_size(table_of(n, {one})), head + 9);
  EXPECT_EQ(packed_size(table_of(n, {plain, one, plain})), head + 1 + 8 * n + 9 + 5);
  packed_size(table_of(n, {one, few, plain, most, few, narrow, plain}));
}

TEST(PackedColumns, tables_of_no_rows_or_columns) {
  packed_size(table_of(0, {{}, {}}));
  packed_size(table_of(3, {}));
  packed_size(table_of(1, {{17}}));
}

TEST(PackedColumns, what_is_no_table_is_refused) {
  std::mt19937_64 random(11);
  std::vector<std::uint64_t> plain(50), few(50), most(50, 1);
  for (std::size_t r = 0; r < 50; ++r) {
    plain[r] = random();
    few[r] = random() % 3 << 40;
  }
  most[7] = 3;
  std::vector<char> bytes;
  pack_columns(table_of(50, {plain, few, most, plain}), bytes);
  WordTable back;
  for (std::size_t size = 0; size < bytes.size(); ++size)
    EXPECT_THROW(unpack_columns(bytes.data(), bytes.data() + size, back), std::runtime_error) << size;
  std::vector<char> huge(16, '\xff');
  EXPECT_THROW(unpack_columns(huge.data(), huge.data() + huge.size(), back), std::runtime_error);
  std::vector<char> broken = bytes;
  broken[8] = 9;  // no way to keep a column
  EXPECT_THROW(unpack_columns(broken.data(), broken.data() + broken.size(), back), std::runtime_error);
}

}  // namespace
}  // namespace solidcull
