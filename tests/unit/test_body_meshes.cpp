// Interface meshes that are kept, through bodies that fly, merge and come apart; against those that are made at once.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "body_meshes.h"
#include "world_parts.h"

namespace solidcull {
namespace {

constexpr double d = 2e-3;  // m

std::vector<std::int64_t> tags(int from, int to) {
  std::vector<std::int64_t> all;
  for (int t = from; t <= to; ++t) all.push_back(t);
  return all;
}

/// A bar of 12 x 3 x 3 granules that touch, in empty space; tags rise along it.
struct Bar {
  SmallWorld world{empty_space()};
  WorldParts parts{world, sleeping_settings(), d};

  Bar() {
    for (int n = 0; n < 108; ++n) world.add(n + 1, 0.999 * d * Vec3(n / 9, n / 3 % 3, n % 3), d / 2);
    world.reneighbour();
    world.compute_forces();
  }
  std::size_t bodies() const { return parts.bed.solid.bodies().size(); }
  void wake(int from, int to) {
    Wakes wakes;
    for (int t = from; t <= to; ++t) wakes.balls.push_back({world.atoms.place(world.at(t)), 0.1 * d});
    parts.change(wakes, {});
  }
  /// Largest difference (voxels) between what is kept and what would be made now.
  double difference() {
    BodyMeshes fresh(parts.bed, parts.shown);
    const auto &a = parts.meshes.ask(), &b = fresh.ask();
    EXPECT_EQ(a.size(), b.size());
    double most = 0;
    for (const auto& [body, mesh] : b)
      for (const Vec3& v : mesh.triangles().vertices)
        most = std::max(most, std::abs(a.at(body).signed_distance(v) - mesh.signed_distance(v)) / parts.bed.scales.voxel());
    return most;
  }
  bool holds(int tag) {
    const Vec3 x = world.atoms.place(world.at(tag));
    const auto& all = parts.meshes.ask();
    return std::any_of(all.begin(), all.end(), [&](const auto& mesh) { return mesh.second.inside(x); });
  }
  void expect_right(const char* when) {
    EXPECT_LT(difference(), 0.01) << when;
    for (int i = 0; i < world.atoms.owned; ++i) EXPECT_EQ(holds(world.atoms.tag[i]), parts.bed.shell.locked(i)) << when;
  }
};

TEST(BodyMeshes, are_as_fresh_ones_whatever_becomes_of_the_bodies) {
  Bar bar;
  bar.parts.lock(tags(1, 45));
  bar.parts.lock(tags(64, 108));
  ASSERT_EQ(bar.bodies(), 2u);
  bar.expect_right("two bodies");
  for (auto& b : bar.parts.bed.solid.bodies_in_motion())  // each has a frame of its own now
    b.second.pose.shift(1e-4 * d * Vec3(b.first, 1, -1));
  bar.expect_right("in frames that have moved");
  bar.parts.lock(tags(46, 63));
  ASSERT_EQ(bar.bodies(), 1u);
  EXPECT_LT(bar.difference(), 0.01) << "merged";
  bar.wake(46, 54);
  ASSERT_EQ(bar.bodies(), 2u);
  EXPECT_LT(bar.difference(), 0.01) << "come apart";
  EXPECT_FALSE(bar.holds(50));
  bar.parts.lock(tags(46, 50));
  EXPECT_LT(bar.difference(), 0.01) << "some are back";
  EXPECT_TRUE(bar.holds(48));
  EXPECT_FALSE(bar.holds(53));
}

TEST(BodyMeshes, do_not_care_who_is_stored) {
  Bar bar;
  bar.parts.lock(tags(1, 108));
  bar.expect_right("all are atoms");
  bar.parts.put_away({50, 53, 56, 59});
  EXPECT_LT(bar.difference(), 0.01);
  bar.parts.exchange.bring_back(53);
  EXPECT_LT(bar.difference(), 0.01);
}

TEST(BodyMeshes, stay_as_they_are_while_they_are_held) {
  Bar bar;
  bar.parts.lock(tags(1, 108));
  bar.parts.meshes.hold();
  const Vec3 x = bar.world.atoms.place(bar.world.at(50));
  Wakes all;
  all.all = Woke::deck;
  bar.parts.change(all, {});
  ASSERT_EQ(bar.bodies(), 0u);
  ASSERT_EQ(bar.parts.meshes.ask().size(), 1u);
  EXPECT_TRUE(bar.parts.meshes.ask().begin()->second.inside(x));
  bar.parts.meshes.let_go();
  EXPECT_TRUE(bar.parts.meshes.ask().empty());
  bar.parts.lock(tags(1, 54));
  bar.expect_right("from here on they follow again");
}

TEST(BodyMeshes, follow_exterior_granules_from_step_to_step) {
  Bar bar;
  std::vector<std::int64_t> held = tags(1, 108);
  held.erase(held.begin() + 58);  // the granule in the middle of a layer
  bar.parts.lock(held);
  EXPECT_FALSE(bar.holds(59));
  ++bar.world.run.step;
  const int i = bar.world.at(59);
  const Vec3 hole = bar.world.atoms.place(i);
  bar.world.atoms.set_place(i, hole + Vec3(0, 0, 20 * d));
  EXPECT_FALSE(bar.holds(59));
  EXPECT_TRUE(bar.parts.meshes.ask().begin()->second.inside(hole)) << "its pore is closed again";
  EXPECT_LT(bar.difference(), 0.01);
}

TEST(BodyMeshes, are_none_before_the_first_granules) {
  SmallWorld world{empty_space()};
  CullingParts parts(world.ports(), sleeping_settings(), 1);
  EXPECT_TRUE(parts.meshes.ask().empty());
}

}  // namespace
}  // namespace solidcull
