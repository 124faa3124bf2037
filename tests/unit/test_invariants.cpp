#include <gtest/gtest.h>

#include "world_parts.h"

namespace solidcull {
namespace {

/// Two rows of four, each a body; of the first the inner two are stored.
struct TwoBodies {
  explicit TwoBodies(const Vec3& velocity = Vec3::Zero()) : world(empty_space()), parts(world, sleeping_settings(), 2 * r) {
    for (const int first : {1, 11})
      for (int n = 0; n < 4; ++n)
        world.add(first + n, Vec3(0.999 * 2 * r * n, first == 1 ? 0 : 0.05, 0), r, velocity + Vec3(0, 0, 0.01 * n));
    world.reneighbour();
    world.compute_forces();
    parts.lock({1, 2, 3, 4, 11, 12, 13, 14});
    ++world.run.step;
    parts.put_away({2, 3});
    parts.reneighbour();
  }
  GranuleStore& store() { return const_cast<GranuleStore&>(parts.bed.solid.store()); }
  Ledger& ledger() { return const_cast<Ledger&>(parts.bed.solid.ledger()); }
  SolidBody& body(int tag) { return parts.bed.solid.body(parts.body_of(tag)); }
  std::string broken() {
    try {
      parts.invariants.check();
    } catch (const InternalError& e) {
      return e.what();
    }
    return "";
  }
  SmallWorld world;
  WorldParts parts;
};

bool says(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

TEST(Invariants, hold_after_locking_and_storing) {
  TwoBodies two;
  EXPECT_EQ(two.broken(), "");
  // a granule may come near, as long as it does not touch
  two.world.add(50, Vec3(0.999 * 2 * r, 2.01 * r, 0), r);
  EXPECT_EQ(two.broken(), "");
}

TEST(Invariants, an_exterior_granule_at_a_stored_one_is_seen) {
  TwoBodies two;
  two.world.add(50, Vec3(0.999 * 2 * r, 1.99 * r, 0), r);
  EXPECT_TRUE(says(two.broken(), "exterior granule 50 touches interior granule 2"));
}

TEST(Invariants, a_granule_of_another_body_at_a_stored_one_is_seen) {
  TwoBodies two;
  two.body(11).shift(Vec3(0, 1.99 * r - 0.05, 0));
  two.parts.motion.refresh();
  two.parts.motion.place();
  EXPECT_TRUE(says(two.broken(), "of another body touches interior granule"));
}

TEST(Invariants, a_granule_lost_from_the_store_is_seen) {
  TwoBodies two;
  std::vector<double> record;
  two.store().take(2, record);
  EXPECT_TRUE(says(two.broken(), "the ledger has 2 granules in the store, which holds 1"));
}

TEST(Invariants, mass_lost_from_the_store_is_seen) {
  TwoBodies two;
  StoredGranule g;
  g.mass = 1e-9 * two.world.mass_of(r);
  two.ledger().stored(g);
  g.mass = 0;
  two.ledger().returned(g);
  EXPECT_TRUE(says(two.broken(), "mass in the store differs from the ledger"));
}

TEST(Invariants, a_locked_granule_without_a_body_or_the_other_way_round_is_seen) {
  TwoBodies two;
  const int i = two.world.at(14);
  two.parts.bed.shell.unlock(two.world.atoms, i);
  EXPECT_TRUE(says(two.broken(), "8 granules are in bodies and 7 are locked"));
}

TEST(Invariants, an_interface_granule_in_the_wrong_body_is_seen) {
  TwoBodies two;
  two.parts.bed.shell.set_body(two.world.at(14), two.parts.body_of(1));
  EXPECT_TRUE(says(two.broken(), "interface granule 14 stands in the wrong body"));
}

TEST(Invariants, a_body_that_moves_among_those_that_stand_is_seen) {
  TwoBodies two;
  two.store().share(two.parts.body_of(1), true);
  EXPECT_TRUE(says(two.broken(), "moves and lies among those that stand still"));
}

TEST(Invariants, other_mass_properties_than_those_of_the_granules_are_seen) {
  TwoBodies count, mass, held, centre;
  count.body(1).mass.count += 1;
  EXPECT_TRUE(says(count.broken(), "other mass properties"));
  mass.body(1).mass.mass *= 1 + 1e-11;
  EXPECT_TRUE(says(mass.broken(), "other mass properties"));
  held.body(1).mass.held += 1;
  EXPECT_TRUE(says(held.broken(), "other mass properties"));
  centre.body(1).mass.first += Vec3(1e-6 * r, 0, 0) * centre.body(1).mass.mass;
  EXPECT_TRUE(says(centre.broken(), "other mass properties"));
}

// ------------------------------------------------------------------------------------------------------------ lost atoms

TEST(LostAtoms, what_leaves_the_box_leaves_its_body) {
  TwoBodies two;
  two.parts.handover.remember();
  EXPECT_FALSE(two.parts.handover.forget_lost());
  // the second row sticks out of the box by its last granule
  two.body(11).shift(Vec3(1 - 0.999 * 2 * r * 2.5, 0, 0));
  two.parts.motion.refresh();
  two.parts.motion.place();
  two.parts.handover.remember();
  two.world.exchange();
  ASSERT_EQ(two.world.at(14), -1);
  EXPECT_TRUE(two.parts.handover.forget_lost());
  EXPECT_EQ(two.parts.body_of(14), 0);
  EXPECT_EQ(two.body(11).mass.count, 3);
  EXPECT_FALSE(two.parts.bed.solid.contacts().contains(13, 14));
  EXPECT_TRUE(two.parts.bed.solid.contacts().contains(12, 13));
  EXPECT_EQ(two.broken(), "");
  EXPECT_FALSE(two.parts.handover.forget_lost());
}

TEST(LostAtoms, a_body_that_loses_its_middle_comes_apart) {
  TwoBodies two;
  two.parts.handover.remember();
  two.world.atoms.take_out(two.world.at(12));  // a deck deletes it
  EXPECT_TRUE(two.parts.handover.forget_lost());
  EXPECT_NE(two.parts.body_of(11), two.parts.body_of(13));
  EXPECT_EQ(two.parts.body_of(13), two.parts.body_of(14));
  EXPECT_EQ(two.body(11).mass.count, 1);
  EXPECT_EQ(two.parts.bed.shell[two.world.at(14)].body, two.parts.body_of(14));
  EXPECT_EQ(two.broken(), "");
}

TEST(LostAtoms, stored_granules_are_not_missed) {
  TwoBodies two;
  two.parts.handover.remember();
  two.parts.put_away({11, 12});
  EXPECT_FALSE(two.parts.handover.forget_lost());
  EXPECT_EQ(two.parts.body_of(11), two.parts.body_of(14));
}

// ------------------------------------------------------------------------------------------------------------ report

TEST(Report, counts_who_is_where) {
  TwoBodies two;
  two.world.add(50, Vec3(0, -0.1, 0), r);
  const double m = two.world.mass_of(r);
  const double expected[12] = {1, 6, 2, 2, 2 * m, 8, 0, 0, 0, 0, 0, 0};
  for (int n = 0; n < 12; ++n) {
    if (n == 9) continue;  // the seconds
    EXPECT_NEAR(two.parts.report.value(n), expected[n], 1e-15) << n;
  }
  EXPECT_EQ(two.parts.report.value(-1), 0);
  EXPECT_EQ(two.parts.report.value(Report::counts + Report::carried + Report::of_all), 0);
}

TEST(Report, says_what_all_granules_have_together) {
  TwoBodies two(Vec3(0.3, 0, 0));
  two.world.add(50, Vec3(0, -0.1, 0), r, Vec3(0, 0, 2), Vec3(30, 0, 0));
  two.parts.motion.begin_lists();
  two.parts.motion.refresh();
  two.parts.motion.give_velocities();  // interface granules move with their bodies
  const double m = two.world.mass_of(r), inertia = 0.4 * m * r * r;
  double before[Report::of_all];
  const int first = Report::counts + Report::carried;
  for (int n = 0; n < Report::of_all; ++n) before[n] = two.parts.report.value(first + n);
  EXPECT_NEAR(before[0], 9 * m, 1e-12 * m);
  const double of_bodies = before[4] + before[5] - 0.5 * m * 4 - 0.5 * inertia * 900;
  EXPECT_NEAR(
      of_bodies,
      two.parts.bed.solid.kinetic_energy(two.parts.body_of(1)) + two.parts.bed.solid.kinetic_energy(two.parts.body_of(11)),
      1e-12 * before[4]);
  two.parts.put_away({4, 14});  // whoever is stored, the sums are the same
  ++two.world.run.step;
  for (int n = 0; n < Report::of_all; ++n)
    EXPECT_NEAR(two.parts.report.value(first + n), before[n], 1e-12 * (std::abs(before[n]) + r)) << n;
}

TEST(Report, counts_anew_when_membership_has_changed_or_a_step_has_passed) {
  TwoBodies two;
  ASSERT_EQ(two.parts.report.value(Report::interior), 2);
  two.parts.put_away({1});
  EXPECT_EQ(two.parts.report.value(Report::interior), 2);  // one count a step is enough
  two.parts.report.membership_changed();
  EXPECT_EQ(two.parts.report.value(Report::interior), 3);
  two.parts.put_away({4});
  ++two.world.run.step;
  EXPECT_EQ(two.parts.report.value(Report::interior), 4);
}

TEST(Report, says_what_stored_granules_carry) {
  TwoBodies two(Vec3(0.3, 0, 0));
  const SolidBody& body = two.body(1);
  ASSERT_GT(body.twist.spin.norm(), 0.1);  // it turns, too
  const double m = two.world.mass_of(r), inertia = 0.4 * m * r * r;
  Vec3 momentum = Vec3::Zero(), turning = Vec3::Zero(), centre = Vec3::Zero();
  double energy = 0;
  for (int n = 1; n <= 2; ++n) {
    const Vec3 x(0.999 * 2 * r * n, 0, 0), v = body.twist.velocity + body.twist.spin.cross(x - body.twist.point);
    momentum += m * v;
    turning += x.cross(m * v) + inertia * body.twist.spin;
    energy += 0.5 * m * v.squaredNorm() + 0.5 * inertia * body.twist.spin.squaredNorm();
    centre += 0.5 * x;
  }
  const auto three = [&](int from) {
    return Vec3(two.parts.report.value(from), two.parts.report.value(from + 1), two.parts.report.value(from + 2));
  };
  EXPECT_LT((three(12) - momentum).norm(), 1e-12 * momentum.norm());
  EXPECT_LT((three(15) - turning).norm(), 1e-12 * turning.norm());
  EXPECT_NEAR(two.parts.report.value(18), energy, 1e-12 * energy);
  EXPECT_LT((three(19) - centre).norm(), 1e-12 * centre.norm());
}

TEST(Report, tells_all_counters_in_two_lines) {
  TwoBodies two;
  two.parts.report.tell_counters();
  ASSERT_EQ(two.world.run.said.size(), 2u);
  EXPECT_TRUE(says(two.world.run.said[0], "0 exterior, 6 interface, 2 interior granules in 2 bodies; culled 8, restored 0"));
  EXPECT_TRUE(says(two.world.run.said[1], "s in the fix since it was made"));
}

}  // namespace
}  // namespace solidcull
