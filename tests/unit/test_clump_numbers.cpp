#include <gtest/gtest.h>

#include "clump_numbers.h"

namespace solidcull {
namespace {

/// Each of its numbers is another one.
Clump numbered(int from) {
  Clump c;
  c.number = from;
  c.spheres = from + 1;
  c.mass = from + 2.5;
  c.lies = {Vec3(from + 3.5, from + 4.5, from + 5.5), Eigen::Quaterniond(from + 9.5, from + 6.5, from + 7.5, from + 8.5),
            Vec3(from + 10.5, from + 11.5, from + 12.5)};
  c.velocity = Vec3(from + 13.5, from + 14.5, from + 15.5);
  c.angular_momentum = Vec3(from + 16.5, from + 17.5, from + 18.5);
  c.rest = {from + 19.5, from + 20.5};
  return c;
}

void expect_same(const Clump& a, const Clump& b) {
  EXPECT_EQ(a.number, b.number);
  EXPECT_EQ(a.spheres, b.spheres);
  EXPECT_EQ(a.mass, b.mass);
  EXPECT_EQ(a.lies.centre, b.lies.centre);
  EXPECT_EQ(a.lies.turn.coeffs(), b.lies.turn.coeffs());
  EXPECT_EQ(a.lies.inertia, b.lies.inertia);
  EXPECT_EQ(a.velocity, b.velocity);
  EXPECT_EQ(a.angular_momentum, b.angular_momentum);
  EXPECT_EQ(a.rest, b.rest);
}

TEST(ClumpNumbers, go_out_and_come_back_one_after_the_other) {
  std::vector<double> numbers = {-1};  // something stands before them
  pack(numbered(100), numbers);
  pack(numbered(200), numbers);
  const std::size_t size = clump_numbers + 2;
  ASSERT_EQ(numbers.size(), 1 + 2 * size);
  EXPECT_EQ(numbers[0], -1);
  expect_same(unpack_clump(&numbers[1], 2), numbered(100));
  expect_same(unpack_clump(&numbers[1 + size], 2), numbered(200));
}

TEST(ClumpNumbers, may_be_without_what_the_engine_keeps_besides) {
  Clump c = numbered(7);
  c.rest.clear();
  std::vector<double> numbers;
  pack(c, numbers);
  ASSERT_EQ(numbers.size(), static_cast<std::size_t>(clump_numbers));
  expect_same(unpack_clump(numbers.data(), 0), c);
}

TEST(Clump, moves_as_its_velocity_and_spin_say) {
  Clump c = numbered(1);
  c.lies.turn = Eigen::Quaterniond(0.3, 0.5, -0.7, 0.1).normalized();
  const Vec3 velocity(1, 2, 3), spin(-4, 5, 6);
  c.move_as(velocity, spin);
  EXPECT_LT((c.spin() - spin).norm(), 1e-14 * spin.norm());
  EXPECT_LT((c.angular_momentum - c.lies.tensor() * spin).norm(), 1e-14 * c.angular_momentum.norm());
  EXPECT_NEAR(c.kinetic_energy(), 0.5 * c.mass * velocity.squaredNorm() + 0.5 * spin.dot(c.lies.tensor() * spin),
              1e-14 * c.kinetic_energy());
}

}  // namespace
}  // namespace solidcull
