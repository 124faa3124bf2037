#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

#include "granule_store.h"
#include "sites.h"
#include "sphere_relaxation.h"

namespace solidcull {
namespace {

constexpr double d = 0.0026;  // m

TEST(PackedTile, is_as_dense_as_it_says_and_hardly_overlaps) {
  const PackedTile& tile = PackedTile::one();
  ASSERT_EQ(tile.centres.size(), static_cast<std::size_t>(PackedTile::spheres));
  EXPECT_NEAR(PackedTile::spheres * M_PI / 6 / std::pow(tile.edge, 3), PackedTile::solid_fraction, 1e-12);
  double largest = 0;
  for (std::size_t i = 0; i < tile.centres.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      Vec3 apart = tile.centres[i] - tile.centres[j];
      for (int k = 0; k < 3; ++k) apart[k] -= tile.edge * std::round(apart[k] / tile.edge);
      largest = std::max(largest, 1 - apart.norm());
    }
  EXPECT_LT(largest, 0.005);
  EXPECT_NEAR(largest, tile.largest_overlap, 1e-12);
  for (const Vec3& c : tile.centres) EXPECT_TRUE((c.array() >= 0).all() && (c.array() < tile.edge).all());
}

TEST(PackedTile, is_the_same_each_time) { EXPECT_EQ(PackedTile().centres, PackedTile::one().centres); }

TEST(Sites, are_found_again_by_their_places) {
  const Sites sites(d);
  for (const double radius : {0.1 * d, 0.5 * d, 3.0 * d})
    for (const Vec3& at : {Vec3(0, 0, 0), Vec3(-0.3, 0.2, 0.01), Vec3(1, -2, 3)}) {
      const std::vector<Vec3> around = sites.around(at, radius, 1.5);
      ASSERT_GT(around.size(), 8u);
      EXPECT_TRUE(std::is_sorted(around.begin(), around.end(),
                                 [&](const Vec3& a, const Vec3& b) { return (a - at).norm() < (b - at).norm() - 1e-12; }));
      for (const Vec3& place : around) EXPECT_EQ(sites.place(sites.nearest(place, radius)), place);
      EXPECT_EQ(sites.place(sites.nearest(at, radius)), around.front());
    }
}

TEST(Sites, fill_space_in_each_octave) {
  const Sites sites(d);
  for (const double size : {0.25, 1.0, 4.0}) {
    const double diameter = size * d;
    EXPECT_DOUBLE_EQ(sites.diameter_of(0.5 * diameter), diameter);
    const double spheres = static_cast<double>(sites.around(Vec3(0.1, 0.2, 0.3), 0.5 * diameter, 6).size());
    EXPECT_NEAR(spheres * std::pow(0.5 / 6, 3), PackedTile::solid_fraction, 0.03) << size;
  }
}

TEST(Sites, too_far_out_is_refused) {
  const Sites sites(d);
  const double far = sites.farthest();
  EXPECT_GT(far, 30000 * d);
  EXPECT_NO_THROW(sites.nearest(Vec3(0.99 * far, 0, 0), 0.5 * d / 16));
  EXPECT_THROW(sites.nearest(Vec3(1.01 * far, 0, 0), 0.5 * d / 16), std::range_error);
}

TEST(GranuleStore, of_sites_keeps_all_but_place_and_load_change) {
  const Sites sites(d);
  GranuleStore store(2 * d, sites);
  std::set<std::array<double, 3>> taken;
  const int granules = 200;
  for (int tag = 1; tag <= granules; ++tag) {
    StoredGranule g;
    g.tag = tag;
    g.body = 1;
    g.radius = 0.5 * d;
    g.mass = 1e-5 * tag;
    g.type = tag % 3;
    g.normal_load = 0.5;
    g.load_change = Vec3(1, 2, 3);
    const Vec3 place(0.004 * std::sin(tag), 0.004 * std::cos(3 * tag), 0.004 * std::sin(7 * tag));
    const auto site = store.free_site(1, place, g.radius, 4, [](const Vec3&) { return true; });
    ASSERT_TRUE(site);
    g.position = *site;
    const double record[] = {1.0 * tag, 7};
    store.add(g, record, 2);
    EXPECT_TRUE(taken.insert({(*site)[0], (*site)[1], (*site)[2]}).second) << "two share a site";
    const StoredGranule back = store.get(tag);
    EXPECT_EQ(back.position, *site);
    EXPECT_EQ(back.mass, g.mass);
    EXPECT_EQ(back.type, g.type);
    EXPECT_NEAR(back.normal_load, g.normal_load, 0.002);
  }
  std::vector<double> record;
  for (int tag = 1; tag <= granules; ++tag) {
    const StoredGranule back = store.take(tag, record);
    EXPECT_EQ(record, (std::vector<double>{1.0 * tag, 7}));
    EXPECT_EQ(back.radius, 0.5 * d);
  }
  EXPECT_EQ(store.size(), 0u);
}

TEST(GranuleStore, of_sites_takes_less_than_any_other) {
  const auto bytes = [](GranuleStore store) {
    for (int tag = 1; tag <= 20000; ++tag) {
      StoredGranule g;
      g.tag = tag;
      g.body = 1;
      g.radius = 0.5 * d;
      g.mass = 1e-5;
      g.position = d * Vec3(tag % 25, tag / 25 % 25, tag / 625);
      store.add(g, nullptr, 0);
    }
    return store.bytes_per_granule();
  };
  const Sites sites(d);
  const double at_sites = bytes(GranuleStore(2 * d, sites));
  EXPECT_LT(at_sites, bytes(GranuleStore(2 * d, GranuleStore::Precision::rounded)) - 5);
  EXPECT_LT(at_sites, bytes(GranuleStore(2 * d)) - 10);
}

// ------------------------------------------------------------------------------------------------------------ relaxation

TEST(SphereRelaxation, parts_two_and_leaves_fixed_ones_alone) {
  SphereRelaxation r({{{Vec3(0, 0, 0), 1}, {Vec3(0.5, 0, 0), 1}}, {}, {{Vec3(-1.5, 0, 0), 1}}, {}}, Vec3::Zero());
  EXPECT_LE(r.relax(500, 1e-6), 1e-6);
  EXPECT_GE((r.spheres()[0].centre - r.spheres()[1].centre).norm(), 2 - 1e-5);
  EXPECT_GE((r.spheres()[0].centre - Vec3(-1.5, 0, 0)).norm(), 2 - 1e-5);
}

TEST(SphereRelaxation, parts_what_lies_in_one_place) {
  SphereRelaxation r({{{Vec3(0, 0, 0), 1}, {Vec3(0, 0, 0), 1}, {Vec3(0, 0, 0), 1}}, {}, {}, {}}, Vec3::Zero());
  EXPECT_LE(r.relax(500, 1e-6), 1e-6);
}

TEST(SphereRelaxation, sees_through_periodic_sides) {
  SphereRelaxation r({{{Vec3(0.1, 5, 5), 1}, {Vec3(9.9, 5, 5), 1}}, {}, {}, {}}, Vec3::Constant(10));
  EXPECT_LE(r.relax(500, 1e-6), 1e-6);
  EXPECT_NEAR((r.spheres()[1].centre - r.spheres()[0].centre)[0], 8, 1e-4);
}

TEST(SphereRelaxation, stiff_ones_keep_their_own_overlaps_and_give_way_less) {
  SphereRelaxation r({{{Vec3(0, 0, 0), 1}}, {{Vec3(1, 0, 0), 1}, {Vec3(2.9, 0, 0), 1}}, {}, {}}, Vec3::Zero());
  EXPECT_LE(r.relax(1000, 1e-6), 1e-5);
  const auto& s = r.spheres();
  EXPECT_GE((s[1].centre - s[2].centre).norm(), 1.9 - 1e-4);
  EXPECT_LT(s[1].centre[0] - 1, -s[0].centre[0]) << "the stiff one moved as far as the free one";
}

TEST(SphereRelaxation, nothing_goes_where_it_may_not) {
  SphereRelaxation r({{{Vec3(0, 0, 0), 1}}, {}, {{Vec3(0.5, 0, 0), 1}}, {}}, Vec3::Zero());
  r.keep_to([](std::size_t, const Vec3& place) { return place[0] > -0.7; });
  r.relax(200, 1e-6);
  EXPECT_GT(r.spheres()[0].centre[0], -0.7);
}

TEST(SphereRelaxation, what_is_caught_finds_a_gap) {
  // a lattice with one sphere too many in one cell, and one missing in another
  SphereRelaxation::Spheres all;
  for (int i = 0; i < 5; ++i)
    for (int j = 0; j < 5; ++j)
      for (int k = 0; k < 5; ++k) {
        const bool inner = i > 0 && i < 4 && j > 0 && j < 4 && k > 0 && k < 4;
        if (!(i == 3 && j == 2 && k == 2)) (inner ? all.free : all.fixed).push_back({2.0 * Vec3(i, j, k), 1});
      }
  all.free.push_back({Vec3(3, 4, 4), 1});
  SphereRelaxation r(std::move(all), Vec3::Zero());
  double overlap = r.relax(300, 1e-4);
  for (int n = 0; n < 10 && overlap > 0.01 && r.reseat(0.01, 6) > 0; ++n) overlap = r.relax(300, 1e-4);
  EXPECT_LT(overlap, 0.01);
}

}  // namespace
}  // namespace solidcull
