#include "bed.h"

namespace solidcull {

Bed::Bed(const Ports& engine, const Settings& settings, int types)
    : BedState(engine, settings),
      stored(*this),
      masses(*this),
      clump_spheres(*this),
      groups(*this, stored, masses),
      census(*this) {
  solid.set_types(types);
  solid.followed_by(*this);
}

void Bed::came_off(std::int64_t tag, int body, const Vec3& place) {
  const int i = index.at(tag);
  solid.tell_granule(shell[i].body, {shell[i].place, atoms.radius[i]});
  locked_clumps.shift(tag, place - shell[i].place);
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
      locked_clumps.reframe(atoms.tag[i], from, to);
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
  g.mass = e.clump ? 0 : atoms.mass[i];
  g.clump = e.clump;
  g.spheres = e.spheres;
  if (const Clump* const c = e.clump ? locked_clumps.find(g.tag) : nullptr) {
    g.has_clump = true;
    g.mass = c->mass;
    g.of_clump = c->lies;
  }
  g.held = e.held;
  g.lock_step = e.lock_step;
  g.normal_load = e.normal_load;
  g.load_change = e.load_change;
  return g;
}

void Bed::leaves_rank(int i) {
  locked_clumps.to_world(atoms.tag[i], solid.bodies().pose(shell[i].body));
  shell.leaves_rank(i);
}

void Bed::arrives(int i, const SolidBodies::Place& at) {
  shell.arrives(i, at);
  const Pose& pose = solid.bodies().pose(at.body);
  if (const Clump* const c = shell[i].clump ? locked_clumps.find(atoms.tag[i]) : nullptr) {
    locked_clumps.shift(atoms.tag[i], solid.nearest_image(c->lies.centre, pose.to_world(at.position)) - c->lies.centre);
    locked_clumps.to_frame(atoms.tag[i], pose);
  }
}

void Bed::send_far() {
  if (clumps.possible) clumps.send_far(ranks);
  atoms.send_far();
}

void Bed::see_largest_radius() {
  double all[2] = {largest_radius_here(*this), clumps.largest()};
  ranks.largest(all, 2);
  largest_radius = all[0];
  largest_clump = all[1];
}

Wakes Bed::take_wakes(Woke all) {
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
