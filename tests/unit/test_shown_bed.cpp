#include <gtest/gtest.h>

#include <cstdlib>

#include "world_parts.h"

namespace solidcull {
namespace {

/// Twelve granules on a floor, tag 1 below, asleep: most are stored.
struct AsleepColumn {
  explicit AsleepColumn(SmallWorld& w) : world(w), culling(w.ports(), sleeping_settings(), 1) {
    setenv("SOLIDCULL_CHECK", "1", 1);
    double z = 0;
    for (int n = 0; n < 12; ++n) {
      z += (n ? 2 * r : r) - (12 - n) * 9.81 * world.mass_of(r) / world.deck.stiffness;
      world.add(n + 1, Vec3(0.001, 0.002, z), r);
    }
    world.follow(culling);
    world.begin_run(&culling);
    world.steps(&culling, 200);
    culling.end_run();
  }
  double interior() { return culling.value(2); }
  void next_run() {
    culling.hide_bed();
    world.begin_run(&culling);
  }
  SmallWorld& world;
  Culling culling;
};

SmallDeck on_a_floor() {
  SmallDeck d;
  d.meshes = {SmallDeck::floor(0, 0.2)};
  return d;
}

TEST(ShownBed, shows_every_granule_once_and_takes_back_what_was_not_touched) {
  SmallWorld world(on_a_floor());
  AsleepColumn column(world);
  const double interior = column.interior();
  const int atoms = world.atoms.owned;
  ASSERT_GE(interior, 8);
  std::map<int, Vec3> places;
  column.culling.show_bed();
  EXPECT_TRUE(column.culling.bed_is_shown());
  EXPECT_EQ(world.atoms.owned, 12);
  EXPECT_EQ(world.atoms.published, 12);
  for (int tag = 1; tag <= 12; ++tag) {
    ASSERT_GE(world.at(tag), 0) << tag;
    places[tag] = world.atoms.place(world.at(tag));
    const double pressed = (13 - tag) * 9.81 * world.mass_of(r) / world.deck.stiffness;  // by what lies above
    if (tag > 1) {
      EXPECT_NEAR(places[tag][2] - places[tag - 1][2], 2 * r - pressed, 1e-6) << tag;
    }
    EXPECT_EQ(world.atoms.colour[static_cast<std::size_t>(world.at(tag))], 0.1 * tag);
  }
  EXPECT_EQ(column.interior(), interior) << "what is shown is still culled";
  column.next_run();
  EXPECT_FALSE(column.culling.bed_is_shown());
  EXPECT_EQ(column.interior(), interior);
  EXPECT_EQ(world.atoms.owned, atoms);
  EXPECT_EQ(world.atoms.published, atoms);
  column.culling.restore_all();
  for (int tag = 1; tag <= 12; ++tag) EXPECT_LT((world.atoms.place(world.at(tag)) - places[tag]).norm(), 1e-15) << tag;
}

TEST(ShownBed, other_columns_and_groups_change_and_nothing_wakes) {
  SmallWorld world(on_a_floor());
  AsleepColumn column(world);
  const double interior = column.interior(), restored = column.culling.value(6);
  column.culling.show_bed();
  for (int tag = 1; tag <= 12; ++tag) {
    world.atoms.colour[static_cast<std::size_t>(world.at(tag))] = 100 + tag;
    world.atoms.groups[world.at(tag)] |= 64;
  }
  column.next_run();
  EXPECT_EQ(column.interior(), interior);
  EXPECT_EQ(column.culling.value(6), restored);
  column.culling.restore_all();
  for (int tag = 1; tag <= 12; ++tag) {
    EXPECT_EQ(world.atoms.colour[static_cast<std::size_t>(world.at(tag))], 100 + tag) << tag;
    EXPECT_EQ(world.atoms.groups[world.at(tag)] & 64, 64) << tag;
    EXPECT_FALSE(world.atoms.is_interface(world.at(tag)));
  }
}

// no membership has changed since they went in: the store still knows the motion that each had then
TEST(ShownBed, of_granules_in_flight_stands_where_their_body_is_now) {
  SmallWorld world((SmallDeck()));
  Culling culling(world.ports(), sleeping_settings(), 1);
  std::map<int, Vec3> start;
  for (int tag = 1; tag <= 12; ++tag) {
    start[tag] = Vec3(0.001, 0.002, 2 * r * tag);
    world.add(tag, start[tag], r, Vec3(0.1, 0, 0.3));
  }
  world.follow(culling);
  world.begin_run(&culling);
  while (culling.value(2) == 0 && world.run.step < 1000) world.steps(&culling, 1);
  ASSERT_GT(culling.value(2), 0);
  world.steps(&culling, 7);
  culling.end_run();
  culling.show_bed();
  const Vec3 way = world.atoms.place(world.at(1)) - start[1];
  for (const auto& from : start) {
    const int i = world.at(from.first);
    EXPECT_LE((world.atoms.place(i) - from.second - way).norm(), 1e-12) << from.first;
    EXPECT_LE((world.atoms.velocity(i) - world.atoms.velocity(world.at(1))).norm(), 1e-9) << from.first;
  }
}

TEST(ShownBed, a_granule_that_was_moved_or_struck_wakes_with_its_neighbours_and_keeps_its_contacts) {
  SmallWorld world(on_a_floor());
  AsleepColumn column(world);
  column.culling.show_bed();
  const Vec3 there = world.atoms.place(world.at(6)) + Vec3(1e-4, 0, 0), faster(0.1, 0.2, 0.3);
  world.atoms.set_place(world.at(6), there);
  world.atoms.set_velocity(world.at(6), faster);
  world.atoms.set_size(world.at(6), r, 0.8 * world.mass_of(r));
  world.atoms.set_size(world.at(2), 0.9 * r, world.mass_of(r));
  column.next_run();
  for (const int tag : {5, 6, 7}) {
    ASSERT_GE(world.at(tag), 0) << tag;
    EXPECT_FALSE(world.atoms.is_interface(world.at(tag))) << tag;
  }
  const int i = world.at(6);
  EXPECT_EQ((world.atoms.place(i) - there).norm(), 0);
  EXPECT_EQ((world.atoms.velocity(i) - faster).norm(), 0);
  EXPECT_EQ(world.atoms.mass[i], 0.8 * world.mass_of(r));
  EXPECT_EQ(world.atoms.radius[world.at(2)], 0.9 * r);
  EXPECT_EQ(world.atoms.histories(i).size(), 2u);
  EXPECT_GT(column.interior(), 0) << "what is far from them stays";
  EXPECT_EQ(column.culling.value(0) + column.culling.value(1) + column.culling.value(2), 12);
}

TEST(ShownBed, what_was_deleted_is_gone_and_what_was_made_is_there) {
  SmallWorld world(on_a_floor());
  AsleepColumn column(world);
  column.culling.show_bed();
  world.atoms.take_out(world.at(7));
  world.add(13, Vec3(0.05, 0, 0.05), r);
  column.next_run();
  EXPECT_EQ(world.at(7), -1);
  EXPECT_GE(world.at(13), 0);
  EXPECT_EQ(column.culling.value(0) + column.culling.value(1) + column.culling.value(2), 12);
  world.steps(&column.culling, 50);
  column.culling.end_run();
  column.culling.restore_all();
  EXPECT_EQ(world.atoms.owned, 12);
  EXPECT_EQ(world.at(7), -1);
  EXPECT_LT(world.atoms.velocity(world.at(8))[2], -0.01) << "what stood on it falls";
}

TEST(ShownBed, an_interface_granule_that_was_deleted_leaves_its_body) {
  SmallWorld world(on_a_floor());
  AsleepColumn column(world);
  int tag = 0;
  for (int i = 0; i < world.atoms.owned; ++i)
    if (world.atoms.is_interface(i)) tag = world.atoms.tag[i];
  ASSERT_GT(tag, 0);
  column.culling.show_bed();
  world.atoms.take_out(world.at(tag));
  column.next_run();
  EXPECT_EQ(world.at(tag), -1);
  EXPECT_EQ(column.culling.value(0) + column.culling.value(1) + column.culling.value(2), 11);
}

TEST(ShownBed, what_may_not_be_culled_any_more_wakes_when_the_run_begins) {
  SmallWorld world(on_a_floor());
  AsleepColumn column(world);
  column.culling.show_bed();
  world.atoms.groups[world.at(6)] |= SmallAtoms::held_group;
  world.atoms.held_bits = SmallAtoms::held_group;
  column.next_run();
  ASSERT_GE(world.at(6), 0);
  EXPECT_FALSE(world.atoms.is_interface(world.at(6)));
  EXPECT_GT(column.interior(), 0);
}

TEST(ShownBed, a_shown_bed_is_restored_as_the_deck_left_it) {
  SmallWorld world(on_a_floor());
  AsleepColumn column(world);
  column.culling.show_bed();
  world.atoms.set_velocity(world.at(6), Vec3(1, 0, 0));
  world.atoms.take_out(world.at(3));
  EXPECT_GT(column.culling.restore_all(), 8);
  EXPECT_EQ(world.atoms.owned, 11);
  EXPECT_EQ(world.atoms.velocity(world.at(6))[0], 1);
  EXPECT_EQ(column.interior(), 0);
}

TEST(ShownBed, is_nothing_where_nothing_is_culled) {
  SmallWorld world(on_a_floor());
  Culling culling(world.ports(), sleeping_settings(), 1);
  world.follow(culling);
  world.add(1, Vec3(0, 0, 0.1), r);
  world.begin_run(&culling);
  culling.end_run();
  culling.show_bed();
  EXPECT_FALSE(culling.bed_is_shown());
  EXPECT_EQ(culling.restore_all(), 0);
}

}  // namespace
}  // namespace solidcull
