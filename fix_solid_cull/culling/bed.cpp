#include "bed.h"

#include <utility>

namespace solidcull {

Bed::Bed(const Ports& engine, const Settings& settings, int types)
    : BedState(engine, settings), stored(*this), masses(*this), groups(*this, stored, masses), census(*this) {
  solid.set_types(types);
}

void Bed::split_bodies() {
  solid.split(masses.by_tag(), [&](std::int64_t tag, int body, const Vec3& place) {
    const int i = index.at(tag);
    solid.stands(shell[i].body, {shell[i].place, atoms.radius[i]});
    shell.stands(i, {body, place});
  });
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
    solid.stands(body, {shell[i].place, atoms.radius[i]});
  }
  Arrivals moved;
  arrivals.for_each([&](std::int64_t tag, Arrival a) {
    const int body = bodies.body_of(tag);
    const Pose &from = bodies.pose(a.at.body), &to = bodies.pose(body);
    if (from != to) a.at.position = to.to_frame(from.to_world(a.at.position));
    if (a.at.body != body) solid.stands(body, {a.at.position, a.radius});
    a.at.body = body;
    moved[tag] = a;
  });
  arrivals = std::move(moved);
  solid.adopt_swallowed();
}

void Bed::label_bodies() {
  for (int i = 0; i < atoms.owned; ++i) shell.label(i, shell[i].locked ? groups.key_of(shell[i].body) : 0);
}

}  // namespace solidcull
