#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <random>

#include "contact_tail.h"

namespace solidcull {
namespace {

using Words = ContactTail::Words;

Vec3 direction(std::mt19937& random) {
  std::normal_distribution<double> number;
  const double x = number(random), y = number(random), z = number(random);
  return Vec3(x, y, z).normalized();
}
Vec3 in_plane(std::mt19937& random, const Vec3& normal, double size) {
  const Vec3 v = direction(random);
  return size * (v - v.dot(normal) * normal);
}
Words words_of(const ContactTail& tail) {
  Words words;
  tail.write(words);
  return words;
}
HistoryBits bits_of(std::size_t width, const std::vector<int>& vectors) {
  HistoryBits bits;
  bits.set_layout(width, vectors);
  return bits;
}

TEST(ContactTail, vectors_come_back_to_a_few_1e13ths_whatever_stands_out_of_the_plane) {
  const HistoryBits bits = bits_of(6, {0, 3});
  std::mt19937 random(1);
  double worst = 0;
  for (int k = 0; k < 20000; ++k) {
    const Vec3 normal = direction(random);
    const Vec3 shear = in_plane(random, normal, std::pow(10, -(k % 300))), torque = std::pow(10, k % 40 - 20) * direction(random);
    const double history[] = {shear[0], shear[1], shear[2], torque[0], torque[1], torque[2]};
    ContactTail tail(bits);
    ASSERT_TRUE(tail.add(k, history, 0.003 * normal));
    const ContactTail again(bits, words_of(tail));
    double back[6];
    ASSERT_TRUE(again.history(0, 0.003 * normal, back));
    worst = std::max(worst, (Vec3(back[0], back[1], back[2]) - shear).norm() / shear.norm());
    worst = std::max(worst, (Vec3(back[3], back[4], back[5]) - torque).norm() / torque.norm());
    ContactTail second(bits);
    ASSERT_TRUE(second.add(k, back, 0.003 * normal));
    EXPECT_EQ(words_of(second), words_of(tail)) << "rounded twice";
  }
  EXPECT_LT(worst, 2e-13);
  EXPECT_GT(worst, 2e-14) << "fewer bits would do";
}

TEST(ContactTail, a_history_in_the_plane_takes_four_words) {
  const HistoryBits bits = bits_of(6, {0, 3});
  const Vec3 normal = Vec3(1, 2, 3).normalized();
  std::mt19937 random(2);
  const Vec3 shear = in_plane(random, normal, 1e-7), torque = in_plane(random, normal, 1e-9);
  const double history[] = {shear[0], shear[1], shear[2], torque[0], torque[1], torque[2]};
  ContactTail tail(bits);
  tail.add(7, history, normal);
  EXPECT_EQ(words_of(tail).size(), 5u);
  for (int k = 0; k < 99; ++k) tail.add(k, history, normal);
  EXPECT_LT(words_of(tail).size(), 400u);
  EXPECT_GT(words_of(tail).size(), 350u);
}

TEST(ContactTail, what_is_zero_takes_a_bit_and_no_history_none) {
  const HistoryBits bits = bits_of(4, {0});
  const double zero[4] = {0, 0, 0, 0};
  ContactTail tail(bits);
  EXPECT_TRUE(words_of(tail).empty());
  tail.add(1, zero, Vec3(1, 0, 0));
  EXPECT_EQ(words_of(tail).size(), 1u);
  tail.add(2, nullptr, Vec3(1, 0, 0));
  EXPECT_EQ(words_of(tail).size(), 2u);
  const ContactTail again(bits, words_of(tail));
  double history[4] = {1, 1, 1, 1};
  EXPECT_TRUE(again.history(0, Vec3(1, 0, 0), history));
  for (const double x : history) EXPECT_EQ(x, 0.0);
  EXPECT_FALSE(again.history(1, Vec3(1, 0, 0), history));
}

TEST(ContactTail, numbers_that_are_no_vectors_come_back_to_the_bit) {
  const HistoryBits bits = bits_of(5, {1});
  const double nan = std::nan("7");
  const double history[] = {-0.0, 0, 1, 0, nan};
  ContactTail tail(bits);
  ASSERT_TRUE(tail.add(-5, history, Vec3(1, 0, 0)));
  double back[5];
  const ContactTail again(bits, words_of(tail));
  ASSERT_TRUE(again.history(0, Vec3(1, 0, 0), back));
  EXPECT_TRUE(std::signbit(back[0]) && back[0] == 0);
  EXPECT_TRUE(std::isnan(back[4]));
  EXPECT_EQ(again.partner(0), -5);
}

TEST(ContactTail, refuses_what_it_cannot_keep_and_stays_as_it_was) {
  const HistoryBits bits = bits_of(7, {0, 3});
  const double good[] = {0, 1, 2, 3, 0, 0, 4}, bad[] = {0, 1, 2, 3, 0, HUGE_VAL, 4};
  ContactTail tail(bits);
  ASSERT_TRUE(tail.add(1, good, Vec3(1, 0, 0)));
  const Words before = words_of(tail);
  EXPECT_FALSE(tail.add(2, bad, Vec3(1, 0, 0)));
  EXPECT_FALSE(tail.add(2, good, Vec3(0, 0, 0)));
  EXPECT_EQ(words_of(tail), before);
  ASSERT_TRUE(tail.add(3, good, Vec3(1, 0, 0)));
  double back[7];
  ASSERT_TRUE(ContactTail(bits, words_of(tail)).history(1, Vec3(1, 0, 0), back));
  for (int d = 0; d < 7; ++d) EXPECT_NEAR(back[d], good[d], 1e-12);
}

TEST(ContactTail, partners_come_and_go_and_the_others_stay) {
  const HistoryBits bits = bits_of(4, {1});
  std::mt19937 random(3);
  std::map<std::int64_t, std::pair<Vec3, std::vector<double>>> due;  // normal, history
  Words words;
  for (int k = 0; k < 3000; ++k) {
    ContactTail tail(bits, words);
    const auto partner = static_cast<std::int64_t>(random() % 40) - 3;
    if (due.count(partner)) {
      ASSERT_TRUE(ContactTail::names(words, partner));
      tail.erase(tail.find(partner));
      due.erase(partner);
    } else {
      EXPECT_FALSE(ContactTail::names(words, partner));
      EXPECT_EQ(tail.find(partner), ContactTail::none);
      const Vec3 normal = direction(random), vector = in_plane(random, normal, 1);
      std::vector<double> history = {double(random()), vector[0], vector[1], vector[2]};
      if (random() % 4 == 0) history.clear();
      ASSERT_TRUE(tail.add(partner, history.empty() ? nullptr : history.data(), normal));
      due[partner] = {normal, history};
    }
    words = words_of(tail);
    ASSERT_EQ(ContactTail(bits, words).size(), due.size());
  }
  const ContactTail tail(bits, words);
  std::size_t seen = 0;
  ContactTail::for_each(words, [&](std::int64_t partner) {
    EXPECT_EQ(partner, tail.partner(seen));
    const auto& [normal, history] = due.at(partner);
    double back[4];
    ASSERT_EQ(tail.history(seen++, normal, back), !history.empty());
    if (history.empty()) return;
    EXPECT_EQ(back[0], history[0]);
    for (int d = 1; d < 4; ++d) EXPECT_NEAR(back[d], history[static_cast<std::size_t>(d)], 3e-13);
  });
  EXPECT_EQ(seen, due.size());
}

}  // namespace
}  // namespace solidcull
