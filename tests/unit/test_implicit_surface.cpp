#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>
#include <stdexcept>
#include <tuple>

#include "implicit_surface.h"
#include "mesh_of.h"

namespace solidcull {
namespace {

const double diagonal = std::sqrt(3.0) * voxel;  // the void voxel nearest to a point may lie this much behind the nearest void

/// Spheres that a test may change while a surface looks at them.
struct Bed {
  std::vector<Sphere> spheres;

  ImplicitSurface surface(double closing) const {
    return ImplicitSurface(voxel, closing, [this](const Vec3& lo, const Vec3& hi, const auto& visit) {
      for (const Sphere& s : spheres) {
        const Vec3 nearest = s.centre.cwiseMax(lo).cwiseMin(hi);
        if ((s.centre - nearest).norm() <= s.radius) visit(s);
      }
    });
  }
  bool is_void(const Vec3& p, double closing) const {
    for (const Sphere& s : spheres)
      if ((p - s.centre).norm() < s.radius + closing) return false;
    return true;
  }
};

Bed bed_on_lattice(int n, double d) {
  Bed bed;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      for (int k = 0; k < n; ++k) bed.spheres.push_back({d * Vec3(i, j, k) + Vec3(0.31, 0.17, 0.53) * voxel, d / 2});
  return bed;
}

Bed heap(int n, double size, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> at(-size / 2, size / 2), radius(0.5 * voxel, 2.5 * voxel);
  Bed bed;
  for (int i = 0; i < n; ++i) {
    const Vec3 c(at(random), at(random), at(random));
    bed.spheres.push_back({c, radius(random)});
  }
  return bed;
}

TEST(ImplicitSurface, refuses_lengths_without_meaning) {
  const auto nothing = [](const Vec3&, const Vec3&, const std::function<void(const Sphere&)>&) {};
  EXPECT_THROW(ImplicitSurface(0.0, 0.0, nothing), std::invalid_argument);
  EXPECT_THROW(ImplicitSurface(-1.0, 0.0, nothing), std::invalid_argument);
  EXPECT_THROW(ImplicitSurface(1.0, -1.0, nothing), std::invalid_argument);
  EXPECT_THROW(ImplicitSurface(1.0, 0.0, nullptr), std::invalid_argument);
}

TEST(ImplicitSurface, a_voxel_is_void_where_its_centre_is) {
  const Bed bed = heap(60, 24 * voxel, 5);
  for (const double closing : {0.0, 0.7 * voxel, 2.0 * voxel}) {
    ImplicitSurface surface = bed.surface(closing);
    for (int i = -17; i < 18; ++i)
      for (int j = -17; j < 18; ++j)
        for (int k = -17; k < 18; ++k) {
          const Voxel v{i, j, k};
          ASSERT_EQ(surface.is_void(v), bed.is_void(surface.centre(v), closing)) << i << ' ' << j << ' ' << k;
        }
  }
}

TEST(ImplicitSurface, finds_the_nearest_void_voxel) {
  const Bed bed = heap(400, 26 * voxel, 9);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> at(-13 * voxel, 13 * voxel);
  for (const double closing : {0.0, 1.3 * voxel}) {
    ImplicitSurface surface = bed.surface(closing);
    std::vector<Vec3> voids;
    for (int i = -26; i < 27; ++i)
      for (int j = -26; j < 27; ++j)
        for (int k = -26; k < 27; ++k)
          if (bed.is_void(Vec3(i, j, k) * voxel, closing)) voids.push_back(Vec3(i, j, k) * voxel);
    int found = 0;
    for (int n = 0; n < 300; ++n) {
      const Vec3 p(at(random), at(random), at(random));
      double nearest = 1.0;
      for (const Vec3& v : voids) nearest = std::min(nearest, (v - p).norm());
      for (const double depth : {0.5 * voxel, 2.0 * voxel, 8.0 * voxel}) {
        const Voxel v = surface.void_within(p, depth);
        ASSERT_EQ(v.none(), nearest > depth + closing);
        EXPECT_NEAR(surface.depth(p, depth), std::min(depth, nearest - closing), 1e-12);
        if (v.none()) continue;
        ++found;
        EXPECT_TRUE(bed.is_void(surface.centre(v), closing));
        EXPECT_NEAR((surface.centre(v) - p).norm(), nearest, 1e-12);
      }
    }
    EXPECT_GT(found, 100);
  }
}

TEST(ImplicitSurface, depth_in_a_lattice_is_the_distance_to_its_faces) {
  const double d = 2 * voxel, closing = d;
  const int n = 14;
  const Bed bed = bed_on_lattice(n, d);
  ImplicitSurface surface = bed.surface(closing);
  for (const Sphere& s : bed.spheres) {
    // The faces are the planes that touch the outermost granules; between those the closed surface sinks in by the sagitta of the
    // closing ball over the gaps of the lattice.
    const Vec3 from_corner = s.centre - bed.spheres.front().centre;
    const Vec3 from_far = bed.spheres.back().centre - s.centre;
    const double to_face = std::min(from_corner.minCoeff(), from_far.minCoeff()) + d / 2;
    const double reach = d / 2 + closing, gap = d / std::sqrt(2.0);
    const double sagitta = reach - std::sqrt(reach * reach - gap * gap);
    const double depth = surface.depth(s.centre, 5 * d);
    EXPECT_LE(depth, std::min(to_face, 5 * d) + diagonal);
    EXPECT_GE(depth, std::min(to_face - sagitta, 5 * d) - 1e-12);
  }
}

TEST(ImplicitSurface, pores_are_no_void) {
  const double d = 2 * voxel;
  const Bed bed = bed_on_lattice(10, d);
  const Vec3 pore = 0.5 * (bed.spheres[444].centre + bed.spheres[555].centre);
  ASSERT_TRUE(bed.is_void(pore, 0.0));
  ImplicitSurface open = bed.surface(0.0), closed = bed.surface(0.5 * d);
  EXPECT_LT(open.depth(pore, 3 * d), 0.5 * d);
  EXPECT_EQ(closed.depth(pore, 3 * d), 3 * d);
}

TEST(ImplicitSurface, a_cavity_wider_than_closing_is_a_surface_too) {
  const double d = 2 * voxel, closing = 0.6 * d;
  Bed bed = bed_on_lattice(21, d);
  const Vec3 middle = bed.spheres[(21 * 21 * 21) / 2].centre;
  const double hole = 3 * d;
  Bed hollow;
  for (const Sphere& s : bed.spheres)
    if ((s.centre - middle).norm() > hole) hollow.spheres.push_back(s);
  ImplicitSurface whole = bed.surface(closing), surface = hollow.surface(closing);
  const Vec3 beside = middle + Vec3(hole + 1.5 * d, 0, 0);
  EXPECT_EQ(whole.depth(beside, 4 * d), 4 * d);
  EXPECT_LT(surface.depth(beside, 4 * d), 2.5 * d);
  EXPECT_LT(surface.depth(middle, 4 * d), 0.0);
}

TEST(ImplicitSurface, depth_of_a_ball_is_that_of_its_surface) {
  Bed bed;
  bed.spheres = {{Vec3(0.4, 0.2, 0.1) * voxel, 15 * voxel}};
  for (const double closing : {0.0, 2.5 * voxel}) {
    ImplicitSurface surface = bed.surface(closing);
    for (double r = 0; r < 14.5; r += 0.37) {
      const Vec3 p = bed.spheres[0].centre + r * voxel * Vec3(0.6, -0.48, 0.64);
      const double depth = surface.depth(p, 20 * voxel), exact = (15 - r) * voxel;
      EXPECT_GE(depth, exact - 1e-12);
      EXPECT_LE(depth, exact + diagonal);
    }
  }
}

TEST(ImplicitSurface, the_order_of_questions_does_not_matter) {
  const Bed bed = heap(300, 22 * voxel, 17);
  std::mt19937 random(2);
  std::vector<Vec3> points;
  for (const Sphere& s : bed.spheres) points.push_back(s.centre);
  const auto answers = [&](const std::vector<Vec3>& in_this_order, const Bed& from) {
    ImplicitSurface surface = from.surface(voxel);
    std::set<std::tuple<double, double, double, int, int, int>> all;
    for (const Vec3& p : in_this_order) {
      const Voxel v = surface.void_within(p, 6 * voxel);
      all.insert({p.x(), p.y(), p.z(), v.i, v.j, v.k});
    }
    return all;
  };
  const auto first = answers(points, bed);
  Bed shuffled = bed;
  std::shuffle(points.begin(), points.end(), random);
  std::shuffle(shuffled.spheres.begin(), shuffled.spheres.end(), random);
  EXPECT_EQ(first, answers(points, shuffled));
}

TEST(ImplicitSurface, a_hint_is_taken_only_while_it_holds) {
  Bed bed;
  bed.spheres = {{Vec3::Zero(), 5 * voxel}};
  ImplicitSurface surface = bed.surface(0.0);
  const Voxel near = surface.void_within(Vec3(4 * voxel, 0, 0), 3 * voxel);
  const Voxel other{7, 0, 0};
  ASSERT_FALSE(near.none());
  const auto is = [](const Voxel& a, const Voxel& b) { return a.i == b.i && a.j == b.j && a.k == b.k; };
  EXPECT_TRUE(is(surface.void_within(Vec3(4.5 * voxel, 0, 0), 3 * voxel, other), other));
  EXPECT_FALSE(is(surface.void_within(Vec3(3 * voxel, 0, 0), 3 * voxel, other), other)) << "out of reach";
  bed.spheres.push_back({Vec3(7 * voxel, 0, 0), 1.5 * voxel});
  surface.touch(bed.spheres.back());
  EXPECT_FALSE(is(surface.void_within(Vec3(4.5 * voxel, 0, 0), 3 * voxel, other), other)) << "no void any more";
}

TEST(ImplicitSurface, a_touch_has_only_near_blocks_evaluated_again) {
  const double closing = voxel;
  Bed bed = heap(500, 40 * voxel, 23);
  ImplicitSurface surface = bed.surface(closing);
  const auto look_everywhere = [&] {
    for (int i = -28; i < 28; ++i)
      for (int j = -28; j < 28; ++j)
        for (int k = -28; k < 28; ++k) surface.is_void({i, j, k});
  };
  look_everywhere();
  const std::size_t blocks = surface.blocks_evaluated();
  EXPECT_EQ(blocks, 8u * 8u * 8u);  // -28 .. 27 is part of eight blocks a side
  EXPECT_EQ(surface.blocks_held(), blocks);
  look_everywhere();
  EXPECT_EQ(surface.blocks_evaluated(), blocks) << "nothing had changed";

  const Sphere gone = bed.spheres.back();
  bed.spheres.pop_back();
  surface.touch(gone);
  look_everywhere();
  EXPECT_GT(surface.blocks_evaluated(), blocks);
  EXPECT_LE(surface.blocks_evaluated(), blocks + 8) << "a ball narrower than a block reaches eight blocks at most";
  EXPECT_EQ(surface.blocks_held(), blocks);
  for (int i = -28; i < 28; ++i)
    for (int j = -28; j < 28; ++j)
      for (int k = -28; k < 28; ++k) {
        const Voxel v{i, j, k};
        ASSERT_EQ(surface.is_void(v), bed.is_void(surface.centre(v), closing));
      }

  surface.touch_all();
  EXPECT_EQ(surface.blocks_held(), 0u);
  look_everywhere();
  EXPECT_EQ(surface.blocks_held(), blocks);
}

TEST(ImplicitSurface, follows_spheres_that_move) {
  const double closing = 0.8 * voxel;
  Bed bed = heap(200, 20 * voxel, 31);
  ImplicitSurface surface = bed.surface(closing);
  std::mt19937 random(4);
  std::uniform_real_distribution<double> step(-3 * voxel, 3 * voxel), fall(0.0, 40 * voxel);
  for (int round = 0; round < 30; ++round) {
    for (int n = round % 7; n < 200; n += 7) {
      Sphere& s = bed.spheres[n];
      surface.touch(s);
      s.centre += Vec3(step(random), step(random), step(random) - (round % 5 == 0 ? fall(random) : 0.0));
      surface.touch(s);
    }
    surface.clear_touched();
    for (const Sphere& s : bed.spheres) {
      const Voxel v = surface.void_within(s.centre, 5 * voxel);
      ImplicitSurface fresh = bed.surface(closing);
      const Voxel w = fresh.void_within(s.centre, 5 * voxel);
      ASSERT_EQ(std::tie(v.i, v.j, v.k), std::tie(w.i, w.j, w.k));
      if (&s - bed.spheres.data() > 20) break;  // each fresh surface starts from nothing
    }
  }
}

TEST(ImplicitSurface, knows_where_it_was_touched) {
  Bed bed;
  ImplicitSurface surface = bed.surface(voxel);
  const Vec3 here(20 * voxel, 0, 0);
  EXPECT_FALSE(surface.touched_near(here, 1.0));
  surface.touch({here, 2 * voxel});
  EXPECT_TRUE(surface.touched_near(here, 0.0));
  EXPECT_TRUE(surface.touched_near(here + Vec3(0, 0, 11 * voxel), 5 * voxel));
  EXPECT_FALSE(surface.touched_near(here + Vec3(0, 0, 40 * voxel), 5 * voxel));
  EXPECT_TRUE(surface.touched_near(here + Vec3(0, 0, 40 * voxel), 40 * voxel));
  surface.clear_touched();
  EXPECT_FALSE(surface.touched_near(here, 1.0));
  surface.touch_all();
  EXPECT_TRUE(surface.touched_near(here, 0.0));
  surface.clear_touched();
  EXPECT_FALSE(surface.touched_near(here, 1.0));

  // Many touched blocks are looked up one by one, few are gone through: both must say the same.
  std::mt19937 random(6);
  std::uniform_real_distribution<double> at(-0.1, 0.1);
  for (int n = 0; n < 300; ++n) surface.touch({Vec3(at(random), at(random), at(random)), voxel});
  for (int n = 0; n < 500; ++n) {
    const Vec3 p(at(random), at(random), at(random));
    bool near = false;
    for (double reach = 0; reach < 60 * voxel; reach += 1.7 * voxel) {
      const bool now = surface.touched_near(p, reach);
      EXPECT_TRUE(now || !near) << "a longer reach cannot find less";
      near = now;
    }
  }
}

}  // namespace
}  // namespace solidcull
