#include <gtest/gtest.h>

#include <vector>

#include "flat_map.h"
#include "release.h"

using solidcull::FlatMap;
using solidcull::release;

TEST(Release, GivesTheMemoryBackNotTheElementsOnly) {
  std::vector<double> numbers(1000, 1.0);
  FlatMap<int> map;
  for (int k = 0; k < 1000; ++k) map[k] = k;
  release(numbers, map);
  EXPECT_EQ(numbers.size(), 0u);
  EXPECT_EQ(numbers.capacity(), 0u);
  EXPECT_EQ(map.size(), 0u);
  EXPECT_EQ(map.memory_bytes(), 0u);
}
