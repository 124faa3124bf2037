#include <gtest/gtest.h>

#include <array>
#include <map>
#include <mutex>
#include <set>

#include "world_parts.h"

namespace solidcull {
namespace {

/// A cube of n x n x n granules in `exterior live` with a cover of two diameters.
struct Cube {
  static constexpr int n = 7;

  explicit Cube(const SmallDeck& deck = empty_space(), const Settings& settings = living_settings(),
                const Vec3& at = Vec3::Zero())
      : world(deck), parts(world, settings, 2 * r) {
    for (int k = 0; k < n * n * n; ++k) world.add(k + 1, at + apart * Vec3(k % n, k / n % n, k / n / n), r);
    world.reneighbour();
    world.compute_forces();
  }
  static int tag(int i, int j, int k) { return 1 + i + n * (j + n * k); }
  bool deep(int i, int j, int k) { return parts.cover.is_deep(world.at(tag(i, j, k))); }
  void remove_above(int layer) {
    for (int t = n * n * n; t > layer * n * n; --t)
      if (const int i = world.at(t); i >= 0 && !parts.bed.shell[i].locked) world.atoms.take_out(i);
    world.reneighbour();
  }

  SmallWorld world;
  WorldParts parts;
};

TEST(Cover, granules_more_than_two_diameters_below_the_surface_are_deep) {
  Cube cube;
  cube.parts.cover.draw();
  // from the surface: half a diameter, one and a half, two and a half, three and a half
  EXPECT_FALSE(cube.deep(0, 3, 3));
  EXPECT_FALSE(cube.deep(1, 3, 3));
  EXPECT_TRUE(cube.deep(2, 3, 3));
  EXPECT_TRUE(cube.deep(3, 3, 3));
  EXPECT_FALSE(cube.deep(3, 3, 6));
  EXPECT_FALSE(cube.deep(3, 3, 5));
  EXPECT_TRUE(cube.deep(3, 3, 4));
}

TEST(Cover, the_pores_of_a_packing_are_no_surface_but_a_hole_for_a_granule_and_more_is) {
  Cube cube;
  for (const auto& [i, j, k] :
       {std::array<int, 3>{3, 3, 3}, {3, 3, 4}, {3, 4, 3}, {4, 3, 3}, {4, 4, 3}, {4, 3, 4}, {3, 4, 4}, {4, 4, 4}})
    cube.world.atoms.take_out(cube.world.at(Cube::tag(i, j, k)));
  cube.world.reneighbour();
  cube.parts.cover.draw();
  EXPECT_FALSE(cube.deep(2, 3, 3));
  EXPECT_FALSE(cube.deep(2, 2, 3));
}

TEST(Cover, a_wall_closes_the_surface) {
  for (const bool moving : {true, false}) {
    SmallDeck deck = empty_space();
    deck.planes = {SmallDeck::ground(0)};
    deck.planes[0].moving = moving;
    Cube cube(deck, living_settings(), Vec3(0, 0, r));
    cube.parts.cover.draw();
    EXPECT_FALSE(cube.deep(3, 3, 0)) << moving;
    cube.parts.cover.close_behind_walls(cube.world.walls.contacts(), [](int) { return true; });
    cube.parts.cover.draw();
    EXPECT_TRUE(cube.deep(3, 3, 0)) << moving;
    EXPECT_TRUE(cube.deep(3, 3, 1)) << moving;
    EXPECT_FALSE(cube.deep(0, 3, 0));  // its side is open
    EXPECT_FALSE(cube.deep(3, 3, 6));
  }
}

TEST(Cover, a_moving_wall_closes_only_where_granules_rest_at_it_and_only_while_it_is_there) {
  SmallDeck deck = empty_space();
  deck.planes = {SmallDeck::ground(0)};
  deck.planes[0].moving = true;
  Cube cube(deck, living_settings(), Vec3(0, 0, r));
  Cover& cover = cube.parts.cover;
  cover.close_behind_walls(cube.world.walls.contacts(), [](int) { return false; });
  cover.draw();
  EXPECT_FALSE(cube.deep(3, 3, 0));
  cover.close_behind_walls(cube.world.walls.contacts(), [](int) { return true; });
  cover.draw();
  EXPECT_TRUE(cube.deep(3, 3, 0));
  cover.close_behind_walls({}, [](int) { return true; });  // it has left
  cover.draw();
  EXPECT_FALSE(cube.deep(3, 3, 0));
}

TEST(Cover, a_still_wall_closes_until_the_deck_takes_it_away) {
  SmallDeck deck = empty_space();
  deck.planes = {SmallDeck::ground(0)};
  Cube cube(deck, living_settings(), Vec3(0, 0, r));
  Cover& cover = cube.parts.cover;
  cover.close_behind_walls(cube.world.walls.contacts(), [](int) { return false; });
  cover.draw();
  EXPECT_TRUE(cube.deep(3, 3, 0));
  cover.begin_run(false);
  cover.close_behind_walls({}, [](int) { return false; });
  cover.draw();
  EXPECT_TRUE(cube.deep(3, 3, 0));
  cover.begin_run(true);
  cover.draw();
  EXPECT_FALSE(cube.deep(3, 3, 0));
}

TEST(Cover, a_thin_plate_closes_the_surface_on_either_side) {
  for (int axis = 0; axis < 3; ++axis)
    for (const bool moving : {false, true}) {
      SmallDeck deck = empty_space();
      Vec3 normal = Vec3::Zero();
      normal[axis] = 1;
      deck.planes = {{"upper", Vec3::Zero(), normal, moving}, {"lower", Vec3::Zero(), -normal, moving}};
      // a layer on either side, and only what touches the plate on its own side is told of it
      SmallWorld world(deck);
      WorldParts parts(world, living_settings(), 2 * r);
      const int n = 9;
      for (int side : {0, 1})
        for (int k = 0; k < n * n; ++k) {
          Vec3 x = Vec3::Zero();
          x[axis] = side ? r : -r;
          x[(axis + 1) % 3] = apart * (k % n);
          x[(axis + 2) % 3] = apart * (k / n);
          world.add(1 + k + side * n * n, x, r);
        }
      world.reneighbour();
      std::vector<WallContact> contacts;
      for (const WallContact& c : world.walls.contacts())
        if (std::abs(c.gap) < 0.1 * r) contacts.push_back(c);
      ASSERT_EQ(contacts.size(), static_cast<std::size_t>(2 * n * n));
      parts.cover.close_behind_walls(contacts, [](int) { return true; });
      EXPECT_EQ(parts.cover.plugs(), static_cast<std::size_t>(2 * n * n)) << "axis " << axis << ", moving " << moving;
    }
}

/// The granules in the middle of the cube are locked, one in the centre is stored.
struct Culled : Cube {
  Culled() {
    std::vector<std::int64_t> tags;
    for (int i = 2; i < 5; ++i)
      for (int j = 2; j < 5; ++j)
        for (int k = 2; k < 5; ++k) tags.push_back(tag(i, j, k));
    parts.lock(tags);
    parts.put_away({tag(3, 3, 3)});
    parts.reneighbour();
    parts.cover.draw();
    parts.cover.wake_exposed();
  }
};

TEST(Cover, an_interface_granule_that_loses_its_cover_asks_to_wake) {
  Culled cube;
  EXPECT_FALSE(cube.parts.bed.wake.any_here());
  cube.remove_above(6);  // one layer of two and a half: half a diameter of the cover is gone, and that is borne
  cube.parts.motion.begin_lists();
  cube.parts.motion.refresh();
  cube.parts.cover.draw();
  cube.parts.cover.wake_exposed();
  const std::size_t after_one = cube.parts.wakes().balls.size();
  cube.remove_above(5);  // the second: half a diameter is left
  cube.parts.motion.begin_lists();
  cube.parts.motion.refresh();
  cube.parts.cover.draw();
  cube.parts.cover.wake_exposed();
  const Wakes wakes = cube.parts.wakes();
  EXPECT_LE(after_one, 9u);  // at most the topmost nine
  // now all nine of them, whoever else
  for (int i = 2; i < 5; ++i)
    for (int j = 2; j < 5; ++j) EXPECT_TRUE(wakes.in_ball(apart * Vec3(i, j, 4), 0)) << i << j;
  EXPECT_FALSE(wakes.in_ball(apart * Vec3(3, 3, 2), 0));  // the lowest are as deep as they were
}

TEST(Cover, storing_and_fetching_leaves_the_surface_as_it_is) {
  Culled cube;
  cube.parts.put_away({Cube::tag(3, 3, 2), Cube::tag(2, 3, 3)});
  cube.parts.reneighbour();
  cube.parts.cover.draw();
  cube.parts.cover.wake_exposed();
  EXPECT_TRUE(cube.deep(2, 2, 2));
  cube.parts.bed.index.index(cube.world.atoms);
  cube.parts.exchange.bring_back(Cube::tag(3, 3, 3));
  cube.parts.reneighbour();
  cube.parts.cover.draw();
  cube.parts.cover.wake_exposed();
  EXPECT_FALSE(cube.parts.bed.wake.any_here());
  EXPECT_TRUE(cube.deep(3, 3, 3));
}

TEST(Cover, a_mass_that_moves_as_one_keeps_its_surface_and_the_observer_rides_on_it) {
  Culled cube;
  const Pose before = cube.parts.cover.observer();
  const Vec3 shift(0.3, 0.1, 0);
  for (int i = 0; i < cube.world.atoms.owned; ++i) cube.world.atoms.set_place(i, cube.world.atoms.place(i) + shift);
  cube.parts.bed.solid.body(cube.parts.body_of(Cube::tag(3, 3, 3))).shift(shift);
  cube.world.reneighbour();
  cube.parts.motion.begin_lists();
  cube.parts.motion.refresh();
  cube.parts.cover.draw();
  cube.parts.cover.wake_exposed();
  EXPECT_FALSE(cube.parts.bed.wake.any_here());
  EXPECT_TRUE(cube.deep(2, 2, 2));
  EXPECT_FALSE(cube.deep(1, 3, 3));
  EXPECT_LT((cube.parts.cover.observer().origin() - before.origin() - shift).norm(), 1e-12);
}

TEST(Cover, depth_does_not_see_borders_between_ranks) {
  enum Floor { none, still, moving };
  for (const Floor floor : {none, still, moving}) {
    SmallDeck deck = empty_space();
    deck.box = {Vec3(-0.1, -0.1, -0.1), Vec3(0.3, 0.3, 0.3)};
    if (floor != none) deck.planes = {SmallDeck::ground(-r)};
    if (floor == moving) deck.planes[0].moving = true;
    std::map<int, bool> deep[3];
    for (const int ranks : {1, 2}) {
      deck.split = {ranks, 1, 1};
      std::mutex mutex;
      run_on_ranks(deck, [&](SmallWorld& w) {
        WorldParts parts(w, living_settings(), 2 * r);
        for (int k = 0; k < 343; ++k) w.add(k + 1, Vec3(0.07, 0, 0) + apart * Vec3(k % 7, k / 7 % 7, k / 49), r);
        w.reneighbour();
        parts.cover.close_behind_walls(w.walls.contacts(), [](int) { return true; });
        parts.cover.draw();
        const std::lock_guard<std::mutex> lock(mutex);
        for (int i = 0; i < w.atoms.owned; ++i) deep[ranks][w.atoms.tag[i]] = parts.cover.is_deep(i);
      });
    }
    EXPECT_EQ(deep[1].size(), 343u);
    EXPECT_EQ(deep[1], deep[2]) << "floor " << floor;
    int n = 0;
    for (const auto& d : deep[1]) n += d.second;
    EXPECT_EQ(n, floor == none ? 27 : 45);  // the inner three of seven each way; down to the floor
  }
}

}  // namespace
}  // namespace solidcull
