#include "deck_commands.h"

#include <algorithm>
#include <cstring>
#include <set>
#include <string>
#include <vector>

#include "command_styles.h"
#include "compute.h"
#include "deck_rules.h"
#include "error.h"
#include "fix_solid_cull.h"
#include "group.h"
#include "lammps.h"
#include "modify.h"
#include "neigh_request.h"
#include "neighbor.h"
#include "restart_files.h"
#include "update.h"

namespace solidcull {

namespace {

std::set<const LAMMPS_NS::LAMMPS*> with_void_lists;
bool histories_stay = false;  // in delete_atoms

bool lists_are_void(const LAMMPS_NS::LAMMPS* lmp) { return with_void_lists.count(lmp) != 0; }

bool needs_lists(LAMMPS_NS::LAMMPS* lmp, const LAMMPS_NS::Compute* c) {
  const LAMMPS_NS::Neighbor* neighbor = lmp->neighbor;
  return std::any_of(neighbor->requests, neighbor->requests + neighbor->nrequest,
                     [&](const LAMMPS_NS::NeighRequest* r) { return r->requestor == c; });
}

/// What was computed of atoms at the last step is computed of the whole bed; what needs forces or neighbours can't be.
void compute_again(LAMMPS_NS::LAMMPS* lmp) {
  LAMMPS_NS::Modify* modify = lmp->modify;
  const LAMMPS_NS::bigint step = lmp->update->ntimestep;
  modify->clearstep_compute();
  for (int c = 0; c < modify->ncompute; ++c) {
    LAMMPS_NS::Compute* compute = modify->compute[c];
    const bool lists = needs_lists(lmp, compute);
    if (compute->invoked_peratom == step && lists) compute->invoked_peratom = -1;  // it has no rows for what was stored
    if (lists || compute->peflag || compute->pressflag || compute->peatomflag || compute->pressatomflag) continue;
    if (compute->invoked_peratom == step) compute->compute_peratom();
    if (compute->scalar_flag && compute->invoked_scalar == step) compute->compute_scalar();
    if (compute->vector_flag && compute->invoked_vector == step) compute->compute_vector();
    if (compute->array_flag && compute->invoked_array == step) compute->compute_array();
  }
  modify->clearstep_compute();
}

/// Whether no culled granule is in the only group on which the command acts.
bool leaves_culled_alone(LAMMPS_NS::LAMMPS* lmp, FixSolidCull& fix, const std::string& group) {
  if (group.empty()) return false;
  const int number = lmp->group->find(group.c_str());
  return number >= 0 && !fix.culls_of(lmp->group->bitmask[number]);
}

void show(LAMMPS_NS::LAMMPS* lmp, FixSolidCull& fix) {
  if (fix.show_bed()) compute_again(lmp);
}

/// The atoms of a restart file are not the whole bed until a fix has taken up the rest.
void refuse_part_of_a_bed(LAMMPS_NS::LAMMPS* lmp, FixSolidCull* fix, const std::string& where) {
  if (fix && fix->waits_for_run()) fix->refuse_before_first_run(where);
  const std::string lost = state_that_no_fix_has(*lmp->modify);
  if (!lost.empty()) lmp->error->all(FLERR, (lost + ", and 'run 0' " + where).c_str());
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
  const bool reads = sight == Sight::whole_bed || sight == Sight::all_restored;
  if (reads) refuse_part_of_a_bed(lmp, fix, std::string("before '") + command + "'");
  if (sight == Sight::run && (lists_are_void(lmp) || (fix && has_commands(words, n)))) set_up_after_all(words, n);
  if (fix && !fix->in_run()) {
    if (sight == Sight::state) fix->hide_bed();
    if (sight == Sight::whole_bed) fix->granules_may_change();
    if (sight == Sight::whole_bed && !leaves_culled_alone(lmp, *fix, only_group_of(command, line))) show(lmp, *fix);
    if (sight == Sight::all_restored) fix->restore_all(command);
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

void met_formula(LAMMPS_NS::LAMMPS* lmp, const char* formula) {
  if (!lmp->modify) return;
  FixSolidCull* fix = fix_of(lmp);
  constexpr int between_runs = 0;
  if (fix ? fix->in_run() : lmp->update->whichflag != between_runs) return;
  if (!reads_granules(formula)) return;
  refuse_part_of_a_bed(lmp, fix, std::string("before the variable '") + formula + "'");
  if (fix) show(lmp, *fix);
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
