#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <random>
#include <set>

#include "solid_bodies.h"

namespace solidcull {
namespace {

using Tags = std::set<std::int64_t>;

/// Granules, their contacts and their bodies, changed together in the order in which the fix does it.
struct Solid {
  SolidBodies bodies;
  FrozenContacts contacts;
  std::map<std::int64_t, MovingGranule> granules;     // world frame; of the locked ones: as they were when they were locked
  std::map<std::int64_t, SolidBodies::Place> places;  // of the locked ones
  std::set<int> parents;                              // bodies that lost a part in the last unlock()

  Solid() { contacts.set_layout({}); }
  /// In the frame of its present body, even while its place is still that in a body that was swallowed.
  GranuleMass mass(std::int64_t tag) const {
    const MovingGranule& g = granules.at(tag);
    const auto at = places.find(tag);
    if (at == places.end()) return {g.mass, g.position, g.radius, g.held};
    const int body = bodies.body_of(tag);
    const Vec3& p = at->second.position;
    if (body == at->second.body) return {g.mass, p, g.radius, g.held};
    return {g.mass, bodies.pose(body).to_frame(bodies.pose(at->second.body).to_world(p)), g.radius, g.held};
  }
  SolidBodies::MassOf mass_of() const {
    return [this](std::int64_t tag) { return mass(tag); };
  }
  /// Where it is and how it moves now, free or locked.
  MovingGranule now(std::int64_t tag) const {
    MovingGranule g = granules.at(tag);
    if (!places.count(tag)) return g;
    const SolidBody& b = bodies.body(bodies.body_of(tag));
    g.position = b.pose.to_world(mass(tag).position);
    g.velocity = b.twist.at(g.position);
    g.spin = b.twist.spin;
    return g;
  }
  void touch(std::int64_t a, std::int64_t b) { contacts.add(a, b, nullptr); }
  void lock(std::int64_t tag) { places[tag] = bodies.lock(tag, granules.at(tag), contacts, mass_of()); }
  /// Two locked granules are in contact now.
  void join(std::int64_t a, std::int64_t b) {
    touch(a, b);
    bodies.join(a, b, mass_of());
  }
  /// The granules of swallowed bodies move to the frames that they are in now.
  void adopt() {
    for (auto& p : places) {
      const Vec3 position = mass(p.first).position;
      p.second = {bodies.body_of(p.first), position};
    }
    bodies.forget_swallowed();
  }
  /// Gives the numbers of the bodies that came off. `given`: those go on with the motion that stands there.
  std::vector<int> unlock(const Tags& tags, const std::map<std::int64_t, MovingGranule>& given = {}) {
    adopt();
    for (const std::int64_t tag : tags) {
      const auto g = given.find(tag);
      MovingGranule free = g == given.end() ? now(tag) : g->second;
      bodies.unlock(tag, mass(tag), contacts, g == given.end() ? nullptr : &g->second);
      granules[tag] = free;
      places.erase(tag);
    }
    for (const std::int64_t tag : tags) contacts.erase(tag);
    std::set<int> born;
    bodies.split(contacts, mass_of(), [&](std::int64_t tag, int body, const Vec3& place) {
      EXPECT_EQ(bodies.body_of(tag), body);
      places.at(tag) = {body, place};
      born.insert(body);
    });
    parents = {bodies.split_parents().begin(), bodies.split_parents().end()};
    EXPECT_EQ(bodies.split_parents().size(), born.size());
    return {born.begin(), born.end()};
  }
  /// All bodies fly freely for n steps, as the fix moves them.
  void fly(int n, double dt) {
    adopt();
    for (auto& [number, body] : bodies.bodies()) {
      if (body.changed) {
        const RigidPart part = body.part();
        body.motion = RigidMotion(&part, 1, body.free_axes());
        body.changed = false;
      }
      for (int k = 0; k < n; ++k) body.pose.advance(body.motion.drift(dt));
      body.twist = body.motion.twist();
    }
  }
  /// The bodies as sets of their granules, by number.
  std::map<int, Tags> members() const {
    std::map<int, Tags> members;
    bodies.for_each_member([&](std::int64_t tag, int body) { members[body].insert(tag); });
    return members;
  }
  std::set<Tags> partition() const {
    std::set<Tags> parts;
    for (const auto& m : members()) parts.insert(m.second);
    return parts;
  }
  std::set<Tags> connected_components() const {
    std::set<Tags> parts;
    Tags left;
    bodies.for_each_member([&](std::int64_t tag, int) { left.insert(tag); });
    while (!left.empty()) {
      Tags part;
      std::vector<std::int64_t> reached{*left.begin()};
      while (!reached.empty()) {
        const std::int64_t tag = reached.back();
        reached.pop_back();
        if (!left.erase(tag)) continue;
        part.insert(tag);
        contacts.for_each_partner(tag, [&](std::int64_t partner) { reached.push_back(partner); });
      }
      parts.insert(part);
    }
    return parts;
  }
};

MovingGranule granule(double mass, const Vec3& position, double radius, const Vec3& velocity = Vec3::Zero(),
                      const Vec3& spin = Vec3::Zero()) {
  return {mass, radius, position, velocity, spin, false};
}

/// n granules of 1 mm side by side, tags from 1; `ring`: the last touches the first.
Solid chain(int n, bool ring = false) {
  Solid solid;
  for (int k = 1; k <= n; ++k) solid.granules[k] = granule(1e-6, Vec3(1e-3 * k, 0, 0), 5e-4);
  for (int k = 1; k < n; ++k) solid.touch(k, k + 1);
  if (ring) solid.touch(n, 1);
  for (int k = 1; k <= n; ++k) solid.lock(k);
  return solid;
}

Tags from_to(std::int64_t first, std::int64_t last) {
  Tags tags;
  for (std::int64_t tag = first; tag <= last; ++tag) tags.insert(tag);
  return tags;
}

MassProperties sum_of(const Solid& solid, const Tags& tags) {
  MassProperties p;
  for (const std::int64_t tag : tags) {
    const GranuleMass g = solid.mass(tag);
    p.add({g.mass, g.position, g.radius, g.held}, g.radius);
  }
  return p;
}

/// Inertia about the world's origin, from that about the centre of mass.
Eigen::Matrix3d about_origin(const MassProperties& p) {
  const Vec3 c = p.centre();
  return p.inertia() + p.mass * (c.squaredNorm() * Eigen::Matrix3d::Identity() - c * c.transpose());
}

/// Sum of m x, whatever point the sums are about.
Vec3 first_moment(const MassProperties& p) { return p.first + p.mass * p.about; }

/// Sum of m x x^T, likewise.
Eigen::Matrix3d second_moment(const MassProperties& p) {
  return p.second + p.first * p.about.transpose() + p.about * p.first.transpose() + p.mass * p.about * p.about.transpose();
}

void expect_same(const MassProperties& is, const MassProperties& due, double relative, const MassProperties& scale) {
  EXPECT_EQ(is.count, due.count);
  EXPECT_EQ(is.held, due.held);
  EXPECT_NEAR(is.mass, due.mass, relative * scale.mass);
  EXPECT_LE((first_moment(is) - first_moment(due)).norm(), relative * first_moment(scale).norm());
  EXPECT_LE((second_moment(is) - second_moment(due)).norm(), relative * second_moment(scale).norm());
  EXPECT_NEAR(is.spin, due.spin, relative * scale.spin);
}

/// Every body's figures are those of its granules, to the rounding of the whole.
void expect_right_figures(const Solid& solid) {
  MassProperties whole;  // in the world
  for (const auto& g : solid.granules) whole.add({g.second.mass, g.second.position, g.second.radius}, g.second.radius);
  const std::map<int, Tags> members = solid.members();
  ASSERT_EQ(members.size(), solid.bodies.size());
  for (const auto& m : members) {
    ASSERT_EQ(solid.bodies.bodies().count(m.first), 1u);
    expect_same(solid.bodies.body(m.first).mass, sum_of(solid, m.second), 1e-12, whole);
    for (const std::int64_t tag : m.second) ASSERT_EQ(solid.bodies.body_of(tag), m.first);
  }
}

// ------------------------------------------------------------------------------------------------------- mass properties

TEST(MassProperties, of_one_granule_are_those_of_a_homogeneous_sphere) {
  MassProperties p;
  p.add({2.0, Vec3(0.5, -1, 2), 0.3}, 0.3);
  EXPECT_EQ(p.count, 1);
  EXPECT_EQ(p.centre(), Vec3(0.5, -1, 2));
  EXPECT_LE((p.inertia() - 0.4 * 2.0 * 0.09 * Eigen::Matrix3d::Identity()).norm(), 1e-14);
}

TEST(MassProperties, of_a_dumbbell_follow_the_parallel_axis_theorem) {
  MassProperties p;
  p.add({1.0, Vec3(-1, 0, 0), 0.5}, 0.5);
  p.add({3.0, Vec3(1, 0, 0), 0.5}, 0.5);
  EXPECT_DOUBLE_EQ(p.centre()[0], 0.5);
  const double own = 0.4 * 4.0 * 0.25, across = own + 1.0 * 1.5 * 1.5 + 3.0 * 0.5 * 0.5;
  EXPECT_LE((p.inertia() - Eigen::Matrix3d(Vec3(own, across, across).asDiagonal())).norm(), 1e-14);
}

TEST(MassProperties, come_back_when_granules_go) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> at(-0.1, 0.1);
  const auto place = [&] {
    const double x = at(random), y = at(random), z = at(random);
    return Vec3(x, y, z);
  };
  MassProperties p, due;
  for (int n = 0; n < 1000; ++n) {
    const Vec3 x = place();
    p.add({1e-5, x, 1e-3}, 1e-3);
    due.add({1e-5, x, 1e-3}, 1e-3);
  }
  const MassProperties scale = [&] {
    MassProperties s = due;
    s.first = Vec3::Constant(0.1 * s.mass) - s.mass * s.about;
    s.second += second_moment(due) - second_moment(s);
    return s;
  }();
  for (int n = 0; n < 100000; ++n) {
    const Vec3 x = place();
    p.add({1e-5, x, 1e-3}, 1e-3);
    p.add({1e-5, x, 1e-3}, 1e-3, -1);
  }
  expect_same(p, due, 1e-12, scale);
}

TEST(MassProperties, of_the_parts_sum_to_the_whole) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> at(0, 0.1), radius(1e-3, 2e-3);
  MassProperties whole, parts[3], sum;
  for (int n = 0; n < 3000; ++n) {
    const double x = at(random), y = at(random), z = at(random), r = radius(random), m = 1e4 * r * r * r;
    whole.add({m, Vec3(x, y, z), r}, r);
    parts[n % 3].add({m, Vec3(x, y, z), r}, r);
  }
  for (const MassProperties& p : parts) sum.add(p);
  expect_same(sum, whole, 1e-12, whole);
  EXPECT_LE((sum.inertia() - whole.inertia()).norm(), 1e-12 * whole.inertia().norm());
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
  for (const MassProperties& p : parts) inertia += about_origin(p);
  EXPECT_LE((inertia - about_origin(whole)).norm(), 1e-12 * inertia.norm());
}

// ------------------------------------------------------------------------------------------------------------ lock and merge

TEST(SolidBodies, asking_for_a_body_that_is_gone_founds_none) {
  Solid s;
  s.granules[1] = s.granules[2] = {1, 0.1, Vec3::Zero(), Vec3::Zero(), Vec3::Zero()};
  s.lock(1);
  s.unlock({1});
  ASSERT_EQ(s.bodies.size(), 0u);
  s.bodies.set_elsewhere([](std::int64_t tag) { return tag == 9 ? 1 : 0; });  // says so still
  s.touch(2, 9);
  s.granules[9] = s.granules[2];
  s.places[9] = {1, Vec3::Zero()};
  EXPECT_THROW(s.lock(2), std::exception);
  EXPECT_THROW(s.bodies.body(1), std::exception);
  EXPECT_THROW(s.bodies.join(9, 9, s.mass_of()), std::exception);
  EXPECT_EQ(s.bodies.size(), 0u);
}

TEST(SolidBodies, where_contacts_turn_no_granule_bodies_are_made_of_points) {
  Solid s;
  s.bodies.set_granules_turn(false);
  const double m = 2, r = 0.1;
  const Vec3 spin(0, 0, 7);
  s.granules[1] = {m, r, Vec3(0, 0, 0), Vec3(0, -1, 0), spin};
  s.granules[2] = {m, r, Vec3(2 * r, 0, 0), Vec3(0, 1, 0), -3 * spin};
  s.lock(1);
  EXPECT_TRUE(s.bodies.body(s.bodies.body_of(1)).twist.spin.isZero(0) || s.bodies.body(s.bodies.body_of(1)).mass.spin == 0);
  s.touch(1, 2);
  s.lock(2);
  SolidBody& pair = s.bodies.body(s.bodies.body_of(1));
  pair.settle();
  // two points at 0.2 m, each at 1 m/s across: 10 rad/s, whatever spins the balls have; the points are balls of r / 1000
  EXPECT_LT((pair.motion.spin() - Vec3(0, 0, 10)).norm(), 1e-5);
  EXPECT_LT((pair.motion.angular_momentum() - Vec3(0, 0, 2 * m * r)).norm(), 1e-12);
  EXPECT_LT((pair.twist.at(Vec3(2 * r, 0, 0)) - Vec3(0, 1, 0)).norm(), 1e-6);
  for (int step = 0; step < 100; ++step) pair.drift(1e-3);
  EXPECT_TRUE(pair.motion.spin().allFinite());
  EXPECT_LT((pair.motion.spin() - Vec3(0, 0, 10)).norm(), 1e-5);
}

TEST(SolidBodies, a_line_of_points_that_closes_through_a_periodic_side_does_not_spin_by_what_rounding_leaves) {
  Solid s;
  s.bodies.set_granules_turn(false);
  s.bodies.set_periods(Vec3(0, 3, 0));
  const double m = 2, r = 0.05;
  for (int tag = 1; tag <= 30; ++tag) {
    s.granules[tag] = {m, r, Vec3(0.3, 0.1 * tag - 0.07, 0.7), Vec3(0.01, -0.02, 0.03), Vec3::Zero()};
    if (tag > 1) s.touch(tag - 1, tag);
    if (tag == 30) s.touch(30, 1);
    s.lock(tag);
  }
  SolidBody& line = s.bodies.body(s.bodies.body_of(1));
  line.settle();
  EXPECT_FALSE(line.free_axes()[0] && line.free_axes()[1] && line.free_axes()[2]);
  line.motion.kick(Vec3(0, 0, -30 * m * 9.81), Vec3::Constant(1e-15), 1e-3);  // what rounding leaves of a torque
  EXPECT_LT(line.motion.spin().norm(), 1e-6);
}

TEST(SolidBodies, a_lone_granule_founds_a_body) {
  Solid solid;
  solid.granules[7] = granule(1.0, Vec3::Zero(), 0.1);
  solid.granules[8] = granule(1.0, Vec3::Ones(), 0.1);
  solid.lock(7);
  solid.lock(8);
  EXPECT_EQ(solid.bodies.body_of(7), 1);
  EXPECT_EQ(solid.bodies.body_of(8), 2);
  EXPECT_EQ(solid.bodies.body_of(9), 0);
  EXPECT_EQ(solid.bodies.size(), 2u);
  EXPECT_EQ(solid.bodies.locked(), 2u);
}

TEST(SolidBodies, a_chain_is_one_body_whatever_the_order_of_locking) {
  std::mt19937 random(3);
  for (int n = 0; n < 20; ++n) {
    Solid solid;
    for (int k = 1; k <= 30; ++k) solid.granules[k] = granule(1e-6, Vec3(1e-3 * k, 0, 0), 5e-4);
    for (int k = 1; k < 30; ++k) solid.touch(k, k + 1);
    std::vector<int> order(30);
    for (int k = 0; k < 30; ++k) order[k] = k + 1;
    std::shuffle(order.begin(), order.end(), random);
    for (const int k : order) solid.lock(k);
    EXPECT_EQ(solid.partition(), (std::set<Tags>{from_to(1, 30)}));
    expect_right_figures(solid);
  }
}

TEST(SolidBodies, contacts_with_granules_that_are_not_locked_join_nothing) {
  Solid solid;
  for (int k = 1; k <= 3; ++k) solid.granules[k] = granule(1.0, Vec3(k, 0, 0), 0.5);
  solid.touch(1, 2);
  solid.touch(2, 3);
  solid.lock(1);
  solid.lock(3);
  EXPECT_EQ(solid.bodies.size(), 2u);
}

TEST(SolidBodies, when_bodies_merge_the_larger_keeps_its_number) {
  for (const bool large_first : {true, false}) {
    Solid solid;
    for (int k = 1; k <= 10; ++k) solid.granules[k] = granule(1.0, Vec3(k, 0, 0), 0.5);
    for (int k = 1; k < 10; ++k) solid.touch(k, k + 1);
    // 1..3 and 5..10; 4 joins them
    std::vector<std::int64_t> order{1, 2, 3, 5, 6, 7, 8, 9, 10};
    if (large_first) std::reverse(order.begin(), order.end());
    for (const std::int64_t tag : order) solid.lock(tag);
    const int large = solid.bodies.body_of(7), small = solid.bodies.body_of(2);
    ASSERT_NE(large, small);
    solid.lock(4);
    EXPECT_EQ(solid.bodies.body_of(2), large);
    EXPECT_EQ(solid.bodies.body_of(4), large);
    EXPECT_EQ(solid.bodies.bodies().count(small), 0u);
    expect_right_figures(solid);
  }
}

TEST(SolidBodies, a_granule_that_joins_many_bodies_merges_them_all) {
  Solid solid;
  for (int k = 1; k <= 6; ++k) {
    solid.granules[k] = granule(1.0, Vec3(k, 0, 0), 0.5);
    solid.touch(7, k);
    solid.lock(k);
  }
  solid.granules[7] = granule(2.0, Vec3(0, 1, 0), 0.5);
  EXPECT_EQ(solid.bodies.size(), 6u);
  solid.lock(7);
  EXPECT_EQ(solid.bodies.size(), 1u);
  expect_right_figures(solid);
}

// -------------------------------------------------------------------------------------------------------- unlock and split

TEST(SolidBodies, a_chain_cut_in_the_middle_becomes_two) {
  Solid solid = chain(9);
  const std::vector<int> born = solid.unlock({5});
  EXPECT_EQ(born.size(), 1u);
  EXPECT_EQ(solid.partition(), (std::set<Tags>{from_to(1, 4), from_to(6, 9)}));
  EXPECT_EQ(solid.bodies.body_of(5), 0);
  expect_right_figures(solid);
}

TEST(SolidBodies, a_chain_that_loses_its_end_stays_one) {
  Solid solid = chain(9);
  EXPECT_TRUE(solid.unlock({1}).empty());
  EXPECT_EQ(solid.partition(), (std::set<Tags>{from_to(2, 9)}));
  expect_right_figures(solid);
}

TEST(SolidBodies, a_ring_cut_once_stays_one_and_cut_twice_becomes_two) {
  Solid solid = chain(12, true);
  EXPECT_TRUE(solid.unlock({1}).empty());
  EXPECT_EQ(solid.bodies.size(), 1u);
  expect_right_figures(solid);
  EXPECT_EQ(solid.unlock({7}).size(), 1u);
  EXPECT_EQ(solid.partition(), (std::set<Tags>{from_to(2, 6), from_to(8, 12)}));
  expect_right_figures(solid);

  Solid at_once = chain(12, true);
  EXPECT_EQ(at_once.unlock({1, 7}).size(), 1u);
  EXPECT_EQ(at_once.partition(), solid.partition());
  expect_right_figures(at_once);
}

TEST(SolidBodies, a_star_without_its_centre_falls_into_its_rays) {
  Solid solid;
  for (int k = 0; k <= 8; ++k) solid.granules[k] = granule(1.0, Vec3(k, 0, 0), 0.5);
  for (int k = 1; k <= 8; ++k) solid.touch(0, k);
  for (int k = 0; k <= 8; ++k) solid.lock(k);
  EXPECT_EQ(solid.unlock({0}).size(), 7u);
  EXPECT_EQ(solid.bodies.size(), 8u);
  expect_right_figures(solid);
}

TEST(SolidBodies, what_comes_off_gets_a_new_number_and_the_larger_part_keeps_the_old_one) {
  Solid solid = chain(10);
  const int body = solid.bodies.body_of(1);
  const std::vector<int> born = solid.unlock({4});
  ASSERT_EQ(born.size(), 1u);
  EXPECT_EQ(solid.bodies.body_of(10), body);
  EXPECT_EQ(solid.bodies.body_of(1), born[0]);
  EXPECT_NE(born[0], body);
  EXPECT_EQ(solid.parents, (std::set<int>{body}));
  solid.unlock({10});
  EXPECT_TRUE(solid.parents.empty()) << "nothing came off this time";
}

TEST(SolidBodies, numbers_are_not_used_again) {
  Solid solid = chain(9);
  std::set<int> given{solid.bodies.body_of(1)};
  for (const std::int64_t cut : {3, 7, 5}) {
    for (const int body : solid.unlock({cut})) EXPECT_TRUE(given.insert(body).second);
  }
  solid.unlock({1, 2, 4, 6, 8, 9});
  EXPECT_EQ(solid.bodies.size(), 0u);
  EXPECT_EQ(solid.bodies.locked(), 0u);
  solid.lock(1);
  EXPECT_TRUE(given.insert(solid.bodies.body_of(1)).second);
}

TEST(SolidBodies, unlocking_what_is_not_locked_changes_nothing) {
  Solid solid = chain(3);
  solid.granules[9] = granule(1.0, Vec3::Zero(), 0.5);
  EXPECT_TRUE(solid.unlock({9}).empty());
  EXPECT_EQ(solid.partition(), (std::set<Tags>{from_to(1, 3)}));
}

TEST(SolidBodies, the_first_moment_of_the_parts_is_that_of_the_whole) {
  Solid solid = chain(101);
  const MassProperties before = solid.bodies.body(solid.bodies.body_of(1)).mass;
  solid.unlock({20, 50, 51, 90});
  MassProperties after = sum_of(solid, {20, 50, 51, 90});
  for (const auto& b : solid.bodies.bodies()) after.add(b.second.mass);
  expect_same(after, before, 1e-12, before);
  EXPECT_LE((after.inertia() - before.inertia()).norm(), 1e-12 * before.inertia().norm());
}

// ------------------------------------------------------------------------------------------------------- against brute force

/// A bed of granules with contacts of density `contacts_per_granule`; rounds of waking and locking.
void random_graph(unsigned seed, int granules, double contacts_per_granule, int rounds) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> at(0, 0.1), radius(1e-3, 2e-3);
  Solid solid;
  std::vector<std::pair<int, int>> edges;
  for (int k = 0; k < granules; ++k) {
    const double x = at(random), y = at(random), z = at(random), r = radius(random);
    solid.granules[k] = granule(1e4 * r * r * r, Vec3(x, y, z), r);
    solid.granules[k].held = k % 7 == 0;
  }
  for (int e = 0; e < contacts_per_granule * granules / 2; ++e) {
    const int a = static_cast<int>(random() % granules), b = static_cast<int>(random() % granules);
    if (a != b) edges.emplace_back(a, b);
  }
  Tags locked;
  for (int round = 0; round < rounds; ++round) {
    Tags leaving, coming;
    for (int k = 0; k < granules; ++k) {
      const bool is = locked.count(k) != 0;
      if (is && random() % 5 == 0) leaving.insert(k);
      if (!is && random() % 2) coming.insert(k);
    }
    const std::size_t before = solid.bodies.size();
    const std::vector<int> born = solid.unlock(leaving);
    for (const std::int64_t tag : leaving) locked.erase(tag);
    ASSERT_EQ(solid.partition(), solid.connected_components()) << "after a split in round " << round;
    ASSERT_LE(solid.bodies.size(), before + born.size());
    expect_right_figures(solid);
    for (const std::int64_t tag : coming) locked.insert(tag);
    for (const auto& e : edges)
      if (locked.count(e.first) && locked.count(e.second) && (coming.count(e.first) || coming.count(e.second)))
        solid.touch(e.first, e.second);
    for (const std::int64_t tag : coming) solid.lock(tag);
    ASSERT_EQ(solid.bodies.locked(), locked.size());
    ASSERT_EQ(solid.partition(), solid.connected_components()) << "after locking in round " << round;
    expect_right_figures(solid);
  }
}

TEST(SolidBodies, are_the_connected_components_of_random_graphs) {
  for (unsigned seed = 0; seed < 20; ++seed)
    for (const double contacts : {0.5, 1.0, 2.0, 6.0}) random_graph(seed, 60, contacts, 10);
  random_graph(99, 2000, 2.5, 5);
}

TEST(SolidBodies, are_the_connected_components_of_a_carved_lattice) {
  constexpr int n = 9;
  const auto tag = [](int i, int j, int k) { return (i * n + j) * n + k; };
  std::mt19937 random(5);
  for (int round = 0; round < 20; ++round) {
    Solid solid;
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j)
        for (int k = 0; k < n; ++k) {
          solid.granules[tag(i, j, k)] = granule(1e-5, 2e-3 * Vec3(i, j, k), 1e-3);
          if (i) solid.touch(tag(i, j, k), tag(i - 1, j, k));
          if (j) solid.touch(tag(i, j, k), tag(i, j - 1, k));
          if (k) solid.touch(tag(i, j, k), tag(i, j, k - 1));
        }
    for (const auto& g : solid.granules) solid.lock(g.first);
    // a ball, a plane and single granules at once
    Tags carved;
    const int middle = static_cast<int>(random() % n);
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j)
        for (int k = 0; k < n; ++k)
          if (i == middle || (Vec3(i, j, k) - Vec3(1, 4, 4)).norm() < 2.5 || random() % 6 == 0) carved.insert(tag(i, j, k));
    solid.unlock(carved);
    ASSERT_EQ(solid.partition(), solid.connected_components());
    expect_right_figures(solid);
  }
}

// ---------------------------------------------------------------------------------------------------- what touches the ground

TEST(MassProperties, count_what_is_held) {
  MassProperties p, q;
  p.add({1, Vec3(1, 2, 3), 0.1, true}, 0.1);
  p.add({1, Vec3(1, 2, 4), 0.1}, 0.1);
  q.add({1, Vec3(1, 2, 5), 0.1, true}, 0.1);
  EXPECT_EQ(p.held, 1);
  p.add(q);
  EXPECT_EQ(p.held, 2);
  const Pose there(Vec3(1, 0, 0), Eigen::Quaterniond(0.8, 0.6, 0, 0));
  EXPECT_EQ(p.seen_from(Pose(), there).held, 2);
  p.add({1, Vec3(1, 2, 3), 0.1, true}, 0.1, -1);
  EXPECT_EQ(p.held, 1);
  p.add(q, -1);
  EXPECT_EQ(p.held, 0);
  EXPECT_EQ(p.count, 1);
}

void expect_at_rest(const SolidBody& body) {
  EXPECT_EQ(body.twist.velocity, Vec3(Vec3::Zero()));
  EXPECT_EQ(body.twist.spin, Vec3(Vec3::Zero()));
}

TEST(SolidBodies, a_grounded_body_gives_the_ground_what_comes_in) {
  Solid solid = chain(3);
  SolidBody& body = solid.bodies.body(1);
  body.grounded = true;
  body.changed = false;
  solid.granules[4] = granule(1e-6, Vec3(4e-3, 0, 0), 5e-4, Vec3(0, 3, 0), Vec3(100, 0, 0));
  solid.touch(3, 4);
  solid.lock(4);
  EXPECT_TRUE(body.grounded);
  EXPECT_TRUE(body.changed);
  expect_at_rest(body);
  EXPECT_EQ(body.mass.count, 4);
  // a granule that goes on with a motion of its own leaves the body where it is
  MovingGranule given = solid.now(4);
  given.velocity = Vec3(0, 5, 0);
  solid.unlock({4}, {{4, given}});
  expect_at_rest(body);
}

TEST(SolidBodies, a_body_that_merges_with_a_grounded_one_is_grounded) {
  for (const bool large_is_grounded : {true, false})
    for (const bool by_lock : {true, false}) {
      Solid solid;
      for (int k = 1; k <= 7; ++k)
        solid.granules[k] =
            granule(1e-6, Vec3(1e-3 * k, 0, 0), 5e-4, (k > 4) == large_is_grounded ? Vec3(0, 0, 0) : Vec3(0, 0, 2));
      solid.granules[large_is_grounded ? 7 : 1].held = true;
      for (const int k : {1, 2, 4, 5, 6}) solid.touch(k, k + 1);  // 1..3 and 4..7
      for (int k = 1; k <= 7; ++k)
        if (k != 4 || !by_lock) solid.lock(k);
      if (by_lock) {
        solid.granules[4].velocity = Vec3(1, 1, 1);
        solid.touch(3, 4);
      }
      SolidBody& stood = solid.bodies.body(solid.bodies.body_of(large_is_grounded ? 7 : 1));
      stood.grounded = true;
      stood.grounded_mass = stood.mass.mass;
      const double of_itself = stood.mass.mass;
      if (by_lock)
        solid.lock(4);
      else
        solid.join(3, 4);
      ASSERT_EQ(solid.bodies.size(), 1u);
      const SolidBody& body = solid.bodies.bodies().begin()->second;
      EXPECT_TRUE(body.grounded);
      expect_at_rest(body);
      EXPECT_EQ(body.mass.held, 1);
      EXPECT_DOUBLE_EQ(body.grounded_mass, of_itself) << "what came to it was not grounded";
    }
}

TEST(SolidBodies, ungrounded_bodies_merge_as_ever) {
  Solid solid;
  solid.granules[1] = granule(1, Vec3::Zero(), 0.5, Vec3(0, 0, 2));
  solid.granules[2] = granule(1, Vec3(1, 0, 0), 0.5, Vec3(0, 0, 4));
  solid.granules[2].held = true;  // the adapter says which bodies are grounded
  solid.lock(1);
  solid.lock(2);
  solid.join(1, 2);
  const SolidBody& body = solid.bodies.bodies().begin()->second;
  EXPECT_FALSE(body.grounded);
  EXPECT_DOUBLE_EQ(body.twist.at(Vec3(0.5, 0, 0))[2], 3);
}

TEST(SolidBodies, of_the_parts_of_a_grounded_body_those_are_grounded_that_are_held) {
  for (int held_parts = 0; held_parts < 8; ++held_parts)
    for (const bool was_grounded : {true, false}) {
      // 1..5, 7..10, 12..14 after the cut; the first is the rest
      Solid solid = chain(14);
      const std::int64_t member[] = {1, 8, 14};
      for (int part = 0; part < 3; ++part)
        if (held_parts >> part & 1) {
          solid.unlock({member[part]});
          solid.granules[member[part]].held = true;
          if (member[part] > 1) solid.touch(member[part], member[part] - 1);
          if (member[part] < 14) solid.touch(member[part], member[part] + 1);
          solid.lock(member[part]);
          solid.adopt();
        }
      ASSERT_EQ(solid.bodies.size(), 1u);
      const int whole = solid.bodies.body_of(1);
      solid.bodies.body(whole).grounded = was_grounded;
      solid.bodies.body(whole).grounded_mass = was_grounded ? 0.25 * solid.bodies.body(whole).mass.mass : 0.0;
      solid.unlock({6, 11});
      ASSERT_EQ(solid.bodies.size(), 3u);
      for (int part = 0; part < 3; ++part) {
        const SolidBody& body = solid.bodies.body(solid.bodies.body_of(member[part]));
        EXPECT_EQ(body.mass.held, held_parts >> part & 1);
        EXPECT_EQ(body.grounded, was_grounded && (held_parts >> part & 1)) << "part " << part;
        // two of fourteen granules left and were not counted
        EXPECT_NEAR(body.grounded_mass, body.grounded ? 0.25 * 14 / 12 * body.mass.mass : 0.0, 1e-12 * body.mass.mass)
            << "part " << part;
        expect_at_rest(body);
      }
      expect_right_figures(solid);
    }
}

TEST(SolidBodies, the_state_of_a_body_has_what_holds_it) {
  Solid solid = chain(3);
  SolidBody body = solid.bodies.body(1), back;
  body.mass.held = 2;
  body.grounded = true;
  body.grounded_mass = 0.75;
  EXPECT_EQ(body.rests(true), 1);
  EXPECT_EQ(body.rests(true), 2);
  body.bear({8, 0, -4}, 4);
  body.bear({2, 0, -1}, 4);
  std::vector<double> numbers;
  body.each_number([&](auto& n) { numbers.push_back(static_cast<double>(n)); });
  std::size_t at = 0;
  back.each_number([&](auto& n) { n = static_cast<std::decay_t<decltype(n)>>(numbers.at(at++)); });
  EXPECT_EQ(at, numbers.size());
  EXPECT_EQ(back.mass.count, 3);
  EXPECT_EQ(back.mass.held, 2);
  EXPECT_EQ(back.mass.mass, body.mass.mass);
  EXPECT_TRUE(back.grounded);
  EXPECT_EQ(numbers[9], 2.0) << "after origin, attitude and counts";
  EXPECT_EQ(back.grounded_mass, 0.75);
  EXPECT_EQ(back.looks_at_rest, 2);
  EXPECT_TRUE(back.pressed);
  EXPECT_EQ(back.extra_load, Vec3(2, 0, -1)) << "2 + (2 - 2) / 4";
  back.ground(false);
  EXPECT_EQ(back.looks_at_rest, 0) << "counted anew";
  EXPECT_FALSE(back.pressed);
  EXPECT_EQ(back.rests(false), 0);
}

TEST(SolidBodies, a_member_takes_14_bytes) {
  SolidBodies bodies;
  bodies.found(SolidBody());
  double sum = 0, weights = 0;
  for (int tag = 1; tag <= 300000; ++tag) {
    bodies.take_in(tag, 1);
    if (tag < 1000) continue;
    sum += static_cast<double>(bodies.member_bytes()) / tag * std::log1p(1.0 / tag);
    weights += std::log1p(1.0 / tag);
  }
  EXPECT_LE(sum / weights, 14.0);
}

// ------------------------------------------------------------------------------------------------------------- far and carved

TEST(MassProperties, far_from_the_origin_are_those_of_the_same_granules_near_it) {
  std::mt19937 random(6);
  const auto on_grid = [&] { return std::ldexp(static_cast<double>(random() % 1024), -20); };  // below 1 mm, exact 1000 m away
  double worst = 0;
  for (int n = 0; n < 20; ++n) {
    Solid near, far;
    for (int k = 1; k <= 30; ++k) {
      const double x = on_grid(), y = on_grid(), z = on_grid();
      near.granules[k] = granule(1e-8 * k, Vec3(x, y, z), 1e-4);
      far.granules[k] = granule(1e-8 * k, Vec3(x, y, z) + Vec3(1000, -1000, 1000), 1e-4);
      for (Solid* s : {&near, &far}) {
        if (k > 1) s->touch(k, k - 1);
        s->lock(k);
      }
    }
    const MassProperties a = near.bodies.body(1).mass, b = far.bodies.body(1).mass;
    worst = std::max(worst, (a.inertia() - b.inertia()).norm() / a.inertia().norm());
    EXPECT_LE((b.centre() - Vec3(1000, -1000, 1000) - a.centre()).norm(), 1e-12);
    const RigidPart part = far.bodies.body(1).part();
    EXPECT_LE((part.inertia - a.inertia()).norm(), 1e-9 * a.inertia().norm());
  }
  std::printf("a body of 1 mm, 1000 m away: inertia off by %.1e (relative)\n", worst);
  EXPECT_LE(worst, 1e-9);
}

TEST(MassProperties, are_the_same_granules_in_another_frame) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> at(-0.1, 0.1);
  const Pose here(Vec3(1, 2, 3), Eigen::Quaterniond(0.1, 0.5, -0.7, 0.2).normalized());
  const Pose there(Vec3(-2, 0, 1), Eigen::Quaterniond(0.8, -0.1, 0.3, 0.4).normalized());
  MassProperties p, due;
  for (int n = 0; n < 100; ++n) {
    const double x = at(random), y = at(random), z = at(random), r = 1e-3 + std::abs(x) / 50;
    p.add({1e4 * r * r * r, Vec3(x, y, z), r}, r);
    due.add({1e4 * r * r * r, there.to_frame(here.to_world(Vec3(x, y, z))), r}, r);
  }
  expect_same(p.seen_from(here, there), due, 1e-13, due);
  EXPECT_LE((p.seen_from(here, there).inertia() - due.inertia()).norm(), 1e-12 * due.inertia().norm());
  expect_same(p.seen_from(here, there).seen_from(there, here), p, 1e-12, due);
}

/// A block of 100,000 granules, of which the three in the corner far from where it began remain.
void carve_down_to_three(const std::vector<std::size_t>& batches) {
  constexpr int nx = 100, ny = 40, nz = 25;
  const auto tag = [](int i, int j, int k) { return std::int64_t{1} + (i * ny + j) * nz + k; };
  std::mt19937 random(8);
  std::uniform_real_distribution<double> radius(0.9e-3, 1e-3);
  Solid solid;
  std::vector<std::pair<double, std::int64_t>> order;  // by distance from the last corner
  for (int i = 0; i < nx; ++i)
    for (int j = 0; j < ny; ++j)
      for (int k = 0; k < nz; ++k) {
        const double r = radius(random);
        solid.granules[tag(i, j, k)] = granule(1e4 * r * r * r, 2e-3 * Vec3(i, j, k), r);
        order.emplace_back((Vec3(nx - 1 - i, ny - 1 - j, nz - 1 - k)).norm() + 1e-6 * k, tag(i, j, k));
        if (i) solid.touch(tag(i, j, k), tag(i - 1, j, k));
        if (j) solid.touch(tag(i, j, k), tag(i, j - 1, k));
        if (k) solid.touch(tag(i, j, k), tag(i, j, k - 1));
      }
  for (const auto& g : solid.granules) solid.lock(g.first);
  ASSERT_EQ(solid.bodies.size(), 1u);
  std::sort(order.rbegin(), order.rend());
  std::size_t at = 0;
  for (const std::size_t left : batches) {
    Tags leaving;
    for (; order.size() - at > left; ++at) leaving.insert(order[at].second);
    solid.unlock(leaving);
  }
  ASSERT_EQ(solid.bodies.size(), 1u);
  ASSERT_EQ(solid.bodies.locked(), 3u);
  Tags three;
  for (; at < order.size(); ++at) three.insert(order[at].second);
  ASSERT_EQ(solid.partition(), (std::set<Tags>{three}));
  const MassProperties& is = solid.bodies.bodies().begin()->second.mass;
  const MassProperties due = sum_of(solid, three);
  const double mass = std::abs(is.mass - due.mass) / due.mass, centre = (is.centre() - due.centre()).norm() / 1e-3,
               inertia = (is.inertia() - due.inertia()).norm() / due.inertia().norm();
  std::printf(
      "100000 granules carved down to 3 in %zu steps: mass off by %.1e, centre by %.1e radii, inertia by %.1e (relative)\n",
      batches.size(), mass, centre, inertia);
  EXPECT_EQ(is.count, 3);
  EXPECT_LE(mass, 1e-9);
  EXPECT_LE(centre, 1e-9);
  EXPECT_LE(inertia, 1e-9);
}

TEST(SolidBodies, a_large_body_that_is_carved_down_to_three_granules_has_their_figures) {
  carve_down_to_three({3});
  std::vector<std::size_t> steps;
  for (std::size_t left = 95000; left > 1000; left -= 2000) steps.push_back(left);
  for (std::size_t left = 1000; left >= 3; --left) steps.push_back(left);
  carve_down_to_three(steps);
}

// ------------------------------------------------------------------------------------------------------------------ in flight

/// Count, momentum and angular momentum about the world's origin of all granules, free and locked, from their own motions.
struct Totals {
  std::size_t count = 0;
  double mass = 0, linear_sizes = 0, angular_sizes = 0;
  Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
};

Totals totals(const Solid& solid) {
  Totals t;
  for (const auto& granule : solid.granules) {
    const MovingGranule g = solid.now(granule.first);
    const RigidPart part = RigidPart::granule(g.mass, g.radius, g.position, g.velocity, g.spin);
    const Vec3 angular = part.angular_momentum(Vec3::Zero());
    ++t.count;
    t.mass += g.mass;
    t.linear += g.mass * g.velocity;
    t.linear_sizes += g.mass * g.velocity.norm();
    t.angular += angular;
    t.angular_sizes += angular.norm();
  }
  return t;
}

/// The same from the figures that the bodies keep of themselves, and the free granules.
Totals booked_totals(const Solid& solid) {
  Totals t;
  const auto book = [&t](const RigidPart& part, std::int64_t count) {
    t.count += static_cast<std::size_t>(count);
    t.mass += part.mass;
    t.linear += part.mass * part.velocity;
    t.angular += part.angular_momentum(Vec3::Zero());
  };
  for (const auto& body : solid.bodies.bodies()) book(body.second.part(), body.second.mass.count);
  for (const auto& [tag, g] : solid.granules)
    if (!solid.places.count(tag)) book(RigidPart::granule(g.mass, g.radius, g.position, g.velocity, g.spin), 1);
  return t;
}

/// Keeps the largest deviation of each kind of change, to be told at the end.
struct Kept {
  double linear = 0, angular = 0, booked = 0;
  void compare(const Solid& solid, const Totals& was) {
    const Totals is = totals(solid), books = booked_totals(solid);
    EXPECT_EQ(books.count, was.count);
    EXPECT_NEAR(books.mass, was.mass, 1e-13 * was.mass);
    booked = std::max({booked, (books.linear - was.linear).norm() / was.linear_sizes,
                       (books.angular - was.angular).norm() / was.angular_sizes});
    EXPECT_EQ(is.count, was.count);
    EXPECT_DOUBLE_EQ(is.mass, was.mass);
    linear = std::max(linear, (is.linear - was.linear).norm() / was.linear_sizes);
    angular = std::max(angular, (is.angular - was.angular).norm() / was.angular_sizes);
  }
  void tell(const char* what) const {
    std::printf("%s: momentum %.1e, angular momentum %.1e; from the bodies' figures %.1e (relative)\n", what, linear, angular,
                booked);
    EXPECT_LE(linear, 1e-12) << what;
    EXPECT_LE(angular, 1e-12) << what;
    EXPECT_LE(booked, 1e-12) << what;
  }
};

struct Lottery {
  std::mt19937 random;
  explicit Lottery(unsigned seed) : random(seed) {}
  double between(double lo, double hi) { return std::uniform_real_distribution<double>(lo, hi)(random); }
  Vec3 vector(double size) {
    const double x = between(-size, size), y = between(-size, size), z = between(-size, size);
    return Vec3(x, y, z);
  }
  /// Free granules with motions of their own around a common one, tied to each other as a tree and some more.
  void cluster(Solid& solid, std::int64_t first, int n, const Vec3& centre, const Vec3& velocity) {
    for (int k = 0; k < n; ++k) {
      const double r = between(0.02, 0.05);
      const Vec3 x = centre + vector(0.3), v = velocity + vector(0.5), w = vector(20);
      solid.granules[first + k] = granule(1e3 * r * r * r, x, r, v, w);
      if (k) solid.touch(first + k, first + static_cast<std::int64_t>(random() % k));
      if (k > 2 && random() % 2) solid.touch(first + k, first + static_cast<std::int64_t>(random() % k));
    }
  }
  void lock(Solid& solid, Tags tags) {
    std::vector<std::int64_t> order(tags.begin(), tags.end());
    std::shuffle(order.begin(), order.end(), random);
    for (const std::int64_t tag : order) solid.lock(tag);
  }
  Tags some(const Solid& solid, std::size_t n) {
    std::vector<std::int64_t> locked;
    for (const auto& p : solid.places) locked.push_back(p.first);
    std::shuffle(locked.begin(), locked.end(), random);
    return {locked.begin(), locked.begin() + static_cast<std::ptrdiff_t>(std::min(n, locked.size()))};
  }
};

std::map<std::int64_t, Vec3> world_places(const Solid& solid) {
  std::map<std::int64_t, Vec3> places;
  for (const auto& g : solid.granules) places[g.first] = solid.now(g.first).position;
  return places;
}

double largest_difference(const std::map<std::int64_t, Vec3>& a, const std::map<std::int64_t, Vec3>& b) {
  EXPECT_EQ(a.size(), b.size());
  double most = 0;
  for (const auto& p : a) most = std::max(most, (p.second - b.at(p.first)).norm());
  return most;
}

/// Largest difference (relative) between two velocity fields in and around the bodies.
double field_difference(const Twist& a, const Twist& b, Lottery& lottery) {
  double most = 0, scale = 0;
  for (int n = 0; n < 20; ++n) {
    const Vec3 x = a.point + lottery.vector(3);
    most = std::max(most, (a.at(x) - b.at(x)).norm());
    scale = std::max(scale, a.at(x).norm());
  }
  return std::max(most / scale, (a.spin - b.spin).norm() / a.spin.norm());
}

TEST(SolidBodiesInFlight, locking_merging_carving_and_splitting_keep_the_momenta) {
  Kept locking, flying, flying_apart, joining, bridging, chaining, adopting, carving, giving;
  double places_merged = 0, places_flown_in_body = 0;
  for (unsigned seed = 0; seed < 50; ++seed) {
    Lottery lottery(seed);
    Solid solid;
    lottery.cluster(solid, 1, 40, Vec3(3, 2, 1), Vec3(1, -2, 0.5));
    lottery.cluster(solid, 101, 25, Vec3(4, 3, 2), Vec3(-1, 0.3, 2));
    lottery.cluster(solid, 201, 12, Vec3(2, 4, 3), Vec3(0, 1, -1));
    const Totals start = totals(solid);
    for (const Tags& tags : {from_to(1, 40), from_to(101, 125), from_to(201, 212)}) {
      lottery.lock(solid, tags);
      locking.compare(solid, start);
    }
    ASSERT_EQ(solid.bodies.size(), 3u);
    expect_right_figures(solid);

    solid.fly(100, 2e-3);
    flying.compare(solid, start);
    ASSERT_NE(solid.bodies.body(solid.bodies.body_of(1)).pose, solid.bodies.body(solid.bodies.body_of(101)).pose);

    // two moving bodies in different poses become one, and the third as well before any place was adopted
    auto places = world_places(solid);
    Totals was = totals(solid);
    if (seed % 2) {
      solid.join(1 + seed % 40, 101 + seed % 25);
      joining.compare(solid, was);
      solid.join(201 + seed % 12, 101 + seed % 25);
      chaining.compare(solid, was);
    } else {
      // a free granule that touches all three
      const Vec3 x = lottery.vector(1), v = lottery.vector(3), w = lottery.vector(30);
      solid.granules[301] = granule(0.2, x, 0.05, v, w);
      for (const std::int64_t tag : {201, 101, 1}) solid.touch(301, tag);
      places = world_places(solid);
      was = totals(solid);
      solid.lock(301);
      bridging.compare(solid, was);
    }
    ASSERT_EQ(solid.bodies.size(), 1u);
    places_merged = std::max(places_merged, largest_difference(world_places(solid), places));
    solid.adopt();
    EXPECT_TRUE(solid.bodies.swallowed().empty());
    adopting.compare(solid, was);
    places_merged = std::max(places_merged, largest_difference(world_places(solid), places));
    expect_right_figures(solid);
    solid.fly(100, 2e-3);
    flying.compare(solid, was);
    if (solid.granules.count(301) == 0) {
      // nothing that was locked before has moved in its body
      const SolidBody& b = solid.bodies.bodies().begin()->second;
      for (const auto& p : solid.places)
        places_flown_in_body =
            std::max(places_flown_in_body, std::abs((b.pose.to_world(p.second.position) - b.motion.centre()).norm() -
                                                    (solid.mass(p.first).position - b.mass.centre()).norm()));
    }

    // granules go on with the field, bodies come apart
    for (int round = 0; round < 4; ++round) {
      was = totals(solid);
      solid.unlock(lottery.some(solid, 6));
      carving.compare(solid, was);
      ASSERT_EQ(solid.partition(), solid.connected_components());
      expect_right_figures(solid);
      // free granules fly on, too
      for (auto& g : solid.granules)
        if (!solid.places.count(g.first)) g.second.position += 20 * 2e-3 * g.second.velocity;
      solid.fly(20, 2e-3);
      flying_apart.compare(solid, was);

      // and others with motions of their own, which the body pays for
      std::map<std::int64_t, MovingGranule> given;
      const Tags leaving = lottery.some(solid, 3);
      for (const std::int64_t tag : leaving) {
        given[tag] = solid.now(tag);
        given[tag].velocity += lottery.vector(2);
        given[tag].spin = lottery.vector(30);
      }
      bool last = false;  // a body that goes out leaves nobody to pay
      std::map<int, Tags> left = solid.members();
      for (const std::int64_t tag : leaving) {
        Tags& mates = left[solid.bodies.body_of(tag)];
        mates.erase(tag);
        last = last || mates.empty();
      }
      was = totals(solid);
      solid.unlock(leaving, last ? std::map<std::int64_t, MovingGranule>() : given);
      if (!last) giving.compare(solid, was);
      ASSERT_EQ(solid.partition(), solid.connected_components());
    }
    EXPECT_GT(solid.bodies.size(), 1u) << "nothing came apart";
  }
  locking.tell("locking");
  flying.tell("flying");
  flying_apart.tell("flying in parts");
  joining.tell("joining two bodies in flight");
  chaining.tell("joining a third to bodies just joined");
  bridging.tell("locking a granule that ties three bodies in flight");
  adopting.tell("adopting the new frames");
  carving.tell("unlocking and splitting");
  giving.tell("unlocking with motions of their own");
  std::printf("world places in merges: %.1e m; distances in the body in flight: %.1e m\n", places_merged, places_flown_in_body);
  EXPECT_LE(places_merged, 1e-12);
  EXPECT_LE(places_flown_in_body, 1e-12);
}

TEST(SolidBodiesInFlight, what_chips_off_leaves_the_velocity_field_of_the_body_and_its_parts_as_it_was) {
  double worst = 0, worst_settled = 0;
  std::size_t parts = 0;
  for (unsigned seed = 0; seed < 50; ++seed) {
    Lottery lottery(1000 + seed);
    Solid solid;
    lottery.cluster(solid, 1, 60, Vec3(1, 2, 3), Vec3(2, 1, -1));
    lottery.lock(solid, from_to(1, 60));
    solid.fly(50, 2e-3);
    const Twist field = solid.bodies.body(solid.bodies.body_of(1)).twist;
    const Pose pose = solid.bodies.body(solid.bodies.body_of(1)).pose;
    solid.bodies.body(solid.bodies.body_of(1)).step_then = 1000;
    const Tags leaving = lottery.some(solid, 8);
    const bool came_apart = !solid.unlock(leaving).empty();
    for (const std::int64_t tag : leaving) {
      const MovingGranule g = solid.now(tag);
      EXPECT_EQ(g.velocity, field.at(g.position));
      EXPECT_EQ(g.spin, field.spin);
    }
    parts += solid.bodies.size();
    for (const auto& [number, body] : solid.bodies.bodies()) {
      EXPECT_TRUE(body.changed);
      EXPECT_EQ(body.pose, pose);
      if (came_apart) {
        EXPECT_EQ(body.step_then, -1) << "the mean acceleration of body " << number << " is measured anew";
      }
      worst = std::max(worst, field_difference(field, body.twist, lottery));
      const RigidPart part = body.part();
      worst_settled = std::max(worst_settled, field_difference(field, RigidMotion(&part, 1).twist(), lottery));
    }
  }
  EXPECT_GT(parts, 100u);
  std::printf("fields of %zu parts: off by %.1e, by %.1e as the motion that they go on with (relative)\n", parts, worst,
              worst_settled);
  EXPECT_LE(worst, 1e-12);
  EXPECT_LE(worst_settled, 1e-12);
}

TEST(SolidBodiesInFlight, a_body_pays_for_the_motion_that_it_gives_back) {
  // two balls strike and are locked, and one is given back with the motion that it had: the other has its own again
  Solid solid;
  solid.granules[1] = granule(2.0, Vec3(10, 0, 0), 0.5, Vec3(1, 2, 3), Vec3(4, 0, 1));
  solid.granules[2] = granule(3.0, Vec3(11, 0, 0), 0.5, Vec3(-1, 0, 5), Vec3(0, -2, 0));
  solid.touch(1, 2);
  solid.lock(1);
  solid.lock(2);
  EXPECT_LE((solid.now(1).velocity - solid.now(2).velocity - solid.now(1).spin.cross(Vec3(-1, 0, 0))).norm(), 1e-14);
  const MovingGranule one = solid.granules.at(1), two = solid.granules.at(2);
  solid.unlock({1}, {{1, one}});
  EXPECT_LE((solid.now(2).velocity - two.velocity).norm(), 1e-14);
  EXPECT_LE((solid.now(2).spin - two.spin).norm(), 1e-12);
}

TEST(SolidBodiesInFlight, a_lone_granule_moves_as_it_did) {
  Solid solid;
  solid.granules[1] = granule(2.0, Vec3(10, 20, 30), 0.5, Vec3(1, 2, 3), Vec3(4, 5, 6));
  solid.lock(1);
  EXPECT_EQ(solid.now(1).position, Vec3(10, 20, 30));
  EXPECT_EQ(solid.now(1).velocity, Vec3(1, 2, 3));
  EXPECT_EQ(solid.now(1).spin, Vec3(4, 5, 6));
  solid.unlock({1});
  EXPECT_EQ(solid.bodies.size(), 0u);
  EXPECT_EQ(solid.granules[1].velocity, Vec3(1, 2, 3));
}

TEST(SolidBodiesInFlight, what_merged_bodies_felt_is_their_mean_by_mass_in_the_frame_that_is_kept) {
  for (const bool known : {true, false}) {
    Lottery lottery(77);
    Solid solid;
    lottery.cluster(solid, 1, 20, Vec3(1, 1, 1), Vec3(1, 0, 0));
    lottery.cluster(solid, 101, 10, Vec3(2, 2, 2), Vec3(0, 1, 0));
    lottery.lock(solid, from_to(1, 20));
    lottery.lock(solid, from_to(101, 110));
    solid.fly(100, 2e-3);
    SolidBody &a = solid.bodies.body(solid.bodies.body_of(1)), &b = solid.bodies.body(solid.bodies.body_of(101));
    a.felt = Vec3(0, 0, -9);
    b.felt = Vec3(1, -2, 3);
    a.felt_known = true;
    b.felt_known = known;
    a.step_then = b.step_then = 1000;
    const double ma = a.mass.mass, mb = b.mass.mass;
    const Vec3 in_world = (ma * a.pose.turned_to_world(a.felt) + mb * b.pose.turned_to_world(b.felt)) / (ma + mb);
    const Vec3 due = known ? a.pose.turned_to_frame(in_world) : a.felt;
    solid.join(5, 105);
    const SolidBody& kept = solid.bodies.body(solid.bodies.body_of(101));
    EXPECT_EQ(solid.bodies.body_of(101), solid.bodies.body_of(1));
    EXPECT_TRUE(kept.felt_known);
    EXPECT_LE((kept.felt - due).norm(), 1e-14);
    EXPECT_EQ(kept.step_then, -1) << "the mean acceleration is measured anew";
    EXPECT_TRUE(kept.changed);
    // parts that come off felt what the whole felt
    const Vec3 felt = kept.felt;
    solid.unlock({5});
    ASSERT_GT(solid.bodies.size(), 1u);
    for (const auto& body : solid.bodies.bodies()) EXPECT_EQ(body.second.felt, felt);
  }
}

// -------------------------------------------------------------------------------------------------------------- periodic boxes

constexpr double edge = 10.0;  // of the box

double wrapped(double x) { return x - edge * std::floor(x / edge); }

/// n granules along x from `start` over the border of a box that is periodic in x, y and z; `n` = 2 edge: a ring.
Solid periodic_chain(int n, double start, const std::vector<int>& order) {
  Solid solid;
  solid.bodies.set_periods(Vec3::Constant(edge));
  for (int k = 0; k < n; ++k)
    solid.granules[k] = granule(1 + 0.1 * k, Vec3(wrapped(start + 0.5 * k), 5 + 0.1 * (k % 3), 5), 0.26,
                                Vec3(0.1 * k, 1, -0.2 * k), Vec3(1, k, 0));
  for (int k = 0; k + 1 < n; ++k) solid.touch(k, k + 1);
  if (n * 0.5 == edge) solid.touch(n - 1, 0);
  for (const int k : order) solid.lock(k);
  solid.adopt();
  return solid;
}

MassProperties straight_chain(int n) {
  MassProperties p;
  for (int k = 0; k < n; ++k) p.add({1 + 0.1 * k, Vec3(0.5 * k, 5 + 0.1 * (k % 3), 5), 0.26}, 0.26);
  return p;
}

std::vector<int> shuffled(int n, std::mt19937& random) {
  std::vector<int> order(n);
  for (int k = 0; k < n; ++k) order[k] = k;
  std::shuffle(order.begin(), order.end(), random);
  return order;
}

TEST(SolidBodiesInPeriodicBoxes, a_chain_across_the_border_is_a_straight_one) {
  std::mt19937 random(41);
  for (int n = 0; n < 100; ++n) {
    const double start = wrapped(0.37 * n);
    const Solid solid = periodic_chain(12, start, shuffled(12, random));
    ASSERT_EQ(solid.bodies.size(), 1u);
    const SolidBody& body = solid.bodies.bodies().begin()->second;
    const MassProperties due = straight_chain(12);
    EXPECT_LE((body.mass.inertia() - due.inertia()).norm(), 1e-12 * due.inertia().norm());
    EXPECT_FALSE(body.spans[0] || body.spans[1] || body.spans[2]);
    for (int k = 0; k < 12; ++k) {
      const Vec3 images = (solid.now(k).position - solid.granules.at(k).position) / edge;
      EXPECT_LE((images - Vec3(images.array().round())).norm(), 1e-13) << "granule " << k << " is not where one of its images is";
      if (k) {
        EXPECT_LT((solid.now(k).position - solid.now(k - 1).position).norm(), 0.6);
      }
    }
    expect_same(body.mass, sum_of(solid, from_to(0, 11)), 1e-12, due);
    // momenta of the straight chain that the granules are images of
    Totals before, after = totals(solid);
    for (int k = 0; k < 12; ++k) {
      const MovingGranule& g = solid.granules.at(k);
      const RigidPart part = RigidPart::granule(g.mass, g.radius, solid.now(k).position, g.velocity, g.spin);
      before.linear += g.mass * g.velocity;
      before.angular += part.angular_momentum(Vec3::Zero());
      before.angular_sizes += part.angular_momentum(Vec3::Zero()).norm();
    }
    EXPECT_LE((after.linear - before.linear).norm(), 1e-12 * after.linear_sizes);
    EXPECT_LE((after.angular - before.angular).norm(), 1e-12 * before.angular_sizes);
  }
}

TEST(SolidBodiesInPeriodicBoxes, a_ring_through_the_box_is_tied_to_its_own_image) {
  std::mt19937 random(42);
  for (int n = 0; n < 50; ++n) {
    const Solid solid = periodic_chain(20, 0.3 * n, shuffled(20, random));
    ASSERT_EQ(solid.bodies.size(), 1u);
    const SolidBody& body = solid.bodies.bodies().begin()->second;
    EXPECT_EQ(body.spans, (std::array<bool, 3>{true, false, false}));
    EXPECT_EQ(body.free_axes(), (FreeAxes{true, false, false}));
    EXPECT_TRUE(body.changed);
  }
  // where the box is not periodic the same contacts tie it to nothing
  Solid open;
  open.granules[1] = granule(1, Vec3(0.2, 0, 0), 0.3);
  open.granules[2] = granule(1, Vec3(9.8, 0, 0), 0.3);
  open.touch(1, 2);
  open.lock(1);
  open.lock(2);
  EXPECT_EQ(open.bodies.body(1).spans, (std::array<bool, 3>{}));
  EXPECT_EQ(open.now(2).position, Vec3(9.8, 0, 0));
}

TEST(SolidBodiesInPeriodicBoxes, what_comes_off_a_ring_is_a_straight_chain_that_can_turn) {
  std::mt19937 random(7);
  for (int n = 0; n < 20; ++n) {
    // locked in any order, so the part may lie on both sides of the seam
    Solid solid = periodic_chain(20, 0.3 * n, shuffled(20, random));
    const std::vector<int> born = solid.unlock({1, 7});
    ASSERT_EQ(born.size(), 1u);
    const SolidBody& off = solid.bodies.body(born[0]);
    EXPECT_EQ(off.mass.count, 5);
    EXPECT_EQ(off.spans, (std::array<bool, 3>{}));
    MassProperties straight;
    for (int k = 2; k < 7; ++k) straight.add({1 + 0.1 * k, Vec3(0.5 * k, 5 + 0.1 * (k % 3), 5), 0.26}, 0.26);
    EXPECT_LT((off.mass.inertia() - straight.inertia()).norm(), 1e-12);
    for (const int k : {2, 4, 6})
      EXPECT_LT((solid.now(k).position - solid.now(3).position).norm(), 2.0) << "its places lie together";
  }
}

TEST(SolidBodiesInPeriodicBoxes, a_contact_that_closes_a_ring_later_ties_it) {
  Solid solid;
  solid.bodies.set_periods(Vec3(0, edge, edge));
  for (int k = 0; k < 20; ++k) {
    solid.granules[k] = granule(1, Vec3(1, 0.1 + 0.5 * k, 1), 0.26);
    if (k) solid.touch(k, k - 1);
    solid.lock(k);
  }
  solid.fly(1, 1e-3);
  EXPECT_FALSE(solid.bodies.body(1).changed);
  EXPECT_EQ(solid.bodies.body(1).free_axes(), (FreeAxes{true, true, true}));
  solid.join(0, 19);
  EXPECT_EQ(solid.bodies.body(1).spans, (std::array<bool, 3>{false, true, false}));
  EXPECT_EQ(solid.bodies.body(1).free_axes(), (FreeAxes{false, true, false}));
  EXPECT_TRUE(solid.bodies.body(1).changed) << "its motion is another one now";
  solid.join(5, 6);  // an ordinary contact within
  EXPECT_EQ(solid.bodies.body(1).spans, (std::array<bool, 3>{false, true, false}));
}

TEST(SolidBodiesInPeriodicBoxes, a_sheet_through_the_box_does_not_turn) {
  Solid solid;
  solid.bodies.set_periods(Vec3(edge, edge, 0));
  const auto tag = [](int i, int j) { return 20 * ((i + 20) % 20) + (j + 20) % 20; };
  for (int i = 0; i < 20; ++i)
    for (int j = 0; j < 20; ++j) {
      solid.granules[tag(i, j)] = granule(1, Vec3(0.1 + 0.5 * i, 0.1 + 0.5 * j, 3), 0.26, Vec3(1, 2, 0.1 * i), Vec3(0, 3, 0));
      solid.touch(tag(i, j), tag(i + 1, j));
      solid.touch(tag(i, j), tag(i, j + 1));
    }
  for (const auto& g : solid.granules) solid.lock(g.first);
  ASSERT_EQ(solid.bodies.size(), 1u);
  const SolidBody& body = solid.bodies.bodies().begin()->second;
  EXPECT_EQ(body.spans, (std::array<bool, 3>{true, true, false}));
  EXPECT_EQ(body.free_axes(), (FreeAxes{false, false, false}));
  solid.fly(10, 1e-3);
  EXPECT_EQ(body.twist.spin, Vec3(Vec3::Zero()));
  EXPECT_LE((body.twist.velocity - Vec3(1, 2, 0.95)).norm(), 1e-12);
}

TEST(SolidBodiesInPeriodicBoxes, parts_merge_through_the_border) {
  std::mt19937 random(43);
  for (const int cut : {2, 4, 9})
    for (const bool by_a_granule : {false, true}) {
      // two parts that meet at the border: joined by a contact, or by a granule that touches both
      const int n = 12;
      Solid solid;
      solid.bodies.set_periods(Vec3(edge, 0, 0));
      for (int k = 0; k < n; ++k)
        solid.granules[k] = granule(1 + 0.1 * k, Vec3(wrapped(-0.5 * cut - 0.25 + 0.5 * k), 5 + 0.1 * (k % 3), 5), 0.26);
      for (int k = 0; k + 1 < n; ++k)
        if (by_a_granule || k != cut) solid.touch(k, k + 1);
      std::vector<int> order = shuffled(n, random);
      if (by_a_granule) order.erase(std::find(order.begin(), order.end(), cut));
      for (const int k : order) solid.lock(k);
      ASSERT_EQ(solid.bodies.size(), 2u);
      if (by_a_granule)
        solid.lock(cut);
      else
        solid.join(cut, cut + 1);
      ASSERT_EQ(solid.bodies.size(), 1u);
      for (const bool adopted : {false, true}) {
        if (adopted) solid.adopt();
        const SolidBody& body = solid.bodies.bodies().begin()->second;
        EXPECT_EQ(body.spans, (std::array<bool, 3>{}));
        const MassProperties due = straight_chain(n);
        EXPECT_LE((body.mass.inertia() - due.inertia()).norm(), 1e-12 * due.inertia().norm());
        expect_same(body.mass, sum_of(solid, from_to(0, n - 1)), 1e-12, due);
        for (int k = 1; k < n; ++k) EXPECT_LT((solid.now(k).position - solid.now(k - 1).position).norm(), 0.6);
      }
    }
}

TEST(SolidBodiesInPeriodicBoxes, moving_bodies_merge_through_the_border_and_keep_their_momenta) {
  double linear = 0, angular = 0, places = 0;
  for (unsigned seed = 0; seed < 40; ++seed) {
    Lottery lottery(2000 + seed);
    Solid solid;
    solid.bodies.set_periods(Vec3(edge, edge, 0));
    const int first = 5 + static_cast<int>(lottery.random() % 30), second = 5 + static_cast<int>(lottery.random() % 30);
    lottery.cluster(solid, 1, first, Vec3(0.5, 0.5, 3), Vec3(1, 0.2, 0));
    lottery.cluster(solid, 101, second, Vec3(9.5, 9.5, 3), Vec3(-1, 0, 0.3));
    lottery.lock(solid, from_to(1, first));
    lottery.lock(solid, from_to(101, 100 + second));
    solid.fly(50, 2e-3);
    // far bodies that were carried round the box, as the fix carries them
    SolidBody& far = solid.bodies.body(solid.bodies.body_of(101));
    const Vec3 round(seed % 2 ? edge : 0, seed % 3 ? -2 * edge : 0, 0);
    far.pose.shift(round);
    far.twist.point += round;
    const auto before = world_places(solid);
    Solid was = solid;
    solid.join(1, 101);
    ASSERT_EQ(solid.bodies.size(), 1u);
    EXPECT_EQ(solid.bodies.body(solid.bodies.body_of(1)).spans, (std::array<bool, 3>{}));
    // one of the parts went to another image as a whole
    const auto after = world_places(solid);
    const Vec3 shift = after.at(101) - before.at(101), other = after.at(1) - before.at(1);
    EXPECT_TRUE(shift.norm() < 1e-12 || other.norm() < 1e-12);
    for (int d = 0; d < 2; ++d) EXPECT_LE(std::abs(after.at(101)[d] - after.at(1)[d]), 0.5 * edge + 1e-12);
    for (const Vec3& s : {shift, other}) {
      EXPECT_NEAR(s[0] / edge, std::round(s[0] / edge), 1e-12);
      EXPECT_NEAR(s[1] / edge, std::round(s[1] / edge), 1e-12);
      EXPECT_NEAR(s[2], 0.0, 1e-12);
    }
    for (const auto& p : before)
      places = std::max(places, (after.at(p.first) - p.second - (p.first > 100 ? shift : other)).norm());
    // the momenta are those of the parts where they are now
    const Vec3 whole_shift(edge * std::round(shift[0] / edge), edge * std::round(shift[1] / edge), 0);
    const Vec3 whole_other(edge * std::round(other[0] / edge), edge * std::round(other[1] / edge), 0);
    for (const auto& [tag, by] : {std::pair<std::int64_t, Vec3>{101, whole_shift}, {1, whole_other}}) {
      SolidBody& b = was.bodies.body(was.bodies.body_of(tag));
      b.pose.shift(by);
      b.twist.point += by;
    }
    const Totals due = totals(was), is = totals(solid);
    linear = std::max(linear, (is.linear - due.linear).norm() / due.linear_sizes);
    angular = std::max(angular, (is.angular - due.angular).norm() / due.angular_sizes);
    solid.adopt();
    places = std::max(places, largest_difference(world_places(solid), after));
  }
  std::printf("merging through the border: momentum %.1e, angular momentum %.1e (relative), places %.1e m\n", linear, angular,
              places);
  EXPECT_LE(linear, 1e-12);
  EXPECT_LE(angular, 1e-12);
  EXPECT_LE(places, 1e-12);
}

TEST(SolidBodiesInPeriodicBoxes, a_granule_that_is_locked_to_a_turned_body_joins_it_at_the_nearest_image) {
  Lottery lottery(45);
  Solid solid;
  solid.bodies.set_periods(Vec3::Constant(edge));
  lottery.cluster(solid, 1, 20, Vec3(0.1, 5, 5), Vec3(-1, 0, 0));
  lottery.lock(solid, from_to(1, 20));
  solid.fly(100, 2e-3);
  const MovingGranule partner = solid.now(7);
  MovingGranule g = granule(0.1, partner.position + Vec3(0.05, 0.03, -0.02), 0.03, Vec3(1, 2, 3), Vec3(4, 5, 6));
  const Vec3 image = g.position;
  for (int d = 0; d < 3; ++d) g.position[d] = wrapped(g.position[d]);
  ASSERT_NE(g.position, image);
  solid.granules[50] = g;
  solid.touch(50, 7);
  solid.lock(50);
  EXPECT_LE((solid.now(50).position - image).norm(), 1e-12);
  EXPECT_EQ(solid.bodies.body(solid.bodies.body_of(50)).spans, (std::array<bool, 3>{}));
}

}  // namespace
}  // namespace solidcull
