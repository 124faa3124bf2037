// `store none restore refill`: sites for what goes, a packing for what comes back, the energy of new contacts.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "sites.h"
#include "world_parts.h"

namespace solidcull {
namespace {

constexpr int edge = 6;

Settings refilling(bool on = true) {
  Settings s = sleeping_settings();
  if (on) s.store = Store::none, s.restore = Restore::refill;
  return s;
}

/// A cube of granules in empty space, one body.
struct Cube {
  explicit Cube(const Settings& settings, const SmallDeck& deck = empty_space()) : world(deck), parts(world, settings, 2 * r) {
    std::vector<std::int64_t> tags;
    for (int n = 0; n < edge * edge * edge; ++n) {
      world.add(n + 1, pressed * Vec3(n % edge, n / edge % edge, n / edge / edge), r);
      tags.push_back(n + 1);
    }
    world.reneighbour();
    world.compute_forces();
    parts.lock(tags);
    parts.walls.update({}, false);
  }
  /// Atoms in the middle, from the last to the first.
  std::vector<int> deep() {
    parts.bed.index.index(world.atoms);
    std::vector<int> atoms;
    for (int i = world.atoms.owned - 1; i >= 0; --i) {
      const int n = world.atoms.tag[i] - 1;
      const auto inside = [](int k) { return k > 0 && k < edge - 1; };
      if (inside(n % edge) && inside(n / edge % edge) && inside(n / edge / edge)) atoms.push_back(i);
    }
    return atoms;
  }
  std::size_t put_away() {
    return parts.refill.put_away(deep(), [](int, const Sphere&) { return false; });
  }
  /// The largest, as a share of the radii's sum.
  double overlap() const {
    double most = 0;
    for (int i = 0; i < world.atoms.owned; ++i)
      for (int j = 0; j < i; ++j) most = std::max(most, 1 - (world.atoms.place(i) - world.atoms.place(j)).norm() / (2 * r));
    return most;
  }
  SmallWorld world;
  WorldParts parts;
};

TEST(Refill, what_goes_to_the_store_takes_a_site_of_its_own) {
  Cube cube(refilling());
  const std::size_t went = cube.put_away();
  EXPECT_GT(went, 40u);
  EXPECT_LE(went, 64u);
  EXPECT_EQ(cube.parts.bed.solid.store().size(), went);
  EXPECT_EQ(cube.world.atoms.owned, edge * edge * edge - static_cast<int>(went));
  const Sites sites(2 * r);
  std::set<Sites::Number> taken;
  cube.parts.bed.solid.store().for_each([&](const Resident& g) {
    const Sites::Number site = sites.nearest(g.position, g.radius);
    EXPECT_EQ(sites.place(site), g.position);
    EXPECT_TRUE(taken.insert(site).second) << "two share a site";
  });
}

TEST(Refill, where_something_would_be_near_nothing_goes) {
  Cube cube(refilling());
  EXPECT_EQ(cube.parts.refill.put_away(cube.deep(), [](int, const Sphere&) { return true; }), 0u);
  EXPECT_EQ(cube.parts.bed.solid.store().size(), 0u);
}

TEST(Refill, no_site_is_near_a_wall) {
  SmallDeck deck = empty_space();
  deck.planes = {SmallDeck::ground(1.5 * 2 * r)};
  Cube cube(refilling(), deck);
  cube.put_away();
  ASSERT_GT(cube.parts.bed.solid.store().size(), 10u);
  const double gap = (ShellClosure::wall_gap_in_skins + ShellClosure::wall_check_in_skins) * cube.world.run.skin;
  cube.parts.bed.solid.store().for_each(
      [&](const Resident& g) { EXPECT_GT(g.position[2] - r, deck.planes[0].point[2] + gap - 1e-12); });
}

TEST(Refill, what_comes_back_is_packed_between_what_is_there_once) {
  Cube cube(refilling());
  cube.put_away();
  std::vector<std::int64_t> stored;
  cube.parts.bed.solid.store().for_each([&](const Resident& g) { stored.push_back(g.tag); });
  cube.parts.refill.begin_change();
  EXPECT_FALSE(cube.parts.refill.pack());
  EXPECT_TRUE(cube.parts.refill.fetch(stored));
  EXPECT_GT(cube.overlap(), 0.05);
  EXPECT_TRUE(cube.parts.refill.pack());
  EXPECT_LT(cube.overlap(), 0.03);
  EXPECT_FALSE(cube.parts.refill.pack());
  EXPECT_EQ(cube.world.atoms.owned, edge * edge * edge);
  for (int i = 0; i < cube.world.atoms.owned; ++i) {  // the body knows where they stand
    const Locked& e = cube.parts.bed.shell[i];
    EXPECT_LT((cube.parts.bed.solid.bodies().pose(e.body).to_world(e.place) - cube.world.atoms.place(i)).norm(), 1e-12);
  }
}

TEST(Refill, a_store_that_keeps_places_has_no_part_in_it) {
  Cube cube(refilling(false));
  EXPECT_FALSE(cube.parts.refill.acts());
  cube.parts.put_away({44});
  const Vec3 place = cube.parts.bed.solid.in_world(*cube.parts.bed.solid.store().find(44));
  const int i = cube.parts.exchange.bring_back(44);
  EXPECT_FALSE(cube.parts.refill.pack());
  EXPECT_EQ(cube.world.atoms.place(i), place);
}

TEST(Refill, energy_is_counted_of_contacts_that_were_not_there_before) {
  for (const bool known : {false, true}) {
    SmallDeck deck = empty_space();
    SmallWorld world(deck);
    WorldParts parts(world, refilling(), 2 * r);
    const double overlap = 1e-5;  // m
    world.add(1, Vec3::Zero(), r);
    world.add(2, Vec3(2 * r - overlap, 0, 0), r);
    world.reneighbour();
    if (known) world.atoms.histories(world.at(1))[2] = world.atoms.histories(world.at(2))[1] = {0, 0, 0};
    FlatMap<char> freed;
    freed[2] = 1;
    parts.refill.note_freed(freed);
    parts.refill.count_energy_of_new_contacts();
    EXPECT_NEAR(parts.bed.solid.ledger().energy_added(), known ? 0 : 0.5 * deck.stiffness * overlap * overlap, 1e-18) << known;
    parts.refill.count_energy_of_new_contacts();  // once
    EXPECT_NEAR(parts.bed.solid.ledger().energy_added(), known ? 0 : 0.5 * deck.stiffness * overlap * overlap, 1e-18) << known;
  }
}

}  // namespace
}  // namespace solidcull
