#include "store_exchange.h"

namespace solidcull {
namespace {

// so many granules go to the store before the engine's arrays are cut, which would hold them and the store else
constexpr std::size_t rows_at_once = 100000;

}  // namespace

std::size_t StoreExchange::forget_past_motions() {
  if (stored_at_ == never || stored_at_ == bed_.run.step) return 0;
  const std::size_t before = bed_.solid.store().memory_bytes();
  bed_.solid.forget_transient();
  stored_at_ = never;
  return before - bed_.solid.store().memory_bytes();
}

/// What the engine keeps of a clump stands behind the record of the sphere that has its mass: motion first.
void StoreExchange::add_clump(const Clump& c, std::vector<double>& record) {
  for (const Vec3& v : {c.velocity, c.angular_momentum}) record.insert(record.end(), v.data(), v.data() + 3);
  record.insert(record.end(), c.rest.begin(), c.rest.end());
  record.push_back(static_cast<double>(c.rest.size()));
}

Clump StoreExchange::clump_of(const std::vector<double>& record, const StoredGranule& g) {
  Clump c;
  c.number = g.clump;
  c.spheres = g.spheres;
  c.mass = g.mass;
  c.lies = g.of_clump;
  const std::size_t rest = static_cast<std::size_t>(record.back());
  const double* const at = record.data() + record.size() - numbers_of_clump(record);
  c.velocity = vec(at);
  c.angular_momentum = vec(at + 3);
  c.rest.assign(at + clump_motion, at + clump_motion + rest);
  return c;
}

int StoreExchange::bring_back(std::int64_t tag) {
  std::vector<double> record;
  const bool still_there = bed_.solid.store().transient_known(tag);  // put away in this very step: nothing has moved
  const StoredGranule g = bed_.solid.bring_back(tag, record);
  if (g.has_clump) bed_.locked_clumps.put(tag, clump_of(record, g));
  Atoms& atoms = bed_.atoms;
  const int i = atoms.put_back(record, g.layout);
  const std::int64_t now = bed_.run.step;
  bed_.shell.came_back(atoms, i, g, g.lock_step == locked_as_it_was_stored && still_there ? now : g.lock_step, now);
  const SolidBody& body = bed_.solid.bodies().body(g.body);
  const Vec3 x = body.pose.to_world(g.position);
  if (!still_there) {
    const Vec3 near = bed_.scales.image_by_place() ? Vec3(0.5 * (bed_.run.box.lo + bed_.run.box.hi)) : atoms.place(i);
    atoms.set_place(i, bed_.solid.nearest_image(x, near));
  }
  atoms.set_velocity(i, body.twist.at(x));
  if (bed_.contacts.turn_granules) atoms.set_spin(i, body.twist.spin);
  for (StoreFollower* f : followers_) f->came_back(i, g, x);
  bed_.index.set(tag, i);
  return i;
}

void StoreExchange::join_images(const std::vector<std::int64_t>& tags) const {
  if (!bed_.run.any_periodic()) return;
  FlatMap<int> first;
  for (const std::int64_t tag : tags)
    if (bed_.locked_clumps.find(tag)) first[bed_.shell[bed_.index.at(tag)].clump] = bed_.index.at(tag);
  for (const std::int64_t tag : tags) {
    const int i = bed_.index.at(tag);
    if (const int* to = first.find(bed_.shell[i].clump)) bed_.clumps.join_image(i, *to);
  }
}

void StoreExchange::put_away(int i) {
  const Locked& e = bed_.shell[i];
  Atoms& atoms = bed_.atoms;
  const bool turns = bed_.contacts.turn_granules;
  atoms.set_velocity(i, e.velocity);
  if (turns) atoms.set_spin(i, e.spin);  // else it is its own, and goes on in the store
  stored_groups_ |= atoms.groups[i];
  bed_.contacts.clear_histories(i);
  if (bed_.scales.image_by_place()) atoms.wrap(i);  // the box and the place tell which image: no word is kept for it
  std::vector<double> record;
  StoredGranule g = bed_.interface_granule(i);
  atoms.pack(i, record, g.layout);
  const std::size_t of_sphere = record.size();
  if (g.has_clump) add_clump(bed_.locked_clumps.take(g.tag), record);
  std::vector<WallLoad> loads;
  for (StoreFollower* f : followers_) f->goes(i, g.walls, loads);
  const std::int64_t now = bed_.run.step;
  if (bed_.scales.image_by_place()) {
    g = bed_.solid.as_stored(g);
    g.lock_step = e.lock_step == now && bed_.scales.compact() ? locked_as_it_was_stored : locked_long_ago;
  }
  if (stored_at_ != now) {
    stored_at_ = now;
    const bool places = !bed_.run.any_periodic() || bed_.scales.image_by_place();  // the place tells which image
    motion_words_ = atoms.motion_words(i, places, turns);
  }
  std::vector<int> transient = motion_words_;
  for (std::size_t k = of_sphere; g.has_clump && k < of_sphere + clump_motion; ++k) transient.push_back(static_cast<int>(k));
  if (bed_.scales.refills()) {
    for (const int word : motion_words_) record[static_cast<std::size_t>(word)] = 0;
    bed_.solid.put_away(g, record, {}, loads);
  } else {
    bed_.solid.put_away(g, record, transient, loads);
  }
  bed_.index.erase(g.tag);
  atoms.take_out(i);
  if (i < atoms.owned) bed_.index.set(atoms.tag[i], i);
}

std::size_t StoreExchange::put_away(const std::vector<int>& atoms) {
  bed_.solid.expects(atoms.size());
  const int left = bed_.atoms.owned - static_cast<int>(atoms.size());
  for (std::size_t k = 0; k < atoms.size(); ++k) {
    put_away(atoms[k]);
    if ((k + 1) % rows_at_once == 0) bed_.memory.give_rows_back(left);
  }
  return atoms.size();
}

}  // namespace solidcull
