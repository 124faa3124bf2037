#include <gtest/gtest.h>

#include <map>

#include "world_parts.h"

namespace solidcull {
namespace {

/// Granules side by side on a floor or ground, each in balance, tied together as one body.
struct Resting {
  explicit Resting(const SmallDeck& deck, int granules = 3) : world(deck), parts(world, sleeping_settings(), 2 * r) {
    weight = 9.81 * world.mass_of(r);
    for (int n = 0; n < granules; ++n) add(n + 1, (n - 0.5 * (granules - 1)) * 2 * r);
    world.reneighbour();
    parts.walls.update(world.walls.contacts(), false);
    world.compute_forces();
  }
  void add(int tag, double x) { world.add(tag, Vec3(x, 0.004, r - weight / world.deck.stiffness), r); }
  void lock(const std::vector<std::int64_t>& tags) {
    Proposal p;
    for (std::size_t k = 0; k + 1 < tags.size(); ++k) p.touches.push_back({tags[k], tags[k + 1]});
    p.chosen = tags;
    for (const std::int64_t tag : tags)
      parts.survey.rows()[world.at(static_cast<int>(tag))].velocity = world.atoms.velocity(world.at(static_cast<int>(tag)));
    parts.change({}, p);
    parts.reneighbour();
    parts.compute_forces();
  }
  /// A step in which something else presses on these granules.
  void step(const std::map<int, Vec3>& also = {}) {
    world.compute_forces();
    for (const auto& [tag, force] : also) {
      const int i = world.at(tag);
      set(world.atoms.f + 3 * i, world.atoms.force(i) + force);
    }
    parts.motion.refresh();
    parts.motion.take_loads();
    parts.grounding.press_on_walls();
  }
  void steps(int n, const std::map<int, Vec3>& also = {}) {
    for (; n > 0; --n) step(also);
  }
  void look() {
    parts.walls.update(world.walls.contacts(), false);
    parts.motion.refresh();
    parts.grounding.update();
    parts.bed.groups.settle();
    parts.motion.refresh_in_step();
    parts.grounding.share_out_loads();
  }
  void ground() {
    step();
    look();
    look();
    step();
  }
  const SolidBody& body(int tag = 1) { return parts.bed.solid.bodies().body(parts.body_of(tag)); }

  SmallWorld world;
  WorldParts parts;
  double weight;
};

SmallDeck on_ground(bool moving = false) {
  SmallDeck deck;
  deck.planes = {SmallDeck::ground(0)};
  deck.planes[0].moving = moving;
  return deck;
}
SmallDeck on_floor() {
  SmallDeck deck;
  deck.meshes = {SmallDeck::floor(0, 0.2)};
  return deck;
}

TEST(Grounding, a_body_is_grounded_after_two_looks_at_rest_at_a_wall_that_stands_still) {
  Resting bed(on_ground());
  bed.lock({1, 2, 3});
  ASSERT_EQ(bed.parts.bed.solid.bodies().size(), 1u);
  bed.step();
  bed.look();
  EXPECT_FALSE(bed.body().grounded);
  bed.look();
  EXPECT_TRUE(bed.body().grounded);
  EXPECT_TRUE(bed.parts.bed.solid.stands(bed.parts.body_of(1)));
}

TEST(Grounding, not_at_a_wall_that_can_move) {
  Resting bed(on_ground(true));
  bed.lock({1, 2, 3});
  bed.step();
  for (int n = 0; n < 5; ++n) bed.look();
  EXPECT_FALSE(bed.body().grounded);
}

TEST(Grounding, not_while_it_moves_or_is_out_of_balance) {
  Resting moves(on_ground()), pressed(on_ground());
  for (int i = 0; i < 3; ++i)
    moves.world.atoms.set_velocity(i, Vec3(0.01 * moves.parts.bed.scales.solid_state().speed * 6, 0, 0));
  moves.lock({1, 2, 3});  // 6 % of the solid-state speed: above the 5 % that is drift
  pressed.lock({1, 2, 3});
  moves.step();
  pressed.step({{2, Vec3(0, 0, -0.01 * pressed.weight)}});
  for (int n = 0; n < 5; ++n) {
    moves.look();
    pressed.look();
  }
  EXPECT_FALSE(moves.body().grounded);
  EXPECT_FALSE(pressed.body().grounded);
  pressed.step();
  pressed.look();
  pressed.look();
  EXPECT_TRUE(pressed.body().grounded);
}

TEST(Grounding, one_granule_that_spins_on_the_spot_may_go_on_and_its_frame_is_the_worlds) {
  Resting bed(on_ground(), 1);
  bed.world.atoms.set_spin(0, Vec3(0, 0, 20));  // about the normal: it does not slide
  bed.parts.walls.update(bed.world.walls.contacts(), false);
  bed.lock({1});
  SolidBody& body = bed.parts.bed.solid.body(bed.parts.body_of(1));
  body.drift(bed.world.run.dt);  // it has turned since
  ASSERT_NE(body.pose, Pose());
  bed.ground();
  EXPECT_TRUE(bed.body().grounded);
  EXPECT_EQ(bed.body().pose, Pose());
  EXPECT_LT((bed.parts.bed.shell[0].place - bed.world.atoms.place(0)).norm(), 1e-12);
  EXPECT_NEAR(bed.body().twist.spin[2], 20, 1e-9);
}

TEST(Grounding, what_has_moved_by_the_last_digits_only_stands_in_the_worlds_frame) {
  const auto pose_after = [](double angle, double way) {
    Resting bed(on_ground());
    bed.lock({1, 2, 3});
    SolidBody& body = bed.parts.bed.solid.body(bed.parts.body_of(1));
    const Eigen::Quaterniond turn(1, 0, 0.5 * angle, 0);
    body.pose = Pose(Vec3(way, 0, 0), turn);
    body.ground(true);
    return body.pose;
  };
  EXPECT_EQ(pose_after(1e-16, 1e-18), Pose());
  EXPECT_NE(pose_after(1e-12, 0), Pose());
  EXPECT_NE(pose_after(0, 1e-12), Pose());
}

TEST(Grounding, a_body_is_let_go_when_its_walls_would_have_to_pull) {
  Resting bed(on_ground());
  bed.lock({1, 2, 3});
  bed.ground();
  // half of the whole weight upwards is borne; the mean is taken over a look's steps
  bed.steps(200, {{2, Vec3(0, 0, 0.45 * 3 * bed.weight)}});
  bed.look();
  EXPECT_FALSE(bed.parts.grounding.lets_go());
  bed.steps(200, {{2, Vec3(0, 0, 0.55 * 3 * bed.weight)}});
  bed.look();
  ASSERT_TRUE(bed.parts.grounding.lets_go());
  EXPECT_TRUE(bed.body().grounded);  // not before its granules at walls can come back
  bed.parts.grounding.let_go();
  EXPECT_FALSE(bed.body().grounded);
  EXPECT_FALSE(bed.parts.grounding.lets_go());
}

TEST(Grounding, a_body_is_let_go_for_a_lateral_load_beyond_its_share_of_what_presses_it_down) {
  Resting bed(on_ground());
  bed.lock({1, 2, 3});
  bed.ground();
  bed.steps(200, {{2, Vec3(0.09 * 3 * bed.weight, 0, 0)}});
  bed.look();
  EXPECT_FALSE(bed.parts.grounding.lets_go());
  // pressed down by its weight once more it holds twice as much
  bed.steps(200, {{2, Vec3(0.19 * 3 * bed.weight, 0, -3 * bed.weight)}});
  bed.look();
  EXPECT_FALSE(bed.parts.grounding.lets_go());
  bed.steps(200, {{2, Vec3(0.11 * 3 * bed.weight, 0, 0)}});
  bed.look();
  EXPECT_TRUE(bed.parts.grounding.lets_go());
}

TEST(Grounding, a_blow_of_one_step_lets_nothing_go) {
  Resting bed(on_ground());
  bed.lock({1, 2, 3});
  bed.ground();
  bed.step({{2, Vec3(3 * bed.weight, 0, 0)}});  // ten times the share, for one of sixteen steps
  bed.look();
  EXPECT_FALSE(bed.parts.grounding.lets_go());
}

TEST(Grounding, the_mean_load_follows_when_bodies_merge) {
  Resting bed(on_ground(), 2);
  bed.add(11, 0.1);
  bed.add(12, 0.11);
  bed.add(13, 0.12);
  bed.world.reneighbour();
  bed.parts.walls.update(bed.world.walls.contacts(), false);
  bed.lock({1, 2});
  bed.lock({11, 12, 13});
  bed.ground();
  ASSERT_TRUE(bed.body(1).grounded && bed.body(11).grounded);
  bed.steps(200, {{1, Vec3(0.8 * bed.weight, 0, 0)}});  // of five granules more than a tenth
  bed.parts.bed.solid.tie(2, 11, bed.parts.bed.masses.by_tag());
  bed.parts.bed.adopt_places();
  ASSERT_EQ(bed.parts.body_of(1), bed.parts.body_of(13));
  bed.parts.motion.begin_lists();
  bed.look();
  EXPECT_TRUE(bed.parts.grounding.lets_go());
}

// ------------------------------------------------------------------------------------------------------------ what walls feel

TEST(Grounding, loads_on_a_granule_are_those_of_meshes_and_the_rest_is_the_other_walls) {
  SmallDeck deck = on_floor();
  deck.planes = {{"side", Vec3(-0.0149, 0, 0), Vec3(1, 0, 0)}};  // the first of three is pressed against it by 0.1 mm
  Resting bed(deck);
  bed.lock({1, 2, 3});
  const int i = bed.world.at(1);
  const std::vector<WallLoad> loads = bed.parts.grounding.wall_loads_on(i);
  ASSERT_EQ(loads.size(), 2u);
  EXPECT_EQ(loads[0].mesh, 0);
  EXPECT_NEAR(loads[0].force[2], bed.weight, 1e-9);
  EXPECT_EQ(loads[1].mesh, WallLoad::no_mesh);
  EXPECT_EQ(loads[1].element, 1);  // pushed along x
  EXPECT_NEAR(loads[1].force[0], bed.world.deck.stiffness * 1e-4, 1e-9);
  EXPECT_NEAR(loads[1].force[2], 0, 1e-9);
}

/// The outer two of three on the floor are stored; the middle one is an interface granule.
struct HalfStored : Resting {
  HalfStored() : Resting(on_floor()) {
    lock({1, 2, 3});
    ground();
    parts.put_away({1, 3});
    parts.reneighbour();
    step();
  }
  Vec3 pressed() const {
    Vec3 sum = Vec3::Zero();
    for (const auto& b : world.walls.borne) sum += b.second.pressed;
    return sum;
  }
};

TEST(Grounding, elements_go_on_feeling_what_stored_granules_press) {
  HalfStored bed;
  EXPECT_EQ(bed.world.atoms.owned, 1);
  EXPECT_LT((bed.pressed() - Vec3(0, 0, -2 * bed.weight)).norm(), 1e-9 * bed.weight);
  EXPECT_LT((bed.world.walls.borne_by_meshes() - Vec3(0, 0, -3 * bed.weight)).norm(), 1e-9 * bed.weight);
}

TEST(Grounding, what_presses_on_a_body_that_stands_is_shared_out_to_the_elements_that_bear_it) {
  HalfStored bed;
  const Vec3 load(0, 0, -0.7 * bed.weight);
  bed.steps(200, {{2, load}});
  bed.look();
  bed.step({{2, load}});
  // to the last newton, whatever it is shared out to
  EXPECT_LT((bed.pressed() - Vec3(0, 0, -2 * bed.weight) - load).norm(), 1e-9 * bed.weight);
  // two alike: on the triangle of each stored granule half of it
  const double each = bed.parts.bed.solid.wall_loads().of_all().size() == 1 ? 1.0 : 0.5;
  for (const auto& b : bed.world.walls.borne) {
    if (b.second.pressed.isZero(0)) continue;
    EXPECT_NEAR(b.second.pressed[2] / (-2 * bed.weight + load[2]), each, 1e-9);
  }
  // the first moment of what the elements bear: loads act where their granules stand
  Vec3 torque = Vec3::Zero();
  for (const auto& b : bed.world.walls.borne) torque += b.second.torque;
  const Vec3 all = bed.world.walls.borne_by_meshes();
  EXPECT_LT((torque - Vec3(0, 0.004, 0).cross(all)).norm(), 1e-6 * 0.004 * all.norm());
}

// ------------------------------------------------------------------------------------------------------------ wall survey

TEST(WallSurvey, knows_what_a_granule_touches_and_how_it_slides_there) {
  SmallDeck deck = on_ground();
  deck.planes.push_back({"piston", Vec3(0.0054, 0, 0), Vec3(-1, 0, 0), true});  // within the skin of the granule, not touching
  Resting bed(deck, 1);
  bed.world.atoms.set_velocity(0, Vec3(0.1, 0, 0));
  bed.world.atoms.set_spin(0, Vec3(0, 0.05 / r, 0));  // rolls at half that speed
  bed.parts.walls.update(bed.world.walls.contacts(), false);
  const AtWall& w = bed.parts.walls[0];
  EXPECT_EQ(w.touched, 1);
  EXPECT_TRUE(w.stands);
  EXPECT_FALSE(w.moves);
  EXPECT_TRUE(w.near);
  EXPECT_TRUE(w.moving_near);
  EXPECT_NEAR(w.slip, 0.05, 1e-3);
  double numbers[AtWall::packed_size];
  w.pack(numbers);
  const AtWall back = AtWall::unpack(numbers);
  EXPECT_EQ(back.touched, 1);
  EXPECT_TRUE(back.stands && back.near && back.moving_near && !back.moves);
}

TEST(WallSurvey, interface_granules_wake_whose_wall_has_gone) {
  for (const bool moving : {false, true})
    for (const bool new_run : {false, true}) {
      Resting bed(on_ground(moving));
      bed.lock({1, 2, 3});
      bed.world.deck.planes.clear();
      bed.parts.walls.update(bed.world.walls.contacts(), new_run);
      // within a run only a wall that can move may leave; between runs a deck may take any away
      EXPECT_EQ(bed.parts.bed.wake.any_here(), moving || new_run) << moving << new_run;
    }
}

TEST(WallSurvey, a_wall_that_stays_wakes_nobody) {
  Resting bed(on_ground(true));
  bed.lock({1, 2, 3});
  bed.parts.walls.update(bed.world.walls.contacts(), true);
  bed.parts.walls.update(bed.world.walls.contacts(), false);
  EXPECT_FALSE(bed.parts.bed.wake.any_here());
  EXPECT_FALSE(bed.parts.walls.take_gone());  // the first time: nothing to compare with
  bed.world.deck.planes.push_back(SmallDeck::ground(-1, "another"));
  EXPECT_FALSE(bed.parts.walls.take_gone());
  bed.world.deck.planes.erase(bed.world.deck.planes.begin());
  EXPECT_TRUE(bed.parts.walls.take_gone());
}

}  // namespace
}  // namespace solidcull
