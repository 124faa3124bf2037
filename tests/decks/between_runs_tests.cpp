// Invariant I9: between runs the deck sees the whole bed, and what it does to culled granules is done, as in the unculled deck.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>
#include <vector>

#include "atom.h"
#include "engine.h"
#include "lammps.h"
#include "neighbor.h"

namespace decks {
namespace {

struct Sequence {
  std::string name, commands;
  std::vector<std::string> groups, variables;  // compared after the commands
  enum class Left { same_tags, other_tags } left = Left::same_tags;
  enum class Then { culled, exterior, either } then = Then::culled;  // when the next run is set up

  friend void PrintTo(const Sequence& s, std::ostream* out) { *out << s.name; }
};

State those_of(const State& all, const State& these) {
  State found;
  for (const auto& [tag, granule] : all)
    if (these.count(tag)) found.emplace(tag, granule);
  return found;
}

/// Those of `these` that touch one of `all` that is not among these.
std::vector<int> beside_the_lost(const State& all, const State& these) {
  std::vector<int> beside;
  for (const auto& [tag, lost] : all)
    for (const auto& [other, g] : these)
      if (!these.count(tag) && std::hypot(g.x[0] - lost.x[0], g.x[1] - lost.x[1], g.x[2] - lost.x[2]) < g.radius + lost.radius)
        beside.push_back(other);
  return beside;
}

class BetweenRuns : public testing::TestWithParam<Sequence> {};

constexpr double diameter = 0.0026;

Bed bed() {
  Bed b;
  b.name = "between";
  b.contact = "model hertz tangential history";
  b.mesh_walls = true;
  return b;
}

const char* fix_line = "fix cull all solid/cull exterior sleep every 50 calm 2 speed 0.05 tolerance 12 0\n";
// the last look chooses, the next run's setup culls: nothing has moved since
const char* looks = "run 100\nrun 0\n";

double interior(Engine& e) { return e.vector("cull", 3); }

void expect_same_groups(Engine& a, Engine& b, const std::vector<std::string>& groups) {
  const State sa = a.state(), sb = b.state();
  for (const std::string& g : groups) {
    const int in_a = a.group_bit(g), in_b = b.group_bit(g);
    std::size_t members = 0;
    for (const auto& [tag, granule] : sa) {
      members += (granule.mask & in_a) != 0;
      ASSERT_EQ((granule.mask & in_a) != 0, (sb.at(tag).mask & in_b) != 0) << "granule " << tag << " in group " << g;
    }
    EXPECT_GT(members, 0u) << g;
  }
}

TEST_P(BetweenRuns, ActOnAllGranules) {
  const Sequence& sequence = GetParam();
  Engine never, culled;
  // on several ranks LIGGGHTS itself loses histories: create_atoms overwrites ghosts by whose tags they are kept, and what
  // displace_atoms or a second delete_atoms sends to another rank is not up to date. What unfix leaves is.
  const bool stock_is_right = never.ranks() == 1;
  never.run(read_bed(bed()) + (stock_is_right ? "" : fix_line) + looks + (stock_is_right ? "" : "unfix cull\n"));
  culled.run(read_bed(bed()) + fix_line + looks);
  const double before = interior(culled);
  ASSERT_GT(before, 300);

  never.run(sequence.commands);
  culled.run(sequence.commands);
  for (const std::string& v : sequence.variables) {
    const double there = never.variable(v), here = culled.variable(v);
    EXPECT_NEAR(here, there, 1e-12 * std::abs(there)) << v;
  }
  culled.run("group everyone union all\n");
  never.run("group everyone union all\n");
  const State a = never.state(), b = culled.state();
  ASSERT_EQ(b.size(), a.size());
  if (sequence.left == Sequence::Left::same_tags) {
    expect_same_granules(a, b);
    EXPECT_EQ(largest_difference(a, b, &Granule::x), 0.0);
    EXPECT_EQ(largest_difference(a, b, &Granule::v), 0.0);
    EXPECT_EQ(largest_difference(a, b, &Granule::omega), 0.0);
    std::vector<std::string> groups = sequence.groups;
    groups.emplace_back("everyone");
    expect_same_groups(never, culled, groups);
  }

  // what was not touched is culled at once
  never.run("run 0\n");
  culled.run("run 0\n");
  if (sequence.then == Sequence::Then::culled)
    EXPECT_GT(interior(culled), 100);
  else if (sequence.then == Sequence::Then::exterior)
    EXPECT_EQ(interior(culled), 0);
  expect_all_there(culled, "cull", a.size());
  const double after = interior(culled);
  never.run("run 0\n");
  culled.run("unfix cull\nrun 0\n");
  State fa = never.state();
  State fb = culled.state();
  // LIGGGHTS loses what a command has moved farther than to the next rank; the fix does not. The others are compared, but for
  // those that would touch it
  const bool some_lost = never.ranks() > 4 && fa.size() < a.size();
  const std::vector<int> beside = some_lost ? beside_the_lost(fb, fa) : std::vector<int>();
  if (some_lost) {
    ASSERT_EQ(fb.size(), a.size());
    for (const int tag : beside) fa.erase(tag);
    fb = those_of(fb, fa);
  }
  ASSERT_EQ(fb.size(), fa.size());
  if (sequence.left == Sequence::Left::same_tags) {
    const double contact_force = 13 * fa.begin()->second.mass * 9.81;
    EXPECT_EQ(largest_difference(fa, fb, &Granule::x), 0.0);
    EXPECT_EQ(largest_difference(fa, fb, &Granule::v), 0.0);
    EXPECT_LE(largest_difference(fa, fb, &Granule::f), 1e-12 * std::max(contact_force, largest(fa, &Granule::f)));
    EXPECT_LE(largest_difference(fa, fb, &Granule::torque),
              1e-12 * std::max(contact_force * diameter / 2, largest(fa, &Granule::torque)));
    if (beside.empty()) {
      EXPECT_EQ(never.histories().size(), culled.histories().size());
    }
  }
  // and goes on
  never.run("run 20\n");
  culled.run("run 20\n");
  const State ga = never.state();
  State gb = culled.state();
  if (some_lost) gb = those_of(gb, ga);
  EXPECT_EQ(gb.size(), ga.size());
  if (sequence.left == Sequence::Left::same_tags && ga.size() == gb.size() && beside.empty())
    EXPECT_LE(largest_difference(ga, gb, &Granule::x), 1e-9 * diameter);
  if (never.rank() == 0) std::printf("%s: %g interior before, %g after\n", sequence.name.c_str(), before, after);
}

/// The deck as it was before the fix's lines were put in.
std::string without_the_fix(const std::string& commands) {
  std::istringstream lines(commands);
  std::string rest;
  for (std::string line; std::getline(lines, line);)
    if (line.find("cull") == std::string::npos) rest += line + "\n";
  return rest;
}

/// What goes on after commands, without a set-up of the run or with commands within it.
class GoingOn : public testing::TestWithParam<Sequence> {};

TEST_P(GoingOn, IsAsWithoutTheFix) {
  const Sequence& sequence = GetParam();
  Engine never, culled;
  never.run(read_bed(bed()) + looks);
  culled.run(read_bed(bed()) + fix_line + looks);
  ASSERT_GT(interior(culled), 300);
  never.run(without_the_fix(sequence.commands));
  culled.run(sequence.commands);
  for (const std::string& v : sequence.variables) {
    const double there = never.variable(v), here = culled.variable(v);
    EXPECT_NEAR(here, there, 1e-4 * std::abs(there)) << v;
  }
  culled.run("unfix cull\nrun 0\n");
  never.run("run 0\n");
  const State a = never.state(), b = culled.state();
  expect_same_granules(a, b);
  ASSERT_EQ(a.size(), b.size());
  // what was struck has come a twentieth of a diameter far
  EXPECT_LE(largest_difference(a, b, &Granule::x), 2e-3 * diameter);
}

TEST(ShortRuns, FetchNothingFromWallsThatAreAsTheyWere) {
  Engine e;
  e.run(read_bed(bed()) + "fix cull all solid/cull exterior sleep every 20 calm 2 speed 0.05 tolerance 12 0\nrun 400\n");
  for (int k = 0; k < 8; ++k) e.run("run 0\n");  // what nothing is near any more goes in now and then
  const double stored = interior(e), restored = e.vector("cull", 7);
  ASSERT_GT(stored, 1000);
  int builds = 0;
  for (int k = 0; k < 10; ++k) {
    e.run("run 0\n");
    EXPECT_EQ(interior(e), stored) << "run " << k;
    e.run("run 20\n");
    builds += e.lammps()->neighbor->ncalls;
  }
  EXPECT_EQ(builds, 0);
  EXPECT_EQ(e.vector("cull", 7), restored);
  // a wall that is taken away between runs, or made anew, finds what stands at it
  e.run("unfix x2\nfix x2 all wall/gran model hertz tangential history primitive type 1 xplane 0.026\nrun 0\n");
  EXPECT_LT(interior(e), stored - 20);
  e.run("run 200\n");
  EXPECT_GT(interior(e), 0.9 * stored);
  e.run("unfix x2\nrun 200\n");
  EXPECT_GT(e.vector("cull", 7), restored + 50) << "what leant on it wakes";
}

TEST(CommandsOnAGroup, LeaveTheBedWhereNothingCulledIsInIt) {
  Engine e;
  e.run(read_bed(bed()) + fix_line + looks);
  e.run("create_atoms 1 single 0.013 0.013 0.05 units box\ngroup new id > 1300\nset group new diameter 0.0026 density 2500\n");
  e.run("group some id < 400\nrun 20\n");
  const double stored = interior(e), atoms = static_cast<double>(e.lammps()->atom->natoms);
  ASSERT_GT(stored, 300);
  e.run("set group new density 3000\nvelocity new set 0 0 -0.1\n");
  EXPECT_EQ(e.lammps()->atom->natoms, atoms);
  const State state = e.state();
  const Granule& newest = state.rbegin()->second;
  EXPECT_GT(state.rbegin()->first, 1300);
  EXPECT_EQ(newest.v[2], -0.1);
  EXPECT_NEAR(newest.mass, 3000 * 3.14159265358979 / 6 * std::pow(diameter, 3), 1e-12 * newest.mass);
  e.run("set group some density 2500\n");
  EXPECT_EQ(e.lammps()->atom->natoms, atoms + stored) << "a group that was made while its granules were culled";
  e.run("run 20\n");
  EXPECT_GT(interior(e), 0.9 * stored);
  EXPECT_EQ(e.lammps()->atom->natoms, atoms + stored - interior(e));
  e.run("variable up atom z*count(all)\nset group new vx v_up\n");  // a formula may count them
  EXPECT_EQ(e.lammps()->atom->natoms, atoms + stored);
}

TEST(TheInterfaceMesh, IsBetweenRunsAsTheLastRunLeftIt) {
  Engine whole, dug;
  for (Engine* e : {&whole, &dug}) e->run(read_bed(bed()) + fix_line + looks);
  const std::string ask = "region solid interface/mesh cull\ngroup inside region solid\n";
  whole.run(ask);
  dug.run("group few id < 700\ndelete_atoms group few compress no\n" + ask);
  const State a = whole.state(), b = dug.state();
  const int in_a = whole.group_bit("inside"), in_b = dug.group_bit("inside");
  int both = 0, deleted = 0;
  for (const auto& [tag, granule] : a) {
    const bool inside = (granule.mask & in_a) != 0;
    const auto left = b.find(tag);
    if (left == b.end()) {
      deleted += inside;
      continue;
    }
    both += inside;
    EXPECT_EQ((left->second.mask & in_b) != 0, inside) << "granule " << tag;
  }
  EXPECT_GT(both, 100);
  EXPECT_GT(deleted, 100);
  dug.run("run 20\nunfix cull\n");
}

TEST(WhatALookChose, IsNotCulledWhereTheDeckHasChangedGranulesSince) {
  Engine left_alone, never, culled;
  left_alone.run(read_bed(bed()) + fix_line + "run 100\nrun 0\n");
  for (Engine* e : {&never, &culled}) e->run(read_bed(bed()) + (e == &never ? "" : fix_line) + "run 100\n");
  ASSERT_EQ(interior(culled), 0);
  ASSERT_GT(interior(left_alone), 300) << "the last look chose nothing";
  for (Engine* e : {&never, &culled}) e->run("set group all diameter 0.0022\nrun 5\n");
  EXPECT_EQ(culled.vector("cull", 2) + interior(culled), 0) << "they have no contacts any more";
  for (Engine* e : {&never, &culled}) e->run("run 100\n");
  culled.run("unfix cull\nrun 0\n");
  EXPECT_LE(largest_difference(never.state(), culled.state(), &Granule::x), 1e-9 * diameter);
}

const std::string left_half = "region left block INF 0.013 INF INF INF INF units box\n";
const std::string inner = "region inner block 0.008 0.018 0.008 0.018 0.004 0.012 units box\n";
const std::string counts =
    "variable n equal count(all)\nvariable m equal mass(all)\nvariable z equal xcm(all,z)\n"
    "variable top equal bound(all,zmax)\nvariable low equal bound(all,zmin)\n";
const std::vector<std::string> counted = {"n", "m", "z", "top", "low"};
constexpr auto other_tags = Sequence::Left::other_tags;
constexpr auto all_exterior = Sequence::Then::exterior;

INSTANTIATE_TEST_SUITE_P(
    Sequences, BetweenRuns,
    testing::Values(
        Sequence{"group_by_region", left_half + "group left region left\n", {"left"}, {}},
        Sequence{"group_by_type_and_id", "group some id < 400\ngroup kind type 1\n", {"some", "kind"}, {}},
        Sequence{"group_algebra",
                 left_half + "group left region left\ngroup right subtract all left\ngroup both union left right\n"
                             "group none intersect left right\n",
                 {"left", "right", "both"},
                 {}},
        Sequence{"group_and_delete_it", left_half + "group a region left\ngroup a delete\ngroup b id < 30\n", {"b"}, {}},
        Sequence{"group_sums",
                 left_half + "group left region left\nvariable n equal count(left)\nvariable m equal mass(left)\n",
                 {"left"},
                 {"n", "m"}},
        Sequence{"variables", counts, {}, counted},
        Sequence{
            "region_variables", inner + "variable n equal count(all,inner)\nvariable m equal mass(all,inner)\n", {}, {"n", "m"}},
        Sequence{"one_granule_by_number", "variable h equal z[500]\nvariable d equal x[20]-x[10]\n", {}, {"h", "d"}},
        Sequence{"print", "print \"there are $(count(all)) granules\"\nvariable n equal count(all)\n", {}, {"n"}},
        Sequence{"print_in_if",
                 "variable n equal count(all)\nif \"${n} > 1000\" then \"set type 1 type 1\" \"print '${n}'\"\n",
                 {},
                 {"n"}},
        Sequence{"set_the_type_they_have", "set type 1 type 1\n", {}, {}},
        Sequence{"set_type_of_all", "set group all type 1\n", {}, {}, Sequence::Left::same_tags, all_exterior},
        Sequence{"set_size_of_few", "set atom 600 diameter 0.00255\nset atom 601 diameter 0.001\n", {}, {}},
        Sequence{"set_density", "group few id 100 200\nset group few density 2600\n", {"few"}, {}},
        Sequence{"set_place", "set atom 600 z 0.05\nset atom 601 x 0.012 y 0.012 z 0.06\n", {}, {}},
        Sequence{"set_velocity", "set atom 600 vx 0.1 vz 0.2\n", {}, {}},
        Sequence{"velocity_of_few", "group few id 100 200 300\nvelocity few set 0.1 0 0.2\n", {"few"}, {}},
        Sequence{"velocity_of_all", "velocity all set 0 0 0.1\n", {}, {}, Sequence::Left::same_tags, all_exterior},
        Sequence{"velocity_ramp", "group few id < 20\nvelocity few ramp vx 0 0.1 z 0 0.02 units box\n", {"few"}, {}},
        Sequence{"displace_few", "group few id 100 200 300\ndisplace_atoms few move 0 0 0.04 units box\n", {"few"}, {}},
        Sequence{
            "displace_across", "group few id 100 200 300 400\ndisplace_atoms few move 0.003 0.002 0.03 units box\n", {"few"}, {}},
        Sequence{"displace_all", "displace_atoms all move 0 0 0.02 units box\n", {}, {}, Sequence::Left::same_tags, all_exterior},
        Sequence{"delete_by_region", inner + "delete_atoms region inner compress no\n" + counts, {}, counted},
        Sequence{"delete_by_group", "group few id 100 200 300\ndelete_atoms group few compress no\n" + counts, {}, counted},
        Sequence{"delete_twice",
                 "group few id 100 200 300\ndelete_atoms group few compress no\ngroup more id 101 201\n"
                 "delete_atoms group more compress no\n" +
                     counts,
                 {},
                 counted},
        Sequence{"delete_and_renumber", inner + "delete_atoms region inner\n" + counts, {}, counted, other_tags, all_exterior},
        Sequence{"delete_many",
                 "group many id > 1000\ndelete_atoms group many compress no\n",
                 {},
                 {},
                 Sequence::Left::same_tags,
                 Sequence::Then::either},
        Sequence{"create_one",
                 "create_atoms 1 single 0.013 0.013 0.05 units box\ngroup new id > 1300\n"
                 "set group new diameter 0.0026 density 2500\n",
                 {"new"},
                 {}},
        Sequence{"create_into_the_bed",
                 "set atom 700 z 0.05\ncreate_atoms 1 single 0.013 0.013 0.05 units box\ngroup new id > 1300\n"
                 "set group new diameter 0.001 density 2500\nset group new z 0.01\n",
                 {"new"},
                 {}},
        Sequence{"write_data", "write_data between.data\n" + counts, {}, counted},
        Sequence{"write_dump", "write_dump all custom between.dump id x y z\n" + counts, {}, counted},
        Sequence{"write_restart",
                 left_half + "group left region left\nwrite_restart between.restart\nset atom 600 vz 0.2\n",
                 {"left"},
                 {}},
        Sequence{"change_box", "change_box all boundary m m m\n", {}, {}, Sequence::Left::same_tags, all_exterior},
        Sequence{"reset_timestep", "reset_timestep 0\nset atom 600 vz 0.2\n", {}, {}},
        Sequence{"several_at_once",
                 left_half + "group left region left\nset atom 600 vz 0.2\ndisplace_atoms left move 0 0 0\n"
                             "group few id 1 2 3\ndelete_atoms group few compress no\nvelocity few set NULL NULL 0.01\n",
                 {"left"},
                 {}}),
    [](const auto& p) { return p.param.name; });

INSTANTIATE_TEST_SUITE_P(
    Runs, GoingOn,
    testing::Values(
        Sequence{"pre_no", "run 20 pre no\n", {}, {}},
        Sequence{"set_then_pre_no", "set atom 600 vz 0.2\nrun 20 pre no\n" + counts, {}, counted},
        Sequence{"group_then_pre_no_twice",
                 "group few id 600 601\nrun 10 pre no post no\nvelocity few set 0 0 0.1\nrun 10 pre no\n",
                 {},
                 {}},
        Sequence{"every", "run 20 every 5 \"set atom 600 vz 0.05\" \"variable n equal count(all)\"\n", {}, {"n"}},
        Sequence{"every_pre_no", "run 20 pre no every 5 \"velocity all set NULL NULL 0\"\n", {}, {}},
        Sequence{"every_null", "run 20 every 5 NULL\n", {}, {}},
        Sequence{"delete_between_many_runs",
                 "group few id 100 200\nrun 5\ndelete_atoms group few compress no\nrun 5\nset atom 300 vz 0.1\nrun 5\n" + counts,
                 {},
                 counted},
        Sequence{"unfix_then_delete",
                 "run 5\nunfix cull\ngroup few id 100 200\ndelete_atoms group few compress no\n"
                 "fix cull all solid/cull\nrun 5\n",
                 {},
                 {}},
        Sequence{"frozen_group", "group few id < 50\nfix hold few freeze\nrun 20\nunfix hold\nrun 20\n", {}, {}},
        Sequence{"driven_group",
                 left_half + "group left region left\nfix push left addforce 1e-5 0 0\nrun 20\n"
                             "variable e equal ke(left)\n",
                 {},
                 {"e"}},
        Sequence{"narrower_gravity",
                 left_half + "group left region left\nunfix grav\nfix grav left gravity 9.81 vector 0 0 -1\n"
                             "run 20\nvariable e equal ke(all)\n",
                 {},
                 {"e"}},
        Sequence{"narrower_integrator",
                 left_half + "group left region left\nunfix integr\nfix integr left nve/sphere\n"
                             "velocity all set 0.01 0 0\nrun 20\nvariable e equal ke(all)\n",
                 {},
                 {"e"}}),
    [](const auto& p) { return p.param.name; });

}  // namespace
}  // namespace decks
