#include "formulas.h"

#include <algorithm>
#include <cctype>
#include <regex>
#include <set>

#include "compute.h"
#include "compute_styles.h"
#include "fix.h"
#include "fix_styles.h"
#include "group.h"
#include "lammps.h"
#include "modify.h"

namespace solidcull {
namespace {

const std::set<std::string> of_no_granule = {
    "PI",      "sqrt",    "exp",    "ln",     "log",       "abs",     "sin",   "cos",  "tan",     "asin",     "acos",
    "atan",    "atan2",   "random", "normal", "ceil",      "floor",   "round", "ramp", "stagger", "stride",   "logfreq",
    "step",    "elapsed", "dt",     "time",   "cpu",       "tpcpu",   "spcpu", "part", "vol",     "elaplong", "cpuremain",
    "swiggle", "lx",      "ly",     "lz",     "vdisplace", "cwiggle", "xlo",   "xhi",  "ylo",     "yhi",      "zlo",
    "zhi",     "xy",      "xz",     "yz",     "xlat",      "ylat",    "zlat"};
const std::set<std::string> group_functions = {"count",    "mass", "charge", "xcm",    "vcm",     "fcm",  "bound",
                                               "gyration", "ke",   "angmom", "torque", "inertia", "omega"};
const char* const of_group = "g_";  // before a group, among what a number is made of
const std::set<std::string> of_forces = {"fcm", "torque", "fx", "fy", "fz", "tqx", "tqy", "tqz"};

bool begins(const std::string& word, const char* with) { return word.compare(0, 2, with) == 0; }

bool is_average(const std::string& style) { return style == "ave/time" || style == "ave/correlate"; }

/// What they say of granules at rest is 0.
bool is_of_motion(const std::string& style) {
  static const std::set<std::string> styles = {"ke", "ke/atom", "erotate", "erotate/sphere", "erotate/sphere/atom"};
  return styles.count(style) != 0;
}

/// A number as the engine computes it in a run.
class InRun {
 public:
  InRun(LAMMPS_NS::LAMMPS* lmp, const CullsOf& culls_of) : lmp_(lmp), culls_of_(culls_of) {}

  bool misses_granules(const std::string& word) {
    if (!seen_.insert(word).second) return false;  // in a circle of names, or known
    if (begins(word, "f_")) {
      const int f = lmp_->modify->find_fix(word.substr(2).c_str());
      if (f < 0) return false;
      const LAMMPS_NS::Fix* fix = lmp_->modify->fix[f];
      if (is_average(fix->style)) return any_source_of(word);
      return treatment_of(fix->style).treatment == Treatment::atoms_only && culls_of_(fix->groupbit);
    }
    if (begins(word, "c_")) {
      const int c = lmp_->modify->find_compute(word.substr(2).c_str());
      if (c < 0) return false;
      const LAMMPS_NS::Compute* compute = lmp_->modify->compute[c];
      switch (measure_of(compute->style).measure) {
        case Measure::exact:
          return any_source_of(word);
        case Measure::atoms_only:
          return !is_of_motion(compute->style) && culls_of_(compute->groupbit);
        case Measure::contacts:
          return culls_of_(compute->groupbit);
        default:
          return false;
      }
    }
    if (begins(word, "v_")) return any_source_of(word);
    if (begins(word, of_group)) {
      const int group = lmp_->group->find(word.substr(2).c_str());
      return group >= 0 && culls_of_(lmp_->group->bitmask[group]);
    }
    constexpr int all = 1;
    return of_no_granule.count(word) == 0 && word != "ke" && culls_of_(all);
  }

 private:
  bool any_source_of(const std::string& word) {
    const std::vector<std::string>& from = sources(lmp_).of(word);
    return std::any_of(from.begin(), from.end(), [&](const std::string& w) { return misses_granules(w); });
  }

  LAMMPS_NS::LAMMPS* lmp_;
  const CullsOf& culls_of_;
  std::set<std::string> seen_;
};

/// What a formula is made of; a function of a group by the group alone.
void add_sources(const std::string& formula, std::vector<std::string>& all) {
  static const std::regex of_a_group(R"((^|[^\w])([a-zA-Z]+)\((\w+)(,[^()]*)?\))");
  std::string rest;
  auto from = formula.begin();
  for (std::sregex_iterator m(formula.begin(), formula.end(), of_a_group), end; m != end; ++m) {
    if (!group_functions.count((*m)[2])) continue;
    if ((*m)[2] != "ke") all.push_back(of_group + (*m)[3].str());
    rest += std::string(from, formula.begin() + m->position()) + " ";
    from = formula.begin() + m->position() + m->length();
  }
  rest.append(from, formula.end());
  for (const std::string& w : words_of(rest)) all.push_back(w);
}

}  // namespace

std::vector<std::string> words_of(const std::string& formula) {
  std::vector<std::string> words;
  const auto in_word = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_'; };
  for (std::size_t at = 0; at < formula.size();) {
    if (std::isdigit(static_cast<unsigned char>(formula[at])) || formula[at] == '.') {  // 1e-3 is no word
      while (at < formula.size() && (in_word(formula[at]) || formula[at] == '.')) ++at;
      continue;
    }
    if (!in_word(formula[at])) {
      ++at;
      continue;
    }
    const std::size_t begin = at;
    while (at < formula.size() && in_word(formula[at])) ++at;
    words.push_back(formula.substr(begin, at - begin));
  }
  return words;
}

Reads reads_of(const std::string& formula, const std::function<bool(const std::string& id)>& reads_fix) {
  Reads most = Reads::nothing;
  for (const std::string& word : words_of(formula)) {
    if (begins(word, "v_") || of_no_granule.count(word)) continue;  // variables are evaluated for themselves
    if (begins(word, "f_") && !reads_fix(word.substr(2))) continue;
    most = std::max(most, of_forces.count(word) ? Reads::forces : Reads::granules);
  }
  return most;
}

bool fix_reads_granules(LAMMPS_NS::LAMMPS* lmp, const std::string& id) {
  const int f = lmp->modify->find_fix(id.c_str());
  if (f < 0) return true;
  const LAMMPS_NS::Fix* fix = lmp->modify->fix[f];
  if (std::string(fix->style) == "solid/cull") return false;
  if (fix->peratom_flag) return true;
  const Treatment t = treatment_of(fix->style).treatment;
  return t != Treatment::exact && t != Treatment::atoms_only;
}

Reads reads_of(const std::string& formula, LAMMPS_NS::LAMMPS* lmp) {
  return reads_of(formula, [&](const std::string& id) { return fix_reads_granules(lmp, id); });
}

void Sources::was_made(const std::string& name, const std::vector<std::string>& words) {
  std::vector<std::string>& all = made_[name];
  all.clear();
  for (const std::string& w : words)
    if (begins(w, "c_") || begins(w, "f_") || begins(w, "v_")) all.push_back(w.substr(0, w.find('[')));
}

void Sources::variable_was_made(const std::string& name, const std::vector<std::string>& formula) {
  std::vector<std::string>& all = made_["v_" + name];
  all.clear();
  for (const std::string& w : formula) add_sources(w, all);
}

const std::vector<std::string>& Sources::of(const std::string& word) const {
  static const std::vector<std::string> none;
  const auto found = made_.find(word);
  return found == made_.end() ? none : found->second;
}

Sources& sources(LAMMPS_NS::LAMMPS* lmp) {
  static std::map<LAMMPS_NS::LAMMPS*, Sources> all;
  return all[lmp];
}

std::string fix_that_missed_granules(const std::string& formula, LAMMPS_NS::LAMMPS* lmp, const CullsOf& culls_of) {
  InRun in_run(lmp, culls_of);
  for (const std::string& word : words_of(formula)) {
    if (!begins(word, "f_") || !in_run.misses_granules(word)) continue;
    const LAMMPS_NS::Fix* fix = lmp->modify->fix[lmp->modify->find_fix(word.substr(2).c_str())];
    return "fix " + std::string(fix->id) + " (" + fix->style + ")";
  }
  return "";
}

}  // namespace solidcull
