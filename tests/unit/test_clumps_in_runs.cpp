// Runs with clumps: they are culled and come back, are struck, lost, deleted and made.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <set>

#include "clump_bundle.h"

namespace solidcull {
namespace {

// f_ID[1..12], from 0
enum Figure {
  exterior_now,
  interface_now,
  interior_now,
  bodies_now,
  stored_mass_now,
  culled_so_far,
  restored_so_far,
  mass_error_now = 10
};

/// Triangles of three spheres, one on the other, at rest on a floor, with the tags 1, 2, 3 below; and a single granule beside
/// them, whose tag is the highest.
struct TriangleColumn {
  static constexpr int clumps = 6, spheres = 3 * clumps, single = 100;

  explicit TriangleColumn(SmallWorld& w, const Settings& settings = sleeping_settings())
      : world(w), culling(w.ports(), settings, 1) {
    setenv("SOLIDCULL_CHECK", "1", 1);  // invariants at every reneighbouring
    const double load = 9.81 * w.mass_of(r) / w.deck.stiffness;
    double z = 0;
    for (int n = 0; n < clumps; ++n) {
      z += (n ? 2 * r : r) - (clumps - n) * load;
      std::vector<Sphere> triangle;
      for (int k = 0; k < 3; ++k) {
        const double angle = k * 2 * std::acos(-1.0) / 3;
        triangle.push_back({Vec3(0.001 + r * std::cos(angle), 0.002 + r * std::sin(angle), z), r});
      }
      w.clumps.make(3 * n + 1, triangle);
    }
    top = z;
    w.add(single, Vec3(0.05, 0.002, r - load), r);
    w.follow(culling);
  }
  static SmallDeck deck(const std::array<int, 3>& split = {1, 1, 1}) {
    SmallDeck d;
    d.clumps = true;
    d.split = split;
    d.box = {Vec3(-0.1, -0.1, -0.01), Vec3(0.1, 0.1, 0.11)};
    d.meshes = {SmallDeck::floor(0, 0.2)};
    return d;
  }
  /// So many spheres of each clump are atoms, over all ranks.
  std::vector<std::int64_t> spheres_there() const {
    std::vector<std::int64_t> there(clumps, 0);
    for (int i = 0; i < world.atoms.owned; ++i)
      if (world.atoms.tag[i] <= spheres) ++there[static_cast<std::size_t>((world.atoms.tag[i] - 1) / 3)];
    world.ranks.sum(there.data(), clumps);
    return there;
  }
  void steps(int n) {
    for (; n > 0; --n) {
      world.step(&culling);
      for (const std::int64_t there : spheres_there())
        EXPECT_TRUE(there == 0 || there == 3) << there << ", step " << world.run.step;
    }
  }
  void expect_all_counted(double granules) {
    EXPECT_EQ(value(exterior_now) + value(interface_now) + value(interior_now), granules);
    EXPECT_EQ(value(culled_so_far) - value(restored_so_far), value(interface_now) + value(interior_now));
    EXPECT_LT(std::abs(value(mass_error_now)), 1e-15);
    EXPECT_NEAR(value(22), granules * world.mass_of(r), 1e-12 * granules * world.mass_of(r));
  }
  double value(int n) { return culling.value(n); }

  SmallWorld& world;
  Culling culling;
  double top = 0;
};

TEST(ClumpsInRuns, that_rest_are_culled_stay_where_they_are_and_come_back) {
  for (const std::array<int, 3>& split : {std::array<int, 3>{1, 1, 1}, {2, 1, 1}, {2, 1, 2}})
    for (const Store store : {Store::exact, Store::compact}) {
      if (store == Store::compact && split[2] > 1) continue;  // as on two
      OfAllRanks before, after;
      run_on_ranks(TriangleColumn::deck(split), [&](SmallWorld& w) {
        Settings settings = sleeping_settings();
        settings.store = store;
        TriangleColumn column(w, settings);
        before.add(w);
        w.begin_run(&column.culling);
        EXPECT_EQ(column.value(exterior_now), 19);
        column.steps(60);
        EXPECT_EQ(column.value(exterior_now), 0);
        EXPECT_GE(column.value(interior_now), 15);
        column.expect_all_counted(19);
        EXPECT_EQ(w.clumps.count(), 0);
        EXPECT_EQ(w.clumps.published, 0);
        column.culling.end_run();
        column.culling.restore_all();
        column.expect_all_counted(19);
        EXPECT_EQ(column.value(exterior_now), 19);
        EXPECT_EQ(w.clumps.published, 6);
        w.reneighbour();
        after.add(w);
      });
      const double far = store == Store::exact ? 1e-9 : 1e-7;  // compact rounds places
      ASSERT_EQ(after.places.size(), 19u);
      ASSERT_EQ(after.clumps.size(), 6u);
      for (const auto& [tag, x] : before.places) EXPECT_LT((after.places.at(tag) - x).norm(), far) << tag;
      for (const auto& [number, c] : before.clumps) {
        EXPECT_LT((after.clumps.at(number).lies.centre - c.lies.centre).norm(), far) << number;
        EXPECT_EQ(after.clumps.at(number).rest, c.rest) << number;
        EXPECT_EQ(after.spheres.at(number), 3) << number;
      }
    }
}

TEST(ClumpsInRuns, that_a_granule_strikes_wake_whole_and_move) {
  for (const std::array<int, 3>& split : {std::array<int, 3>{1, 1, 1}, {2, 1, 1}}) {
    OfAllRanks after;
    run_on_ranks(TriangleColumn::deck(split), [&](SmallWorld& w) {
      TriangleColumn column(w);
      w.begin_run(&column.culling);
      column.steps(60);
      EXPECT_EQ(column.value(exterior_now), 0);
      column.culling.end_run();
      w.add(99, Vec3(0.001 + r, 0.002, column.top + 3 * r), r, Vec3(0, 0, -1));  // on the sphere that stands out to the right
      w.begin_run(&column.culling);
      column.steps(40);
      EXPECT_EQ(column.value(restored_so_far), 0);
      column.steps(60);
      EXPECT_GE(column.value(restored_so_far), 3);
      column.expect_all_counted(20);
      const auto there = column.spheres_there();
      EXPECT_EQ(there.back(), 3);
      column.culling.restore_all();
      w.reneighbour();
      after.add(w);
    });
    ASSERT_EQ(after.clumps.size(), 6u);
    const Clump& struck = after.clumps.at(6);
    EXPECT_GT(struck.velocity.norm() + r * struck.spin().norm(), 0.01);  // m/s: it does not stand like a rock
    for (const auto& [number, n] : after.spheres) EXPECT_EQ(n, 3) << number;
  }
}

// ------------------------------------------------------------------------------------------------------------ in space

Settings eager_settings() {
  Settings s = sleeping_settings();
  s.every = 10;
  s.calm = 2;
  s.speed = 0.1;
  return s;
}

TEST(ClumpsInRuns, a_bundle_that_is_struck_keeps_its_momenta) {
  for (const std::array<int, 3>& split : {std::array<int, 3>{1, 1, 1}, {2, 2, 1}}) {
    OfAllRanks before, after;
    SmallDeck deck = ClumpBundle::deck(split);
    deck.arms_meet = true;
    run_on_ranks(deck, [&](SmallWorld& w) {
      setenv("SOLIDCULL_CHECK", "1", 1);
      Culling culling(w.ports(), eager_settings(), 1);
      // neighbours hardly touch: they drift apart so slowly that they are calm
      ClumpBundle::make(w, Vec3(0.98 * r + ClumpBundle::step, 0, 0), 2 * r * (1 - 1e-7), false, true);
      w.add(101, Vec3(-0.2 * r, 0.4 * r, 0.022), r, Vec3(0, 0, -0.6), Vec3(10, 20, 30));  // it arrives after 120 steps
      w.follow(culling);
      before.add(w);
      w.begin_run(&culling);
      w.steps(&culling, 90);
      EXPECT_GE(culling.value(interior_now), 3);
      EXPECT_EQ(culling.value(restored_so_far), 0);
      w.steps(&culling, 160);
      EXPECT_GE(culling.value(restored_so_far), 3);
      EXPECT_LT(std::abs(culling.value(mass_error_now)), 1e-15);
      culling.end_run();
      culling.restore_all();
      w.reneighbour();
      after.add(w);
    });
    ASSERT_EQ(after.places.size(), 26u);
    ASSERT_EQ(after.clumps.size(), 8u);
    EXPECT_GT((after.velocities.at(101) - before.velocities.at(101)).norm(), 0.1);  // it has struck
    EXPECT_NEAR(after.mass, before.mass, 1e-12 * before.mass);
    EXPECT_LT((after.momentum - before.momentum).norm(), 1e-12 * before.motion);
    EXPECT_LT((after.turning - before.turning).norm(), 1e-12 * before.turning_motion);
  }
}

/// Of each clump of the bundle so many spheres are atoms, over all ranks.
std::vector<std::int64_t> spheres_of_bundle(const SmallWorld& w) {
  std::vector<std::int64_t> there(ClumpBundle::rods, 0);
  for (int i = 0; i < w.atoms.owned; ++i)
    if (w.atoms.tag[i] <= ClumpBundle::spheres) ++there[static_cast<std::size_t>((w.atoms.tag[i] - 1) / 3)];
  w.ranks.sum(there.data(), ClumpBundle::rods);
  return there;
}

/// The bundle flies out through the right side of the box, and each rod by one end. The engine deletes a clump with the first
/// sphere that it loses, so the culling has to give back what is left of it, whatever rank that is on.
TEST(ClumpsInRuns, that_leave_the_box_are_lost_whole_whatever_rank_their_spheres_are_on) {
  // m; the spheres of a rod are 6 mm from each other. The last: the sphere that is lost is alone on its rank
  for (const double cut : {0.0, -0.001, 0.0135}) {
    SmallDeck deck = ClumpBundle::deck({cut != 0 ? 2 : 1, 1, 1});
    deck.box.hi[0] = 0.015;
    run_on_ranks(deck, [&](SmallWorld& w) {
      setenv("SOLIDCULL_CHECK", "1", 1);
      if (cut != 0)
        w.ranks.move_cuts({std::vector<double>{deck.box.lo[0], cut, deck.box.hi[0]}, w.ranks.cuts()[1], w.ranks.cuts()[2]});
      w.ranks.update();
      Culling culling(w.ports(), eager_settings(), 1);
      ClumpBundle::make(w, Vec3(-0.022, 0, 0), 2 * r * (1 - 1e-7), false, true);
      const Vec3 velocity(1, 0, 0);
      for (int i = 0; i < w.atoms.owned; ++i) w.atoms.set_velocity(i, velocity);
      w.clumps.throw_all(velocity);
      w.follow(culling);
      w.begin_run(&culling);
      w.steps(&culling, 60);
      EXPECT_EQ(culling.value(exterior_now), 0) << cut;
      EXPECT_GE(culling.value(interior_now), 12) << cut;
      int broken_for = 0, lost = 0;  // steps, of any clump; clumps
      std::vector<std::int64_t> last = spheres_of_bundle(w);
      for (int n = 0; n < 540; ++n) {
        w.step(&culling);
        const std::vector<std::int64_t> there = spheres_of_bundle(w);
        bool broken = false;
        for (std::size_t k = 0; k < there.size(); ++k) {
          broken = broken || there[k] == 1 || there[k] == 2;
          lost += there[k] == 0 && last[k] > 0 && culling.stored() == 0;
        }
        last = there;
        broken_for = broken ? broken_for + 1 : 0;
        // neighbour lists are built every five steps: the one that loses it, and the one that gives the others back
        ASSERT_LE(broken_for, 12) << cut << ", step " << w.run.step;
      }
      EXPECT_EQ(culling.value(exterior_now) + culling.value(interface_now) + culling.value(interior_now), 0) << cut;
      EXPECT_GT(lost, 0) << cut;
      EXPECT_EQ(w.clumps.count(), 0) << cut;
      EXPECT_LT(std::abs(culling.value(mass_error_now)), 1e-15) << cut;
    });
  }
}

// ------------------------------------------------------------------------------------------------------------ between runs

/// A column that sleeps, on one rank and on two, of which the deck sees all granules.
void with_shown_column(const std::function<void(TriangleColumn&)>& work) {
  for (const int ranks : {1, 2})
    run_on_ranks(TriangleColumn::deck({ranks, 1, 1}), [&](SmallWorld& w) {
      TriangleColumn column(w);
      w.begin_run(&column.culling);
      column.steps(60);
      EXPECT_GE(column.value(interior_now), 15);
      column.culling.end_run();
      column.culling.show_bed();
      column.culling.finish_show();
      std::int64_t shown[2] = {w.atoms.owned, w.clumps.count()};
      w.ranks.sum(shown, 2);
      EXPECT_EQ(shown[0], 19);
      EXPECT_EQ(shown[1], 6);
      work(column);
    });
}

void next_run(TriangleColumn& column) {
  column.culling.hide_bed();
  column.world.begin_run(&column.culling);
}

TEST(ClumpsBetweenRuns, that_are_shown_and_not_touched_stay_culled) {
  with_shown_column([](TriangleColumn& column) {
    const double restored = column.value(restored_so_far), stored = column.value(interior_now);
    next_run(column);
    EXPECT_EQ(column.value(restored_so_far), restored);
    EXPECT_EQ(column.value(interior_now), stored);
    EXPECT_EQ(column.world.clumps.count(), 0);
    column.steps(5);
  });
}

TEST(ClumpsBetweenRuns, one_that_the_deck_has_thrown_wakes_with_that_motion) {
  with_shown_column([](TriangleColumn& column) {
    SmallWorld& w = column.world;
    constexpr int thrown = 4;
    const Vec3 velocity(0.1, 0.2, 0.3), spin(1, 2, 3);
    if (w.clumps.find(thrown) >= 0) {
      Clump c = w.clumps.take(thrown);
      c.move_as(velocity, spin);
      w.clumps.read(c);
    }
    next_run(column);
    EXPECT_EQ(column.spheres_there()[thrown - 1], 3);
    std::int64_t here = w.clumps.find(thrown) >= 0;
    if (here) {
      const Clump c = w.clumps.clump(w.clumps.find(thrown));
      EXPECT_EQ(c.velocity, velocity);
      EXPECT_LT((c.spin() - spin).norm(), 1e-12 * spin.norm());
    }
    w.ranks.sum(&here, 1);
    EXPECT_EQ(here, 1);
    column.expect_all_counted(19);
    column.steps(20);
  });
}

TEST(ClumpsBetweenRuns, one_of_which_a_sphere_was_deleted_is_gone_and_the_others_are_whole) {
  for (const int sphere : {10, 11, 12})
    with_shown_column([&](TriangleColumn& column) {
      SmallWorld& w = column.world;
      if (w.at(sphere) >= 0) w.atoms.take_out(w.at(sphere));
      next_run(column);
      column.steps(30);
      const std::vector<std::int64_t> there = column.spheres_there();
      EXPECT_EQ(there[3], 0);
      EXPECT_EQ(w.clumps.find(4), -1);
      EXPECT_EQ(column.value(exterior_now) + column.value(interface_now) + column.value(interior_now), 16);
      column.culling.end_run();
      column.culling.restore_all();
      std::int64_t left = w.clumps.count();
      w.ranks.sum(&left, 1);
      EXPECT_EQ(left, 5);
    });
}

TEST(ClumpsBetweenRuns, one_that_is_made_while_others_are_culled_gets_a_number_of_its_own) {
  for (const int ranks : {1, 2})
    run_on_ranks(TriangleColumn::deck({ranks, 1, 1}), [&](SmallWorld& w) {
      TriangleColumn column(w);
      w.begin_run(&column.culling);
      column.steps(60);
      column.culling.end_run();
      EXPECT_EQ(w.clumps.count(), 0);
      EXPECT_EQ(w.clumps.make(31, {{Vec3(-0.05, 0, 0.05), r}, {Vec3(-0.05, 0, 0.055), r}}), 7);
      w.begin_run(&column.culling);
      w.steps(&column.culling, 20);
      column.culling.end_run();
      column.culling.restore_all();
      std::int64_t all = w.clumps.count();
      w.ranks.sum(&all, 1);
      EXPECT_EQ(all, 7);
      w.reneighbour();
    });
}

}  // namespace
}  // namespace solidcull
