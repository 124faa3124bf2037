#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <set>
#include <sstream>

#include "input_error.h"
#include "settings.h"

namespace solidcull {
namespace {

std::vector<std::string> words(const std::string& line) {
  std::istringstream in(line);
  return {std::istream_iterator<std::string>(in), {}};
}

Settings parsed(const std::string& line) { return parse_settings(words(line)); }

/// The text with which a line is refused; empty if it is not.
std::string refusal(const std::string& line) {
  try {
    parsed(line);
  } catch (const InputError& e) {
    return e.what();
  }
  return {};
}

using Outputs = std::vector<std::pair<int, std::string>>;

template <class Output>
Outputs listed(const std::vector<Output>& outputs) {
  Outputs list;
  for (const Output& o : outputs) list.emplace_back(o.every, o.file);
  return list;
}

void expect_same(const Settings& a, const Settings& b) {
  EXPECT_EQ(a.every, b.every);
  EXPECT_EQ(a.depth, b.depth);
  EXPECT_EQ(a.exterior, b.exterior);
  EXPECT_EQ(a.speed, b.speed);
  EXPECT_EQ(a.calm, b.calm);
  EXPECT_EQ(a.tolerance_absolute, b.tolerance_absolute);
  EXPECT_EQ(a.tolerance_relative, b.tolerance_relative);
  EXPECT_EQ(a.carve_radius, b.carve_radius);
  EXPECT_EQ(a.carve_cap, b.carve_cap);
  EXPECT_EQ(a.store, b.store);
  EXPECT_EQ(a.restore, b.restore);
  EXPECT_EQ(a.voxel, b.voxel);
  EXPECT_EQ(a.balance_every, b.balance_every);
  EXPECT_EQ(a.balance_threshold, b.balance_threshold);
  EXPECT_EQ(a.audit_every, b.audit_every);
  EXPECT_EQ(a.audit_patches, b.audit_patches);
  EXPECT_EQ(a.report, b.report);
  EXPECT_EQ(a.reasons, b.reasons);
  EXPECT_EQ(listed(a.meshes), listed(b.meshes));
  EXPECT_EQ(listed(a.beds), listed(b.beds));
}

// ----------------------------------------------------------------------------------------------------------- what is taken

TEST(Settings, a_sleeping_surface_needs_no_cover) {
  EXPECT_EQ(parsed("exterior sleep").exterior, Exterior::sleep);
  EXPECT_EQ(parsed("exterior sleep").depth, 0.0);
  EXPECT_EQ(parsed("exterior live").depth, 2.0);
  EXPECT_EQ(parsed("exterior sleep depth 1.5").depth, 1.5);
  EXPECT_EQ(parsed("depth 1.5 exterior sleep").depth, 1.5);
}

TEST(Settings, without_keywords_are_the_defaults) {
  const Settings s = parsed("");
  EXPECT_EQ(s.every, 0);
  EXPECT_EQ(s.depth, 0.0);
  EXPECT_EQ(s.exterior, Exterior::sleep);
  EXPECT_EQ(s.speed, 0.01);
  EXPECT_EQ(s.calm, 4);
  EXPECT_EQ(s.tolerance_absolute, 3.0);
  EXPECT_EQ(s.tolerance_relative, 0.0);
  EXPECT_EQ(s.carve_radius, 2.0);
  EXPECT_EQ(s.carve_cap, 4.0);
  EXPECT_EQ(s.store, Store::exact);
  EXPECT_EQ(s.restore, Restore::exact);
  EXPECT_EQ(s.voxel, 0.5);
  EXPECT_EQ(s.report, ReportLength::brief);
  EXPECT_FALSE(s.reasons);
  EXPECT_TRUE(s.meshes.empty());
  EXPECT_TRUE(s.beds.empty());
}

TEST(Settings, every_keyword_is_parsed) {
  Settings due;
  due.every = 40;
  due.depth = 3.5;
  due.exterior = Exterior::live;
  due.speed = 1e-3;
  due.calm = 5;
  due.tolerance_absolute = 0.5;
  due.tolerance_relative = 0.1;
  due.carve_radius = 1.5;
  due.carve_cap = 6;
  due.voxel = 0.25;
  due.balance_every = 1000;
  due.balance_threshold = 1.2;
  due.audit_every = 2000;
  due.audit_patches = 4;
  due.report = ReportLength::full;
  due.reasons = true;
  due.meshes = {{100, "out/mesh.*.vdb"}};
  due.beds = {{200, "bed.vtp"}};
  const std::string line =
      "every 40 depth 3.5 exterior live speed 1e-3 calm 5 tolerance 0.5 0.1 carve 1.5 6 store exact "
      "restore exact voxel 0.25 balance 1000 1.2 audit 2000 4 report full reasons yes mesh 100 out/mesh.*.vdb bed 200 bed.vtp";
  expect_same(parsed(line), due);
  std::set<std::string> named;
  for (const std::string& w : words(line)) named.insert(w);
  for (const std::string& k : setting_keywords()) EXPECT_TRUE(named.count(k)) << "keyword " << k << " is in no test";
}

TEST(Settings, what_is_not_stored_is_refilled) {
  for (const char* line : {"store none restore refill", "restore refill store none"}) {
    EXPECT_EQ(parsed(line).store, Store::none);
    EXPECT_EQ(parsed(line).restore, Restore::refill);
  }
}

TEST(Settings, the_store_is_exact_or_compact) {
  EXPECT_EQ(parsed("store exact").store, Store::exact);
  EXPECT_EQ(parsed("store compact").store, Store::compact);
}

TEST(Settings, keywords_come_in_any_order_and_the_last_word_counts) {
  EXPECT_EQ(parsed("calm 4 every 10").calm, parsed("every 10 calm 4").calm);
  EXPECT_EQ(parsed("calm 4 calm 6").calm, 6);
}

TEST(Settings, the_limits_themselves_are_allowed) {
  for (const char* line : {"every 1",
                           "every 2000000000",
                           "depth 50",
                           "calm 1",
                           "tolerance 0 0.1",
                           "tolerance 0.1 0",
                           "carve 1 1",
                           "voxel 0.1",
                           "exterior sleep",
                           "exterior sleep depth 0",
                           "depth 0 exterior sleep",
                           "exterior sleep depth 1 voxel 2",
                           "depth 4 voxel 2",
                           "depth 1 voxel 0.5",
                           "speed 1e-9",
                           "report short",
                           "report full",
                           "reasons yes",
                           "reasons no",
                           "mesh 1 a.vdb",
                           "mesh 1 a.stl",
                           "mesh 1 a.vtp",
                           "mesh 1 a.vtp least 3 skin",
                           "bed 1 a.vtp",
                           "bed 1 a.vtp seen spin calm 3"})
    EXPECT_EQ(refusal(line), "") << line;
}

TEST(Settings, files_may_be_several_and_keep_the_star_for_the_step) {
  const Settings s = parsed("mesh 5 a.*.stl bed 6 b_*.vtp mesh 7 a.*.vdb bed 8 c.vtp");
  EXPECT_EQ(listed(s.meshes), (Outputs{{5, "a.*.stl"}, {7, "a.*.vdb"}}));
  EXPECT_EQ(listed(s.beds), (Outputs{{6, "b_*.vtp"}, {8, "c.vtp"}}));
}

TEST(Settings, words_behind_a_file_are_of_that_file_alone) {
  const Settings s = parsed("bed 1 a.vtp seen bed 2 b.vtp spin bed 3 c.vtp mesh 4 d.vdb least 20 surface mesh 5 e.stl skin");
  EXPECT_TRUE(s.beds[0].seen && !s.beds[0].spin);
  EXPECT_TRUE(!s.beds[1].seen && s.beds[1].spin);
  EXPECT_TRUE(!s.beds[2].seen && !s.beds[2].spin);
  EXPECT_TRUE(s.meshes[0].surface && !s.meshes[0].skin);
  EXPECT_EQ(s.meshes[0].least, 20);
  EXPECT_TRUE(!s.meshes[1].surface && s.meshes[1].skin);
  EXPECT_EQ(s.meshes[1].least, 1);
}

// --------------------------------------------------------------------------------------------------------- what is refused

struct Refusal {
  const char* line;
  const char* text;
};

class SettingsRefuse : public testing::TestWithParam<Refusal> {};

TEST_P(SettingsRefuse, with_the_keyword_the_value_and_what_to_do) { EXPECT_EQ(refusal(GetParam().line), GetParam().text); }

const Refusal refusals[] = {
    {"every 0", "keyword 'every' has the value '0': give a whole number of steps, 1 or more"},
    {"every -5", "keyword 'every' has the value '-5': give a whole number of steps, 1 or more"},
    {"every 10.5", "keyword 'every' has the value '10.5': give a whole number of steps, 1 or more"},
    {"every 1e3", "keyword 'every' has the value '1e3': give a whole number of steps, 1 or more"},
    {"every often", "keyword 'every' has the value 'often': give a whole number of steps, 1 or more"},
    {"every 99999999999999999999",
     "keyword 'every' has the value '99999999999999999999': give a whole number of steps, 1 or more"},
    {"every", "keyword 'every' ends too early: give a whole number of steps, 1 or more"},
    {"every calm 3", "keyword 'every' has the value 'calm': give a whole number of steps, 1 or more"},

    {"exterior live depth 0",
     "keyword 'depth' has the value '0' and 'exterior' the value 'live': give a cover of more than 0, or say 'exterior sleep'"},
    {"depth -1", "keyword 'depth' has the value '-1': give a number of mean diameters, 0 to 50"},
    {"depth 51", "keyword 'depth' has the value '51': give a number of mean diameters, 0 to 50"},
    {"depth nan", "keyword 'depth' has the value 'nan': give a number of mean diameters, 0 to 50"},
    {"depth 2d", "keyword 'depth' has the value '2d': give a number of mean diameters, 0 to 50"},
    {"depth", "keyword 'depth' ends too early: give a number of mean diameters, 0 to 50"},

    {"exterior rest", "keyword 'exterior' has the value 'rest': give 'live' or 'sleep'"},
    {"exterior", "keyword 'exterior' ends too early: give 'live' or 'sleep'"},

    {"speed 0", "keyword 'speed' has the value '0': give a fraction of sqrt(g d), more than 0"},
    {"speed -0.1", "keyword 'speed' has the value '-0.1': give a fraction of sqrt(g d), more than 0"},
    {"speed inf", "keyword 'speed' has the value 'inf': give a fraction of sqrt(g d), more than 0"},
    {"speed slow", "keyword 'speed' has the value 'slow': give a fraction of sqrt(g d), more than 0"},
    {"speed", "keyword 'speed' ends too early: give a fraction of sqrt(g d), more than 0"},

    {"calm 0", "keyword 'calm' has the value '0': give a whole number of looks, 1 or more"},
    {"calm 2.0", "keyword 'calm' has the value '2.0': give a whole number of looks, 1 or more"},
    {"calm", "keyword 'calm' ends too early: give a whole number of looks, 1 or more"},

    {"tolerance -1 0", "keyword 'tolerance' has the value '-1': give two numbers A R, 0 or more and not both 0"},
    {"tolerance 1 -1", "keyword 'tolerance' has the value '-1': give two numbers A R, 0 or more and not both 0"},
    {"tolerance 0 0", "keyword 'tolerance' has the value '0 0': give two numbers A R, 0 or more and not both 0"},
    {"tolerance x 0", "keyword 'tolerance' has the value 'x': give two numbers A R, 0 or more and not both 0"},
    {"tolerance 3", "keyword 'tolerance' ends too early: give two numbers A R, 0 or more and not both 0"},
    {"tolerance 3 calm 3", "keyword 'tolerance' has the value 'calm': give two numbers A R, 0 or more and not both 0"},
    {"tolerance", "keyword 'tolerance' ends too early: give two numbers A R, 0 or more and not both 0"},

    {"carve 0 4",
     "keyword 'carve' has the value '0': give two numbers C CAP: radius in mean diameters, more than 0; growth, 1 or more"},
    {"carve 2 0.9",
     "keyword 'carve' has the value '0.9': give two numbers C CAP: radius in mean diameters, more than 0; growth, 1 or more"},
    {"carve big 4",
     "keyword 'carve' has the value 'big': give two numbers C CAP: radius in mean diameters, more than 0; growth, 1 or more"},
    {"carve 2",
     "keyword 'carve' ends too early: give two numbers C CAP: radius in mean diameters, more than 0; growth, 1 or more"},

    {"motion fixed", "keyword 'motion' is no more: leave it and its value out; bodies that walls hold stand still by themselves"},
    {"walls", "keyword 'walls' is no more: leave it and its value out; walls that stand still always count as cover"},
    {"store some", "keyword 'store' has the value 'some': give 'exact', 'compact' or 'none'"},
    {"store", "keyword 'store' ends too early: give 'exact', 'compact' or 'none'"},
    {"store none",
     "keyword 'store' has the value 'none' and 'restore' the value 'exact': say 'restore refill', or store granules"},
    {"restore new", "keyword 'restore' has the value 'new': give 'exact' or 'refill'"},
    {"restore", "keyword 'restore' ends too early: give 'exact' or 'refill'"},
    {"restore refill",
     "keyword 'restore' has the value 'refill' and 'store' keeps granules: say 'store none', or 'restore exact'"},

    {"voxel 0.09", "keyword 'voxel' has the value '0.09': give a size in mean diameters, 0.1 to 2"},
    {"voxel 2.1", "keyword 'voxel' has the value '2.1': give a size in mean diameters, 0.1 to 2"},
    {"voxel fine", "keyword 'voxel' has the value 'fine': give a size in mean diameters, 0.1 to 2"},
    {"voxel", "keyword 'voxel' ends too early: give a size in mean diameters, 0.1 to 2"},

    {"audit 0 4",
     "keyword 'audit' has the value '0': give two whole numbers N K: steps from one audit to the next, patches that each wakes"},
    {"audit 1000",
     "keyword 'audit' ends too early: give two whole numbers N K: steps from one audit to the next, patches that each wakes"},
    {"audit 1000 0.5",
     "keyword 'audit' has the value '0.5': give two whole numbers N K: steps from one audit to the next, patches that each "
     "wakes"},
    {"balance 0 1.1",
     "keyword 'balance' has the value '0': give a whole number of steps, 1 or more, and the largest work of a rank over the "
     "mean, more than 1"},
    {"balance 100 1",
     "keyword 'balance' has the value '1': give a whole number of steps, 1 or more, and the largest work of a rank over the "
     "mean, more than 1"},
    {"balance 100",
     "keyword 'balance' ends too early: give a whole number of steps, 1 or more, and the largest work of a rank over the mean, "
     "more than 1"},

    {"report long", "keyword 'report' has the value 'long': give 'short' or 'full'"},
    {"reasons maybe", "keyword 'reasons' has the value 'maybe': give 'yes' or 'no'"},
    {"report", "keyword 'report' ends too early: give 'short' or 'full'"},

    {"mesh 0 a.stl", "keyword 'mesh' has the value '0': give a whole number of steps, 1 or more, and a file name"},
    {"mesh a.stl", "keyword 'mesh' has the value 'a.stl': give a whole number of steps, 1 or more, and a file name"},
    {"mesh", "keyword 'mesh' ends too early: give a whole number of steps, 1 or more, and a file name"},
    {"mesh 10 a.vtp least", "keyword 'mesh' ends too early: give a whole number of granules, 1 or more, behind 'least'"},
    {"mesh 10 a.vtp least 0", "keyword 'mesh' has the value '0': give a whole number of granules, 1 or more, behind 'least'"},
    {"mesh 10", "keyword 'mesh' ends too early: give a file name that ends with .vdb, .stl or .vtp"},
    {"mesh 10 a.obj", "keyword 'mesh' has the value 'a.obj': give a file name that ends with .vdb, .stl or .vtp"},
    {"mesh 10 .stl", "keyword 'mesh' has the value '.stl': give a file name that ends with .vdb, .stl or .vtp"},
    {"mesh 10 a.STL", "keyword 'mesh' has the value 'a.STL': give a file name that ends with .vdb, .stl or .vtp"},

    {"bed -1 a.vtp", "keyword 'bed' has the value '-1': give a whole number of steps, 1 or more, and a file name"},
    {"bed", "keyword 'bed' ends too early: give a whole number of steps, 1 or more, and a file name"},
    {"bed 10", "keyword 'bed' ends too early: give a file name that ends with .vtp or .vdb"},
    {"bed 10 a.stl", "keyword 'bed' has the value 'a.stl': give a file name that ends with .vtp or .vdb"},

    {"exterior live voxel 1.5 depth 2", "voxel 1.5 is too coarse for depth 2.0: choose voxel <= depth/2"},
    {"exterior live voxel 2", "voxel 2.0 is too coarse for depth 2.0: choose voxel <= depth/2"},
    {"depth 0.8 exterior live", "voxel 0.5 is too coarse for depth 0.8: choose voxel <= depth/2"},

    {"deptth 2",
     "unknown keyword 'deptth': choose from audit, balance, bed, calm, carve, depth, every, exterior, mesh, reasons, report, "
     "restore, "
     "speed, "
     "store, "
     "tolerance, voxel"},
    {"calm 3 4",
     "unknown keyword '4': choose from audit, balance, bed, calm, carve, depth, every, exterior, mesh, reasons, report, restore, "
     "speed, "
     "store, "
     "tolerance, voxel"},
};

INSTANTIATE_TEST_SUITE_P(Refusals, SettingsRefuse, testing::ValuesIn(refusals), [](const auto& info) {
  std::string name = std::to_string(info.index) + "_";
  for (const char* c = info.param.line; *c; ++c) name += std::isalnum(static_cast<unsigned char>(*c)) ? *c : '_';
  return name;
});

TEST(Settings, each_keyword_is_refused_without_a_value) {
  for (const std::string& k : setting_keywords())
    EXPECT_EQ(refusal(k).find("keyword '" + k + "' ends too early: give "), 0u) << refusal(k);
}

// --------------------------------------------------------------------------------------------------------------- intervals

TEST(LookInterval, is_a_twentieth_of_the_deck_s_own_time) {
  EXPECT_EQ(look_interval(0.0026, 9.81, 3e-5), 27);  // 0.05 sqrt(0.0026 / 9.81) = 8.14e-4 s
  EXPECT_EQ(look_interval(0.0026, 9.81, 1e-5), 81);
  EXPECT_EQ(look_interval(0.0026, 9.81 / 4, 3e-5), 54);
}

TEST(LookInterval, stays_between_10_and_1000_steps) {
  EXPECT_EQ(look_interval(0.0026, 9.81, 1e-2), 10);
  EXPECT_EQ(look_interval(0.0026, 9.81, 1e-9), 1000);
}

// ----------------------------------------------------------------------------------------------------- the command page

/// The lines under a heading of the page, up to the next one.
std::vector<std::string> section(const std::string& heading) {
  std::ifstream page(SOLIDCULL_SOURCE_DIR "/fix_solid_cull/fix_solid_cull.md");
  EXPECT_TRUE(page) << "the command page is missing";
  std::vector<std::string> lines;
  bool inside = false;
  for (std::string line; std::getline(page, line);) {
    if (line.rfind("## ", 0) == 0)
      inside = line == "## " + heading;
    else if (inside)
      lines.push_back(line);
  }
  EXPECT_FALSE(lines.empty()) << "no section " << heading;
  return lines;
}

TEST(CommandPage, has_lammps_headings) {
  for (const char* heading :
       {"Syntax", "Examples", "Description", "Restart and output info", "Restrictions", "Related", "Default"})
    section(heading);
}

TEST(CommandPage, explains_the_keywords_that_the_code_knows) {
  // one line each: "| `keyword` *values* | meaning |"
  std::set<std::string> explained;
  for (const std::string& line : section("Syntax")) {
    if (line.rfind("| `", 0) != 0) continue;
    const std::string name = line.substr(3, line.find('`', 3) - 3);
    EXPECT_TRUE(explained.insert(name).second) << "keyword " << name << " stands there twice";
  }
  const std::vector<std::string> known = setting_keywords();
  EXPECT_EQ(explained, std::set<std::string>(known.begin(), known.end()));
}

TEST(CommandPage, gives_examples_that_are_accepted) {
  int examples = 0;
  for (const std::string& line : section("Examples")) {
    const std::vector<std::string> w = words(line);
    if (w.size() < 4 || w[0] != "fix" || w[3] != "solid/cull") continue;
    ++examples;
    EXPECT_NO_THROW(parse_settings({w.begin() + 4, w.end()})) << line;
  }
  EXPECT_GE(examples, 3);
}

TEST(CommandPage, names_the_defaults_of_the_code) {
  for (const std::string& line : section("Default")) {
    const std::vector<std::string> w = words(line);
    if (w.empty() || w[0] != "depth") continue;
    expect_same(parse_settings(w), Settings());
    const std::set<std::string> named(w.begin(), w.end());
    // a number of steps that depends on the deck, cuts that do not move, audits that do not come, and files that are not written:
    // told in words
    for (const std::string& k : setting_keywords())
      EXPECT_TRUE(named.count(k) || k == "audit" || k == "balance" || k == "every" || k == "mesh" || k == "bed")
          << "no default for " << k;
    return;
  }
  ADD_FAILURE() << "no line of defaults that begins with depth";
}

}  // namespace
}  // namespace solidcull
