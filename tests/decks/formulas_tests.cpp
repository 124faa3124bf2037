// Invariant I9 for numbers of contacts and forces: between runs a formula of the deck has them of all granules, as in the
// unculled deck, and the next run culls again at once.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "atom.h"
#include "engine.h"
#include "lammps.h"

namespace decks {
namespace {

struct Formulas {
  std::string name;
  std::string computes;                // before the runs, with what thermo prints
  std::string commands;                // between the runs, before the variables are asked for
  std::vector<std::string> variables;  // formulas
  friend void PrintTo(const Formulas& f, std::ostream* out) { *out << f.name; }
};

class FormulasBetweenRuns : public testing::TestWithParam<Formulas> {};

constexpr const char* fix_line = "fix cull all solid/cull exterior sleep every 50 calm 2 speed 0.05 tolerance 12 0\n";

Bed bed() {
  Bed b;
  b.name = "formulas";
  b.contact = "model hertz tangential history";
  b.mesh_walls = true;
  return b;
}

constexpr double contact_force = 3e-3;  // N, of what lies at the bottom; forces and torques are small differences of many

constexpr const char* unfix = "unfix cull\n";

double value(Engine& e, const std::string& formula) {
  e.run("variable asked equal \"" + formula + "\"\n");
  return e.variable("asked");
}

TEST_P(FormulasBetweenRuns, AreOfTheWholeBed) {
  const Formulas& p = GetParam();
  Engine never, culled;
  for (Engine* e : {&never, &culled}) {
    e->run(read_bed(bed()) + (e == &culled ? fix_line : "") + p.computes + "run 100\nrun 0\n");
    if (e == &culled) {
      ASSERT_GT(e->vector("cull", 3), 300);
    }
    if (p.commands != unfix || e == &culled) e->run(p.commands);
  }
  for (const std::string& v : p.variables) {
    const double there = value(never, v), here = value(culled, v);
    EXPECT_NE(there, 0) << v;
    EXPECT_NEAR(here, there, 1e-12 * std::max(std::abs(there), v.find("c_") == 0 || v.find("f_") == 0 ? 0 : contact_force)) << v;
  }
  if (p.commands == unfix) return;
  // what was asked has changed nothing
  const std::size_t granules = never.state().size();
  never.run("run 0\n");
  culled.run("run 0\n");
  if (p.commands.empty()) {
    EXPECT_GT(culled.vector("cull", 3), 300);
  }
  expect_all_there(culled, "cull", granules);
  culled.run("unfix cull\n");
  never.run("run 20\n");
  culled.run("run 20\n");
  const State a = never.state();
  State b = culled.state();
  // LIGGGHTS loses what a command has moved farther than to the next rank; the fix does not
  for (auto g = b.begin(); never.ranks() > 4 && a.size() < granules && g != b.end();)
    g = a.count(g->first) ? std::next(g) : b.erase(g);
  EXPECT_LE(largest_difference(a, b, &Granule::x), 1e-9 * 0.0026);
  EXPECT_LE(largest_difference(a, b, &Granule::v), 1e-9);
  EXPECT_EQ(never.histories().size(), culled.histories().size());
}

const std::string stress =
    "compute st all stress/atom virial\ncompute sum all reduce sum c_st[1] c_st[2] c_st[3] c_st[4]\n"
    "compute each all reduce max c_st[3]\nthermo_style custom step atoms c_sum[1] c_sum[2] c_sum[3] c_sum[4] c_each\n"
    "thermo_modify norm no\n";
const std::vector<std::string> stresses = {"c_sum[1]", "c_sum[2]", "c_sum[3]", "c_sum[4]", "c_each", "c_st[600][3]"};
const std::string per_granule =
    "compute ca all contact/atom\ncompute cg all contact/atom/gran\ncompute co all coord/atom 0.0028\n"
    "compute ce all centro/atom 4\ncompute sum all reduce sum c_ca c_cg c_co c_ce\n"
    "thermo_style custom step atoms c_sum[1] c_sum[2] c_sum[3] c_sum[4]\nthermo_modify norm no\n";
const std::string per_contact =
    "compute pl all pair/gran/local id force force_normal force_tangential contactArea delta\n"
    "compute sum all reduce sum c_pl[6] c_pl[9] c_pl[13] c_pl[14]\ncompute most all reduce max c_pl[14]\n"
    "compute wl all wall/gran/local id force contactArea\ncompute wsum all reduce sum c_wl[4] c_wl[6] c_wl[7]\n"
    "thermo_style custom step atoms c_sum[1] c_sum[2] c_sum[3] c_sum[4] c_most c_wsum[1] c_wsum[2] c_wsum[3]\n"
    "thermo_modify norm no\n";
// which of the two is the first, and with it the sign of a force, is the engine's choice
const std::vector<std::string> contacts = {"c_sum[3]", "c_sum[4]", "c_most", "c_wsum[2]", "c_wsum[3]"};

INSTANTIATE_TEST_SUITE_P(
    Numbers, FormulasBetweenRuns,
    testing::Values(Formulas{"stress", stress, "", stresses},
                    Formulas{"of_each_granule", per_granule, "", {"c_sum[1]", "c_sum[2]", "c_sum[3]", "c_sum[4]", "c_ca[600]"}},
                    Formulas{"of_each_contact", per_contact, "", contacts},
                    Formulas{"forces", "", "", {"fcm(all,z)", "fz[600]", "fx[20]", "torque(all,x)", "tqx[20]"}},
                    Formulas{"after_the_bed_was_shown", stress,
                             "group few id < 400\nvariable n equal count(few)\nprint \"${n}\"\n", stresses},
                    Formulas{"as_of_the_last_step",
                             stress,
                             "set atom 600 z 0.05\ngroup few id 100 200\nvelocity few set 0 0 0.1\n",
                             {"c_sum[1]", "c_sum[3]"}},
                    Formulas{"before_granules_go",
                             stress,
                             "group few id 100 200\ndelete_atoms group few compress no\n",
                             {"c_sum[1]", "c_sum[3]"}},
                    Formulas{"restored_by_a_command", stress, "change_box all boundary m m m\n", {"c_sum[1]", "c_sum[3]"}},
                    Formulas{"restored_by_unfix", stress, unfix, stresses},
                    Formulas{"restored_by_unfix_of_contacts", per_contact, unfix, contacts}),
    [](const auto& p) { return p.param.name; });

TEST(AMeshLoadInAFormula, LeavesTheBedAsleep) {
  Engine e;
  e.run(read_bed(bed()) + fix_line + "run 100\nrun 0\n");
  const double atoms = static_cast<double>(e.lammps()->atom->natoms);
  ASSERT_GT(e.vector("cull", 3), 300);
  EXPECT_EQ(value(e, "f_floor[3]"), e.vector("floor", 3));
  value(e, "f_cull[3]+step*dt");
  EXPECT_EQ(e.lammps()->atom->natoms, atoms);
  value(e, "ke(all)");
  EXPECT_GT(e.lammps()->atom->natoms, atoms + 300);
}

TEST(OtherContacts, MayComeBetweenRunsWhileGranulesAreCulled) {
  // filled without tangential history, tested with it
  const std::string without = "model hertz tangential no_history", with = "model hertz tangential history";
  Bed b = bed();
  b.name = "formulas_plain";
  b.contact = without;
  b.mesh_walls = false;
  std::string walls = "pair_style gran " + with + "\npair_coeff * *\n";
  for (const char* w : {"x1", "x2", "y1", "y2", "z1"}) {
    const std::string at = w[1] == '1' ? "0" : "0.026";
    walls +=
        std::string("unfix ") + w + "\nfix " + w + " all wall/gran " + with + " primitive type 1 " + w[0] + "plane " + at + "\n";
  }
  Engine never, culled;
  for (Engine* e : {&never, &culled}) {
    e->run(read_bed(b) + (e == &culled ? fix_line : "") + "run 100\nrun 0\n");
    if (e == &culled) {
      ASSERT_GT(e->vector("cull", 3), 300);
    }
    e->run(walls + "run 50\n");
  }
  EXPECT_LE(largest_difference(never.state(), culled.state(), &Granule::x), 1e-9 * 0.0026);
  culled.run("run 400\n");
  EXPECT_GT(culled.vector("cull", 3), 100) << "it culls again";
  expect_all_there(culled, "cull", never.state().size());
}

}  // namespace
}  // namespace decks
