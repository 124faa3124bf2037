// The one list of a stored granule's numbers, by which the store, other ranks and restart files take it.
#include <gtest/gtest.h>

#include <cstddef>
#include <type_traits>
#include <vector>

#include "granule_store.h"
#include "stored_granule.h"

using namespace solidcull;

namespace {

/// Each number is another one.
StoredGranule filled(std::int64_t tag, int body) {
  StoredGranule g;
  int n = 1;
  g.each_number([&](auto& x) {
    using Number = std::decay_t<decltype(x)>;
    x = std::is_same_v<Number, bool> ? Number(true) : static_cast<Number>(0.5 + n);
    ++n;
  });
  g.tag = tag;
  g.body = body;
  return g;
}

std::vector<double> numbers_of(StoredGranule g) {
  std::vector<double> numbers{static_cast<double>(g.tag), static_cast<double>(g.body)};
  g.each_number([&](auto& x) { numbers.push_back(static_cast<double>(x)); });
  return numbers;
}

TEST(StoredGranule, has_no_number_that_its_list_leaves_out) {
  StoredGranule g;
  std::size_t bytes = sizeof g.tag + sizeof g.body;
  g.each_number([&](auto& x) { bytes += sizeof x; });
  // what is left over is room between members, less than one of them everywhere
  const std::size_t room = sizeof(StoredGranule) - bytes;
  const std::size_t after_flags = alignof(int) - 2 * sizeof(bool), after_body = sizeof(int),
                    in_clump = sizeof(ClumpMass) - (3 + 4 + 3) * sizeof(double);
  const std::size_t known = after_flags + after_body + in_clump;
  EXPECT_EQ(room, known + (sizeof(StoredGranule) - known - bytes) % alignof(ClumpMass))
      << "a member stands in no list of stored_granule.h";
  EXPECT_LT(room - known, alignof(ClumpMass));
}

TEST(StoredGranule, comes_out_of_an_exact_store_with_all_its_numbers) {
  GranuleStore store(10.0);
  const double record[] = {1, 2, 3};
  store.add(filled(7, 3), record, 3);
  EXPECT_EQ(numbers_of(store.get(7)), numbers_of(filled(7, 3)));
  std::vector<double> out;
  EXPECT_EQ(numbers_of(store.take(7, out)), numbers_of(filled(7, 3)));
  EXPECT_EQ(out, std::vector<double>(record, record + 3));
}

TEST(StoredGranule, keeps_its_small_numbers_in_a_rounded_store) {
  GranuleStore store(10.0, GranuleStore::Precision::rounded);
  StoredGranule in = filled(7, 3);
  store.add(in, nullptr, 0);
  StoredGranule out = store.get(7);
  std::vector<int> due, are;
  in.each_small([&](auto& x) { due.push_back(x); });
  out.each_small([&](auto& x) { are.push_back(x); });
  EXPECT_EQ(are, due);
  EXPECT_EQ(out.lock_step, in.lock_step);
}

}  // namespace
