#include "bed.h"

namespace solidcull {

Bed::Bed(const Ports& engine, const Settings& settings, int types)
    : BedState(engine, settings), stored(*this), masses(*this), groups(*this, stored, masses), census(*this) {
  solid.set_types(types);
  solid.followed_by(*this);
}

void Bed::came_off(std::int64_t tag, int body, const Vec3& place) {
  const int i = index.at(tag);
  solid.tell_granule(shell[i].body, {shell[i].place, atoms.radius[i]});
  shell.set_place(i, {body, place});
}

void Bed::adopt_places() {
  const SolidBodies& bodies = solid.bodies();
  for (int i = 0; i < atoms.owned; ++i) {
    if (!shell[i].locked || shell[i].body == Locked::arriving) continue;
    const int before = shell[i].body, body = bodies.body_of(atoms.tag[i]);
    if (before == body) continue;
    const Pose &from = bodies.pose(before), &to = bodies.pose(body);
    if (from != to) {
      shell.reframe(i, from, to);
      solid.turn_contacts(atoms.tag[i], to.turn().transpose() * from.turn());
    }
    shell.set_body(i, body);
    solid.tell_granule(body, {shell[i].place, atoms.radius[i]});
  }
  arrivals.adopt_places(solid);
  solid.adopt_swallowed();
}

StoredGranule Bed::interface_granule(int i) const {
  const Locked& e = shell[i];
  StoredGranule g;
  g.tag = atoms.tag[i];
  g.type = atoms.type[i];
  g.body = e.body;
  g.position = e.place;
  g.radius = atoms.radius[i];
  g.mass = atoms.mass[i];
  g.held = e.held;
  g.lock_step = e.lock_step;
  g.normal_load = e.normal_load;
  g.load_change = e.load_change;
  return g;
}

void Bed::see_largest_radius() {
  largest_radius = largest_radius_here(*this);
  ranks.largest(&largest_radius, 1);
}

Wakes Bed::take_wakes(bool all) {
  // a body that wakes on one rank wakes on each
  std::vector<char> asked;
  for (std::size_t p = 0; p < groups.spanning_parts(); ++p) asked.push_back(wake.asks_body(groups.body_of_part(p)));
  groups.unite(asked, [](char& whole, char other) { whole |= other; });
  for (std::size_t p = 0; p < asked.size(); ++p)
    if (asked[p]) wake.ask_body(groups.body_of_part(p));
  // atoms may be a skin outside of their subdomain; what rests beside a ball is asked for within a diameter of it
  const double margin = contact_reach(*this) + stored.slack() + scales.diameter();
  return wake.take(ranks, scales.wake_up(), all, margin);
}

void Bed::label_bodies() {
  for (int i = 0; i < atoms.owned; ++i) shell.label(i, shell[i].locked ? groups.key_of(shell[i].body) : 0);
}

}  // namespace solidcull
