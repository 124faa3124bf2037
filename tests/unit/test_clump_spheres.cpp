#include <gtest/gtest.h>

#include <set>

#include "world_parts.h"

namespace solidcull {
namespace {

/// Along x: a rod across the border at x = 0 (tags 1 to 3), a single granule (4), and a rod (5 to 7) that is on one rank.
struct Rods {
  explicit Rods(SmallWorld& w) : world(w), parts(w, sleeping_settings(), 2 * r) {
    across = world.clumps.make(1, rod(Vec3(-0.3 * r, 0, 0)), Vec3(0.1, 0, 0), Vec3(0, 0, 2));
    world.add(4, Vec3(-5 * r, 0, 0), r);
    beside = world.clumps.make(5, rod(Vec3(5 * r, 0, 0)));
    world.reneighbour();
    parts.bed.index.index(world.atoms);
    parts.bed.see_largest_radius();
  }
  static std::vector<Sphere> rod(const Vec3& middle) {
    return {{middle - Vec3(r, 0, 0), r}, {middle, r}, {middle + Vec3(r, 0, 0), r}};
  }
  static SmallDeck deck(int ranks) {
    SmallDeck d = empty_space();
    d.clumps = true;
    d.split = {ranks, 1, 1};
    d.box = {Vec3(-0.1, -0.1, -0.1), Vec3(0.1, 0.1, 0.1)};
    return d;
  }
  const ClumpSpheres& spheres() const { return parts.bed.clump_spheres; }
  int tag(int i) const { return world.atoms.tag[i]; }
  std::size_t owned() const { return static_cast<std::size_t>(world.atoms.owned); }

  SmallWorld& world;
  WorldParts parts;
  int across = 0, beside = 0;
};

void on_one_and_two_ranks(const std::function<void(Rods&)>& work) {
  for (const int ranks : {1, 2})
    run_on_ranks(Rods::deck(ranks), [&](SmallWorld& w) {
      Rods rods(w);
      EXPECT_EQ(w.atoms.owned, ranks == 1 ? 7 : w.ranks.me == 0 ? 3 : 4);  // the first rod has two spheres on rank 0
      work(rods);
    });
}

TEST(ClumpSpheres, unite_the_numbers_of_a_clump_on_all_ranks) {
  on_one_and_two_ranks([](Rods& rods) {
    std::vector<int> tags;
    for (int i = 0; i < rods.world.atoms.owned; ++i) tags.push_back(rods.tag(i));
    rods.spheres().unite(tags, [](int& one, int other) { one += other; });
    for (std::size_t i = 0; i < tags.size(); ++i) {
      const int tag = rods.tag(static_cast<int>(i));
      EXPECT_EQ(tags[i], tag == 4 ? 4 : tag < 4 ? 1 + 2 + 3 : 5 + 6 + 7) << tag;
    }
  });
}

/// In a box with periodic sides each rank hears of its own spheres, too.
TEST(ClumpSpheres, count_a_rank_once_though_its_images_come_too) {
  SmallDeck deck = Rods::deck(2);
  deck.box = {Vec3(-6 * r, -r, -r), Vec3(6 * r, r, r)};  // as narrow as a clump is long
  deck.periodic = {true, true, true};
  run_on_ranks(deck, [](SmallWorld& w) {
    Rods rods(w);
    std::vector<int> ones(rods.owned(), 1);
    rods.spheres().unite(ones, [](int& one, int other) { one += other; });
    for (std::size_t i = 0; i < ones.size(); ++i) EXPECT_EQ(ones[i], rods.tag(static_cast<int>(i)) == 4 ? 1 : 3);
  });
}

TEST(ClumpSpheres, flags_hold_for_all_or_for_any_of_them) {
  for (const int marked : {1, 3, 4, 6})
    on_one_and_two_ranks([&](Rods& rods) {
      std::vector<char> one(rods.owned(), 0), but_one(rods.owned(), 1);
      for (int i = 0; i < rods.world.atoms.owned; ++i)
        if (rods.tag(i) == marked) {
          one[static_cast<std::size_t>(i)] = 1;
          but_one[static_cast<std::size_t>(i)] = 0;
        }
      rods.spheres().any_of(one);
      rods.spheres().all_of(but_one);
      for (int i = 0; i < rods.world.atoms.owned; ++i) {
        const int tag = rods.tag(i);
        const bool with_it = tag == marked || (marked < 4 && tag < 4) || (marked > 4 && tag > 4);
        EXPECT_EQ(one[static_cast<std::size_t>(i)] != 0, with_it) << tag;
        EXPECT_EQ(but_one[static_cast<std::size_t>(i)] == 0, with_it) << tag;
      }
    });
}

TEST(ClumpSpheres, keep_whole_leaves_single_granules_and_whole_clumps) {
  on_one_and_two_ranks([](Rods& rods) {
    std::vector<int> atoms;
    for (int i = 0; i < rods.world.atoms.owned; ++i)
      if (rods.tag(i) != 3) atoms.push_back(i);
    rods.spheres().keep_whole(atoms);
    std::set<int> kept, due;
    for (const int i : atoms) kept.insert(rods.tag(i));
    for (const int tag : {4, 5, 6, 7})
      if (rods.world.at(tag) >= 0) due.insert(tag);
    EXPECT_EQ(kept, due);
  });
}

TEST(ClumpSpheres, near_knows_the_clumps_of_which_spheres_are_here_though_another_rank_moves_them) {
  on_one_and_two_ranks([](Rods& rods) {
    const std::map<int, Clump> near = rods.spheres().near();
    ASSERT_EQ(near.count(rods.across), 1u);
    const Clump& c = near.at(rods.across);
    EXPECT_LT((c.lies.centre - Vec3(-0.3 * r, 0, 0)).norm(), 1e-15);
    EXPECT_EQ(c.velocity, Vec3(0.1, 0, 0));
    EXPECT_LT((c.spin() - Vec3(0, 0, 2)).norm(), 1e-12);
    EXPECT_TRUE(c.rest.empty());
  });
}

TEST(ClumpSpheres, take_brings_a_clump_whole_from_the_rank_that_moves_it) {
  on_one_and_two_ranks([](Rods& rods) {
    // rank 0 moves the one across: its centre is there. The last rank asks for both.
    std::vector<std::pair<int, int>> asked;
    if (rods.world.at(3) >= 0) asked = {{rods.beside, rods.world.at(5)}, {rods.across, rods.world.at(3)}};
    const std::vector<Clump> taken = rods.spheres().take(asked);
    ASSERT_EQ(taken.size(), asked.size());
    for (std::size_t k = 0; k < asked.size(); ++k) {
      EXPECT_EQ(taken[k].number, asked[k].first);
      EXPECT_EQ(taken[k].spheres, 3);
      EXPECT_EQ(taken[k].rest.size(), static_cast<std::size_t>(rods.world.clumps.rest_size));
    }
    EXPECT_EQ(rods.world.clumps.count(), 0);  // no rank moves one any more
  });
}

TEST(ClumpSpheres, a_clump_that_no_rank_moves_is_an_internal_error) {
  run_on_ranks(Rods::deck(2), [](SmallWorld& w) {
    Rods rods(w);
    if (w.clumps.find(rods.across) >= 0) w.clumps.take(rods.across);
    std::vector<std::pair<int, int>> asked;
    if (w.ranks.me == 1) asked = {{rods.across, w.at(3)}};
    if (w.ranks.me == 1)
      EXPECT_THROW(rods.spheres().take(asked), InternalError);
    else
      EXPECT_NO_THROW(rods.spheres().take(asked));
  });
}

TEST(ClumpSpheres, where_there_are_none_nothing_is_asked_of_other_ranks) {
  SmallDeck deck = Rods::deck(2);
  deck.clumps = false;
  run_on_ranks(deck, [](SmallWorld& w) {
    WorldParts parts(w, sleeping_settings(), 2 * r);
    w.add(1, Vec3(-r, 0, 0), r);
    w.add(2, Vec3(r, 0, 0), r);
    w.reneighbour();
    const int before = w.ranks.collectives;
    std::vector<char> flags(static_cast<std::size_t>(w.atoms.owned), 1);
    parts.bed.clump_spheres.all_of(flags);
    EXPECT_TRUE(parts.bed.clump_spheres.near().empty());
    EXPECT_EQ(w.ranks.collectives, before);
  });
}

}  // namespace
}  // namespace solidcull
