// PairForce against the force that the engine itself gives two granules, and against Hertz's formula.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "atom.h"
#include "engine.h"
#include "force.h"
#include "lammps.h"
#include "neigh_list.h"
#include "pair_force.h"
#include "pair_gran.h"

namespace decks {
namespace {

using solidcull::PairForce;
using solidcull::Vec3;

constexpr double radius = 0.0013, other_radius = 0.0017;  // m

constexpr double side = 0.04;  // m, of the box

/// Two granules whose centres are `apart` from each other, free of gravity. On several ranks, in a row along x, they are on both
/// sides of the first border: each is on a rank of its own.
std::string two(const Bed& bed, double apart, int ranks) {
  const auto x = [&](double sign) {
    char text[32];
    std::snprintf(text, sizeof text, "%.17g", side / std::max(ranks, 2) + sign * apart / 2);
    return std::string(text);
  };
  return head(bed, "* 1 1") +
         "region box block 0 0.04 0 0.04 0 0.04 units box\ncreate_box 2 box\nneighbor 0.0004 bin\nneigh_modify delay 0\n" +
         body(bed) + "unfix grav\ncreate_atoms 1 single " + x(-1) + " 0.02 0.02 units box\ncreate_atoms 2 single " + x(1) +
         " 0.02 0.02 units box\nset atom 1 diameter 0.0026\nset atom 2 diameter 0.0034\nset group all density 2500\n"
         "fix integr all nve/sphere\nthermo 100000\n";
}

/// What PairForce says of the force on granule 1.
struct Asked {
  Vec by_place, by_history;
  int rows = 0;        // in which the contact stands
  bool owned = false;  // by one rank, both granules: then it may be asked by history too
};

Asked ask(Engine& e) {
  const LAMMPS_NS::Atom* atom = e.lammps()->atom;
  auto* pair = static_cast<LAMMPS_NS::PairGran*>(e.lammps()->force->pair);
  PairForce law(e.lammps());
  double mine[8] = {};
  for (int n = 0; n < pair->list->inum; ++n) {
    const int i = pair->list->ilist[n];
    for (int k = 0; k < pair->list->numneigh[i]; ++k) {
      const int j = pair->list->firstneigh[i][k];
      const double sign = atom->tag[i] == 1 ? 1 : -1;  // the law of action and reaction
      const bool counts = atom->tag[i] == 1 || j < atom->nlocal;
      if (!counts) continue;  // the other rank has it too, as granule 1's
      mine[6] += 1;
      const Vec3 by_place = law.on_first(i, k);
      for (int d = 0; d < 3; ++d) mine[d] += sign * by_place[d];
      if (j >= atom->nlocal) continue;
      mine[7] += 1;
      const double* history = nullptr;
      if (pair->listgranhistory && pair->listgranhistory->firstneigh[i][k])
        history = pair->listgranhistory->firstdouble[i] + static_cast<std::ptrdiff_t>(pair->dnum()) * k;
      const Vec3 by_history = law.on_first(i, j, history);
      for (int d = 0; d < 3; ++d) mine[3 + d] += sign * by_history[d];
    }
  }
  double all[8];
  MPI_Allreduce(mine, all, 8, MPI_DOUBLE, MPI_SUM, MPI_COMM_WORLD);
  return {{all[0], all[1], all[2]}, {all[3], all[4], all[5]}, static_cast<int>(all[6]), all[7] > 0};
}

double size(const Vec& v) { return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

void expect_same(const Vec& a, const Vec& b, double scale, const std::string& what) {
  for (int d = 0; d < 3; ++d) EXPECT_NEAR(a[d], b[d], 1e-15 * scale) << what << ", component " << d;
}

class PairForces : public testing::TestWithParam<std::string> {};

TEST_P(PairForces, IsTheEnginesOwn) {
  Bed bed;
  bed.contact = GetParam();
  bed.cohesion = bed.contact.find("cohesion") != std::string::npos;
  Engine e;
  // it slides and turns while it is pressed: springs and dampers of every kind bear
  e.run(two(bed, radius + other_radius - 4e-5, e.ranks()) +
        "velocity all set 0 0 0\ngroup one id 1\ngroup other id 2\nvelocity one set 0.01 0.02 -0.03\nset atom 1 omegay 8\n"
        "set atom 2 omegaz -5\nrun 4\nrun 0\n");  // the last: forces of the state that is there now
  const State before = e.state();
  const Histories histories = e.histories();
  const Vec force = before.at(1).f;
  ASSERT_GT(size(force), 10 * before.at(1).mass * 9.81) << "they do not touch";
  EXPECT_GT(std::hypot(force[1], force[2]), 1e-3 * size(force)) << "nothing is tangential";

  const Asked asked = ask(e);
  EXPECT_EQ(asked.rows, 1);
  EXPECT_EQ(asked.owned, e.ranks() == 1);
  expect_same(asked.by_place, force, size(force), "by its place in the list");
  if (asked.owned) expect_same(asked.by_history, force, size(force), "by its history");

  // it only asked
  const State after = e.state();
  for (const auto what : {&Granule::x, &Granule::v, &Granule::omega, &Granule::f, &Granule::torque})
    EXPECT_EQ(largest_difference(before, after, what), 0.0);
  EXPECT_EQ(e.histories(), histories);
}

TEST_P(PairForces, LeavesTheRunAsItWouldBe) {
  Bed bed;
  bed.contact = GetParam();
  bed.cohesion = bed.contact.find("cohesion") != std::string::npos;
  Engine never, asked;
  for (Engine* e : {&never, &asked}) {
    e->run(two(bed, radius + other_radius - 4e-5, e->ranks()) + "group one id 1\nvelocity one set 0.02 0.05 -0.03\n");
    for (int k = 0; k < 8; ++k) {
      e->run("run 5\n");
      if (e == &asked) ask(*e);
    }
  }
  for (const auto what : {&Granule::x, &Granule::v, &Granule::omega, &Granule::f, &Granule::torque})
    EXPECT_EQ(largest_difference(never.state(), asked.state(), what), 0.0);
  EXPECT_EQ(never.histories(), asked.histories());
}

INSTANTIATE_TEST_SUITE_P(Models, PairForces,
                         testing::Values("model hertz tangential history", "model hertz tangential no_history",
                                         "model hooke tangential history", "model hooke tangential no_history",
                                         "model hertz tangential history rolling_friction epsd2",
                                         "model hertz tangential history rolling_friction cdt",
                                         "model hertz tangential history cohesion sjkr"),
                         [](const testing::TestParamInfo<std::string>& info) {
                           std::string name;
                           for (const char c : info.param) name += std::isalnum(static_cast<unsigned char>(c)) ? c : '_';
                           return name;
                         });

TEST(PairForce, OfTwoAtRestIsHertzs) {
  const double overlap = 3e-5, stiffness = 5e6 / (2 * (1 - 0.3 * 0.3));  // N/m2: both have the same
  const double reduced = radius * other_radius / (radius + other_radius);
  Bed bed;
  bed.contact = "model hertz tangential history";
  Engine e;
  e.run(two(bed, radius + other_radius - overlap, e.ranks()) + "run 0\n");
  const double expected = 4.0 / 3 * stiffness * std::sqrt(reduced) * std::pow(overlap, 1.5);
  const Asked asked = ask(e);
  EXPECT_NEAR(asked.by_place[0], -expected, 1e-11 * expected);  // the overlap is a difference of places 700 times as large
  EXPECT_EQ(asked.by_place[1], 0);
  EXPECT_EQ(asked.by_place[2], 0);
  EXPECT_NEAR(asked.by_history[0], asked.owned ? -expected : 0, 1e-11 * expected);
}

TEST(PairForce, OfTwoThatDoNotTouchIsNone) {
  Engine e;
  e.run(two(Bed(), radius + other_radius + 1e-5, e.ranks()) + "run 0\n");
  const Asked asked = ask(e);
  ASSERT_EQ(asked.rows, 1) << "they are neighbours";
  EXPECT_EQ(size(asked.by_place), 0);
  EXPECT_EQ(size(asked.by_history), 0);
}

TEST(PairForce, FollowsTheHistoryThatItIsGiven) {
  // the spring in the plane of contact is where a history goes in: three times as long, three times the force
  Bed bed;
  bed.contact = "model hertz tangential history";
  Engine e;
  e.run(two(bed, radius + other_radius - 4e-5, e.ranks()) + "displace_atoms all move " +
        std::to_string(0.5 * side / std::max(e.ranks(), 2)) + " 0 0 units box\nrun 0\n");  // one rank has both
  auto* pair = static_cast<LAMMPS_NS::PairGran*>(e.lammps()->force->pair);
  ASSERT_EQ(pair->dnum(), 3);
  PairForce law(e.lammps());
  int mine = 0, all = 0;
  for (int n = 0; n < pair->list->inum; ++n) {
    const int i = pair->list->ilist[n];
    for (int k = 0; k < pair->list->numneigh[i]; ++k) {
      const int j = pair->list->firstneigh[i][k];
      const double none[] = {0, 0, 0}, one[] = {0, 1e-7, 0}, three[] = {0, 3e-7, 0}, across[] = {0, 0, 1e-7};
      const Vec3 at_rest = law.on_first(i, j, nullptr);
      EXPECT_EQ(law.on_first(i, j, none), at_rest);
      const double spring = law.on_first(i, j, one)[1];
      EXPECT_GT(std::abs(spring), 1e-3 * at_rest.norm());
      EXPECT_NEAR(law.on_first(i, j, three)[1], 3 * spring, 1e-12 * std::abs(spring));
      EXPECT_NEAR(law.on_first(i, j, across)[2], spring, 1e-12 * std::abs(spring));
      EXPECT_EQ(law.on_first(i, j, one)[0], at_rest[0]);
      ++mine;
    }
  }
  MPI_Allreduce(&mine, &all, 1, MPI_INT, MPI_SUM, MPI_COMM_WORLD);
  EXPECT_EQ(all, 1);
}

}  // namespace
}  // namespace decks
