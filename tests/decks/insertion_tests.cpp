// Fixes that insert granules where a bed sleeps, half sleeps or is not: as many come, and with as much energy, as without
// culling.
#include <gtest/gtest.h>
#include <mpi.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <ostream>
#include <sstream>
#include <string>
#include <tuple>

#include "engine.h"

namespace decks {
namespace {

struct Style {
  const char* name;
  const char* lines;  // REGION: stands for the block where granules are to come
  friend void PrintTo(const Style& s, std::ostream* out) { *out << s.name; }
};

#define TEMPLATE(radius)                                                                                  \
  "fix t3 all particletemplate/sphere 15485863 atom_type 1 density constant 2500 radius constant " radius \
  "\nfix more all particledistribution/discrete 32452843 1 t3 1.0\n"
#define FROM(style) "fix new all insert/" style " seed 86028157 distributiontemplate more vel constant 0 0 -0.3 maxattempt 100 "
#define STREAM "fix new all insert/stream seed 86028157 distributiontemplate more vel constant 0 0 -0.3 maxattempt 100 "

const Style styles[] = {
    {"pack_once",
     TEMPLATE("0.0008") FROM("pack") "insert_every once overlapcheck yes all_in yes region where particles_in_region 400\n"},
    {"pack_often",
     TEMPLATE("0.0008") FROM("pack") "insert_every 40 overlapcheck yes all_in no region where particles_in_region 400\n"},
    {"pack_no_check",
     TEMPLATE("0.0008") FROM("pack") "insert_every once overlapcheck no all_in yes region where particles_in_region 260\n"},
    {"pack_large",
     TEMPLATE("0.003") FROM("pack") "insert_every once overlapcheck yes all_in no region where particles_in_region 230\n"},
    {"rate", TEMPLATE("0.0008") FROM(
                 "rate/region") "particlerate 20000 nparticles 100 insert_every 40 overlapcheck yes all_in yes region where\n"},
    {"stream",
     TEMPLATE("0.0008") "fix face all mesh/surface/planar file FACE type 1\n" STREAM
                        "particlerate 20000 nparticles 100 insert_every 700 overlapcheck yes all_in no insertion_face face\n"},
    {"stream_extrude",
     TEMPLATE(
         "0.0008") "fix face all mesh/surface/planar file FACE type 1\n" STREAM
                   "particlerate 20000 nparticles 100 overlapcheck yes all_in yes insertion_face face extrude_length 0.008\n"},
    {"stream_tilted",
     TEMPLATE(
         "0.0008") "fix face all mesh/surface/planar file TILTED type 1\n" STREAM
                   "particlerate 20000 nparticles 100 overlapcheck yes all_in no insertion_face face extrude_length 0.008\n"},
    {"stream_later", TEMPLATE("0.0008") "fix face all mesh/surface/planar file FACE type 1\n" STREAM
                                        "particlerate 20000 nparticles 100 start START overlapcheck yes all_in no insertion_face "
                                        "face extrude_length 0.008\n"},
    {"two_at_once",
     TEMPLATE("0.0008")
         FROM("rate/region") "particlerate 20000 nparticles 60 insert_every 40 overlapcheck yes all_in yes region where\n"
                             "fix new2 all insert/rate/region seed 67867979 distributiontemplate more vel constant 0 0 -0.1 "
                             "maxattempt 100 "
                             "particlerate 20000 nparticles 60 insert_every 40 overlapcheck yes all_in no region where\n"},
};

struct Place {
  const char* name;
  double lo;  // m; the bed is some 30 mm deep
  friend void PrintTo(const Place& p, std::ostream* out) { *out << p.name; }
};
const Place places[] = {{"in_the_bed", 0.012}, {"at_its_surface", 0.026}, {"above", 0.045}};

class Insertion : public testing::TestWithParam<std::tuple<Style, Place>> {};

Bed bed() {
  Bed b;
  b.name = "insertion";
  return b;
}

void replace(std::string& in, const std::string& what, const std::string& by) {
  for (std::size_t at = in.find(what); at != std::string::npos; at = in.find(what)) in.replace(at, what.size(), by);
}

/// A square inlet, above the block where its stream begins.
void write_face(const std::string& file, double z, double tilt) {
  std::ofstream out(file);
  const double c[4][2] = {{0.006, 0.006}, {0.02, 0.006}, {0.02, 0.02}, {0.006, 0.02}};
  out << "solid face\n";
  for (const auto& t : {std::array<int, 3>{0, 1, 2}, std::array<int, 3>{0, 2, 3}}) {
    out << "facet normal 0 0 1\nouter loop\n";
    for (const int k : t) out << "vertex " << c[k][0] << ' ' << c[k][1] << ' ' << z + tilt * (c[k][1] - 0.013) << '\n';
    out << "endloop\nendfacet\n";
  }
  out << "endsolid face\n";
}

struct Outcome {
  double granules, energy;
};

/// moved_by: what the bed is moved by before the insertion (m).
Outcome outcome(Engine& e, const Style& style, const Place& place, const std::string& culling, double moved_by = 0) {
  const std::string face = std::string("face_") + place.name + ".stl";
  const std::string start = read_bed(bed()) + "variable n equal count(all)\nvariable k equal ke\n" + culling;
  if (e.rank() == 0) {
    write_face(face, place.lo, 0);
    write_face("tilted_" + face, place.lo, 0.36);
  }
  MPI_Barrier(MPI_COMM_WORLD);
  e.run(start + "run 200\n");
  e.run("variable now equal step\n");
  if (moved_by != 0) {
    std::ostringstream moved;
    moved << "displace_atoms all move " << moved_by << " 0 0 units box\n";
    e.run(moved.str());
  }
  std::ostringstream block, later;
  block << "region where block 0.004 0.022 0.004 0.022 " << place.lo << ' ' << place.lo + 0.01 << " units box\n";
  later << static_cast<long>(e.variable("now")) + 150;
  std::string lines = block.str() + style.lines;
  replace(lines, "TILTED", "tilted_" + face);
  replace(lines, "FACE", face);
  replace(lines, "START", later.str());
  e.run(lines + "run 400\n");
  return {e.variable("n"), e.variable("k")};
}

// J: of a bed that comes to rest, a fifth of what it has where each granule moves as fast as what counts as rest at most. Those
// that are culled have none
constexpr double last_motion = 3e-8;

TEST_P(Insertion, BringsAsManyGranulesAsWithoutCulling) {
  const auto& [style, place] = GetParam();
  Engine culled;
  // who is at the edge of a block when granules come the next time is a matter of chance: so are counts then
  double least = HUGE_VAL, most = 0, least_energy = HUGE_VAL, most_energy = 0;
  for (const double moved_by : {0.0, 1e-8, -1e-8, 2e-8, -2e-8}) {
    Engine stock;
    const Outcome o = outcome(stock, style, place, "", moved_by);
    if (stock.rank() == 0) std::printf("%s %s: stock %g, %g J\n", style.name, place.name, o.granules - 1300, o.energy);
    least = std::min(least, o.granules);
    most = std::max(most, o.granules);
    least_energy = std::min(least_energy, o.energy);
    most_energy = std::max(most_energy, o.energy);
  }
  const Outcome found = outcome(culled, style, place, "fix cull all solid/cull exterior sleep every 50 calm 2\n");
  EXPECT_GT(culled.vector("cull", 6), 600) << "the bed never slept";
  if (culled.rank() == 0) std::printf("%s %s: culled %g, %g J\n", style.name, place.name, found.granules - 1300, found.energy);
  EXPECT_GE(found.granules, least);
  EXPECT_LE(found.granules, most);
  EXPECT_GE(found.energy, 0.95 * least_energy - last_motion);
  EXPECT_LE(found.energy, 1.05 * most_energy + last_motion);
}

INSTANTIATE_TEST_SUITE_P(All, Insertion, testing::Combine(testing::ValuesIn(styles), testing::ValuesIn(places)),
                         [](const auto& info) {
                           return std::string(std::get<0>(info.param).name) + "_" + std::get<1>(info.param).name;
                         });

}  // namespace
}  // namespace decks
