// How solid bodies move: in step with the engine's integrator, over ranks, and when the load on a body as a whole has changed.
#include <mpi.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "engine_vectors.h"
#include "fix_solid_cull.h"
#include "group.h"
#include "neighbor.h"
#include "update.h"

namespace solidcull {
namespace {

// a body feels a force as a whole once the wave has crossed it: steps for one granule
constexpr double steps_per_granule = 10;

Vec3 moved_corner(const Pose& then, const Pose& now, const Vec3& corner) { return now.to_world(corner) - then.to_world(corner); }

}  // namespace

/// Largest way (m) that a point of the box has gone from one pose to the other: at a corner, for the way is convex.
double largest_way(const Pose& then, const Pose& now, const Vec3& lo, const Vec3& hi) {
  double square = 0;
  for (int c = 0; c < 8; ++c) {
    const Vec3 corner(c & 1 ? hi[0] : lo[0], c & 2 ? hi[1] : lo[1], c & 4 ? hi[2] : lo[2]);
    square = std::max(square, moved_corner(then, now, corner).squaredNorm());
  }
  return std::sqrt(square);
}

Vec3 FixSolidCull::nearest_image(const Vec3& x, const Vec3& to) const {
  Vec3 image = x;
  const int periodic[3] = {domain->xperiodic, domain->yperiodic, domain->zperiodic};
  for (int d = 0; d < 3; ++d)
    if (periodic[d]) image[d] -= domain->prd[d] * std::round((x[d] - to[d]) / domain->prd[d]);
  return image;
}

// ------------------------------------------------------------------------------------------------------------ the time step

void FixSolidCull::refresh_locked() {
  if (!locked_index_stale_) return;
  locked_index_stale_ = false;
  active_.clear();
  locked_index_.clear();
  locked_slot_.clear();
  locked_place_.clear();
  riding_.clear();
  FlatMap<int> slot;
  FlatMap<char> has_atoms;
  for (int i = 0; i < atom->nlocal; ++i)
    if (shell_[i].locked && shell_[i].body > 0) has_atoms[shell_[i].body] = 1;
  for (auto& b : bodies_.bodies()) {
    // what sleeps on the ground and has no atoms costs nothing
    const auto spans = groups_.find(b.first);
    const bool spanning = spans != groups_.end() && std::binary_search(spanning_.begin(), spanning_.end(), spans->second.key);
    if (b.second.grounded && !spanning && !has_atoms.contains(b.first) && walls_bear(b.first)) continue;
    slot[b.first] = static_cast<int>(active_.size());
    active_.push_back({b.first, &b.second});
    active_.back().stands = stands_still(b.first);
    const auto group = groups_.find(b.first);
    if (group == groups_.end()) continue;
    const auto at = std::lower_bound(spanning_.begin(), spanning_.end(), group->second.key);
    if (at != spanning_.end() && *at == group->second.key) active_.back().spanning = static_cast<int>(at - spanning_.begin());
  }
  store_->for_each_body([&](int body, const Vec3& lo, const Vec3& hi) {
    const int* s = slot.find(body);
    if (!s && !bodies_.bodies().count(body))
      broken("interior granules belong to body " + std::to_string(body) + ", which is not there");
    if (!s || active_[*s].stands) return;
    const SolidBody& b = *active_[*s].body;
    active_[*s].reach = (b.pose.to_world(0.5 * (lo + hi)) - b.motion.centre()).norm() + 0.5 * (hi - lo).norm();
  });
  for (int i = 0; i < atom->nlocal; ++i) {
    if (!shell_[i].locked || shell_[i].body < 0) continue;  // below 0: on its way to another rank
    const int* s = slot.find(shell_[i].body);
    if (!s) broken("interface granule " + std::to_string(atom->tag[i]) + " belongs to no body");
    locked_index_.push_back(i);
    locked_slot_.push_back(*s);
    if (!active_[*s].stands) riding_.push_back(locked_index_.size() - 1);
    locked_place_.push_back(shell_[i].place);
  }
}

/// The load on interface granule number k of locked_index_ goes to its body, about the frame's origin for now.
inline void FixSolidCull::add_to_body(std::size_t k, const Vec3& contact, const double* torque) {
  ActiveBody& a = active_[locked_slot_[k]];
  a.force += contact;
  a.torque += (a.body->pose.turn() * locked_place_[k]).cross(contact) + vec(torque);
}

void FixSolidCull::take_loads() {
  const auto timed = watch_.time(Part::load);
  refresh_locked();
  if (thawed_) rebase_thawed_contacts();
  largest_excess_ = 0;
  const bool moves = rigid();
  const Vec3 g = gravity();
  for (ActiveBody& a : active_) a.force = a.torque = a.change = Vec3::Zero();
  double** force = atom->f;
  for (std::size_t k = 0; k < locked_index_.size(); ++k) {
    const int i = locked_index_[k];
    ShellEntry& e = shell_[i];
    const Vec3 in_world = vec(force[i]);
    ActiveBody& a = active_[locked_slot_[k]];
    if (moves && !a.stands) add_to_body(k, in_world - atom->rmass[i] * g, atom->torque[i]);
    const Vec3 load = a.body->pose.turned_to_frame(in_world);
    if (e.fresh) {
      e.reference = load - e.load_change;
      e.fresh = false;
    }
    e.load_change = load - e.reference;
    if (a.stands) a.change += in_world - atom->rmass[i] * g;
    const double tolerance = wake_up_.tolerance(atom->rmass[i], e.normal_load);
    const double square = e.load_change.squaredNorm();
    if (square > e.excess * e.excess * tolerance * tolerance) e.excess = std::sqrt(square) / tolerance;
    largest_excess_ = std::max(largest_excess_, e.excess);
    set(force[i], Vec3::Zero());
    set(atom->torque[i], Vec3::Zero());
  }
  if (sleeping())
    for (ActiveBody& a : active_)
      if (a.stands) a.change += wall_loads_.force(a.number) + a.body->mass.mass * g;
  if (moves) sum_over_bodies();
  if (sleeping()) press_on_walls();
}

void FixSolidCull::sum_over_bodies() {
  // contacts and other forces on interface granules are there; gravity pulls the whole mass
  for (ActiveBody& a : active_) a.torque += (a.body->pose.origin() - a.body->motion.centre()).cross(a.force);
  if (!spanning_.empty()) {
    std::vector<double> sums(9 * spanning_.size(), 0.0);
    for (const ActiveBody& a : active_)
      for (int d = 0; d < 3 && a.spanning >= 0; ++d) {
        sums[9 * a.spanning + d] += a.force[d];
        sums[9 * a.spanning + 3 + d] += a.torque[d];
        sums[9 * a.spanning + 6 + d] += a.change[d];
      }
    MPI_Allreduce(MPI_IN_PLACE, sums.data(), static_cast<int>(sums.size()), MPI_DOUBLE, MPI_SUM, world);
    for (ActiveBody& a : active_)
      if (a.spanning >= 0) {
        a.force = vec(&sums[9 * a.spanning]);
        a.torque = vec(&sums[9 * a.spanning + 3]);
        a.change = vec(&sums[9 * a.spanning + 6]);
      }
  }
  const Vec3 g = gravity();
  for (ActiveBody& a : active_) a.force += a.body->motion.mass() * g;
}

void FixSolidCull::post_integrate() {
  if (!store_ || !rigid() || (comm->nprocs == 1 && active_.empty())) return;
  const auto timed = watch_.time(Part::load);
  const double dt = update->dt;
  const int periodic[3] = {domain->xperiodic, domain->yperiodic, domain->zperiodic};
  for (ActiveBody& a : active_) {
    if (a.stands) continue;
    SolidBody& b = *a.body;
    b.motion.kick(a.force, a.torque, 0.5 * dt);
    b.pose.advance(b.motion.drift(dt));
    a.way += way_in_a_step(a);
    for (int d = 0; d < 3; ++d) {
      const double c = b.motion.centre()[d];
      if (!periodic[d] || (c >= domain->boxlo[d] && c < domain->boxhi[d])) continue;
      Vec3 shift = Vec3::Zero();
      shift[d] = c < domain->boxlo[d] ? domain->prd[d] : -domain->prd[d];
      b.pose.shift(shift);
      b.motion.shift(shift);
    }
    b.twist = b.motion.twist();
  }
  place_interface_granules();
  // the engine looks at its atoms only: a body that has none would come near something unseen
  if ((comm->nprocs == 1 || fast_bodies_) && any_rank(body_comes_too_far(0))) next_reneighbor = update->ntimestep;
}

double FixSolidCull::way_in_a_step(const ActiveBody& a) const {
  return a.reach > 0 ? update->dt * (a.body->motion.velocity().norm() + a.body->motion.spin().norm() * a.reach) : 0.0;
}

bool FixSolidCull::body_comes_too_far(int steps) const {
  return std::any_of(active_.begin(), active_.end(),
                     [&](const ActiveBody& a) { return a.way + steps * way_in_a_step(a) > 0.5 * neighbor->skin; });
}

bool FixSolidCull::body_is_fast(int steps) const {
  return std::any_of(active_.begin(), active_.end(),
                     [&](const ActiveBody& a) { return steps * way_in_a_step(a) > 0.25 * neighbor->skin; });
}

/// The velocity field over places in the body's frame: v = constant + gradient * place.
struct FixSolidCull::FieldInFrame {
  Vec3 constant;
  Eigen::Matrix3d gradient;
  explicit FieldInFrame(const SolidBody& b) : constant(b.twist.at(b.pose.origin())) {
    for (int d = 0; d < 3; ++d) gradient.col(d) = b.twist.spin.cross(b.pose.turn().col(d));
  }
  Vec3 at(const Vec3& place) const { return constant + gradient * place; }
};

void FixSolidCull::place_interface_granules() {
  const bool periodic = domain->xperiodic || domain->yperiodic || domain->zperiodic;
  const std::vector<FieldInFrame> fields = fields_of_bodies();
  for (const std::size_t k : riding_) {
    const int i = locked_index_[k];
    const SolidBody& b = *active_[locked_slot_[k]].body;
    const Vec3 x = b.pose.to_world(locked_place_[k]);
    set(atom->x[i], periodic ? nearest_image(x, vec(atom->x[i])) : x);
    set(atom->v[i], fields[locked_slot_[k]].at(locked_place_[k]));
    set(atom->omega[i], b.twist.spin);
  }
}

std::vector<FixSolidCull::FieldInFrame> FixSolidCull::fields_of_bodies() const {
  std::vector<FieldInFrame> fields;
  fields.reserve(active_.size());
  for (const ActiveBody& a : active_) fields.emplace_back(*a.body);
  return fields;
}

void FixSolidCull::final_integrate() {
  if (!store_ || !rigid() || active_.empty()) return;
  const auto timed = watch_.time(Part::load);
  for (ActiveBody& a : active_) {
    if (a.stands) continue;
    a.body->motion.kick(a.force, a.torque, 0.5 * update->dt);
    a.body->twist = a.body->motion.twist();
  }
  const std::vector<FieldInFrame> fields = fields_of_bodies();
  for (const std::size_t k : riding_) give_velocity(k, fields);
}

void FixSolidCull::give_velocities() {
  const std::vector<FieldInFrame> fields = fields_of_bodies();
  for (std::size_t k = 0; k < locked_index_.size(); ++k) give_velocity(k, fields);
}

void FixSolidCull::give_velocity(std::size_t k, const std::vector<FieldInFrame>& fields) {
  const int i = locked_index_[k];
  set(atom->v[i], fields[locked_slot_[k]].at(locked_place_[k]));
  set(atom->omega[i], active_[locked_slot_[k]].body->twist.spin);
}

// ------------------------------------------------------------------------------------------------------------ which bodies

int FixSolidCull::key_of(int body) const {
  const auto group = groups_.find(body);
  return group == groups_.end() ? body * comm->nprocs + comm->me : group->second.key;
}

int FixSolidCull::key_of_atom(int i) const {
  if (i < atom->nlocal) return shell_[i].locked ? key_of(shell_[i].body) : 0;
  const int* key = ghost_body_.find(atom->tag[i]);
  return key ? *key : 0;
}

/// Stored granules that may touch one of another rank.
std::vector<std::int64_t> FixSolidCull::stored_at_borders() const {
  std::vector<std::int64_t> tags;
  const double reach = 2 * store_->largest_radius() + neighbor->skin + store_slack();
  const Vec3 out = Vec3::Constant(reach + domain->prd[0] + domain->prd[1] + domain->prd[2]);
  const Vec3 lo = vec(domain->sublo), hi = vec(domain->subhi);
  for (int d = 0; d < 3; ++d)
    for (const bool upper : {false, true}) {
      Vec3 from = lo - out, to = hi + out;
      (upper ? from : to)[d] = upper ? hi[d] - reach : lo[d] + reach;
      for_each_stored_in_box(from, to, [&](const Resident& g) { tags.push_back(g.tag); });
    }
  std::sort(tags.begin(), tags.end());
  tags.erase(std::unique(tags.begin(), tags.end()), tags.end());
  return tags;
}

void FixSolidCull::group_bodies() {
  groups_.clear();
  spanning_.clear();
  group_spans_.clear();
  if (comm->nprocs == 1) return;
  // a contact across ranks joins the bodies of its two ends: each rank sends its end, all ranks join the same pairs
  constexpr int columns = 6;
  std::vector<double> rows;
  const auto reaches_out = [&](std::int64_t tag) {
    const int body = bodies_.body_of(tag);
    if (!body) return;
    contacts_.for_each_partner(tag, [&](std::int64_t partner) {
      if (bodies_.body_of(partner)) return;
      const Vec3 x = bodies_.pose(body).to_world(mass_of(tag).position);
      rows.insert(rows.end(), {double(std::min(tag, partner)), double(std::max(tag, partner)),
                               double(body) * comm->nprocs + comm->me, x[0], x[1], x[2]});
    });
  };
  for (int i = 0; i < atom->nlocal; ++i)
    if (shell_[i].locked) reaches_out(atom->tag[i]);
  for (const std::int64_t tag : stored_at_borders()) reaches_out(tag);
  arriving_.for_each([&](std::int64_t tag, const Arrival&) { reaches_out(tag); });
  rows = halo_.gather_all(rows);
  struct Link {
    int parent;
    Vec3 shift;  // this one's image + shift = the parent's image
  };
  std::map<int, Link> links;
  const auto root = [&](int key) {
    Link l{key, Vec3::Zero()};
    for (auto at = links.find(l.parent); at != links.end(); at = links.find(l.parent)) {
      if (at->second.parent == l.parent) break;
      l.shift += at->second.shift;
      l.parent = at->second.parent;
    }
    return l;
  };
  std::map<std::pair<double, double>, std::size_t> first_end;
  std::set<int> joined;
  for (std::size_t r = 0; r < rows.size(); r += columns) {
    const auto end = first_end.emplace(std::make_pair(rows[r], rows[r + 1]), r);
    if (end.second) continue;
    const std::size_t f = end.first->second;
    const Link a = root(static_cast<int>(rows[f + 2])), b = root(static_cast<int>(rows[r + 2]));
    joined.insert({static_cast<int>(rows[f + 2]), static_cast<int>(rows[r + 2])});
    const Vec3 xa = vec(&rows[f + 3]), xb = vec(&rows[r + 3]);
    Vec3 to_a = nearest_image(xb, xa) - xb;  // image of b + to_a = image of a, at this contact
    for (int d = 0; d < 3; ++d) to_a[d] = domain->prd[d] > 0 ? domain->prd[d] * std::round(to_a[d] / domain->prd[d]) : 0;
    const Vec3 shift = to_a + a.shift - b.shift;
    if (a.parent == b.parent) {
      for (int d = 0; d < 3; ++d)
        if (std::abs(shift[d]) > 0.5 * domain->prd[d]) group_spans_[a.parent][d] = true;
    } else if (a.parent < b.parent) {
      links[b.parent] = {a.parent, shift};
    } else {
      links[a.parent] = {b.parent, -shift};
    }
  }
  std::map<int, std::array<bool, 3>> spans;
  for (const auto& s : group_spans_)
    for (int d = 0; d < 3; ++d) spans[root(s.first).parent][d] |= s.second[d];
  group_spans_ = spans;
  for (const int key : joined) spanning_.push_back(root(key).parent);
  std::sort(spanning_.begin(), spanning_.end());
  spanning_.erase(std::unique(spanning_.begin(), spanning_.end()), spanning_.end());
  for (const auto& body : bodies_.bodies()) {
    const Link l = root(body.first * comm->nprocs + comm->me);
    groups_[body.first] = {l.parent, l.shift};
  }
}

void FixSolidCull::follow_loads(int swallowed, int kept) {
  wall_loads_.merge(swallowed, kept);
  if (const Sum* gone = pressed_.find(swallowed)) {
    const Vec3 moved = gone->value;
    pressed_[kept].value += moved;
    pressed_.erase(swallowed);
  }
  rested_.erase(swallowed);
}

void FixSolidCull::adopt_places() {
  // granules of swallowed bodies move to the frame of the body that they are part of now
  for (int i = 0; i < atom->nlocal; ++i) {
    ShellEntry& e = shell_[i];
    if (!e.locked || e.body < 0) continue;
    const int body = bodies_.body_of(atom->tag[i]);
    if (e.body == body) continue;
    const Pose &from = bodies_.pose(e.body), &to = bodies_.pose(body);
    if (from != to) {
      e.place = to.to_frame(from.to_world(e.place));
      e.reference = to.turned_to_frame(from.turned_to_world(e.reference));
      e.load_change = to.turned_to_frame(from.turned_to_world(e.load_change));
      const Eigen::Matrix3d turn = to.turn().transpose() * from.turn();
      const std::int64_t tag = atom->tag[i];
      contacts_.turn(tag, turn, [&](std::int64_t partner) { return partner > tag || !bodies_.body_of(partner); });
    }
    e.body = body;
  }
  FlatMap<Arrival> arriving;
  arriving_.for_each([&](std::int64_t tag, Arrival a) {
    const int body = bodies_.body_of(tag);
    const Pose &from = bodies_.pose(a.at.body), &to = bodies_.pose(body);
    if (from != to) a.at.position = to.to_frame(from.to_world(a.at.position));
    a.at.body = body;
    arriving[tag] = a;
  });
  arriving_ = std::move(arriving);
  for (const auto& gone : bodies_.swallowed()) {
    const int body = bodies_.root(gone.first);
    const Pose &from = gone.second, &to = bodies_.pose(body);
    const bool same = from == to;
    const Eigen::Matrix3d turn = to.turn().transpose() * from.turn();
    if (compact() && !same) turn_inner_histories(gone.first, turn);
    if (store_->holds(gone.first) && store_->frame_of(gone.first) != GranuleStore::shared_frame)
      ++clear_version_;  // its granules may stand from now on
    store_->merge(gone.first, body, [&](StoredGranule& g) {
      if (same) return;
      g.position = to.to_frame(from.to_world(g.position));
      g.load_change = turn * g.load_change;
      contacts_.turn(g.tag, turn, [&](std::int64_t partner) { return partner > g.tag || !bodies_.body_of(partner); });
    });
    follow_loads(gone.first, body);
    clear_of_walls_.erase(gone.first);
    at_home_.erase(gone.first);
    drawn_.erase(gone.first);
    if (!same) {
      drawn_.erase(body);
      clear_of_walls_.erase(body);
      at_home_.erase(body);
    }
    if (observed_ == gone.first) observed_ = 0;
    if (sleeping()) find_frame(body);
  }
  merges_.clear();
  for (const auto& m : bodies_.take_merges())
    if (meshes_wanted_) merges_.push_back({m.first, m.second, bodies_.pose(m.second)});
  bodies_.forget_swallowed();
}

void FixSolidCull::settle_bodies() {
  group_bodies();
  if (!rigid()) return;
  for (auto& [number, body] : bodies_.bodies()) {
    const auto group = groups_.find(number);
    const bool spans = group != groups_.end() && std::binary_search(spanning_.begin(), spanning_.end(), group->second.key);
    // what was a part of a larger body may have become a body of its own without a change of its granules
    body.changed = body.changed || body.spanned != spans;
    body.spanned = spans;
    if (body.grounded && !spans && body.mass.held == 0) set_grounded(number, false);  // what held it has gone
    if (spans || !body.changed) continue;
    const RigidPart part = body.part();
    body.motion = RigidMotion(&part, 1, body.free_axes());
    body.twist = body.motion.twist();
    body.changed = false;
  }
  if (spanning_.empty()) return;
  constexpr int columns = 26;
  std::vector<double> rows;
  for (auto& [number, body] : bodies_.bodies()) {
    const Group& group = groups_.at(number);
    if (!std::binary_search(spanning_.begin(), spanning_.end(), group.key)) continue;
    const RigidPart p = body.part();
    const Vec3 centre = p.centre + group.shift;
    rows.insert(rows.end(), {double(group.key), p.mass, centre[0], centre[1], centre[2]});
    rows.insert(rows.end(), p.inertia.data(), p.inertia.data() + 9);
    for (const Vec3& v : {p.velocity, p.spin}) rows.insert(rows.end(), v.data(), v.data() + 3);
    for (const bool s : body.spans) rows.push_back(s);
    rows.insert(rows.end(), {double(body.grounded), double(body.mass.held), body.grounded_mass});
  }
  rows = halo_.gather_all(rows);
  std::map<int, std::vector<RigidPart>> parts;
  std::map<int, std::pair<bool, bool>> ground;     // some part is grounded, some part is held
  std::map<int, std::pair<double, double>> stood;  // grounded of itself, mass
  for (std::size_t r = 0; r < rows.size(); r += columns) {
    RigidPart p;
    const int key = static_cast<int>(rows[r]);
    p.mass = rows[r + 1];
    p.centre = vec(&rows[r + 2]);
    p.inertia = Eigen::Map<const Eigen::Matrix3d>(&rows[r + 5]);
    p.velocity = vec(&rows[r + 14]);
    p.spin = vec(&rows[r + 17]);
    parts[key].push_back(p);
    ground[key].first |= rows[r + 23] != 0;
    ground[key].second |= rows[r + 24] != 0;
    stood[key].first += rows[r + 25];
    stood[key].second += p.mass;
    for (int d = 0; d < 3; ++d) group_spans_[key][d] |= rows[r + 20 + d] != 0;
  }
  for (auto& [number, body] : bodies_.bodies()) {
    const Group& group = groups_.at(number);
    const auto all = parts.find(group.key);
    if (all == parts.end()) continue;
    set_grounded(number, ground[group.key].first && ground[group.key].second);
    const auto [grounded, all_mass] = stood.at(group.key);
    if (body.grounded) body.grounded_mass = grounded / all_mass * body.mass.mass;
    SolidBody whole;
    whole.spans = group_spans_[group.key];
    body.motion = RigidMotion(all->second.data(), static_cast<int>(all->second.size()), whole.free_axes());
    body.motion.shift(-group.shift);
    if (body.grounded) body.motion.stop();
    body.twist = body.motion.twist();
    body.changed = false;
  }
}

double FixSolidCull::kinetic_energy(int body) const {
  return bodies_.bodies().count(body) ? bodies_.body(body).part().kinetic_energy() : 0.0;
}

// ------------------------------------------------------------------------------------------------------- the load as a whole

void FixSolidCull::wake_body(int key) { waking_bodies_.insert(key); }

void FixSolidCull::watch_effective_gravity(bool new_gravity) {
  // the mean acceleration over the time in which a wave crosses the body: what it feels as a whole
  const Vec3 g = gravity();
  const std::int64_t now = update->ntimestep;
  if (g != gravity_then_)  // what stands still feels gravity alone
    for (const auto& [number, b] : bodies_.bodies())
      if (b.grounded && wake_up_.gravity_changed(b.pose.turned_to_frame(g), b.felt_known ? b.felt : gravity_then_,
                                                 static_cast<double>(b.mass.count)))
        wake_body(key_of(number));
  for (const ActiveBody& a : active_) {
    SolidBody& b = *a.body;
    const double granules = (rigid() ? b.motion.mass() : b.mass.mass) * static_cast<double>(b.mass.count) / b.mass.mass;
    const auto begin = [&] {
      b.velocity_then = b.motion.velocity();
      b.step_then = now;
    };
    if (!rigid()) {
      if (!b.felt_known) b.felt = g;
      b.felt_known = true;
      if (wake_up_.gravity_changed(g, b.felt, granules)) wake_body(key_of(a.number));
      continue;
    }
    if (b.grounded) {
      if (!b.felt_known) b.felt = b.pose.turned_to_frame(g);
      b.felt_known = true;
      continue;
    }
    if (new_gravity) {
      if (b.felt_known && wake_up_.gravity_changed(b.pose.turned_to_frame(g - b.acceleration), b.felt, granules))
        wake_body(key_of(a.number));
      begin();
      continue;
    }
    if (b.step_then < 0) {
      begin();
      continue;
    }
    const double window = std::max<double>(look_every_, steps_per_granule * std::cbrt(granules));
    const double steps = static_cast<double>(now - b.step_then);
    if (steps < window) continue;
    b.acceleration = (b.motion.velocity() - b.velocity_then) / (steps * update->dt);
    const Vec3 feels = b.pose.turned_to_frame(g - b.acceleration);
    if (!b.felt_known) {
      b.felt = feels;
      b.felt_known = true;
    } else if (wake_up_.gravity_changed(feels, b.felt, granules)) {
      wake_body(key_of(a.number));
    }
    begin();
  }
}

}  // namespace solidcull
