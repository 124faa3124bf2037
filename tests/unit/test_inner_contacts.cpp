#include <gtest/gtest.h>

#include <map>
#include <random>
#include <set>

#include "exact_contacts.h"
#include "packed_history.h"
#include "rounded_contacts.h"
#include "solid.h"
#include "solid_state.h"

namespace solidcull {
namespace {

constexpr std::size_t width = 7;  // a vector, a number that changes sign with the side, a vector

Settings settings_of(Store store) {
  Settings s;
  s.store = store;
  return s;
}

/// A body whose granules, of several sizes, go in and out of a store, with its contacts kept beside it.
struct Packing {
  using Numbers = std::vector<double>;
  std::mt19937 random;
  Store store;
  Scales scales;
  Solid solid;
  std::map<std::int64_t, StoredGranule> granules;
  std::map<std::pair<std::int64_t, std::int64_t>, Numbers> contacts;  // as the lower tag sees it; empty: no history
  std::set<std::int64_t> stored;
  Vec3 periods;
  int body;

  /// out_of_plane: of the vectors' own size.
  Packing(Store of, unsigned seed, int n, const Vec3& edges, double out_of_plane = 0)
      : random(seed), store(of), scales(settings_of(of)), solid(scales), periods(edges) {
    scales.set(1.0, 9.81);
    solid.set_histories({true, true, true, true, false, false, false}, {0, 4});
    solid.set_types(1);
    solid.set_periods(periods);
    solid.open_store();
    solid.pack_contacts_from(0);
    SolidBody b;
    b.grounded = true;
    body = solid.found(b);
    const double size = 0.8 * std::cbrt(n);
    for (int tag = 1; tag <= n; ++tag) {
      StoredGranule g;
      g.tag = tag;
      g.type = 1;
      g.body = body;
      g.radius = 0.4 + 0.2 * share();
      g.mass = g.radius;
      g.position = size * Vec3(share(), share(), share());
      granules[tag] = solid.store().rounded(g);
      solid.take_in(tag, body, {granules[tag].position, granules[tag].radius});
    }
    for (const auto& [a, g] : granules)
      for (const auto& [c, h] : granules) {
        if (a >= c) continue;
        const Vec3 apart = solid.nearest_image(h.position, g.position) - g.position;
        const double gap = apart.norm() / (g.radius + h.radius) - 1;
        if (gap > SolidStateLaw::gap) continue;
        Numbers history;
        if (share() > 0.2) {
          const Vec3 out = out_of_plane * apart.normalized();
          const Vec3 shear = in_plane(apart, 1e-6), torque = in_plane(apart, 1e-8) + 1e-8 * out;
          history = {shear[0], shear[1], shear[2], share() - 0.5, torque[0], torque[1], torque[2]};
        }
        contacts[{a, c}] = history;
        solid.freeze_in_frame(a, c, history.empty() ? nullptr : history.data());
      }
  }
  double share() { return std::uniform_real_distribution<double>(0, 1)(random); }
  Vec3 in_plane(const Vec3& normal, double size) {
    const Vec3 v(share() - 0.5, share() - 0.5, share() - 0.5), n = normal.normalized();
    return size * (v - v.dot(n) * n);
  }
  void put_away(std::int64_t tag) {
    solid.put_away(granules.at(tag), {1, 2, static_cast<double>(tag)}, {}, {});
    stored.insert(tag);
  }
  void bring_back(std::int64_t tag) {
    std::vector<double> record;
    EXPECT_EQ(solid.bring_back(tag, record).position, granules.at(tag).position);
    stored.erase(tag);
  }
  /// What a store of this kind may lose of a vector, in its own size.
  double rounding() const { return store == Store::compact ? 0.01 : 5e-13; }
  /// Each contact of the graph and of the store once from each side. off: of vectors, in their own size.
  void expect_all_in(const Solid& solid, double off, const Eigen::Matrix3d& turn = Eigen::Matrix3d::Identity()) {
    for (const auto& one : granules) {
      const std::int64_t tag = one.first;
      std::set<std::int64_t> partners;
      const auto see = [&](std::int64_t partner, const double* history) {
        EXPECT_TRUE(partners.insert(partner).second) << tag << " and " << partner << " touch twice";
        const auto due = contacts.find({std::min(tag, partner), std::max(tag, partner)});
        ASSERT_NE(due, contacts.end()) << tag << " and " << partner;
        ASSERT_EQ(history != nullptr, !due->second.empty()) << tag << " and " << partner;
        if (!history) return;
        std::vector<double> is(history, history + width);
        if (tag > partner) solid.contacts().change_side(is.data());
        EXPECT_NEAR(is[3], due->second[3], store == Store::compact ? 2e-5 * std::abs(due->second[3]) : 0.0);
        for (const int v : {0, 4}) {
          const Vec3 vector = turn * Vec3(Eigen::Map<const Vec3>(due->second.data() + v));
          EXPECT_LE((Eigen::Map<const Vec3>(is.data() + v) - vector).norm(), off * vector.norm()) << tag << ' ' << partner;
        }
      };
      solid.contacts().for_each_here(tag, see);
      solid.contacts().for_each_elsewhere(tag, [&](std::int64_t partner) {
        double history[width];
        see(partner, solid.inner_history(*solid.store().find(tag), partner, history) ? history : nullptr);
      });
      std::size_t due = 0;
      for (const auto& c : contacts) due += c.first.first == tag || c.first.second == tag;
      EXPECT_EQ(partners.size(), due) << "contacts of " << tag;
    }
  }
};

class InnerContactsOf : public testing::TestWithParam<Store> {};
INSTANTIATE_TEST_SUITE_P(stores, InnerContactsOf, testing::Values(Store::exact, Store::compact),
                         [](const auto& of) { return of.param == Store::exact ? "exact" : "compact"; });

TEST_P(InnerContactsOf, what_goes_in_and_out_keeps_its_contacts) {
  for (const Vec3& periods : {Vec3(0, 0, 0), Vec3(4.9, 0, 5.1)}) {
    Packing p(GetParam(), 1, 200, periods);
    ASSERT_GT(p.contacts.size(), 500u);
    p.expect_all_in(p.solid, 1e-14);
    for (int turn = 0; turn < 1500; ++turn) {
      const std::int64_t tag = 1 + static_cast<std::int64_t>(p.share() * 200);
      if (p.stored.count(tag))
        p.bring_back(tag);
      else
        p.put_away(tag);
      if (turn % 250 == 249) p.expect_all_in(p.solid, p.rounding());
    }
    for (const auto& g : p.granules)
      if (!p.stored.count(g.first)) p.put_away(g.first);
    EXPECT_EQ(p.solid.contacts().size(), 0u);
    p.expect_all_in(p.solid, p.rounding());
    for (const auto& g : p.granules) p.bring_back(g.first);
    EXPECT_EQ(p.solid.contacts().size(), p.contacts.size());
    p.expect_all_in(p.solid, p.rounding());
  }
}

TEST_P(InnerContactsOf, histories_turn_with_a_body_that_is_swallowed) {
  Packing p(GetParam(), 2, 150, Vec3::Zero());
  for (const auto& g : p.granules) p.put_away(g.first);
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.7, Vec3(1, 2, -3).normalized()).toRotationMatrix();
  GranuleStore& store = const_cast<GranuleStore&>(p.solid.store());  // as Solid::adopt_swallowed() has it
  std::unique_ptr<InnerContacts> inner;
  if (p.store == Store::compact)
    inner = std::make_unique<RoundedContacts>(store, p.solid.bodies());
  else
    inner = std::make_unique<ExactContacts>(store, p.solid.bodies());
  inner->set_layout(p.solid.contacts().layout(), p.solid.contacts().vectors());
  inner->turn(p.body, turn);
  for (const auto& g : p.granules) store.move(g.first, p.body, turn * g.second.position + Vec3(7, -3, 0.1));
  p.expect_all_in(p.solid, 2 * p.rounding(), turn);
}

TEST_P(InnerContactsOf, a_granule_that_arrives_with_its_contacts_is_as_one_that_was_put_away) {
  Packing p(GetParam(), 3, 150, Vec3::Zero());
  Scales scales(settings_of(p.store));
  scales.set(1.0, 9.81);
  Solid arrived(scales);
  arrived.set_histories(p.solid.contacts().layout(), p.solid.contacts().vectors());
  arrived.set_types(1);
  arrived.open_store();
  arrived.pack_contacts_from(0);
  SolidBody body;
  body.grounded = true;
  const int number = arrived.found(body);
  ContactList contacts(width);
  for (const auto& [tag, granule] : p.granules) {
    contacts.clear();
    for (const auto& [pair, history] : p.contacts)
      if (pair.second == tag) {
        std::vector<double> own = history;
        if (!own.empty()) arrived.contacts().change_side(own.data());
        contacts.add(pair.first, own.empty() ? nullptr : own.data());
      }
    StoredGranule g = granule;
    g.body = number;
    const double record[] = {1, 2, static_cast<double>(tag)};
    arrived.add_stored(g, record, 3, contacts);
  }
  EXPECT_EQ(arrived.contacts().size(), 0u);
  p.expect_all_in(arrived, p.rounding());
  for (const auto& g : p.granules) p.put_away(g.first);
  EXPECT_EQ(arrived.store().memory_bytes(), p.solid.store().memory_bytes());
}

TEST(InnerContacts, who_arrives_takes_away_what_it_would_be_confused_with) {
  std::int64_t alike = 3;
  while (!PackedHistory::alike(2, alike)) ++alike;
  Packing p(Store::compact, 4, 2, Vec3::Zero());
  StoredGranule g = p.granules.at(1);
  const double record[] = {1, 2, 3}, history[width] = {0, 1e-6, 0, 0.25, 0, 1e-8, 0};
  Scales scales(settings_of(p.store));
  scales.set(1.0, 9.81);
  Solid solid(scales);
  solid.set_histories(p.solid.contacts().layout(), p.solid.contacts().vectors());
  solid.set_types(1);
  solid.open_store();
  solid.pack_contacts_from(0);
  const int body = solid.found(SolidBody());
  ContactList contacts(width);
  const auto arrives = [&](std::int64_t tag, double x) {
    g.tag = tag;
    g.body = body;
    g.radius = 0.5;
    g.position = Vec3(x, 0, 0);
    solid.add_stored(g, record, 3, contacts);
  };
  const auto known = [&](std::int64_t tag, std::int64_t partner) {
    double numbers[width];
    return solid.inner_history(*solid.store().find(tag), partner, numbers);
  };
  arrives(2, 0);
  contacts.add(2, history);
  arrives(1, 1);
  EXPECT_TRUE(known(1, 2));
  EXPECT_TRUE(known(2, 1));
  contacts.clear();
  contacts.add(1, history);
  arrives(alike, 2);
  EXPECT_FALSE(known(1, 2));
  EXPECT_TRUE(known(1, alike));
  EXPECT_TRUE(known(alike, 1));
}

TEST(ExactContacts, vectors_out_of_the_plane_come_back_as_well) {
  for (const double out : {1e-9, 1e-3, 1.0, 1e6}) {
    Packing p(Store::exact, 5, 100, Vec3(4.9, 4.9, 4.9), out);
    for (const auto& g : p.granules) p.put_away(g.first);
    EXPECT_EQ(p.solid.contacts().size(), 0u);
    p.expect_all_in(p.solid, p.rounding());
  }
}

TEST(ExactContacts, a_small_bed_leaves_them_in_the_graph_and_a_larger_one_packs_what_comes_then) {
  Packing p(Store::exact, 5, 100, Vec3(4.9, 4.9, 4.9));
  p.solid.pack_contacts_from(60);
  const std::size_t all = p.solid.contacts().size();
  for (const std::int64_t upto : {59, 100}) {
    p.solid.expects(static_cast<std::size_t>(upto) - p.stored.size());
    for (std::int64_t tag = 1 + static_cast<std::int64_t>(p.stored.size()); tag <= upto; ++tag) p.put_away(tag);
    if (upto == 59) {
      EXPECT_EQ(p.solid.contacts().size(), all);
    }
  }
  EXPECT_LT(p.solid.contacts().size(), all);
  EXPECT_GT(p.solid.contacts().size(), 0u);
  p.expect_all_in(p.solid, p.rounding());
}

TEST(ExactContacts, a_bed_that_comes_to_rest_packs_them_and_what_a_wave_woke_leaves_them_in_the_graph) {
  Packing p(Store::exact, 11, 100, Vec3(4.9, 4.9, 4.9));
  p.solid.pack_contacts_from(60);
  p.solid.expects(100);
  for (const auto& g : p.granules) p.put_away(g.first);
  EXPECT_EQ(p.solid.contacts().size(), 0u);
  for (std::int64_t tag = 1; tag <= 30; ++tag) p.bring_back(tag);
  const std::size_t woken = p.solid.contacts().size();
  EXPECT_GT(woken, 0u);
  p.solid.expects(30);
  for (std::int64_t tag = 1; tag <= 30; ++tag) p.put_away(tag);
  EXPECT_EQ(p.solid.contacts().size(), woken);
  p.expect_all_in(p.solid, p.rounding());
  for (std::int64_t tag = 1; tag <= 40; ++tag) p.bring_back(tag);
  p.solid.expects(40);
  for (std::int64_t tag = 1; tag <= 40; ++tag) p.put_away(tag);
  EXPECT_EQ(p.solid.contacts().size(), 0u);
  p.expect_all_in(p.solid, p.rounding());
}

TEST(ExactContacts, who_arrives_in_a_small_bed_leaves_them_in_the_graph_too) {
  for (const std::size_t pack_from : {0, 101}) {
    Packing p(Store::exact, 13, 100, Vec3(0, 0, 0));
    p.solid.pack_contacts_from(pack_from);
    const std::size_t all = p.solid.contacts().size();
    const double record[] = {1, 2, 3};
    for (const auto& g : p.granules) p.solid.add_stored(g.second, record, 3);
    for (const auto& g : p.granules) p.solid.enter_store(g.first);
    EXPECT_EQ(p.solid.contacts().size(), pack_from == 0 ? 0 : all);
    p.expect_all_in(p.solid, p.rounding());
  }
}

TEST(CompactContacts, are_packed_by_the_handful_too) {
  Packing p(Store::compact, 12, 100, Vec3(0, 0, 0));
  for (const auto& g : p.granules) {
    p.solid.expects(1);
    p.put_away(g.first);
  }
  EXPECT_EQ(p.solid.contacts().size(), 0u);
  p.expect_all_in(p.solid, p.rounding());
}

TEST(ExactContacts, coming_and_going_again_changes_no_bit) {
  Packing p(Store::exact, 6, 150, Vec3(0, 4.9, 0), 1e-4);
  std::map<std::pair<std::int64_t, std::int64_t>, Packing::Numbers> first;
  for (int round = 0; round < 5; ++round) {
    // not in the same order: a contact waits with the later of its granules
    for (const auto& g : p.granules) p.put_away(round % 2 ? 151 - g.first : g.first);
    for (const auto& g : p.granules) p.bring_back(g.first);
    p.solid.contacts().for_each_contact([&](std::int64_t low, std::int64_t high, const double* history) {
      Packing::Numbers numbers;
      if (history) numbers.assign(history, history + width);
      auto& before = first[{low, high}];
      if (round == 0) before = numbers;
      ASSERT_EQ(before.size(), numbers.size());
      for (std::size_t d = 0; d < numbers.size(); ++d) EXPECT_EQ(before[d], numbers[d]) << low << ' ' << high;
    });
  }
}

/// Two granules, the second one at `x` with a contact whose history is given; what is in the graph then.
std::size_t left_in_the_graph(double x, const std::vector<double>& history, int other_body) {
  const Scales scales = [] {
    Scales s(settings_of(Store::exact));
    s.set(1.0, 9.81);
    return s;
  }();
  Solid solid(scales);
  solid.set_histories({true, true, true}, {0});
  solid.set_types(1);
  solid.open_store();
  solid.pack_contacts_from(0);
  const int body = solid.found(SolidBody());
  StoredGranule g;
  g.tag = 1;
  g.body = body;
  g.radius = 0.5;
  solid.add_stored(g, nullptr, 0, ContactList(3));
  g.tag = 2;
  g.position = Vec3(x, 0, 0);
  if (other_body) g.body = solid.found(SolidBody());
  ContactList contacts(3);
  contacts.add(1, history.data());
  solid.add_stored(g, nullptr, 0, contacts);
  std::vector<std::int64_t> partners;
  solid.contacts().for_each_partner(1, [&](std::int64_t partner) { partners.push_back(partner); });
  EXPECT_EQ(partners, std::vector<std::int64_t>{2});
  return solid.contacts().size();
}

TEST(ExactContacts, what_cannot_be_found_again_from_its_place_stays_in_the_graph) {
  EXPECT_EQ(left_in_the_graph(1.0, {0, 1, 2}, false), 0u);
  EXPECT_EQ(left_in_the_graph(1.2, {0, 1, 2}, false), 1u) << "too far";
  EXPECT_EQ(left_in_the_graph(0.0, {0, 1, 2}, false), 1u) << "in no direction";
  EXPECT_EQ(left_in_the_graph(1.0, {0, std::nan(""), 2}, false), 1u) << "no number";
  EXPECT_EQ(left_in_the_graph(1.0, {0, 1, 2}, true), 1u) << "another body";
}

TEST(ExactContacts, touching_without_history_stays_that) {
  const Scales scales = [] {
    Scales s(settings_of(Store::exact));
    s.set(1.0, 9.81);
    return s;
  }();
  Solid solid(scales);
  solid.set_types(1);
  solid.open_store();  // a contact model without history
  solid.pack_contacts_from(0);
  StoredGranule g;
  g.body = solid.found(SolidBody());
  g.radius = 0.5;
  ContactList contacts(0);
  for (g.tag = 1; g.tag <= 3; ++g.tag) {
    g.position = Vec3(static_cast<double>(g.tag), 0, 0);
    solid.add_stored(g, nullptr, 0, contacts);
    contacts.clear();
    contacts.add(g.tag, nullptr);
  }
  EXPECT_EQ(solid.contacts().size(), 0u);
  std::vector<double> record;
  solid.bring_back(2, record);
  EXPECT_EQ(solid.contacts().size(), 2u);
  EXPECT_TRUE(solid.contacts().contains(1, 2) && solid.contacts().contains(2, 3));
}

}  // namespace
}  // namespace solidcull
