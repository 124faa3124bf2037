#include <gtest/gtest.h>

#include <cmath>

#include "world_parts.h"

namespace solidcull {
namespace {

const double degree = std::acos(-1.0) / 180;

/// A block of n x n x n granules that is one body.
struct Block {
  explicit Block(int n, const SmallDeck& deck = SmallDeck(), const Settings& settings = sleeping_settings())
      : world(deck), parts(world, settings, 2 * r) {
    std::vector<std::int64_t> tags;
    for (int k = 0; k < n * n * n; ++k) {
      world.add(k + 1, 0.999 * 2 * r * Vec3(k % n, k / n % n, k / n / n), r);
      tags.push_back(k + 1);
    }
    world.reneighbour();
    world.compute_forces();
    parts.gravity.begin_run();  // before anything is culled
    parts.lock(tags);
    parts.motion.refresh();
    number = parts.body_of(1);
    window = std::max(parts.bed.scales.look_every(), static_cast<int>(std::ceil(10 * n)));
  }
  SolidBody& body() { return parts.bed.solid.body(number); }
  void watch() {
    parts.motion.begin_lists();
    parts.motion.refresh();
    parts.gravity.watch();
  }
  /// The body is pulled for a window's steps, and seen at its end.
  void pull(const Vec3& acceleration) {
    body().kick(body().motion.mass() * acceleration, Vec3::Zero(), window * world.run.dt);
    world.run.step += window;
    watch();
  }
  bool asks() const { return parts.bed.wake.asks_body(number); }
  void tilt(double degrees) { world.deck.gravity = 9.81 * Vec3(std::sin(degrees * degree), 0, -std::cos(degrees * degree)); }

  SmallWorld world;
  WorldParts parts;
  int number, window;
};

TEST(EffectiveGravity, a_body_that_stands_wakes_when_gravity_tilts_beyond_its_share) {
  // of |g| across: a tenth of 3/120 for 343 granules (0.14 degrees), ten times as much for 27 (1.4 degrees)
  struct Case {
    int n;
    double sleeps, wakes;
  };
  for (const Case& c : {Case{7, 0.13, 0.16}, Case{3, 1.3, 1.6}})
    for (const double degrees : {c.sleeps, c.wakes}) {
      Block block(c.n);
      block.parts.bed.solid.ground(block.number, true);
      block.watch();  // what it feels when it is locked
      EXPECT_FALSE(block.asks());
      block.tilt(degrees);
      block.watch();
      EXPECT_EQ(block.asks(), degrees == c.wakes) << c.n << ' ' << degrees;
    }
}

TEST(EffectiveGravity, slow_turning_adds_up) {
  Block block(7);
  block.parts.bed.solid.ground(block.number, true);
  block.watch();
  for (double degrees = 0.02; degrees < 0.13; degrees += 0.02) {
    block.tilt(degrees);
    block.watch();
    EXPECT_FALSE(block.asks()) << degrees;
  }
  block.tilt(0.16);
  block.watch();
  EXPECT_TRUE(block.asks());
}

TEST(EffectiveGravity, gravity_turns_from_look_to_look_but_not_where_its_size_changes) {
  Block block(3);
  block.watch();
  EXPECT_FALSE(block.parts.gravity.turns());
  block.tilt(0.001);
  block.watch();
  EXPECT_TRUE(block.parts.gravity.turns());
  block.watch();
  EXPECT_FALSE(block.parts.gravity.turns()) << "it stands again";
  block.world.deck.gravity *= 0.5;
  block.watch();
  EXPECT_FALSE(block.parts.gravity.turns());
  block.world.deck.gravity.setZero();
  block.watch();
  EXPECT_FALSE(block.parts.gravity.turns());
  block.tilt(5);
  block.watch();
  EXPECT_FALSE(block.parts.gravity.turns()) << "it had no direction";
}

TEST(EffectiveGravity, a_body_that_rested_wakes_when_it_is_let_fall_and_one_that_falls_on_does_not) {
  Block rests(7), falls(7);
  const Vec3 g = rests.world.deck.gravity;
  rests.watch();  // the window of its mean acceleration begins
  falls.watch();
  rests.pull(Vec3::Zero());  // it felt gravity
  falls.pull(g);             // it felt nothing
  EXPECT_FALSE(rests.asks() || falls.asks());
  rests.pull(g);
  falls.pull(g);
  EXPECT_TRUE(rests.asks());
  EXPECT_FALSE(falls.asks());
  falls.pull(Vec3::Zero());  // it lands
  EXPECT_TRUE(falls.asks());
}

TEST(EffectiveGravity, what_a_body_feels_turns_with_it) {
  for (const double degrees : {1.3, 1.6}) {
    Block block(7);
    block.watch();
    block.pull(Vec3::Zero());
    // the body turns and gravity stays: in its frame it is gravity that turns
    block.body().pose.advance(
        {block.body().motion.centre(), block.body().motion.centre(), rotation(Vec3(0, degrees * degree, 0))});
    block.pull(Vec3::Zero());
    EXPECT_EQ(block.asks(), degrees > 1.5) << degrees;
  }
}

TEST(EffectiveGravity, a_force_is_felt_over_the_time_in_which_a_wave_crosses_the_body) {
  Block block(7);
  block.watch();
  block.pull(Vec3::Zero());
  // half of the window at 4/5 of g sideways, then back: the mean over it is nothing
  const double half = 0.5 * block.window * block.world.run.dt;
  block.body().kick(block.body().motion.mass() * Vec3(8, 0, 0), Vec3::Zero(), half);
  block.world.run.step += block.window / 2;
  block.watch();
  EXPECT_FALSE(block.asks());
  block.body().kick(block.body().motion.mass() * Vec3(-8, 0, 0), Vec3::Zero(), half);
  block.world.run.step += block.window - block.window / 2;
  block.watch();
  EXPECT_FALSE(block.asks());
}

TEST(EffectiveGravity, a_deck_that_has_changed_gravity_between_runs_is_seen_at_once) {
  for (const bool changed : {false, true}) {
    Block block(7);
    block.watch();
    block.pull(Vec3::Zero());
    if (changed) block.tilt(5);
    block.parts.gravity.begin_run();
    EXPECT_EQ(block.asks(), changed);
    EXPECT_EQ(block.parts.gravity.at_last_look(), block.world.deck.gravity);
  }
}

}  // namespace
}  // namespace solidcull
