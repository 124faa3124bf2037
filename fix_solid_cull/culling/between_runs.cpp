#include "between_runs.h"

#include <string>

#include "input_error.h"
#include "internal_error.h"

namespace solidcull {

/// Atoms come and go now: neighbour lists, which name them by their indices, and ghosts are void until the next run sets up.
void BetweenRuns::leave_lists() {
  bed_.contacts.bring_histories_up_to_date();
  bed_.contacts.forget_neighbours();
  bed_.atoms.drop_ghosts();
}

void BetweenRuns::show_bed() {
  if (!bed_.solid.has_store() || !bed_.census.something_locked() || p_.shown.shown()) return;
  leave_lists();
  p_.handover.remember();
  bed_.memory.freed(p_.exchange.forget_past_motions());
  p_.shown.show();
  bed_.atoms.count_more(bed_.census.stored());
  show_unfinished_ = true;
}

void BetweenRuns::finish_show() {
  if (!show_unfinished_) return;
  show_unfinished_ = false;
  bed_.ranks.update();
  bed_.census.publish_atoms(0);
}

void BetweenRuns::lend_contacts() {
  bed_.memory.give_bins_back();
  p_.shown.give_contacts();
}

void BetweenRuns::take_contacts_back() {
  leave_lists();
  p_.shown.take_contacts();
  bed_.census.publish_atoms(0);
}

bool BetweenRuns::culls_of(int groups) const {
  if (!bed_.census.something_locked()) return false;
  int culled = p_.shown.shown() ? ~0 : p_.exchange.stored_groups();
  const Atoms& atoms = bed_.atoms;
  for (int i = 0; i < atoms.owned; ++i)
    if (bed_.shell.locked(i)) culled |= atoms.groups[i];
  return bed_.ranks.any((culled & groups) != 0);
}

void BetweenRuns::hide_bed() {
  if (!p_.shown.shown()) return;
  finish_show();
  p_.shown.hide();
  p_.exchange.set_stored_groups(p_.shown.groups_of_guests());
  bed_.census.publish_atoms(-bed_.census.stored());
}

void BetweenRuns::take_changes(bool other_walls) {
  if (!p_.shown.changed()) return;
  change_.forget_lost();
  p_.closure.begin_run(other_walls);
  change_.make(look_, Phase::beginning);
  p_.shown.give_changes();
  change_.send_far();
  change_.take_arrivals();
}

const std::map<int, InterfaceMesh>& BetweenRuns::interface_meshes() {
  const bool stand_in = p_.shown.shown() && p_.meshes.behind();
  if (stand_in) p_.shown.stand_in_for_missing(bed_.arrivals);
  const auto& meshes = p_.files.ask_meshes();
  if (stand_in) bed_.arrivals.clear();
  return meshes;
}

std::int64_t BetweenRuns::restore_all(Phase phase) {
  if (p_.snapshot.waits())
    throw InputError("the granules that the restart file holds besides the atoms would be lost: put a run, or 'run 0', before " +
                     ("'unfix " + bed_.run.name + "'"));
  if (!bed_.solid.has_store()) return 0;
  const std::int64_t culled = bed_.census.locked();
  if (culled > 0) {
    p_.shown.shown() ? hide_bed() : leave_lists();
    bed_.ranks.update();
    change_.forget_lost();
    bed_.wake.ask_all(Woke::deck);
    change_.make(look_, phase);
    p_.shown.give_changes();
    change_.send_far();
  }
  bed_.memory.give_bins_back();
  if (bed_.solid.store().size() != 0 || bed_.solid.locked() != 0 || bed_.solid.contacts().size() != 0)
    throw InternalError("a restore of everything left " + std::to_string(bed_.solid.store().size()) + " granules in the store");
  return culled;
}

}  // namespace solidcull
