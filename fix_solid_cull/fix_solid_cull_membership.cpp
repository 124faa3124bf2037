// Exterior <-> interface <-> interior. All that changes the engine's atoms happens here, in pre_exchange or between runs.
#include <mpi.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <set>
#include <tuple>

#include "atom.h"
#include "comm.h"
#include "contacts_in_store.h"
#include "domain.h"
#include "engine_access.h"
#include "engine_vectors.h"
#include "fix_insert.h"
#include "fix_solid_cull.h"
#include "group.h"
#include "modify.h"
#include "neighbor.h"
#include "output.h"
#include "region.h"
#include "release.h"
#include "update.h"

namespace solidcull {
namespace {

// a shell granule goes to the store when nothing exterior is within this many skins; it is fetched at one skin (no flapping)
constexpr double store_gap_in_skins = 2.5;
// an exterior granule that nothing stored was so near to need not be looked at again until it has moved by this many skins: it
// may have gone as far the other way when the last went to the store, so twice this and one skin is the gap
constexpr double clear_way_in_skins = 0.75;
// so many moving frames are compared with a granule one by one, more as one box
constexpr std::size_t few_frames = 8;
// after this share of the atoms came or went, the engine sorts its arrays at once
constexpr double sort_share = 0.05;
// interface granules that nothing is near any more go to the store when they are this share of the atoms, or when more changes
constexpr double store_share = 0.05;
// they are looked for so often, and when something was locked
constexpr int builds_between_storing = 4;

// walls are looked at again when a body has moved by this many skins; what is nearer than that and a margin becomes an atom
constexpr double wall_check_in_skins = 0.25;
constexpr double wall_gap_in_skins = 1.5;

}  // namespace

Sphere FixSolidCull::sphere(int i) const { return {vec(atom->x[i]), atom->radius[i]}; }

double FixSolidCull::contact_reach() const {
  double largest = 0;
  for (int i = 0; i < atom->nlocal; ++i) largest = std::max(largest, atom->radius[i]);
  if (store_) largest = std::max(largest, store_->largest_radius());
  double everywhere = 0;
  MPI_Allreduce(&largest, &everywhere, 1, MPI_DOUBLE, MPI_MAX, world);
  return 2 * everywhere + neighbor->skin;
}

GranuleMass FixSolidCull::mass_of(std::int64_t tag) const {
  const bool stored = store_->contains(tag);
  const int* i = stored ? nullptr : index_of_.find(tag);
  if (!stored && !i) {
    const Arrival& a = *arriving_.find(tag);
    const Pose &from = bodies_.pose(a.at.body), &to = bodies_.pose(bodies_.body_of(tag));
    return {a.mass, from == to ? a.at.position : to.to_frame(from.to_world(a.at.position)), a.radius, a.held};
  }
  GranuleMass m;
  int stands_in;
  if (stored) {
    const StoredGranule g = store_->get(tag);
    m = {g.mass, g.position, g.radius, g.held};
    stands_in = g.body;
  } else {
    m = {atom->rmass[*i], shell_[*i].place, atom->radius[*i], shell_[*i].held};
    stands_in = shell_[*i].body;
  }
  const int body = bodies_.body_of(tag);
  if (body && stands_in != body) {
    const Pose &from = bodies_.pose(stands_in), &to = bodies_.pose(body);
    if (from != to) m.position = to.to_frame(from.to_world(m.position));
  }
  return m;
}

MovingGranule FixSolidCull::moving(int i) const {
  const ShellEntry& e = shell_[i];
  // a granule that is locked has the motion that it had before
  const bool now = e.locked && e.lock_step == update->ntimestep;
  return {
      atom->rmass[i], atom->radius[i], vec(atom->x[i]), now ? e.velocity : vec(atom->v[i]), now ? e.spin : vec(atom->omega[i]),
      e.held};
}

std::vector<FixSolidCull::Ball> FixSolidCull::collect_balls() {
  std::vector<double> rows;
  for (const Ball& b : waking_) rows.insert(rows.end(), {b.centre[0], b.centre[1], b.centre[2], b.radius});
  waking_.clear();
  rows = halo_.gather_all(rows);
  std::vector<Ball> balls;
  for (std::size_t r = 0; r < rows.size(); r += 4) {
    ledger_.carved();
    for (const Vec3& shift : halo_.image_shifts()) balls.push_back({vec(&rows[r]) + shift, rows[r + 3]});
  }
  return balls;
}

bool FixSolidCull::in_ball(const Vec3& x, double margin) const {
  return std::any_of(balls_.begin(), balls_.end(), [&](const Ball& b) {
    const double reach = b.radius + margin;
    return (x - b.centre).squaredNorm() <= reach * reach;
  });
}

void FixSolidCull::index_atoms() {
  int highest = 0;
  for (int i = 0; i < atom->nlocal; ++i) highest = std::max(highest, atom->tag[i]);
  index_of_.begin(static_cast<std::size_t>(atom->nlocal), highest);
  for (int i = 0; i < atom->nlocal; ++i) index_of_.set(atom->tag[i], i);
}

void FixSolidCull::change_membership() {
  const auto timed = watch_.time(Part::membership);
  if (stored_at_ >= 0 && stored_at_ != update->ntimestep) {
    const std::size_t before = store_->memory_bytes();
    store_->forget_transient();
    memory_.trim(before - store_->memory_bytes());
    stored_at_ = -1;
  }
  balls_ = collect_balls();
  std::vector<double> keys(waking_bodies_.begin(), waking_bodies_.end());
  keys = halo_.gather_all(keys);
  freed_keys_.assign(keys.begin(), keys.end());
  waking_bodies_.clear();
  const bool all = any_rank(wake_all_);
  const bool change = any_rank(all || !balls_.empty() || !freed_keys_.empty() || !chosen_.empty() || !joins_.empty() ||
                               !lifting_.empty() || open_for_insertion_);
  for (const int body : lifting_)
    if (bodies_.bodies().count(body)) set_grounded(body, false);
  lifting_.clear();
  freed_.clear();
  locked_now_.clear();
  freed_anywhere_.clear();
  locked_anywhere_.clear();
  if (change || comm->nprocs > 1) {
    index_atoms();
  }
  if (change) {
    free_what_wakes(all);
    if (!all) lock_what_was_chosen();
    tell_neighbours();
  }
  // before contacts thaw: what they are given to must be atoms
  if (change || stored_everywhere_ > 0) share_exterior();
  if (stored_everywhere_ > 0) keep_shell_closed();
  if (change) {
    thaw_contacts();
    free_from_bodies();
    freeze_contacts();
    lock_into_bodies();
    adopt_places();
    settle_bodies();
    freeze_inner_contacts();
    freeze_histories();
    if (meshes_wanted_) {
      for (const int body : bodies_.split_parents()) meshes_.erase(body);  // made anew from what is left, as is what came off
      update_meshes();
    }
  }
  if (change) {
    count_bodies();
    if (store_bodies_ > 1) {  // parts that came off face each other now
      share_exterior();
      keep_shell_closed();
    }
  }
  if (change || (sleeping() && locked_everywhere_ > 0)) store_what_is_deep(change);
  if (rigid() && stored_everywhere_ > 0) fetch_from_outside();
  if (change || any_rank(shell_changed_)) publish_atom_counts();
  hand_over();
  locked_before_.clear();
  for (int i = 0; i < atom->nlocal; ++i)
    if (shell_[i].locked && shell_[i].body > 0)
      locked_before_.push_back({atom->tag[i], {atom->rmass[i], shell_[i].place, atom->radius[i], shell_[i].held}});
  shell_changed_ = false;
  wake_all_ = false;
  open_for_insertion_ = false;
  chosen_.clear();
  side_changes_.clear();
  touches_.clear();
  joins_.clear();
  const std::size_t before = contacts_.memory_bytes() + bodies_.member_bytes();
  contacts_.fit();
  bodies_.fit();
  memory_.trim(before - contacts_.memory_bytes() - bodies_.member_bytes());
  if (!new_run_) {  // walls keep pointers into the arrays over the setup of a run
    memory_.fit_bins(store_->size() > 0);
    if (memory_.too_large()) fit_memory();
  }
  locked_index_stale_ = true;
  refresh_locked();
  if (rigid()) give_velocities();
  locked_index_stale_ = true;  // what follows sorts the atoms
}

/// Unlocked granules leave their bodies, which may come apart.
void FixSolidCull::free_from_bodies() {
  std::map<std::pair<int, std::size_t>, Vec3>
      cuts;  // which ball took granules from which body, and its centre in the body's frame
  for (const std::int64_t tag : freed_) {
    const int body = bodies_.body_of(tag), i = *index_of_.find(tag);
    const Vec3 x = bodies_.body(body).pose.to_world(shell_[i].place);
    if (meshes_wanted_)
      for (std::size_t b = 0; b < balls_.size(); ++b)
        if ((x - balls_[b].centre).norm() <= balls_[b].radius)
          cuts.emplace(std::make_pair(body, b), bodies_.body(body).pose.to_frame(balls_[b].centre));
    // nothing has moved since it was locked: it goes on as if it had never been; else it starts from its body's motion
    const bool back = shell_[i].lock_step == update->ntimestep;
    const Twist twist = bodies_.body(body).twist;
    set(atom->v[i], back ? shell_[i].velocity : twist.at(x));
    set(atom->omega[i], back ? shell_[i].spin : twist.spin);
    MovingGranule given{atom->rmass[i], atom->radius[i], x, vec(atom->v[i]), vec(atom->omega[i])};
    const double before = kinetic_energy(body);
    bodies_.unlock(tag, mass_of(tag), contacts_, back && rigid() ? &given : nullptr);
    const double after =
        kinetic_energy(body) + RigidPart::granule(given.mass, given.radius, x, given.velocity, given.spin).kinetic_energy();
    ledger_.restored(after - before);
    contacts_.erase(tag);
  }
  freed_anywhere_.for_each([&](std::int64_t tag, char) { contacts_.erase(tag); });
  for (const auto& cut : cuts) {
    const auto mesh = meshes_.find(cut.first.first);
    if (mesh != meshes_.end()) mesh->second.carve({cut.second, balls_[cut.first.second].radius});
  }
  split_bodies();
  for (const std::int64_t tag : freed_) {
    ShellEntry& e = shell_[*index_of_.find(tag)];
    if (sleeping() && e.body && !bodies_.bodies().count(e.body)) forget_body(e.body);
    e.lock_step = -1;
    e.body = 0;
    e.held = false;
  }
}

void FixSolidCull::lock_into_bodies() {
  const auto mass = [&](std::int64_t tag) { return mass_of(tag); };
  const auto lock_one = [&](std::int64_t tag) {
    const int i = *index_of_.find(tag);
    MovingGranule granule = moving(i);
    if (!rigid()) granule.velocity = granule.spin = Vec3::Zero();  // its momentum goes to the ground
    const SolidBodies::Place at = bodies_.lock(tag, granule, contacts_, mass);
    shell_[i].body = at.body;
    shell_[i].place = at.position;
  };
  // from neighbour to neighbour, so that what hangs together becomes one body without many that merge
  FlatMap<char, std::int32_t> waits;
  waits.reserve(locked_now_.size());
  for (const std::int64_t tag : locked_now_) waits[static_cast<std::int32_t>(tag)] = 1;
  std::vector<std::int64_t> queue;
  for (const std::int64_t first : locked_now_) {
    if (!waits.erase(static_cast<std::int32_t>(first))) continue;
    queue.assign(1, first);
    for (std::size_t at = 0; at < queue.size(); ++at) {
      const std::int64_t tag = queue[at];
      lock_one(tag);
      contacts_.for_each_partner(tag, [&](std::int64_t partner) {
        if (waits.erase(static_cast<std::int32_t>(partner))) queue.push_back(partner);
      });
    }
  }
  for (std::size_t r = 0; r < joins_.size(); r += 5)
    bodies_.join(static_cast<std::int64_t>(joins_[r + 3]), static_cast<std::int64_t>(joins_[r + 4]), mass);
}

void FixSolidCull::lock(int i) {
  ShellEntry& e = shell_[i];
  e.locked = true;
  e.fresh = true;
  e.load_change = Vec3::Zero();
  e.excess = 0;
  e.calm = 0;
  e.waited = 0;
  e.held = sleeping() && e.stands;
  e.lock_step = update->ntimestep;
  e.velocity = vec(atom->v[i]);
  e.spin = vec(atom->omega[i]);
  if (!rigid()) {
    set(atom->v[i], Vec3::Zero());
    set(atom->omega[i], Vec3::Zero());
  }
  atom->mask[i] |= group->bitmask[interface_group_];
  ledger_.locked();
}

void FixSolidCull::unlock(int i) {
  ShellEntry& e = shell_[i];
  e.locked = false;
  e.fresh = false;
  e.clear_in = -1;
  e.excess = 0;
  e.calm = 0;
  e.waited = 0;
  e.normal_load = ShellEntry::not_known;
  atom->mask[i] &= ~group->bitmask[interface_group_];
  vector_atom[i] = 0;
}

void FixSolidCull::clear_map() {
  // before the first atom comes or goes: the map is cleared by the tags of the atoms that are there
  if (!atom->map_style || map_cleared_) return;
  atom->map_clear();
  map_cleared_ = true;
}

void FixSolidCull::make_store() {
  store_ = std::make_unique<GranuleStore>(2 * diameter_, compact() ? GranuleStore::Precision::rounded : GranuleStore::Precision::exact);
  bodies_.set_elsewhere([this](std::int64_t tag) { return store_->body_of(tag); });
  if (!compact()) return;
  contacts_.set_elsewhere(
      [this](std::int64_t tag, std::vector<std::int64_t>& partners) { contacts_in_store(*store_, bodies_, tag, partners); });
}

std::size_t FixSolidCull::locked_here() const { return bodies_.locked() + store_->size(); }

/// From a to the image of b that it touches, in the frame of their body.
Vec3 FixSolidCull::apart(const Resident& a, const Resident& b) const {
  const Vec3 there = b.position - a.position;
  if ((bodies_.periods().array() == 0).all()) return there;
  const Pose& pose = bodies_.pose(a.body);
  return pose.turned_to_frame(nearest_image(pose.turned_to_world(there), Vec3::Zero()));
}

/// That of a contact inside a compact store, as g sees it; false if it has none.
bool FixSolidCull::inner_history(const Resident& g, std::int64_t partner, double* history) const {
  const Resident other = *store_->find(partner);
  std::vector<std::uint64_t> tail;
  store_->tail(g.tag, tail);
  std::size_t at = packed_.find(tail, partner);
  if (at < tail.size()) {
    packed_.unpack(&tail[at], apart(g, other), history);
    return true;
  }
  store_->tail(partner, tail);
  at = packed_.find(tail, g.tag);
  if (at == tail.size()) return false;
  packed_.unpack(&tail[at], apart(other, g), history);
  contacts_.change_side(history);
  return true;
}

void FixSolidCull::turn_inner_histories(int body, const Eigen::Matrix3d& by) {
  std::vector<Resident> granules;
  store_->for_each_of_body(body, [&](const Resident& g) { granules.push_back(g); });
  std::vector<double> history(contacts_.width());
  std::vector<std::uint64_t> tail, turned;
  for (const Resident& g : granules) {
    store_->tail(g.tag, tail);
    if (tail.empty()) continue;
    turned.clear();
    contacts_.for_each_elsewhere(g.tag, [&](std::int64_t partner) {
      const std::size_t at = packed_.find(tail, partner);
      if (at == tail.size()) return;
      const Vec3 normal = apart(g, *store_->find(partner));
      packed_.unpack(&tail[at], normal, history.data());
      contacts_.turn(history.data(), by);
      packed_.pack(partner, history.data(), by * normal, turned);
    });
    store_->set_tail(g.tag, turned);
  }
}

/// The store says itself which body a granule is in; a compact one also what it touches there, and of the histories of those
/// contacts few bits are kept.
void FixSolidCull::entered_store(std::int64_t tag) {
  bodies_.leave(tag);
  if (!compact()) return;
  const Resident g = *store_->find(tag);
  std::vector<std::int64_t> partners;
  contacts_.for_each_partner(tag, [&](std::int64_t partner) { partners.push_back(partner); });
  std::vector<std::uint64_t> tail;
  contacts_.for_each(tag, [&](std::int64_t partner, const double* history) {
    if (!history || contacts_.width() == 0 || !store_->contains(partner)) return;
    if (std::any_of(partners.begin(), partners.end(),
                    [&](std::int64_t p) { return p != partner && PackedHistory::alike(p, partner); }))
      return;
    packed_.pack(partner, history, apart(g, *store_->find(partner)), tail);
  });
  if (!tail.empty()) store_->set_tail(tag, tail);
  contacts_.drop(tag, [&](std::int64_t partner) { return store_->contains(partner); });
}

void FixSolidCull::leaves_store(std::int64_t tag) {
  const Resident g = *store_->find(tag);
  bodies_.take_in(tag, g.body);
  if (!compact()) return;
  std::vector<double> history(contacts_.width());
  std::vector<std::uint64_t> tail;
  contacts_.for_each_elsewhere(tag, [&](std::int64_t partner) {
    contacts_.add(tag, partner, inner_history(g, partner, history.data()) ? history.data() : nullptr);
    store_->tail(partner, tail);
    const auto at = tail.begin() + static_cast<std::ptrdiff_t>(packed_.find(tail, tag));
    if (at == tail.end()) return;
    tail.erase(at, at + static_cast<std::ptrdiff_t>(packed_.words()));
    store_->set_tail(partner, tail);
  });
}

int FixSolidCull::bring_back(std::int64_t tag) {
  clear_map();
  leaves_store(tag);
  std::vector<double> record;
  const bool still_there = store_->transient_known(tag);  // put away in this very step
  const StoredGranule g = store_->take(tag, record);
  ledger_.returned(g);
  wall_loads_.erase(tag, g.body);
  const int i = records_.append(record, g.layout);
  ShellEntry& e = shell_[i];
  e = ShellEntry();
  e.locked = true;
  e.fresh = true;
  e.body = g.body;
  e.place = g.position;
  e.load_change = g.load_change;
  e.normal_load = g.normal_load;
  e.walls = g.walls;
  e.held = g.held;
  e.came_back = update->ntimestep;
  e.lock_step = g.lock_step == locked_as_it_was_stored && still_there ? update->ntimestep : g.lock_step;
  e.velocity = vec(atom->v[i]);
  e.spin = vec(atom->omega[i]);
  const SolidBody& body = bodies_.body(g.body);
  const Vec3 x = body.pose.to_world(g.position);
  if (!still_there)  // else nothing has moved
    set(atom->x[i], nearest_image(x, compact() ? Vec3(0.5 * (vec(domain->boxlo) + vec(domain->boxhi))) : vec(atom->x[i])));
  set(atom->v[i], body.twist.at(x));
  set(atom->omega[i], body.twist.spin);
  e.registered = true;  // the implicit surface does not care who holds a granule
  e.registered_at = observer_.to_frame(x);
  index_of_.set(tag, i);
  return i;
}

void FixSolidCull::put_away(int i) {
  clear_map();
  ShellEntry& e = shell_[i];
  set(atom->v[i], e.velocity);
  set(atom->omega[i], e.spin);
  histories_.clear(i);
  if (compact()) domain->remap(atom->x[i], atom->image[i]);  // the box and the place tell which image: no word is kept for it
  std::vector<double> record;
  StoredGranule g;
  records_.pack(i, record, g.layout);
  g.position = e.place;
  g.body = e.body;
  g.radius = atom->radius[i];
  g.mass = atom->rmass[i];
  g.tag = atom->tag[i];
  g.type = atom->type[i];
  g.lock_step = e.lock_step;
  g.load_change = e.load_change;
  g.normal_load = e.normal_load;
  g.walls = e.walls;
  g.held = e.held;
  if (compact()) {
    g = store_->rounded(g);
    bodies_.shift(g.body, {g.mass, e.place, g.radius, g.held}, g.position);  // else many small ways add up when they leave
    g.lock_step = e.lock_step == update->ntimestep ? locked_as_it_was_stored : locked_long_ago;
  }
  if (e.wall_near && sleeping()) wall_loads_.add(g.tag, g.body, wall_loads_on(i));
  if (stored_at_ != update->ntimestep) {
    stored_at_ = update->ntimestep;
    const bool periodic = domain->xperiodic || domain->yperiodic || domain->zperiodic;  // the place tells which image
    motion_words_ = records_.motion_words(i, !periodic || compact());
  }
  store_->add(g, record.data(), static_cast<int>(record.size()), motion_words_);
  entered_store(g.tag);
  ledger_.stored(g);
  double& largest = largest_radius_by_type_[g.type];
  largest = std::max(largest, g.radius);
  index_of_.erase(g.tag);
  records_.remove(i);
  if (i < atom->nlocal) index_of_.set(atom->tag[i], i);
}

void FixSolidCull::free_what_wakes(bool all) {
  if (!all && balls_.empty() && freed_keys_.empty()) return;
  std::set<int> whole;  // bodies of this rank that wake as a whole
  for (const auto& b : bodies_.bodies())
    if (all || std::find(freed_keys_.begin(), freed_keys_.end(), key_of(b.first)) != freed_keys_.end()) whole.insert(b.first);
  for (int i = 0; i < atom->nlocal; ++i)
    if (shell_[i].locked && (whole.count(shell_[i].body) || in_ball(vec(atom->x[i]), 0))) {
      unlock(i);
      freed_.push_back(atom->tag[i]);
    }
  std::vector<std::int64_t> stored;
  if (!whole.empty())
    for (const int body : whole) store_->for_each_of_body(body, [&](const Resident& g) { stored.push_back(g.tag); });
  for (const Ball& b : balls_)
    for_each_stored_in_box(b.centre - Vec3::Constant(b.radius), b.centre + Vec3::Constant(b.radius), [&](const Resident& g) {
      if (!whole.count(g.body) && (nearest_image(in_world(g), b.centre) - b.centre).squaredNorm() <= b.radius * b.radius)
        stored.push_back(g.tag);
    });
  std::sort(stored.begin(), stored.end());
  stored.erase(std::unique(stored.begin(), stored.end()), stored.end());
  for (const std::int64_t tag : stored) {
    unlock(bring_back(tag));
    freed_.push_back(tag);
  }
  for (const std::int64_t tag : freed_) freed_anywhere_[tag] = 1;
}

void FixSolidCull::lock_what_was_chosen() {
  for (const std::int64_t tag : chosen_) {
    const int* i = index_of_.find(tag);
    // since the look it may have left this rank or the simulation, or have been moved, or something wakes beside it
    if (!i || shell_[*i].locked || in_ball(vec(atom->x[*i]), diameter_)) continue;
    const ShellEntry& e = shell_[*i];
    const Vec3 v = vec(atom->v[*i]);
    const double passed = static_cast<double>(update->ntimestep - e.lock_step) * update->dt;
    if (!(rigid() ? solid_state_.went_on(v - e.velocity, e.reference, e.reference, passed)
                  : solid_state_.at_rest(v, vec(atom->omega[*i]), atom->radius[*i])))
      continue;
    lock(*i);
    locked_now_.push_back(tag);
    locked_anywhere_[tag] = 1;
  }
}

void FixSolidCull::tell_neighbours() {
  if (!halo_.needed()) return;
  std::vector<double> rows;
  const auto tell = [&](const std::vector<std::int64_t>& tags, double what) {
    for (const std::int64_t tag : tags) {
      const double* x = atom->x[*index_of_.find(tag)];
      rows.insert(rows.end(), {x[0], x[1], x[2], static_cast<double>(tag), what});
    }
  };
  tell(freed_, 0);
  tell(locked_now_, 1);
  const double reach = contact_reach();
  rows = halo_.exchange(rows, 5, reach);
  const std::vector<double> joins = halo_.exchange(joins_, 5, reach);
  joins_.insert(joins_.end(), joins.begin(), joins.end());
  for (std::size_t r = 0; r < rows.size(); r += 5)
    (rows[r + 4] == 0 ? freed_anywhere_ : locked_anywhere_)[static_cast<std::int64_t>(rows[r + 3])] = 1;
}

void FixSolidCull::count_bodies() {
  std::int64_t counts[2] = {static_cast<std::int64_t>(bodies_.size()), static_cast<std::int64_t>(locked_here())};
  MPI_Allreduce(MPI_IN_PLACE, counts, 2, MPI_INT64_T, MPI_SUM, world);
  store_bodies_ = static_cast<int>(counts[0]);
  locked_everywhere_ = counts[1];
}

void FixSolidCull::share_exterior() {
  halo_foreign_.clear();
  if (!halo_.needed()) return;
  std::vector<double> rows;
  for (int i = 0; i < atom->nlocal; ++i)
    if (!shell_[i].locked || store_bodies_ > 1)
      rows.insert(rows.end(), {atom->x[i][0], atom->x[i][1], atom->x[i][2], atom->radius[i], double(as_foreign(i).body),
                               double(as_foreign(i).stands)});
  rows = halo_.exchange(rows, 6, contact_reach() + store_gap_in_skins * neighbor->skin + store_slack());
  for (std::size_t r = 0; r < rows.size(); r += 6)
    halo_foreign_.push_back({{vec(&rows[r]), rows[r + 3]}, static_cast<int>(rows[r + 4]), rows[r + 5] != 0});
}

FixSolidCull::Foreign FixSolidCull::as_foreign(int i) const {
  const ShellEntry& e = shell_[i];
  const bool in_body = e.locked && e.body > 0;  // else it has just been chosen
  return {sphere(i), in_body ? key_of(e.body) : 0, in_body && stands_still(e.body)};
}

bool FixSolidCull::frame_stands(int frame) const { return frame == GranuleStore::shared_frame || stands_still(frame); }

/// Nothing that is stored in a frame that stands was within store_gap_in_skins of it when it was last looked at; since then it
/// has hardly moved, and only what is as far from all exterior granules went to the store.
bool FixSolidCull::is_clear(int i) const {
  const double way = clear_way_in_skins * neighbor->skin;
  return shell_[i].clear_in == clear_version_ && (vec(atom->x[i]) - shell_[i].clear_at).squaredNorm() < way * way;
}

void FixSolidCull::keep_shell_closed() {
  const auto timed = watch_.time(Part::shell);
  const double skin = neighbor->skin, gap = store_gap_in_skins * skin;
  std::set<std::int64_t> near;
  struct Frame {
    int number, own;
    bool stands;
    const Pose* pose;
    Vec3 middle, half;  // of a box around its stored granules, in the world
  };
  std::vector<Frame> frames;
  std::vector<Frame> moving;
  Vec3 moving_lo = Vec3::Constant(HUGE_VAL), moving_hi = -moving_lo;  // around all of them
  Vec3 lo = Vec3::Constant(HUGE_VAL), hi = -lo;
  store_->for_each_frame([&](int frame, const Vec3& own_lo, const Vec3& own_hi) {
    const Pose& pose = pose_of_frame(frame);
    const Vec3 half = turned_half_box(pose.turn(), 0.5 * (own_hi - own_lo)) + Vec3::Constant(store_->largest_radius() + gap);
    frames.push_back({frame, frame == GranuleStore::shared_frame ? -1 : key_of(frame), frame_stands(frame), &pose,
                      pose.to_world(0.5 * (own_lo + own_hi)), half});
    lo = lo.cwiseMin(frames.back().middle - half);
    hi = hi.cwiseMax(frames.back().middle + half);
    if (frames.back().stands) return;
    moving.push_back(frames.back());
    moving_lo = moving_lo.cwiseMin(frames.back().middle - half);
    moving_hi = moving_hi.cwiseMax(frames.back().middle + half);
  });
  const auto far_from_all = [&](const Vec3& x, double radius) {
    for (const Vec3& shift : halo_.image_shifts())
      if (((x + shift).array() >= lo.array() - radius).all() && ((x + shift).array() <= hi.array() + radius).all()) return false;
    return true;
  };
  // exterior granules, and the shells of other bodies
  struct Visitor {
    Foreign who;
    int atom;    // an exterior granule of this rank, else -1
    bool clear;  // of what is stored in frames that stand
  };
  std::vector<Visitor> visitors;
  std::vector<Sphere> places;
  const auto near_moving = [&](const Sphere& s) {
    if (moving.empty()) return false;
    for (const Vec3& shift : halo_.image_shifts()) {
      const Vec3 x = s.centre + shift;
      if ((x.array() < moving_lo.array() - s.radius).any() || (x.array() > moving_hi.array() + s.radius).any()) continue;
      if (moving.size() > few_frames) return true;
      for (const Frame& f : moving)
        if (((x - f.middle).array().abs() <= f.half.array() + s.radius).all()) return true;
    }
    return false;
  };
  const auto comes = [&](const Visitor& v) {
    if ((v.who.stands || v.clear) && !near_moving(v.who.sphere)) return;
    visitors.push_back(v);
    places.push_back(v.who.sphere);
  };
  for (const Foreign& v : halo_foreign_)
    if (!far_from_all(v.sphere.centre, v.sphere.radius)) comes({v, -1, false});
  for (int i = 0; i < atom->nlocal; ++i) {
    const ShellEntry& e = shell_[i];
    const bool clear = !e.locked && is_clear(i);
    if ((e.locked && store_bodies_ <= 1) || (clear && moving.empty()) || far_from_all(vec(atom->x[i]), atom->radius[i])) continue;
    const Foreign who = as_foreign(i);
    comes({who, e.locked ? -1 : i, clear});
  }
  SphereCells cells;
  cells.build(std::move(places), 2 * diameter_ + gap);
  for (const Frame& f : frames) {
    const Vec3 half = f.half + Vec3::Constant(cells.largest_radius());
    for (const Vec3& shift : halo_.image_shifts())
      cells.for_each_in_box(f.middle - half - shift, f.middle + half - shift, [&](std::size_t k, const Sphere& s) {
        Visitor& v = visitors[k];
        if (v.who.body == f.own || (f.stands && (v.who.stands || v.clear))) return true;
        const Vec3 at = f.pose->to_frame(s.centre + shift);
        store_->for_each_near(f.number, {at, s.radius}, gap, [&](const Resident& g) {
          const double reach = s.radius + g.radius + skin;
          if ((g.position - at).squaredNorm() < reach * reach) near.insert(g.tag);
          if (f.stands) v.atom = -1;
        });
        return true;
      });
  }
  for (const Visitor& v : visitors) {
    if (v.atom < 0 || v.clear) continue;
    shell_[v.atom].clear_at = v.who.sphere.centre;
    shell_[v.atom].clear_in = clear_version_;
  }
  fetch_near_walls(near);
  if (open_for_insertion_)
    for (const WallContacts::Box& box : insertion_boxes(false))
      for_each_stored_in_box(box.lo, box.hi, [&](const Resident& g) { near.insert(g.tag); });
  for (const std::int64_t tag : near) bring_back(tag);
  shell_changed_ = shell_changed_ || !near.empty();
}

/// Around the regions of the fixes that insert; of those that do so at this step or the next one, if `now`.
std::vector<WallContacts::Box> FixSolidCull::insertion_boxes(bool now) const {
  std::vector<WallContacts::Box> boxes;
  const Vec3 reach = Vec3::Constant(store_->largest_radius() + neighbor->skin);
  for (int f = 0; f < modify->nfix; ++f) {
    const LAMMPS_NS::Fix* fix = modify->fix[f];
    if (std::strncmp(fix->style, "insert/pack", 11) != 0 && std::strncmp(fix->style, "insert/rate", 11) != 0) continue;
    const std::int64_t steps = fix->next_reneighbor - update->ntimestep;
    if (now && steps != 0 && steps != 1) continue;
    const LAMMPS_NS::Region* region = engine::insertion_region(fix);
    if (region && region->bboxflag)
      boxes.push_back({Vec3(region->extent_xlo, region->extent_ylo, region->extent_zlo) - reach,
                       Vec3(region->extent_xhi, region->extent_yhi, region->extent_zhi) + reach});
  }
  return boxes;
}

void FixSolidCull::fetch_near_walls(std::set<std::int64_t>& near) {
  // walls and bodies are compared when they have moved against each other since the last time, and at the start of a run
  if (new_run_) clear_of_walls_.clear();
  const double skin = neighbor->skin, gap = wall_gap_in_skins * skin, enough = wall_check_in_skins * skin;
  const std::vector<WallContacts::Triangle> triangles = walls_.triangles();
  const Vec3 reach = Vec3::Constant(store_->largest_radius() + gap);
  std::vector<int> moved;  // frames that are to be compared with what stands still
  store_->for_each_frame([&](int frame, const Vec3& lo, const Vec3& hi) {
    const Pose& pose = pose_of_frame(frame);
    const auto known = clear_of_walls_.find(frame);
    // walls that hold a body may have stored granules of it at them
    const bool at_walls = sleeping() && frame_stands(frame) && !new_run_;
    const bool against_still =
        !at_walls && (known == clear_of_walls_.end() || largest_way(known->second.pose, pose, lo, hi) >= enough);
    // what moves is seen from the body: a wall that turns with it stays where it is
    std::vector<Vec3> corners;
    for (const WallContacts::Triangle& t : triangles)
      if (t.moving)
        for (const Vec3& c : t.corner) corners.push_back(pose.to_frame(c));
    bool against_moving = known == clear_of_walls_.end() || known->second.corners.size() != corners.size();
    for (std::size_t k = 0; !against_moving && k < corners.size(); ++k)
      against_moving = (corners[k] - known->second.corners[k]).squaredNorm() >= enough * enough;
    if (!against_still && !against_moving) return;
    SeenWalls& seen = clear_of_walls_[frame];
    if (at_walls) seen.pose = pose;
    if (against_still) {
      seen.pose = pose;
      moved.push_back(frame);
    }
    if (against_moving) seen.corners = std::move(corners);
    for (const WallContacts::Triangle& t : triangles)
      if (t.moving ? against_moving : against_still)
        for_each_stored_in_box(
            t.box.lo - reach, t.box.hi + reach,
            [&](const Resident& g) {
              if (!near.count(g.tag) && walls_.near(t, {nearest_image(in_world(g), 0.5 * (t.box.lo + t.box.hi)), g.radius}, gap))
                near.insert(g.tag);
            },
            frame);
  });
  if (moved.empty()) return;
  store_->for_each_frame([&](int frame, const Vec3& lo, const Vec3& hi) {
    if (std::find(moved.begin(), moved.end(), frame) == moved.end()) return;
    // a ball around all of them first
    const Sphere all{pose_of_frame(frame).to_world(0.5 * (lo + hi)), 0.5 * (hi - lo).norm() + store_->largest_radius()};
    if (!walls_.primitive_near(all, gap)) return;
    store_->for_each_in_box(frame, lo, hi, [&](const Resident& g) {
      if (walls_.primitive_near({in_world(g), g.radius}, gap)) near.insert(g.tag);
    });
  });
}

void FixSolidCull::fetch_from_outside() {
  // a body may leave the box: what is outside becomes an atom, and the engine does with it what it does with any that leaves
  const bool periodic[3] = {domain->xperiodic != 0, domain->yperiodic != 0, domain->zperiodic != 0};
  const auto outside = [&](const Vec3& x, double margin) {
    for (int d = 0; d < 3; ++d)
      if (!periodic[d] && (x[d] - margin < domain->boxlo[d] || x[d] + margin >= domain->boxhi[d])) return true;
    return false;
  };
  std::vector<std::int64_t> leaving;
  store_->for_each_frame([&](int frame, const Vec3& lo, const Vec3& hi) {
    if (frame_stands(frame)) return;
    const Pose& pose = pose_of_frame(frame);
    if (!outside(pose.to_world(0.5 * (lo + hi)), 0.5 * (hi - lo).norm())) return;
    // the ball around them may stick out where they do not
    const Vec3 half = turned_half_box(pose.turn(), 0.5 * (hi - lo)), middle = pose.to_world(0.5 * (lo + hi));
    if (!outside(middle - half, 0) && !outside(middle + half, 0)) return;
    store_->for_each_in_box(frame, lo, hi, [&](const Resident& g) {
      if (outside(in_world(g), 0)) leaving.push_back(g.tag);
    });
  });
  for (const std::int64_t tag : leaving) bring_back(tag);
  shell_changed_ = shell_changed_ || !leaving.empty();
}

void FixSolidCull::forget_lost_atoms() {
  // interface granules that have left the box, or were deleted, are members of no body any more
  std::size_t here = 0;
  for (int i = 0; i < atom->nlocal; ++i) here += shell_[i].locked;
  FlatMap<char> present;
  std::vector<Locked> lost;
  if (here != locked_here() - store_->size()) {
    for (int i = 0; i < atom->nlocal; ++i) present[atom->tag[i]] = 1;
    for (const Locked& l : locked_before_)
      if (!present.contains(l.tag) && bodies_.body_of(l.tag) && !store_->contains(l.tag)) lost.push_back(l);
  }
  if (!any_rank(!lost.empty())) return;
  index_atoms();
  for (const Locked& l : lost) bodies_.unlock(l.tag, l.granule, contacts_);
  for (const Locked& l : lost) contacts_.erase(l.tag);
  split_bodies();
  settle_bodies();
  count_bodies();
  label_bodies();
  locked_index_stale_ = true;
}

void FixSolidCull::split_bodies() {
  std::set<int> came_off;
  bodies_.split(
      contacts_, [&](std::int64_t tag) { return mass_of(tag); },
      [&](std::int64_t tag, int body, const Vec3& place) {
        came_off.insert(body);
        if (store_->contains(tag)) {
          StoredGranule g = store_->get(tag);
          if (store_->frame_of(g.body) == GranuleStore::shared_frame) store_->share(body, true);
          wall_loads_.move(tag, g.body, body);
          g.body = body;
          store_->move(tag, body, place);
          return;
        }
        ShellEntry& e = shell_[*index_of_.find(tag)];
        e.body = body;
        e.place = place;
      });
  if (!sleeping()) return;
  came_off.insert(bodies_.split_parents().begin(), bodies_.split_parents().end());
  for (const int body : came_off)
    if (bodies_.bodies().count(body)) find_frame(body);
}

/// In this change, and not before it in the same step.
bool FixSolidCull::just_locked(int i) const {
  const ShellEntry& e = shell_[i];
  return e.locked && e.lock_step == update->ntimestep && e.came_back != update->ntimestep;
}

void FixSolidCull::freeze_contacts() {
  // a contact between two granules of one body is left out of the engine's lists from here on
  const auto is_locked = [&](std::int64_t tag) {
    if (const int* i = index_of_.find(tag)) return shell_[*i].locked;
    return locked_anywhere_.contains(tag) || (ghost_body_.contains(tag) && !freed_anywhere_.contains(tag));
  };
  std::set<std::pair<std::int64_t, std::int64_t>> joined;
  for (std::size_t r = 0; r < joins_.size(); r += 5) {
    const std::int64_t a = static_cast<std::int64_t>(joins_[r + 3]), b = static_cast<std::int64_t>(joins_[r + 4]);
    if (!is_locked(a) || !is_locked(b)) continue;
    joined.insert({std::min(a, b), std::max(a, b)});
  }
  // two bodies that touch stay two, and their contact the engine's, until a granule is locked that touches both, or they are
  // joined
  const auto freezes = [&](std::int64_t a, std::int64_t b) {
    return is_locked(b) &&
           (locked_anywhere_.contains(a) || locked_anywhere_.contains(b) || joined.count({std::min(a, b), std::max(a, b)}));
  };
  // the load of a contact that goes inside stays in the balance that the older granule was locked with (invariant I5)
  const auto rebase = [&](int i, std::int64_t partner, const double* history) {
    if (shell_[i].fresh) return;
    if (const int* j = index_of_.find(partner))
      shell_[i].reference -= bodies_.pose(shell_[i].body).turned_to_frame(pair_force_.on_first(i, *j, history));
  };
  for (int i = 0; i < atom->nlocal; ++i) {
    if (!shell_[i].locked) continue;
    const std::int64_t tag = atom->tag[i];
    histories_.for_each_partner(i, [&](int partner, const double* history) {
      const int* j = index_of_.find(partner);
      if (j && just_locked(i) && just_locked(*j)) {  // most are: seen from both sides, and without contacts until now
        if (i < *j) contacts_.add_unturned(tag, partner, history);
        return;
      }
      if (!freezes(tag, partner)) return;
      if (!contacts_.contains(tag, partner)) contacts_.add_unturned(tag, partner, history);
      rebase(i, partner, history);
    });
  }
  for (const Touch& t : touches_)
    if (is_locked(t.a) && freezes(t.a, t.b) && !contacts_.contains(t.a, t.b)) {
      contacts_.add(t.a, t.b, nullptr);
      if (contacts_.width()) continue;  // touching within the gap: no force
      if (const int* a = index_of_.find(t.a)) rebase(*a, t.b, nullptr);
      if (const int* b = index_of_.find(t.b)) rebase(*b, t.a, nullptr);
    }
  for (const auto& pair : joined)
    if (!contacts_.contains(pair.first, pair.second)) contacts_.add(pair.first, pair.second, nullptr);
  for (const SideChange& c : side_changes_) {
    const int* i = index_of_.find(c.interface_tag);
    if (i && shell_[*i].locked && !shell_[*i].fresh && freezes(c.interface_tag, c.other_tag))
      shell_[*i].reference -= bodies_.pose(shell_[*i].body).turned_to_frame(c.force);
  }
}

void FixSolidCull::freeze_inner_contacts() {
  // two bodies that touched have become one: what the engine saw between them goes inside too
  if (contacts_.width() == 0) return;
  share_bodies();
  for (int i = 0; i < atom->nlocal; ++i) {
    if (!shell_[i].locked) continue;
    const std::int64_t tag = atom->tag[i];
    const int own = key_of(shell_[i].body);
    histories_.for_each_partner(i, [&](int partner, const double* history) {
      const int* j = index_of_.find(partner);
      if (j && just_locked(i) && just_locked(*j)) return;  // freeze_contacts() has seen to it
      const int* ghost = j ? nullptr : ghost_body_.find(partner);
      const int other = j ? (shell_[*j].locked ? key_of(shell_[*j].body) : 0) : ghost ? *ghost : 0;
      if (other != own || contacts_.contains(tag, partner)) return;
      contacts_.add_unturned(tag, partner, history);
      for (const int* end : {static_cast<const int*>(&i), j})
        if (end && !shell_[*end].fresh && j)
          shell_[*end].reference -=
              bodies_.pose(shell_[*end].body)
                  .turned_to_frame(end == j ? Vec3(-pair_force_.on_first(i, *j, history)) : pair_force_.on_first(i, *j, history));
    });
  }
}

void FixSolidCull::share_bodies() {
  ghost_body_.clear();
  if (!halo_.needed()) return;
  std::vector<double> rows;
  for (int i = 0; i < atom->nlocal; ++i)
    if (shell_[i].locked)
      rows.insert(rows.end(),
                  {atom->x[i][0], atom->x[i][1], atom->x[i][2], double(atom->tag[i]), double(key_of(shell_[i].body))});
  rows = halo_.exchange(rows, 5, contact_reach());
  for (std::size_t r = 0; r < rows.size(); r += 5)
    ghost_body_[static_cast<std::int64_t>(rows[r + 3])] = static_cast<int>(rows[r + 4]);
}

void FixSolidCull::freeze_histories() {
  // now that each granule has its body: vectors wait in the body's frame
  contacts_.turn_all_unturned([&](std::int64_t low, std::int64_t high) -> Eigen::Matrix3d {
    const int body = bodies_.body_of(low);
    return bodies_.pose(body ? body : bodies_.body_of(high)).turn().transpose();
  });
}

void FixSolidCull::thaw_contacts() {
  std::vector<std::int64_t> freed;  // in the order of their tags: neighbours lie near each other in memory then
  freed.reserve(freed_anywhere_.size());
  freed_anywhere_.for_each([&](std::int64_t tag, char) { freed.push_back(tag); });
  std::sort(freed.begin(), freed.end());
  struct Given {
    int atom;
    std::int64_t partner;
    std::size_t history;
  };
  std::vector<Given> given;
  std::vector<double> histories;
  const std::size_t width = contacts_.width();
  const auto give = [&](const int* atom, std::int64_t partner, const double* history) {
    if (!atom) return static_cast<double*>(nullptr);
    given.push_back({*atom, partner, histories.size()});
    histories.insert(histories.end(), history, history + width);
    return &histories[given.back().history];
  };
  for (const std::int64_t tag : freed) {
    const int* mine = index_of_.find(tag);
    const int own = bodies_.body_of(tag);
    contacts_.for_each(tag, [&](std::int64_t partner, const double* history) {
      if (!history || (partner < tag && freed_anywhere_.contains(partner))) return;
      const Eigen::Matrix3d& turn = bodies_.pose(own ? own : bodies_.body_of(partner)).turn();
      if (double* const h = give(mine, partner, history)) contacts_.turn(h, turn);
      if (double* const h = give(index_of_.find(partner), tag, history)) {
        contacts_.turn(h, turn);
        contacts_.change_side(h);
      }
    });
  }
  std::sort(given.begin(), given.end(),
            [](const Given& a, const Given& b) { return std::tie(a.atom, a.history) < std::tie(b.atom, b.history); });
  std::vector<ContactHistories::Contact> of_one;
  for (std::size_t g = 0; g < given.size();) {
    const int atom = given[g].atom;
    of_one.clear();
    for (; g < given.size() && given[g].atom == atom; ++g) of_one.push_back({given[g].partner, &histories[given[g].history]});
    histories_.give(atom, of_one.data(), of_one.size());
  }
  thawed_ = !freed_anywhere_.empty();
}

/// Walls do not hinder it from going to the store: there are none, or they and its body stand still, and what they do to it is
/// known.
bool FixSolidCull::may_leave_its_walls(const ShellEntry& e) const {
  if (!e.wall_near) return true;
  return sleeping() && !e.moving_wall_near && stands_still(e.body) && e.came_back != update->ntimestep && !e.fresh && !new_run_;
}

void FixSolidCull::store_what_is_deep(bool change) {
  // shells that nothing is near any more go now and then; what was just locked, and what the looks ask for, at once
  const bool asked = any_rank(!locked_now_.empty() || store_asked_);
  store_asked_ = false;
  if (!asked && (!sleeping() || ++builds_without_storing_ < builds_between_storing)) return;
  builds_without_storing_ = 0;
  std::int64_t highest = 0, highest_anywhere = 0;
  for (int i = 0; i < atom->nlocal; ++i) highest = std::max<std::int64_t>(highest, atom->tag[i]);
  MPI_Allreduce(&highest, &highest_anywhere, 1, MPI_INT64_T, MPI_MAX, world);
  if (locked_now_.empty() && !sleeping()) return;

  std::vector<Sphere> exterior;
  std::vector<Sphere> shells;
  std::vector<Foreign> of_shell;
  const auto sort_in = [&](const Foreign& f) {
    if (!f.body) {
      exterior.push_back(f.sphere);
    } else if (store_bodies_ > 1) {
      shells.push_back(f.sphere);
      of_shell.push_back(f);
    }
  };
  for (int i = 0; i < atom->nlocal; ++i) sort_in(as_foreign(i));
  for (const Foreign& f : halo_foreign_) sort_in(f);
  SphereCells cells, shell_cells;
  cells.build(std::move(exterior), 2 * diameter_);
  shell_cells.build(std::move(shells), 2 * diameter_);
  const double gap = store_gap_in_skins * neighbor->skin;
  // the largest body is everywhere: it asks whether it is near one of the others
  struct Extent {
    int key;
    Vec3 lo, hi;
  };
  std::vector<Extent> others;
  int largest = 0;
  if (store_bodies_ > 1) {
    std::size_t most = 0;
    for (const auto& [number, body] : bodies_.bodies())
      if (static_cast<std::size_t>(body.mass.count) > most)
        most = static_cast<std::size_t>(body.mass.count), largest = key_of(number);
    store_->for_each_body([&](int body, const Vec3& lo, const Vec3& hi) {
      if (key_of(body) == largest) return;
      const Pose& pose = bodies_.pose(body);
      const Vec3 half = turned_half_box(pose.turn(), 0.5 * (hi - lo)) + Vec3::Constant(store_->largest_radius());
      const Vec3 middle = pose.to_world(0.5 * (lo + hi));
      others.push_back({key_of(body), middle - half, middle + half});
    });
  }
  const bool images = halo_.image_shifts().size() > 1;
  const auto near_another_body = [&](int i) {
    if (store_bodies_ <= 1) return false;
    const Foreign self = as_foreign(i);
    const Sphere& s = self.sphere;
    // bodies that both stand still may be as near as they like, but what they do to each other needs two atoms
    const auto touches = [&](const Sphere& other) {
      const double reach = neighbor->contactDistanceFactor * (s.radius + other.radius);
      return (nearest_image(other.centre, s.centre) - s.centre).squaredNorm() < reach * reach;
    };
    if (shell_cells.any_near(s, gap, [&](std::size_t k) {
          const Foreign& other = of_shell[k];
          return other.body != self.body && (!(self.stands && other.stands) || touches(other.sphere));
        }))
      return true;
    const double reach = s.radius + gap;
    if (self.body == largest && !images && std::none_of(others.begin(), others.end(), [&](const Extent& e) {
          return (s.centre.array() > e.lo.array() - reach).all() && (s.centre.array() < e.hi.array() + reach).all();
        }))
      return false;
    bool near = false;
    for_each_stored_near(
        s, gap,
        [&](const Resident& g) {
          near = near || !(self.stands && stands_still(g.body)) || touches({in_world(g), g.radius});
        },
        self.body);
    return near;
  };
  // what is to be inserted at this step or the next must find the bed open
  const std::vector<WallContacts::Box> opened = insertion_boxes(true);
  const auto is_open = [&](const Vec3& x) {
    return std::any_of(opened.begin(), opened.end(), [&](const WallContacts::Box& box) {
      return (x.array() >= box.lo.array()).all() && (x.array() <= box.hi.array()).all();
    });
  };
  std::vector<int> deep;
  stay_near_ = 0;
  for (int i = atom->nlocal - 1; i >= 0; --i) {
    // the highest tag must stay an atom: new atoms are numbered from it
    if (!shell_[i].locked || !may_leave_its_walls(shell_[i]) || atom->tag[i] == highest_anywhere) continue;
    if (!cells.any_near(sphere(i), gap) && !near_another_body(i) && !is_open(vec(atom->x[i])))
      deep.push_back(i);
    else
      ++stay_near_;
  }
  // where nothing else changes, a few wait for more
  if (!change && static_cast<double>(deep.size()) < store_share * atom->nlocal) return;
  for (const int i : deep) put_away(i);
  shell_changed_ = shell_changed_ || !deep.empty();
}

void FixSolidCull::fit_memory() {
  const std::size_t atoms_then = static_cast<std::size_t>(atom->nmax);
  memory_.fit();
  pair_force_.release();
  release(chosen_, side_changes_, touches_, joins_, freed_, locked_now_, freed_anywhere_, locked_anywhere_, overdue_, index_of_,
          locked_index_, locked_slot_, locked_place_, riding_, around_, balls_, halo_foreign_, ghost_body_);
  locked_before_.shrink_to_fit();
  shell_.resize(atom->nmax);
  shell_.shrink_to_fit();
  index_atoms();
  memory_.trim(atoms_then * sizeof(ShellEntry));
}

void FixSolidCull::publish_atom_counts() {
  LAMMPS_NS::bigint owned = atom->nlocal;
  MPI_Allreduce(&owned, &atom->natoms, 1, MPI_LMP_BIGINT, MPI_SUM, world);
  std::int64_t stored = static_cast<std::int64_t>(store_->size());
  const std::int64_t before = stored_everywhere_;
  MPI_Allreduce(&stored, &stored_everywhere_, 1, MPI_INT64_T, MPI_SUM, world);
  if (output->thermo) engine::expect_atoms(*output->thermo, static_cast<long>(before - stored_everywhere_));
  if (map_cleared_) {
    atom->nghost = 0;
    atom->map_set();
    map_cleared_ = false;
  }
  const double moved = static_cast<double>(freed_.size() + locked_now_.size());
  if (any_rank(moved > sort_share * atom->nlocal) && atom->sortfreq > 0) atom->nextsort = update->ntimestep;
  ++membership_version_;
  label_bodies();
}

void FixSolidCull::label_bodies() {
  for (int i = 0; i < atom->nlocal; ++i)
    vector_atom[i] = shell_[i].locked ? (comm->nprocs == 1 ? shell_[i].body : key_of(shell_[i].body)) : 0;
}

void FixSolidCull::restore_all() {
  histories_.bring_up_to_date();
  halo_.update();
  wake_all_ = true;
  change_membership();
  memory_.give_bins_back();
  if (store_->size() != 0 || locked_here() != 0 || contacts_.size() != 0)
    broken("a restore of everything left " + std::to_string(store_->size()) + " granules in the store");
}

void FixSolidCull::open_for_insertion() {
  // fixes that insert check for overlap with atoms only: where they may put granules, stored ones become atoms first
  for (int f = 0; f < modify->nfix; ++f) {
    if (std::strncmp(modify->fix[f]->style, "insert/", 7) != 0) continue;
    const std::int64_t next = modify->fix[f]->next_reneighbor;
    if (new_run_ || next == update->ntimestep + 2) {
      open_for_insertion_ = true;
      if (!new_run_) next_reneighbor = update->ntimestep + 1;
    }
  }
}

void FixSolidCull::check_inserted() {
  bool inserted = false;
  for (int f = 0; f < modify->nfix; ++f)
    if (std::strncmp(modify->fix[f]->style, "insert/", 7) == 0)
      inserted = inserted || static_cast<LAMMPS_NS::FixInsert*>(modify->fix[f])->has_inserted();
  if (!inserted || stored_everywhere_ == 0) return;
  int overlapping = 0;
  bool near = false;
  for (int i = 0; i < atom->nlocal + atom->nghost; ++i) {
    if (atom->mask[i] & group->bitmask[interface_group_]) continue;
    const Sphere s = sphere(i);
    for_each_stored_near(s, neighbor->skin, [&](const Resident& g) {
      near = true;
      if ((nearest_image(in_world(g), s.centre) - s.centre).norm() < g.radius + s.radius) overlapping = atom->tag[i];
    });
  }
  int everywhere = 0;
  MPI_Allreduce(&overlapping, &everywhere, 1, MPI_INT, MPI_MAX, world);
  if (everywhere)
    refuse("granule " + std::to_string(everywhere) +
           " was inserted into the place of a culled one: give the insertion a region above the bed, or unfix solid/cull first");
  if (any_rank(near)) next_reneighbor = update->ntimestep + 1;
}

}  // namespace solidcull
