#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "few_bits.h"

namespace solidcull {
namespace {

TEST(FewBits, a_half_word_is_within_a_five_hundredth_over_forty_decades_and_stays_what_it_is) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> decade(-19, 18);
  for (int n = 0; n < 100000; ++n) {
    const double x = (n % 2 ? -1 : 1) * std::pow(10, decade(random));
    const double once = HalfWord::unpack(HalfWord::pack(x));
    ASSERT_NEAR(once, x, std::abs(x) / 512) << x;
    ASSERT_EQ(HalfWord::unpack(HalfWord::pack(once)), once);
  }
  EXPECT_EQ(HalfWord::unpack(HalfWord::pack(0.0)), 0.0);
  EXPECT_EQ(HalfWord::unpack(HalfWord::pack(1e-30)), 0.0);
  EXPECT_GT(HalfWord::unpack(HalfWord::pack(1e30)), 4e18);
  EXPECT_LT(HalfWord::unpack(HalfWord::pack(-1e30)), -4e18);
  for (const double whole : {1.0, -1.0, 0.5, 256.0, 511.0}) EXPECT_EQ(HalfWord::unpack(HalfWord::pack(whole)), whole);
  EXPECT_EQ(HalfWord::unpack(HalfWord::pack(511.9)), 512.0);
}

TEST(FewBits, a_fixed_place_is_within_half_a_step_on_both_sides_of_zero_and_stays_what_it_is) {
  constexpr double step = 3e-11;
  std::mt19937 random(1);
  std::uniform_real_distribution<double> coordinate(-60, 60);
  std::uint32_t words[FixedPlace::words];
  for (int n = 0; n < 100000; ++n) {
    const Vec3 x(coordinate(random), coordinate(random), 1e-6 * coordinate(random));
    FixedPlace::pack(x, step, words);
    const Vec3 once = FixedPlace::unpack(words, step);
    ASSERT_LE((once - x).cwiseAbs().maxCoeff(), 0.501 * step + 1e-14);
    FixedPlace::pack(once, step, words);
    ASSERT_EQ(FixedPlace::unpack(words, step), once);
  }
  FixedPlace::pack(Vec3::Zero(), step, words);
  EXPECT_EQ(FixedPlace::unpack(words, step), Vec3(0, 0, 0));
  EXPECT_THROW(FixedPlace::pack(Vec3(0, 0, 66.1), step, words), std::range_error);
  EXPECT_THROW(FixedPlace::pack(Vec3(-66.1, 0, 0), step, words), std::range_error);
  EXPECT_THROW(FixedPlace::pack(Vec3(NAN, 0, 0), step, words), std::range_error);
}

}  // namespace
}  // namespace solidcull
