// The pipeline of a membership change: exterior <-> interface <-> interior, at a reneighbouring.
#include <cstdint>
#include <string>

#include "culling.h"
#include "input_error.h"
#include "internal_error.h"
#include "numbers.h"

namespace solidcull {
namespace {

// after this share of the atoms came or went, the engine sorts its arrays at once
constexpr double sort_share = 0.05;

}  // namespace

/// Who leaves for another rank must be known before the engine sends it.
void Culling::follow_box() {
  p_.bed.ranks.follow_box();
  if (!p_.bed.ranks.any(p_.bed.ranks.subdomain_changed())) return;
  p_.bed.ranks.update();
  p_.handover.forget_homes();
}

void Culling::change() {
  check_numbers(p_.bed.atoms);  // before they are sorted into cells, here and by the engine
  if (!p_.bed.solid.has_store()) return;
  const auto timed = p_.report.time(Part::membership);
  meet_new_granules();
  follow_box();
  // another fix may have deleted granules in this hook
  if (phase_ == Phase::stepping && p_.bed.census.something_locked() && p_.lost.forget_lost()) settle_bodies();
  p_.bed.memory.freed(p_.exchange.begin_change());
  if (!p_.bed.census.something_locked() && !p_.bed.ranks.any(proposal_.any_here() || p_.wake.any_at_all())) return;
  if (phase_ == Phase::stepping) p_.bed.memory.make_room(proposal_.chosen.size());
  p_.refill.begin_change();
  MembershipChange c(p_.for_change(), p_.wake.take(p_.bed.ranks, p_.bed.scales.wake_up()), proposal_.take());
  const bool changes = p_.bed.ranks.any(c.any_here() || p_.grounding.lets_go());
  bool shell_changed = false;
  p_.grounding.let_go();
  if (changes || p_.bed.ranks.count > 1) p_.bed.index.index(p_.bed.atoms);
  if (changes) c.free_and_lock();
  if (p_.bed.scales.refills() && p_.bed.ranks.count > 1)  // over there they may have other sites, where the shell is not closed
    for (const std::int64_t tag : p_.handover.stored_elsewhere()) {
      p_.exchange.bring_back(tag);
      shell_changed = true;
    }
  close_shell(changes, shell_changed);  // before contacts thaw: what they are given to must be atoms
  refill(shell_changed);
  if (changes) {
    c.thaw_and_unlock();
    c.freeze_and_lock();
    p_.bed.groups.settle();
    c.finish_bodies();
    p_.bed.census.count_bodies();
    // parts that came off face each other now, or merged bodies have found other sites
    if (p_.bed.census.several_bodies() || p_.bed.scales.refills()) close_shell(true, shell_changed);
    refill(shell_changed);
  }
  store_and_fetch(c, changes, shell_changed);
  if (p_.bed.scales.refills() && p_.bed.ranks.any(shell_changed)) settle_bodies();  // granules stand elsewhere in them
  if (changes || p_.bed.ranks.any(shell_changed)) publish(c);
  follow_box();  // places of stored granules are rounded: the last digit of a border decides who owns what lies on it
  if (p_.handover.send_home()) count_restored();
  p_.lost.remember();
  fit_memory();
  p_.motion.is_stale();
  p_.motion.refresh();
  if (p_.bed.scales.rigid()) p_.motion.give_velocities();
  p_.motion.is_stale();  // what follows sorts the atoms
}

/// Invariant I1: what is near comes out of the store.
void Culling::close_shell(bool changes, bool& shell_changed) {
  const auto timed = p_.report.time(Part::shell);
  if (changes || p_.bed.census.something_stored()) p_.closure.share();
  if (p_.bed.census.something_stored()) shell_changed |= p_.closure.fetch_what_is_near() > 0;
}

/// What came out of a store that knows no places is packed; what it comes near to by that comes out, too.
void Culling::refill(bool& shell_changed) {
  if (!p_.bed.scales.refills()) return;
  while (p_.refill.pack()) close_shell(true, shell_changed);
}

/// And what nothing is near goes in.
void Culling::store_and_fetch(const MembershipChange& c, bool changes, bool& shell_changed) {
  if (changes || (p_.bed.scales.sleeping() && p_.bed.census.something_locked()))
    shell_changed |= p_.closure.store_what_is_deep(c.locked_some(), changes) > 0;
  if (p_.bed.scales.rigid() && p_.bed.census.something_stored()) shell_changed |= p_.closure.fetch_from_outside() > 0;
}

/// The engine and the report learn how many granules there are where.
void Culling::publish(const MembershipChange& c) {
  p_.bed.atoms.publish_counts(-p_.bed.census.count_stored());
  if (p_.bed.ranks.any(static_cast<double>(c.moved()) > sort_share * p_.bed.atoms.owned)) p_.bed.atoms.sort_soon();
  p_.report.membership_changed();
  p_.bed.label_bodies();
}

/// After granules came from a file or another rank.
void Culling::count_restored() {
  p_.bed.census.count_stored();
  p_.bed.census.count_bodies();
  p_.bed.label_bodies();
}

void Culling::fit_memory() {
  Memory& memory = p_.bed.memory;
  memory.freed(p_.bed.solid.fit());
  if (phase_ == Phase::beginning) return;  // walls keep pointers into the arrays over the setup of a run
  memory.fit_bins(p_.bed.solid.store().size() > 0);
  if (!memory.too_large()) return;
  const std::size_t before = p_.bed.shell.bytes() + p_.walls.rows().bytes() + p_.survey.rows().bytes() + p_.cover.rows().bytes();
  memory.fit();
  p_.motion.release_memory();
  p_.cover.release_memory();
  p_.closure.release_memory();
  p_.bed.groups.release_memory();
  p_.lost.release_memory();
  for (FollowsAtoms* f : p_.followers) f->fit(p_.bed.atoms.room);
  p_.bed.index.index(p_.bed.atoms);
  memory.freed(before);
}

std::int64_t Culling::restore_all() {
  if (p_.snapshot.waits())
    throw InputError("the granules that the restart file holds besides the atoms would be lost: put a run, or 'run 0', before " +
                     ("'unfix " + p_.bed.run.name + "'"));
  if (!p_.bed.solid.has_store()) return 0;
  const std::int64_t culled = p_.bed.census.locked();
  if (culled > 0) {
    p_.shown.shown() ? hide_bed() : leave_lists();
    p_.bed.ranks.update();
    if (p_.lost.forget_lost()) settle_bodies();
    p_.wake.ask_all();
    change();
    p_.shown.give_changes();
  }
  p_.bed.memory.give_bins_back();
  if (p_.bed.solid.store().size() != 0 || p_.bed.solid.locked() != 0 || p_.bed.solid.contacts().size() != 0)
    throw InternalError("a restore of everything left " + std::to_string(p_.bed.solid.store().size()) + " granules in the store");
  return culled;
}

}  // namespace solidcull
