#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "granule_store.h"
#include "packed_history.h"

namespace solidcull {
namespace {

using Words = std::vector<std::uint64_t>;

Vec3 in_plane(std::mt19937& random, const Vec3& normal, double size) {
  std::uniform_real_distribution<double> number(-1, 1);
  const Vec3 v(number(random), number(random), number(random));
  return size * (v - v.dot(normal) * normal);
}
Vec3 direction(std::mt19937& random) {
  std::normal_distribution<double> number;
  const double x = number(random), y = number(random), z = number(random);
  return Vec3(x, y, z).normalized();
}

TEST(PackedHistory, a_word_holds_two_vectors) {
  PackedHistory packed;
  packed.set_layout(0, {});
  EXPECT_EQ(packed.words(), 1u);
  packed.set_layout(3, {0});
  EXPECT_EQ(packed.words(), 1u);
  packed.set_layout(6, {0, 3});
  EXPECT_EQ(packed.words(), 1u);
  packed.set_layout(7, {0, 3});
  EXPECT_EQ(packed.words(), 2u);
  packed.set_layout(12, {0, 3, 6, 9});
  EXPECT_EQ(packed.words(), 2u);
}

TEST(PackedHistory, vectors_in_the_plane_of_contact_come_back_to_a_hundredth_and_again_to_the_bit) {
  PackedHistory packed;
  packed.set_layout(6, {0, 3});
  std::mt19937 random(1);
  double worst = 0;
  for (int k = 0; k < 20000; ++k) {
    const Vec3 normal = direction(random), shear = in_plane(random, normal, std::pow(10, -(k % 12))),
               torque = in_plane(random, normal, 1e-9);
    const double history[] = {shear[0], shear[1], shear[2], torque[0], torque[1], torque[2]};
    Words words;
    packed.pack(k, history, 0.003 * normal, words);
    ASSERT_EQ(words.size(), 1u);
    double back[6];
    packed.unpack(words.data(), 0.003 * normal, back);
    worst = std::max(worst, (Vec3(back[0], back[1], back[2]) - shear).norm() / shear.norm());
    worst = std::max(worst, (Vec3(back[3], back[4], back[5]) - torque).norm() / torque.norm());
    Words again;
    packed.pack(k, back, 0.003 * normal, again);
    EXPECT_EQ(again, words);
    // as the other granule sees it
    double other[6];
    for (int d = 0; d < 6; ++d) other[d] = -back[d];
    Words turned;
    packed.pack(k, other, -0.003 * normal, turned);
    packed.unpack(turned.data(), -0.003 * normal, other);
    for (int d = 0; d < 6; ++d) EXPECT_NEAR(other[d], -back[d], 1e-12 * std::abs(back[d]) + 1e-25);
  }
  EXPECT_LT(worst, 0.012);
  std::printf("vectors off by at most %.4f of their size\n", worst);
}

TEST(PackedHistory, other_numbers_come_back_to_a_hundred_thousandth) {
  PackedHistory packed;
  packed.set_layout(5, {1});
  for (const double x : {0.0, 1.0, -3.14159265, 1e-20, -7e20}) {
    const double history[] = {x, 0, 1e-6, 0, 2 * x};
    Words words;
    packed.pack(1, history, Vec3(1, 0, 0), words);
    ASSERT_EQ(words.size(), 2u);
    double back[5];
    packed.unpack(words.data(), Vec3(1, 0, 0), back);
    EXPECT_NEAR(back[0], x, 1e-5 * std::abs(x));
    EXPECT_NEAR(back[2], 1e-6, 1e-8);
    EXPECT_NEAR(back[4], 2 * x, 2e-5 * std::abs(x));
  }
}

TEST(PackedHistory, no_history_takes_no_room) {
  PackedHistory packed;
  packed.set_layout(3, {0});
  const double none[] = {0, 0, 0}, some[] = {0, 0, 1};
  Words words;
  packed.pack(1, none, Vec3(1, 0, 0), words);
  EXPECT_TRUE(words.empty());
  packed.pack(2, some, Vec3(1, 0, 0), words);
  EXPECT_EQ(words.size(), 1u);
}

TEST(PackedHistory, each_is_found_by_its_partner) {
  PackedHistory packed;
  packed.set_layout(9, {0, 3, 6});
  Words words;
  for (int tag = 1; tag <= 8; ++tag) {
    const double history[9] = {0, 1.0 * tag};
    packed.pack(tag, history, Vec3(1, 0, 0), words);
  }
  for (int tag = 1; tag <= 8; ++tag) {
    EXPECT_FALSE(PackedHistory::alike(tag, tag + 1));
    const std::size_t at = packed.find(words, tag);
    ASSERT_LT(at, words.size());
    double back[9];
    packed.unpack(&words[at], Vec3(1, 0, 0), back);
    EXPECT_NEAR(back[1], tag, 0.01 * tag);
  }
  EXPECT_EQ(packed.find(words, 9), words.size());
}

TEST(PackedHistory, the_store_keeps_them_with_a_granule_and_lets_its_record_be) {
  GranuleStore store(1.0, GranuleStore::Precision::rounded);
  std::vector<double> record = {1.5, 2.5, 3.5, 4.5}, back;
  for (int tag = 1; tag <= 100; ++tag) {
    StoredGranule g;
    g.tag = tag;
    g.body = 1;
    g.radius = 0.1;
    g.mass = 2;
    g.held = tag % 2;
    g.position = Vec3(tag, 0, 0);
    store.add(g, record.data(), 4, {1, 2});
    Words tail(static_cast<std::size_t>(tag % 7), static_cast<std::uint64_t>(-tag));
    store.set_tail(*store.find(tag), tail);
  }
  for (const bool known : {true, false}) {
    for (int tag = 1; tag <= 100; ++tag) {
      const WordView is = store.tail(*store.find(tag));
      const Words tail(is.begin(), is.end());
      EXPECT_EQ(tail, Words(static_cast<std::size_t>(tag % 7), static_cast<std::uint64_t>(-tag)));
      store.record(tag, back);
      EXPECT_EQ(back, known ? record : (std::vector<double>{1.5, 0, 0, 4.5}));
      EXPECT_EQ(store.get(tag).held, tag % 2);
    }
    store.merge(1, 2, [](StoredGranule& g) { g.load_change[0] = 1; });
    store.merge(2, 1, [](StoredGranule& g) { g.load_change[0] = 0; });
    store.forget_transient();
  }
  store.set_tail(*store.find(3), {});
  store.take(3, back);
  EXPECT_EQ(back, (std::vector<double>{1.5, 0, 0, 4.5}));
}

}  // namespace
}  // namespace solidcull
