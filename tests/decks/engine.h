// LIGGGHTS as a test drives it: commands in, state by tag out. Works on any number of ranks; every function is collective.
#pragma once

#include <mpi.h>

#include <array>
#include <map>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

namespace LAMMPS_NS {
class Fix;
class LAMMPS;
}  // namespace LAMMPS_NS
namespace solidcull {
class ProgramCall;
}

namespace decks {

using Vec = std::array<double, 3>;

struct Granule {
  Vec x, v, omega, f, torque;
  double radius, mass;
  int type, mask;
  int clump = 0;  ///< that it is a sphere of
};

/// What fix multisphere keeps of each clump, as numbers, by the clump's number; equal on all ranks.
using ClumpRows = std::map<int, std::vector<double>>;
/// Everything a granule has, by tag; equal on all ranks.
using State = std::map<int, Granule>;
/// History of each contact (tag, partner) as `tag` sees it; mesh contacts have the negative triangle ID - 1 as partner.
using Histories = std::map<std::pair<int, int>, std::vector<double>>;

/// Tests look at the engine as a deck leaves it between two of its commands: culled granules are none of its atoms then.
class Engine {
 public:
  explicit Engine(MPI_Comm ranks = MPI_COMM_WORLD);
  ~Engine();
  Engine(const Engine&) = delete;

  void run(const std::string& deck);  ///< lines of a deck
  State state() const;
  Histories histories();                         ///< granule-granule and granule-mesh
  ClumpRows clumps() const;                      ///< those that the engine moves
  double vector(const std::string& fix, int n);  ///< f_ID[n], n from 1; n = 0: f_ID
  double variable(const std::string& name);      ///< an equal-style variable
  int group_bit(const std::string& name) const;
  int rank() const;
  int ranks() const;
  LAMMPS_NS::LAMMPS* lammps() { return lmp_; }

 private:
  LAMMPS_NS::LAMMPS* lmp_;
  std::unique_ptr<solidcull::ProgramCall> in_deck_;
};

double largest_difference(const State& a, const State& b, Vec Granule::*what);

/// The same pairs, and every value within 1e-12 of the largest; local.
void expect_same_histories(const Histories& a, const Histories& b);
/// Expects the same tags, each with its type, radius and mass to the bit.
void expect_same_granules(const State& a, const State& b);
double largest(const State& a, Vec Granule::*what);
/// Expects that so many granules went in and none is lost: `cull` names a fix solid/cull, what it says of atoms is what the
/// engine's own arrays hold, and the rest is in its store. Collective.
void expect_all_there(Engine& e, const std::string& cull, std::size_t granules);

/// What a bed is made of.
struct Bed {
  std::string name;
  std::string contact = "model hertz tangential history rolling_friction epsd2";
  bool mesh_walls = false;
  bool cohesion = false;
  bool periodic = false;  // in x and y, instead of side walls
  int granules = 1300;
  double side = 0.026;    // m, square base
  double box_length = 0;  // m: the box goes on along x to here, where that is more
  double dt = 3e-5;       // s
  std::string extra;      // lines after the walls

  friend void PrintTo(const Bed& bed, std::ostream* out) { *out << bed.name; }
};

std::string grid();                                                  ///< how a deck cuts the box
std::string head(const Bed& bed, const std::string& cuts = grid());  ///< up to the box
std::string body(const Bed& bed);                                    ///< material, walls, gravity
std::string read_bed(const Bed& bed);                                ///< reads the settled bed (made once, see settled())
/// A deck up to the first run of a pour into an empty box.
std::string pouring(const Bed& bed, const std::string& cuts = grid());
/// 64 granules fall on the bed.
extern const char* const rain_of_64;
/// Lets them fall for 3,000 steps, and expects that none is lost, here and in the store of the fix `cull`. How many there are.
/// Collective.
std::size_t rain_on(Engine& e, const Bed& bed);
/// True once a process: beds are made once for all its tests.
bool first_asked_for(const std::string& file);
/// Runs the deck on one rank, so that a bed is the same whatever the grid, and writes its restart file. One that is there is
/// taken where SOLIDCULL_KEEP_BEDS is in the environment (grids.sh). Collective.
void make_bed(const std::string& file, const std::string& deck);
/// The bed's restart file, poured and settled. Collective.
std::string settled(const Bed& bed);

}  // namespace decks
