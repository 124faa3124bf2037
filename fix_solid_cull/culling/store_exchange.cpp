#include "store_exchange.h"

namespace solidcull {

std::size_t StoreExchange::begin_change() {
  if (stored_at_ == never || stored_at_ == ports_.run.step) return 0;
  const std::size_t before = solid_.store().memory_bytes();
  solid_.forget_transient();
  stored_at_ = never;
  return before - solid_.store().memory_bytes();
}

int StoreExchange::bring_back(std::int64_t tag) {
  std::vector<double> record;
  const bool still_there = solid_.store().transient_known(tag);  // put away in this very step: nothing has moved
  const StoredGranule g = solid_.bring_back(tag, record);
  Atoms& atoms = ports_.atoms;
  const int i = atoms.put_back(record, g.layout);
  const std::int64_t now = ports_.run.step;
  shell_.came_back(atoms, i, g, g.lock_step == locked_as_it_was_stored && still_there ? now : g.lock_step, now);
  walls_.came_back(i, g.walls);
  const SolidBody& body = solid_.bodies().body(g.body);
  const Vec3 x = body.pose.to_world(g.position);
  if (!still_there) {
    const Vec3 near = scales_.image_by_place() ? Vec3(0.5 * (ports_.run.box.lo + ports_.run.box.hi)) : atoms.place(i);
    atoms.set_place(i, solid_.nearest_image(x, near));
  }
  atoms.set_velocity(i, body.twist.at(x));
  if (ports_.contacts.turn_granules) atoms.set_spin(i, body.twist.spin);
  cover_.came_back(i, x);
  index_.set(tag, i);
  if (scales_.refills()) came_back_.push_back(tag);
  return i;
}

void StoreExchange::relocate(int i, const Vec3& place) {
  const Locked& e = shell_[i];
  Atoms& atoms = ports_.atoms;
  const Vec3 by = solid_.bodies().pose(e.body).turned_to_world(place - e.place);
  solid_.count_refilled(-atoms.mass[i] * ports_.run.gravity().dot(by));
  solid_.relocate(e.body, {atoms.mass[i], e.place, atoms.radius[i], e.held}, place);
  shell_.stands(i, {e.body, place});
  atoms.set_place(i, atoms.place(i) + by);
}

void StoreExchange::put_away(int i) {
  const Locked& e = shell_[i];
  Atoms& atoms = ports_.atoms;
  const bool turns = ports_.contacts.turn_granules;
  atoms.set_velocity(i, e.velocity);
  if (turns) atoms.set_spin(i, e.spin);  // else it is its own, and goes on in the store
  stored_groups_ |= atoms.groups[i];
  ports_.contacts.clear_histories(i);
  if (scales_.image_by_place()) atoms.wrap(i);  // the box and the place tell which image: no word is kept for it
  std::vector<double> record;
  StoredGranule g;
  atoms.pack(i, record, g.layout);
  g.position = e.place;
  g.body = e.body;
  g.radius = atoms.radius[i];
  g.mass = atoms.mass[i];
  g.tag = atoms.tag[i];
  g.type = atoms.type[i];
  g.lock_step = e.lock_step;
  g.load_change = e.load_change;
  g.normal_load = e.normal_load;
  g.walls = walls_[i].touched;
  g.held = e.held;
  const std::int64_t now = ports_.run.step;
  if (scales_.image_by_place()) {
    g = solid_.as_stored(g);
    g.lock_step = e.lock_step == now && scales_.compact() ? locked_as_it_was_stored : locked_long_ago;
  }
  std::vector<WallLoad> loads;
  if (walls_[i].near && scales_.sleeping()) loads = grounding_.wall_loads_on(i);
  if (stored_at_ != now) {
    stored_at_ = now;
    const bool places = !ports_.run.any_periodic() || scales_.image_by_place();  // the place tells which image
    motion_words_ = atoms.motion_words(i, places, turns);
  }
  if (scales_.refills()) {
    for (const int word : motion_words_) record[static_cast<std::size_t>(word)] = 0;
    solid_.put_away(g, record, {}, loads);
  } else {
    solid_.put_away(g, record, motion_words_, loads);
  }
  index_.erase(g.tag);
  atoms.take_out(i);
  if (i < atoms.owned) index_.set(atoms.tag[i], i);
}

}  // namespace solidcull
