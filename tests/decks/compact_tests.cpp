// `store compact`: of a culled granule all comes back, but of the histories of its contacts with others in the store few bits.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "engine.h"

namespace decks {
namespace {

constexpr double diameter = 0.0026;
const char* rolling = "model hertz tangential history rolling_friction epsd2";
const char* compact = "fix cull all solid/cull every 50 calm 2 speed 0.05 tolerance 12 0 exterior sleep store compact\n";
// quick looks ask for a fifth of the speed, and what bears little need not be calm for longer
const char* compact_at_once = "fix cull all solid/cull calm 2 speed 0.25 tolerance 12 0 exterior sleep store compact\n";

double f(Engine& e, int n) { return e.vector("cull", n); }

Bed bed(const std::string& name, const std::string& contact = rolling) {
  Bed b;
  b.name = name;
  b.contact = contact;
  return b;
}

double energy_of_motion(const State& s) {
  double sum = 0;
  for (const auto& g : s)
    for (int d = 0; d < 3; ++d)
      sum += 0.5 * g.second.mass * (g.second.v[d] * g.second.v[d] + 0.4 * std::pow(g.second.radius * g.second.omega[d], 2));
  return sum;
}
double energy_of_height(const State& s) {
  double sum = 0;
  for (const auto& g : s) sum += g.second.mass * 9.81 * g.second.x[2];
  return sum;
}

class Compact : public testing::TestWithParam<Bed> {};

TEST_P(Compact, CullAndRestoreKeepsAllButBitsOfHistories) {
  const Bed& b = GetParam();
  const std::string looks = "run 6\nrun 0\n";  // the second look, 5 steps after the first, chooses, the next run's setup culls
  Engine never, culled;
  never.run(read_bed(b) + looks);
  culled.run(read_bed(b) + compact_at_once + looks);
  const double interior = f(culled, 3);
  EXPECT_GT(interior, 0.5 * b.granules);
  EXPECT_NEAR(f(culled, 11), 0, 1e-15 * f(culled, 5)) << "mass error";
  culled.run("unfix cull\n");
  expect_same_granules(never.state(), culled.state());
  EXPECT_EQ(largest_difference(never.state(), culled.state(), &Granule::x), 0.0);
  EXPECT_EQ(largest_difference(never.state(), culled.state(), &Granule::v), 0.0);
  EXPECT_EQ(largest_difference(never.state(), culled.state(), &Granule::omega), 0.0);

  never.run("run 0\n");
  culled.run("run 0\n");
  if (never.histories().empty()) {  // then all of the force follows from places and motion
    const double contact_force = 13 * never.state().begin()->second.mass * 9.81;
    EXPECT_LE(largest_difference(never.state(), culled.state(), &Granule::f), 1e-12 * contact_force);
  }
  const Histories ha = never.histories(), hb = culled.histories();
  EXPECT_EQ(ha.size(), hb.size());
  double off = 0, scale = 0;
  std::size_t whole = 0, rounded = 0, lost = 0;
  const auto size = [](const std::vector<double>& h, std::size_t first) {
    return std::hypot(h[first], h[first + 1], h[first + 2]);
  };
  for (const auto& h : ha) scale = std::max(scale, size(h.second, 0));
  for (const auto& h : ha) {
    const auto other = hb.find(h.first);
    ASSERT_NE(other, hb.end()) << h.first.first << " and " << h.first.second << " touch no more";
    bool same = true, none = true;
    double worst = 0;
    for (std::size_t v = 0; v + 2 < h.second.size(); v += 3) {  // shear, rolling torque
      std::vector<double> difference;
      for (std::size_t d = v; d < v + 3; ++d) difference.push_back(other->second[d] - h.second[d]);
      none = none && size(other->second, v) == 0;
      same = same && size(difference, 0) <= 1e-12 * scale;
      if (size(h.second, v) > 0) worst = std::max(worst, size(difference, 0) / size(h.second, v));
    }
    whole += same;
    lost += none && !same;
    rounded += !none && !same;
    if (!none && !same) off = std::max(off, worst);
  }
  EXPECT_LE(off, 0.05) << "1 % in the plane of contact; what the engine has left across it is not kept";
  EXPECT_LE(lost, 2 + ha.size() / 1000) << "two partners with one key";
  for (int k = 0; k <= 4; ++k) {
    const State a = never.state(), c = culled.state();
    if (never.rank() == 0)
      std::printf(
          "%s: %g interior, histories: %zu whole, %zu off by up to %.2g, %zu lost; after %d steps dx/d %.3g, kinetic %.3g and "
          "%.3g J, "
          "height %+.3g J\n",
          b.name.c_str(), interior, whole, rounded, off, lost, 250 * k, largest_difference(a, c, &Granule::x) / diameter,
          energy_of_motion(a), energy_of_motion(c), energy_of_height(c) - energy_of_height(a));
    if (k < 4) {
      never.run("run 250\n");
      culled.run("run 250\n");
    }
  }
  const double apart = largest_difference(never.state(), culled.state(), &Granule::x);
  EXPECT_LE(apart, 1e-4 * diameter) << "contacts bear what they bore";
  EXPECT_LE(energy_of_motion(culled.state()), energy_of_motion(never.state()) * 1.1 + 1e-13);
}

Bed periodic() {
  Bed b = bed("compact_periodic");
  b.periodic = true;
  return b;
}

INSTANTIATE_TEST_SUITE_P(Beds, Compact,
                         testing::Values(bed("compact_rolling"), bed("compact_plain", "model hertz tangential no_history"),
                                         periodic()),
                         [](const testing::TestParamInfo<Bed>& info) { return info.param.name; });

const char* rain =
    "lattice sc 0.004\nregion rain block 0.006 0.020 0.006 0.020 0.05 0.065 units box\ncreate_atoms 1 region rain\n"
    "group rain id > 1300\nset group rain diameter 0.0026\nset group rain density 2500\nvelocity rain set 0 0 -1.0\n";

TEST(CompactScenes, RainOnACompactBedLosesNothing) {
  for (Bed b : {bed("compact_rolling"), periodic()}) {
    Engine e;
    e.run(read_bed(b) + compact + "run 300\n");
    ASSERT_GT(f(e, 3), 900);
    e.run(rain);
    const double all = 1300 + 64;
    for (int k = 0; k < 12; ++k) {
      e.run("run 250\n");
      EXPECT_EQ(f(e, 1) + f(e, 2) + f(e, 3), all);
      EXPECT_NEAR(f(e, 11), 0, 1e-12 * 0.03) << "mass error";
    }
    EXPECT_GT(f(e, 7), 30) << "restored: the rain wakes what it hits";
    const double interior = f(e, 3);
    e.run("unfix cull\nrun 0\n");
    const State end = e.state();
    EXPECT_EQ(static_cast<double>(end.size()), all);
    for (int tag = 1; tag <= 1300; ++tag) ASSERT_TRUE(end.count(tag)) << tag << " is lost";
    if (e.rank() == 0) std::printf("%s: %g of %g interior at the end\n", b.name.c_str(), interior, all);
  }
}

TEST(CompactScenes, ARestartGoesOnWhereItStopped) {
  const Bed b = bed("compact_rolling");
  Engine straight;
  straight.run(read_bed(b) + "run 0\n" + rain + compact + "run 400\nwrite_restart compact.restart\nrun 800\n");
  const std::string from = head(b) + "read_restart compact.restart\nneighbor 0.0004 bin\nneigh_modify delay 0\n" + body(b) +
                           "fix integr all nve/sphere\nthermo 100000\nthermo_modify norm no\n";
  Engine again;
  again.run(from + compact + "run 0\n");
  EXPECT_GT(f(again, 3), 500);
  again.run("run 800\n");
  for (const int n : {1, 2, 3}) EXPECT_EQ(f(again, n), f(straight, n)) << "f_cull[" << n << "]";
  straight.run("unfix cull\nrun 0\n");
  again.run("unfix cull\nrun 0\n");
  const double apart = largest_difference(straight.state(), again.state(), &Granule::x);
  EXPECT_LE(apart, 1e-9 * diameter);
  // the file holds what an exact store needs too, and the other way
  Engine exact;
  std::string other = compact;
  other.replace(other.find("compact"), 7, "exact");
  exact.run(from + other + "run 0\nwrite_restart exact.restart\n");
  EXPECT_GT(f(exact, 3), 500);
  Engine back;
  std::string file = from;
  file.replace(file.find("compact.restart"), 15, "exact.restart");
  back.run(file + compact + "run 0\nunfix cull\nrun 0\n");
  exact.run("unfix cull\nrun 0\n");
  EXPECT_EQ(exact.state().size(), straight.state().size());
  EXPECT_EQ(back.state().size(), straight.state().size());
  if (straight.rank() == 0) std::printf("after 800 steps: %.3g d apart\n", apart / diameter);
}

}  // namespace
}  // namespace decks
