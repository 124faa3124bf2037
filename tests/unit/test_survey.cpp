#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>

#include "world_parts.h"

namespace solidcull {
namespace {

constexpr int looks_to_calm = 4;

/// Granules in a row, and looks at them 16 steps apart. Forces are what a test says they are.
struct SurveyedBed {
  explicit SurveyedBed(const Settings& settings = sleeping_settings(), const SmallDeck& deck = SmallDeck())
      : world(deck), parts(world, settings, 2 * r) {
    every = parts.bed.scales.look_every();
    speed = parts.bed.scales.solid_state().speed;
  }
  /// The weight of one granule (N).
  double weight() const { return 9.81 * world.mass_of(r); }
  /// n granules along x, from this place on; neighbours press on each other with so many weights. Returns where the row ends.
  Vec3 row(int first_tag, int n, const Vec3& from, double weights = 5) {
    const Vec3 step(2 * r - weights * weight() / world.deck.stiffness, 0, 0);
    for (int k = 0; k < n; ++k) world.add(first_tag + k, from + k * step, r);
    return from + n * step;
  }
  void begin() {
    world.reneighbour();
    parts.walls.update(world.walls.contacts(), false);
    for (int i = 0; i < world.atoms.owned; ++i) world.atoms.clear_load(i);
  }
  /// Returns how many have been calm for long enough.
  std::int64_t look(const Patience& patience = {false, looks_to_calm, 1}) {
    proposal = Proposal();
    parts.motion.refresh();
    const std::int64_t candidates = parts.survey.find_calm(patience, proposal);
    parts.survey.leave_out_unsteady(patience, proposal);
    parts.survey.choose_asleep(patience, proposal);
    world.run.step += every;
    return candidates;
  }
  std::set<std::int64_t> chosen() const { return std::set<std::int64_t>(proposal.chosen.begin(), proposal.chosen.end()); }
  int calm(int tag) { return parts.survey[world.at(tag)].calm; }
  void set_velocity(int tag, const Vec3& v) { world.atoms.set_velocity(world.at(tag), v); }

  SmallWorld world;
  WorldParts parts;
  Proposal proposal;
  int every;
  double speed;
};

using Tags = std::set<std::int64_t>;

TEST(Survey, a_granule_at_rest_is_chosen_when_it_has_been_calm_for_so_many_looks) {
  SurveyedBed bed;
  bed.row(1, 3, Vec3::Zero());
  bed.begin();
  for (int n = 1; n < looks_to_calm; ++n) {
    EXPECT_EQ(bed.look(), 0) << n;
    EXPECT_TRUE(bed.chosen().empty()) << n;
  }
  EXPECT_EQ(bed.look(), 3);
  EXPECT_EQ(bed.chosen(), (Tags{1, 2, 3}));
}

TEST(Survey, a_granule_that_a_fix_moves_on_a_way_of_its_own_is_not_chosen_before_it_is_released) {
  SurveyedBed bed;
  bed.row(1, 3, Vec3::Zero());
  bed.begin();
  std::vector<double> until(3 * static_cast<std::size_t>(bed.world.atoms.owned), 0.0);  // in the second of three columns
  until[3 * static_cast<std::size_t>(bed.world.at(2)) + 1] = 1000;
  bed.world.atoms.ways = {until.data() + 1, 3, 1000};
  for (int n = 0; n < looks_to_calm; ++n) bed.look();
  EXPECT_EQ(bed.chosen(), (Tags{1, 3}));
  bed.world.atoms.ways.step = 1001;
  for (int n = 0; n < looks_to_calm; ++n) bed.look();
  EXPECT_EQ(bed.chosen(), (Tags{1, 2, 3}));
}

TEST(Survey, motion_against_a_neighbour_starts_the_count_anew) {
  SurveyedBed bed;
  bed.row(1, 4, Vec3::Zero());
  bed.begin();
  bed.look();
  bed.look();
  bed.set_velocity(4, Vec3(0, 1.1 * bed.speed, 0));
  bed.look();
  EXPECT_EQ(bed.calm(4), 0);
  EXPECT_EQ(bed.calm(3), 0);  // its neighbour sees the same
  EXPECT_EQ(bed.calm(2), 3);
  bed.set_velocity(4, Vec3(0, 0.9 * bed.speed, 0));
  bed.look();
  EXPECT_EQ(bed.calm(4), 1);
  EXPECT_EQ(bed.calm(2), 4);
}

TEST(Survey, surfaces_that_slide_are_no_rest_but_wheels_that_roll_on_each_other_are) {
  SurveyedBed slides, rolls;
  for (SurveyedBed* bed : {&slides, &rolls}) {
    bed->row(1, 2, Vec3::Zero());
    bed->begin();
    const Vec3 spin(0, 0, 2 * bed->speed / r);
    bed->world.atoms.set_spin(0, spin);
    bed->world.atoms.set_spin(1, bed == &slides ? spin : Vec3(-spin));
    for (int n = 0; n < looks_to_calm; ++n) bed->look();
  }
  EXPECT_TRUE(slides.chosen().empty());
  EXPECT_EQ(rolls.chosen(), (Tags{1, 2}));
}

TEST(Survey, a_granule_that_touches_nothing_is_no_solid) {
  SurveyedBed bed;
  bed.world.add(1, Vec3::Zero(), r);
  bed.world.add(2, Vec3(2.05 * r, 0, 0), r);  // within the skin, but not touching
  bed.begin();
  for (int n = 0; n < 3 * looks_to_calm; ++n) EXPECT_EQ(bed.look(), 0);
}

TEST(Survey, a_granule_out_of_balance_is_no_solid) {
  SurveyedBed bed;
  bed.row(1, 3, Vec3::Zero());
  bed.begin();
  // a quarter of the wake-up tolerance of three weights
  set(bed.world.atoms.f + 3 * bed.world.at(3), Vec3(0, 0, 0.8 * bed.weight()));
  for (int n = 0; n < looks_to_calm; ++n) bed.look();
  EXPECT_EQ(bed.calm(3), 0);
  EXPECT_EQ(bed.calm(1), looks_to_calm);
}

TEST(Survey, what_something_holds_or_nothing_moves_is_never_chosen) {
  SurveyedBed bed;
  bed.row(1, 4, Vec3::Zero());
  bed.begin();
  bed.world.atoms.groups[bed.world.at(1)] |= SmallAtoms::held_group;
  bed.world.atoms.groups[bed.world.at(4)] = 0;
  for (int n = 0; n < looks_to_calm; ++n) bed.look();
  EXPECT_EQ(bed.chosen(), (Tags{2, 3}));
}

// ------------------------------------------------------------------------------------------------------------ frames

TEST(Survey, a_mass_that_falls_freely_is_solid) {
  SurveyedBed bed;
  bed.row(1, 3, Vec3::Zero());
  bed.begin();
  const Vec3 g = bed.world.deck.gravity;
  Vec3 v(1, 0, 0);
  for (int n = 0; n < looks_to_calm; ++n) {
    for (int i = 0; i < 3; ++i) {
      bed.world.atoms.set_velocity(i, v);
      set(bed.world.atoms.f + 3 * i, bed.world.atoms.mass[i] * g);
    }
    bed.look();
    v += bed.every * bed.world.run.dt * g;
  }
  EXPECT_EQ(bed.chosen(), (Tags{1, 2, 3}));
  EXPECT_GT(v.norm(), 100 * bed.speed);
}

TEST(Survey, a_mass_that_turns_as_one_is_solid) {
  SurveyedBed bed;
  bed.row(1, 5, Vec3::Zero());
  bed.begin();
  const Vec3 spin(0, 0, 2);  // rad/s
  const double angle = spin[2] * bed.every * bed.world.run.dt;
  std::vector<Vec3> x;
  for (int i = 0; i < 5; ++i) x.push_back(bed.world.atoms.place(i));
  for (int n = 0; n < looks_to_calm; ++n) {
    for (int i = 0; i < 5; ++i) {
      const Vec3 at = rotation(Vec3(0, 0, n * angle)) * x[static_cast<std::size_t>(i)];
      bed.world.atoms.set_place(i, at);
      bed.world.atoms.set_velocity(i, spin.cross(at));
      bed.world.atoms.set_spin(i, spin);
      set(bed.world.atoms.f + 3 * i, bed.world.atoms.mass[i] * spin.cross(spin.cross(at)));
    }
    bed.look();
  }
  EXPECT_EQ(bed.chosen(), (Tags{1, 2, 3, 4, 5}));
  EXPECT_GT(bed.world.atoms.velocity(4).norm(), 20 * bed.speed);  // yet each one moves
}

TEST(Survey, a_mass_that_is_struck_as_a_whole_begins_anew) {
  SurveyedBed bed;
  bed.row(1, 3, Vec3::Zero());
  bed.begin();
  bed.look();
  bed.look();
  for (int i = 0; i < 3; ++i) bed.world.atoms.set_velocity(i, Vec3(0, 0, 2 * bed.speed));
  bed.look();
  EXPECT_EQ(bed.calm(2), 1);
}

// ------------------------------------------------------------------------------------------------------------ walls

struct OnGround : SurveyedBed {
  OnGround() : SurveyedBed(sleeping_settings(), deck()) {
    world.add(1, Vec3(0, 0, r - weight() / world.deck.stiffness), r);
    begin();
  }
  static SmallDeck deck() {
    SmallDeck d;
    d.planes = {SmallDeck::ground(0)};
    return d;
  }
};

TEST(Survey, a_granule_alone_on_a_wall_that_stands_still_is_solid_unless_it_slides_there) {
  OnGround rests, slides;
  slides.set_velocity(1, Vec3(1.1 * slides.speed, 0, 0));
  // pressed by its weight alone it must be calm for longer: (3 weights / 1)^(1/2) times
  for (int n = 1; n <= 7; ++n) {
    for (OnGround* bed : {&rests, &slides}) {
      bed->parts.walls.update(bed->world.walls.contacts(), false);
      bed->look();
    }
    EXPECT_EQ(rests.chosen().size(), n == 7 ? 1u : 0u) << n;
    EXPECT_EQ(slides.calm(1), 0);
  }
}

// ------------------------------------------------------------------------------------------------------------ loads

TEST(Survey, who_is_hardly_pressed_must_be_calm_for_longer) {
  SurveyedBed bed;
  bed.row(1, 2, Vec3::Zero(), 5.0);             // 5 weights: confined
  bed.row(3, 2, Vec3(0, 0.05, 0), 3.0 / 1.96);  // (3 / 1.53)^(1/2) = 1.4 times as long: 5.6 looks
  bed.row(5, 2, Vec3(0, 0.1, 0), 0.1);          // twice at most
  bed.begin();
  std::map<std::int64_t, int> first;
  for (int n = 1; n <= 10; ++n) {
    bed.look();
    for (const std::int64_t tag : bed.chosen()) first.emplace(tag, n);
  }
  EXPECT_EQ(first, (std::map<std::int64_t, int>{{1, 4}, {2, 4}, {3, 6}, {4, 6}, {5, 8}, {6, 8}}));
}

TEST(Survey, who_woke_and_stands_where_it_stood_must_be_calm_for_half_as_long) {
  SurveyedBed bed;
  bed.row(1, 2, Vec3::Zero());           // has never been culled
  bed.row(3, 2, Vec3(0, 0.05, 0));       // woke and stands
  bed.row(5, 2, Vec3(0, 0.1, 0));        // woke and has moved since, by 0.4 % of d
  bed.row(7, 2, Vec3(0, 0.15, 0), 0.1);  // woke, stands, and is hardly pressed: twice the half
  bed.begin();
  for (int tag = 3; tag <= 8; ++tag) bed.parts.survey.note_wake(bed.world.at(tag), Woke::load);
  for (const int tag : {5, 6}) {
    const int i = bed.world.at(tag);
    bed.world.atoms.set_place(i, bed.world.atoms.place(i) + Vec3(0, 0, 0.004 * 2 * r));
  }
  std::map<std::int64_t, int> first;
  for (int n = 1; n <= 6; ++n) {
    bed.look();
    for (const std::int64_t tag : bed.chosen()) first.emplace(tag, n);
  }
  EXPECT_EQ(first, (std::map<std::int64_t, int>{{1, 4}, {2, 4}, {3, 2}, {4, 2}, {5, 4}, {6, 4}, {7, 4}, {8, 4}}));
}

TEST(Survey, quick_looks_do_not_ask_what_presses) {
  SurveyedBed bed;
  bed.row(1, 2, Vec3::Zero(), 0.1);
  bed.begin();
  const Patience quick{true, 3, 5};
  bed.look(quick);
  bed.look(quick);
  EXPECT_TRUE(bed.chosen().empty());
  bed.look(quick);
  EXPECT_EQ(bed.chosen(), (Tags{1, 2}));
}

TEST(Survey, a_load_that_changes_from_look_to_look_is_no_solid_state) {
  SurveyedBed bed;
  bed.row(1, 2, Vec3::Zero(), 5.0);
  bed.begin();
  double weights = 5;
  for (int n = 0; n < 3 * looks_to_calm; ++n) {
    weights += 1;  // more than three quarters of a weight
    bed.world.atoms.set_place(1, Vec3(2 * r - weights * bed.weight() / bed.world.deck.stiffness, 0, 0));
    bed.look();
    EXPECT_TRUE(bed.chosen().empty()) << n;
  }
  bed.look();
  EXPECT_EQ(bed.chosen(), (Tags{1, 2}));  // it has been calm all the time
}

TEST(Survey, the_cover_around_what_moves_is_left_out) {
  Settings settings = sleeping_settings();
  settings.depth = 2;  // diameters
  SurveyedBed bed(settings);
  bed.row(1, 8, Vec3::Zero());
  bed.begin();
  for (int n = 0; n < looks_to_calm + 1; ++n) {
    bed.set_velocity(8, Vec3(0, 0, 2 * bed.speed));
    bed.look();
  }
  // 8 moves and 7 feels it; the gap from 7 to 4 is almost two diameters, to 3 almost three
  EXPECT_EQ(bed.chosen(), (Tags{1, 2, 3}));
}

TEST(Survey, where_culling_waits_nobody_is_calm) {
  SurveyedBed bed;
  bed.row(1, 3, Vec3::Zero());
  bed.begin();
  for (int n = 0; n < looks_to_calm - 1; ++n) bed.look();
  bed.parts.survey.forget_calm();
  bed.look();
  EXPECT_TRUE(bed.chosen().empty());
  EXPECT_EQ(bed.calm(2), 1);
}

// ------------------------------------------------------------------------------------------------------------ ties

TEST(Survey, ties_name_each_pair_that_touches_once_and_leave_out_a_granule_alone_among_exterior_ones) {
  SurveyedBed bed;
  bed.row(1, 3, Vec3::Zero());
  bed.row(4, 3, Vec3(0, 0.05, 0));
  bed.world.add(7, Vec3(0, 0.1, 0), r);  // touches nothing: on a wall, say
  bed.begin();
  bed.proposal.chosen = {1, 2, 5, 7};
  bed.proposal.overdue_tags = {1, 5};
  bed.parts.survey.tie(bed.proposal);
  EXPECT_EQ(bed.chosen(), (Tags{1, 2, 7}));  // 4 and 6 stay exterior: 5 alone makes no solid
  EXPECT_EQ(bed.proposal.overdue_tags, (std::vector<std::int64_t>{1}));
  ASSERT_EQ(bed.proposal.touches.size(), 1u);
  EXPECT_EQ(std::min(bed.proposal.touches[0].a, bed.proposal.touches[0].b), 1);
  EXPECT_EQ(std::max(bed.proposal.touches[0].a, bed.proposal.touches[0].b), 2);
}

/// Two bodies of two granules each, which touch without being tied.
struct TwoBodies : SurveyedBed {
  TwoBodies() {
    const double apart = 2 * r - 5 * weight() / world.deck.stiffness;
    world.add(1, Vec3::Zero(), r);
    world.add(2, Vec3(apart, 0, 0), r);
    world.add(3, Vec3(0.05, 0, 0), r);
    world.add(4, Vec3(0.05 + apart, 0, 0), r);
    world.reneighbour();
    world.compute_forces();
    parts.lock({1, 2, 3, 4});
    SolidBody& second = parts.bed.solid.body(parts.body_of(3));
    second.shift(Vec3(2 * apart - 0.05, 0, 0));
    second.take_twist();
    parts.motion.refresh();
    parts.motion.place();
    parts.reneighbour();
    parts.motion.begin_lists();
  }
};

TEST(Survey, two_bodies_that_have_rested_against_each_other_are_joined) {
  TwoBodies bed;
  ASSERT_NE(bed.parts.body_of(1), bed.parts.body_of(3));
  ASSERT_TRUE(bed.world.contacts.listed(2, 3));
  ASSERT_FALSE(bed.world.contacts.listed(1, 2));
  for (int n = 1; n < looks_to_calm; ++n) {
    bed.look();
    EXPECT_TRUE(bed.proposal.joins.empty()) << n;
  }
  bed.look();
  ASSERT_EQ(bed.proposal.joins.size(), 1u);
  EXPECT_EQ(bed.proposal.joins[0].a + bed.proposal.joins[0].b, 2 + 3);
  bed.parts.change({}, bed.proposal);
  EXPECT_EQ(bed.parts.body_of(1), bed.parts.body_of(4));
  EXPECT_EQ(bed.parts.bed.solid.bodies().size(), 1u);
}

/// The same count, where a granule touches two of the other body.
TEST(Survey, contacts_do_not_count_one_by_one_before_bodies_join) {
  SurveyedBed bed;
  const double apart = 2 * r - 5 * bed.weight() / bed.world.deck.stiffness;
  bed.world.add(1, Vec3::Zero(), r);
  bed.world.add(2, Vec3(apart, 0, 0), r);
  bed.world.add(3, Vec3(0.5 * apart, 0.05, 0), r);
  bed.world.add(4, Vec3(1.5 * apart, 0.05, 0), r);
  bed.world.reneighbour();
  bed.world.compute_forces();
  bed.parts.lock({1, 2, 3, 4});
  SolidBody& second = bed.parts.bed.solid.body(bed.parts.body_of(3));
  second.shift(Vec3(0, std::sqrt(0.75) * apart - 0.05, 0));
  second.take_twist();
  bed.parts.motion.refresh();
  bed.parts.motion.place();
  bed.parts.reneighbour();
  ASSERT_NE(bed.parts.body_of(1), bed.parts.body_of(3));
  ASSERT_TRUE(bed.world.contacts.listed(1, 3) && bed.world.contacts.listed(2, 3) && bed.world.contacts.listed(2, 4));
  bed.parts.motion.begin_lists();
  for (int n = 1; n < looks_to_calm; ++n) {
    bed.look();
    EXPECT_TRUE(bed.proposal.joins.empty()) << n;
    EXPECT_EQ(bed.calm(2), n);
    EXPECT_EQ(bed.calm(3), n);
  }
  bed.look();
  EXPECT_EQ(bed.proposal.joins.size(), 3u);
  // who leaves the other body begins anew
  bed.world.atoms.set_place(bed.world.at(3), Vec3(0, 0.5, 0));
  bed.world.atoms.set_place(bed.world.at(4), Vec3(0, 0.52, 0));
  bed.look();
  EXPECT_EQ(bed.calm(2), 0);
}

TEST(Survey, two_bodies_that_slide_on_each_other_are_not) {
  TwoBodies bed;
  for (int n = 0; n < 2 * looks_to_calm; ++n) {
    for (const int tag : {3, 4}) bed.set_velocity(tag, Vec3(0, 1.1 * bed.speed, 0));
    bed.look();
    EXPECT_TRUE(bed.proposal.joins.empty()) << n;
  }
}

TEST(Survey, exterior_granules_are_counted_with_their_energy) {
  TwoBodies bed;
  const int i = bed.world.add(5, Vec3(0, 0.05, 0), r, Vec3(3, 0, 0));
  EXPECT_EQ(bed.parts.survey.exterior_here(), 1);
  EXPECT_DOUBLE_EQ(bed.parts.survey.kinetic_energy_of_exterior(), 4.5 * bed.world.atoms.mass[i]);
}

// ------------------------------------------------------------------------------------------------------------- what is awake

/// How many each reason keeps awake, as the last look saw it.
AwakeSteps awake(SurveyedBed& bed, int looks = looks_to_calm) {
  return bed.parts.survey.see_awake({false, looks, 1}, bed.proposal);
}

TEST(Awake, each_exterior_granule_has_one_reason) {
  SurveyedBed bed;
  const Vec3 end = bed.row(1, 3, Vec3::Zero());
  bed.row(4, 1, end + Vec3(0.1, 0, 0));
  bed.row(5, 2, Vec3(0, 0.1, 0));
  bed.row(7, 2, Vec3(0, 0.2, 0));
  bed.begin();
  bed.set_velocity(5, Vec3(0, 3 * bed.speed, 0));
  bed.set_velocity(7, Vec3(0, 1.5 * bed.speed, 0));
  bed.look();
  const AwakeSteps now = awake(bed);
  EXPECT_EQ(now[Awake::settling], 3);
  EXPECT_EQ(now[Awake::alone], 1);
  EXPECT_EQ(now[Awake::moving], 4);
  EXPECT_EQ(now.all(), 8);
  EXPECT_EQ(now.nearly_slow, 2) << "7 and 8 would be calm with twice the speed";
  EXPECT_EQ(now.in_vain, 0);
}

TEST(Awake, what_the_deck_holds_is_held_and_what_is_not_looked_at_waits) {
  SurveyedBed bed;
  bed.row(1, 3, Vec3::Zero());
  bed.begin();
  bed.world.atoms.groups[bed.world.at(2)] = 0;
  bed.look();
  EXPECT_EQ(awake(bed)[Awake::held], 1);
  EXPECT_EQ(awake(bed)[Awake::settling], 2);
  bed.parts.survey.forget_calm();
  EXPECT_EQ(awake(bed)[Awake::paused], 3);
  EXPECT_EQ(awake(bed).all(), 3);
}

TEST(Awake, out_of_balance_by_less_than_twice_the_limit) {
  SurveyedBed bed;
  bed.row(1, 2, Vec3::Zero());
  bed.row(3, 2, Vec3(0, 0.1, 0));
  bed.begin();
  const double limit = bed.parts.bed.scales.solid_state().force * bed.weight();
  bed.world.atoms.f[3 * bed.world.at(1)] = 1.5 * limit;
  bed.world.atoms.f[3 * bed.world.at(3)] = 3 * limit;
  bed.look();
  EXPECT_EQ(awake(bed)[Awake::unsteady], 4);
  EXPECT_EQ(awake(bed).nearly_balanced, 2);
}

TEST(Awake, in_solid_state_but_covered) {
  Settings settings = sleeping_settings();
  settings.depth = 1.5;
  SurveyedBed bed(settings);
  bed.row(1, 6, Vec3::Zero());
  bed.begin();
  for (int n = 0; n < looks_to_calm; ++n) {
    bed.set_velocity(1, Vec3(0, 3 * bed.speed, 0));
    bed.look();
  }
  const AwakeSteps now = awake(bed);
  EXPECT_EQ(now[Awake::moving], 2) << "1, and 2 against it";
  EXPECT_GE(now[Awake::covered], 1);
  EXPECT_EQ(now[Awake::covered] + now[Awake::settling], 4);
  EXPECT_EQ(now[Awake::settling], static_cast<double>(bed.chosen().size()));
}

TEST(Awake, woken_and_still_there_is_awake_in_vain) {
  SurveyedBed bed;
  bed.row(1, 3, Vec3::Zero());
  bed.begin();
  bed.parts.survey.note_wake(bed.world.at(1), Woke::load);
  bed.parts.survey.note_wake(bed.world.at(2), Woke::load);
  bed.parts.survey.rows()[bed.world.at(2)].woke_at += Vec3(0, 0, 0.02 * 2 * r);
  bed.look();
  EXPECT_EQ(awake(bed).in_vain, 1);
}

TEST(Awake, a_granule_knows_its_reasons_and_takes_them_along) {
  SurveyedBed bed;
  bed.row(1, 3, Vec3::Zero());
  bed.row(4, 1, Vec3(0, 0.1, 0));
  bed.begin();
  const auto of = [&](int tag) { return bed.parts.survey[bed.world.at(tag)]; };
  EXPECT_EQ(of(4).awake, Awake::count) << "no look has seen it";
  bed.look();
  awake(bed);
  EXPECT_EQ(of(4).awake, Awake::alone);
  EXPECT_EQ(of(1).awake, Awake::settling);
  EXPECT_EQ(of(1).woke_by, Woke::never);
  bed.parts.survey.note_wake(bed.world.at(1), Woke::exposed);
  EXPECT_EQ(of(1).awake, Awake::count) << "no look has seen it since";
  EXPECT_EQ(of(1).woke_by, Woke::exposed);
  bed.look();
  awake(bed);
  for (const int tag : {1, 2, 4}) {
    double packed[AtRest::packed_size];
    of(tag).pack(packed);
    const AtRest there = AtRest::unpack(packed);
    EXPECT_EQ(there.awake, of(tag).awake) << tag;
    EXPECT_EQ(there.woke_by, of(tag).woke_by) << tag;
  }
  for (int why = 0; why <= static_cast<int>(Awake::count); ++why)
    for (int by = 0; by < static_cast<int>(Woke::count); ++by) {
      AtRest a;
      a.awake = static_cast<Awake>(why);
      a.woke_by = static_cast<Woke>(by);
      double packed[AtRest::packed_size];
      a.pack(packed);
      const AtRest b = AtRest::unpack(packed);
      EXPECT_TRUE(b.awake == a.awake && b.woke_by == a.woke_by) << why << " " << by;
    }
}

}  // namespace
}  // namespace solidcull
