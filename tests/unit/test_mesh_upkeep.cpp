// A kept interface mesh is what it would be if it were made at once, whatever has come and gone before.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

#include "interface_mesh.h"
#include "mesh_of.h"

namespace solidcull {
namespace {

constexpr double d = 2 * voxel, closing = 0.6 * d;  // as the fix has them (m)

/// A loose packing: granules of a lattice, shaken, of different sizes.
std::vector<Sphere> packing(int n, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> u(-1, 1);
  std::vector<Sphere> granules;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      for (int k = 0; k < n; ++k)
        granules.push_back(
            {1.05 * d * Vec3(i, j, k) + 0.02 * d * Vec3(u(random), u(random), u(random)), 0.5 * d * (1 + 0.03 * u(random))});
  return granules;
}

/// Largest difference of the level sets in a box, in voxels.
double largest_difference(const InterfaceMesh& a, const InterfaceMesh& b, const Vec3& lo, const Vec3& hi, int samples = 20000) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> u(0.0, 1.0);
  double most = 0;
  for (int n = 0; n < samples; ++n) {
    const Vec3 p = lo.array() + (hi - lo).array() * Vec3(u(random), u(random), u(random)).array();
    most = std::max(most, std::abs(a.signed_distance(p) - b.signed_distance(p)));
  }
  return most / voxel;
}

/// Granules of a body, those around it, and the mesh that is kept.
struct KeptBody {
  std::vector<Sphere> granules, exterior;
  InterfaceMesh mesh{voxel, closing};

  void come(const Sphere& s) {
    granules.push_back(s);
    mesh.touch(s);
  }
  void leave(std::size_t n) {
    mesh.touch(granules[n]);
    exterior.push_back(granules[n]);
    granules.erase(granules.begin() + static_cast<long>(n));
  }
  void bring_up_to_date() { bring_up_to_date(mesh); }
  void bring_up_to_date(InterfaceMesh& which) const {
    which.update(granules_of(granules), largest_of(granules));
    which.leave_out(exterior, granules_of(granules), largest_of(granules));
  }
  InterfaceMesh fresh() const {
    InterfaceMesh made(voxel, closing);
    bring_up_to_date(made);
    return made;
  }
};

TEST(MeshUpkeep, what_comes_and_goes_leaves_no_trace) {
  KeptBody body;
  body.granules = packing(12, 1);
  body.bring_up_to_date();
  std::mt19937 random(2);
  const Vec3 lo = Vec3::Constant(-2 * d), hi = Vec3::Constant(15 * d);
  double most = 0;
  for (int round = 0; round < 12; ++round) {
    if (round % 3 == 0) {  // a ball is carved
      const Sphere ball{body.granules[random() % body.granules.size()].centre, (1.5 + round % 4) * d};
      for (std::size_t n = body.granules.size(); n-- > 0;)
        if ((body.granules[n].centre - ball.centre).norm() < ball.radius) body.leave(n);
    } else if (round % 3 == 1) {  // half of what is free is locked again, elsewhere
      for (std::size_t n = body.exterior.size() / 2; n-- > 0;) {
        Sphere s = body.exterior.back();
        s.centre += 0.03 * voxel * Vec3(1, -1, 0.5);
        body.exterior.pop_back();
        body.come(s);
      }
    } else {  // the rest moves on
      for (Sphere& s : body.exterior) s.centre += 0.02 * voxel * Vec3(0.3, 0.2, 1);
    }
    body.bring_up_to_date();
    const InterfaceMesh fresh = body.fresh();
    most = std::max(most, largest_difference(body.mesh, fresh, lo, hi));
    ASSERT_NEAR(body.mesh.volume(), fresh.volume(), 1e-3 * fresh.volume()) << "round " << round;
    for (const Sphere& s : body.granules) ASSERT_TRUE(body.mesh.inside(s.centre)) << "round " << round;
    for (const Sphere& s : body.exterior) ASSERT_FALSE(body.mesh.inside(s.centre)) << "round " << round;
  }
  std::printf("a kept mesh is within %.2g voxels of a fresh one\n", most);
  EXPECT_LT(most, 0.1);
}

TEST(MeshUpkeep, nothing_changes_far_from_what_was_touched) {
  KeptBody body;
  body.granules = packing(16, 3);
  const InterfaceMesh before = body.fresh();
  body.bring_up_to_date();
  const Sphere gone = body.granules[body.granules.size() / 2 + 8 * 16 + 8];
  body.leave(body.granules.size() / 2 + 8 * 16 + 8);
  body.bring_up_to_date();
  std::mt19937 random(4);
  std::uniform_real_distribution<double> u(-2 * d, 18 * d);
  for (int n = 0; n < 20000; ++n) {
    const Vec3 p(u(random), u(random), u(random));
    if ((p - gone.centre).norm() < 9 * d) continue;
    ASSERT_EQ(body.mesh.signed_distance(p), before.signed_distance(p)) << p.transpose();
  }
}

TEST(MeshUpkeep, an_exterior_granule_in_a_pore_is_outside_and_leaves_no_hole_behind) {
  KeptBody body;
  body.granules = packing(9, 5);
  const std::size_t middle = body.granules.size() / 2;
  const Sphere free = body.granules[middle];
  body.granules.erase(body.granules.begin() + static_cast<long>(middle));
  body.bring_up_to_date();
  ASSERT_TRUE(body.mesh.inside(free.centre)) << "no ball of this size fits into the pore";
  const InterfaceMesh closed = body.fresh();
  body.exterior = {free};
  body.bring_up_to_date();
  EXPECT_FALSE(body.mesh.inside(free.centre));
  const double ball = 4.0 / 3.0 * M_PI * std::pow(free.radius, 3);
  EXPECT_NEAR(closed.volume() - body.mesh.volume(), ball, 0.2 * ball);
  for (const Sphere& s : body.granules) EXPECT_TRUE(body.mesh.inside(s.centre));
  body.exterior.clear();
  body.bring_up_to_date();
  EXPECT_EQ(largest_difference(body.mesh, closed, Vec3::Constant(-2 * d), Vec3::Constant(11 * d)), 0.0);
}

TEST(MeshUpkeep, granules_of_the_body_go_before_exterior_ones_that_overlap) {
  for (const double radius : {0.2, 0.6, 1.0, 3.0}) {  // voxels; small ones are held larger
    KeptBody body;
    body.granules = {{Vec3::Zero(), radius * voxel}};
    body.exterior = {{Vec3(1.2 * radius * voxel, 0, 0), radius * voxel}, {Vec3(0, 0, -40 * voxel), 40 * voxel}};
    body.bring_up_to_date();
    EXPECT_TRUE(body.mesh.inside(Vec3::Zero())) << radius;
  }
}

TEST(MeshUpkeep, exterior_granules_that_do_not_reach_the_surface_change_nothing) {
  KeptBody body;
  body.granules = packing(6, 6);
  body.bring_up_to_date();
  const double volume = body.mesh.volume();
  const std::size_t voxels = body.mesh.active_voxels();
  body.exterior = {{Vec3(3 * d, 3 * d, 12 * d), d / 2}, {Vec3(-9 * d, 0, 0), 5 * d}};
  body.bring_up_to_date();
  EXPECT_EQ(body.mesh.volume(), volume);
  EXPECT_EQ(body.mesh.active_voxels(), voxels);
}

TEST(MeshUpkeep, a_body_that_loses_all_is_empty_and_may_grow_again) {
  KeptBody body;
  body.granules = packing(4, 8);
  body.bring_up_to_date();
  EXPECT_FALSE(body.mesh.empty());
  while (!body.granules.empty()) body.leave(0);
  body.exterior.clear();
  body.bring_up_to_date();
  EXPECT_TRUE(body.mesh.empty());
  EXPECT_TRUE(body.mesh.triangles().triangles.empty());
  for (const Sphere& s : packing(4, 9)) body.come(s);
  body.bring_up_to_date();
  EXPECT_LT(largest_difference(body.mesh, body.fresh(), Vec3::Constant(-2 * d), Vec3::Constant(6 * d)), 0.1);
}

}  // namespace
}  // namespace solidcull
