#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "parts_that_came_off.h"

namespace solidcull {
namespace {

using Part = std::set<std::int64_t>;

struct Net {
  std::map<std::int64_t, Vec3> places;
  std::map<std::int64_t, std::set<std::int64_t>> partners;
  FrozenContacts contacts;
  mutable long asked = 0;  // for places

  void touch(std::int64_t a, std::int64_t b) {
    contacts.add(a, b, nullptr);
    partners[a].insert(b);
    partners[b].insert(a);
  }
  void take_out(std::int64_t tag) {
    contacts.erase(tag);
    places.erase(tag);
    for (const std::int64_t p : partners[tag]) partners[p].erase(tag);
    partners.erase(tag);
  }
  std::vector<Part> parts(const std::vector<std::int64_t>& cut) const {
    std::vector<Part> found;
    for (const auto& part : parts_that_came_off(
             cut, contacts, [&](std::int64_t tag) { return places.count(tag) != 0; },
             [&](std::int64_t tag) {
               ++asked;
               return places.at(tag);
             })) {
      found.emplace_back(part.begin(), part.end());
      EXPECT_EQ(found.back().size(), part.size()) << "a granule is in its part once";
    }
    return found;
  }
  Part all_around(std::int64_t tag) const {
    Part reached = {tag};
    std::vector<std::int64_t> queue = {tag};
    for (std::size_t at = 0; at < queue.size(); ++at) {
      const auto found = partners.find(queue[at]);
      if (found == partners.end()) continue;
      for (const std::int64_t p : found->second)
        if (reached.insert(p).second) queue.push_back(p);
    }
    return reached;
  }
  /// The connected parts that hold one of these; all but one must have come off, and the largest must not if it is alone that
  /// large.
  void expect_all_but_the_largest(const std::vector<std::int64_t>& cut) const {
    std::set<Part> all;
    for (const std::int64_t tag : cut) all.insert(all_around(tag));
    const std::vector<Part> off = parts(cut);
    std::set<Part> left = all;
    for (const Part& part : off) EXPECT_EQ(left.erase(part), 1u);
    ASSERT_EQ(left.size(), cut.empty() ? 0u : 1u);
    if (left.empty()) return;
    std::size_t searches = 0;  // of the part that is left: it may close early only where it has one and others have more
    for (const std::int64_t tag : cut) searches += left.begin()->count(tag);
    if (searches == 1) {
      for (const Part& part : off) {
        std::size_t theirs = 0;
        for (const std::int64_t tag : cut) theirs += part.count(tag);
        if (theirs == 1) {
          EXPECT_LE(part.size(), left.begin()->size());
        }
      }
    }
  }
};

Net block(int nx, int ny, int nz) {
  Net net;
  const auto tag = [&](int i, int j, int k) { return static_cast<std::int64_t>(1 + i + nx * (j + ny * k)); };
  for (int i = 0; i < nx; ++i)
    for (int j = 0; j < ny; ++j)
      for (int k = 0; k < nz; ++k) {
        net.places[tag(i, j, k)] = Vec3(i, j, k);
        if (i) net.touch(tag(i, j, k), tag(i - 1, j, k));
        if (j) net.touch(tag(i, j, k), tag(i, j - 1, k));
        if (k) net.touch(tag(i, j, k), tag(i, j, k - 1));
      }
  return net;
}

TEST(PartsThatCameOff, nothing_comes_off_where_nothing_or_one_place_is_cut) {
  const Net net = block(4, 4, 4);
  EXPECT_TRUE(net.parts({}).empty());
  EXPECT_TRUE(net.parts({7}).empty());
  EXPECT_TRUE(net.parts({7, 8, 30}).empty());
}

TEST(PartsThatCameOff, the_smaller_half_of_a_chain_comes_off) {
  Net net = block(30, 1, 1);
  net.take_out(11);
  const std::vector<Part> off = net.parts({10, 12});
  ASSERT_EQ(off.size(), 1u);
  EXPECT_EQ(off.front(), net.all_around(1));
  EXPECT_EQ(off.front().size(), 10u);
}

TEST(PartsThatCameOff, granules_left_alone_come_off_one_by_one) {
  Net net = block(20, 20, 1);
  std::vector<std::int64_t> cut;
  for (const std::int64_t alone : {105, 110, 115}) {
    for (const std::int64_t p : std::set<std::int64_t>(net.partners[alone])) {
      for (const std::int64_t q : net.partners[p])
        if (q != alone) cut.push_back(q);
      net.take_out(p);
    }
    cut.push_back(alone);
  }
  std::sort(cut.begin(), cut.end());
  cut.erase(std::unique(cut.begin(), cut.end()), cut.end());
  cut.erase(std::remove_if(cut.begin(), cut.end(), [&](std::int64_t t) { return !net.places.count(t); }), cut.end());
  EXPECT_EQ(net.parts(cut).size(), 3u);
  net.expect_all_but_the_largest(cut);
}

TEST(PartsThatCameOff, two_sides_of_a_hole_meet_around_it) {
  constexpr int n = 41, middle = 20, hole = 12;
  Net net = block(n, n, n);
  const auto tag = [](int i, int j, int k) { return static_cast<std::int64_t>(1 + i + n * (j + n * k)); };
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      for (int k = 0; k < n; ++k)
        if ((Vec3(i, j, k) - Vec3::Constant(middle)).norm() <= hole) net.take_out(tag(i, j, k));
  EXPECT_TRUE(net.parts({tag(middle, middle, middle - hole - 1), tag(middle, middle, middle + hole + 1)}).empty());
  EXPECT_LT(net.asked, 6000) << "of " << net.places.size() << ": one that goes equally far in all directions meets most of them";
}

TEST(PartsThatCameOff, random_nets_fall_apart_as_a_plain_search_says) {
  std::mt19937 random(3);
  for (int n = 0; n < 40; ++n) {
    Net net = block(12, 12, 6);
    std::set<std::int64_t> cut;
    const int out = 200 + static_cast<int>(random() % 500);
    for (int k = 0; k < out; ++k) {
      const std::int64_t tag = 1 + static_cast<std::int64_t>(random() % 864);
      if (!net.places.count(tag)) continue;
      const std::set<std::int64_t> around = net.partners[tag];
      net.take_out(tag);
      cut.erase(tag);
      cut.insert(around.begin(), around.end());
    }
    net.expect_all_but_the_largest({cut.begin(), cut.end()});
  }
}

}  // namespace
}  // namespace solidcull
