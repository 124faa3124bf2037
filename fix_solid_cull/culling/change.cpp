#include "change.h"

#include <cstdint>
#include <string>

#include "input_error.h"
#include "numbers.h"

namespace solidcull {
namespace {

// after this share of the atoms came or went, the engine sorts its arrays at once
constexpr double sort_share = 0.05;

}  // namespace

/// Who leaves for another rank must be known before the engine sends it.
void Change::follow_box() {
  bed_.ranks.follow_box();
  if (!bed_.ranks.any(bed_.ranks.subdomain_changed())) return;
  bed_.ranks.update();
  p_.handover.forget_homes();
}

void Change::make(Look& look, Phase phase) {
  check_numbers(bed_.atoms);  // before they are sorted into cells, here and by the engine
  if (!bed_.solid.has_store()) return;
  const auto timed = p_.report.time(Part::membership);
  meet_new_granules(phase);
  follow_box();
  // another fix may have deleted granules in this hook
  if (phase == Phase::stepping && bed_.census.something_locked()) forget_lost();
  bed_.memory.freed(p_.exchange.begin_change());
  if (!bed_.census.something_locked() && !bed_.ranks.any(look.chosen().any_here() || bed_.wake.any_at_all())) return;
  if (phase == Phase::stepping) bed_.memory.make_room(look.chosen().chosen.size());
  p_.refill.begin_change();
  MembershipChange c(bed_, p_.for_change(), bed_.wake.take(bed_.ranks, bed_.scales.wake_up()), look.take());
  const bool changes = bed_.ranks.any(c.any_here() || p_.grounding.lets_go());
  bool shell_changed = false;
  p_.grounding.let_go();
  if (changes || bed_.ranks.count > 1) bed_.index.index(bed_.atoms);
  if (changes) c.free_and_lock();
  if (p_.refill.acts() && bed_.ranks.count > 1) shell_changed = p_.refill.fetch(p_.handover.stored_elsewhere());
  close_shell(changes, shell_changed);  // before contacts thaw: what they are given to must be atoms
  pack(shell_changed);
  if (changes) {
    c.change_bodies();
    p_.refill.note_freed(c.freed_anywhere());
    // parts that came off face each other now, or merged bodies have found other sites
    if (bed_.census.several_bodies() || p_.refill.acts()) close_shell(true, shell_changed);
    pack(shell_changed);
  }
  store_and_fetch(c, changes, shell_changed);
  if (p_.refill.acts() && bed_.ranks.any(shell_changed)) settle_bodies();  // granules stand elsewhere in them
  if (changes || bed_.ranks.any(shell_changed)) publish(c);
  follow_box();  // places of stored granules are rounded: the last digit of a border decides who owns what lies on it
  if (p_.handover.send_home()) count_restored();
  p_.handover.remember();
  fit_memory(phase);
  p_.motion.refresh();
  p_.motion.give_velocities();
}

/// What was made inside a stored granule cannot stay. Stored ones come back for each fix that inserts, so nothing that LIGGGHTS
/// does is known to come here; but between runs a deck may make granules anywhere, and fixes need not look for overlap. What was
/// culled there wakes before the first force: a blow is shared by two. Before anything comes out of the store.
void Change::meet_new_granules(Phase phase) {
  if (bed_.census.something_locked()) {
    const ShellClosure::Overlapped found = p_.closure.by_new_granules();
    if (found.in_stored && phase == Phase::stepping)
      throw InputError("granule " + std::to_string(found.in_stored) +
                       " was inserted into the place of a culled one: give the insertion a region above the bed, or unfix " +
                       bed_.run.name + " first");
    for (const Vec3& place : found.places) bed_.wake.ask(place, bed_.scales.wake_up().radius(1));
  }
  p_.closure.forget_new();
}

/// Invariant I1: what is near comes out of the store.
void Change::close_shell(bool changes, bool& shell_changed) {
  const auto timed = p_.report.time(Part::shell);
  if (changes || bed_.census.something_stored()) p_.closure.share();
  if (bed_.census.something_stored()) shell_changed |= p_.closure.fetch_what_is_near() > 0;
}

/// What came out of a store that knows no places is packed; what it comes near to by that comes out, too.
void Change::pack(bool& shell_changed) {
  while (p_.refill.pack()) close_shell(true, shell_changed);
}

/// And what nothing is near goes in.
void Change::store_and_fetch(const MembershipChange& c, bool changes, bool& shell_changed) {
  if (changes || (bed_.scales.sleeping() && bed_.census.something_locked()))
    shell_changed |= p_.deep.store(c.locked_some(), changes, [&](const std::vector<int>& atoms, const DeepGranules::Near& near) {
      return p_.refill.acts() ? p_.refill.put_away(atoms, near) : p_.exchange.put_away(atoms);
    }) > 0;
  if (bed_.census.something_stored()) shell_changed |= p_.closure.fetch_from_outside() > 0;
}

/// The engine and the report learn how many granules there are where.
void Change::publish(const MembershipChange& c) {
  bed_.atoms.publish_counts(-bed_.census.count_stored());
  if (bed_.ranks.any(static_cast<double>(c.moved()) > sort_share * bed_.atoms.owned)) bed_.atoms.sort_soon();
  p_.report.membership_changed();
  bed_.label_bodies();
}

void Change::count_restored() {
  bed_.census.count_stored();
  bed_.census.count_bodies();
  bed_.label_bodies();
}

void Change::fit_memory(Phase phase) {
  Memory& memory = bed_.memory;
  memory.freed(bed_.solid.fit());
  if (phase == Phase::beginning) return;  // walls keep pointers into the arrays over the setup of a run
  memory.fit_bins(bed_.solid.store().size() > 0);
  if (!memory.too_large()) return;
  const std::size_t before = bed_.shell.bytes() + p_.walls.rows().bytes() + p_.survey.rows().bytes() + p_.cover.rows().bytes();
  memory.fit();
  p_.motion.release_memory();
  p_.cover.release_memory();
  p_.closure.release_memory();
  bed_.groups.release_memory();
  p_.handover.release_memory();
  for (FollowsAtoms* f : p_.followers) f->fit(bed_.atoms.room);
  bed_.index.index(bed_.atoms);
  memory.freed(before);
}

void Change::take_arrivals() {
  p_.handover.take_over();
  forget_lost();
  bed_.groups.share();
}

void Change::forget_lost() {
  if (p_.handover.forget_lost()) settle_bodies();
}

void Change::settle_bodies() {
  bed_.groups.settle();
  bed_.census.count_bodies();
  bed_.label_bodies();
}

}  // namespace solidcull
