#include "engine.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "fix.h"
#include "fix_contact_history.h"
#include "fix_contact_history_mesh.h"
#include "fix_multisphere.h"
#include "group.h"
#include "input.h"
#include "lammps.h"
#include "modify.h"
#include "program_calls.h"
#include "variable.h"

namespace decks {
namespace {

template <class Row>
std::vector<Row> everywhere(const std::vector<Row>& mine) {
  int ranks = 1;
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  int bytes = static_cast<int>(mine.size() * sizeof(Row)), total = 0;
  std::vector<int> counts(ranks), at(ranks);
  MPI_Allgather(&bytes, 1, MPI_INT, counts.data(), 1, MPI_INT, MPI_COMM_WORLD);
  for (int r = 0; r < ranks; ++r) {
    at[r] = total;
    total += counts[r];
  }
  std::vector<Row> all(static_cast<std::size_t>(total) / sizeof(Row));
  MPI_Allgatherv(mine.data(), bytes, MPI_BYTE, all.data(), counts.data(), at.data(), MPI_BYTE, MPI_COMM_WORLD);
  return all;
}

Vec vec(const double* v) { return {v[0], v[1], v[2]}; }

/// DECK_PACKING=1, 2 or 3 pours every bed otherwise: a test that then fails holds for one packing only.
int pouring_seed() {
  constexpr int primes[] = {32452867, 15485917, 49979693, 67867979};
  const char* const wanted = std::getenv("DECK_PACKING");
  return primes[wanted ? std::clamp(std::atoi(wanted), 0, 3) : 0];
}

void write_floor(const std::string& file, double side) {
  // two triangles, a little larger than the box
  const double lo = -0.001, hi = side + 0.001;
  std::ofstream out(file);
  const double c[4][2] = {{lo, lo}, {hi, lo}, {hi, hi}, {lo, hi}};
  out << "solid floor\n";
  for (const auto& t : {std::array<int, 3>{0, 1, 2}, std::array<int, 3>{0, 2, 3}}) {
    out << "facet normal 0 0 1\nouter loop\n";
    for (const int k : t) out << "vertex " << c[k][0] << ' ' << c[k][1] << " 0\n";
    out << "endloop\nendfacet\n";
  }
  out << "endsolid floor\n";
}

void write_side(const std::string& file, double side) {
  const double lo = -0.001, hi = side + 0.001, top = 0.1;
  std::ofstream out(file);
  const double c[4][2] = {{lo, lo}, {hi, lo}, {hi, top}, {lo, top}};
  out << "solid side\n";
  for (const auto& t : {std::array<int, 3>{0, 1, 2}, std::array<int, 3>{0, 2, 3}}) {
    out << "facet normal 1 0 0\nouter loop\n";
    for (const int k : t) out << "vertex 0 " << c[k][0] << ' ' << c[k][1] << "\n";
    out << "endloop\nendfacet\n";
  }
  out << "endsolid side\n";
}

}  // namespace

Engine::Engine(MPI_Comm ranks) {
  std::vector<std::string> words = {"liggghts", "-log", "none", "-screen", "deck_tests.screen"};
  std::vector<char*> args;
  for (std::string& w : words) args.push_back(&w[0]);
  lmp_ = new LAMMPS_NS::LAMMPS(static_cast<int>(args.size()), args.data(), ranks);
  in_deck_ = std::make_unique<solidcull::ProgramCall>(lmp_, solidcull::ProgramCall::By::library);
}

Engine::~Engine() {
  in_deck_.reset();
  delete lmp_;
}

void Engine::run(const std::string& deck) {
  std::istringstream lines(deck);
  for (std::string line; std::getline(lines, line);)
    if (!line.empty()) lmp_->input->one(line.c_str());
}

int Engine::group_bit(const std::string& name) const { return lmp_->group->bitmask[lmp_->group->find(name.c_str())]; }

int Engine::rank() const { return lmp_->comm->me; }
int Engine::ranks() const { return lmp_->comm->nprocs; }

State Engine::state() const {
  struct Row {
    int tag;
    Granule g;
  };
  std::vector<Row> rows;
  const LAMMPS_NS::Atom* a = lmp_->atom;
  for (int i = 0; i < a->nlocal; ++i)
    rows.push_back({a->tag[i],
                    {vec(a->x[i]), vec(a->v[i]), vec(a->omega[i]), vec(a->f[i]), vec(a->torque[i]), a->radius[i], a->rmass[i],
                     a->type[i], a->mask[i], a->molecule ? std::max(a->molecule[i], 0) : 0}});
  State state;
  for (const Row& r : everywhere(rows)) state[r.tag] = r.g;
  return state;
}

ClumpRows Engine::clumps() const {
  struct Row {
    int number, width;
    double of_row[100];
  };
  std::vector<Row> rows;
  for (int f = 0; f < lmp_->modify->nfix; ++f) {
    auto* fix = dynamic_cast<LAMMPS_NS::FixMultisphere*>(lmp_->modify->fix[f]);
    if (!fix) continue;
    for (int k = 0; k < fix->data().n_body(); ++k) {
      Row r{fix->data().tag(k), 0, {}};
      r.width = fix->data().prop().pushElemToBuffer(k, r.of_row, LAMMPS_NS::OPERATION_COMM_EXCHANGE, false, false, false);
      rows.push_back(r);
    }
  }
  ClumpRows all;
  for (const Row& r : everywhere(rows)) all[r.number] = std::vector<double>(r.of_row, r.of_row + r.width);
  return all;
}

Histories Engine::histories() {
  struct Row {
    int tag, partner, width;
    double h[16];
  };
  std::vector<Row> rows;
  LAMMPS_NS::Modify* modify = lmp_->modify;
  for (int f = 0; f < modify->nfix; ++f) {
    if (std::strncmp(modify->fix[f]->style, "contacthistory", 14) != 0) continue;
    auto* fix = static_cast<LAMMPS_NS::FixContactHistory*>(modify->fix[f]);
    const bool mesh = std::strcmp(fix->style, "contacthistory/mesh") == 0;
    fix->setup_pre_exchange();
    for (int i = 0; i < lmp_->atom->nlocal; ++i)
      for (int k = 0; k < fix->n_partner(i); ++k) {
        Row r{lmp_->atom->tag[i], mesh ? -1 - fix->partner(i, k) : fix->partner(i, k), fix->get_dnum(), {}};
        std::copy_n(fix->contacthistory(i, k), r.width, r.h);
        rows.push_back(r);
      }
  }
  Histories all;
  for (const Row& r : everywhere(rows)) all[{r.tag, r.partner}] = std::vector<double>(r.h, r.h + r.width);
  return all;
}

double Engine::vector(const std::string& fix, int n) {
  LAMMPS_NS::Fix* f = lmp_->modify->fix[lmp_->modify->find_fix(fix.c_str())];
  return n == 0 ? f->compute_scalar() : f->compute_vector(n - 1);
}

double Engine::variable(const std::string& name) {
  std::string n = name;
  return lmp_->input->variable->compute_equal(lmp_->input->variable->find(&n[0]));
}

void expect_same_granules(const State& a, const State& b) {
  ASSERT_EQ(a.size(), b.size());
  for (const auto& g : a) {
    ASSERT_TRUE(b.count(g.first)) << "granule " << g.first << " was lost";
    EXPECT_EQ(g.second.type, b.at(g.first).type);
    EXPECT_EQ(g.second.radius, b.at(g.first).radius);
    EXPECT_EQ(g.second.mass, b.at(g.first).mass);
  }
}

void expect_all_there(Engine& e, const std::string& cull, std::size_t granules) {
  const State atoms = e.state();
  const int bit = e.group_bit(cull + "_interface");
  std::size_t interface = 0;
  for (const auto& g : atoms) interface += (g.second.mask & bit) != 0;
  EXPECT_EQ(atoms.size(), static_cast<std::size_t>(e.lammps()->atom->natoms)) << "two atoms have one tag, or some are lost";
  EXPECT_EQ(e.vector(cull, 1), static_cast<double>(atoms.size() - interface)) << "exterior granules";
  EXPECT_EQ(e.vector(cull, 2), static_cast<double>(interface)) << "interface granules";
  EXPECT_EQ(e.vector(cull, 3), static_cast<double>(granules - atoms.size())) << "interior granules";
}

void expect_same_histories(const Histories& a, const Histories& b) {
  EXPECT_EQ(a.size(), b.size());
  double most = 0, scale = 0;
  for (const auto& h : a) {
    const auto other = b.find(h.first);
    ASSERT_NE(other, b.end()) << "the history of " << h.first.first << " with " << h.first.second << " was lost";
    for (std::size_t d = 0; d < h.second.size(); ++d) {
      most = std::max(most, std::abs(h.second[d] - other->second[d]));
      scale = std::max(scale, std::abs(h.second[d]));
    }
  }
  EXPECT_LE(most, 1e-12 * scale);
}

double largest_difference(const State& a, const State& b, Vec Granule::*what) {
  double most = 0;
  for (const auto& g : a) {
    const auto other = b.find(g.first);
    if (other == b.end()) return HUGE_VAL;
    for (int d = 0; d < 3; ++d) {
      const double diff = std::abs((g.second.*what)[d] - (other->second.*what)[d]);
      if (!(diff <= most)) most = diff;
    }
  }
  return a.size() == b.size() ? most : HUGE_VAL;
}

double largest(const State& a, Vec Granule::*what) {
  double most = 0;
  for (const auto& g : a)
    for (int d = 0; d < 3; ++d) most = std::max(most, std::abs((g.second.*what)[d]));
  return most;
}

/// SOLIDCULL_GRID in the environment, such as "2 2 2", cuts the box otherwise.
std::string grid() {
  const char* const asked = std::getenv("SOLIDCULL_GRID");
  return asked ? asked : "* * 1";
}

std::string head(const Bed& bed, const std::string& cuts) {
  return std::string("atom_style granular\natom_modify map array\nboundary ") + (bed.periodic ? "p p f" : "f f f") +
         "\nnewton off\ncommunicate single vel yes\nunits si\n"
         "processors " +
         cuts + "\n";
}

std::string body(const Bed& bed) {
  std::ostringstream s;
  s << "fix m1 all property/global youngsModulus peratomtype 5.e6 5.e6\n"
       "fix m2 all property/global poissonsRatio peratomtype 0.3 0.3\n"
       "fix m3 all property/global coefficientRestitution peratomtypepair 2 0.3 0.3 0.3 0.3\n"
       "fix m4 all property/global coefficientFriction peratomtypepair 2 0.5 0.5 0.5 0.5\n"
       "fix m5 all property/global coefficientRollingFriction peratomtypepair 2 0.1 0.1 0.1 0.1\n"
       "fix m8 all property/global coefficientRollingViscousDamping peratomtypepair 2 0.1 0.1 0.1 0.1\n"
       "fix m6 all property/global characteristicVelocity scalar 1.0\n";
  if (bed.cohesion) s << "fix m7 all property/global cohesionEnergyDensity peratomtypepair 2 3000 3000 3000 3000\n";
  s << "pair_style gran " << bed.contact << "\npair_coeff * *\ntimestep " << bed.dt
    << "\nfix grav all gravity 9.81 vector 0 0 -1\n";
  const std::string wall = " all wall/gran " + bed.contact;
  for (const char* dim : {"x", "y"}) {
    if (bed.periodic) break;
    if (!(bed.mesh_walls && dim[0] == 'x')) s << "fix " << dim << "1" << wall << " primitive type 1 " << dim << "plane 0\n";
    s << "fix " << dim << "2" << wall << " primitive type 1 " << dim << "plane " << bed.side << "\n";
  }
  if (bed.mesh_walls)
    s << "fix floor all mesh/surface/stress file " << bed.name << "_floor.stl type 1\n"
      << "fix side all mesh/surface/stress file " << bed.name << "_side.stl type 1\n"
      << "fix meshes" << wall << " mesh n_meshes 2 meshes floor side\n";
  else
    s << "fix z1" << wall << " primitive type 1 zplane 0\n";
  s << bed.extra;
  return s.str();
}

/// SOLIDCULL_BOX in the environment, such as 0.4: boxes go on along x to there (m), so that there are far more bins than atoms.
double empty_room() {
  const char* const asked = std::getenv("SOLIDCULL_BOX");
  return asked ? std::atof(asked) : 0.0;
}

std::string pouring(const Bed& bed, const std::string& cuts) {
  std::ostringstream s;
  const double rim = bed.periodic ? 0 : 0.002;
  s << head(bed, cuts) << "region reg block " << -rim << ' '
    << std::max(bed.side + rim, bed.periodic ? 0.0 : std::max(bed.box_length, empty_room())) << ' ' << -rim << ' '
    << bed.side + rim << " -0.002 0.15\n"
    << "create_box 2 reg\nneighbor 0.0006 bin\nneigh_modify delay 0\n"
    << body(bed)
    << "fix t1 all particletemplate/sphere 15485863 atom_type 1 density constant 2500 radius constant 0.0012\n"
       "fix t2 all particletemplate/sphere 15485867 atom_type 2 density constant 2500 radius constant 0.0014\n"
       "fix dist all particledistribution/discrete 32452843 2 t1 0.5 t2 0.5\n"
    << "region pour block 0 " << bed.side << " 0 " << bed.side << " 0.001 0.1\n"
    << "fix ins all insert/pack seed " << pouring_seed()
    << " distributiontemplate dist maxattempt 200 insert_every once overlapcheck yes all_in "
       "yes vel constant 0 0 -0.3 region pour particles_in_region "
    << bed.granules << "\nfix integr all nve/sphere\nthermo 100000\nthermo_modify norm no\n";
  return s.str();
}

bool first_asked_for(const std::string& file) {
  static std::set<std::string> all;
  return all.insert(file).second;
}

void make_bed(const std::string& file, const std::string& deck) {
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  if (rank == 0 && !(std::getenv("SOLIDCULL_KEEP_BEDS") && std::filesystem::exists(file))) {
    const std::string unfinished = "making_" + file;
    Engine(MPI_COMM_SELF).run(deck + "write_restart " + unfinished + "\n");
    std::filesystem::rename(unfinished, file);
  }
  MPI_Barrier(MPI_COMM_WORLD);
}

namespace {

void write_meshes(const Bed& bed) {
  if (!first_asked_for(bed.name + "_floor.stl")) return;
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  if (rank == 0) {
    write_floor(bed.name + "_floor.stl", bed.side);
    write_side(bed.name + "_side.stl", bed.side);
  }
  MPI_Barrier(MPI_COMM_WORLD);
}

std::string settling(const Bed& bed) {
  const auto steps = [&](double at_3e5) { return static_cast<int>(std::lround(at_3e5 * 3e-5 / bed.dt)); };
  std::ostringstream s;
  s << pouring(bed, "1 1 1") << "run " << steps(4000) << "\nunfix ins\n"
    << "fix visc all viscous 0.002\nrun " << steps(6000) << "\n";
  // spin about a lone contact has no damping in most models: stopped by hand, until the bed is at rest
  for (int k = 0; k < 8; ++k) s << "set group all omegax 0 omegay 0 omegaz 0\nvelocity all set 0 0 0\nrun " << steps(700) << "\n";
  s << "unfix visc\n";
  return s.str();
}

}  // namespace

std::string settled(const Bed& bed) {
  write_meshes(bed);
  // beds that differ in their names alone are one, which is poured once
  Bed poured = bed;
  poured.name = "poured";
  std::ostringstream name;
  name << "bed_" << std::hex << std::hash<std::string>()(settling(poured));
  poured.name = name.str();
  const std::string file = poured.name + ".restart";
  if (!first_asked_for(file)) return file;
  write_meshes(poured);
  make_bed(file, settling(poured));
  return file;
}

std::string read_bed(const Bed& bed) {
  return head(bed) + "read_restart " + settled(bed) + "\nneighbor 0.0004 bin\nneigh_modify delay 0\n" + body(bed) +
         "fix integr all nve/sphere\nthermo 100000\nthermo_modify norm no\n";
}

const char* const rain_of_64 =
    "lattice sc 0.004\nregion rain block 0.006 0.020 0.006 0.020 0.05 0.065 units box\ncreate_atoms 1 region rain\n"
    "group rain id > 1300\nset group rain diameter 0.0026\nset group rain density 2500\nvelocity rain set 0 0 -1.0\n";

std::size_t rain_on(Engine& e, const Bed& bed) {
  e.run(rain_of_64);
  const std::size_t all = static_cast<std::size_t>(bed.granules) + 64;
  for (int k = 0; k < 12; ++k) {
    e.run("run 250\n");
    expect_all_there(e, "cull", all);
    EXPECT_NEAR(e.vector("cull", 11), 0, 1e-12 * 0.03) << "mass error";
  }
  return all;
}

}  // namespace decks
