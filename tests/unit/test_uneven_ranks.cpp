#include <gtest/gtest.h>

#include "uneven_ranks.h"
#include "world_parts.h"

namespace solidcull {
namespace {

std::string line_of(int ranks, int here, int there) {
  std::string line;
  SmallDeck deck = empty_space();
  deck.split = {ranks, 1, 1};
  run_on_ranks(deck, [&](SmallWorld& w) {
    WorldParts parts(w, sleeping_settings(), 2 * r);
    for (int n = 0; n < here; ++n) w.add(n + 1, Vec3(-0.99, 0, 0.001 * n), r);
    for (int n = 0; n < there; ++n) w.add(here + n + 1, Vec3(0.99, 0, 0.001 * n), r);
    const std::string text = uneven_ranks(parts.bed);
    if (w.ranks.me == ranks - 1) line = text;
  });
  return line;
}

TEST(UnevenRanks, are_named_when_one_has_less_than_a_fifth_of_the_mean) {
  EXPECT_EQ(line_of(2, 200, 25), "");
  EXPECT_EQ(line_of(2, 400, 20),
            "rank 1 has 20 granules, the mean of 2 ranks is 210: it waits for the others. 'processors * * 1' before the box is "
            "made cuts no tall box in z");
  EXPECT_NE(line_of(3, 400, 400).find("rank 1 has 0 granules"), std::string::npos);
}

TEST(UnevenRanks, are_no_matter_for_few_granules_or_one_rank) {
  EXPECT_EQ(line_of(2, 199, 0), "");
  EXPECT_EQ(line_of(1, 400, 0), "");
}

}  // namespace
}  // namespace solidcull
