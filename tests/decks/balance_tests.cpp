// Keyword `balance`: cuts between ranks go to the work, and results stay.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "comm.h"
#include "domain.h"
#include "engine.h"
#include "lammps.h"

namespace decks {
namespace {

/// A bed at rest in one half of a box that is twice as long: ranks of the other half have nothing to do.
std::string half_empty(const Bed& bed) { return read_bed(bed) + "run 0\n"; }

Bed bed_with(bool mesh_walls) {
  Bed bed;
  bed.name = mesh_walls ? "balanced_mesh" : "balanced";
  bed.mesh_walls = mesh_walls;
  bed.box_length = 2 * bed.side;
  if (mesh_walls) bed.extra = "variable load equal -f_floor[3]\n";
  return bed;
}

/// Where the first cut along x is, as a share of the box; 1 where there is none.
double first_cut(Engine& e) { return e.lammps()->comm->xsplit[1]; }
/// Where it cuts off its part of the bed.
double due_cut(Engine& e, const Bed& bed) {
  const LAMMPS_NS::Domain& box = *e.lammps()->domain;
  const int parts = e.lammps()->comm->procgrid[0];
  return parts == 1 ? 1.0 : (bed.side / parts - box.boxlo[0]) / (box.boxhi[0] - box.boxlo[0]);
}

class Balance : public testing::TestWithParam<bool> {};

TEST_P(Balance, BringsCutsToTheBedWhereNothingIsCulled) {
  const Bed bed = bed_with(GetParam());
  Engine stock, moved;
  stock.run(half_empty(bed) + "run 400\n");
  moved.run(half_empty(bed) + "fix cull all solid/cull every 100000 balance 50 1.1\nrun 400\n");
  const State a = stock.state(), b = moved.state();
  expect_same_granules(a, b);
  EXPECT_LT(largest_difference(a, b, &Granule::x), 1e-6) << "sums have another order";
  if (GetParam()) {
    EXPECT_NEAR(moved.variable("load"), stock.variable("load"), 1e-4 * stock.variable("load"));
  }
  EXPECT_NEAR(first_cut(moved), due_cut(moved, bed), 0.02);
}

TEST_P(Balance, HandsOnWhatIsCulledWithItsContactsAndWhatItsWallsBear) {
  const Bed bed = bed_with(GetParam());
  Engine stock, culled;  // stock: of the cuts
  stock.run(half_empty(bed) + "fix cull all solid/cull\nrun 300\n");
  // asleep from the start; cuts move in the very build in which most is culled, and after it
  culled.run(half_empty(bed) + "fix cull all solid/cull balance 10 1.05\nrun 300\n");
  EXPECT_GT(culled.vector("cull", 3), 500) << "interior";
  expect_all_there(culled, "cull", 1300);
  if (GetParam()) {
    EXPECT_NEAR(culled.variable("load"), stock.variable("load"), 1e-4 * stock.variable("load"));
  }
  if (const int parts = culled.lammps()->comm->procgrid[0]; parts > 1) {
    EXPECT_GT(std::abs(first_cut(culled) - 1.0 / parts), 0.01) << "cuts moved over what is culled";
    // most of the work is where the bed is: the cut has gone there. A few atoms are left, too few for more parts than that
    if (parts <= 4) {
      EXPECT_LT(first_cut(culled), 0.9 / parts);
    }
  }
  for (Engine* e : {&stock, &culled}) e->run("unfix cull\nrun 0\n");
  const State a = stock.state(), b = culled.state();
  expect_same_granules(a, b);
  EXPECT_LT(largest_difference(a, b, &Granule::x), 1e-5);
  // both may be as far from the unculled bed as they sleep through
  Engine never;
  never.run(half_empty(bed) + "run 300\n");
  const double slept_through = largest_difference(never.state(), a, &Granule::f);
  if (never.rank() == 0) std::printf("forces: %.3g N slept through without balance\n", slept_through);
  EXPECT_LT(slept_through, 3 * 9.81 * 2.3e-5) << "three granules' weight";
  EXPECT_LT(largest_difference(a, b, &Granule::f), std::max(0.5 * 9.81 * 2.3e-5, slept_through));
}

TEST_P(Balance, FollowsABlow) {
  const Bed bed = bed_with(GetParam());
  const std::string ball =
      "run 0\ncreate_atoms 1 single 0.005 0.005 0.034 units box\ngroup ball id > 1300\nset group ball diameter 0.0052\n"
      "set group ball density 4000\nvelocity ball set 0 0 -1.5\n";
  Engine stock, culled;
  stock.run(read_bed(bed) + ball + "run 600\n");
  culled.run(read_bed(bed) + ball + "fix cull all solid/cull balance 20 1.1\nrun 600\n");
  expect_all_there(culled, "cull", 1301);
  culled.run("unfix cull\nrun 0\n");
  const State a = stock.state(), b = culled.state();
  expect_same_granules(a, b);
  EXPECT_NEAR(b.at(1301).x[2], a.at(1301).x[2], 5e-4) << "how deep it went";
}

INSTANTIATE_TEST_SUITE_P(Walls, Balance, testing::Bool(),
                         [](const testing::TestParamInfo<bool>& p) { return std::string(p.param ? "mesh" : "planes"); });

}  // namespace
}  // namespace decks
