#include <gtest/gtest.h>

#include <map>
#include <set>

#include "world_parts.h"

namespace solidcull {
namespace {

/// What is true of a granule that is an atom.
struct State {
  Vec3 place, velocity, spin;
  double colour;
  SmallAtoms::Histories histories;
  bool operator==(const State& o) const {
    return place == o.place && velocity == o.velocity && spin == o.spin && colour == o.colour && histories == o.histories;
  }
};

/// The same to the last bit; histories of contacts between two granules that were stored may have lost 1e-12 of themselves.
void expect_no_op(const State& now, const State& then, int tag, const std::set<int>& stored) {
  State rest = now;
  ASSERT_EQ(now.histories.size(), then.histories.size()) << tag;
  for (const auto& [partner, due] : then.histories) {
    ASSERT_EQ(now.histories.count(partner), 1u) << tag << ' ' << partner;
    const auto& is = now.histories.at(partner);
    if (stored.count(tag) && stored.count(static_cast<int>(partner))) {
      ASSERT_EQ(is.size(), due.size());
      EXPECT_LE((vec(is.data()) - vec(due.data())).norm(), 1e-12 * vec(due.data()).norm()) << tag << ' ' << partner;
    } else {
      EXPECT_TRUE(is == due) << tag << ' ' << partner;
    }
  }
  rest.histories = then.histories;
  EXPECT_TRUE(rest == then) << tag;
}

/// A cluster of twelve that press on and shear each other, with motions that are not rigid; its contacts have histories.
struct Cluster {
  explicit Cluster(const Settings& settings = sleeping_settings(), int width = 3)
      : world(empty_space()), parts(world, settings, 2 * r) {
    world.contacts.width = width;
    parts.bed.solid.set_histories(world.contacts.flips(), world.contacts.vectors());
    for (int n = 0; n < 12; ++n) {
      const Vec3 at = 0.98 * 2 * r * Vec3(n % 3, n / 3 % 2, n / 6) + Vec3(0.1, -0.2, 0.3);
      world.add(n + 1, at, r, 1e-4 * Vec3(n % 5, n % 2, 0.3 * n), 0.01 * Vec3(0.7 * n, n % 3, 1));
      tags.push_back(n + 1);
    }
    world.begin_run(nullptr);
    world.steps(nullptr, 5);
    for (int n = 1; n <= 12; ++n) before[n] = state(n);
  }
  State state(int tag) {
    const int i = world.at(tag);
    return {world.atoms.place(i), world.atoms.velocity(i), world.atoms.spin(i), world.atoms.colour[static_cast<std::size_t>(i)],
            world.atoms.histories(i)};
  }
  void lock() {
    parts.lock(tags);
    world.contacts.build();  // the engine keeps no history of pairs that have left its lists
    parts.leave_out();
  }
  void wake_all() {
    Wakes wakes;
    wakes.all = Woke::deck;
    parts.change(wakes, {});
  }

  SmallWorld world;
  WorldParts parts;
  std::vector<std::int64_t> tags;
  std::map<int, State> before;
};

TEST(StoreExchange, locked_stored_and_restored_in_one_step_is_a_no_op) {
  for (const bool some_stored : {false, true}) {
    Cluster c;
    std::size_t pairs = 0;
    for (const auto& s : c.before) pairs += s.second.histories.size();
    ASSERT_GE(pairs, 2u * 15u);
    c.lock();
    ASSERT_EQ(c.parts.bed.solid.bodies().size(), 1u);
    for (int n = 1; n <= 12; ++n) EXPECT_TRUE(c.world.atoms.histories(c.world.at(n)).empty()) << n;
    const std::set<int> stored = some_stored ? std::set<int>{2, 3, 5, 7, 11, 12} : std::set<int>();
    if (some_stored) c.parts.put_away({2, 3, 5, 7, 11, 12});
    EXPECT_EQ(c.world.atoms.owned, some_stored ? 6 : 12);
    c.wake_all();
    ASSERT_EQ(c.world.atoms.owned, 12);
    EXPECT_EQ(c.parts.bed.solid.locked(), 0u);
    EXPECT_EQ(c.parts.bed.solid.contacts().size(), 0u);
    for (int n = 1; n <= 12; ++n) expect_no_op(c.state(n), c.before[n], n, stored);
    EXPECT_EQ(c.parts.bed.solid.ledger().granules_locked(), 12);
    EXPECT_EQ(c.parts.bed.solid.ledger().granules_restored(), 12);
  }
}

TEST(StoreExchange, without_histories_too) {
  Cluster c(sleeping_settings(), 0);
  c.lock();
  ASSERT_EQ(c.parts.bed.solid.bodies().size(), 12u);  // nothing ties them but what the survey says touches
  c.parts.put_away({2, 3, 5});
  c.wake_all();
  for (int n = 1; n <= 12; ++n) EXPECT_TRUE(c.state(n) == c.before[n]) << n;
}

TEST(StoreExchange, a_compact_store_gives_motion_back_to_the_bit_and_histories_nearly) {
  Settings settings = sleeping_settings();
  settings.store = Store::compact;
  Cluster c(settings);
  c.lock();
  c.parts.put_away({2, 3, 5, 7, 11, 12});
  c.wake_all();
  for (int n = 1; n <= 12; ++n) {
    const State now = c.state(n), &then = c.before[n];
    EXPECT_EQ(now.place, then.place) << n;
    EXPECT_EQ(now.velocity, then.velocity) << n;
    EXPECT_EQ(now.spin, then.spin) << n;
    ASSERT_EQ(now.histories.size(), then.histories.size()) << n;
    for (const auto& [partner, h] : then.histories)
      EXPECT_LE((vec(now.histories.at(partner).data()) - vec(h.data())).norm(), 0.01 * vec(h.data()).norm())
          << n << ' ' << partner;
  }
}

TEST(StoreExchange, a_granule_that_comes_back_later_has_its_bodys_motion_and_its_opaque_columns) {
  Cluster c;
  c.lock();
  c.parts.put_away({2, 3, 5});
  c.parts.bed.solid.body(c.parts.body_of(1)).shift(Vec3(0.001, 0, 0));
  ++c.world.run.step;
  EXPECT_GT(c.parts.exchange.forget_past_motions(), 0u);  // the motions of single granules are forgotten: the body has them
  const SolidBody& body = c.parts.bed.solid.bodies().body(c.parts.body_of(3));
  const int i = c.parts.exchange.bring_back(3);
  EXPECT_EQ(c.world.at(3), i);
  EXPECT_LT((c.world.atoms.place(i) - c.before[3].place - Vec3(0.001, 0, 0)).norm(), 1e-15);
  EXPECT_EQ(c.world.atoms.velocity(i), body.twist.at(body.pose.to_world(c.parts.bed.shell[i].place)));
  EXPECT_EQ(c.world.atoms.spin(i), body.twist.spin);
  EXPECT_EQ(c.world.atoms.colour[static_cast<std::size_t>(i)], c.before[3].colour);
  EXPECT_TRUE(c.world.atoms.is_interface(i));
  EXPECT_EQ(c.parts.bed.index.at(3), i);
}

TEST(StoreExchange, the_index_of_tags_follows_when_atoms_take_other_indices) {
  Cluster c;
  c.lock();
  for (const std::int64_t tag : {1, 12, 6, 4}) {
    c.parts.exchange.put_away(c.parts.bed.index.at(tag));
    EXPECT_FALSE(c.parts.bed.index.contains(tag));
    for (int i = 0; i < c.world.atoms.owned; ++i) EXPECT_EQ(c.parts.bed.index.at(c.world.atoms.tag[i]), i);
  }
  c.parts.exchange.bring_back(12);
  for (int i = 0; i < c.world.atoms.owned; ++i) EXPECT_EQ(c.parts.bed.index.at(c.world.atoms.tag[i]), i);
  EXPECT_THROW(c.parts.bed.index.at(1), InternalError);
}

TEST(ContactFreezing, histories_turn_with_the_body) {
  Cluster c;
  c.lock();
  c.parts.put_away({2, 3, 5, 7});
  SolidBody& body = c.parts.bed.solid.body(c.parts.body_of(1));
  body.kick(Vec3::Zero(), Vec3(3e-4, 6e-4, -5e-4), 0.01);
  for (int n = 0; n < 2000; ++n) body.drift(1e-4);
  body.take_twist();
  const Eigen::Matrix3d turn = body.pose.turn();
  ASSERT_GT((turn - Eigen::Matrix3d::Identity()).norm(), 0.5);  // far round
  const Pose pose = body.pose;
  const Twist twist = body.twist;
  c.world.run.step += 2000;
  c.parts.motion.refresh();
  c.parts.motion.place();
  c.wake_all();
  for (int n = 1; n <= 12; ++n) {
    const State now = c.state(n), &then = c.before[n];
    EXPECT_LT((now.place - pose.to_world(then.place)).norm(), 1e-12) << n;
    EXPECT_LT((now.velocity - twist.at(pose.to_world(then.place))).norm(), 1e-12) << n;
    ASSERT_EQ(now.histories.size(), then.histories.size()) << n;
    for (const auto& [partner, h] : then.histories)
      EXPECT_LE((vec(now.histories.at(partner).data()) - turn * vec(h.data())).norm(), 1e-12 * vec(h.data()).norm())
          << n << ' ' << partner;
  }
}

TEST(ContactFreezing, a_granule_that_wakes_alone_takes_its_contacts_along) {
  Cluster c;
  c.lock();
  c.parts.put_away({2, 3, 5, 7});
  Wakes wakes;
  wakes.balls.push_back({c.before[5].place, 0.1 * r});
  c.parts.change(wakes, {});
  EXPECT_FALSE(c.parts.body_of(5));
  ASSERT_GE(c.world.at(5), 0);
  expect_no_op(c.state(5), c.before[5], 5, {2, 3, 5, 7});
  // atoms that it touches have the contact too; what is stored is not asked (the shell's closure brings it out before)
  for (const auto& [partner, h] : c.before[5].histories) {
    const int i = c.world.at(partner);
    if (i < 0) continue;
    const SmallAtoms::Histories& theirs = c.world.atoms.histories(i);
    ASSERT_EQ(theirs.size(), 1u) << partner;
    EXPECT_EQ(vec(theirs.at(5).data()), Vec3(-vec(h.data()))) << partner;
  }
}

/// Three in a row that press on each other; the first two are a body.
struct Neighbour {
  Neighbour() : world(empty_space()), parts(world, sleeping_settings(), 2 * r) {
    for (int n = 0; n < 3; ++n) world.add(n + 1, Vec3(0.99 * 2 * r * n, 0, 0), r);
    world.reneighbour();
    world.compute_forces();
    parts.lock({1, 2});
    parts.reneighbour();
    parts.compute_forces();
  }
  double load_change(int tag) { return parts.bed.shell[world.at(tag)].load_change.norm(); }
  void step() {
    ++world.run.step;
    parts.compute_forces();
  }
  SmallWorld world;
  WorldParts parts;
};

TEST(ContactFreezing, a_contact_that_goes_inside_or_comes_out_is_no_change_of_load) {
  Neighbour n;
  const double press = 0.02 * r * n.world.deck.stiffness;
  n.step();
  EXPECT_LT(n.load_change(2), 1e-12 * press);
  n.parts.lock({3});  // the contact of 2 and 3 goes inside
  ASSERT_EQ(n.parts.body_of(3), n.parts.body_of(1));
  n.parts.reneighbour();
  n.step();
  EXPECT_FALSE(n.world.contacts.listed(2, 3));
  EXPECT_LT(n.load_change(2), 1e-12 * press);
  Wakes wakes;  // and comes out
  wakes.balls.push_back({n.world.atoms.place(n.world.at(3)), 0.1 * r});
  n.parts.change(wakes, {});
  n.parts.reneighbour();
  n.step();
  ASSERT_TRUE(n.world.contacts.listed(2, 3));
  EXPECT_LT(n.load_change(2), 1e-12 * press);
  // but a load that is really another one is seen
  n.world.atoms.set_place(n.world.at(3), n.world.atoms.place(n.world.at(3)) + Vec3(1e-4, 0, 0));
  n.step();
  EXPECT_NEAR(n.load_change(2), 0.5 * press * 2, 1e-9);
}

}  // namespace
}  // namespace solidcull
