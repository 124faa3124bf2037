// neighbor_build.cpp against the engine's own build: the same pairs, in the same order, with the same histories, at any size
// ratio.
#include <dlfcn.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <sstream>

#include "atom.h"
#include "domain.h"
#include "engine.h"
#include "force.h"
#include "lammps.h"
#include "neigh_list.h"
#include "pair_gran.h"

namespace decks {
namespace {

constexpr double smallest = 0.0006, side = 0.03;  // m

/// A neighbour as a row of the list has it. An image has its owner's tag, so the place tells them apart.
struct Neighbour {
  int tag;
  Vec x;
  bool ghost, touched;
  double size_ratio;  // to the granule of the row, 1 or more
  std::vector<double> history;

  bool operator==(const Neighbour& o) const {
    return tag == o.tag && x == o.x && ghost == o.ghost && touched == o.touched && history == o.history;
  }
};
struct Row {
  int tag;
  Vec x;
  std::vector<Neighbour> neighbours;

  bool operator==(const Row& o) const { return tag == o.tag && x == o.x && neighbours == o.neighbours; }
};

/// The lists of this rank.
std::vector<Row> rows(Engine& e) {
  const LAMMPS_NS::Atom* atom = e.lammps()->atom;
  auto* pair = static_cast<LAMMPS_NS::PairGran*>(e.lammps()->force->pair);
  const LAMMPS_NS::NeighList* list = pair->list;
  const LAMMPS_NS::NeighList* histories = pair->listgranhistory;
  const auto place = [&](int i) { return Vec{atom->x[i][0], atom->x[i][1], atom->x[i][2]}; };
  std::vector<Row> all;
  for (int n = 0; n < list->inum; ++n) {
    const int i = list->ilist[n];
    Row row{atom->tag[i], place(i), {}};
    for (int k = 0; k < list->numneigh[i]; ++k) {
      const int j = list->firstneigh[i][k];
      const double ratio = atom->radius[i] / atom->radius[j];
      Neighbour found{atom->tag[j], place(j), j >= atom->nlocal, false, std::max(ratio, 1 / ratio), {}};
      if (histories) {
        const int width = pair->dnum();
        const double* const from = histories->firstdouble[i] + static_cast<std::ptrdiff_t>(width) * k;
        found.touched = histories->firstneigh[i][k] != 0;
        found.history.assign(from, from + width);
      }
      row.neighbours.push_back(found);
    }
    all.push_back(row);
  }
  return all;
}

struct Mix {
  std::string name;
  int octaves;  // radii of `smallest` times 1, 2, 4 ... 2^octaves
  bool periodic = false;
  std::string contact = "model hertz tangential history";

  friend void PrintTo(const Mix& mix, std::ostream* out) { *out << mix.name; }
};

/// Granules of each size fall on a floor and on each other.
std::string rain(const Mix& mix) {
  const int count[] = {1500, 200, 50, 8}, seed[] = {32452867, 49979687, 67867967, 86028121};  // of each size, the smallest first
  Bed bed;
  bed.periodic = mix.periodic;
  bed.side = side;
  bed.contact = mix.contact;
  bed.dt = 1.5e-5;
  const double rim = mix.periodic ? 0 : 0.002;
  std::ostringstream s;
  s << head(bed) << "region box block " << -rim << ' ' << side + rim << ' ' << -rim << ' ' << side + rim
    << " -0.002 0.09 units box\ncreate_box 2 box\nneighbor 0.0006 bin\nneigh_modify delay 0\n"
    << body(bed) << "region pour block 0 " << side << " 0 " << side << " 0.0001 0.045 units box\n";
  for (int k = mix.octaves; k >= 0; --k)  // the largest first, while there is room
    s << "fix t" << k << " all particletemplate/sphere 15485863 atom_type " << 1 + k % 2
      << " density constant 2500 radius constant " << smallest * (1 << k) << "\nfix d" << k
      << " all particledistribution/discrete 32452843 1 t" << k << " 1.0\nfix i" << k << " all insert/pack seed " << seed[k]
      << " distributiontemplate d" << k << " maxattempt 500 insert_every once overlapcheck yes all_in "
      << (mix.periodic ? "no" : "yes") << " vel constant 0.05 0.03 -1 region pour particles_in_region " << count[k] << "\n";
  s << "fix integr all nve/sphere\nthermo 100000\nthermo_modify norm no\n";
  return s.str();
}

/// Sizes that are there: LIGGGHTS inserts no granule that is wider than a rank's part of the box.
int octaves_inserted(const Mix& mix, Engine& e) {
  const LAMMPS_NS::Domain& box = *e.lammps()->domain;
  int octaves = mix.octaves;
  for (int d = 0; d < 3; ++d)
    while (2 * smallest * (1 << octaves) > box.subhi[d] - box.sublo[d]) --octaves;
  return octaves;
}

class Neighbours : public testing::TestWithParam<Mix> {};

TEST_P(Neighbours, AreThoseThatTheEngineFindsInItsOrder) {
  const Mix& mix = GetParam();
  Engine own, ours;
  own.run(rain(mix));
  ours.run(rain(mix) + "fix cull all solid/cull every 1000000\n");  // nothing is culled: the same granules in both
  enum { kPairs, kGhosts, kTouching, kOctaves, kDifferent, kCounts };
  std::array<int, kCounts> most{}, anywhere{}, everywhere{};
  std::string first;
  for (int part = 0; part < 4; ++part) {
    own.run("run 600\n");
    ours.run("run 600\n");
    EXPECT_EQ(ours.vector("cull", 2) + ours.vector("cull", 3), 0);
    const std::vector<Row> expected = rows(own), found = rows(ours);
    std::array<int, kCounts> now{};
    for (const Row& row : expected)
      for (const Neighbour& n : row.neighbours) {
        ++now[kPairs];
        now[kGhosts] += n.ghost;
        now[kTouching] += n.touched;
        now[kOctaves] = std::max(now[kOctaves], static_cast<int>(std::lround(std::log2(n.size_ratio))));
      }
    now[kDifferent] = expected.size() != found.size();
    for (std::size_t n = 0; n < std::min(expected.size(), found.size()); ++n) {
      if (expected[n] == found[n]) continue;
      if (!now[kDifferent]++) first = "row " + std::to_string(n) + " of granule " + std::to_string(expected[n].tag);
    }
    for (int k = 0; k < kCounts; ++k) most[k] = std::max(most[k], now[k]);
  }
  MPI_Allreduce(most.data(), anywhere.data(), kCounts, MPI_INT, MPI_MAX, MPI_COMM_WORLD);
  MPI_Allreduce(most.data(), everywhere.data(), kCounts, MPI_INT, MPI_SUM, MPI_COMM_WORLD);
  EXPECT_EQ(anywhere[kDifferent], 0) << first;
  // what was compared; of eight ranks one alone has few
  const auto& compared = own.ranks() > 4 ? everywhere : anywhere;
  EXPECT_GT(compared[kPairs], 1000);
  EXPECT_EQ(anywhere[kOctaves], octaves_inserted(mix, own));
  const bool histories = mix.contact.find("no_history") == std::string::npos, images = mix.periodic || own.ranks() > 1;
  EXPECT_GE(compared[kTouching], histories ? 100 : 0);
  EXPECT_GE(compared[kGhosts], images ? 50 : 0);
  EXPECT_EQ(largest_difference(own.state(), ours.state(), &Granule::x), 0.0);
  EXPECT_EQ(largest_difference(own.state(), ours.state(), &Granule::f), 0.0);
  if (own.rank() == 0)
    std::printf("%s: %d pairs, %d with ghosts, %d touching\n", mix.name.c_str(), compared[kPairs], compared[kGhosts],
                compared[kTouching]);
}

const char* no_history = "model hertz tangential no_history";
const char* rolling = "model hertz tangential history rolling_friction epsd2";

INSTANTIATE_TEST_SUITE_P(Mixes, Neighbours,
                         testing::Values(Mix{"one_size", 0}, Mix{"ratio_2", 1}, Mix{"ratio_4", 2}, Mix{"ratio_8", 3},
                                         Mix{"one_size_periodic", 0, true}, Mix{"ratio_2_periodic", 1, true},
                                         Mix{"ratio_4_periodic", 2, true}, Mix{"ratio_8_periodic", 3, true},
                                         Mix{"ratio_8_no_history", 3, false, no_history},
                                         Mix{"ratio_8_rolling_periodic", 3, true, rolling}),
                         [](const testing::TestParamInfo<Mix>& info) { return info.param.name; });

TEST(NeighbourBuild, IsTheOneThatTheEngineCalls) {
  Dl_info from = {};
  void* const build = dlsym(RTLD_DEFAULT, "_ZN9LAMMPS_NS8Neighbor22granular_bin_no_newtonEPNS_9NeighListE");
  ASSERT_NE(build, nullptr);
  ASSERT_NE(dladdr(build, &from), 0);
  EXPECT_NE(std::string(from.dli_fname).find("solidcull"), std::string::npos) << from.dli_fname;
}

}  // namespace
}  // namespace decks
