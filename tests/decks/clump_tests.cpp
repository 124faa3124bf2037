// Clumps, granules of several spheres: locked, stored, freed and moved as one.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <fstream>
#include <map>
#include <set>
#include <sstream>

#include "atom.h"
#include "comm.h"
#include "engine.h"
#include "fix_multisphere.h"
#include "lammps.h"
#include "modify.h"

namespace decks {
namespace {

constexpr const char* contact = "model hertz tangential history rolling_friction epsd2";
constexpr double diameter = 0.0024;  // m, of the smallest spheres

/// A bed of clumps, some sphere in their midst or none.
struct ClumpBed {
  std::string name, templates, shares;
  int granules;  // spheres and clumps
  bool periodic = false;
  double side = 0.026, high = 0.2;  // m, of the box

  friend void PrintTo(const ClumpBed& b, std::ostream* out) { *out << b.name; }
};

const std::string three = "nspheres 3 ntry 100000 spheres 0 0 0 0.0012 0.0013 0 0 0.0010 0.0005 0.0011 0 0.0009 type 1\n";
/// Rods, whose ends are far from each other.
std::string nine() {
  std::ostringstream s;
  s << "nspheres 9 ntry 100000 spheres";
  for (int k = 0; k < 9; ++k) s << ' ' << 0.0006 * (k - 4) << " 0 0 0.0010";
  s << " type 2\n";
  return s.str();
}

ClumpBed bed_of(const std::string& name) {
  const std::string of_three = "fix t1 all particletemplate/multisphere 15485863 atom_type 1 density constant 2500 " + three,
                    of_nine = "fix t2 all particletemplate/multisphere 15485867 atom_type 1 density constant 2500 " + nine(),
                    sphere =
                        "fix t3 all particletemplate/sphere 49979687 atom_type 1 density constant 2500 radius constant 0.0013\n";
  if (name == "rods") return {name, of_three + of_nine, "2 t1 0.5 t2 0.5", 220};
  if (name == "mixed") return {name, of_three + of_nine + sphere, "3 t1 0.4 t2 0.2 t3 0.4", 350};
  if (name == "many") return {name, of_three + of_nine + sphere, "3 t1 0.685 t2 0.21 t3 0.105", 7000, false, 0.08, 0.3};
  return {name, of_three, "1 t1 1.0", 400, name == "periodic"};
}

std::string head(const ClumpBed& b, const std::string& cuts = grid()) {
  return std::string("atom_style granular\natom_modify map array\nboundary ") + (b.periodic ? "p p f" : "f f f") +
         "\nnewton off\ncommunicate single vel yes\nunits si\nprocessors " + cuts + "\n";
}

std::string body(const ClumpBed& b) {
  std::ostringstream s;
  s << "fix m1 all property/global youngsModulus peratomtype 5.e6\n"
       "fix m2 all property/global poissonsRatio peratomtype 0.3\n"
       "fix m3 all property/global coefficientRestitution peratomtypepair 1 0.3\n"
       "fix m4 all property/global coefficientFriction peratomtypepair 1 0.5\n"
       "fix m5 all property/global coefficientRollingFriction peratomtypepair 1 0.1\n"
    << "pair_style gran " << contact << "\npair_coeff * *\ntimestep 2e-5\nfix grav all gravity 9.81 vector 0 0 -1\n";
  const std::string wall = " all wall/gran " + std::string(contact) + " primitive type 1 ";
  for (const char* dim : {"x", "y"})
    if (!b.periodic)
      s << "fix " << dim << "1" << wall << dim << "plane 0\nfix " << dim << "2" << wall << dim << "plane " << b.side << "\n";
  s << "fix z1" << wall << "zplane 0\n";
  return s.str();
}

constexpr const char* moved =
    "fix spheres all nve/sphere\nfix clumps all multisphere allow_group_and_set yes\nthermo 100000\nthermo_modify norm no lost "
    "ignore\n";

/// Poured and settled. Collective.
std::string settled(const ClumpBed& b) {
  const std::string file = "clumps_" + b.name + ".restart";
  if (!first_asked_for(file)) return file;
  const double rim = b.periodic ? 0 : 0.002;
  std::ostringstream s;
  s << head(b, "1 1 1") << "region reg block " << -rim << ' ' << b.side + rim << ' ' << -rim << ' ' << b.side + rim << " -0.002 "
    << b.high << "\n"
    << "create_box 1 reg\nneighbor 0.0006 bin\nneigh_modify delay 0\n"
    << body(b) << b.templates << "fix dist all particledistribution/discrete 32452867 " << b.shares << "\n"
    << "region pour block 0.002 " << b.side - 0.002 << " 0.002 " << b.side - 0.002 << " 0.005 " << b.high - 0.01 << "\n"
    << "fix ins all insert/pack seed 32452843 distributiontemplate dist maxattempt 300 insert_every once overlapcheck yes all_in "
       "yes "
       "orientation random vel constant 0 0 -0.5 region pour ntry_mc 10000 particles_in_region "
    << b.granules << "\n"
    << moved << "run 12000\nunfix ins\nfix visc all viscous 0.002\nrun 9000\nunfix visc\nrun 5000\n";
  make_bed(file, s.str());
  return file;
}

std::string read(const ClumpBed& b, const std::string& file = "") {
  return head(b) + "read_restart " + (file.empty() ? settled(b) : file) + "\nneighbor 0.0004 bin\nneigh_modify delay 0\n" +
         body(b) + moved;
}

/// Largest difference of what the engine moves clumps by, over the largest of each number; rows must be the same.
double largest_difference(const ClumpRows& a, const ClumpRows& b) {
  if (a.size() != b.size()) return HUGE_VAL;
  double most = 0;
  for (const auto& [number, row] : a) {
    const auto other = b.find(number);
    if (other == b.end() || other->second.size() != row.size()) return HUGE_VAL;
    for (std::size_t k = 0; k < row.size(); ++k) most = std::max(most, std::abs(row[k] - other->second[k]));
  }
  return most;
}

std::size_t clumps_of(const State& atoms) {
  std::set<int> clumps;
  for (const auto& a : atoms) clumps.insert(a.second.clump);
  clumps.erase(0);
  return clumps.size();
}

/// Nothing is lost: as many spheres as there were, atoms or stored, and every clump whose spheres are free is moved.
void expect_whole(Engine& e, std::size_t spheres) {
  const State atoms = e.state();
  EXPECT_EQ(static_cast<double>(atoms.size()) + e.vector("cull", 3), static_cast<double>(spheres));
  EXPECT_EQ(e.clumps().size(), clumps_of(atoms));
  EXPECT_NEAR(e.vector("cull", 11), 0, 1e-12 * e.vector("cull", 23)) << "mass error";
}

struct Case {
  std::string bed, keywords;
  friend void PrintTo(const Case& c, std::ostream* out) { *out << c.bed << ", " << c.keywords; }
};

class Clumps : public testing::TestWithParam<Case> {};

/// Invariant I3.
TEST_P(Clumps, AreCulledAndRestoredToTheBit) {
  const ClumpBed bed = bed_of(GetParam().bed);
  const std::string deck = read(bed), looks = "run 100\nrun 0\n";  // the last look chooses
  Engine never, culled;
  never.run(deck + looks);
  culled.run(deck + "fix cull all solid/cull every 50 calm 2 speed 0.05 tolerance 12 0 " + GetParam().keywords + "\n" + looks);
  const State all = never.state();
  const ClumpRows rows = never.clumps();
  const double interior = culled.vector("cull", 3), interface = culled.vector("cull", 2);
  EXPECT_GT(interior, 0.02 * static_cast<double>(all.size())) << "nothing was stored: the test shows nothing";
  EXPECT_LT(culled.clumps().size(), rows.size());
  expect_whole(culled, all.size());
  culled.run("unfix cull\n");
  const State back = culled.state();
  expect_same_granules(all, back);
  const double rounding = bed.periodic ? 1e-16 * bed.side : 0.0;  // of what has been in another periodic image
  EXPECT_LE(largest_difference(all, back, &Granule::x), rounding);
  EXPECT_EQ(largest_difference(all, back, &Granule::v), 0.0);
  EXPECT_EQ(largest_difference(all, back, &Granule::omega), 0.0);
  for (const auto& a : all) EXPECT_EQ(a.second.clump, back.at(a.first).clump);
  EXPECT_LE(largest_difference(rows, culled.clumps()), rounding);

  never.run("run 0\n");
  culled.run("run 0\n");
  const State fa = never.state(), fb = culled.state();
  const double contact_force = 13 * 1e-4 * 9.81;
  EXPECT_LE(largest_difference(fa, fb, &Granule::f), 1e-12 * contact_force);
  ASSERT_NO_FATAL_FAILURE(expect_same_histories(never.histories(), culled.histories()));
  never.run("run 100\n");
  culled.run("run 100\n");
  const double drift = largest_difference(never.state(), culled.state(), &Granule::x);
  EXPECT_LE(drift, 1e-9 * diameter);
  if (never.rank() == 0)
    std::printf("%s: %g interior, %g interface of %zu spheres, %zu clumps; dx/d after 100 steps %.3g\n", bed.name.c_str(),
                interior, interface, all.size(), rows.size(), drift / diameter);
}

INSTANTIATE_TEST_SUITE_P(Beds, Clumps,
                         testing::Values(Case{"three", "exterior live depth 1.5"}, Case{"three", "exterior sleep depth 0"},
                                         Case{"rods", "exterior sleep depth 0"}, Case{"rods", "exterior live depth 1"},
                                         Case{"mixed", "exterior sleep depth 0"}, Case{"mixed", "exterior live depth 1.5"},
                                         Case{"periodic", "exterior sleep depth 0"}),
                         [](const testing::TestParamInfo<Case>& info) {
                           return info.param.bed + (info.param.keywords.find("live") != std::string::npos ? "_live" : "_sleep");
                         });

// 24,884 spheres: five minutes, most of them for the bed
INSTANTIATE_TEST_SUITE_P(DISABLED_ManyAtOnce, Clumps,
                         testing::Values(Case{"many", "exterior sleep depth 0"}, Case{"many", "exterior live depth 1.5"}),
                         [](const testing::TestParamInfo<Case>& info) {
                           return info.param.keywords.find("live") != std::string::npos ? "live" : "sleep";
                         });

class StruckClumps : public testing::TestWithParam<Case> {};

/// A ball falls on them: they wake, move and sleep again.
TEST_P(StruckClumps, LoseNothing) {
  const ClumpBed bed = bed_of(GetParam().bed);
  Engine e;
  e.run(read(bed) + "fix cull all solid/cull every 50 " + GetParam().keywords + "\nrun 500\n");
  const std::size_t spheres = e.state().size() + static_cast<std::size_t>(e.vector("cull", 3)) + 1;
  e.run(
      "create_atoms 1 single 0.013 0.013 0.06 units box\nregion above block 0.01 0.016 0.01 0.016 0.055 0.065 units box\n"
      "group ball region above\nset group ball diameter 0.004\nset group ball density 2500\nvelocity ball set 0 0 -1\n");
  e.run("run 0\n");
  const double mass = e.vector("cull", 23);
  double least = 1;
  for (int k = 0; k < 10; ++k) {
    e.run("run 1000\n");
    expect_whole(e, spheres);
    EXPECT_NEAR(e.vector("cull", 23), mass, 1e-12 * mass);
    least = std::min(least, e.vector("cull", 3) / static_cast<double>(spheres));
  }
  EXPECT_GT(e.vector("cull", 7), 0) << "nothing woke: the test shows nothing";
  const double interior = e.vector("cull", 3);
  EXPECT_GT(interior, 0.1 * static_cast<double>(spheres));
  e.run("unfix cull\nrun 100\n");
  EXPECT_EQ(e.state().size(), spheres);
  EXPECT_EQ(e.clumps().size(), clumps_of(e.state()));
}

INSTANTIATE_TEST_SUITE_P(Beds, StruckClumps,
                         testing::Values(Case{"three", "exterior live depth 1.5"}, Case{"three", "exterior sleep"},
                                         Case{"rods", "exterior sleep depth 0"}, Case{"mixed", "exterior sleep"},
                                         Case{"mixed", "exterior live depth 1"}, Case{"periodic", "exterior sleep"},
                                         Case{"three", "exterior sleep store compact"}),
                         [](const testing::TestParamInfo<Case>& info) {
                           return info.param.bed + (info.param.keywords.find("live") != std::string::npos ? "_live" : "_sleep") +
                                  (info.param.keywords.find("compact") != std::string::npos ? "_compact" : "");
                         });

// ------------------------------------------------------------------------------------------------------------ a block in flight

// columns of a clump's numbers, as fix multisphere has them
constexpr std::size_t xcm = 1, vcm = 4, angmom = 7, masstotal = 20;

struct Totals {
  double mass = 0, motion = 0, turning_motion = 0;  // of which momenta may be sums
  Eigen::Vector3d momentum = Eigen::Vector3d::Zero(), turning = Eigen::Vector3d::Zero();
  void add(double m, const double* x, const double* v, const Eigen::Vector3d& own) {
    const Eigen::Vector3d p = m * Eigen::Vector3d(v[0], v[1], v[2]), l = Eigen::Vector3d(x[0], x[1], x[2]).cross(p) + own;
    mass += m;
    momentum += p;
    turning += l;
    motion += p.norm();
    turning_motion += l.norm();
  }
};

/// Of an engine that has all granules.
Totals totals(Engine& e) {
  Totals t;
  for (const auto& [tag, a] : e.state())
    if (a.clump == 0)
      t.add(a.mass, a.x.data(), a.v.data(),
            0.4 * a.mass * a.radius * a.radius * Eigen::Vector3d(a.omega[0], a.omega[1], a.omega[2]));
  for (const auto& [number, row] : e.clumps())
    t.add(row[masstotal], &row[xcm], &row[vcm], Eigen::Vector3d(row[angmom], row[angmom + 1], row[angmom + 2]));
  return t;
}

/// Every granule has the velocity field of a rigid body.
void throw_spinning(Engine& e, const Eigen::Vector3d& velocity, const Eigen::Vector3d& spin) {
  const Eigen::Vector3d pole(0.013, 0.013, 0.01);
  const auto at = [&](const double* x) -> Eigen::Vector3d {
    return velocity + spin.cross(Eigen::Vector3d(x[0], x[1], x[2]) - pole);
  };
  LAMMPS_NS::Atom* atom = e.lammps()->atom;
  for (int i = 0; i < atom->nlocal; ++i)
    for (int d = 0; d < 3; ++d) {
      atom->v[i][d] = at(atom->x[i])[d];
      atom->omega[i][d] = spin[d];
    }
  LAMMPS_NS::Modify* modify = e.lammps()->modify;
  auto& clumps = dynamic_cast<LAMMPS_NS::FixMultisphere&>(*modify->fix[modify->find_fix("clumps")]).data();
  for (int k = 0; k < clumps.n_body(); ++k) {
    double x[3], w[3] = {spin[0], spin[1], spin[2]};
    clumps.xcm(x, k);
    Eigen::Vector3d v = at(x);
    clumps.set_v_body(k, v.data());
    clumps.set_angmom_via_omega_body(k, w);
  }
}

class BlockOfClumps : public testing::TestWithParam<Case> {};

/// It flies and turns, and a ball strikes it: momentum and angular momentum are what they were.
TEST_P(BlockOfClumps, KeepsItsMomenta) {
  const ClumpBed bed = bed_of(GetParam().bed);
  Engine e;
  e.run(read(bed) +
        "unfix grav\nunfix z1\nunfix x1\nunfix x2\nunfix y1\nunfix y2\nrun 0\ncreate_atoms 1 single 0.013 0.013 0.03 units box\n"
        "region above block 0.012 0.014 0.012 0.014 0.029 0.031 units box\ngroup ball region above\n"
        "set group ball diameter 0.003\nset group ball density 2500\nrun 0\n");
  throw_spinning(e, {0.01, 0.02, 0.01}, {1, 2, -1});
  e.run("velocity ball set 0 0 -0.8\n");
  const Totals before = totals(e);
  e.run("fix cull all solid/cull every 20 calm 2 speed 0.2 tolerance 100 0 " + GetParam().keywords + "\nrun 100\n");
  const double interior = e.vector("cull", 3), spheres = static_cast<double>(e.state().size()) + interior;
  EXPECT_GT(interior, 0.01 * spheres) << "nothing was stored: the test shows nothing";
  for (int k = 0; k < 4; ++k) e.run("run 250\n");
  EXPECT_GT(e.vector("cull", 7), 0) << "nothing woke";
  e.run("unfix cull\n");
  const Totals after = totals(e);
  EXPECT_EQ(static_cast<double>(e.state().size()), spheres);
  EXPECT_NEAR(after.mass, before.mass, 1e-12 * before.mass);
  EXPECT_LE((after.momentum - before.momentum).norm(), 1e-12 * before.motion);
  EXPECT_LE((after.turning - before.turning).norm(), 1e-12 * before.turning_motion);
  if (e.rank() == 0)
    std::printf("%s: %g of %g interior; momentum %.2g, angular momentum %.2g of what moves\n", bed.name.c_str(), interior,
                spheres, (after.momentum - before.momentum).norm() / before.motion,
                (after.turning - before.turning).norm() / before.turning_motion);
}

INSTANTIATE_TEST_SUITE_P(Beds, BlockOfClumps,
                         testing::Values(Case{"three", "exterior live depth 1"}, Case{"three", "exterior sleep"},
                                         Case{"mixed", "exterior sleep depth 0"}),
                         [](const testing::TestParamInfo<Case>& info) {
                           return info.param.bed + (info.param.keywords.find("live") != std::string::npos ? "_live" : "_sleep");
                         });

// ------------------------------------------------------------------------------------------------------------ decks

constexpr const char* asleep = "fix cull all solid/cull every 50 exterior sleep depth 0\n";

/// What is culled comes back from a restart file, clumps as they were.
TEST(ClumpsInDecks, GoOnFromARestartFile) {
  const ClumpBed bed = bed_of("mixed");
  Engine on, again;
  on.run(read(bed) + asleep + "run 600\nwrite_restart clumps.restart\n");
  const double interior = on.vector("cull", 3);
  EXPECT_GT(interior, 100);
  again.run(read(bed, "clumps.restart") + asleep + "run 0\n");
  expect_whole(again, on.state().size() + static_cast<std::size_t>(interior));
  EXPECT_GT(again.vector("cull", 3), 0.5 * interior) << "what is at walls is an atom until it has felt them";
  for (Engine* e : {&on, &again}) e->run("run 100\nunfix cull\nrun 0\n");
  expect_same_granules(on.state(), again.state());
  EXPECT_LE(largest_difference(on.state(), again.state(), &Granule::x), 1e-9 * diameter);
  EXPECT_LE(largest_difference(on.clumps(), again.clumps()), 1e-9);
}

/// All clumps are stored as a run begins, and new ones are poured on them: no number is given twice, and as many come as in
/// stock.
TEST(ClumpsInDecks, AreInsertedOnWhatIsStored) {
  const ClumpBed bed = bed_of("three");
  const std::string pour = bed.templates + "fix dist all particledistribution/discrete 32452867 " + bed.shares +
                           "\nregion pour block 0.003 0.023 0.003 0.023 0.04 0.08\n"
                           "fix ins all insert/pack seed 32452843 distributiontemplate dist maxattempt 100 insert_every 1000 "
                           "overlapcheck yes all_in yes orientation random vel constant 0 0 -0.5 region pour ntry_mc 10000 "
                           "particles_in_region 30\n";
  Engine stock, culled;
  stock.run(read(bed) + "run 1000\n" + pour);
  stock.run("run 2500\n");
  culled.run(read(bed) + asleep + "run 1000\n");
  EXPECT_GT(culled.vector("cull", 3), 1000);
  culled.run(pour);
  culled.run("run 2500\n");
  const State all = stock.state();
  expect_whole(culled, all.size());
  culled.run("unfix cull\n");
  const State back = culled.state();
  EXPECT_EQ(back.size(), all.size());
  EXPECT_EQ(clumps_of(back), clumps_of(all));
  std::map<int, int> spheres;
  for (const auto& [tag, a] : back) ++spheres[a.clump];
  for (const auto& [number, n] : spheres) EXPECT_EQ(n, 3) << "spheres of clump " << number;
}

/// A fix that counts clumps gives each a number more. Those that were stored then have the number that it begins with.
TEST(ClumpsInDecks, GetTheColumnsOfFixesThatComeLater) {
  const ClumpBed bed = bed_of("three");
  Engine without, with;
  if (with.rank() == 0) {
    std::ofstream face("clumps_pass.stl");
    face << "solid face\n";
    for (const char* third : {"0.0275 -0.0015", "-0.0015 0.0275"})
      face << "facet normal 0 0 1\nouter loop\nvertex -0.0015 -0.0015 0.0\nvertex " << third
           << " 0.0\nvertex 0.0275 0.0275 0.0\nendloop\nendfacet\n";
    face << "endsolid face\n";
  }
  for (Engine* e : {&without, &with}) e->run(read(bed) + asleep + "run 600\n");
  EXPECT_GT(with.vector("cull", 3), 1000);
  with.run(
      "fix face all mesh/surface/planar file clumps_pass.stl type 1\n"
      "fix passed all massflow/mesh mesh face count once vec_side 0 0 -1\n");
  for (Engine* e : {&without, &with}) e->run("run 100\nunfix cull\nrun 0\n");
  expect_same_granules(without.state(), with.state());
  constexpr std::size_t quaternion = 13;  // behind the centre and what moves
  const ClumpRows rows = without.clumps();
  for (const auto& [number, row] : with.clumps()) {
    const std::vector<double>& due = rows.at(number);
    ASSERT_EQ(row.size(), due.size() + 1);
    EXPECT_EQ(row.back(), -1);
    // those that the mesh has woken have moved by next to nothing since
    for (std::size_t k = quaternion; k < due.size(); ++k)
      EXPECT_LE(std::abs(row[k] - due[k]), 1e-6 * std::abs(due[k])) << "clump " << number << ", number " << k;
  }
}

/// Spheres that are of no clump are not moved by fix multisphere: without an integrator of their own they stay where they are.
TEST(ClumpsInDecks, LeaveSpheresAloneThatNothingMoves) {
  std::string deck = read(bed_of("mixed"));
  const std::string integrator = "fix spheres all nve/sphere\n";
  deck.erase(deck.find(integrator), integrator.size());
  Engine stock, culled;
  stock.run(deck + "run 600\n");
  culled.run(deck + asleep + "run 600\n");
  EXPECT_GT(culled.vector("cull", 2) + culled.vector("cull", 3), 100) << "no clump was culled: the test shows nothing";
  for (Engine* e : {&stock, &culled}) e->run("unfix z1\nrun 500\n");
  culled.run("unfix cull\n");
  const State all = stock.state(), back = culled.state();
  expect_same_granules(all, back);
  std::size_t spheres = 0;
  for (const auto& [tag, g] : all) {
    if (g.clump) continue;
    ++spheres;
    EXPECT_EQ(back.at(tag).x, g.x) << tag;
  }
  EXPECT_GT(spheres, 50u);
}

/// Contacts that a formula counts between runs: none within a clump, be it across a border. Those of clumps across a periodic
/// side are known where one rank has both sides.
TEST(ClumpsInDecks, HaveNoContactsWithinBetweenRuns) {
  const std::string count =
      "compute each all contact/atom\ncompute sum all reduce sum c_each\nthermo_style custom step atoms c_sum\n"
      "variable contacts equal c_sum\nrun 100\n";
  for (const std::string name : {"periodic", "three"}) {
    const std::string deck = read(bed_of(name));
    Engine stock, culled;
    stock.run(deck + "run 600\n" + count);
    culled.run(deck + asleep + "run 600\n" + count);
    EXPECT_GT(culled.vector("cull", 3), 100);
    const double contacts = culled.variable("contacts"), due = stock.variable("contacts");
    culled.run("unfix cull\nrun 0\n");
    if (name == "periodic" && culled.lammps()->comm->nprocs > 1) {
      EXPECT_LE(contacts, culled.variable("contacts"));
    } else {
      EXPECT_EQ(contacts, culled.variable("contacts")) << name;
      EXPECT_NEAR(contacts, due, 0.01 * due) << name;
    }
  }
}

/// A clump that has lost a sphere is deleted, stored or not, as in stock.
TEST(ClumpsInDecks, AreDeletedAsInStock) {
  const ClumpBed bed = bed_of("three");
  const std::string dig =
      "region hole block 0.008 0.016 0.008 0.016 0 0.008 units box\ndelete_atoms region hole compress no\nrun 300\n";
  Engine stock, culled;
  stock.run(read(bed) + "run 600\n" + dig);
  culled.run(read(bed) + asleep + "run 600\n");
  EXPECT_GT(culled.vector("cull", 3), 1000);
  culled.run(dig);
  const State all = stock.state();
  expect_whole(culled, all.size());
  culled.run("unfix cull\nrun 0\n");
  expect_same_granules(all, culled.state());
  EXPECT_EQ(stock.clumps().size(), culled.clumps().size());
  EXPECT_LT(all.size(), 1200u);
}

}  // namespace
}  // namespace decks
