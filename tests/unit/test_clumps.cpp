// Clumps are locked, stored, freed and moved as one granule.
#include <gtest/gtest.h>

#include <set>

#include "clump_bundle.h"
#include "clump_numbers.h"

namespace solidcull {
namespace {

const SmallDeck on_one_rank = ClumpBundle::deck();

// ------------------------------------------------------------------------------------------------------------ invariant I3

/// What the engine has of the spheres and of the clumps that it moves.
struct EngineState {
  std::map<int, std::vector<double>> spheres, clumps;
  std::map<int, SmallAtoms::Histories> histories;

  explicit EngineState(SmallWorld& w) {
    for (int i = 0; i < w.atoms.owned; ++i) {
      int layout = 0;
      w.atoms.pack(i, spheres[w.atoms.tag[i]], layout);
      histories[w.atoms.tag[i]] = w.atoms.histories(i);
    }
    for (int k = 0; k < w.clumps.count(); ++k) pack(w.clumps.clump(k), clumps[w.clumps.clump(k).number]);
  }
};

TEST(CulledClumps, locked_stored_and_freed_in_one_step_are_as_they_were_to_the_bit) {
  for (const Store store : {Store::exact, Store::compact})
    for (const bool some_stored : {false, true}) {
      SmallWorld world(on_one_rank);
      BundleParts bundle(world, Vec3(0.03, -0.02, 0.01), false, store);
      const EngineState before(world);
      ASSERT_EQ(before.clumps.size(), 8u);
      bundle.parts.lock(bundle.tags);
      world.contacts.build();
      bundle.parts.leave_out();
      ASSERT_EQ(world.clumps.count(), 0);
      ASSERT_EQ(bundle.parts.bed.solid.bodies().size(), 1u);
      for (int i = 0; i < world.atoms.owned; ++i) EXPECT_EQ(world.clumps.of(i), 0);
      if (some_stored) bundle.parts.put_away({1, 2, 3, 10, 11, 12, 22, 23, 24});
      EXPECT_EQ(world.atoms.owned, some_stored ? 16 : 25);
      Wakes all;
      all.all = Woke::deck;
      bundle.parts.change(all, {});
      const EngineState after(world);
      EXPECT_EQ(after.spheres, before.spheres);
      EXPECT_EQ(after.clumps, before.clumps);
      for (const auto& [tag, of_tag] : before.histories) {
        ASSERT_EQ(after.histories.at(tag).size(), of_tag.size()) << tag;
        for (const auto& [partner, h] : of_tag) {
          // of two that were stored, exact keeps 1e-12 of a history, and compact a hundredth
          const double lost = some_stored ? (store == Store::exact ? 1e-12 : 0.01) : 0.0;
          EXPECT_LE((vec(after.histories.at(tag).at(partner).data()) - vec(h.data())).norm(), lost * vec(h.data()).norm())
              << tag << ' ' << partner;
        }
      }
    }
}

TEST(CulledClumps, a_body_has_the_mass_and_the_momenta_of_its_clumps) {
  SmallWorld world(on_one_rank);
  BundleParts bundle(world, Vec3(0.03, -0.02, 0.01));
  OfAllRanks free;
  free.add(world);
  bundle.lock();
  const SolidBodies& bodies = bundle.parts.bed.solid.bodies();
  ASSERT_EQ(bodies.size(), 1u);
  const RigidMotion& motion = bodies.body(bundle.parts.body_of(1)).motion;
  const Vec3 momentum = motion.mass() * motion.velocity(), turning = motion.angular_momentum() + motion.centre().cross(momentum);
  EXPECT_NEAR(motion.mass(), free.mass, 1e-12 * free.mass);
  EXPECT_LT((momentum - free.momentum).norm(), 1e-12 * free.motion);
  EXPECT_LT((turning - free.turning).norm(), 1e-12 * free.turning_motion);
  bundle.check();
  // and what is stored of it carries what it has
  bundle.store();
  ASSERT_EQ(bundle.stored().size(), 24u);
  enum { momentum_of_stored = 12, turning_of_stored = 15, mass_of_all = 22 };
  const int single = world.at(25);
  ASSERT_GE(single, 0);
  const Twist twist = bodies.body(bundle.parts.body_of(1)).twist;
  const Vec3 x = world.atoms.place(single);
  const RigidPart left = RigidPart::granule(world.atoms.mass[single], r, x, twist.at(x), twist.spin);
  for (int d = 0; d < 3; ++d) {
    EXPECT_NEAR(bundle.parts.report.value(momentum_of_stored + d) + left.mass * left.velocity[d], momentum[d],
                1e-12 * free.motion);
    EXPECT_NEAR(bundle.parts.report.value(turning_of_stored + d) + left.angular_momentum(Vec3::Zero())[d], turning[d],
                1e-12 * free.turning_motion);
  }
  EXPECT_NEAR(bundle.parts.report.value(mass_of_all), free.mass, 1e-12 * free.mass);
}

// ------------------------------------------------------------------------------------------------------------ all or nothing

TEST(CulledClumps, one_of_which_not_all_spheres_were_chosen_stays_free) {
  SmallWorld world(on_one_rank);
  BundleParts bundle(world);
  bundle.parts.lock({1, 2, 3, 4, 5, 25});  // all of the first rod and of the single granule, two spheres of the second rod
  EXPECT_EQ(bundle.parts.bed.solid.locked(), 4u);
  for (const int tag : {4, 5, 6}) {
    EXPECT_EQ(bundle.parts.body_of(tag), 0) << tag;
    EXPECT_GT(world.clumps.of(world.at(tag)), 0) << tag;
  }
}

/// A ball around one sphere wakes its clump, be it stored or in the shell, and whatever rank the others are on.
TEST(CulledClumps, one_that_wakes_by_one_sphere_wakes_whole) {
  for (const int ranks : {1, 2})
    for (const bool is_stored : {false, true})
      for (const int struck : {1, 3}) {  // on the left and on the right of the border
        OfAllRanks all;
        run_on_ranks(ClumpBundle::deck({ranks, 1, 1}), [&](SmallWorld& w) {
          BundleParts bundle(w, Vec3(0.98 * r + ClumpBundle::step, 0, 0));  // the left rods' middle spheres are at the border
          const Vec3 there =
              Vec3(0.98 * r + ClumpBundle::step, 0, 0) - 0.98 * Vec3(r, r, r) - Vec3((3 - struck) * ClumpBundle::step, 0, 0);
          bundle.lock();
          if (is_stored) bundle.store();
          Wakes wakes;
          wakes.balls.push_back({there, 0.3 * r});
          bundle.wake(wakes);
          for (const std::int64_t tag : bundle.tags)
            if (tag > 3) {
              EXPECT_TRUE(bundle.parts.body_of(tag) || w.at(static_cast<int>(tag)) < 0) << tag;
            }
          all.add(w);
        });
        ASSERT_EQ(all.clumps.size(), 1u) << ranks << is_stored << struck;
        EXPECT_EQ(all.spheres, (std::map<int, int>{{1, 3}}));
        if (ranks == 2) {
          EXPECT_NE(all.rank_of.at(1), all.rank_of.at(3));
        }
      }
}

/// An exterior granule comes near one sphere of a clump: all of it comes out of the store, and nothing else, though another rank
/// stores it.
TEST(CulledClumps, one_whose_sphere_is_fetched_is_fetched_whole) {
  for (const int ranks : {1, 2}) {
    OfAllRanks all;
    std::set<std::int64_t> still_stored;
    run_on_ranks(ClumpBundle::deck({ranks, 1, 1}), [&](SmallWorld& w) {
      BundleParts bundle(w, Vec3(0.98 * r + ClumpBundle::step, 0, 0));
      bundle.lock();
      bundle.store();
      const std::set<std::int64_t> stored = bundle.stored();
      if (ranks == 2) {
        EXPECT_EQ(stored.count(1), w.ranks.me == 0 ? 1u : 0u) << "the sphere with the mass is on the left of the border";
      }
      EXPECT_EQ(stored.count(1), stored.count(3));
      const Vec3 third = Vec3(0.98 * r + ClumpBundle::step, 0, 0) - 0.98 * Vec3(r, r, r);
      w.add(100, third - Vec3(0, 2.1 * r, 0), r);  // of the right end of the first rod
      bundle.parts.reneighbour();
      bundle.parts.bed.index.index(w.atoms);
      bundle.parts.closure.share();
      bundle.parts.closure.fetch_what_is_near();
      bundle.parts.send_home();
      bundle.parts.reneighbour();
      bundle.check();
      all.add(w);
      const std::set<std::int64_t> left = bundle.stored();
      const std::lock_guard<std::mutex> lock(all.mutex);
      still_stored.insert(left.begin(), left.end());
    });
    for (int tag = 1; tag <= 3; ++tag) EXPECT_EQ(all.places.count(tag), 1u) << tag;
    EXPECT_EQ(still_stored.size() + all.places.size(), 26u);
    EXPECT_GE(still_stored.size(), 15u);
    for (const std::int64_t tag : still_stored)
      for (int k = 0; k < 3; ++k) EXPECT_TRUE(still_stored.count(ClumpBundle::first_of(static_cast<int>(tag)) + k)) << tag;
  }
}

// ------------------------------------------------------------------------------------------------------------ on two ranks

/// Clumps across a border are stored once, where the sphere is that has the mass, and come back there and whole.
TEST(CulledClumps, across_a_border_are_on_one_rank_in_the_store_and_come_back_whole) {
  for (const bool backwards : {false, true}) {
    OfAllRanks before, after;
    std::map<std::int64_t, int> stored_on;
    run_on_ranks(ClumpBundle::deck({2, 1, 1}), [&](SmallWorld& w) {
      BundleParts bundle(w, Vec3(0.98 * r + ClumpBundle::step, 0, 0), backwards);
      before.add(w);
      bundle.lock();
      bundle.store();
      bundle.check();
      {
        const std::lock_guard<std::mutex> lock(after.mutex);
        for (const std::int64_t tag : bundle.stored())
          EXPECT_TRUE(stored_on.emplace(tag, w.ranks.me).second) << "two ranks store granule " << tag;
      }
      bundle.wake_all();
      after.add(w);
      EXPECT_EQ(bundle.parts.bed.solid.locked(), 0u);
    });
    ASSERT_EQ(stored_on.size(), 24u);
    std::set<int> homes, across;
    for (const auto& [tag, rank] : stored_on) {
      const int first = ClumpBundle::first_of(static_cast<int>(tag));
      EXPECT_EQ(rank, before.rank_of.at(first)) << tag;
      homes.insert(rank);
      if (before.rank_of.at(static_cast<int>(tag)) != rank) across.insert(first);
    }
    EXPECT_EQ(homes.size(), backwards ? 1u : 2u);  // the spheres at the right ends are all on one rank
    EXPECT_EQ(across.size(), 4u);
    ASSERT_EQ(after.places.size(), 25u);
    ASSERT_EQ(after.clumps.size(), 8u);
    for (const auto& [tag, x] : before.places) {
      EXPECT_LT((after.places.at(tag) - x).norm(), 1e-15) << tag;
      EXPECT_EQ(after.rank_of.at(tag), before.rank_of.at(tag)) << tag;
    }
    for (const auto& [number, c] : before.clumps) {
      const Clump& now = after.clumps.at(number);
      EXPECT_LT((now.lies.centre - c.lies.centre).norm(), 1e-15) << number;
      EXPECT_LT(now.lies.turn.angularDistance(c.lies.turn), 1e-7) << number;  // the root of a rounding error
      EXPECT_EQ(now.mass, c.mass);
      EXPECT_EQ(now.rest, c.rest);
      EXPECT_EQ(after.spheres.at(number), 3) << number;
    }
    EXPECT_NEAR(after.mass, before.mass, 1e-12 * before.mass);
    EXPECT_LT((after.momentum - before.momentum).norm(), 1e-12 * before.motion);
    EXPECT_LT((after.turning - before.turning).norm(), 1e-12 * before.turning_motion);
  }
}

/// Their bodies carry clumps over the border, stored or in the shell.
TEST(CulledClumps, go_with_their_body_to_another_rank) {
  for (const bool is_stored : {false, true})
    for (const double way : {0.3 * r, 2 * r, 5 * r}) {
      OfAllRanks before, after;
      run_on_ranks(ClumpBundle::deck({2, 1, 1}), [&](SmallWorld& w) {
        BundleParts bundle(w, Vec3(-0.5 * r, 0, 0));
        before.add(w);
        bundle.lock();
        if (is_stored) bundle.store();
        bundle.shift(Vec3(way, 0, 0));
        bundle.parts.bed.index.index(w.atoms);
        bundle.parts.send_home();
        bundle.parts.reneighbour();
        bundle.check();
        for (const std::int64_t tag : bundle.stored()) {
          const auto first = bundle.parts.bed.solid.store().find(ClumpBundle::first_of(static_cast<int>(tag)));
          ASSERT_TRUE(first) << tag << " without the sphere that has its clump's mass";
          EXPECT_GT(bundle.parts.bed.solid.in_world(*first)[0] * (w.ranks.me ? 1 : -1), -0.5 * bundle.parts.bed.stored.slack());
        }
        bundle.wake_all();
        after.add(w);
      });
      ASSERT_EQ(after.places.size(), 25u);
      ASSERT_EQ(after.clumps.size(), 8u);
      for (const auto& [tag, x] : before.places) EXPECT_LT((after.places.at(tag) - x - Vec3(way, 0, 0)).norm(), 1e-15) << tag;
      for (const auto& [number, c] : before.clumps) {
        EXPECT_LT((after.clumps.at(number).lies.centre - c.lies.centre - Vec3(way, 0, 0)).norm(), 1e-15) << number;
        EXPECT_EQ(after.spheres.at(number), 3) << number;
      }
      EXPECT_LT((after.momentum - before.momentum).norm(), 1e-12 * before.motion);
    }
}

// ------------------------------------------------------------------------------------------------------------ looks

constexpr int looks_till_calm = 4;

/// A clump of two spheres, 1 and 2, and a granule at each of its ends, 3 beside 1 and 4 beside 2. All press a little. What bears
/// on them else is what a test says. On two ranks the border is in the middle of the clump.
struct LookedAtClump {
  explicit LookedAtClump(SmallWorld& w) : world(w), parts(w, sleeping_settings(), 2 * r) {
    w.clumps.make(1, {{Vec3(-0.6 * r, 0, 0), r}, {Vec3(0.6 * r, 0, 0), r}});
    const double press = 15 * 9.81 * w.mass_of(r) / w.deck.stiffness;  // what bears little is to be calm for longer
    w.add(3, Vec3(press - 2.6 * r, 0, 0), r);
    w.add(4, Vec3(2.6 * r - press, 0, 0), r);
    w.reneighbour();
    parts.bed.see_largest_radius();
    parts.walls.update({}, false);
    for (int i = 0; i < w.atoms.owned; ++i) w.atoms.clear_load(i);
    speed = parts.bed.scales.solid_state().speed;
  }
  void look() {
    proposal = Proposal();
    parts.motion.refresh();
    const Patience patience{false, looks_till_calm, 1};
    parts.survey.find_calm(patience, proposal);
    parts.survey.leave_out_unsteady(patience, proposal);
    parts.survey.choose_asleep(patience, proposal);
    world.run.step += parts.bed.scales.look_every();
  }
  void looks() {
    for (int n = 0; n < looks_till_calm; ++n) look();
  }
  void expect_chosen(const std::set<std::int64_t>& due) const {
    for (const std::int64_t tag : {1, 2, 3, 4})
      if (world.at(static_cast<int>(tag)) >= 0) {
        EXPECT_EQ(std::count(proposal.chosen.begin(), proposal.chosen.end(), tag), due.count(tag)) << tag;
      }
  }
  void expect_calm(int tag, int looks) const {
    if (world.at(tag) >= 0) {
      EXPECT_EQ(parts.survey[world.at(tag)].calm, looks) << tag;
    }
  }
  void bear(int tag, const Vec3& weights) {
    if (world.at(tag) >= 0) set(world.atoms.f + 3 * std::size_t(world.at(tag)), 9.81 * world.mass_of(r) * weights);
  }
  void strike(int tag, const Vec3& velocity) {
    if (world.at(tag) >= 0) world.atoms.set_velocity(world.at(tag), velocity);
  }
  SmallWorld& world;
  WorldParts parts;
  Proposal proposal;
  double speed;
};

void look_on_one_and_two_ranks(const std::function<void(LookedAtClump&)>& work) {
  for (const int ranks : {1, 2})
    run_on_ranks(ClumpBundle::deck({ranks, 1, 1}), [&](SmallWorld& w) {
      LookedAtClump c(w);
      EXPECT_EQ(w.atoms.owned, 4 / ranks);
      work(c);
    });
}

TEST(CalmOfClumps, one_at_rest_is_chosen_though_each_sphere_touches_on_one_side_only) {
  look_on_one_and_two_ranks([](LookedAtClump& c) {
    for (int n = 1; n < looks_till_calm; ++n) c.look();
    c.expect_chosen({});
    c.look();
    c.expect_chosen({1, 2, 3, 4});
  });
}

TEST(CalmOfClumps, is_that_of_all_of_its_spheres) {
  look_on_one_and_two_ranks([](LookedAtClump& c) {
    c.look();
    c.look();
    c.strike(4, Vec3(0, 1.1 * c.speed, 0));
    c.look();
    for (const int tag : {1, 2, 4}) c.expect_calm(tag, 0);  // 1 touches nothing that moves
    c.expect_calm(3, 3);
    c.strike(4, Vec3(0, 0.9 * c.speed, 0));
    c.look();
    for (const int tag : {1, 2, 4}) c.expect_calm(tag, 1);
    c.expect_chosen({3});
  });
}

TEST(CalmOfClumps, one_of_which_a_sphere_is_held_stays_free) {
  look_on_one_and_two_ranks([](LookedAtClump& c) {
    if (c.world.at(2) >= 0) c.world.atoms.groups[c.world.at(2)] |= SmallAtoms::held_group;
    c.looks();
    for (const int tag : {1, 2}) c.expect_calm(tag, 0);
    c.expect_chosen({3, 4});
  });
}

/// Forces on its spheres that cancel leave it at rest. The same as a couple turn it.
TEST(CalmOfClumps, one_that_is_turned_is_not_balanced_though_its_centre_is) {
  look_on_one_and_two_ranks([](LookedAtClump& c) {
    c.bear(1, Vec3(3, 0, 0));
    c.bear(2, Vec3(-3, 0, 0));
    c.looks();
    c.expect_chosen({1, 2, 3, 4});
  });
  look_on_one_and_two_ranks([](LookedAtClump& c) {
    c.bear(1, Vec3(0, 3, 0));
    c.bear(2, Vec3(0, -3, 0));
    c.looks();
    for (const int tag : {1, 2}) c.expect_calm(tag, 0);
  });
}

}  // namespace
}  // namespace solidcull
