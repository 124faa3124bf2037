#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <map>
#include <mutex>
#include <utility>
#include <vector>

#include "mesh_of.h"
#include "small_world.h"
#include "surface_parts.h"

namespace solidcull {
namespace {

constexpr double grain = 4 * voxel, pore = 1.2 * voxel;  // m

struct CutBox {
  const char* name;
  std::array<int, 3> split;
  std::array<bool, 3> periodic;
  double half_edge;  ///< of the cube, in granules
  Vec3 shift, turn;  ///< of the granules' frame

  friend void PrintTo(const CutBox& c, std::ostream* out) { *out << c.name; }
};

/// Some 900 granules, in no order.
std::vector<Sphere> heap() {
  std::vector<Sphere> all = lattice(10, grain, Vec3(-4.63, -4.41, -4.52) * grain);
  for (std::size_t n = 0; n < all.size(); ++n) {
    const double s = static_cast<double>(n);
    all[n].centre += 0.05 * grain * Vec3(std::sin(7 * s), std::sin(11 * s), std::sin(13 * s));
    all[n].radius *= 1 + 0.1 * std::sin(17 * s);
  }
  return without(std::move(all), {Vec3(2, 1, 5) * grain, 2.5 * grain});
}

SmallDeck deck_of(const CutBox& c) {
  SmallDeck deck = empty_space();
  deck.box = {Vec3::Constant(-c.half_edge * grain), Vec3::Constant(c.half_edge * grain)};
  deck.split = c.split;
  deck.periodic = c.periodic;
  return deck;
}

using Corner = std::array<float, 3>;
using Triangle = std::array<Corner, 3>;

/// As they stand in a file, each beginning with its least corner.
void add(const TriangleMesh& mesh, std::vector<Triangle>& to) {
  for (const auto& t : mesh.triangles) {
    Triangle corners;
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t a = 0; a < 3; ++a) corners[k][a] = static_cast<float>(mesh.vertices[t[k]][static_cast<int>(a)]);
    std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
    to.push_back(corners);
  }
}

/// Edges that are not passed as often one way as the other.
std::size_t open_edges(const std::vector<Triangle>& triangles) {
  std::map<std::pair<Corner, Corner>, int> passed;
  for (const Triangle& t : triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const Corner &from = t[k], &to = t[(k + 1) % 3];
      if (from == to) continue;
      from < to ? ++passed[{from, to}] : --passed[{to, from}];
    }
  return static_cast<std::size_t>(std::count_if(passed.begin(), passed.end(), [](const auto& p) { return p.second != 0; }));
}

class SurfacesOverRanks : public ::testing::TestWithParam<CutBox> {
 protected:
  /// The granules of one body, each on the rank that owns its place, in a frame that has been turned.
  static InterfaceMesh mesh_here(const SmallWorld& w, const Pose& pose) {
    std::vector<Sphere> own;
    for (const Sphere& s : heap())
      if (w.ranks.owns(w.run.wrapped(pose.to_world(s.centre)))) own.push_back(s);
    return mesh_of(own, voxel, pore, pose);
  }
  static Pose pose() {
    const Vec3 turn = GetParam().turn;
    const Eigen::AngleAxisd about(turn.norm(), turn.norm() > 0 ? Vec3(turn.normalized()) : Vec3(Vec3::UnitX()));
    return Pose(GetParam().shift * grain, Eigen::Quaterniond(about));
  }
};

TEST_P(SurfacesOverRanks, AreClosedAndAreWhatOneRankWouldHave) {
  std::vector<Triangle> here, on_root;
  std::mutex mutex;
  run_on_ranks(deck_of(GetParam()), [&](SmallWorld& w) {
    SurfaceParts parts(w.run, w.ranks, voxel, pore), whole(w.run, w.ranks, voxel, pore);
    InterfaceMesh own(voxel, pore);  // turned once, for that is as much by chance as threads are
    own.merge(mesh_here(w, pose()));
    parts.add_part(7, own.copy(), 1);
    parts.join_here();
    ASSERT_EQ(parts.surfaces().size(), 1u);
    const TriangleMesh mine = parts.triangles(*parts.surfaces().at(7).mesh);
    const Box near = w.ranks.own().grown_by(2 * voxel);
    const Vec3 middle = 0.5 * (near.lo + near.hi);
    const auto far = [&](const Vec3& v) { return !near.holds(v - w.image_shift(v - middle)); };
    EXPECT_EQ(std::count_if(mine.vertices.begin(), mine.vertices.end(), far), 0);

    whole.add_part(7, std::move(own), 1);
    whole.join_on_root();
    EXPECT_EQ(whole.surfaces().size(), w.ranks.me == 0 ? 1u : 0u);
    const std::lock_guard<std::mutex> lock(mutex);
    add(mine, here);
    if (w.ranks.me == 0) add(whole.surfaces().at(7).mesh->triangles(), on_root);
  });
  EXPECT_GT(here.size(), 10000u);
  EXPECT_EQ(open_edges(here), 0u);
  std::sort(here.begin(), here.end());
  std::sort(on_root.begin(), on_root.end());
  EXPECT_TRUE(here == on_root) << here.size() << " triangles, " << on_root.size() << " on one rank";
}

INSTANTIATE_TEST_SUITE_P(
    Grids, SurfacesOverRanks,
    ::testing::Values(CutBox{"two", {2, 1, 1}, {false, false, false}, 6, Vec3(0, 0, 0), Vec3(0, 0, 0)},
                      CutBox{"eight", {2, 2, 2}, {false, false, false}, 6, Vec3(0, 0, 0), Vec3(0, 0, 0)},
                      CutBox{"slabs", {8, 1, 1}, {false, false, false}, 6, Vec3(0, 0, 0), Vec3(0, 0, 0)},
                      CutBox{"over_periodic_sides", {2, 2, 1}, {true, true, false}, 6, Vec3(3.3, -2.6, 0), Vec3(0, 0, 0)},
                      CutBox{"turned", {2, 2, 1}, {false, false, false}, 9, Vec3(0.3, -0.2, 0.1), Vec3(0.3, -0.8, 0.5)}),
    [](const auto& c) { return c.param.name; });

TEST(SurfaceParts, of_a_body_on_one_rank_cross_the_border) {
  std::vector<Triangle> here;
  std::mutex mutex;
  const CutBox two{"", {2, 1, 1}, {false, false, false}, 6, Vec3(0, 0, 0), Vec3(0, 0, 0)};
  const Pose turned(Vec3(0.4 * grain, 0, 0), Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized())));
  const InterfaceMesh ball = mesh_of({{Vec3::Zero(), 2 * grain}}, voxel, pore, turned);
  run_on_ranks(deck_of(two), [&](SmallWorld& w) {
    SurfaceParts parts(w.run, w.ranks, voxel, pore);
    if (w.ranks.me == 1) parts.add_whole(3, ball, 1);
    parts.join_here();
    ASSERT_EQ(parts.surfaces().count(3), 1u);
    const TriangleMesh mine = parts.triangles(*parts.surfaces().at(3).mesh);
    EXPECT_GT(mine.triangles.size(), 100u);
    const std::lock_guard<std::mutex> lock(mutex);
    add(mine, here);
  });
  std::vector<Triangle> whole;
  add(ball.triangles(), whole);
  std::sort(here.begin(), here.end());
  std::sort(whole.begin(), whole.end());
  EXPECT_TRUE(here == whole) << here.size() << " triangles for " << whole.size();
}

TEST(SurfaceParts, of_all_bodies_are_one_closed_surface) {
  std::vector<Triangle> here;
  std::mutex mutex;
  const Pose turned(Vec3(0.4, 0, 0) * grain, Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized())));
  const InterfaceMesh stone = mesh_of(lattice(3, grain, Vec3(-1, -1, -3) * grain), voxel, pore, turned);
  run_on_ranks(deck_of({"", {2, 2, 1}, {false, false, false}, 6, Vec3(0, 0, 0), Vec3(0, 0, 0)}), [&](SmallWorld& w) {
    std::vector<Sphere> own;
    for (const Sphere& s : heap())
      if (w.ranks.owns(s.centre)) own.push_back(s);
    SurfaceParts parts(w.run, w.ranks, voxel, pore);
    if (w.ranks.me == 3) parts.add_whole(3, stone, 27);
    parts.add_part(8, mesh_of(own, voxel, pore), 1);
    parts.make_one();
    parts.join_here();
    ASSERT_EQ(parts.surfaces().size(), 1u);
    const TriangleMesh mine = parts.triangles(*parts.surfaces().at(0).mesh);
    const std::lock_guard<std::mutex> lock(mutex);
    add(mine, here);
  });
  EXPECT_GT(here.size(), 10000u);
  EXPECT_EQ(open_edges(here), 0u);
}

TEST(SurfaceParts, of_bodies_with_few_granules_on_all_ranks_are_left_out) {
  const InterfaceMesh ball = mesh_of({{Vec3::Zero(), grain}}, voxel, pore);
  run_on_ranks(deck_of({"", {2, 2, 1}, {false, false, false}, 6, Vec3(0, 0, 0), Vec3(0, 0, 0)}), [&](SmallWorld& w) {
    SurfaceParts parts(w.run, w.ranks, voxel, pore);
    parts.add_part(5, ball.copy(), 3);                   // 12 in all
    parts.add_part(6, ball.copy(), 2);                   // 8
    if (w.ranks.me == 2) parts.add_whole(11, ball, 10);  // 10
    parts.leave_out_below(10);
    EXPECT_EQ(parts.surfaces().count(5), 1u);
    EXPECT_EQ(parts.surfaces().count(6), 0u);
    EXPECT_EQ(parts.surfaces().count(11), w.ranks.me == 2 ? 1u : 0u);
    parts.join_on_root();
    EXPECT_EQ(parts.surfaces().size(), w.ranks.me == 0 ? 2u : 0u);
  });
}

/// The wall of a part along its border is in no rank's surface; a rank receives what lies near it, and no more.
TEST(SurfaceParts, no_rank_receives_much_more_than_a_border) {
  std::size_t received[2] = {};
  int at = 0;
  for (const int ranks : {4, 8}) {
    SmallDeck deck = deck_of({"", {ranks, 1, 1}, {false, false, false}, 6, Vec3(0, 0, 0), Vec3(0, 0, 0)});
    deck.box = {Vec3(-10 * ranks, -6, -6) * grain, Vec3(10 * ranks, 6, 6) * grain};
    std::atomic<std::size_t> most{0};
    run_on_ranks(deck, [&](SmallWorld& w) {
      const Box own = w.ranks.own();
      std::vector<Sphere> granules;  // a bar through the whole box
      for (double x = own.lo.x() + 0.5 * grain; x < own.hi.x(); x += grain)
        for (int j = -2; j <= 2; ++j)
          for (int k = -2; k <= 2; ++k) granules.push_back({Vec3(x, j * grain, k * grain), grain / 2});
      SurfaceParts parts(w.run, w.ranks, voxel, pore);
      parts.add_part(1, mesh_of(granules, voxel, pore), 1);
      const std::size_t before = w.ranks.delivered;
      parts.join_here();
      std::size_t came = w.ranks.delivered - before, known = most;
      while (known < came && !most.compare_exchange_weak(known, came)) {
      }
    });
    received[at++] = most;
  }
  EXPECT_GT(received[0], 1000u);
  EXPECT_LT(static_cast<double>(received[1]), 1.1 * static_cast<double>(received[0]));
}

}  // namespace
}  // namespace solidcull
