#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <random>
#include <set>
#include <stdexcept>

#include "frozen_contacts.h"

namespace solidcull {
namespace {

using History = std::vector<double>;
using Pair = std::pair<std::int64_t, std::int64_t>;

/// Partner to history (empty: touching without history), as `tag` sees its contacts.
std::map<std::int64_t, History> seen_by(const FrozenContacts& contacts, std::int64_t tag) {
  std::map<std::int64_t, History> seen;
  contacts.for_each(tag, [&](std::int64_t partner, const double* h) {
    EXPECT_EQ(seen.count(partner), 0u) << "a contact is visited twice";
    seen[partner] = h ? History(h, h + contacts.width()) : History();
  });
  std::set<std::int64_t> partners;
  contacts.for_each_partner(tag, [&](std::int64_t partner) { partners.insert(partner); });
  EXPECT_EQ(partners.size(), seen.size());
  return seen;
}

FrozenContacts with_layout(std::vector<bool> flips) {
  FrozenContacts contacts;
  contacts.set_layout(std::move(flips));
  return contacts;
}

TEST(FrozenContacts, a_history_is_seen_by_its_giver_as_it_was_given) {
  const double h[] = {1, 2, 3, 4};
  for (const bool low_gives : {true, false}) {
    FrozenContacts contacts = with_layout({true, true, false, true});
    const std::int64_t giver = low_gives ? 5 : 9, other = low_gives ? 9 : 5;
    contacts.add(giver, other, h);
    EXPECT_EQ(seen_by(contacts, giver)[other], (History{1, 2, 3, 4}));
    EXPECT_EQ(seen_by(contacts, other)[giver], (History{-1, -2, 3, -4}));
  }
}

TEST(FrozenContacts, turned_is_the_view_from_the_other_side_and_its_own_inverse) {
  const FrozenContacts contacts = with_layout({true, false});
  const double h[] = {3, 4};
  const History other = contacts.turned(h);
  EXPECT_EQ(other, (History{-3, 4}));
  EXPECT_EQ(contacts.turned(other.data()), (History{3, 4}));
}

TEST(FrozenContacts, a_review_sees_new_contacts_and_those_that_the_last_one_kept) {
  FrozenContacts contacts = with_layout({});
  std::set<Pair> seen, wanted;
  const auto review = [&] {
    seen.clear();
    contacts.review([&](std::int64_t low, std::int64_t high) {
      EXPECT_TRUE(seen.emplace(low, high).second) << "a contact is reviewed twice";
      return wanted.count({low, high}) != 0;
    });
    return seen;
  };
  contacts.add(1, 3, nullptr);  // nobody wants reviews
  contacts.begin_reviews();
  contacts.add(1, 2, nullptr);
  contacts.add(3, 2, nullptr);
  contacts.add(4, 2, nullptr);
  contacts.add(2, 4, nullptr);
  wanted = {{2, 3}};
  EXPECT_EQ(review(), (std::set<Pair>{{1, 2}, {2, 3}, {2, 4}}));
  contacts.add(5, 6, nullptr);
  EXPECT_EQ(review(), (std::set<Pair>{{2, 3}, {5, 6}}));
  contacts.erase(3);
  EXPECT_TRUE(review().empty());
  contacts.add(7, 8, nullptr);  // in the place of one that has gone
  contacts.erase(7);
  contacts.add(8, 9, nullptr);
  EXPECT_EQ(review(), (std::set<Pair>{{8, 9}}));
  contacts.fit();
  EXPECT_TRUE(review().empty());
  contacts.add(1, 9, nullptr);
  EXPECT_EQ(review(), (std::set<Pair>{{1, 9}}));
}

TEST(FrozenContacts, each_contact_is_listed_once_as_its_low_tag_sees_it) {
  FrozenContacts contacts = with_layout({true});
  const double h[] = {2};
  contacts.add(8, 3, h);
  contacts.add(3, 1, nullptr);
  std::map<Pair, History> all;
  contacts.for_each_contact([&](std::int64_t low, std::int64_t high, const double* history) {
    all[{low, high}] = history ? History(history, history + 1) : History();
  });
  EXPECT_EQ(all, (std::map<Pair, History>{{{3, 8}, {-2}}, {{1, 3}, {}}}));
}

TEST(FrozenContacts, adding_again_from_either_side_replaces_the_history) {
  FrozenContacts contacts = with_layout({true});
  const double first[] = {1}, second[] = {5}, third[] = {7};
  contacts.add(1, 2, first);
  contacts.add(1, 2, second);
  EXPECT_EQ(contacts.size(), 1u);
  EXPECT_EQ(seen_by(contacts, 1)[2], (History{5}));
  contacts.add(2, 1, third);
  EXPECT_EQ(contacts.size(), 1u);
  EXPECT_EQ(seen_by(contacts, 2)[1], (History{7}));
  EXPECT_EQ(seen_by(contacts, 1)[2], (History{-7}));
}

TEST(FrozenContacts, a_history_may_come_and_go) {
  FrozenContacts contacts = with_layout({false, false});
  const double h[] = {1, 2};
  contacts.add(1, 2, nullptr);
  EXPECT_EQ(seen_by(contacts, 1)[2], History());
  contacts.add(1, 2, h);
  EXPECT_EQ(seen_by(contacts, 1)[2], (History{1, 2}));
  contacts.add(1, 2, nullptr);
  EXPECT_EQ(seen_by(contacts, 2)[1], History());
}

TEST(FrozenContacts, contact_models_without_history_have_a_graph_too) {
  FrozenContacts contacts = with_layout({});
  contacts.add(1, 2, nullptr);
  contacts.add(2, 3, nullptr);
  EXPECT_TRUE(contacts.contains(3, 2));
  EXPECT_FALSE(contacts.contains(1, 3));
  EXPECT_EQ(seen_by(contacts, 2).size(), 2u);
}

TEST(FrozenContacts, erase_takes_all_contacts_of_a_granule_from_both_sides) {
  FrozenContacts contacts = with_layout({true});
  const double h[] = {1};
  for (std::int64_t a = 1; a <= 4; ++a)
    for (std::int64_t b = a + 1; b <= 4; ++b) contacts.add(a, b, h);
  contacts.erase(2);
  EXPECT_EQ(contacts.size(), 3u);
  EXPECT_TRUE(seen_by(contacts, 2).empty());
  for (const std::int64_t tag : {1, 3, 4}) EXPECT_EQ(seen_by(contacts, tag).size(), 2u);
  contacts.erase(2);
  contacts.erase(99);
  EXPECT_EQ(contacts.size(), 3u);
}

TEST(FrozenContacts, contacts_known_from_elsewhere_are_listed_with_the_others) {
  FrozenContacts contacts = with_layout({true});
  const double h[] = {1};
  contacts.add(1, 2, h);
  contacts.set_elsewhere([](std::int64_t tag, std::vector<std::int64_t>& partners) {
    if (tag == 1) partners = {3, 4};
  });
  EXPECT_EQ(seen_by(contacts, 1), (std::map<std::int64_t, History>{{2, {1}}, {3, {}}, {4, {}}}));
  EXPECT_EQ(seen_by(contacts, 2).size(), 1u);
  std::set<std::int64_t> elsewhere;
  contacts.for_each_elsewhere(1, [&](std::int64_t partner) { elsewhere.insert(partner); });
  EXPECT_EQ(elsewhere, (std::set<std::int64_t>{3, 4}));
  EXPECT_EQ(contacts.size(), 1u);
  EXPECT_FALSE(contacts.contains(1, 3));
}

TEST(FrozenContacts, drop_takes_those_that_go_and_no_others) {
  FrozenContacts contacts = with_layout({true});
  const double h[] = {1};
  for (std::int64_t tag = 1; tag <= 10; ++tag) contacts.add(0, tag, h);
  contacts.add(2, 4, h);
  contacts.drop(0, [](std::int64_t partner) { return partner % 2 == 0; });
  EXPECT_EQ(contacts.size(), 6u);
  EXPECT_EQ(seen_by(contacts, 0).size(), 5u);
  EXPECT_EQ(seen_by(contacts, 2).size(), 1u);
  EXPECT_EQ(seen_by(contacts, 3)[0], (History{-1}));
}

TEST(FrozenContacts, fit_gives_room_back_and_keeps_what_is_there) {
  FrozenContacts contacts = with_layout({true, false});
  for (std::int64_t tag = 1; tag <= 50000; ++tag) {
    const double h[] = {double(tag), 1};
    contacts.add(tag + 1, tag, tag % 3 ? h : nullptr);
  }
  const std::size_t bytes = contacts.memory_bytes();
  contacts.fit();
  EXPECT_EQ(contacts.memory_bytes(), bytes) << "all of it is in use";
  for (std::int64_t tag = 1; tag <= 49000; ++tag) contacts.erase(tag);
  EXPECT_EQ(contacts.memory_bytes(), bytes);
  contacts.fit();
  EXPECT_LT(contacts.memory_bytes(), bytes / 10);
  EXPECT_EQ(contacts.size(), 1000u);
  for (std::int64_t tag = 49001; tag <= 50000; ++tag)
    EXPECT_EQ(seen_by(contacts, tag)[tag + 1], tag % 3 ? (History{-double(tag), 1}) : History());
  EXPECT_EQ(contacts.layout(), (std::vector<bool>{true, false}));
}

TEST(FrozenContacts, places_of_erased_contacts_are_used_again) {
  FrozenContacts contacts = with_layout({true, false, true});
  const double h[] = {1, 2, 3};
  for (std::int64_t tag = 1; tag <= 100; ++tag) contacts.add(0, tag, h);
  const std::size_t bytes = contacts.memory_bytes();
  for (std::int64_t round = 1; round <= 50; ++round) {
    contacts.erase(0);
    EXPECT_EQ(contacts.size(), 0u);
    for (std::int64_t tag = 1; tag <= 100; ++tag) contacts.add(0, 1000 * round + tag, round % 2 ? h : nullptr);
  }
  EXPECT_EQ(contacts.size(), 100u);
  EXPECT_LE(contacts.memory_bytes(), 2 * bytes) << "the list of free places is all that may come on top";
  // what stood in the place before is not seen
  EXPECT_EQ(seen_by(contacts, 50001)[0], History());
}

TEST(FrozenContacts, the_layout_may_change_only_while_nothing_is_frozen) {
  FrozenContacts contacts = with_layout({true});
  const double h[] = {1};
  contacts.add(1, 2, h);
  EXPECT_NO_THROW(contacts.set_layout({true}));
  EXPECT_THROW(contacts.set_layout({false}), std::logic_error);
  EXPECT_THROW(contacts.set_layout({true, true}), std::logic_error);
}

TEST(FrozenContacts, a_new_layout_after_all_is_erased_keeps_later_histories_apart) {
  FrozenContacts contacts = with_layout({true});
  const double h[] = {1};
  for (std::int64_t tag = 1; tag <= 5; ++tag) contacts.add(0, tag, h);
  contacts.erase(0);
  contacts.set_layout({false, true, false});
  for (std::int64_t tag = 1; tag <= 8; ++tag) {
    const double x = static_cast<double>(tag);
    const double wide[] = {x, 10 * x, 100 * x};
    contacts.add(0, tag, wide);
  }
  for (std::int64_t tag = 1; tag <= 8; ++tag) {
    const double x = static_cast<double>(tag);
    EXPECT_EQ(seen_by(contacts, 0)[tag], (History{x, 10 * x, 100 * x})) << "of " << tag;
    EXPECT_EQ(seen_by(contacts, tag)[0], (History{x, -10 * x, 100 * x})) << "of " << tag;
  }
}

// ----------------------------------------------------------------------------------------------------------------- turning

/// A number, a vector that has a sense, a number, a vector that has none, a number.
FrozenContacts with_vectors() {
  FrozenContacts contacts = with_layout({true, true, true, true, false, false, false, false, true});
  contacts.set_vectors({1, 5});
  return contacts;
}

/// A quarter turn about z: x to y, y to -x. Exact.
const Eigen::Matrix3d quarter = (Eigen::Matrix3d() << 0, -1, 0, 1, 0, 0, 0, 0, 1).finished();

TEST(FrozenContacts, a_rotation_turns_the_vectors_of_a_history_only) {
  const FrozenContacts contacts = with_vectors();
  EXPECT_EQ(contacts.vectors(), (std::vector<int>{1, 5}));
  double h[] = {1, 2, 3, 4, 5, 6, 7, 8, 9};
  contacts.turn(h, quarter);
  EXPECT_EQ(History(h, h + 9), (History{1, -3, 2, 4, 5, -7, 6, 8, 9}));
  FrozenContacts scalars = with_layout({true, true, true});
  double s[] = {1, 2, 3};
  scalars.turn(s, quarter);
  EXPECT_EQ(History(s, s + 3), (History{1, 2, 3}));
}

TEST(FrozenContacts, a_contact_that_turns_is_turned_as_both_ends_see_it) {
  const double h[] = {1, 2, 3, 4, 5, 6, 7, 8, 9};
  for (const bool low_turns : {true, false})
    for (const bool low_gives : {true, false}) {
      FrozenContacts contacts = with_vectors();
      contacts.add(low_gives ? 4 : 6, low_gives ? 6 : 4, h);
      contacts.turn(low_turns ? 4 : 6, quarter, [](std::int64_t) { return true; });
      const History giver{1, -3, 2, 4, 5, -7, 6, 8, 9}, other{-1, 3, -2, -4, 5, -7, 6, 8, -9};
      EXPECT_EQ(seen_by(contacts, 4)[6], low_gives ? giver : other);
      EXPECT_EQ(seen_by(contacts, 6)[4], low_gives ? other : giver);
    }
}

TEST(FrozenContacts, a_body_that_turns_turns_each_of_its_contacts_once) {
  // granules 0..9 turn, 10..19 do not; a pair of the first is turned by its lower one, a pair across by the one that turns
  const Eigen::Matrix3d by = Eigen::AngleAxisd(0.7, Vec3(2, -1, 2) / 3).toRotationMatrix();
  std::mt19937 random(9);
  std::normal_distribution<double> number;
  FrozenContacts contacts = with_vectors();
  std::map<Pair, History> due;  // as the low tag sees it
  for (int n = 0; n < 200; ++n) {
    const std::int64_t a = random() % 20, b = random() % 20;
    if (a == b) continue;
    History h;
    if (random() % 5)
      for (int d = 0; d < 9; ++d) h.push_back(number(random));
    contacts.add(std::min(a, b), std::max(a, b), h.empty() ? nullptr : h.data());
    due[{std::min(a, b), std::max(a, b)}] = h;
  }
  contacts.erase(3);  // leaves free places behind
  for (auto d = due.begin(); d != due.end();) d = d->first.first == 3 || d->first.second == 3 ? due.erase(d) : std::next(d);
  for (std::int64_t tag = 0; tag < 10; ++tag) contacts.turn(tag, by, [&](std::int64_t partner) { return partner > tag; });
  int turned = 0, kept = 0;
  for (auto& [pair, h] : due) {
    if (pair.first < 10 && !h.empty()) {
      for (const int v : {1, 5}) {
        const Vec3 w = by * Vec3(h[v], h[v + 1], h[v + 2]);
        for (int d = 0; d < 3; ++d) h[v + d] = w[d];
      }
      ++turned;
    } else {
      ++kept;
    }
  }
  EXPECT_GT(turned, 30);
  EXPECT_GT(kept, 30);
  std::size_t listed = 0;
  contacts.for_each_contact([&](std::int64_t low, std::int64_t high, const double* history) {
    ++listed;
    const History is = history ? History(history, history + 9) : History();
    const History& should = due.at({low, high});
    ASSERT_EQ(is.size(), should.size());
    for (std::size_t d = 0; d < is.size(); ++d) EXPECT_NEAR(is[d], should[d], 1e-15) << low << " " << high << " " << d;
  });
  EXPECT_EQ(listed, due.size());
}

TEST(FrozenContacts, turning_what_has_no_contacts_or_no_history_does_nothing) {
  FrozenContacts contacts = with_vectors();
  contacts.add(1, 2, nullptr);
  contacts.turn(1, quarter, [](std::int64_t) { return true; });
  contacts.turn(99, quarter, [](std::int64_t) { return true; });
  EXPECT_EQ(seen_by(contacts, 2)[1], History());
}

TEST(FrozenContacts, a_wide_history_is_kept_as_well) {
  for (const std::size_t width : {32, 33, 100}) {
    FrozenContacts contacts = with_layout(std::vector<bool>(width, true));
    History h(width), turned(width);
    for (std::size_t d = 0; d < width; ++d) turned[d] = -(h[d] = 1.0 + static_cast<double>(d));
    contacts.add(1, 2, h.data());
    EXPECT_EQ(seen_by(contacts, 1)[2], h);
    EXPECT_EQ(seen_by(contacts, 2)[1], turned);
  }
}

TEST(FrozenContacts, a_contact_without_numbers_may_have_a_history) {
  FrozenContacts contacts = with_layout({});
  const double h[] = {0};
  contacts.add(1, 2, h);
  contacts.add(2, 3, nullptr);
  int with = 0, all = 0;
  contacts.for_each_contact([&](std::int64_t, std::int64_t, const double* history) {
    ++all;
    with += history != nullptr;
  });
  EXPECT_EQ(all, 2);
  EXPECT_EQ(with, 1);
}

TEST(FrozenContacts, takes_the_tags_of_the_engine_only) {
  FrozenContacts contacts = with_layout({});
  EXPECT_THROW(contacts.add(1, std::int64_t{INT32_MAX} + 1, nullptr), std::logic_error);
  EXPECT_THROW(contacts.add(std::int64_t{INT32_MIN}, 1, nullptr), std::logic_error);
  EXPECT_EQ(contacts.size(), 0u);
  contacts.add(INT32_MIN + 1, INT32_MAX, nullptr);
  EXPECT_TRUE(contacts.contains(INT32_MAX, INT32_MIN + 1));
}

TEST(FrozenContacts, an_edge_takes_16_bytes_and_its_history) {
  constexpr int n = 40;  // a cubic lattice: three edges per node
  for (const std::size_t width : {0, 3}) {
    FrozenContacts contacts = with_layout(std::vector<bool>(width, true));
    const History h(width, 1.0);
    const auto tag = [](int i, int j, int k) { return (i * n + j) * n + k; };
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j)
        for (int k = 0; k < n; ++k) {
          const double* history = width ? h.data() : nullptr;
          if (i) contacts.add(tag(i, j, k), tag(i - 1, j, k), history);
          if (j) contacts.add(tag(i, j, k), tag(i, j - 1, k), history);
          if (k) contacts.add(tag(i, j, k), tag(i, j, k - 1), history);
        }
    const double edges = static_cast<double>(contacts.size()), nodes = n * n * n;
    EXPECT_LE(static_cast<double>(contacts.memory_bytes()), edges * (17.0 + 8.0 * static_cast<double>(width)) + 16.1 * nodes);
  }
}

TEST(FrozenContacts, does_as_a_map_of_pairs_does_under_random_operations) {
  const std::vector<bool> flips{true, false, true};
  std::mt19937 random(7);
  std::normal_distribution<double> number;
  FrozenContacts contacts = with_layout(flips);
  std::map<Pair, History> reference;  // both directions
  const auto turned = [&](History h) {
    for (std::size_t d = 0; d < h.size(); ++d)
      if (flips[d]) h[d] = -h[d];
    return h;
  };
  constexpr std::int64_t tags = 40;
  for (int n = 0; n < 20000; ++n) {
    const std::int64_t a = random() % tags, b = random() % tags;
    if (random() % 12 == 0) {
      contacts.erase(a);
      for (std::int64_t other = 0; other < tags; ++other) {
        reference.erase({a, other});
        reference.erase({other, a});
      }
    } else if (a != b) {
      History h;
      if (random() % 4) h = {number(random), number(random), number(random)};
      contacts.add(a, b, h.empty() ? nullptr : h.data());
      reference[{a, b}] = h;
      reference[{b, a}] = turned(h);
    }
    ASSERT_EQ(2 * contacts.size(), reference.size());
    if (n % 50) continue;
    for (std::int64_t tag = 0; tag < tags; ++tag) {
      std::map<std::int64_t, History> due;
      for (auto r = reference.lower_bound({tag, INT64_MIN}); r != reference.end() && r->first.first == tag; ++r)
        due[r->first.second] = r->second;
      ASSERT_EQ(seen_by(contacts, tag), due) << "of " << tag << " after " << n << " operations";
    }
  }
}

TEST(FrozenContacts, an_unturned_history_is_none_until_all_are_turned) {
  FrozenContacts contacts = with_layout({true, true, true, false});
  contacts.set_vectors({0});
  const double h[] = {1, 2, 3, 4}, k[] = {-5, 6, 7, 8};
  contacts.add(1, 2, k);
  contacts.add_unturned(7, 3, h);  // as the higher one sees it
  contacts.add_unturned(1, 7, k);
  EXPECT_EQ(contacts.size(), 3u);
  EXPECT_TRUE(contacts.contains(3, 7));
  EXPECT_EQ(seen_by(contacts, 7).at(3), History());
  contacts.turn(7, Eigen::Matrix3d(2 * Eigen::Matrix3d::Identity()), [](std::int64_t) { return true; });  // waits in the world
  const Eigen::Matrix3d by = Eigen::AngleAxisd(M_PI / 2, Vec3::UnitZ()).toRotationMatrix();
  std::set<Pair> asked;
  contacts.turn_all_unturned([&](std::int64_t low, std::int64_t high) {
    asked.insert({low, high});
    return low == 3 ? by : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
  });
  EXPECT_EQ(asked, (std::set<Pair>{{3, 7}, {1, 7}}));
  const History seen = seen_by(contacts, 7).at(3);  // (1, 2, 3) turned by a right angle about z
  ASSERT_EQ(seen.size(), 4u);
  EXPECT_NEAR(seen[0], -2, 1e-12);
  EXPECT_NEAR(seen[1], 1, 1e-12);
  EXPECT_NEAR(seen[2], 3, 1e-12);
  EXPECT_EQ(seen[3], 4);
  EXPECT_EQ(seen_by(contacts, 1).at(7), History(k, k + 4));
  EXPECT_EQ(seen_by(contacts, 1).at(2), History(k, k + 4));
  contacts.turn_all_unturned(
      [&](std::int64_t, std::int64_t) { return Eigen::Matrix3d(Eigen::Matrix3d::Zero()); });  // none is left
  EXPECT_EQ(seen_by(contacts, 1).at(7), History(k, k + 4));
  contacts.erase(7);
  EXPECT_EQ(contacts.size(), 1u);
}

}  // namespace
}  // namespace solidcull
