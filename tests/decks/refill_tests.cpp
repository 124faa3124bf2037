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

/// Largest overlap of two granules, as a share of the radii's sum.
double largest_overlap(const State& s, const Bed& b) {
  double largest = 0;
  int bins[6] = {};
  const double limit[6] = {.001, .003, .01, .03, .1, .3};
  for (auto i = s.begin(); i != s.end(); ++i)
    for (auto j = std::next(i); j != s.end(); ++j) {
      double square = 0;
      for (int d = 0; d < 3; ++d) {
        double way = j->second.x[d] - i->second.x[d];
        if (b.periodic && d < 2) way -= b.side * std::round(way / b.side);
        square += way * way;
      }
      const double o = 1 - std::sqrt(square) / (i->second.radius + j->second.radius);
      largest = std::max(largest, o);
      for (int k = 0; k < 6; ++k) bins[k] += o > limit[k];
    }
  std::printf("DIAG >.001 %d >.003 %d >.01 %d >.03 %d >.1 %d >.3 %d\n", bins[0], bins[1], bins[2], bins[3], bins[4], bins[5]);
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
  never.run(read_bed(b) + "run 301\n");
  culled.run(read_bed(b) + culling + GetParam().exterior + refill + "run 301\n");
  const double interior = f(culled, 3);
  EXPECT_GT(interior, 0.2 * b.granules);
  EXPECT_NEAR(f(culled, 11), 0, 1e-12 * f(culled, 5)) << "mass error";
  const State before = culled.state();
  culled.run("unfix cull\nrun 0\n");
  never.run("run 0\n");
  expect_same_granules(never.state(), culled.state());
  const State packed = culled.state();
  const double overlap = largest_overlap(packed, b);
  double moved = 0;
  for (const auto& [tag, g] : never.state()) {
    double square = 0;
    for (int d = 0; d < 3; ++d) {
      double way = packed.at(tag).x[d] - g.x[d];
      if (b.periodic && d < 2) way -= b.side * std::round(way / b.side);
      square += way * way;
    }
    moved += std::sqrt(square) / static_cast<double>(b.granules) / diameter;
  }
  if (never.rank() == 0)
    std::printf("%s %s: %g interior, moved by %.3g d in the mean, largest overlap %.3g (never culled: %.3g)\n", b.name.c_str(),
                GetParam().exterior.c_str(), interior, moved, overlap, largest_overlap(never.state(), b));
  for (int k = 0; k < 4; ++k) {
    never.run("run 250\n");
    culled.run("run 250\n");
    if (never.rank() == 0)
      std::printf("  after %d steps: height %+.3f d, fastest %.3g sqrt(g d)\n", 250 * (k + 1),
                  (height(culled.state()) - height(never.state())) / diameter, fastest(culled.state()) / std::sqrt(9.81 * diameter));
  }
  for (const auto& g : culled.state())
    for (int d = 0; d < 3; ++d) ASSERT_TRUE(std::isfinite(g.second.x[d])) << g.first;
}

INSTANTIATE_TEST_SUITE_P(Scenes, Refill,
                         testing::Values(Scene{"exterior live depth 1.5", bed("refill")}, Scene{"exterior sleep", bed("refill")},
                                         Scene{"exterior sleep", periodic()}),
                         [](const testing::TestParamInfo<Scene>& info) {
                           return (info.param.exterior == "exterior sleep" ? "sleep_" : "live_") + info.param.bed.name;
                         });

const char* rain =
    "lattice sc 0.004\nregion rain block 0.006 0.020 0.006 0.020 0.05 0.065 units box\ncreate_atoms 1 region rain\n"
    "group rain id > 1300\nset group rain diameter 0.0026\nset group rain density 2500\nvelocity rain set 0 0 -1.0\n";

TEST(RefillScenes, RainWakesWhatItHitsAndNothingIsLost) {
  for (const Scene& s : {Scene{"exterior sleep", bed("refill")}, Scene{"exterior live depth 1.5", bed("refill")},
                         Scene{"exterior sleep", periodic()}}) {
    Engine e;
    e.run(read_bed(s.bed) + culling + s.exterior + refill + "run 300\n");
    ASSERT_GT(f(e, 3), 200);
    e.run(rain);
    const std::size_t all = 1300 + 64;
    for (int k = 0; k < 12; ++k) {
      e.run("run 250\n");
      expect_all_there(e, "cull", all);
      EXPECT_NEAR(f(e, 11), 0, 1e-12 * 0.03) << "mass error";
      if (e.rank() == 0) std::printf("%g exterior %g interface %g interior; ", f(e, 1), f(e, 2), f(e, 3));
      else f(e,1),f(e,2),f(e,3);
    }
    const double restored = f(e, 7), energy = f(e, 12);
    EXPECT_GT(restored, 30) << "the rain wakes what it hits";
    e.run("unfix cull\nrun 0\n");
    const State end = e.state();
    EXPECT_EQ(end.size(), all);
    for (int tag = 1; tag <= static_cast<int>(all); ++tag) ASSERT_TRUE(end.count(tag)) << tag << " is lost";
    if (e.rank() == 0)
      std::printf("%s %s: restored %g, energy added %.3g m g d each\n", s.bed.name.c_str(), s.exterior.c_str(), restored,
                  energy / restored / (weight_of_one * diameter));
  }
}

}  // namespace
}  // namespace decks
