#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>
#include <unordered_map>

#include "flat_map.h"

namespace solidcull {
namespace {

using Reference = std::unordered_map<std::int64_t, int>;

template <class Key>
void expect_same(const FlatMap<int, Key>& map, const Reference& reference) {
  ASSERT_EQ(map.size(), reference.size());
  ASSERT_EQ(map.empty(), reference.empty());
  for (const auto& r : reference) {
    const int* found = map.find(static_cast<Key>(r.first));
    ASSERT_NE(found, nullptr) << "key " << r.first << " is lost";
    ASSERT_EQ(*found, r.second);
  }
  std::size_t visited = 0;
  map.for_each([&](std::int64_t key, int value) {
    ++visited;
    ASSERT_TRUE(reference.count(key)) << "key " << key << " came from nowhere";
    ASSERT_EQ(value, reference.at(key));
  });
  ASSERT_EQ(visited, reference.size());
}

/// `operations` random insertions and removals over `keys` keys, compared every so often.
template <class Key = std::int64_t>
void random_operations(unsigned seed, std::int64_t keys, int operations, int compare_every) {
  std::mt19937_64 random(seed);
  FlatMap<int, Key> map;
  Reference reference;
  for (int n = 0; n < operations; ++n) {
    const Key key = static_cast<Key>(random() % static_cast<std::uint64_t>(keys)) - static_cast<Key>(keys / 2);
    if (random() % 2) {
      const int value = static_cast<int>(random() % 1000);
      map[key] = value;
      reference[key] = value;
    } else {
      ASSERT_EQ(map.erase(key), reference.erase(key) == 1);
    }
    ASSERT_EQ(map.contains(key), reference.count(key) == 1);
    if (n % compare_every == 0) expect_same(map, reference);
  }
  expect_same(map, reference);
}

TEST(FlatMap, a_new_map_is_empty_and_finds_nothing) {
  FlatMap<int> map;
  EXPECT_EQ(map.size(), 0u);
  EXPECT_TRUE(map.empty());
  EXPECT_EQ(map.find(0), nullptr);
  EXPECT_FALSE(map.erase(0));
}

TEST(FlatMap, a_new_key_has_the_default_value) {
  FlatMap<double> map;
  EXPECT_EQ(map[7], 0.0);
  map[7] = 2.5;
  EXPECT_EQ(map[7], 2.5);
  EXPECT_EQ(map.size(), 1u);
}

TEST(FlatMap, a_key_that_was_erased_starts_from_the_default_again) {
  FlatMap<int> map;
  map[3] = 5;
  EXPECT_TRUE(map.erase(3));
  EXPECT_FALSE(map.erase(3));
  EXPECT_EQ(map[3], 0);
}

TEST(FlatMap, takes_the_ends_of_the_key_range) {
  FlatMap<int> map;
  for (const std::int64_t key : {INT64_MIN + 1, std::int64_t{-1}, std::int64_t{0}, INT64_MAX}) map[key] = 1;
  EXPECT_EQ(map.size(), 4u);
  EXPECT_TRUE(map.contains(INT64_MIN + 1));
  EXPECT_TRUE(map.contains(INT64_MAX));
}

// few keys in a small table: long runs of occupied slots, many of them around the table's end
TEST(FlatMap, removal_shifts_back_what_was_displaced) {
  for (unsigned seed = 0; seed < 300; ++seed) random_operations(seed, 9, 200, 1);
  for (unsigned seed = 0; seed < 20; ++seed) random_operations(seed, 60, 2000, 7);
  for (unsigned seed = 0; seed < 300; ++seed) random_operations<std::int32_t>(seed, 9, 200, 1);
}

TEST(FlatMap, does_as_unordered_map_does_under_random_operations) {
  random_operations(1, 3000, 200000, 20000);
  random_operations(2, INT64_MAX, 20000, 2000);
  random_operations<std::int32_t>(3, 3000, 200000, 20000);
  random_operations<std::int32_t>(4, INT32_MAX, 20000, 2000);
}

TEST(FlatMap, removal_leaves_no_tombstones) {
  FlatMap<int> map;
  for (int k = 0; k < 100; ++k) map[k] = k;
  const std::size_t bytes = map.memory_bytes();
  for (int k = 100; k < 100000; ++k) {
    map[k] = k;
    map.erase(k - 100);
  }
  EXPECT_EQ(map.size(), 100u);
  EXPECT_LE(map.memory_bytes(), bytes);
}

TEST(FlatMap, holds_values_that_own_memory) {
  FlatMap<std::string> map;
  for (int k = 0; k < 1000; ++k) map[k] = std::string(40, static_cast<char>('a' + k % 26));
  for (int k = 0; k < 1000; k += 2) map.erase(k);
  for (int k = 1; k < 1000; k += 2) EXPECT_EQ(*map.find(k), std::string(40, static_cast<char>('a' + k % 26)));
}

TEST(FlatMap, clear_empties_it_and_keeps_the_memory) {
  FlatMap<int> map;
  for (int k = 0; k < 1000; ++k) map[k] = k + 1;
  const std::size_t bytes = map.memory_bytes();
  map.clear();
  EXPECT_TRUE(map.empty());
  EXPECT_EQ(map.memory_bytes(), bytes);
  EXPECT_EQ(map.find(1), nullptr);
  map.for_each([](std::int64_t, int) { ADD_FAILURE(); });
  EXPECT_EQ(map[1], 0);
  EXPECT_EQ(map.size(), 1u);
}

TEST(FlatMap, clear_gives_back_what_is_much_more_than_was_in_use) {
  FlatMap<int> map;
  map.reserve(1000000);
  EXPECT_GT(map.memory_bytes(), 10000000u);
  for (int k = 0; k < 1000; ++k) map[k] = k + 1;
  map.clear();
  EXPECT_EQ(map.memory_bytes(), 0u);
  EXPECT_EQ(map.find(1), nullptr);
  for (int k = 0; k < 1000; ++k) map[k] = k + 1;
  const std::size_t bytes = map.memory_bytes();
  EXPECT_LT(bytes, 100000u);
  for (int round = 0; round < 5; ++round) {
    map.clear();
    EXPECT_EQ(map.memory_bytes(), bytes);
    for (int k = 0; k < 1000; ++k) map[k] = k + 1;
  }
  map.clear();
  map.clear();
  EXPECT_EQ(map.memory_bytes(), 0u) << "not in use at all";
}

TEST(FlatMap, fit_gives_back_what_is_not_needed_and_loses_nothing) {
  FlatMap<int> map;
  for (int k = 0; k < 100000; ++k) map[k] = k + 1;
  const std::size_t bytes = map.memory_bytes();
  map.fit();
  EXPECT_EQ(map.memory_bytes(), bytes) << "all of it is in use";
  for (int k = 0; k < 99900; ++k) map.erase(k);
  map.fit();
  EXPECT_LT(map.memory_bytes(), 5000u);
  EXPECT_EQ(map.size(), 100u);
  for (int k = 99900; k < 100000; ++k) EXPECT_EQ(*map.find(k), k + 1);
  FlatMap<int> none;
  none.fit();
  EXPECT_EQ(none.memory_bytes(), 0u);
}

TEST(FlatMap, a_map_of_numbers_of_32_bits_takes_14_bytes_per_element) {
  FlatMap<int, std::int32_t> map;
  double sum = 0, log_size = 0;
  for (int k = 1; k <= 1000000; ++k) {
    map[k] = k;
    if (k < 1000) continue;
    const double bytes = static_cast<double>(map.memory_bytes()) / k, weight = std::log1p(1.0 / k);
    ASSERT_LE(bytes, 16.1);
    sum += weight * bytes;
    log_size += weight;
  }
  EXPECT_LE(sum / log_size, 14.0);
}

TEST(FlatMap, copying_in_the_order_of_another_map_does_not_heap_up) {
  // quadratic otherwise: minutes, not a second
  FlatMap<int, std::int32_t> from, to;
  for (int k = 0; k < 1000000; ++k) from[k] = k;
  from.for_each([&](std::int32_t key, int value) { to[key] = value; });
  EXPECT_EQ(to.size(), from.size());
}

TEST(FlatMap, reserve_makes_room_and_loses_nothing) {
  FlatMap<int> map;
  Reference reference;
  for (int k = 0; k < 50; ++k) map[7 * k] = reference[7 * k] = k;
  map.reserve(10000);
  expect_same(map, reference);
  const std::size_t bytes = map.memory_bytes();
  for (int k = 0; k < 10000; ++k) map[k] = reference[k] = k;
  EXPECT_EQ(map.memory_bytes(), bytes);
  expect_same(map, reference);
  map.reserve(1);
  expect_same(map, reference);
}

}  // namespace
}  // namespace solidcull
