// Interface meshes that are kept, and the region that they make: commands that are given it act as its group says.
#include <gtest/gtest.h>
#include <mpi.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "atom.h"
#include "engine.h"
#include "fix.h"
#include "group.h"
#include "interface_mesh_source.h"
#include "lammps.h"
#include "modify.h"

namespace decks {
namespace {

using solidcull::InterfaceMesh;
using solidcull::Vec3;

constexpr double diameter = 0.0026, voxel = 0.5 * diameter;

LAMMPS_NS::Fix* cull(Engine& e) { return e.lammps()->modify->fix[e.lammps()->modify->find_fix("cull")]; }

const std::map<int, InterfaceMesh>& meshes(Engine& e) {
  return dynamic_cast<solidcull::InterfaceMeshSource*>(cull(e))->interface_meshes();
}

/// For each owned atom, whether the mesh of any rank holds its centre, or a periodic image of that.
std::vector<char> held(Engine& e, const Vec3& period) {
  const LAMMPS_NS::Atom* atom = e.lammps()->atom;
  std::vector<int> counts(static_cast<std::size_t>(e.ranks())), at(counts.size(), 0);
  const int mine = 3 * atom->nlocal;
  MPI_Allgather(&mine, 1, MPI_INT, counts.data(), 1, MPI_INT, MPI_COMM_WORLD);
  for (std::size_t r = 1; r < counts.size(); ++r) at[r] = at[r - 1] + counts[r - 1];
  std::vector<double> x(static_cast<std::size_t>(at.back() + counts.back()));
  MPI_Allgatherv(atom->x[0], mine, MPI_DOUBLE, x.data(), counts.data(), at.data(), MPI_DOUBLE, MPI_COMM_WORLD);
  std::vector<char> in(x.size() / 3, 0);
  const int sides = period.isZero() ? 0 : 4;  // a body hangs together over several periods
  for (const auto& body : meshes(e))
    for (std::size_t n = 0; n < in.size(); ++n)
      for (int i = -sides; i <= sides && !in[n]; ++i)
        for (int j = -sides; j <= sides && !in[n]; ++j)
          in[n] = body.second.inside(Vec3(x[3 * n], x[3 * n + 1], x[3 * n + 2]) + Vec3(i, j, 0).cwiseProduct(period));
  MPI_Allreduce(MPI_IN_PLACE, in.data(), static_cast<int>(in.size()), MPI_CHAR, MPI_MAX, MPI_COMM_WORLD);
  const auto first = in.begin() + at[static_cast<std::size_t>(e.rank())] / 3;
  return std::vector<char>(first, first + atom->nlocal);
}

double sum(double mine) {
  double all = 0;
  MPI_Allreduce(&mine, &all, 1, MPI_DOUBLE, MPI_SUM, MPI_COMM_WORLD);
  return all;
}
double largest(double mine) {
  double all = 0;
  MPI_Allreduce(&mine, &all, 1, MPI_DOUBLE, MPI_MAX, MPI_COMM_WORLD);
  return all;
}

/// Level set of all bodies of this rank (m).
double level(Engine& e, const Vec3& x) {
  double least = HUGE_VAL;
  for (const auto& body : meshes(e)) least = std::min(least, body.second.signed_distance(x));
  return least;
}

/// Largest difference of the two, at the surfaces of both (voxels). Collective.
double distance(Engine& a, Engine& b) {
  double most = 0;
  for (Engine* e : {&a, &b})
    for (const auto& body : meshes(*e))
      for (const Vec3& v : body.second.triangles().vertices) most = std::max(most, std::abs(level(a, v) - level(b, v)) / voxel);
  return largest(most);
}

struct Scene {
  std::string name, keywords, commands;  // what goes on for 1,000 steps; each line is run with the step's question in between
  bool periodic = false;
  int least = 100;  // granules that are culled in the end

  friend void PrintTo(const Scene& s, std::ostream* out) { *out << s.name; }
};

Bed bed_of(const Scene& scene) {
  Bed bed;
  bed.name = scene.periodic ? "mesh_periodic" : "mesh";
  bed.periodic = scene.periodic;
  return bed;
}

const std::string ball =
    "create_atoms 1 single 0.013 0.013 0.052 units box\ngroup ball id > 1300\nset group ball diameter 0.005 density 2500\n"
    "velocity ball set 0 0 -0.6\n";
const std::string calm = "every 50 calm 2 speed 0.05 tolerance 6 0.1", calmer = "every 50 calm 2 speed 0.05 tolerance 30 1";
const std::string tilt = "unfix grav\nfix grav all gravity 9.81 vector 0.7 0 -1\n";
const std::string untilt = "unfix grav\nfix grav all gravity 9.81 vector 0 0 -1\n";

class KeptMesh : public testing::TestWithParam<Scene> {};

/// Carves, merges and splits for 1,000 steps, all the time asked for meshes; then against those that are made after a restart.
TEST_P(KeptMesh, IsAsAFreshOneAndHoldsWhatIsCulledAlone) {
  const Scene& scene = GetParam();
  const std::string fix = "fix cull all solid/cull " + scene.keywords + "\n";
  Engine kept, fresh;
  kept.run(read_bed(bed_of(scene)) + "run 0\n" + fix + "run 300\n" + scene.commands +
           "region solid interface/mesh cull\nvariable one atom 1\ncompute inside all reduce/region solid sum v_one\n"
           "fix asks all ave/time 20 1 20 c_inside\nrun 1000\nwrite_restart mesh.restart\n");
  EXPECT_GT(kept.vector("cull", 8), 3) << "carves";
  const Bed bed = bed_of(scene);
  fresh.run(head(bed) + "read_restart mesh.restart\nneighbor 0.0004 bin\nneigh_modify delay 0\n" + body(bed) +
            "fix integr all nve/sphere\nthermo 100000\nthermo_modify norm no\n" + fix + "run 0\n");
  ASSERT_EQ(fresh.vector("cull", 1), kept.vector("cull", 1)) << "the same granules are exterior";
  const double apart = distance(kept, fresh);
  EXPECT_LE(apart, 0.5) << "voxels between a kept mesh and a fresh one";

  kept.run("variable n equal count(all)\n");
  kept.variable("n");  // the whole bed is there
  const std::vector<char> in = held(kept, scene.periodic ? Vec3(0.026, 0.026, 0) : Vec3(Vec3::Zero()));
  double culled = 0, outside = 0, exterior = 0, inside = 0;
  for (std::size_t i = 0; i < in.size(); ++i)
    if (cull(kept)->vector_atom[i] > 0)
      ++culled, outside += !in[i];
    else
      ++exterior, inside += in[i];
  culled = sum(culled), outside = sum(outside), exterior = sum(exterior), inside = sum(inside);
  EXPECT_GE(culled, scene.least);
  EXPECT_EQ(outside, 0) << "culled centres out of " << culled;
  kept.run("variable m equal count(all,solid)\n");
  EXPECT_EQ(kept.variable("m"), culled + inside) << "what the region holds";
  EXPECT_LE(inside, 0.02 * exterior) << "exterior centres";
  if (kept.rank() == 0)
    std::printf("%s: %g culled centres, %g outside; %g exterior ones, %g inside; kept and fresh %.2g voxels apart; %zu bodies\n",
                scene.name.c_str(), culled, outside, exterior, inside, apart, meshes(kept).size());
}

INSTANTIATE_TEST_SUITE_P(Meshes, KeptMesh,
                         testing::Values(Scene{"impact", calm, ball},
                                         Scene{"impact_live", "exterior live depth 1.5 " + calm, ball},
                                         Scene{"impact_compact", "store compact " + calm, ball},
                                         Scene{"struck_refill", calm + " store none restore refill",
                                               "group few id 100 200 300 400\nvelocity few set 0.1 0 0.3\n", false, 1},
                                         Scene{"rain", calm, rain_of_64 + std::string("run 1500\n")},
                                         Scene{"tilt_and_back", calm, tilt + "run 150\n" + untilt + "run 600\n" + ball},
                                         Scene{"rain_periodic", calmer, rain_of_64 + std::string("run 1500\n"), true}),
                         [](const auto& info) { return info.param.name; });

// ------------------------------------------------------------------------------------------------------------ the region

struct Asleep {
  std::string name, keywords, commands;
};
const std::vector<Asleep> states = {{"asleep", "every 50 calm 2 speed 0.05 tolerance 12 0", "run 300\n"},
                                    {"half", "every 50 calm 2", "run 300\n" + ball + "run 1000\n"},
                                    {"live", "exterior live depth 1.5 every 50 calm 2", "run 500\n"}};

struct Case {
  std::string name, by_region, by_group;  // both do the same where the group G is that of the region S
  bool other_tags = false;

  friend void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }
};

class CommandsOnAMeshRegion : public testing::TestWithParam<Case> {};

std::string deck(const Asleep& state, const std::string& side) {
  Bed bed;
  bed.name = "mesh";
  return read_bed(bed) + "run 0\nfix cull all solid/cull " + state.keywords + "\n" + state.commands +
         "region S interface/mesh cull side " + side +
         "\nregion low block INF INF INF INF INF 0.01 units box\nregion both intersect 2 S low\nregion one union 2 S low\n";
}

std::multiset<std::vector<double>> places(const State& state) {
  std::multiset<std::vector<double>> all;
  for (const auto& g : state) all.insert({g.second.x[0], g.second.x[1], g.second.x[2], g.second.mass, g.second.v[0]});
  return all;
}

TEST_P(CommandsOnAMeshRegion, ActAsItsGroupSaysBefore) {
  const Case& c = GetParam();
  const std::string groups = "group G region S\ngroup B region both\ngroup U region one\n";
  for (const Asleep& state : states)
    for (const char* side : {"in", "out"}) {
      Engine by_region, by_group;
      by_region.run(deck(state, side) + c.by_region);
      by_group.run(deck(state, side) + groups + "variable held equal count(G)\n");
      const double held = by_group.variable("held");
      by_group.run(c.by_group);
      for (Engine* e : {&by_region, &by_group}) e->run("group everyone union all\n");
      const State a = by_region.state(), b = by_group.state();
      ASSERT_EQ(a.size(), b.size()) << state.name << ", side " << side << ", of " << held << " in the region";
      EXPECT_EQ(places(a), places(b)) << state.name << ", side " << side;
      if (!c.other_tags) expect_same_granules(a, b);
      if (state.name != "asleep" || std::string(side) == "in") {
        EXPECT_GT(held, 20) << state.name;
      }
      for (Engine* e : {&by_region, &by_group}) e->run("run 20\n");  // and go on
    }
}

INSTANTIATE_TEST_SUITE_P(
    Meshes, CommandsOnAMeshRegion,
    testing::Values(Case{"delete_atoms", "delete_atoms region S\n", "delete_atoms group G\n", true},
                    Case{"delete_atoms_compress_no", "delete_atoms region S compress no\n", "delete_atoms group G compress no\n"},
                    Case{"delete_atoms_intersect", "delete_atoms region both\n", "delete_atoms group B\n", true},
                    Case{"delete_atoms_union", "delete_atoms region one\n", "delete_atoms group U\n", true},
                    Case{"delete_atoms_asked_before", "group X region S\ndelete_atoms region S\n", "delete_atoms group G\n",
                         true},
                    Case{"delete_atoms_after_a_command_that_restores", "change_box all boundary f f f\ndelete_atoms region S\n",
                         "change_box all boundary f f f\ndelete_atoms group G\n", true},
                    Case{"delete_atoms_twice", "delete_atoms region low\ndelete_atoms region S\n",
                         "group L region low\ndelete_atoms group L\ndelete_atoms group G\n", true},
                    Case{"set", "set region S vx 0.001\n", "set group G vx 0.001\n"},
                    Case{"set_of_a_union", "set region one vx 0.001\n", "set group U vx 0.001\n"},
                    Case{"masks", "variable m atom rmask(S)*0.001+grmask(all,both)*0.01\nset group all vx v_m\n",
                         "variable m atom gmask(G)*0.001+gmask(B)*0.01\nset group all vx v_m\n"},
                    Case{"group_functions", "variable n equal count(all,S)*1e-6+count(all,both)*1e-9\nset group all vx ${n}\n",
                         "variable n equal count(G)*1e-6+count(B)*1e-9\nset group all vx ${n}\n"}),
    [](const auto& info) { return info.param.name; });

TEST(MeshRegion, IsWhereGranulesAreMade) {
  for (const Asleep& state : states)
    for (const char* side : {"in", "out"}) {
      Engine e;
      e.run(deck(state, side) +
            "variable before equal count(all)\nlattice sc 0.0021\n"
            "region top block 0.002 0.024 0.002 0.024 0.002 0.05 units box\nregion there intersect 2 S top\n");
      const double before = e.variable("before");
      e.run(
          "create_atoms 2 region there\ngroup new id > " + std::to_string(static_cast<int>(before)) +
          "\ngroup in region S\ngroup both intersect new in\nvariable made equal count(new)\nvariable both equal count(both)\n");
      EXPECT_GT(e.variable("made"), 3) << state.name << ", side " << side;
      EXPECT_EQ(e.variable("made"), e.variable("both")) << state.name << ", side " << side;
    }
}

TEST(MeshRegion, ChoosesWhatIsWritten) {
  for (const Asleep& state : states)
    for (const char* side : {"in", "out"}) {
      Engine e;
      e.run(deck(state, side) + "write_dump all custom region.dump id modify region S\nwrite_restart region.restart region S\n" +
            "group G region S\nvariable held equal count(G)\n");
      const double held = e.variable("held");
      std::ifstream dump("region.dump");
      std::string line;
      for (int k = 0; k < 4; ++k) std::getline(dump, line);
      EXPECT_EQ(std::stod(line), held) << state.name << ", side " << side;
      if (held == 0) continue;
      Engine again;
      again.run(head(Bed()) + "read_restart region.restart\nvariable n equal atoms\n");
      EXPECT_EQ(static_cast<double>(again.lammps()->atom->natoms), held) << state.name << ", side " << side;
    }
}

// ------------------------------------------------------------------------------------------------------------ files

/// A closed surface as an STL file has it: edges that are not passed as often one way as the other, and what it encloses (m^3).
struct Closed {
  std::size_t triangles = 0, open_edges = 0;
  double volume = 0;
};

Closed read_stl(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  std::string head(80, '\0');
  std::uint32_t count = 0;
  in.read(head.data(), 80).read(reinterpret_cast<char*>(&count), sizeof count);
  using Corner = std::array<float, 3>;
  struct [[gnu::packed]] Record {
    float normal[3], corners[9];
    char none[2];
  } r;
  Closed found;
  std::map<std::pair<Corner, Corner>, int> passed;
  for (; found.triangles < count && in.read(reinterpret_cast<char*>(&r), sizeof r); ++found.triangles) {
    Corner c[3];
    Vec3 v[3];
    for (int k = 0; k < 3; ++k)
      for (int d = 0; d < 3; ++d) v[k][d] = c[k][static_cast<std::size_t>(d)] = r.corners[3 * k + d];
    found.volume += v[0].dot(v[1].cross(v[2])) / 6;
    for (int k = 0; k < 3; ++k) {
      const Corner &from = c[k], &to = c[(k + 1) % 3];
      if (from != to) from < to ? ++passed[{from, to}] : --passed[{to, from}];
    }
  }
  EXPECT_EQ(found.triangles, count) << file << " ends too early";
  for (const auto& p : passed) found.open_edges += p.second != 0;
  return found;
}

/// All granules are atoms in the first step, and nearly all sleep in the last: the skin of the bed is the same.
TEST(FilesOfMeshes, AreClosedAndAreTheSameOnAnyRanks) {
  Bed bed;
  bed.name = "mesh";
  Engine e;
  e.run(read_bed(bed) +
        "run 0\nfix cull all solid/cull every 50 calm 2 speed 0.05 tolerance 30 1 mesh 300 skin_*.stl skin mesh 300 bodies_*.stl "
        "mesh 300 bodies_*_%.vdb mesh 300 bodies_*.vtp bed 300 bed_*_%.vdb\n"
        "reset_timestep 0\nrun 300\n");
  EXPECT_GT(e.vector("cull", 3), 300) << "stored granules";
  for (const char* what : {"bodies", "bed"})
    EXPECT_TRUE(std::ifstream(what + ("_000000300_" + std::to_string(e.rank())) + ".vdb").good()) << what;
  if (e.rank() != 0) return;
  const Closed awake = read_stl("skin_000000000.stl"), asleep = read_stl("skin_000000300.stl"),
               bodies = read_stl("bodies_000000300.stl");
  for (const Closed* c : {&awake, &asleep, &bodies}) {
    EXPECT_GT(c->triangles, 1000u);
    EXPECT_EQ(c->open_edges, 0u);
  }
  EXPECT_NEAR(asleep.volume, awake.volume, 0.002 * awake.volume);
  EXPECT_LT(std::abs(static_cast<double>(asleep.triangles) / static_cast<double>(awake.triangles) - 1), 0.02);
  EXPECT_LT(bodies.volume, 1.0001 * asleep.volume);
  std::printf("skin: %zu and %zu triangles, %.6g and %.6g m^3; bodies: %zu, %.6g m^3\n", awake.triangles, asleep.triangles,
              awake.volume, asleep.volume, bodies.triangles, bodies.volume);
}

}  // namespace
}  // namespace decks
