// A column at rest, asleep but for its highest granule, which the deck holds, and which becomes heavier by less than `tolerance`:
// what sleeps below it would sink, by what springs say.
#include <gtest/gtest.h>

#include <cstdlib>

#include "culling.h"
#include "world_parts.h"

namespace solidcull {
namespace {

constexpr int patches = 38 - 1, way_low = 39 - 1, shift_low = 41 - 1, energy_high = 44 - 1;  // of f_ID

Settings audited(int every, int number) {
  Settings s = sleeping_settings();
  s.audit_every = every;
  s.audit_patches = number;
  return s;
}

struct Pressed {
  static constexpr int granules = 12;

  explicit Pressed(SmallWorld& w, const Settings& settings) : world(w), culling(w.ports(), settings, 1) {
    setenv("SOLIDCULL_CHECK", "1", 1);
    double z = 0;
    for (int n = 0; n < granules; ++n) {
      z += (n ? 2 * r : r) - (granules - n) * weight() / world.deck.stiffness;
      world.add(n + 1, Vec3(0.001, 0.002, z), r);
    }
    world.atoms.groups[world.at(granules)] |= SmallAtoms::held_group;
    world.atoms.held_bits = SmallAtoms::held_group;
    world.follow(culling);
  }
  static SmallDeck deck() {
    SmallDeck d;
    d.meshes = {SmallDeck::floor(0, 0.2)};
    d.damping = 2;
    return d;
  }
  double weight() const { return 9.81 * world.mass_of(r); }
  double value(int n) { return culling.value(n); }
  SmallWorld& world;
  Culling culling;
};

TEST(Audit, sees_what_sleeps_through_a_small_load) {
  SmallWorld world(Pressed::deck());
  Pressed p(world, audited(300, 1));
  world.begin_run(&p.culling);
  world.steps(&p.culling, 100);
  ASSERT_EQ(p.value(0), 1) << "only what the deck holds is awake";
  const double more = 0.4 * p.weight();
  world.atoms.set_size(world.at(Pressed::granules), r, 1.4 * world.mass_of(r));
  world.steps(&p.culling, 150);
  ASSERT_EQ(p.value(0), 1) << "less than the tolerance";
  ASSERT_EQ(p.value(patches), 0);
  world.steps(&p.culling, 2040);
  EXPECT_EQ(p.value(0), 1) << "what was woken for it is culled again";
  ASSERT_GE(p.value(patches), 6);
  // the three highest ones lie in the patch, and each contact below is shorter by more/stiffness: the first audit sees that, the
  // next ones less and less of it, for what it has let go has sunk
  EXPECT_GT(p.value(way_low), 0);
  EXPECT_LT(p.value(way_low + 1), 3 * 3 * more / world.deck.stiffness);
  EXPECT_GT(p.value(way_low + 1), 2 * more / world.deck.stiffness / p.value(patches));
  EXPECT_GT(p.value(shift_low + 1), 0.2 * more / p.value(patches));
  EXPECT_LT(p.value(energy_high), 1e-3 * world.mass_of(r) * 9.81 * r) << "it has come to rest when the audit ends";
}

TEST(Audit, finds_next_to_nothing_in_a_column_at_rest) {
  SmallWorld world(Pressed::deck());
  Pressed p(world, audited(400, 2));
  world.begin_run(&p.culling);
  world.steps(&p.culling, 3190);
  ASSERT_GE(p.value(patches), 6);
  EXPECT_GE(p.value(way_low + 1), p.value(way_low));
  EXPECT_LT(p.value(way_low + 1), 1e-3 * p.weight() / world.deck.stiffness);
  EXPECT_LT(p.value(shift_low + 1), 1e-3 * p.weight());
  EXPECT_EQ(p.value(0), 1);
}

TEST(Audit, there_is_none_unless_it_is_asked_for) {
  SmallWorld world(Pressed::deck());
  Pressed p(world, sleeping_settings());
  world.begin_run(&p.culling);
  world.steps(&p.culling, 1000);
  EXPECT_EQ(p.value(patches), 0);
  EXPECT_EQ(p.value(6), 0) << "nothing was woken";
  p.culling.end_run();
  EXPECT_EQ(world.run.said.back().find("audit"), std::string::npos);
}

TEST(Audit, what_was_struck_in_time_is_no_fault) {
  SmallWorld world(Pressed::deck());
  Pressed p(world, audited(300, 1));
  world.begin_run(&p.culling);
  world.steps(&p.culling, 310);  // one lasts
  ASSERT_GT(p.value(0), 1);
  world.atoms.set_size(world.at(Pressed::granules), r, 30 * world.mass_of(r));  // far beyond the tolerance
  world.steps(&p.culling, 150);
  ASSERT_EQ(p.value(patches), 1);
  p.culling.end_run();
  const std::string& told = world.run.said.back();
  EXPECT_NE(told.find("audit         = 1 patches, "), std::string::npos) << told;
  EXPECT_EQ(told.find(" 0 of which woke anyway"), std::string::npos) << told;
}

}  // namespace
}  // namespace solidcull
