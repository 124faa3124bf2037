#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <map>
#include <random>
#include <set>

#include "contacts_in_store.h"
#include "packed_history.h"
#include "solid_state.h"

namespace solidcull {
namespace {

using Tags = std::set<std::int64_t>;

/// A compact store with the graph and the bodies that ask it, and all that it holds kept beside it: granules that go in and out
/// as the fix has them do it.
struct StoreOfPacking {
  SolidBodies bodies;
  FrozenContacts contacts;
  GranuleStore store;
  std::map<std::int64_t, StoredGranule> granules;  // stored or not
  Vec3 periods = Vec3::Zero();

  explicit StoreOfPacking(double cell) : store(cell, GranuleStore::Precision::rounded) {
    contacts.set_layout(std::vector<bool>(6, true));
    contacts.set_elsewhere([this](std::int64_t tag, std::vector<std::int64_t>& partners) {
      contacts_in_store(store, bodies, tag, SolidStateLaw::gap, partners);
    });
    bodies.set_elsewhere([this](std::int64_t tag) { return store.body_of(tag); });
  }
  StoreOfPacking(const StoreOfPacking&) = delete;

  void set_periods(const Vec3& p) { bodies.set_periods(periods = p); }
  bool touch(const StoredGranule& a, const StoredGranule& b) const {
    Vec3 apart = bodies.pose(a.body).turned_to_world(b.position - a.position);
    for (int d = 0; d < 3; ++d)
      if (periods[d] > 0) apart[d] -= periods[d] * std::round(apart[d] / periods[d]);
    return apart.norm() <= (1 + SolidStateLaw::gap) * (a.radius + b.radius);
  }
  Tags around(std::int64_t tag) const {
    Tags partners;
    for (const auto& [other, g] : granules)
      if (other != tag && g.body == granules.at(tag).body && touch(granules.at(tag), g)) partners.insert(other);
    return partners;
  }
  Tags listed(std::int64_t tag) const {
    Tags partners;
    contacts.for_each_partner(tag, [&](std::int64_t p) { EXPECT_TRUE(partners.insert(p).second) << p << " is listed twice"; });
    Tags again;
    contacts.for_each(tag, [&](std::int64_t p, const double*) { again.insert(p); });
    EXPECT_EQ(again, partners);
    return partners;
  }
  void expect_right_graph() const {
    for (const auto& g : granules) EXPECT_EQ(listed(g.first), around(g.first)) << "granule " << g.first;
  }

  void lock(const StoredGranule& g) {
    granules[g.tag] = g;
    bodies.take_in(g.tag, g.body);
  }
  void tie_all() {
    const std::vector<double> history(contacts.width(), 0.5);
    for (const auto& g : granules)
      for (const std::int64_t partner : around(g.first)) contacts.add(g.first, partner, history.data());
  }
  void put_away(std::int64_t tag) {
    double tag_word;  // as the engine packs its ints
    std::memcpy(&tag_word, &tag, sizeof tag);
    const std::vector<double> record = {0, 0, 0, tag_word, granules.at(tag).radius, 2500, granules.at(tag).mass, 1, 1};
    store.add(granules.at(tag), record.data(), static_cast<int>(record.size()));
    contacts.drop(tag, [&](std::int64_t partner) { return store.contains(partner); });
    bodies.leave(tag);
  }
  void bring_back(std::int64_t tag) {
    contacts.for_each_elsewhere(tag, [&](std::int64_t partner) { contacts.add(tag, partner, nullptr); });
    bodies.take_in(tag, store.body_of(tag));
    std::vector<double> record;
    store.take(tag, record);
  }
};

StoredGranule granule(std::int64_t tag, int body, const Vec3& position, double radius) {
  StoredGranule g;
  g.tag = tag;
  g.body = body;
  g.type = 1;
  g.position = position;
  g.radius = radius;
  g.mass = 1e4 * radius * radius * radius;
  return g;
}

/// n^3 granules of diameter 1 at random, as dense as a bed, in a cube.
void fill(StoreOfPacking& p, int n, int bodies, unsigned seed) {
  std::mt19937 random(seed);
  const double edge = n * std::cbrt(0.5236 / 0.6);
  std::uniform_real_distribution<double> at(0, edge), size(0.35, 0.5);
  for (int b = 0; b < bodies; ++b) p.bodies.found(SolidBody());
  for (int tag = 1; tag <= n * n * n; ++tag) {
    const double x = at(random), y = at(random), z = at(random);
    p.lock(granule(tag, 1 + tag % bodies, Vec3(x, y, z), size(random)));
  }
  p.tie_all();
}

TEST(ContactsInStore, the_graph_is_the_same_wherever_its_granules_are) {
  for (const int bodies : {1, 3}) {
    StoreOfPacking p(2.0);
    fill(p, 7, bodies, 1);
    p.expect_right_graph();
    std::mt19937 random(2);
    for (int step = 0; step < 3000; ++step) {
      const std::int64_t tag = 1 + static_cast<std::int64_t>(random() % p.granules.size());
      p.store.contains(tag) ? p.bring_back(tag) : p.put_away(tag);
      if (step % 500 == 0) p.expect_right_graph();
    }
    for (const auto& g : p.granules)
      if (!p.store.contains(g.first)) p.put_away(g.first);
    p.expect_right_graph();
    EXPECT_EQ(p.contacts.size(), 0u) << "the store has them all";
  }
}

TEST(ContactsInStore, bodies_that_share_a_frame_are_told_apart) {
  StoreOfPacking p(2.0);
  fill(p, 6, 2, 3);
  p.store.share(1, true);
  p.store.share(2, true);
  for (const auto& g : p.granules) p.put_away(g.first);
  p.expect_right_graph();
}

TEST(ContactsInStore, what_comes_back_touches_its_neighbours_without_history_and_atoms_keep_theirs) {
  StoreOfPacking p(2.0);
  p.bodies.found(SolidBody());
  for (int tag = 1; tag <= 4; ++tag) p.lock(granule(tag, 1, Vec3(tag, 0, 0), 0.5));
  p.tie_all();
  for (const int tag : {1, 2, 3}) p.put_away(tag);
  EXPECT_EQ(p.contacts.size(), 1u) << "between 3, in the store, and 4";
  p.bring_back(2);
  EXPECT_EQ(p.contacts.size(), 3u);
  const auto has_history = [&](std::int64_t a, std::int64_t b) {
    bool has = false;
    p.contacts.for_each(a, [&](std::int64_t partner, const double* h) { has = has || (partner == b && h); });
    return has;
  };
  EXPECT_FALSE(has_history(2, 1));
  EXPECT_FALSE(has_history(2, 3));
  EXPECT_TRUE(has_history(3, 4));
  EXPECT_TRUE(has_history(4, 3));
}

TEST(ContactsInStore, touching_is_within_the_gap_of_solid_state) {
  StoreOfPacking p(2.0);
  p.bodies.found(SolidBody());
  p.lock(granule(1, 1, Vec3::Zero(), 0.5));
  p.lock(granule(2, 1, Vec3(1 + 0.99 * SolidStateLaw::gap, 0, 0), 0.5));
  p.lock(granule(3, 1, Vec3(0, 1 + 1.01 * SolidStateLaw::gap, 0), 0.5));
  for (const int tag : {1, 2, 3}) p.put_away(tag);
  EXPECT_EQ(p.listed(1), Tags{2});
  EXPECT_EQ(p.listed(3), Tags{});
}

TEST(ContactsInStore, a_body_touches_itself_through_periodic_sides_however_it_was_put_together) {
  // a row of 10 around a box of 10, and a second one beside it whose places begin two periods further on; the frame is turned
  for (const double angle : {0.0, 0.7}) {
    StoreOfPacking p(2.0);
    p.set_periods(Vec3(10, 0, 0));
    SolidBody body;
    body.pose = Pose(Vec3(3, 4, 5), Eigen::Quaterniond(Eigen::AngleAxisd(angle, Vec3(1, 2, 3).normalized())));
    p.bodies.found(body);
    for (int k = 0; k < 10; ++k) {
      p.lock(granule(1 + k, 1, body.pose.turned_to_frame(Vec3(k, 0, 0)), 0.5));
      p.lock(granule(11 + k, 1, body.pose.turned_to_frame(Vec3(k + 20, 1, 0)), 0.5));
    }
    for (const auto& g : p.granules) p.put_away(g.first);
    EXPECT_EQ(p.listed(1), (Tags{2, 10, 11}));
    p.expect_right_graph();
  }
}

TEST(ContactsInStore, bodies_that_meet_are_one_at_once) {
  StoreOfPacking p(2.0);
  const auto mass_of = [&](std::int64_t tag) {
    return GranuleMass{p.granules.at(tag).mass, p.granules.at(tag).position, p.granules.at(tag).radius};
  };
  for (const int body : {1, 2}) {
    SolidBody b;
    b.mass.add({1, Vec3(body, 0, 0), 0.5}, 0.5);
    p.bodies.found(b);
  }
  p.store.share(1, true);
  p.store.share(2, true);
  for (const int tag : {1, 2}) {
    p.lock(granule(tag, tag, Vec3(tag, 0, 0), 0.5));
    p.put_away(tag);
  }
  EXPECT_EQ(p.listed(1), Tags{});
  p.bodies.join(1, 2, mass_of);
  EXPECT_EQ(p.bodies.body_of(1), p.bodies.body_of(2));
  EXPECT_EQ(p.listed(1), Tags{2});
}

TEST(ContactsInStore, a_body_comes_apart_where_what_was_stored_goes) {
  // a bar of 3 x 3 x 20 with its middle layer taken out
  StoreOfPacking p(2.0);
  SolidBody body;
  for (int k = 0; k < 180; ++k) body.mass.add({1, Vec3(k / 9, k / 3 % 3, k % 3), 0.5}, 0.5);
  p.bodies.found(body);
  for (int k = 0; k < 180; ++k) {
    StoredGranule g = granule(k + 1, 1, Vec3(k / 9, k / 3 % 3, k % 3), 0.5);
    g.mass = 1;
    p.lock(g);
  }
  p.tie_all();
  for (int tag = 1; tag <= 180; ++tag) p.put_away(tag);
  const auto mass_of = [&](std::int64_t tag) {
    const StoredGranule g = p.store.contains(tag) ? p.store.get(tag) : p.granules.at(tag);
    return GranuleMass{g.mass, g.position, g.radius};
  };
  std::vector<std::int64_t> middle;
  for (int tag = 64; tag <= 72; ++tag) middle.push_back(tag);
  for (const std::int64_t tag : middle) p.bring_back(tag);
  for (const std::int64_t tag : middle) p.bodies.unlock(tag, mass_of(tag), p.contacts);
  for (const std::int64_t tag : middle) p.contacts.erase(tag);
  Tags off;
  p.bodies.split(p.contacts, mass_of, [&](std::int64_t tag, int number, const Vec3& place) {
    off.insert(tag);
    p.store.move(tag, number, place);
  });
  EXPECT_EQ(off.size(), 63u) << "the shorter end";
  EXPECT_EQ(*off.rbegin(), 63);
  ASSERT_EQ(p.bodies.size(), 2u);
  EXPECT_EQ(p.bodies.body(p.bodies.body_of(1)).mass.count, 63);
  EXPECT_EQ(p.bodies.body(p.bodies.body_of(180)).mass.count, 108);
  EXPECT_NE(p.bodies.body_of(1), p.bodies.body_of(180));
  EXPECT_EQ(p.bodies.body_of(66), 0);
}

TEST(ContactsInStore, a_granule_of_a_few_kinds_takes_no_more_than_68_bytes_in_all) {
  // 27,000, locked and tied all at once, of two sizes, with 2.2 histories each; every tenth has its own change of load
  StoreOfPacking p(2.0);
  PackedHistory packed;
  packed.set_layout(6, {0, 3});
  p.bodies.found(SolidBody());
  std::mt19937 random(4);
  std::uniform_real_distribution<double> load(0, 1);
  const int n = 30;
  const double spacing = std::cbrt(0.5236 / 0.6);
  for (int k = 0; k < n * n * n; ++k) {
    StoredGranule g = granule(k + 1, 1, spacing * Vec3(k / (n * n), k / n % n, k % n), k % 2 ? 0.5 : 0.48);
    if (k % 10 == 0) g.load_change = Vec3(load(random), load(random), load(random));
    p.lock(g);
  }
  const std::vector<double> history(p.contacts.width(), 0.5);
  for (int k = 0; k < n * n * n; ++k)
    for (const int step : {1, n, n * n})
      if (k + step < n * n * n) p.contacts.add(k + 1, k + 1 + step, history.data());
  const double before = static_cast<double>(p.contacts.memory_bytes() + p.bodies.member_bytes()) / (n * n * n);
  for (int tag = 1; tag <= n * n * n; ++tag) {
    p.put_away(tag);
    std::vector<std::uint64_t> tail;
    for (int k = 0; k < 2 + (tag % 5 == 0); ++k) {
      const double own[6] = {0, load(random), load(random), 0, load(random), load(random)};
      packed.pack(tag + k, own, Vec3(1, 0, 0), tail);
    }
    p.store.set_tail(*p.store.find(tag), tail);
  }
  p.contacts.fit();
  p.bodies.fit();
  const double store = p.store.bytes_per_granule(), contacts = static_cast<double>(p.contacts.memory_bytes()) / (n * n * n),
               members = static_cast<double>(p.bodies.member_bytes()) / (n * n * n);
  std::printf("store %.1f, contacts %.1f, members %.1f bytes per granule (contacts and members before: %.1f)\n", store, contacts,
              members, before);
  EXPECT_LE(store + contacts + members, 68);
  for (int tag = 1; tag <= n * n * n; ++tag) {
    const StoredGranule is = p.store.get(tag), due = p.store.rounded(p.granules.at(tag));
    ASSERT_EQ(is.position, due.position);
    ASSERT_LE((is.position - p.granules.at(tag).position).cwiseAbs().maxCoeff(), std::ldexp(2.0, -26));
    ASSERT_EQ(is.radius, due.radius);
    ASSERT_EQ(is.mass, due.mass);
    ASSERT_EQ(is.normal_load, due.normal_load);
    ASSERT_EQ(is.load_change, due.load_change);
  }
}

TEST(ContactsInStore, loads_are_rounded_by_less_than_a_five_hundredth) {
  const GranuleStore store(1.0, GranuleStore::Precision::rounded);
  StoredGranule g = granule(1, 1, Vec3::Zero(), 0.5);
  g.normal_load = 0.123456789123;
  g.load_change = Vec3(1e-7, -0.3, 12.3456789);
  const StoredGranule r = store.rounded(g);
  EXPECT_NEAR(r.normal_load, g.normal_load, g.normal_load / 512);
  for (int d = 0; d < 3; ++d) EXPECT_NEAR(r.load_change[d], g.load_change[d], std::abs(g.load_change[d]) / 512);
  EXPECT_EQ(store.rounded(r).load_change, r.load_change);
  g.normal_load = -1;  // not known
  EXPECT_EQ(store.rounded(g).normal_load, -1);
  EXPECT_EQ(GranuleStore(1.0).rounded(g).load_change, g.load_change);
}

TEST(ContactsInStore, a_place_that_a_compact_store_cannot_tell_is_refused_and_nothing_is_changed) {
  GranuleStore store(1.0, GranuleStore::Precision::rounded);
  EXPECT_THROW(store.add(granule(1, 1, Vec3(0, 40000, 0), 0.5), nullptr, 0), std::range_error);
  EXPECT_EQ(store.size(), 0u);
  EXPECT_FALSE(store.contains(1));
  store.add(granule(1, 1, Vec3(0, -32767, 0.25), 0.5), nullptr, 0);
  EXPECT_THROW(store.move(1, 2, Vec3(0, 40000, 0)), std::range_error);
  EXPECT_EQ(store.body_of(1), 1);
  EXPECT_EQ(store.find(1)->position, Vec3(0, -32767, 0.25));
}

}  // namespace
}  // namespace solidcull
