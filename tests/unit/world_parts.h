// All parts of the culling on one rank of a small world, each open to questions.
#pragma once

#include <utility>
#include <vector>

#include "culling_parts.h"
#include "small_world.h"

namespace solidcull {

/// Settings of `exterior live`, with its cover of two diameters.
inline Settings living_settings() {
  Settings s;
  s.exterior = Exterior::live;
  s.depth = 2.0;
  return s;
}
/// Settings of `exterior sleep` with no cover, as most tests of decisions want them: the surface costs more than the rest.
inline Settings sleeping_settings() {
  Settings s;
  s.exterior = Exterior::sleep;
  s.depth = 0;
  return s;
}

struct WorldParts : CullingParts {
  /// d: mean diameter of the granules (m).
  WorldParts(SmallWorld& small_world, const Settings& settings, double d)
      : CullingParts(small_world.ports(), settings, 1), world(small_world) {
    world.atoms.followers = followers;
    for (FollowsAtoms* f : followers) f->grow(world.atoms.room);
    for (FollowsAtoms* f : followers)
      for (int i = 0; i < world.atoms.owned; ++i) f->reset(i);
    world.on_arrival = [this](int i) { bed.shell.mark_arriving(i); };
    bed.solid.set_histories(bed.contacts.flips(), bed.contacts.vectors());
    Vec3 periods = world.run.edges();
    for (int k = 0; k < 3; ++k)
      if (!world.run.periodic[static_cast<std::size_t>(k)]) periods[k] = 0;
    bed.solid.set_periods(periods);
    const double g = world.deck.gravity.norm();
    bed.scales.set(d, g > 0 ? g : Scales::standard_gravity);
    bed.scales.make_laws(world.run.dt);
    bed.solid.open_store();
    bed.solid.pack_contacts_from(0);
  }

  /// The first half of a membership change: nothing goes to the store or comes out by the shell's closure. Collective.
  void change(Wakes wakes, Proposal proposal) {
    bed.see_largest_radius();
    exchange.forget_past_motions();
    MembershipChange c(bed, for_change(), std::move(wakes), std::move(proposal));
    bed.index.index(world.atoms);
    c.free_and_lock();
    c.change_bodies();
    bed.census.count_bodies();
    bed.census.count_stored();
    bed.label_bodies();
    motion.begin_lists();
  }
  /// What is another rank's goes there; false if nothing is, on any rank. Collective.
  bool send_home() {
    const bool some = world.ranks.any(handover.find_leaving(deep.take_away_from_home()));
    if (some) handover.send_home();
    return some;
  }
  /// All that wakes. Collective.
  Wakes wakes() { return bed.take_wakes(world.any_woke(bed.wake.asks_all())); }
  /// Owned granules with these tags are locked; what of them touches is one body. Collective.
  void lock(const std::vector<std::int64_t>& tags) {
    Proposal p;
    for (const std::int64_t tag : tags)
      if (world.at(static_cast<int>(tag)) >= 0) {
        p.chosen.push_back(tag);
        const int i = world.at(static_cast<int>(tag));
        AtRest& r = survey.rows()[i];  // it has this motion since now
        r.velocity = world.atoms.velocity(i);
        r.acceleration_around = Vec3::Zero();
        r.since = world.run.step;
      }
    change({}, std::move(p));
  }
  /// This rank's atoms with these tags go to the store.
  void put_away(const std::vector<std::int64_t>& tags) {
    bed.index.index(world.atoms);
    for (const std::int64_t tag : tags)
      if (const int* i = bed.index.find(tag)) exchange.put_away(*i);
    motion.begin_lists();
  }
  /// Ghosts, lists and what ranks tell each other, as between a change and the next forces. Collective.
  void reneighbour() {
    bed.census.count_bodies();
    bed.census.count_stored();
    world.exchange();
    world.borders();
    handover.take_over();
    bed.groups.share();
    world.contacts.build();
    leave_out();
    motion.begin_lists();
    motion.refresh();
  }
  void leave_out() {
    std::vector<BodyGroups::Key> body;
    for (int i = 0; i < world.atoms.owned + world.atoms.ghosts; ++i) body.push_back(bed.groups.key_of_atom(i));
    world.contacts.leave_out_pairs_within(body);
  }
  void compute_forces() {
    world.compute_forces();
    motion.refresh();
    freezing.rebase_thawed();
    motion.take_loads();
  }
  int body_of(std::int64_t tag) const { return bed.solid.bodies().body_of(tag); }

  SmallWorld& world;
};

}  // namespace solidcull
