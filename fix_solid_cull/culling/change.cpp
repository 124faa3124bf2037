#include "change.h"

#include <algorithm>
#include <cstdint>
#include <string>
#include <utility>

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
  if (bed_.ranks.subdomains_changed()) take_subdomains();
}

/// After all that ranks do together by the old ones: what is another rank's now goes there as this change ends, atoms with the
/// engine's exchange.
void Change::move_cuts() {
  if (p_.balance.move()) take_subdomains();
}

void Change::take_subdomains() {
  bed_.ranks.update();
  p_.handover.forget_homes();
}

/// What came out of a store that lags behind, or a deck has moved.
bool Change::any_far_out() const {
  if (bed_.ranks.count == 1) return false;
  if (p_.refill.acts()) return true;  // granules get their places as they come out
  const Atoms& atoms = bed_.atoms;
  for (int i = 0; i < atoms.owned; ++i)
    if (bed_.ranks.is_far_out(atoms.place(i))) return true;
  bool far = false;
  bed_.solid.store().for_each_frame([&](int frame, const Vec3& lo, const Vec3& hi) {
    if (far) return;
    const Pose& pose = bed_.solid.pose_of_frame(frame);
    const Vec3 middle = pose.to_world(0.5 * (lo + hi)), half = turned_half_box(pose.turn(), 0.5 * (hi - lo));
    // a place is as far out as its farthest coordinate: two corners tell for the box
    if (!bed_.ranks.is_far_out(middle - half) && !bed_.ranks.is_far_out(middle + half)) return;
    bed_.solid.store().for_each_in_box(frame, lo, hi,
                                       [&](const Resident& g) { far = far || bed_.ranks.is_far_out(bed_.solid.in_world(g)); });
  });
  return far;
}

/// For the engine's exchange, which looks one rank far.
bool Change::any_lost_on_the_way() const {
  if (bed_.ranks.count == 1) return false;
  for (int i = 0; i < bed_.atoms.owned; ++i)
    if (!bed_.ranks.brings_home(bed_.atoms.place(i))) return true;
  for (int k = 0; k < bed_.clumps.count(); ++k)
    if (!bed_.ranks.brings_home(bed_.clumps.centre(k))) return true;
  return false;
}

void Change::send_far() {
  if (std::exchange(some_far_, false)) bed_.send_far();
}

auto Change::begin(const Look& look) -> Occasion {
  std::int64_t highest = 0;
  for (int i = 0; i < bed_.atoms.owned; ++i) highest = std::max<std::int64_t>(highest, bed_.atoms.tag[i]);
  enum { asked, wakes_all, lets_go, asks_to_store, made, far, unsettled, tag, radius, clump, numbers };
  double all[numbers] = {};
  all[asked] = look.chosen().any_here() || bed_.wake.any_here();
  all[wakes_all] = static_cast<double>(bed_.wake.asks_all());
  all[lets_go] = p_.grounding.lets_go();
  all[asks_to_store] = p_.deep.asked();
  all[made] = p_.closure.some_made();
  all[far] = any_far_out();
  all[unsettled] = unsettled_;
  all[tag] = static_cast<double>(highest);
  all[radius] = largest_radius_here(bed_);
  all[clump] = bed_.clumps.largest();
  bed_.ranks.largest(all, numbers);
  bed_.largest_radius = all[radius];
  bed_.largest_clump = all[clump];
  bed_.ranks.expect_far_out(all[far] != 0);
  if (all[unsettled] != 0) settle_bodies();
  Occasion now;
  now.asked = all[asked] != 0;
  now.wakes_all = static_cast<Woke>(all[wakes_all]);
  now.lets_go = all[lets_go] != 0;
  now.asks_to_store = all[asks_to_store] != 0;
  now.made = all[made] != 0;
  now.highest = static_cast<std::int64_t>(all[tag]);
  return now;
}

auto Change::see(bool shell_changed, const MembershipChange& c) -> Outcome {
  enum { changed, leave, sorts, map, far, bodies, locked, stored, atoms, clumps, numbers };
  std::int64_t all[numbers] = {};
  all[changed] = shell_changed;
  all[leave] = p_.handover.find_leaving(p_.deep.take_away_from_home());
  all[sorts] = static_cast<double>(c.moved()) > sort_share * bed_.atoms.owned;
  all[map] = bed_.atoms.map_is_too_small();
  all[far] = any_lost_on_the_way();
  all[bodies] = static_cast<std::int64_t>(bed_.solid.bodies().size());
  all[locked] = static_cast<std::int64_t>(bed_.solid.locked());
  all[stored] = static_cast<std::int64_t>(bed_.solid.store().size());
  all[atoms] = bed_.atoms.owned;
  all[clumps] = bed_.clumps.count();
  bed_.ranks.sum(all, numbers);
  if (bed_.clumps.possible) bed_.clumps.publish_count(all[clumps]);
  return {all[changed] != 0, all[leave] != 0, all[sorts] != 0, all[map] != 0, all[far] != 0,
          all[bodies],       all[locked],     all[stored],     all[atoms]};
}

void Change::make(Look& look, Phase phase) {
  check_numbers(bed_.atoms);  // before they are sorted into cells, here and by the engine
  if (!bed_.solid.has_store()) return;
  const auto timed = p_.report.time(Part::membership);
  follow_box();
  // another fix may have deleted granules in this hook
  if (phase == Phase::stepping && bed_.census.something_locked()) forget_lost();
  if (bed_.clumps.possible && bed_.census.something_locked()) wake_counted_clumps();
  const Occasion now = begin(look);
  const bool overlaps = now.made && meet_new_granules(phase);
  bed_.memory.freed(p_.exchange.forget_past_motions());
  if (!bed_.census.something_locked() && !now.asked && now.wakes_all == Woke::never) {
    move_cuts();
    return;
  }
  if (phase == Phase::stepping) bed_.memory.make_room(look.chosen().chosen.size());
  p_.refill.begin_change();
  Wakes wakes = bed_.take_wakes(now.wakes_all);
  p_.audit.see_wakes(wakes);
  MembershipChange c(bed_, p_.for_change(), std::move(wakes), look.take());
  const bool changes = now.changes() || overlaps;
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
  store_and_fetch(c, now, changes, shell_changed);
  if (p_.refill.acts() && bed_.ranks.any(shell_changed)) settle_bodies();  // granules stand elsewhere in them
  follow_box();  // places of stored granules are rounded: the last digit of a border decides who owns what lies on it
  move_cuts();
  const Outcome all = see(shell_changed, c);
  some_far_ = all.some_far;
  const std::int64_t went = bed_.census.set(all.bodies, all.locked, all.stored);
  if (changes || all.shell_changed) {
    bed_.atoms.publish_counts(-went, all.atoms, all.map_too_small);
    if (all.sorts) bed_.atoms.sort_soon();
    p_.report.membership_changed();
    bed_.label_bodies();
  }
  if (all.some_leave) {
    p_.handover.send_home();
    bed_.label_bodies();
  }
  p_.handover.remember();
  fit_memory(phase);
  p_.motion.refresh();
  p_.motion.give_velocities();
}

/// Fixes that insert, or count what passes, count clumps where the engine moves them, and spheres else.
void Change::wake_counted_clumps() {
  for (const Box& box : p_.closure.opened(bed_.run.skin)) {
    for (int i = 0; i < bed_.atoms.owned; ++i)
      if (bed_.shell[i].locked && bed_.shell[i].clump && box.holds(bed_.atoms.place(i)))
        bed_.wake.ask(bed_.atoms.place(i), 0.5 * bed_.atoms.radius[i], Woke::deck);
    bed_.stored.for_each_in_box(box.lo, box.hi, [&](const Resident& g) {
      const Vec3 x = bed_.solid.in_world(g);
      if (box.holds(x) && bed_.solid.store().get(g.tag).clump) bed_.wake.ask(x, 0.5 * g.radius, Woke::deck);
    });
  }
}

/// What was made inside a stored granule cannot stay. Stored ones come back for each fix that inserts, so nothing that LIGGGHTS
/// does is known to come here; but between runs a deck may make granules anywhere, and fixes need not look for overlap. What was
/// culled there wakes before the first force: a blow is shared by two. Before anything comes out of the store. Whether something
/// was.
bool Change::meet_new_granules(Phase phase) {
  bool overlaps = false;
  if (bed_.census.something_locked()) {
    const ShellClosure::Overlapped found = p_.closure.by_new_granules();
    if (found.in_stored && phase == Phase::stepping)
      throw InputError("granule " + std::to_string(found.in_stored) +
                       " was inserted into the place of a culled one: give the insertion a region above the bed, or unfix " +
                       bed_.run.name + " first");
    for (const Vec3& place : found.places) bed_.wake.ask(place, bed_.scales.wake_up().radius(1), Woke::insertion);
    overlaps = found.some;
  }
  p_.closure.forget_new();
  return overlaps;
}

/// Whether interface granules may go to the store though nothing else changes.
bool Change::stores_asleep() const { return bed_.scales.sleeping() && bed_.census.something_locked(); }

/// Invariant I1: what is near comes out of the store.
void Change::close_shell(bool changes, bool& shell_changed) {
  const auto timed = p_.report.time(Part::shell);
  // what goes to the store asks for them, too, be it the first that does
  if (changes || bed_.census.something_stored() || stores_asleep()) p_.closure.share();
  if (bed_.census.something_stored()) shell_changed |= p_.closure.fetch_what_is_near() > 0;
}

/// What came out of a store that knows no places is packed; what it comes near to by that comes out, too.
void Change::pack(bool& shell_changed) {
  while (p_.refill.pack()) close_shell(true, shell_changed);
}

/// And what nothing is near goes in.
void Change::store_and_fetch(const MembershipChange& c, const Occasion& now, bool changes, bool& shell_changed) {
  if (changes || stores_asleep())
    shell_changed |= p_.deep.store({c.locked_some(), now.asks_to_store, changes, now.highest},
                                   [&](const std::vector<int>& atoms, const DeepGranules::Near& near) {
                                     return p_.refill.acts() ? p_.refill.put_away(atoms, near) : p_.exchange.put_away(atoms);
                                   }) > 0;
  if (bed_.census.something_stored()) shell_changed |= p_.closure.fetch_from_outside() > 0;
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
  if (!p_.handover.forget_lost()) return;
  if (bed_.ranks.count == 1) {
    settle_bodies();
    return;
  }
  unsettled_ = true;
  bed_.groups.settle_those_here();
  bed_.label_bodies();
}

void Change::settle_bodies() {
  unsettled_ = false;
  bed_.index.index(bed_.atoms);
  bed_.groups.settle();
  bed_.census.count_bodies();
  bed_.label_bodies();
}

}  // namespace solidcull
