#include "solid_bodies.h"

#include <algorithm>
#include <map>
#include <random>
#include <set>

#include <gtest/gtest.h>

namespace solidcull {
namespace {

using Tags = std::set<std::int64_t>;

/// Granules, their contacts and their bodies, changed together in the order in which the fix does it.
struct Solid {
  SolidBodies bodies;
  FrozenContacts contacts;
  std::map<std::int64_t, GranuleMass> granules;

  Solid() { contacts.set_layout({}); }
  SolidBodies::MassOf mass_of() const {
    return [this](std::int64_t tag) { return granules.at(tag); };
  }
  void touch(std::int64_t a, std::int64_t b) { contacts.add(a, b, nullptr); }
  void lock(std::int64_t tag) { bodies.lock(tag, granules.at(tag), contacts); }
  std::vector<int> unlock(const Tags& tags) {
    for (const std::int64_t tag : tags) bodies.unlock(tag, granules.at(tag), contacts);
    for (const std::int64_t tag : tags) contacts.erase(tag);
    return bodies.split(contacts, mass_of());
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

GranuleMass granule(double mass, const Vec3& position, double radius) { return {mass, position, radius}; }

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
    const GranuleMass& g = solid.granules.at(tag);
    p.add(g.mass, g.position, g.radius);
  }
  return p;
}

/// Inertia about the world's origin, from that about the centre of mass.
Eigen::Matrix3d about_origin(const MassProperties& p) {
  const Vec3 c = p.centre();
  return p.inertia() + p.mass * (c.squaredNorm() * Eigen::Matrix3d::Identity() - c * c.transpose());
}

void expect_same(const MassProperties& is, const MassProperties& due, double relative, const MassProperties& scale) {
  EXPECT_EQ(is.count, due.count);
  EXPECT_NEAR(is.mass, due.mass, relative * scale.mass);
  EXPECT_LE((is.first - due.first).norm(), relative * scale.first.norm());
  EXPECT_LE((is.second - due.second).norm(), relative * scale.second.norm());
  EXPECT_NEAR(is.spin, due.spin, relative * scale.spin);
}

/// Every body's figures are those of its granules, to the rounding of the whole.
void expect_right_figures(const Solid& solid) {
  const MassProperties whole = sum_of(solid, [&] {
    Tags all;
    for (const auto& g : solid.granules) all.insert(g.first);
    return all;
  }());
  const std::map<int, Tags> members = solid.members();
  ASSERT_EQ(members.size(), solid.bodies.size());
  for (const auto& m : members) {
    ASSERT_EQ(solid.bodies.bodies().count(m.first), 1u);
    expect_same(solid.bodies.properties(m.first), sum_of(solid, m.second), 1e-12, whole);
    for (const std::int64_t tag : m.second) ASSERT_EQ(solid.bodies.body_of(tag), m.first);
  }
}

// ------------------------------------------------------------------------------------------------------- mass properties

TEST(MassProperties, of_one_granule_are_those_of_a_homogeneous_sphere) {
  MassProperties p;
  p.add(2.0, Vec3(0.5, -1, 2), 0.3);
  EXPECT_EQ(p.count, 1);
  EXPECT_EQ(p.centre(), Vec3(0.5, -1, 2));
  EXPECT_LE((p.inertia() - 0.4 * 2.0 * 0.09 * Eigen::Matrix3d::Identity()).norm(), 1e-14);
}

TEST(MassProperties, of_a_dumbbell_follow_the_parallel_axis_theorem) {
  MassProperties p;
  p.add(1.0, Vec3(-1, 0, 0), 0.5);
  p.add(3.0, Vec3(1, 0, 0), 0.5);
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
    p.add(1e-5, x, 1e-3);
    due.add(1e-5, x, 1e-3);
  }
  const MassProperties scale = [&] {
    MassProperties s = due;
    s.first = Vec3::Constant(0.1 * s.mass);
    return s;
  }();
  for (int n = 0; n < 100000; ++n) {
    const Vec3 x = place();
    p.add(1e-5, x, 1e-3);
    p.add(1e-5, x, 1e-3, -1);
  }
  expect_same(p, due, 1e-12, scale);
}

TEST(MassProperties, of_the_parts_sum_to_the_whole) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> at(0, 0.1), radius(1e-3, 2e-3);
  MassProperties whole, parts[3], sum;
  for (int n = 0; n < 3000; ++n) {
    const double x = at(random), y = at(random), z = at(random), r = radius(random), m = 1e4 * r * r * r;
    whole.add(m, Vec3(x, y, z), r);
    parts[n % 3].add(m, Vec3(x, y, z), r);
  }
  for (const MassProperties& p : parts) sum.add(p);
  expect_same(sum, whole, 1e-12, whole);
  EXPECT_LE((sum.inertia() - whole.inertia()).norm(), 1e-12 * whole.inertia().norm());
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
  for (const MassProperties& p : parts) inertia += about_origin(p);
  EXPECT_LE((inertia - about_origin(whole)).norm(), 1e-12 * inertia.norm());
}

// ------------------------------------------------------------------------------------------------------------ lock and merge

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
    EXPECT_TRUE(solid.bodies.take_merges().empty());
    solid.lock(4);
    EXPECT_EQ(solid.bodies.body_of(2), large);
    EXPECT_EQ(solid.bodies.body_of(4), large);
    EXPECT_EQ(solid.bodies.take_merges(), (std::vector<std::pair<int, int>>{{large, small}}));
    EXPECT_TRUE(solid.bodies.take_merges().empty());
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
  EXPECT_EQ(solid.bodies.take_merges().size(), 5u);
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
  const MassProperties before = solid.bodies.properties(solid.bodies.body_of(1));
  solid.unlock({20, 50, 51, 90});
  MassProperties after = sum_of(solid, {20, 50, 51, 90});
  for (const auto& b : solid.bodies.bodies()) after.add(b.second);
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

}  // namespace
}  // namespace solidcull
