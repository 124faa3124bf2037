// Boxes that follow the granules (boundary m and s): the same results as in a box that stands still, where nothing leaves it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "domain.h"
#include "engine.h"
#include "lammps.h"

namespace decks {
namespace {

struct Sides {
  std::string name, boundary, exterior;
  friend void PrintTo(const Sides& s, std::ostream* out) { *out << s.name; }
};

class Boundaries : public testing::TestWithParam<Sides> {};

double f(Engine& e, int n) { return e.vector("cull", n); }

/// A granule falls on a bed at rest, most of which is culled before it arrives; none is where `exterior` is empty. Number 1301 is
/// the one that falls.
void strike(Engine& e, const std::string& boundary, const std::string& exterior) {
  Bed bed;
  bed.name = "sides";
  e.run(read_bed(bed) +
        "run 0\nset group all omegax 0 omegay 0 omegaz 0\ncreate_atoms 1 single 0.013 0.013 0.06\ngroup ball id > 1300\n"
        "set group ball diameter 0.0026\nset group ball density 2500\nchange_box all boundary " +
        boundary + "\nrun 0\n" +
        (exterior.empty() ? "" : "fix cull all solid/cull exterior " + exterior + " every 50 calm 2 depth 1.5\n") + "run 1500\n");
}

/// How far granules may stand apart in the two boxes (m). Their borders between ranks lie elsewhere, by which LIGGGHTS itself
/// differs: on two ranks by up to 2.3e-6 m, on more as the grid is.
double largest_apart(int ranks, const std::string& boundary) {
  if (ranks <= 2) return ranks == 1 ? 1e-8 : 5e-6;
  Engine still, follows;
  strike(still, "f f f", "");
  strike(follows, boundary, "");
  const double stock = largest_difference(still.state(), follows.state(), &Granule::x);
  if (still.rank() == 0) std::printf("stock's granules are %.2g m apart\n", stock);
  return std::max(5e-6, 2 * stock);
}

TEST_P(Boundaries, HoldWhatIsStoredAndChangeNoResult) {
  Engine still, follows;
  strike(still, "f f f", GetParam().exterior);
  strike(follows, GetParam().boundary, GetParam().exterior);
  EXPECT_GT(f(follows, 3), 300) << "interior";
  EXPECT_NEAR(f(follows, 3), f(still, 3), 0.02 * f(still, 3));
  expect_all_there(follows, "cull", 1301);

  // the box holds all granules, stored ones too
  LAMMPS_NS::Domain* const box = follows.lammps()->domain;
  const double top = box->boxhi[2];
  follows.run("unfix cull\n");
  still.run("unfix cull\n");
  const State here = follows.state(), there = still.state();
  expect_same_granules(there, here);
  for (const auto& g : here)
    for (int d = 0; d < 3; ++d) {
      ASSERT_GE(g.second.x[d], box->boxlo[d]) << g.first;
      ASSERT_LE(g.second.x[d], box->boxhi[d]) << g.first;
    }
  EXPECT_LT(std::abs(here.at(1301).x[2] - there.at(1301).x[2]), 1e-9) << "the one that falls";
  EXPECT_LT(largest_difference(here, there, &Granule::x), largest_apart(still.ranks(), GetParam().boundary));

  // it strikes
  const double before = here.at(1301).x[2];
  for (Engine* e : {&still, &follows})
    e->run("fix cull all solid/cull exterior " + GetParam().exterior + " every 50 calm 2 depth 1.5\nrun 2500\n");
  expect_all_there(follows, "cull", 1301);
  EXPECT_GT(f(follows, 3), 100);
  EXPECT_LT(box->boxhi[2], top + 1e-9);
  for (Engine* e : {&still, &follows}) e->run("unfix cull\nrun 0\n");
  const State a = still.state(), b = follows.state();
  expect_same_granules(a, b);
  EXPECT_LT(b.at(1301).x[2], before - 0.015) << "it has fallen";
  // where it comes to rest is a matter of chance, below a diameter; the bed is as it was
  EXPECT_LT(std::abs(a.at(1301).x[2] - b.at(1301).x[2]), 0.0026);
  double moved = 0;
  for (const auto& g : b)
    if (g.first <= 1300) moved += std::abs(g.second.x[2] - a.at(g.first).x[2]) / 1300;
  EXPECT_LT(moved, 1e-5);
  if (still.rank() == 0)
    std::printf("%s: box up to %.4g m, then %.4g m; the bed's granules stand %.2g m apart in the mean\n", GetParam().name.c_str(),
                top, box->boxhi[2], moved);
}

INSTANTIATE_TEST_SUITE_P(Sides, Boundaries,
                         testing::Values(Sides{"m", "m m m", "live"}, Sides{"m_sleep", "m m m", "sleep"},
                                         Sides{"s_sleep", "s s s", "sleep"}, Sides{"above_only_sleep", "f s fm", "sleep"}),
                         [](const auto& p) { return p.param.name; });

}  // namespace
}  // namespace decks
