// Invariant I3: cull, then restore with nothing having moved, is as if nothing had been done.
#include <gtest/gtest.h>

#include <cmath>

#include "engine.h"

namespace decks {
namespace {

constexpr double diameter = 0.0026;

struct Case {
  Bed bed;
  std::string cover;  // keywords of the fix

  friend void PrintTo(const Case& c, std::ostream* out) { *out << c.bed.name << ", " << c.cover; }
};

const char* const sleep = "exterior sleep";

class NoOp : public testing::TestWithParam<Case> {};

TEST_P(NoOp, ForcesHistoriesAndFuture) {
  const Bed& bed = GetParam().bed;
  const std::string deck = read_bed(bed);
  const std::string looks = "run 100\nrun 0\n";  // the last look chooses, the next run's setup culls

  Engine never;
  never.run(deck + looks);
  Engine culled;
  culled.run(deck + "fix cull all solid/cull exterior live every 50 calm 2 speed 0.05 tolerance 12 0 " + GetParam().cover + "\n" +
             looks);
  const double interior = culled.vector("cull", 3), interface = culled.vector("cull", 2);
  EXPECT_GT(interior, 0.1 * bed.granules) << "nothing was stored: the test shows nothing";
  EXPECT_GT(interface, 0.05 * bed.granules);
  EXPECT_EQ(static_cast<double>(culled.state().size()) + interior, never.state().size());
  culled.run("unfix cull\n");

  const State a = never.state(), b = culled.state();
  expect_same_granules(a, b);
  EXPECT_EQ(largest_difference(a, b, &Granule::x), 0.0);
  EXPECT_EQ(largest_difference(a, b, &Granule::v), 0.0);
  EXPECT_EQ(largest_difference(a, b, &Granule::omega), 0.0);

  never.run("run 0\n");
  culled.run("run 0\n");
  const State fa = never.state(), fb = culled.state();
  // relative to a contact force: at rest the sums are nearly zero. The contacts at the floor carry the bed, 13 granules each
  const double contact_force = 13 * fa.begin()->second.mass * 9.81;
  EXPECT_LE(largest_difference(fa, fb, &Granule::f), 1e-12 * contact_force);
  EXPECT_LE(largest_difference(fa, fb, &Granule::torque), 1e-12 * contact_force * diameter / 2);

  ASSERT_NO_FATAL_FAILURE(expect_same_histories(never.histories(), culled.histories()));

  never.run("run 1000\n");
  culled.run("run 1000\n");
  const double drift = largest_difference(never.state(), culled.state(), &Granule::x);
  EXPECT_LE(drift, 1e-9 * diameter);
  if (never.rank() == 0)
    std::printf("%s: %g interior, %g interface of %zu; dx/d after 1000 steps %.3g\n", bed.name.c_str(), interior, interface,
                a.size(), drift / diameter);
}

Bed bed(const std::string& name, const std::string& contact, bool mesh = false, bool cohesion = false) {
  Bed b;
  b.name = name;
  b.contact = contact;
  b.mesh_walls = mesh;
  b.cohesion = cohesion;
  if (contact.find("hooke") != std::string::npos) b.dt = 2e-5;  // stiffer at low speed: 3e-5 s would shake the bed
  return b;
}

Bed periodic() {
  Bed b = bed("hertz_history_periodic", "model hertz tangential history rolling_friction epsd2");
  b.periodic = true;
  return b;
}

const char* cover = "depth 1.5";

INSTANTIATE_TEST_SUITE_P(
    Models, NoOp,
    testing::Values(
        Case{bed("hertz_history_epsd2", "model hertz tangential history rolling_friction epsd2"), cover},
        Case{bed("hertz_history_mesh", "model hertz tangential history", true), cover},
        Case{bed("hertz_plain", "model hertz tangential no_history"), cover},
        Case{bed("hertz_off", "model hertz tangential off"), cover},
        Case{bed("hertz_cdt", "model hertz tangential history rolling_friction cdt"), cover},
        Case{bed("hooke_history", "model hooke tangential history"), cover},
        Case{bed("hooke_history_epsd_mesh", "model hooke tangential history rolling_friction epsd", true), cover},
        Case{bed("hooke_plain_mesh", "model hooke tangential no_history", true), cover},
        Case{bed("hertz_sjkr", "model hertz tangential history cohesion sjkr", false, true), cover},
        Case{bed("hertz_sjkr_mesh", "model hertz tangential history cohesion sjkr rolling_friction epsd2", true, true), cover},
        Case{periodic(), cover}, Case{bed("hertz_history_epsd2", "model hertz tangential history rolling_friction epsd2"), sleep},
        Case{bed("hertz_history_mesh", "model hertz tangential history", true), sleep},
        Case{bed("hooke_history_epsd_mesh", "model hooke tangential history rolling_friction epsd", true), sleep}),
    [](const testing::TestParamInfo<Case>& info) { return info.param.bed.name + (info.param.cover == sleep ? "_sleep" : ""); });

}  // namespace
}  // namespace decks
