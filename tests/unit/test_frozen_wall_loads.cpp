#include <gtest/gtest.h>

#include <algorithm>
#include <exception>
#include <map>
#include <random>
#include <tuple>
#include <vector>

#include "frozen_wall_loads.h"

namespace solidcull {
namespace {

using Element = FrozenWallLoads::Element;
using Key = std::tuple<int, int, int>;  // body, mesh, element

WallLoad load(int mesh, int element, const Vec3& force, const Vec3& torque = Vec3::Zero()) {
  WallLoad l;
  l.mesh = mesh;
  l.element = element;
  l.force = force;
  l.torque = torque;
  return l;
}

WallLoad up(int element, double newton) { return load(0, element, newton * Vec3::UnitZ()); }

/// All that is there.
std::map<Key, Element> listed(const FrozenWallLoads& loads) {
  std::map<Key, Element> all;
  loads.for_each([&](int body, int mesh, int element, const Element& e) {
    EXPECT_TRUE(all.emplace(Key{body, mesh, element}, e).second) << "visited twice";
  });
  std::map<FrozenWallLoads::Place, std::pair<int, Vec3>> sums;
  for (const auto& [key, e] : all) {
    auto& sum =
        sums.emplace(FrozenWallLoads::Place{std::get<1>(key), std::get<2>(key)}, std::make_pair(0, Vec3(0, 0, 0))).first->second;
    sum.first += e.granules;
    sum.second += e.force;
  }
  EXPECT_EQ(loads.of_all().size(), sums.size());
  for (const auto& [place, sum] : sums) {
    EXPECT_EQ(loads.of_all().at(place).granules, sum.first);
    EXPECT_LE((loads.of_all().at(place).force - sum.second).norm(), 1e-9 * (1 + sum.second.norm()));
  }
  std::size_t on_meshes = 0;
  for (const auto& [place, e] : loads.of_all()) {
    if (place.first == WallLoad::no_mesh) continue;
    const FrozenWallLoads::OnMesh& row = loads.on_meshes().at(on_meshes++);
    EXPECT_EQ(row.place, place);
    EXPECT_EQ(row.force, e.force);
    EXPECT_EQ(row.torque, e.torque);
  }
  EXPECT_EQ(loads.on_meshes().size(), on_meshes);
  return all;
}

double shares_of(const FrozenWallLoads& loads, int body) {
  double sum = 0;
  loads.for_each([&](int b, int, int, const Element& e) {
    EXPECT_GE(e.share, 0.0);
    if (b == body) sum += e.share;
  });
  return sum;
}

void expect_near(const Vec3& a, const Vec3& b, double margin) {
  EXPECT_LE((a - b).norm(), margin) << a.transpose() << " and " << b.transpose();
}

// ------------------------------------------------------------------------------------------------------- coming and going

TEST(FrozenWallLoads, begin_with_nothing) {
  FrozenWallLoads loads;
  EXPECT_TRUE(loads.empty());
  EXPECT_FALSE(loads.holds(1));
  EXPECT_EQ(loads.force(1), Vec3(Vec3::Zero()));
  EXPECT_EQ(loads.weigh(1, Vec3::UnitX()), 0.0);
  loads.share_out(1, 0);
  loads.erase(7, 1);
  loads.move(7, 1, 2);
  loads.merge(1, 2);
  EXPECT_TRUE(listed(loads).empty());
  EXPECT_TRUE(loads.empty());
}

TEST(FrozenWallLoads, a_granule_without_loads_leaves_nothing_behind) {
  FrozenWallLoads loads;
  loads.add(7, 1, {});
  EXPECT_TRUE(loads.empty());
  EXPECT_FALSE(loads.holds(1));
}

TEST(FrozenWallLoads, of_walls_that_report_no_load_nothing_is_pressed_on) {
  FrozenWallLoads loads;
  loads.add(7, 1, {load(WallLoad::no_mesh, 4, {1, 0, 0}), up(3, 2)});
  EXPECT_EQ(listed(loads).size(), 2u);
  ASSERT_EQ(loads.on_meshes().size(), 1u);
  EXPECT_EQ(loads.on_meshes()[0].place, FrozenWallLoads::Place(0, 3));
  loads.erase(7, 1);
  EXPECT_TRUE(loads.on_meshes().empty());
}

TEST(FrozenWallLoads, an_element_bears_the_sum_of_its_granules) {
  FrozenWallLoads loads;
  loads.add(7, 1, {load(0, 3, {1, 2, 3}, {4, 5, 6})});
  loads.add(8, 1, {load(0, 3, {10, 20, 30}, {40, 50, 60})});
  const auto all = listed(loads);
  ASSERT_EQ(all.size(), 1u);
  const Element& e = all.at({1, 0, 3});
  EXPECT_EQ(e.granules, 2);
  EXPECT_EQ(e.force, Vec3(11, 22, 33));
  EXPECT_EQ(e.torque, Vec3(44, 55, 66));
  EXPECT_EQ(e.share, 0.0);
}

TEST(FrozenWallLoads, meshes_elements_and_bodies_are_told_apart) {
  FrozenWallLoads loads;
  loads.add(7, 1, {load(0, 3, {1, 0, 0}), load(1, 3, {2, 0, 0}), load(0, 4, {4, 0, 0})});
  loads.add(8, 2, {load(0, 3, {8, 0, 0})});
  const auto all = listed(loads);
  ASSERT_EQ(all.size(), 4u);
  EXPECT_EQ(all.at({1, 0, 3}).force[0], 1);
  EXPECT_EQ(all.at({1, 1, 3}).force[0], 2);
  EXPECT_EQ(all.at({1, 0, 4}).force[0], 4);
  EXPECT_EQ(all.at({2, 0, 3}).force[0], 8);
  EXPECT_EQ(loads.force(1), Vec3(7, 0, 0));
  EXPECT_EQ(loads.force(2), Vec3(8, 0, 0));
  EXPECT_EQ(loads.force(3), Vec3(Vec3::Zero()));
  EXPECT_TRUE(loads.holds(1) && loads.holds(2));
  EXPECT_FALSE(loads.holds(3));
}

TEST(FrozenWallLoads, a_granule_in_a_corner_takes_all_its_loads_with_it) {
  FrozenWallLoads loads;
  loads.add(7, 1, {load(0, 3, {1, 0, 0}), load(0, 3, {2, 0, 0}), load(1, 5, {4, 0, 0})});
  loads.add(8, 1, {load(0, 3, {8, 0, 0})});
  EXPECT_EQ(listed(loads).at({1, 0, 3}).granules, 3) << "loads, here: an element may touch a granule twice";
  loads.erase(7, 1);
  const auto all = listed(loads);
  ASSERT_EQ(all.size(), 1u);
  EXPECT_EQ(all.at({1, 0, 3}).granules, 1);
  EXPECT_EQ(all.at({1, 0, 3}).force, Vec3(8, 0, 0));
}

TEST(FrozenWallLoads, an_element_vanishes_when_its_last_granule_goes_and_with_it_what_rounding_left) {
  FrozenWallLoads loads;
  loads.add(7, 1, {up(3, 1e9)});
  loads.add(8, 1, {up(3, 1e-9), up(4, 1)});
  loads.erase(7, 1);
  EXPECT_NE(listed(loads).at({1, 0, 3}).force[2], 1e-9) << "rounding has taken it: else this test shows nothing";
  loads.erase(8, 1);
  EXPECT_TRUE(listed(loads).empty());
  EXPECT_TRUE(loads.empty());
  EXPECT_FALSE(loads.holds(1));
  loads.add(9, 1, {up(3, 1e-9)});
  EXPECT_EQ(loads.force(1), Vec3(0, 0, 1e-9));
}

TEST(FrozenWallLoads, erasing_what_is_not_there_changes_nothing) {
  FrozenWallLoads loads;
  loads.add(7, 1, {up(3, 1)});
  loads.erase(8, 1);
  EXPECT_EQ(loads.force(1), Vec3(0, 0, 1));
  loads.erase(7, 1);
  loads.erase(7, 1);
  EXPECT_TRUE(loads.empty());
}

TEST(FrozenWallLoads, a_granule_that_comes_back_and_is_put_away_again_has_its_new_loads_only) {
  FrozenWallLoads loads;
  loads.add(7, 1, {up(3, 1), up(4, 1)});
  loads.erase(7, 1);
  loads.add(7, 1, {up(4, 2)});
  const auto all = listed(loads);
  ASSERT_EQ(all.size(), 1u);
  EXPECT_EQ(all.at({1, 0, 4}).force[2], 2);
}

TEST(FrozenWallLoads, clear_empties_them) {
  FrozenWallLoads loads;
  loads.add(7, 1, {up(3, 1)});
  loads.clear();
  EXPECT_TRUE(loads.empty());
  loads.erase(7, 1);
  loads.add(7, 2, {up(3, 4)});
  EXPECT_EQ(listed(loads).size(), 1u);
  EXPECT_EQ(loads.force(2), Vec3(0, 0, 4));
}

// ----------------------------------------------------------------------------------------------------- bodies change hands

TEST(FrozenWallLoads, a_granule_that_moves_to_another_body_takes_its_loads_along) {
  FrozenWallLoads loads;
  loads.add(7, 1, {up(3, 1), up(4, 2)});
  loads.add(8, 1, {up(3, 4)});
  loads.move(7, 1, 2);
  const auto all = listed(loads);
  ASSERT_EQ(all.size(), 3u);
  EXPECT_EQ(all.at({1, 0, 3}).force[2], 4);
  EXPECT_EQ(all.at({1, 0, 3}).granules, 1);
  EXPECT_EQ(all.at({2, 0, 3}).force[2], 1);
  EXPECT_EQ(all.at({2, 0, 4}).force[2], 2);
  loads.move(8, 1, 2);
  EXPECT_FALSE(loads.holds(1));
  loads.erase(7, 2);
  loads.erase(8, 2);
  EXPECT_TRUE(loads.empty());
}

TEST(FrozenWallLoads, to_move_within_a_body_or_without_loads_changes_nothing) {
  FrozenWallLoads loads;
  loads.add(7, 1, {up(3, 1)});
  loads.move(7, 1, 1);
  loads.move(8, 1, 2);
  ASSERT_EQ(listed(loads).size(), 1u);
  EXPECT_EQ(loads.force(1), Vec3(0, 0, 1));
}

TEST(FrozenWallLoads, a_body_that_is_swallowed_hands_over_all_its_granules) {
  FrozenWallLoads loads;
  loads.add(7, 1, {load(0, 3, {1, 0, 0}, {0, 1, 0}), load(0, 4, {2, 0, 0})});
  loads.add(8, 2, {load(0, 3, {4, 0, 0}, {0, 4, 0})});
  loads.add(9, 3, {load(0, 3, {8, 0, 0})});
  loads.merge(1, 2);
  const auto all = listed(loads);
  ASSERT_EQ(all.size(), 3u);
  EXPECT_FALSE(loads.holds(1));
  EXPECT_EQ(all.at({2, 0, 3}).granules, 2);
  EXPECT_EQ(all.at({2, 0, 3}).force, Vec3(5, 0, 0));
  EXPECT_EQ(all.at({2, 0, 3}).torque, Vec3(0, 5, 0));
  EXPECT_EQ(all.at({2, 0, 4}).force, Vec3(2, 0, 0));
  EXPECT_EQ(loads.force(3), Vec3(8, 0, 0));
  loads.erase(7, 2);  // it is of the body that kept its number now
  loads.erase(8, 2);
  EXPECT_FALSE(loads.holds(2));
}

TEST(FrozenWallLoads, a_body_may_be_swallowed_by_one_that_touches_no_wall) {
  FrozenWallLoads loads;
  loads.add(7, 1, {up(3, 1)});
  loads.merge(1, 2);
  EXPECT_FALSE(loads.holds(1));
  EXPECT_EQ(loads.force(2), Vec3(0, 0, 1));
  loads.merge(5, 2);  // and one that touches none swallowed
  EXPECT_EQ(listed(loads).size(), 1u);
}

// ----------------------------------------------------------------------------------------------------------------- shares

TEST(FrozenWallLoads, what_presses_on_a_body_is_borne_in_proportion_to_what_bears_it) {
  FrozenWallLoads loads;
  loads.add(7, 1, {up(3, 1)});
  loads.add(8, 1, {up(4, 3)});
  loads.add(9, 2, {up(3, 100)});
  const double sum = loads.weigh(1, {0, 0, -5});
  EXPECT_DOUBLE_EQ(sum, 20);
  loads.share_out(1, sum);
  const auto all = listed(loads);
  EXPECT_DOUBLE_EQ(all.at({1, 0, 3}).share, 0.25);
  EXPECT_DOUBLE_EQ(all.at({1, 0, 4}).share, 0.75);
  EXPECT_EQ(all.at({2, 0, 3}).share, 0.0) << "another body's";
}

TEST(FrozenWallLoads, an_element_that_does_not_bear_that_way_gets_nothing) {
  FrozenWallLoads loads;
  loads.add(7, 1, {load(0, 3, {0, 0, 2}), load(1, 5, {2, 0, 0}), load(1, 6, {-2, 0, 0})});
  loads.share_out(1, loads.weigh(1, {0, 0, -1}));
  EXPECT_DOUBLE_EQ(listed(loads).at({1, 0, 3}).share, 1);
  EXPECT_EQ(listed(loads).at({1, 1, 5}).share, 0.0);
  loads.share_out(1, loads.weigh(1, {1, 0, 0}));  // towards the side at +x: it pushes more, the one at -x less
  EXPECT_EQ(listed(loads).at({1, 0, 3}).share, 0.0);
  EXPECT_DOUBLE_EQ(listed(loads).at({1, 1, 5}).share, 0.5);
  EXPECT_DOUBLE_EQ(listed(loads).at({1, 1, 6}).share, 0.5);
}

TEST(FrozenWallLoads, a_load_that_lifts_relieves_what_carries) {
  // the floor carries 20, a side holds down with 1: nearly all of the relief is the floor's
  FrozenWallLoads loads;
  loads.add(7, 1, {load(0, 3, {0, 0, 20}), load(1, 5, {2, 0, -1})});
  loads.share_out(1, loads.weigh(1, {0, 0, 1}));
  EXPECT_DOUBLE_EQ(listed(loads).at({1, 0, 3}).share, 20.0 / 21);
  EXPECT_DOUBLE_EQ(listed(loads).at({1, 1, 5}).share, 1.0 / 21);
}

TEST(FrozenWallLoads, where_no_element_bears_along_that_line_there_are_no_shares) {
  FrozenWallLoads loads;
  loads.add(7, 1, {up(3, 1)});
  loads.share_out(1, loads.weigh(1, {0, 0, -1}));
  const double sum = loads.weigh(1, {1, 0, 0});
  EXPECT_EQ(sum, 0.0);
  loads.share_out(1, sum);
  EXPECT_EQ(shares_of(loads, 1), 0.0);
}

TEST(FrozenWallLoads, shares_sum_to_one_over_the_ranks) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> force(0, 1);
  FrozenWallLoads ranks[3];
  for (int n = 0; n < 300; ++n)
    ranks[n % 3].add(n, 1, {load(0, n % 17, {force(random) - 0.5, force(random) - 0.5, force(random)})});
  const Vec3 pressed(0.3, -0.2, -1);
  double sum = 0, shares = 0;
  for (FrozenWallLoads& r : ranks) sum += r.weigh(1, pressed);
  for (FrozenWallLoads& r : ranks) {
    r.share_out(1, sum);
    EXPECT_LT(shares_of(r, 1), 1.0);
    shares += shares_of(r, 1);
  }
  EXPECT_NEAR(shares, 1.0, 1e-14);
}

// ---------------------------------------------------------------------------------------------------------- many of them

TEST(FrozenWallLoads, rounding_does_not_pile_up_over_many_moves) {
  struct Stored {
    std::int64_t tag;
    int body;
    std::vector<WallLoad> loads;
  };
  std::mt19937 random(2);
  std::uniform_real_distribution<double> force(-1, 1);
  std::vector<Stored> there;
  FrozenWallLoads loads;
  std::int64_t next = 1;
  for (int n = 0; n < 100000; ++n) {
    if (there.size() < 100 || (there.size() < 300 && random() % 2)) {
      Stored s{next++, 1 + static_cast<int>(random() % 3), {}};
      for (unsigned k = random() % 4; k > 0; --k) {
        const double x = force(random), y = force(random), z = force(random);
        s.loads.push_back(load(static_cast<int>(random() % 2), static_cast<int>(random() % 5), {x, y, z}, {z, x, y}));
      }
      loads.add(s.tag, s.body, s.loads);
      there.push_back(s);
      continue;
    }
    Stored& one = there[random() % there.size()];
    if (random() % 3 == 0) {
      const int to = 1 + static_cast<int>(random() % 3);
      loads.move(one.tag, one.body, to);
      one.body = to;
    } else {
      loads.erase(one.tag, one.body);
      std::swap(one, there.back());
      there.pop_back();
    }
  }
  std::map<Key, Element> due;
  for (const Stored& s : there)
    for (const WallLoad& l : s.loads) {
      Element& e = due[{s.body, l.mesh, l.element}];
      ++e.granules;
      e.force += l.force;
      e.torque += l.torque;
    }
  const auto all = listed(loads);
  ASSERT_EQ(all.size(), due.size());
  for (const auto& [key, e] : due) {
    ASSERT_TRUE(all.count(key));
    EXPECT_EQ(all.at(key).granules, e.granules);
    expect_near(all.at(key).force, e.force, 1e-11);
    expect_near(all.at(key).torque, e.torque, 1e-11);
  }
  EXPECT_LT(loads.memory_bytes(), 300000u) << "places that were given back are used again";
  for (const Stored& s : there) loads.erase(s.tag, s.body);
  EXPECT_TRUE(loads.empty());
}

TEST(FrozenWallLoads, count_their_memory) {
  FrozenWallLoads loads;
  const std::size_t before = loads.memory_bytes();
  for (int tag = 1; tag <= 1000; ++tag) loads.add(tag, 1, {up(tag, 1)});
  EXPECT_GT(loads.memory_bytes(), before + 1000 * sizeof(WallLoad));
}

TEST(FrozenWallLoads, taking_away_from_a_body_that_bears_nothing_founds_none) {
  FrozenWallLoads loads;
  loads.add(1, 5, {up(0, 1)});
  EXPECT_THROW(loads.erase(1, 6), std::exception);
  EXPECT_THROW(loads.move(1, 6, 7), std::exception);
  EXPECT_EQ(listed(loads).size(), 1u);
}

}  // namespace
}  // namespace solidcull
