#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "world_parts.h"

namespace solidcull {
namespace {

using Tags = std::set<std::int64_t>;

/// Ten granules along x that are one body.
struct Row {
  explicit Row(const SmallDeck& deck = empty_space(), int granules = 10) : world(deck), parts(world, sleeping_settings(), 2 * r) {
    skin = world.run.skin;
    for (int n = 0; n < granules; ++n) world.add(n + 1, x(n + 1), r);
    world.reneighbour();
    world.compute_forces();
    for (int n = 0; n < granules; ++n) tags.push_back(n + 1);
    parts.lock(tags);
    parts.walls.update({}, false);
  }
  static Vec3 x(int tag) { return Vec3((tag - 1) * 0.999 * 2 * r, 0, 0); }
  void ground() { parts.bed.solid.ground(parts.body_of(1), true); }
  std::size_t fetch() {
    parts.bed.census.count_bodies();
    parts.bed.census.count_stored();
    parts.closure.share();
    return parts.closure.fetch_what_is_near();
  }
  std::size_t store() {
    parts.bed.index.index(world.atoms);
    parts.bed.census.count_bodies();
    parts.closure.share();
    const std::int64_t highest = *std::max_element(world.atoms.tag, world.atoms.tag + world.atoms.owned);
    return parts.deep.store({true, false, true, highest},
                            [&](const std::vector<int>& atoms, const auto&) { return parts.exchange.put_away(atoms); });
  }
  Tags stored() const {
    Tags all;
    parts.bed.solid.store().for_each([&](const Resident& g) { all.insert(g.tag); });
    return all;
  }
  /// An exterior granule beside the fifth of the row, its surface so many skins away.
  int visitor(double skins, double radius = r) {
    const int i = world.add(99, x(5) + Vec3(0, r + radius + skins * skin, 0), radius);
    parts.walls.update({}, false);
    return i;
  }

  SmallWorld world;
  WorldParts parts;
  double skin;
  std::vector<std::int64_t> tags;
};

Tags all_but(int granules, Tags left_out) {
  Tags all;
  for (int tag = 1; tag <= granules; ++tag)
    if (!left_out.count(tag)) all.insert(tag);
  return all;
}

TEST(ShellClosure, what_comes_within_the_skin_makes_a_stored_granule_an_atom) {
  for (const bool stands : {false, true})
    for (const double radius : {0.1 * r, r, 10 * r}) {
      Row near, far;
      for (Row* row : {&near, &far}) {
        if (stands) row->ground();
        row->parts.put_away(row->tags);
        row->visitor(row == &near ? 0.999 : 1.001, radius);
      }
      EXPECT_EQ(near.fetch(), 1u) << radius;
      EXPECT_EQ(near.stored(), all_but(10, {5})) << radius;
      const int i = near.world.at(5);
      ASSERT_GE(i, 0);
      EXPECT_EQ(near.world.atoms.place(i), Row::x(5));
      EXPECT_TRUE(near.parts.bed.shell.locked(i));
      EXPECT_EQ(far.fetch(), 0u) << radius;
    }
}

TEST(ShellClosure, a_large_stored_granule_is_seen_from_its_surface) {
  for (const double skins : {0.999, 1.001}) {
    Row row(empty_space(), 1);
    row.world.add(2, Vec3(-10.99 * r, 0, 0), 10 * r);
    row.world.reneighbour();
    row.world.compute_forces();
    row.parts.lock({2});
    row.parts.put_away({1, 2});
    row.world.add(99, Vec3(-10.99 * r, 10.1 * r + skins * row.skin, 0), 0.1 * r);
    EXPECT_EQ(row.fetch(), skins < 1 ? 1u : 0u);
    EXPECT_EQ(row.stored().count(2), skins < 1 ? 0u : 1u);
  }
}

TEST(ShellClosure, a_shell_granule_goes_to_the_store_when_nothing_is_within_two_and_a_half_skins) {
  Row near, far;
  near.visitor(2.499);
  far.visitor(2.501);
  EXPECT_EQ(near.store(), 9u);
  EXPECT_EQ(near.stored(), all_but(10, {5}));
  EXPECT_EQ(far.store(), 10u);
}

TEST(ShellClosure, between_the_two_gaps_nothing_changes_sides) {
  for (const double skins : {1.01, 1.5, 2.49}) {
    Row row;
    row.visitor(skins);
    EXPECT_EQ(row.store(), 9u);  // 5 stays an atom
    EXPECT_EQ(row.fetch(), 0u);
    row.parts.put_away({5});
    for (int n = 0; n < 5; ++n) {
      EXPECT_EQ(row.fetch(), 0u) << skins;  // and is none once it is stored
      EXPECT_EQ(row.store(), 0u) << skins;
    }
  }
}

TEST(ShellClosure, the_highest_tag_stays_an_atom) {
  Row row;
  EXPECT_EQ(row.store(), 9u);  // new atoms are numbered from it
  EXPECT_EQ(row.stored(), all_but(10, {10}));
}

TEST(ShellClosure, a_visitor_that_comes_nearer_is_seen_in_time) {
  Row row;
  row.ground();
  row.parts.put_away(row.tags);
  const int i = row.visitor(20);
  // it comes in steps of a third of the skin: never nearer than the skin without the stored one being an atom
  for (double skins = 20; skins > 0.3; skins -= 1.0 / 3) {
    row.world.atoms.set_place(row.world.at(99), Row::x(5) + Vec3(0, 2 * r + skins * row.skin, 0));
    row.fetch();
    EXPECT_EQ(row.stored().count(5) == 0, skins < 1) << skins;
  }
  EXPECT_GE(i, 0);
}

TEST(ShellClosure, who_was_clear_is_looked_at_again_when_something_comes_to_stand_in_the_store_otherwise) {
  Row row;
  row.ground();
  row.parts.put_away({1, 2, 9, 10});
  row.visitor(0.5);
  ASSERT_EQ(row.fetch(), 0u);  // 5 is an atom: the visitor is clear of the store
  row.parts.put_away({5});     // as another rank or a file brings it: nobody asked who is near
  row.parts.bed.solid.stands_otherwise();
  EXPECT_EQ(row.fetch(), 1u);
  EXPECT_EQ(row.stored().count(5), 0u);
}

TEST(ShellClosure, who_was_clear_is_looked_at_again_when_a_body_comes_to_stand) {
  Row row;
  row.parts.put_away(row.tags);
  row.visitor(4);
  ASSERT_EQ(row.fetch(), 0u);
  SolidBody& body = row.parts.bed.solid.body(row.parts.body_of(1));
  body.shift(Vec3(0, 3.5 * row.skin, 0));  // it moved there
  row.ground();
  EXPECT_EQ(row.fetch(), 1u);
}

// ------------------------------------------------------------------------------------------------------------ other bodies

/// A second row beside the first, so many skins away; both stored but for the fifth of each.
struct TwoRows : Row {
  explicit TwoRows(double skins) {
    for (int n = 1; n <= 10; ++n) world.add(n + 20, x(n) + Vec3(0, 2 * r + skins * skin, 0), r);
    world.reneighbour();
    world.compute_forces();
    std::vector<std::int64_t> second;
    for (int n = 21; n <= 30; ++n) second.push_back(n);
    parts.lock(second);
    parts.walls.update({}, false);
    for (const int tag : {5, 25}) kept.insert(tag);
    std::vector<std::int64_t> away;
    for (const int first : {0, 20})
      for (int n = 1; n <= 10; ++n)
        if (!kept.count(first + n)) away.push_back(first + n);
    parts.put_away(away);
  }
  Tags kept;
};

TEST(ShellClosure, the_shell_of_another_body_makes_stored_granules_atoms_unless_both_stand) {
  TwoRows near(0.9), far(1.1), stand(0.9);
  for (const int tag : {1, 21}) stand.parts.bed.solid.ground(stand.parts.body_of(tag), true);
  ASSERT_NE(near.parts.body_of(1), near.parts.body_of(21));
  near.parts.put_away({5});
  stand.parts.put_away({5});
  far.parts.put_away({5});
  EXPECT_EQ(near.fetch(), 1u);
  EXPECT_EQ(near.stored().count(5), 0u);
  EXPECT_EQ(far.fetch(), 0u);
  EXPECT_EQ(stand.fetch(), 0u);
}

TEST(ShellClosure, shells_near_another_body_stay_atoms_unless_both_stand) {
  TwoRows near(2.4), far(2.6), stand(2.4);
  for (const int tag : {1, 21}) stand.parts.bed.solid.ground(stand.parts.body_of(tag), true);
  for (TwoRows* rows : {&near, &far, &stand}) rows->world.add(99, Vec3(0.5, 0.5, 0), r);  // the highest tag
  for (TwoRows* rows : {&near, &far, &stand}) rows->parts.walls.update({}, false);
  EXPECT_EQ(near.store(), 0u);
  EXPECT_EQ(far.store(), 2u);
  EXPECT_EQ(stand.store(), 2u);
}

// ------------------------------------------------------------------------------------------------------------ walls

SmallDeck with_floor(double gap_in_skins, bool moving) {
  SmallDeck deck = empty_space();
  deck.meshes = {SmallDeck::floor(-(r + gap_in_skins * deck.skin), 1.0)};
  deck.meshes[0].moving = moving;
  return deck;
}

TEST(ShellClosure, a_wall_that_can_move_fetches_what_it_comes_near_to) {
  Row row(with_floor(1.6, true));
  row.ground();
  row.parts.put_away(row.tags);
  EXPECT_EQ(row.fetch(), 0u);
  for (auto& t : row.world.deck.meshes[0].triangles)
    for (Vec3& corner : t) corner[2] += 0.3 * row.skin;  // 1.3 skins now
  EXPECT_EQ(row.fetch(), 10u);
}

TEST(ShellClosure, a_body_that_moves_to_a_wall_is_fetched_and_one_that_the_wall_holds_is_not) {
  for (const bool plane : {false, true}) {
    SmallDeck deck = with_floor(1.6, false);
    if (plane) {
      deck.meshes.clear();
      deck.planes = {SmallDeck::ground(-(r + 1.6 * deck.skin))};
    }
    Row row(deck);
    row.parts.put_away(row.tags);
    EXPECT_EQ(row.fetch(), 0u);
    row.parts.bed.solid.body(row.parts.body_of(1)).shift(Vec3(0, 0, -0.3 * row.skin));
    EXPECT_EQ(row.fetch(), 10u) << plane;
    // at rest there: walls that stand still hold it
    row.ground();
    row.parts.put_away(row.tags);
    EXPECT_EQ(row.fetch(), 0u) << plane;
    row.parts.closure.begin_run(true);  // a deck may have changed its walls
    EXPECT_EQ(row.fetch(), 10u) << plane;
    row.parts.closure.end_setup();
  }
}

TEST(ShellClosure, who_is_within_the_skin_of_a_still_mesh_stays_an_atom_while_its_body_may_move) {
  for (const double skins : {0.7, 1.1}) {
    Row row(with_floor(skins, false));
    row.world.add(99, Vec3(0.5, 0.5, 0.5), r);  // the highest tag
    row.parts.reneighbour();
    row.parts.walls.update(row.world.walls.contacts(), false);
    EXPECT_FALSE(row.parts.walls[row.world.at(5)].near);  // engines list what is nearer
    EXPECT_EQ(row.store(), skins < 1 ? 0u : 10u);
    row.ground();
    row.parts.motion.refresh();
    EXPECT_EQ(row.store(), skins < 1 ? 10u : 0u);
  }
}

TEST(ShellClosure, who_is_at_a_wall_goes_to_the_store_only_once_its_body_stands) {
  for (const bool moving : {false, true}) {
    Row row(with_floor(0, moving));
    row.world.add(99, Vec3(0.5, 0.5, 0.5), r);  // the highest tag
    row.parts.reneighbour();
    row.parts.walls.update(row.world.walls.contacts(), false);
    row.parts.compute_forces();  // what the walls do is known from then on
    EXPECT_EQ(row.store(), 0u);
    row.ground();
    row.parts.motion.refresh();
    ++row.world.run.step;
    EXPECT_EQ(row.store(), moving ? 0u : 10u);
  }
}

// ------------------------------------------------------------------------------------------------------- insertion, box, looks

TEST(ShellClosure, where_granules_will_be_inserted_the_bed_is_opened) {
  SmallDeck deck = empty_space();
  deck.sources = {{{Vec3(0.04, -0.01, -0.01), Vec3(0.06, 0.01, 0.01)}, 5, r}};
  Row row(deck);
  row.world.add(99, Vec3(0.5, 0.5, 0.5), r);
  row.parts.walls.update({}, false);
  row.parts.put_away(row.tags);
  row.world.run.step = 3;
  EXPECT_EQ(row.fetch(), 0u);  // two steps before
  row.world.run.step = 4;
  EXPECT_GT(row.fetch(), 0u);
  // their centres are in the region, or as far from it as two granules reach
  for (const int tag : {4, 5, 6, 7, 8}) EXPECT_EQ(row.stored().count(tag), 0u) << tag;
  EXPECT_EQ(row.stored().count(1), 1u);
  // it stays open for the step of the insertion and the one before
  row.parts.walls.update({}, false);
  row.store();
  for (const int tag : {4, 5, 6, 7, 8}) EXPECT_EQ(row.stored().count(tag), 0u) << tag;
  row.world.run.step = 6;
  row.store();
  EXPECT_EQ(row.stored(), all_but(10, {}));
}

TEST(ShellClosure, an_insertion_of_large_granules_opens_the_bed_as_far_as_they_reach) {
  for (const double radius : {r, 3 * r, 20 * r}) {
    SmallDeck deck = empty_space();
    deck.sources = {{{Vec3(-0.001, -0.001, -0.001), Vec3(0.001, 0.001, 0.001)}, 1, radius}};
    Row row(deck);
    row.world.add(99, Vec3(0.5, 0.5, 0.5), r);
    row.parts.walls.update({}, false);
    row.parts.put_away(row.tags);
    row.world.run.step = 1;
    row.fetch();
    for (int tag = 1; tag <= 10; ++tag) {
      const bool must_open = Row::x(tag)[0] <= 0.001 + radius + r, may_open = Row::x(tag)[0] <= 0.001 + radius + 6 * r;
      const bool open = !row.stored().count(tag);
      EXPECT_TRUE(open ? may_open : !must_open) << tag << ' ' << radius;
    }
  }
}

TEST(ShellClosure, what_a_new_granule_overlaps_is_found_before_anything_comes_out_of_the_store) {
  struct Case {
    double gap;  // of the surfaces, in radii
    bool made, stored;
  };
  for (const Case& c : {Case{-0.01, true, true}, Case{-0.01, true, false}, Case{0.01, true, true}, Case{-0.01, false, true}}) {
    Row row;
    if (c.stored) row.parts.put_away(row.tags);
    const int i = row.world.add(99, Row::x(5) + Vec3(0, (2 + c.gap) * r, 0), r);
    if (c.made) row.parts.closure.was_made(i);
    const bool overlaps = c.made && c.gap < 0;
    const ShellClosure::Overlapped found = row.parts.closure.by_new_granules();
    EXPECT_EQ(found.in_stored, overlaps && c.stored ? 99 : 0) << c.gap;
    ASSERT_EQ(found.places.size(), overlaps ? 1u : 0u) << c.gap;
    if (overlaps) {
      EXPECT_NEAR((found.places[0] - Row::x(5)).norm(), 0, 1e-12);
    }
    EXPECT_EQ(row.stored(), c.stored ? all_but(10, {}) : Tags());
    row.parts.closure.forget_new();
    EXPECT_TRUE(row.parts.closure.by_new_granules().places.empty());
  }
}

TEST(ShellClosure, what_leaves_the_box_becomes_an_atom) {
  Row row;
  row.parts.put_away(row.tags);
  EXPECT_EQ(row.parts.closure.fetch_from_outside(), 0u);
  row.parts.bed.solid.body(row.parts.body_of(1)).shift(Vec3(1 - 0.065, 0, 0));  // the side is at 1 m
  EXPECT_EQ(row.parts.closure.fetch_from_outside(), 3u);
  EXPECT_EQ(row.stored(), all_but(10, {8, 9, 10}));
}

TEST(ShellClosure, a_box_that_follows_the_granules_holds_what_is_stored) {
  Row row;
  row.world.run.kept = {Vec3::Constant(-HUGE_VAL), Vec3::Constant(HUGE_VAL)};
  row.parts.put_away(row.tags);
  row.parts.bed.solid.body(row.parts.body_of(1)).shift(Vec3(1 - 0.065, 0, 0));
  EXPECT_EQ(row.parts.closure.fetch_from_outside(), 0u);
  Box box{Vec3(-0.5, 0, 0), Vec3(0.5, 0.25, 0)};
  row.parts.bed.stored.enclose(box);
  double farthest = -HUGE_VAL;
  row.parts.bed.solid.store().for_each(
      [&](const Resident& g) { farthest = std::max(farthest, row.parts.bed.solid.in_world(g)[0]); });
  EXPECT_GT(farthest, 1);
  EXPECT_NEAR(box.hi[0], farthest, 1e-12);
  EXPECT_EQ(box.lo[0], -0.5);
  EXPECT_EQ(box.hi[1], 0.25);
}

TEST(DeepGranules, a_look_asks_for_a_rebuild_when_enough_might_go) {
  for (const int granules : {10, 11}) {
    Row row(empty_space(), granules);
    row.parts.motion.refresh();
    EXPECT_EQ(row.parts.deep.ask_to_store(row.parts.motion.interface_atoms()), granules > 10) << granules;
  }
}

TEST(ShellClosure, what_comes_near_on_another_rank_or_through_a_periodic_side_counts) {
  SmallDeck deck = empty_space();
  deck.box = {Vec3(-0.1, -0.1, -0.1), Vec3(0.1, 0.1, 0.1)};
  deck.periodic = {true, false, false};
  deck.split = {2, 1, 1};
  run_on_ranks(deck, [](SmallWorld& w) {
    WorldParts parts(w, sleeping_settings(), 2 * r);
    // pairs of granules on rank 1: one by the border at 0, one by the periodic side at 0.1
    for (const int first : {1, 3}) {
      w.add(first, Vec3(first == 1 ? 0.001 : 0.099, 0, 0), r);
      w.add(first + 1, Vec3(first == 1 ? 0.001 : 0.099, 0.999 * 2 * r, 0), r);
    }
    // visitors on rank 0, within half a skin of 1 and of 3
    w.add(11, Vec3(0.001 - 2.1 * r, 0, 0), r);
    w.add(12, Vec3(-0.101 + 2.1 * r, 0, 0), r);
    w.reneighbour();
    w.compute_forces();
    parts.lock({1, 2, 3, 4});
    parts.walls.update({}, false);
    parts.put_away({1, 2, 3, 4});
    parts.bed.census.count_bodies();
    parts.bed.census.count_stored();
    parts.closure.share();
    EXPECT_EQ(parts.closure.fetch_what_is_near(), w.ranks.me == 1 ? 2u : 0u);
    EXPECT_EQ(w.at(1) >= 0 && w.at(3) >= 0, w.ranks.me == 1);
  });
}

}  // namespace
}  // namespace solidcull
