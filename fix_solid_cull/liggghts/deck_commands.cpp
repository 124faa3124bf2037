#include "deck_commands.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "command_styles.h"
#include "deck_rules.h"
#include "error.h"
#include "fix_solid_cull.h"
#include "formulas.h"
#include "group.h"
#include "lammps.h"
#include "mesh_regions.h"
#include "modify.h"
#include "restart_files.h"
#include "update.h"
#include "whole_bed_forces.h"

namespace solidcull {

namespace {

std::set<const LAMMPS_NS::LAMMPS*> with_void_lists;
struct Known {
  int numbers = 0, forces = 0;  // of all granules, as of the show of the bed that has this number
};
std::map<const LAMMPS_NS::LAMMPS*, Known> known;
bool histories_stay = false;  // in delete_atoms

bool lists_are_void(const LAMMPS_NS::LAMMPS* lmp) { return with_void_lists.count(lmp) != 0; }

/// Whether no culled granule is in the only group on which the command acts.
bool leaves_culled_alone(LAMMPS_NS::LAMMPS* lmp, FixSolidCull& fix, const std::string& group) {
  if (group.empty()) return false;
  const int number = lmp->group->find(group.c_str());
  return number >= 0 && !fix.culls_of(lmp->group->bitmask[number]);
}

/// Numbers that were computed in the last step are computed again, of all granules.
void bring_up_to_date(LAMMPS_NS::LAMMPS* lmp, FixSolidCull& fix) {
  known[lmp].numbers = fix.show_number();
  if (!some_current_number_needs_forces(lmp)) {
    compute_again(lmp);
    return;
  }
  const WholeBedForces forces(lmp, fix);
  compute_again(lmp);
  known[lmp].forces = fix.show_number();
}

void restore(LAMMPS_NS::LAMMPS* lmp, FixSolidCull& fix, const char* command) {
  if (fix.restore_all(command)) bring_up_to_date(lmp, fix);
}

void refuse_part_of_a_bed(LAMMPS_NS::LAMMPS* lmp, FixSolidCull* fix, const std::string& where) {
  const std::string why = part_of_a_bed(lmp, fix, where);
  if (!why.empty()) lmp->error->all(FLERR, why.c_str());
}

/// A run that is to go on without a set-up, where there is nothing to go on with.
void set_up_after_all(char** words, int& n) {
  for (int w = 0; w + 1 < n; ++w)
    if (std::strcmp(words[w], "every") == 0) {
      return;
    } else if (std::strcmp(words[w], "pre") == 0) {
      std::copy(words + w + 2, words + n, words + w);
      n -= 2;
      return;
    }
}
bool has_commands(char** words, int n) {
  return std::any_of(words, words + n, [](const char* w) { return std::strcmp(w, "every") == 0; });
}

/// The fix line itself: one of the same ID would take the place of a fix that holds granules.
bool is_own_line(const char* command, char** words, int n) {
  return n > 2 && std::strcmp(command, "fix") == 0 && std::strcmp(words[2], "solid/cull") == 0;
}
bool is(const char* command, const char* name) { return std::strcmp(command, name) == 0; }

/// What names of the deck stand for.
void remember(LAMMPS_NS::LAMMPS* lmp, const char* command, const std::vector<std::string>& words) {
  if (words.size() < 3) return;
  const std::vector<std::string> rest(words.begin() + 2, words.end());
  if (is(command, "compute")) sources(lmp).was_made("c_" + words[0], rest);
  if (is(command, "fix")) sources(lmp).was_made("f_" + words[0], rest);
  if (is(command, "variable")) sources(lmp).variable_was_made(words[0], rest);
}

}  // namespace

FixSolidCull* fix_of(LAMMPS_NS::LAMMPS* lmp) {
  if (!lmp->modify) return nullptr;
  for (int f = 0; f < lmp->modify->nfix; ++f)
    if (lmp->modify->fix[f] && std::strcmp(lmp->modify->fix[f]->style, "solid/cull") == 0)
      return static_cast<FixSolidCull*>(lmp->modify->fix[f]);
  return nullptr;
}

MetCommand::MetCommand(LAMMPS_NS::LAMMPS* lmp, const char* command, bool added, char** words, int& n) : lmp_(lmp) {
  if (!lmp->modify) return;
  FixSolidCull* fix = fix_of(lmp);
  const std::vector<std::string> line(words, words + n);
  Sight sight = sight_of(command, line, added);
  resets_ = std::strcmp(command, "reset_timestep") == 0;
  // fix insert/stream then moves the step at which each granule was released
  if (resets_ && lmp->modify->find_fix(releases_id) >= 0) sight = Sight::whole_bed;
  if (is_own_line(command, words, n)) sight = fix ? Sight::all_restored : Sight::nothing;
  const std::string refused = why_no_interface_mesh_for_command(lmp, command, n, words);
  if (!refused.empty()) lmp->error->all(FLERR, refused.c_str());
  if (is(command, "pair_style") && (!fix || fix->waits_for_run())) sight = Sight::nothing;  // it comes right after read_restart
  if (fix && !fix->waits_for_run() && !fix->in_run() && is(command, "unfix") && n > 0 && is(words[0], fix->id))
    restore(lmp, *fix, nullptr);  // numbers may be read after the fix has gone
  remember(lmp, command, line);
  const bool reads = sight == Sight::whole_bed || sight == Sight::all_restored;
  if (reads) refuse_part_of_a_bed(lmp, fix, std::string("before '") + command + "'");
  if (sight == Sight::run && (lists_are_void(lmp) || (fix && has_commands(words, n)))) set_up_after_all(words, n);
  if (fix && !fix->in_run()) {
    if (sight == Sight::state) fix->hide_bed();
    if (sight == Sight::whole_bed) fix->granules_may_change();
    if (sight == Sight::whole_bed && !leaves_culled_alone(lmp, *fix, only_group_of(command, line))) show(lmp, *fix, false);
    if (sight == Sight::all_restored) restore(lmp, *fix, command);
  }
  if (n == 1 && std::strcmp(command, "read_restart") == 0) remember_read(lmp, words[0]);
  histories_stay = lists_are_void(lmp) && std::strcmp(command, "delete_atoms") == 0;
  step_ = lmp->update->ntimestep;
}

MetCommand::~MetCommand() {
  histories_stay = false;
  if (!resets_) return;
  if (FixSolidCull* fix = fix_of(lmp_)) fix->time_was_reset(lmp_->update->ntimestep - step_);
}

std::string part_of_a_bed(LAMMPS_NS::LAMMPS* lmp, const FixSolidCull* fix, const std::string& where) {
  if (fix && fix->waits_for_run()) return fix->before_first_run(where);
  const std::string lost = state_that_no_fix_has(*lmp->modify);
  return lost.empty() ? lost : lost + ", and 'run 0' " + where;
}

void show(LAMMPS_NS::LAMMPS* lmp, FixSolidCull& fix, bool forces) {
  fix.show_bed();
  if (!fix.bed_is_shown()) return;
  if (known[lmp].numbers != fix.show_number()) bring_up_to_date(lmp, fix);
  if (!forces || known[lmp].forces == fix.show_number()) return;
  const WholeBedForces computed(lmp, fix);
  known[lmp].forces = fix.show_number();
}

void refuse_value_of_atoms(LAMMPS_NS::LAMMPS* lmp, const std::string& formula) {
  FixSolidCull* const fix = fix_of(lmp);
  if (!fix) return;
  const std::string missed = fix_that_missed_granules(formula, lmp, [&](int groups) { return fix->culls_of(groups); });
  if (!missed.empty()) fix->refuse_value_of_atoms(formula, missed);
}

void met_formula(LAMMPS_NS::LAMMPS* lmp, const char* formula) {
  if (!lmp->modify || WholeBedForces::at_work()) return;
  FixSolidCull* fix = fix_of(lmp);
  constexpr int between_runs = 0;
  if (fix ? fix->in_run() : lmp->update->whichflag != between_runs) return;
  const Reads reads = reads_of(formula, lmp);
  refuse_value_of_atoms(lmp, formula);
  if (reads == Reads::nothing) return;
  refuse_part_of_a_bed(lmp, fix, std::string("before the variable '") + formula + "'");
  if (fix) show(lmp, *fix, reads == Reads::forces);
}

void run_begins(LAMMPS_NS::LAMMPS* lmp) {
  if (FixSolidCull* fix = fix_of(lmp)) fix->run_begins();
  with_void_lists.erase(lmp);
}

void leave_lists(LAMMPS_NS::LAMMPS* lmp) { with_void_lists.insert(lmp); }

bool leaves_histories() {
  const bool leaves = histories_stay;
  histories_stay = false;
  return leaves;
}

}  // namespace solidcull
