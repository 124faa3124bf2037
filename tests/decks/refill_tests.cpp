// `store none restore refill`: of a culled granule no place is kept, and what comes back is packed anew.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "engine.h"

namespace decks {
namespace {

constexpr double diameter = 0.0026;
const double weight_of_one = 2500 * M_PI / 6 * std::pow(diameter, 3) * 9.81;
const std::string refill = " store none restore refill\n";
const std::string culling = "fix cull all solid/cull every 50 calm 2 speed 0.05 tolerance 12 0 ";

double f(Engine& e, int n) { return e.vector("cull", n); }

Bed bed(const std::string& name) {
  Bed b;
  b.name = name;
  return b;
}
Bed periodic() {
  Bed b = bed("refill_periodic");
  b.periodic = true;
  return b;
}

double distance(const Vec& x, const Vec& y, const Bed& b) {
  double square = 0;
  for (int d = 0; d < 3; ++d) {
    double way = y[d] - x[d];
    if (b.periodic && d < 2) way -= b.side * std::round(way / b.side);
    square += way * way;
  }
  return std::sqrt(square);
}

/// Largest overlap of two granules, as a share of the radii's sum.
double largest_overlap(const State& s, const Bed& b) {
  double largest = 0;
  for (auto i = s.begin(); i != s.end(); ++i)
    for (auto j = std::next(i); j != s.end(); ++j)
      largest = std::max(largest, 1 - distance(i->second.x, j->second.x, b) / (i->second.radius + j->second.radius));
  return largest;
}

/// Mean of the highest tenth.
double height(const State& s) {
  std::vector<double> tops;
  for (const auto& g : s) tops.push_back(g.second.x[2] + g.second.radius);
  std::sort(tops.rbegin(), tops.rend());
  double sum = 0;
  const std::size_t tenth = tops.size() / 10;
  for (std::size_t k = 0; k < tenth; ++k) sum += tops[k];
  return sum / static_cast<double>(tenth);
}

double fastest(const State& s) {
  double most = 0;
  for (const auto& g : s) most = std::max(most, std::hypot(g.second.v[0], g.second.v[1], g.second.v[2]));
  return most;
}

struct Scene {
  std::string exterior;
  Bed bed;
  friend void PrintTo(const Scene& s, std::ostream* out) { *out << s.exterior << ' ' << s.bed.name; }
};

class Refill : public testing::TestWithParam<Scene> {};

TEST_P(Refill, GivesBackEachGranuleInANewPacking) {
  const Bed& b = GetParam().bed;
  Engine never, culled;
  never.run(read_bed(b) + "run 301\nrun 0\n");
  culled.run(read_bed(b) + culling + GetParam().exterior + refill + "run 301\n");
  const double interior = f(culled, 3);
  EXPECT_GT(interior, 0.4 * b.granules);
  EXPECT_NEAR(f(culled, 11), 0, 1e-12 * f(culled, 5)) << "mass error";
  culled.run("unfix cull\nrun 0\n");
  const State then = never.state(), packed = culled.state();
  expect_same_granules(then, packed);
  const double overlap = largest_overlap(packed, b), before = largest_overlap(then, b);
  double moved = 0;
  for (const auto& [tag, g] : then) moved += distance(packed.at(tag).x, g.x, b) / b.granules / diameter;
  EXPECT_GT(moved, 0.2) << "places were kept";
  EXPECT_LT(overlap, 0.15);
  if (never.rank() == 0)
    std::printf("%s: %g interior, moved by %.3g d in the mean, largest overlap %.3g (never culled: %.3g)\n", b.name.c_str(),
                interior, moved, overlap, before);
  for (int k = 1; k <= 4; ++k) {
    never.run("run 250\n");
    culled.run("run 250\n");
    const State now = culled.state();
    const double higher = (height(now) - height(never.state())) / diameter;
    if (never.rank() == 0) std::printf("  after %d steps: height %+.3f d, fastest %.3g m/s\n", 250 * k, higher, fastest(now));
    EXPECT_LT(std::abs(higher), 0.3);
    // a granule that falls by three diameters has 0.4 m/s
    EXPECT_LT(fastest(now), 0.6);
    ASSERT_EQ(now.size(), static_cast<std::size_t>(b.granules));
  }
}

INSTANTIATE_TEST_SUITE_P(Scenes, Refill,
                         testing::Values(Scene{"exterior live depth 1.5", bed("refill")}, Scene{"exterior sleep", bed("refill")},
                                         Scene{"exterior sleep", periodic()}),
                         [](const testing::TestParamInfo<Scene>& info) {
                           return (info.param.exterior == "exterior sleep" ? "sleep_" : "live_") + info.param.bed.name;
                         });

TEST(RefillScenes, RainWakesWhatItHitsAndNothingIsLost) {
  for (const Scene& s : {Scene{"exterior sleep", bed("refill")}, Scene{"exterior live depth 1.5", bed("refill")},
                         Scene{"exterior sleep", periodic()}}) {
    Engine e;
    e.run(read_bed(s.bed) + culling + s.exterior + refill + "run 300\n");
    ASSERT_GT(f(e, 3), 200);
    const std::size_t all = rain_on(e, s.bed);
    const double restored = f(e, 7), energy = f(e, 12);
    EXPECT_GT(restored, 30) << "the rain wakes what it hits";
    e.run("unfix cull\nrun 0\n");
    const State end = e.state();
    EXPECT_EQ(end.size(), all);
    for (int tag = 1; tag <= static_cast<int>(all); ++tag) ASSERT_TRUE(end.count(tag)) << tag << " is lost";
    const double each = energy / restored / (weight_of_one * diameter);
    EXPECT_LT(each, 30);
    for (const auto& g : end)
      for (int d = 0; d < 3; ++d) ASSERT_TRUE(std::isfinite(g.second.x[d] + g.second.v[d])) << g.first;
    if (e.rank() == 0)
      std::printf("%s %s: restored %g, energy added %.3g m g d each\n", s.bed.name.c_str(), s.exterior.c_str(), restored, each);
  }
}

/// LIGGGHTS's exchange goes one rank far.
TEST(RefillScenes, PackingsBeyondTheNextRankLoseNothing) {
  const Bed b = bed("refill");
  Engine e;
  e.run(read_bed(b) + culling + "exterior sleep" + refill + "run 300\n");
  ASSERT_GT(f(e, 3), 200);
  const std::size_t all = rain_on(e, b);
  EXPECT_GT(f(e, 7), 30);
  e.run("unfix cull\nrun 0\n");
  const State end = e.state();
  EXPECT_EQ(end.size(), all);
  for (int tag = 1; tag <= static_cast<int>(all); ++tag) ASSERT_TRUE(end.count(tag)) << tag << " is lost";
}

TEST(RefillScenes, ARestartHoldsThemAll) {
  const Bed b = bed("refill");
  const std::string keywords = culling + "exterior sleep" + refill;
  Engine straight;
  straight.run(read_bed(b) + keywords + "run 300\nwrite_restart refill.restart\n");
  const double interior = f(straight, 3);
  ASSERT_GT(interior, 500);
  const std::string from = head(b) + "read_restart refill.restart\nneighbor 0.0004 bin\nneigh_modify delay 0\n" + body(b) +
                           "fix integr all nve/sphere\nthermo 100000\nthermo_modify norm no\n";
  Engine again;
  again.run(from + keywords + "run 0\n");
  EXPECT_EQ(f(again, 3), interior);
  for (Engine* e : {&straight, &again}) {
    e->run("run 200\n");
    expect_all_there(*e, "cull", 1300);
    e->run("unfix cull\nrun 0\n");
  }
  const State a = straight.state(), c = again.state();
  expect_same_granules(a, c);
  EXPECT_LE(largest_difference(a, c, &Granule::x), 1e-6 * diameter);
}

/// Between runs the deck moves a stored granule and takes others out.
TEST(RefillScenes, TheDeckSeesAndChangesTheWholeBed) {
  const Bed b = bed("refill");
  Engine e;
  e.run(read_bed(b) + culling + "exterior sleep" + refill + "run 300\n");
  ASSERT_GT(f(e, 3), 500);
  e.run("group few id <= 40\nset group few density 2600\ngroup gone id > 1290\ndelete_atoms group gone compress no\nrun 100\n");
  expect_all_there(e, "cull", 1290);
  e.run("unfix cull\nrun 0\n");
  const State end = e.state();
  EXPECT_EQ(end.size(), 1290u);
  for (int tag = 1; tag <= 1290; ++tag) ASSERT_TRUE(end.count(tag)) << tag << " is lost";
  for (int tag = 1; tag <= 40; ++tag) {
    const Granule& g = end.at(tag);
    EXPECT_NEAR(g.mass, 2600 * 4 * M_PI / 3 * std::pow(g.radius, 3), 1e-9 * g.mass) << tag;
  }
  EXPECT_LT(largest_overlap(end, b), 0.15);
}

}  // namespace
}  // namespace decks
