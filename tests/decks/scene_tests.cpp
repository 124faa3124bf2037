// What a user's deck must see: loads, ids, restarts, fines, ramps. Each culled run stands beside one that never culls.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "atom.h"
#include "engine.h"
#include "engine_access.h"
#include "fix.h"
#include "force.h"
#include "lammps.h"
#include "neigh_list.h"
#include "pair.h"
#include "pair_force.h"

namespace decks {
namespace {

constexpr double diameter = 0.0026;

Bed mesh_bed(const std::string& name) {
  Bed bed;
  bed.name = name;
  bed.mesh_walls = true;
  return bed;
}

void write_plate(const std::string& file, double side, double z) {
  std::ofstream out(file);
  const double lo = 1e-4, hi = side - 1e-4;
  const double c[4][2] = {{lo, lo}, {hi, lo}, {hi, hi}, {lo, hi}};
  out << "solid plate\n";
  for (const auto& t : {std::array<int, 3>{0, 2, 1}, std::array<int, 3>{0, 3, 2}}) {
    out << "facet normal 0 0 -1\nouter loop\n";
    for (const int k : t) out << "vertex " << c[k][0] << ' ' << c[k][1] << ' ' << z << "\n";
    out << "endloop\nendfacet\n";
  }
  out << "endsolid plate\n";
}

double f(Engine& e, int n) { return e.vector("cull", n); }

TEST(Scenes, WallLoadsOfABedAtRest) {
  Engine e;
  e.run(read_bed(mesh_bed("loads")) + "run 50\n");
  const double floor = e.vector("floor", 3), side = e.vector("side", 1), friction = e.vector("side", 3);
  e.run("fix cull all solid/cull exterior live every 50 calm 2 depth 1.5\nrun 1000\n");
  ASSERT_GT(f(e, 3), 100);
  EXPECT_NEAR(e.vector("floor", 3), floor, 1e-3 * std::abs(floor));
  EXPECT_NEAR(e.vector("side", 1), side, 1e-3 * std::abs(side));
  EXPECT_NEAR(e.vector("side", 3), friction, 1e-3 * std::abs(side));
  if (e.rank() == 0)
    std::printf("floor %.8g -> %.8g N, side %.8g -> %.8g N\n", floor, e.vector("floor", 3), side, e.vector("side", 1));
}

TEST(Scenes, ABedThatSleepsStillWeighsOnItsWalls) {
  Engine e;
  const Bed bed = mesh_bed("asleep");
  e.run(read_bed(bed) + "run 50\n");
  const double load[] = {e.vector("floor", 3), e.vector("side", 1), e.vector("side", 3), e.vector("floor", 4),
                         e.vector("floor", 5)};
  const double lever = std::abs(load[0]) * bed.side;
  e.run("fix cull all solid/cull exterior sleep every 50\nrun 1500\n");
  expect_all_there(e, "cull", 1300);
  EXPECT_GT(f(e, 3), 1250) << "granules at the walls are in the store too";
  const auto weighs = [&] {
    EXPECT_NEAR(e.vector("floor", 3), load[0], 1e-3 * std::abs(load[0]));
    EXPECT_NEAR(e.vector("side", 1), load[1], 1e-3 * std::abs(load[1]));
    EXPECT_NEAR(e.vector("side", 3), load[2], 1e-3 * std::abs(load[1]));
    EXPECT_NEAR(e.vector("floor", 4), load[3], 1e-3 * lever);
    EXPECT_NEAR(e.vector("floor", 5), load[4], 1e-3 * lever);
  };
  weighs();
  e.run("run 1\n");  // a new run, with walls as they were
  EXPECT_GT(f(e, 3), 1250);
  weighs();
  e.run("run 300\n");
  EXPECT_GT(f(e, 3), 1250);
  weighs();
  if (e.rank() == 0)
    std::printf("%g interior; floor %.8g -> %.8g N, side %.8g -> %.8g N\n", f(e, 3), load[0], e.vector("floor", 3), load[1],
                e.vector("side", 1));
  const auto lowest = [&] {
    double z = 1;
    for (const auto& g : e.state()) z = std::min(z, g.second.x[2]);
    return z;
  };
  e.run("run 0\n");
  const double before = lowest();
  e.run("fix gone all move/mesh mesh floor linear 0 0 -0.05\nrun 600\n");
  EXPECT_GT(f(e, 7), 100) << "what rested on the floor wakes";
  e.run("unfix cull\nrun 0\n");
  EXPECT_EQ(e.state().size(), 1300u);
  EXPECT_LT(lowest(), before - 0.0005) << "nothing follows the floor";
}

/// Its surface is awake. What lies below it moves no farther when it is woken.
TEST(Scenes, AuditsOfABedAtRestFindThatNothingIsMissed) {
  Engine e;
  const Bed bed = mesh_bed("audited");
  e.run(read_bed(bed) + "run 50\n");
  const double floor = e.vector("floor", 3);
  e.run("fix cull all solid/cull exterior live every 20 calm 2 depth 1.5 audit 300 3\nrun 2100\n");
  expect_all_there(e, "cull", 1300);
  EXPECT_GT(f(e, 3), 100);
  EXPECT_GE(f(e, 38), 6);  // patches
  EXPECT_GE(f(e, 7), f(e, 38)) << "restored for it";
  EXPECT_GT(f(e, 40), 0);
  EXPECT_LT(f(e, 40), 2e-4 * diameter);
  EXPECT_LT(f(e, 44), 1e-9);  // J: of a granule of 2e-5 kg that falls by 5 nm
  EXPECT_NEAR(e.vector("floor", 3), floor, 1e-3 * std::abs(floor));
}

TEST(Scenes, GranulesThatSpinOnTheSpotSleepAndGoOnSpinning) {
  // 64 that spin about the normal of the floor, each beside one that it does not touch: a rank of eight has enough to store them
  Bed bed = mesh_bed("asleep");
  settled(bed);  // writes its floor
  bed.dt = 1.5e-5;
  constexpr int count = 128;
  std::string granules, spins;
  for (int k = 0; k < count / 2; ++k) {
    const double x = 0.0015 + 0.0031 * (k % 8), y = 0.0015 + 0.0031 * (k / 8);
    for (const double beside : {0.0, 0.00131})
      granules += "create_atoms 1 single " + std::to_string(x + beside) + ' ' + std::to_string(y) + " 0.00065 units box\n";
    spins += "set atom " + std::to_string(2 * k + 1) + " omegaz 60\n";
  }
  Engine e;
  e.run(head(bed) + "region box block -0.002 0.028 -0.002 0.028 -0.002 0.15 units box\ncreate_box 2 box\nneighbor 0.0004 bin\n" +
        "neigh_modify delay 0\n" + body(bed) + granules +
        "set group all diameter 0.0013\nset group all density 2500\nfix integr all nve/sphere\nthermo 100000\n"
        "thermo_modify norm no\nrun 6000\n" +
        spins + "fix cull all solid/cull exterior sleep every 50\nrun 1500\n");
  expect_all_there(e, "cull", count);
  EXPECT_EQ(e.state().size(), 1u) << "all but the highest tag are in the store";
  EXPECT_EQ(f(e, 1), 0);
  const double weight = count * e.state().at(count).mass * 9.81;
  EXPECT_NEAR(std::abs(e.vector("floor", 3)), weight, 1e-4 * weight);
  e.run("unfix cull\nrun 0\n");
  const State s = e.state();
  ASSERT_EQ(s.size(), std::size_t(count));
  for (int tag = 1; tag <= count; ++tag) EXPECT_NEAR(s.at(tag).omega[2], tag % 2 ? 60 : 0, 1e-9) << "granule " << tag;
}

TEST(Scenes, WhatRestsOnAFloorThatIsUnfixedFalls) {
  const Bed bed = mesh_bed("asleep");
  Engine e;
  e.run(read_bed(bed) + "fix cull all solid/cull exterior sleep every 50\nrun 1500\n");
  ASSERT_GT(f(e, 3), 1250);
  const double weight = std::abs(e.vector("floor", 3));
  // the side is the only mesh now: it must not be given what the floor bore. A new wall has no histories, so no friction yet
  const std::string no_floor =
      "unfix meshes\nunfix floor\nfix meshes all wall/gran " + bed.contact + " mesh n_meshes 1 meshes side\nrun 1\n";
  Engine never;
  never.run(read_bed(bed) + "run 1500\n" + no_floor);
  e.run(no_floor);
  EXPECT_NEAR(e.vector("side", 1), never.vector("side", 1), 1e-3 * weight);
  const double rubs = never.vector("side", 3);  // what has begun to fall; in the culled bed less of it may have
  EXPECT_GE(e.vector("side", 3), std::min(0.0, rubs) - 1e-3 * weight);
  EXPECT_LE(e.vector("side", 3), std::max(0.0, rubs) + 1e-3 * weight);
  EXPECT_GT(std::abs(e.vector("side", 1)), 0.1 * weight);
  e.run("run 400\n");
  EXPECT_GT(f(e, 7), 1250) << "what rested on the floor wakes";
  e.run("unfix cull\nrun 0\n");
  EXPECT_EQ(e.state().size(), 1300u);

  Engine none;  // no mesh is left at all
  none.run(read_bed(bed) + "fix cull all solid/cull exterior sleep every 50\nrun 1500\n");
  none.run("unfix meshes\nunfix floor\nunfix side\nrun 50\nunfix cull\nrun 0\n");
  EXPECT_EQ(none.state().size(), 1300u);
}

TEST(Scenes, WhatIsInsertedIntoASleepingBedFindsItsGranules) {
  Engine e;
  e.run(read_bed(mesh_bed("asleep")) + "fix cull all solid/cull exterior sleep every 50\nrun 1500\n");
  ASSERT_GT(f(e, 3), 1250);
  // once, and more at a rate, from the middle of the bed upwards; the region reaches over the bed
  const std::string where = " overlapcheck yes all_in yes vel constant 0 0 -0.1 region pour";
  e.run(
      "fix t1 all particletemplate/sphere 15485863 atom_type 1 density constant 2500 radius constant 0.0008\n"
      "fix dist all particledistribution/discrete 32452843 1 t1 1.0\n"
      "region pour block 0 0.026 0 0.026 0.012 0.045\n"
      "fix once all insert/pack seed 32452867 distributiontemplate dist maxattempt 300 insert_every once" +
      where +
      " volumefraction_region 0.45\n"
      "fix rate all insert/rate/region seed 49979687 distributiontemplate dist maxattempt 100 nparticles 60 particlerate 10000 "
      "insert_every 100" +
      where + "\nrun 1000\nunfix once\nunfix rate\nunfix cull\nrun 0\n");
  const State all = e.state();
  EXPECT_GT(all.size(), 1350u) << "granules are inserted";
  double deepest = 0;
  for (auto a = all.begin(); a != all.end(); ++a)
    for (auto b = std::next(a); b != all.end(); ++b) {
      double apart = 0;
      for (int d = 0; d < 3; ++d) apart += std::pow(a->second.x[d] - b->second.x[d], 2);
      const double smaller = std::min(a->second.radius, b->second.radius);
      deepest = std::max(deepest, (a->second.radius + b->second.radius - std::sqrt(apart)) / smaller);
    }
  EXPECT_LT(deepest, 0.1);
  for (int tag = 1; tag <= 1300; ++tag) ASSERT_TRUE(all.count(tag)) << tag << " is lost";
  if (e.rank() == 0) std::printf("%zu granules, deepest overlap %.3g radii\n", all.size(), deepest);
}

TEST(Scenes, RestartWhileCulledGoesOnAsIfItHadNotStopped) {
  const Bed bed = mesh_bed("restart");
  const std::string fix = "fix cull all solid/cull exterior live every 50 calm 2 depth 1.5\n";
  // something that moves: granules rain onto the culled bed
  const std::string rain =
      "create_atoms 1 single 0.013 0.013 0.06\ncreate_atoms 1 single 0.017 0.013 0.065\n"
      "group rain id > 1300\nset group rain diameter 0.0026\nset group rain density 2500\nvelocity rain set 0 0 -0.5\n";
  Engine straight;
  straight.run(read_bed(bed) + "run 0\n" + rain + fix + "run 600\nwrite_restart stop.restart\nrun 1000\n");
  Engine again;
  again.run(head(bed) + "read_restart stop.restart\nneighbor 0.0004 bin\nneigh_modify delay 0\n" + body(bed) +
            "fix integr all nve/sphere\nthermo 100000\nthermo_modify norm no\n" + fix + "run 0\n");
  EXPECT_GT(f(again, 3), 100);
  again.run("run 1000\n");
  for (const int n : {1, 2, 3}) EXPECT_EQ(f(again, n), f(straight, n)) << "f_cull[" << n << "]";
  for (Engine* e : {&straight, &again}) expect_all_there(*e, "cull", 1302);
  EXPECT_EQ(f(again, 6), f(straight, 6)) << "culled so far";
  EXPECT_NEAR(f(again, 5), f(straight, 5), 1e-12 * f(straight, 5)) << "stored mass";
  straight.run("unfix cull\nrun 0\n");
  again.run("unfix cull\nrun 0\n");
  const State a = straight.state(), b = again.state();
  EXPECT_EQ(a.size(), 1302u);
  const double apart = largest_difference(a, b, &Granule::x);
  EXPECT_LE(apart, 1e-9 * diameter);
  if (straight.rank() == 0) std::printf("after 1000 steps: %.3g d apart\n", apart / diameter);
}

/// What stored granules press on walls is in the file, for the walls that it was written with.
TEST(Scenes, NothingAtWallsComesOutOfARestartFileWhereWallsAreAsTheyWere) {
  const Bed bed = mesh_bed("walls_then");
  const std::string fix = "fix cull all solid/cull exterior sleep\n", walls = body(bed);
  Engine straight;
  straight.run(read_bed(bed) + fix + "run 1500\nwrite_restart walls_then.asleep.restart\n");
  const double stored = f(straight, 3);
  ASSERT_GT(stored, 1100);
  straight.run("run 100\n");
  const auto interior = [&](const std::string& skin, const std::string& of_deck, double* floor, double* side) {
    Engine e;
    e.run(head(bed) + "read_restart walls_then.asleep.restart\nneighbor " + skin + " bin\nneigh_modify delay 0\n" + of_deck +
          "fix integr all nve/sphere\nthermo 100000\nthermo_modify norm no\n" + fix + "run 0\n");
    const double found = f(e, 3);
    e.run("run 100\n");
    if (floor) *floor = e.vector("floor", 3);
    if (side) *side = e.vector("side", 1);
    expect_all_there(e, "cull", 1300);
    return found;
  };
  double floor = 0, side = 0;
  EXPECT_EQ(interior("0.0004", walls, &floor, &side), stored);
  EXPECT_NEAR(floor, straight.vector("floor", 3), 1e-9 * std::abs(floor));
  EXPECT_NEAR(side, straight.vector("side", 1), 1e-9 * std::abs(side));
  const auto with = [&](const std::string& then, const std::string& now) {
    const std::size_t at = walls.find(then);
    EXPECT_NE(at, std::string::npos) << then;
    std::string others = walls;
    return others.replace(at, then.size(), now);
  };
  const double fewer = stored - 150;  // at least a side
  EXPECT_LT(interior("0.0005", walls, nullptr, nullptr), fewer) << "the skin tells what is near a wall";
  for (const auto& [then, now] : {std::pair<std::string, std::string>{"yplane 0.026", "yplane 0.0260001"},
                                  {"_floor.stl type 1", "_floor.stl type 1 surface_vel 0.1 0 0"},
                                  {"_side.stl type 1", "_side.stl type 2"},
                                  {"peratomtypepair 2 0.5 0.5 0.5 0.5", "peratomtypepair 2 0.4 0.4 0.4 0.4"}})
    EXPECT_LT(interior("0.0004", with(then, now), nullptr, nullptr), fewer) << now;
}

TEST(Scenes, FinesPouredOnACoarseBedNeverTouchAnInteriorGranule) {
  Bed bed;
  bed.name = "coarse";
  bed.granules = 700;
  Engine e;
  e.run(read_bed(bed) + "run 0\nfix cull all solid/cull exterior live every 50 calm 2 depth 1.0 tolerance 3 0\nrun 300\n");
  const double before = f(e, 3);
  ASSERT_GT(before, 30);
  // 10:1: granules of 0.13 mm radius fall through the pores (type 2's material, stiff enough for 1e-6 s)
  std::string pour =
      "lattice sc 0.0006\nregion fines block 0.009 0.017 0.009 0.017 0.040 0.046 units box\n"
      "create_atoms 2 region fines\ngroup fines id > 700\nset group fines diameter 0.00026\n"
      "set group fines density 2500\nvelocity fines set 0 0 -1.0\ntimestep 0.000003\n";
  expect_all_there(e, "cull", 700);
  e.run(pour);
  const std::size_t fines = e.state().size() - 700;  // the deck sees the whole bed now
  ASSERT_GT(fines, 500u);
  double lowest = 1;
  for (int k = 0; k < 40; ++k) {
    e.run("run 250\n");
    expect_all_there(e, "cull", 700 + fines);
    for (const auto& g : e.state())
      if (g.first > 700) lowest = std::min(lowest, g.second.x[2]);
  }
  const double after = f(e, 3);
  EXPECT_LT(after, before) << "no granule was fetched from the store: the fines never came near it";
  e.run("unfix cull\nrun 0\n");
  const State all = e.state();
  EXPECT_EQ(all.size(), 700u + fines);
  double deepest = 0;
  for (const auto& a : all) {
    if (a.first <= 700) continue;
    for (const auto& b : all) {
      if (b.first > 700) continue;
      double d2 = 0;
      for (int d = 0; d < 3; ++d) d2 += (a.second.x[d] - b.second.x[d]) * (a.second.x[d] - b.second.x[d]);
      deepest = std::max(deepest, a.second.radius + b.second.radius - std::sqrt(d2));
    }
  }
  EXPECT_LT(deepest, 0.1 * 0.00013) << "a fine granule is inside a coarse one";
  if (e.rank() == 0)
    std::printf("%zu fines, lowest at %.3g m, deepest overlap %.3g of their radius; interior %g -> %g\n", fines, lowest,
                deepest / 0.00013, before, after);
}

/// A plate rests on a bed under load, the bed is culled, then the plate is driven down; returns the plate's load change (N) at
/// the first load change that is over the tolerance.
double load_change_at_wake_up(double plate_speed) {
  Bed bed;
  bed.name = "ramp";
  bed.extra = "fix plate all mesh/surface/stress file plate.stl type 1\nfix platewall all wall/gran " + bed.contact +
              " mesh n_meshes 1 meshes plate\n";
  Bed bare;
  bare.name = bed.name;
  Engine e;
  if (e.rank() == 0) write_plate("plate.stl", bed.side, 0);
  e.run(read_bed(bare) + "run 0\nvariable top equal bound(all,zmax)+0.0013\nvariable z equal ${top}\n");
  const double top = e.variable("z");
  if (e.rank() == 0) write_plate("plate.stl", bed.side, top);
  MPI_Barrier(MPI_COMM_WORLD);
  e.run(bed.extra + "fix down all move/mesh mesh plate linear 0 0 -0.02\nfix visc all viscous 0.002\nrun 0\n");
  while (e.vector("plate", 3) < 0.2) e.run("run 20 pre no post no\n");
  e.run(
      "unfix down\nrun 4000\nunfix visc\nrun 1000\nfix cull all solid/cull exterior live every 50 calm 2 depth 1.5 tolerance 1 "
      "0\nrun 1000\n");
  EXPECT_GT(f(e, 3), 100);
  EXPECT_EQ(f(e, 8), 0);
  const double before = e.vector("plate", 3);
  char move[100];
  std::snprintf(move, sizeof move, "fix down all move/mesh mesh plate linear 0 0 -%g\nrun 0\n", plate_speed);
  e.run(move);
  const int chunk = std::max(1, static_cast<int>(1e-9 / plate_speed / bed.dt));  // a nanometre
  double load = 0;                                                               // what wakes moves, so the load is read before
  for (int k = 0; k < 2000; ++k) {
    e.run("run " + std::to_string(chunk) + " pre no post no\n");
    if (f(e, 8) > 0 || f(e, 9) > 1) return load;
    load = e.vector("plate", 3) - before;
  }
  ADD_FAILURE() << "nothing woke";
  return 0;
}

TEST(Scenes, ASlowAndAFastRampWakeAtTheSameLoad) {
  const double middle = load_change_at_wake_up(1e-6), slow = load_change_at_wake_up(1e-7), fast = load_change_at_wake_up(1e-5);
  EXPECT_GT(middle, 0);
  // 0.2 % and 0.04 % were measured. A plate that is faster still goes on while its push is on its way to the granule that wakes
  EXPECT_NEAR(slow, middle, 0.01 * middle);
  EXPECT_NEAR(fast, middle, 0.01 * middle);
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  if (rank == 0) std::printf("first wake-up at +%.5g N (10 x slower: +%.5g N, 10 x faster: +%.5g N)\n", middle, slow, fast);
}

double distance(const Vec& a, const Vec& b) {
  return std::sqrt(std::pow(a[0] - b[0], 2) + std::pow(a[1] - b[1], 2) + std::pow(a[2] - b[2], 2));
}

/// Sum of the normal forces that its contacts with granules press on each granule (N), by tag. Collective.
std::vector<double> normal_loads(Engine& e) {
  const LAMMPS_NS::Atom* atom = e.lammps()->atom;
  const LAMMPS_NS::NeighList* list = e.lammps()->force->pair->list;
  solidcull::PairForce law(e.lammps());
  std::vector<double> mine(static_cast<std::size_t>(atom->natoms) + 1), all(mine.size());
  for (int n = 0; n < list->inum; ++n) {
    const int i = list->ilist[n];
    for (int k = 0; k < list->numneigh[i]; ++k) {
      const int j = list->firstneigh[i][k];
      const Vec apart = {atom->x[j][0] - atom->x[i][0], atom->x[j][1] - atom->x[i][1], atom->x[j][2] - atom->x[i][2]};
      const double normal = std::abs(law.on_first(i, k).dot(solidcull::Vec3(apart[0], apart[1], apart[2]).normalized()));
      mine[atom->tag[i]] += normal;
      if (j < atom->nlocal) mine[atom->tag[j]] += normal;  // a ghost is counted by its own rank
    }
  }
  MPI_Allreduce(mine.data(), all.data(), static_cast<int>(all.size()), MPI_DOUBLE, MPI_SUM, MPI_COMM_WORLD);
  return all;
}

/// Pushes the granules of its group: a fix that the culling takes for one that acts on none, for the table of styles has all of
/// its family as exact.
class FixPush : public LAMMPS_NS::Fix {
 public:
  FixPush(LAMMPS_NS::LAMMPS* lmp, int narg, char** arg) : Fix(lmp, narg, arg), force_(std::atof(arg[3])) {}
  int setmask() override { return LAMMPS_NS::FixConst::POST_FORCE; }
  void setup(int) override { post_force(0); }
  void post_force(int) override {
    for (int i = 0; i < atom->nlocal; ++i)
      if (atom->mask[i] & groupbit) atom->f[i][2] += force_;
  }

 private:
  double force_;
};

TEST(Scenes, ABlowOfGivenExcessCarvesTheBallsOfTheLaw) {
  Bed bed;
  bed.name = "carve";
  bed.side = 0.034;
  bed.granules = 2600;
  Engine e;
  e.run(read_bed(bed) + "run 50\n");
  const State whole = e.state();
  const std::vector<double> loads = normal_loads(e);
  double mean_diameter = 0;
  for (const auto& g : whole) mean_diameter += 2 * g.second.radius / static_cast<double>(whole.size());
  e.run("fix cull all solid/cull exterior live every 50 calm 2 depth 1.5 tolerance 3 0 carve 1.5 4\nrun 325\n");
  // half-way between two looks: what the last one found is done, and no other is on its way
  ASSERT_EQ(f(e, 8), 0);
  const int bit = e.group_bit("cull_interface");
  const State before = e.state();

  // two interface granules away from walls, their balls overlapping: struck with 2 and 4 times the tolerance. That is 3 weights
  // for those that bear 6 or more, and less for others
  const auto bears_enough = [&](int tag) { return loads[tag] > 7 * whole.at(tag).mass * 9.81; };
  std::vector<int> struck;
  for (const Vec& aim : {Vec{0.014, 0.017, 0.03}, Vec{0.019, 0.017, 0.03}}) {
    int best = 0;
    for (const auto& g : before)
      if ((g.second.mask & bit) && bears_enough(g.first) && (struck.empty() || g.first != struck[0]) &&
          (!best || distance(g.second.x, aim) < distance(before.at(best).x, aim)))
        best = g.first;
    ASSERT_NE(best, 0);
    struck.push_back(best);
  }
  const double excess[2] = {2, 4};
  std::string hits;
  for (int k = 0; k < 2; ++k) {
    const std::string name = "hit" + std::to_string(k);
    char force[64];
    std::snprintf(force, sizeof force, "%.17g", -excess[k] * 3 * before.at(struck[k]).mass * 9.81);
    hits += "group " + name + " id " + std::to_string(struck[k]) + "\nfix " + name + " " + name + " particledistribution/push " +
            force + "\n";
  }
  solidcull::engine::fix_styles(*e.lammps()->modify)["particledistribution/push"] =
      [](LAMMPS_NS::LAMMPS* lmp, int narg, char** arg) -> LAMMPS_NS::Fix* { return new FixPush(lmp, narg, arg); };
  e.run(hits + "run 0\n");
  for (int k = 0; k < 24 && f(e, 8) == 0; ++k) e.run("run 1 pre no post no\n");
  ASSERT_EQ(f(e, 8), 2) << "two carves, of one step together";

  const State after = e.state();
  int carved = 0;
  for (const auto& g : whole) {
    const bool was_exterior = before.count(g.first) && !(before.at(g.first).mask & bit);
    const bool is_exterior = after.count(g.first) && !(after.at(g.first).mask & bit);
    bool in_a_ball = false, at_a_rim = false;
    for (int k = 0; k < 2; ++k) {
      const double radius = 1.5 * mean_diameter * (1 + 0.5 * std::log2(excess[k]));
      const double d = distance(g.second.x, before.at(struck[k]).x);
      in_a_ball = in_a_ball || d <= radius;
      at_a_rim = at_a_rim || std::abs(d - radius) < 0.02 * mean_diameter;  // a struck granule's load trembles by a few per cent
    }
    if (at_a_rim) continue;
    EXPECT_EQ(is_exterior, was_exterior || in_a_ball) << "granule " << g.first;
    carved += is_exterior && !was_exterior;
    // the hole is lined: whatever an exterior granule could touch is an atom (I1)
    for (const auto& other : whole) {
      const bool touches = distance(g.second.x, other.second.x) < g.second.radius + other.second.radius;
      EXPECT_TRUE(!is_exterior || !touches || after.count(other.first)) << g.first << " and " << other.first;
    }
  }
  EXPECT_GT(carved, 20);
  if (e.rank() == 0) std::printf("two blows freed %d granules; %g carves\n", carved, f(e, 8));
}

TEST(Scenes, TheRegionHoldsTheBodiesAndNothingElse) {
  const Bed bed = mesh_bed("region");
  Engine e;
  e.run(
      read_bed(bed) +
      "run 0\nfix cull all solid/cull exterior live every 50 calm 2 depth 1.5\nrun 500\nrun 0\nregion solid interface/mesh cull\n"
      "region rest interface/mesh cull side out\ngroup held region solid\nvariable held equal count(held)\n"
      "variable both equal count(all,solid)+count(all,rest)\nvariable one atom 1\ncompute inside all reduce/region solid sum "
      "v_one\n"
      "variable inside equal c_inside\nthermo_style custom step atoms c_inside\nrun 0\n");
  expect_all_there(e, "cull", 1300);
  EXPECT_EQ(e.variable("both"), 1300);
  EXPECT_EQ(e.variable("held"), e.variable("inside"));
  // what is culled and no other; at rough places of the surface an exterior centre may lie within half a voxel
  const double held = e.variable("held"), interface = f(e, 2), culled = interface + f(e, 3);
  EXPECT_NEAR(held, culled, 0.02 * interface);
  if (e.rank() == 0) std::printf("the region holds %g granules, %g are culled\n", held, culled);
  e.run("thermo_style custom step atoms\nuncompute inside\nregion solid delete\nregion rest delete\nunfix cull\nrun 0\n");
}

/// No contact turns a granule there, and no body does.
TEST(Scenes, WithoutFrictionEachGranuleKeepsItsSpin) {
  Bed bed;
  bed.name = "smooth";
  bed.contact = "model hertz tangential off";
  for (const char* keywords : {"exterior live depth 1.5", "exterior sleep", "exterior sleep store compact"}) {
    Engine e;
    // slower than what counts as motion; gravity that leans makes bodies rock
    e.run(read_bed(bed) +
          "run 0\nset group all omegax 1e-4 omegay -2e-4 omegaz 5e-4\nfix cull all solid/cull every 50 calm 2 speed 0.05 "
          "tolerance 30 0 " +
          keywords + "\nrun 500\n");
    ASSERT_GT(f(e, 3), 100) << keywords;
    expect_all_there(e, "cull", 1300);
    e.run("unfix grav\nfix grav all gravity 9.81 vector 0.01 0 -1\nrun 200\n");
    ASSERT_GT(f(e, 2) + f(e, 3), 100) << keywords;
    e.run("unfix cull\nrun 0\n");
    const State all = e.state();
    ASSERT_EQ(all.size(), 1300u);
    const Vec spin = {1e-4, -2e-4, 5e-4};
    for (const auto& g : all)
      for (int d = 0; d < 3; ++d) ASSERT_EQ(g.second.omega[d], spin[d]) << "granule " << g.first << ", " << keywords;
  }
}

TEST(Scenes, GravityThatTurnsWakesEverything) {
  Bed bed;
  bed.name = "gravity";
  Engine e;
  e.run(read_bed(bed) + "run 0\nfix cull all solid/cull exterior live every 50 calm 2 depth 1.5\nrun 500\n");
  ASSERT_GT(f(e, 3), 100);
  expect_all_there(e, "cull", 1300);
  e.run("unfix grav\nfix grav all gravity 9.81 vector 0.6 0 -1\nrun 30\n");
  EXPECT_EQ(f(e, 3), 0);
  EXPECT_EQ(f(e, 2), 0);
  expect_all_there(e, "cull", 1300);
}

TEST(Scenes, AWallThatGoesWakesWhatTouchedIt) {
  Bed bed;
  bed.name = "wall";
  Engine e;
  e.run(read_bed(bed) + "run 0\nfix cull all solid/cull exterior live every 50 calm 2 depth 1.5\nrun 500\n");
  const double before = f(e, 3);
  ASSERT_GT(before, 100);
  e.run("unfix x2\nrun 500\n");
  EXPECT_GT(f(e, 7), 100) << "restored";
  expect_all_there(e, "cull", 1300);
  double farthest = 0;
  for (const auto& g : e.state()) farthest = std::max(farthest, g.second.x[0]);
  EXPECT_GT(farthest, bed.side) << "nothing flows out";
}

TEST(Scenes, ARunThatStartsWithAnEmptyBoxIsCulledToo) {
  Bed bed;
  bed.name = "pour";
  Engine e;
  e.run(pouring(bed) + "fix cull all solid/cull\nrun 1\n");
  const std::size_t poured = e.state().size();
  {
    Engine stock;  // on many ranks LIGGGHTS finds no place for some
    stock.run(pouring(bed) + "run 1\n");
    ASSERT_EQ(poured, stock.state().size());
    ASSERT_TRUE(poured == static_cast<std::size_t>(bed.granules) || e.ranks() > 4) << poured;
  }
  // it falls before it is damped: the drag would keep it in the air
  e.run("run 4000\nfix visc all viscous 0.002\nrun 6000\nunfix visc\n");
  expect_all_there(e, "cull", poured);
  // it still trembles: what spins about a lone contact is stopped by hand
  for (int k = 0; k < 4; ++k) e.run("velocity all set 0 0 0\nset group all omegax 0 omegay 0 omegaz 0\nrun 1500\n");
  expect_all_there(e, "cull", poured);
  EXPECT_GT(f(e, 3), 100);
  if (e.rank() == 0) std::printf("%g interior granules\n", f(e, 3));
}

TEST(Scenes, GranulesLeaveByTheStoreAndComeBackWithTheirIds) {
  const Bed bed = mesh_bed("ids");
  Engine e;
  e.run(read_bed(bed) + "run 0\nfix cull all solid/cull exterior live every 50 calm 2 depth 1.5\nrun 500\n");
  const State atoms = e.state();
  EXPECT_TRUE(atoms.count(1300)) << "the highest tag must stay an atom: new atoms are numbered from it";
  ASSERT_GT(f(e, 3), 100);
  expect_all_there(e, "cull", 1300);
  e.run(
      "create_atoms 1 single 0.013 0.013 0.06\ngroup new id > 1300\nset group new diameter 0.0026\nset group new density 2500\n");
  EXPECT_TRUE(e.state().count(1301));
  e.run("unfix cull\nrun 0\n");
  EXPECT_EQ(e.state().size(), 1301u);
}

}  // namespace
}  // namespace decks
