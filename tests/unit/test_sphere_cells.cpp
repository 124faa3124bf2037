#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>

#include "sphere_cells.h"

namespace solidcull {
namespace {

class RandomPlaces {
 public:
  explicit RandomPlaces(unsigned seed) : engine_(seed) {}
  double between(double lo, double hi) { return std::uniform_real_distribution<double>(lo, hi)(engine_); }
  Vec3 place(const Vec3& size) {
    const double x = between(-0.5, 0.5), y = between(-0.5, 0.5), z = between(-0.5, 0.5);
    return size.cwiseProduct(Vec3(x, y, z));
  }
  std::vector<Sphere> spheres(int n, const Vec3& size, double smallest, double largest) {
    std::vector<Sphere> all;
    for (int k = 0; k < n; ++k) {
      const Vec3 c = place(size);
      all.push_back({c, between(smallest, largest)});
    }
    return all;
  }

 private:
  std::mt19937 engine_;
};

bool truly_near(const std::vector<Sphere>& spheres, const Sphere& s, double gap) {
  for (const Sphere& other : spheres)
    if ((other.centre - s.centre).norm() - other.radius - s.radius < gap) return true;
  return false;
}

void expect_all_of_the_box(const SphereCells& cells, const std::vector<Sphere>& spheres, const Vec3& lo, const Vec3& hi) {
  std::set<std::size_t> visited;
  EXPECT_TRUE(cells.for_each_in_box(lo, hi, [&](std::size_t index, const Sphere& s) {
    EXPECT_TRUE(visited.insert(index).second) << "sphere " << index << " is visited twice";
    EXPECT_EQ(s.centre, spheres[index].centre);
    EXPECT_EQ(s.radius, spheres[index].radius);
    return true;
  }));
  for (std::size_t k = 0; k < spheres.size(); ++k) {
    const Vec3& c = spheres[k].centre;
    const bool in_box = (c.array() >= lo.array()).all() && (c.array() <= hi.array()).all();
    EXPECT_TRUE(visited.count(k) || !in_box) << "sphere " << k << " is in the box and was not visited";
  }
}

TEST(SphereCells, none_are_near_to_nothing) {
  SphereCells cells;
  const auto never = [](std::size_t, const Sphere&) {
    ADD_FAILURE();
    return true;
  };
  EXPECT_FALSE(cells.any_near({Vec3::Zero(), 1}, 100));
  EXPECT_TRUE(cells.for_each_in_box(Vec3::Constant(-1), Vec3::Constant(1), never));
  cells.build({{Vec3::Zero(), 1}}, 1);
  cells.build({}, 1);
  EXPECT_EQ(cells.size(), 0u);
  EXPECT_EQ(cells.largest_radius(), 0.0);
  EXPECT_FALSE(cells.any_near({Vec3::Zero(), 1}, 100));
  EXPECT_TRUE(cells.for_each_in_box(Vec3::Constant(-1), Vec3::Constant(1), never));
}

TEST(SphereCells, one_sphere_is_near_up_to_the_gap) {
  SphereCells cells;
  cells.build({{Vec3(1, 2, 3), 0.5}}, 0.1);
  EXPECT_EQ(cells.largest_radius(), 0.5);
  EXPECT_TRUE(cells.any_near({Vec3(2.7, 2, 3), 1.0}, 0.21));
  EXPECT_FALSE(cells.any_near({Vec3(2.7, 2, 3), 1.0}, 0.19));
}

TEST(SphereCells, any_near_answers_as_brute_force) {
  RandomPlaces random(1);
  for (const Vec3& size : {Vec3(1, 1, 1), Vec3(3, 1, 0.1), Vec3(1, 0, 0), Vec3(0, 0, 0)})
    for (const double cell : {0.02, 0.1, 5.0}) {
      const std::vector<Sphere> spheres = random.spheres(300, size, 0.005, 0.05);  // size ratio 10
      SphereCells cells;
      cells.build(spheres, cell);
      ASSERT_EQ(cells.size(), spheres.size());
      int near = 0;
      for (int n = 0; n < 500; ++n) {
        const Sphere s{random.place(1.6 * size + Vec3::Constant(0.3)), random.between(0.002, 0.2)};
        for (const double gap : {0.0, 0.03, -0.005}) {
          ASSERT_EQ(cells.any_near(s, gap), truly_near(spheres, s, gap)) << "gap " << gap << ", cell " << cell;
          near += truly_near(spheres, s, gap);
        }
      }
      EXPECT_GT(near, 0);
      EXPECT_LT(near, 1500);
    }
}

TEST(SphereCells, any_near_asks_among_those_that_count_only) {
  RandomPlaces random(4);
  const std::vector<Sphere> spheres = random.spheres(300, Vec3(1, 1, 1), 0.005, 0.05);
  SphereCells cells;
  cells.build(spheres, 0.1);
  int near = 0, near_but_not_counted = 0;
  for (int n = 0; n < 1500; ++n) {
    const Sphere s{random.place(Vec3(1.6, 1.6, 1.6)), random.between(0.002, 0.05)};
    const std::size_t every = 2 + n % 5;
    std::vector<Sphere> counted;
    for (std::size_t k = 0; k < spheres.size(); k += every) counted.push_back(spheres[k]);
    const bool due = truly_near(counted, s, 0.01);
    ASSERT_EQ(cells.any_near(s, 0.01, [&](std::size_t index) { return index % every == 0; }), due);
    near += due;
    near_but_not_counted += !due && truly_near(spheres, s, 0.01);
  }
  EXPECT_GT(near, 50);
  EXPECT_GT(near_but_not_counted, 50);
  const auto none = [](std::size_t) { return false; };
  EXPECT_FALSE(cells.any_near({Vec3::Zero(), 1}, 1, none));
}

TEST(SphereCells, nothing_is_near_by_a_gap_below_every_overlap) {
  SphereCells cells;
  cells.build({{Vec3::Zero(), 0.1}, {Vec3(0.1, 0, 0), 0.1}}, 0.2);
  EXPECT_FALSE(cells.any_near({Vec3(0.05, 0, 0), 0.1}, -1.0));
}

TEST(SphereCells, box_queries_give_each_sphere_in_the_box_once) {
  RandomPlaces random(2);
  for (const Vec3& size : {Vec3(1, 1, 1), Vec3(5, 0.5, 0.5), Vec3(1, 1, 0)}) {
    const std::vector<Sphere> spheres = random.spheres(400, size, 0.01, 0.02);
    SphereCells cells;
    cells.build(spheres, 0.05);
    for (int n = 0; n < 200; ++n) {
      const Vec3 a = random.place(1.2 * size), b = random.place(1.2 * size);
      expect_all_of_the_box(cells, spheres, a.cwiseMin(b), a.cwiseMax(b));
    }
    expect_all_of_the_box(cells, spheres, Vec3::Constant(-100), Vec3::Constant(100));
    for (const Sphere& s : spheres) expect_all_of_the_box(cells, spheres, s.centre, s.centre);
  }
}

TEST(SphereCells, a_visit_that_says_false_is_the_last) {
  RandomPlaces random(3);
  SphereCells cells;
  cells.build(random.spheres(100, Vec3::Ones(), 0.01, 0.02), 0.1);
  int visits = 0;
  EXPECT_FALSE(
      cells.for_each_in_box(Vec3::Constant(-1), Vec3::Constant(1), [&](std::size_t, const Sphere&) { return ++visits < 7; }));
  EXPECT_EQ(visits, 7);
}

TEST(SphereCells, two_spheres_far_apart_need_no_grid_in_between) {
  SphereCells cells;
  cells.build({{Vec3::Zero(), 0.001}, {Vec3::Constant(1000), 0.001}}, 0.002);
  EXPECT_TRUE(cells.any_near({Vec3::Constant(1000), 0.001}, 0));
  EXPECT_TRUE(cells.any_near({Vec3::Zero(), 0.001}, 0));
  EXPECT_FALSE(cells.any_near({Vec3::Constant(500), 0.001}, 0));
}

TEST(SphereCells, building_anew_forgets_what_was_there) {
  SphereCells cells;
  cells.build({{Vec3::Zero(), 1}}, 1);
  cells.build({{Vec3(10, 0, 0), 0.1}}, 1);
  EXPECT_EQ(cells.size(), 1u);
  EXPECT_EQ(cells.largest_radius(), 0.1);
  EXPECT_FALSE(cells.any_near({Vec3::Zero(), 1}, 0));
}

TEST(SphereCells, places_that_are_no_numbers_lead_nowhere) {
  const double nan = std::nan(""), inf = HUGE_VAL;
  for (const double bad : {nan, inf, -inf})
    for (const bool first : {true, false}) {
      std::vector<Sphere> spheres = {{Vec3::Zero(), 0.1}, {Vec3(1, 0, 0), 0.1}, {Vec3(0, 1, 0), 0.1}};
      spheres.insert(first ? spheres.begin() : spheres.end(), {Vec3(0, bad, 0), 0.1});
      SphereCells cells;
      cells.build(spheres, 0.2);
      EXPECT_EQ(cells.size(), 4u);
      EXPECT_TRUE(cells.any_near({Vec3(1.05, 0, 0), 0.1}, 0.0));
      EXPECT_FALSE(cells.any_near({Vec3(bad, 0, 0), 0.1}, 0.0));
    }
}

}  // namespace
}  // namespace solidcull
