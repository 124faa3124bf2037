#include "body_motion.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "numbers.h"
#include "release.h"
#include "run_failure.h"

namespace solidcull {

namespace {

// what presses on a body that stands, and is less than this share of a granule's weight, is not told to other ranks at once
constexpr double no_difference = 0.01;

bool moves_by_numbers(const SolidBody& b) {
  return std::isfinite(b.pose.origin().sum() + b.pose.quaternion().coeffs().sum() + b.twist.velocity.sum() + b.twist.spin.sum());
}

}  // namespace

void BodyMotion::refresh() {
  if (!stale()) return;
  stale_ = false;
  listed_ = bed_.shell.version();
  active_.clear();
  atoms_.clear();
  slot_.clear();
  place_.clear();
  riding_.clear();
  clumps_.clear();
  if (bed_.solid.bodies().bodies().empty()) return;
  const Atoms& atoms = bed_.atoms;
  FlatMap<int> slot;
  FlatMap<char> has_atoms;
  for (int i = 0; i < atoms.owned; ++i)
    if (bed_.shell[i].in_body()) has_atoms[bed_.shell[i].body] = 1;
  const Vec3 g = bed_.run.gravity();
  for (auto& [number, body] : bed_.solid.bodies_in_motion()) {
    // what sleeps on the ground and has no atoms costs nothing
    const int spanning = bed_.groups.spanning(number);
    if (body.grounded && spanning < 0 && !has_atoms.contains(number) && bed_.solid.walls_bear(number, g)) continue;
    slot[number] = static_cast<int>(active_.size());
    active_.push_back({number, &body});
    active_.back().stands = bed_.solid.stands(number);
    active_.back().spanning = spanning;
  }
  bed_.solid.store().for_each_body([&](int body, const Vec3& lo, const Vec3& hi) {
    const int* s = slot.find(body);
    if (!s && !bed_.solid.exists(body))
      throw InternalError("interior granules belong to body " + std::to_string(body) + ", which is not there");
    if (!s || active_[*s].stands) return;
    const SolidBody& b = *active_[*s].body;
    active_[*s].reach = (b.pose.to_world(0.5 * (lo + hi)) - b.motion.centre()).norm() + 0.5 * (hi - lo).norm();
  });
  for (int i = 0; i < atoms.owned; ++i) {
    if (!bed_.shell[i].locked || bed_.shell[i].body == Locked::arriving) continue;
    const int* s = slot.find(bed_.shell[i].body);
    if (!s) throw InternalError("interface granule " + std::to_string(atoms.tag[i]) + " belongs to no body");
    atoms_.push_back(i);
    slot_.push_back(static_cast<std::size_t>(*s));
    if (!active_[*s].stands) riding_.push_back(atoms_.size() - 1);
    place_.push_back(bed_.shell[i].place);
  }
  if (bed_.clumps.possible) list_clumps();
}

void BodyMotion::list_clumps() {
  FlatMap<int> place;
  for (const int i : atoms_) {
    const Locked& e = bed_.shell[i];
    if (e.clump == 0 || e.spheres == Locked::some_lost) continue;
    const auto known = place.find(e.clump);
    const std::size_t at = known ? static_cast<std::size_t>(*known) : clumps_.size();
    if (!known) {
      place[e.clump] = static_cast<int>(at);
      clumps_.emplace_back();
    }
    clumps_[at].atoms.push_back(i);
    clumps_[at].share = static_cast<double>(clumps_[at].atoms.size()) / e.spheres;
  }
}

void BodyMotion::refresh_in_step() {
  const std::vector<ActiveBody> before = active_;
  refresh();
  FlatMap<const ActiveBody*> known;
  for (const ActiveBody& a : before) known[a.number] = &a;
  for (ActiveBody& a : active_) {
    const ActiveBody* const* then = known.find(a.number);
    if (!then || a.stands) continue;
    a.force = (*then)->force;
    a.torque = (*then)->torque;
    a.way = (*then)->way;
  }
}

// ------------------------------------------------------------------------------------------------------------ loads

/// The load on interface granule number k goes to its body, about the frame's origin for now.
inline void BodyMotion::add_to_body(std::size_t k, const Vec3& contact, const Vec3& torque) {
  ActiveBody& a = active_[slot_[k]];
  a.force += contact;
  a.torque += (a.body->pose.turn() * place_[k]).cross(contact) + torque;
}

void BodyMotion::take_loads() {
  largest_excess_ = 0;
  const bool turns = bed_.contacts.turn_granules;
  const Vec3 g = bed_.run.gravity();
  const WakeUpLaw& law = bed_.scales.wake_up();
  Atoms& atoms = bed_.atoms;
  for (ActiveBody& a : active_) a.force = a.torque = a.change = Vec3::Zero();
  for (std::size_t k = 0; k < atoms_.size(); ++k) {
    const int i = atoms_[k];
    const Vec3 in_world = atoms.force(i), torque = vec(atoms.torque + 3 * std::size_t(i));
    if (!std::isfinite(in_world.sum() + torque.sum())) refuse_no_number(atoms.tag[i], "load", in_world);
    ActiveBody& a = active_[slot_[k]];
    if (!a.stands) add_to_body(k, in_world - atoms.mass[i] * g, turns ? torque : Vec3(Vec3::Zero()));
    if (a.stands) a.change += in_world - atoms.mass[i] * g;
    const double tolerance = law.tolerance(atoms.mass[i], bed_.shell[i].normal_load);
    largest_excess_ = std::max(largest_excess_, bed_.shell.take_load(i, a.body->pose.turned_to_frame(in_world), tolerance));
    atoms.clear_force(i);
    if (turns) atoms.clear_torque(i);  // else what walls turn is the granule alone: the engine's integrator sees to that
  }
  if (!clumps_.empty()) take_loads_of_clumps();
  if (bed_.scales.sleeping())
    for (ActiveBody& a : active_)
      if (a.stands) a.change += bed_.solid.wall_loads().force(a.number) + a.body->mass.mass * g;
  // contacts and other forces on interface granules are there; gravity pulls the whole mass
  for (ActiveBody& a : active_) a.torque += (a.body->pose.origin() - a.body->motion.centre()).cross(a.force);
  sum_over_ranks();
  for (ActiveBody& a : active_) a.force += a.body->motion.mass() * g;
}

/// Besides what each of its spheres bears: what the clump bears as a whole. A rank that has some of its spheres only lets these
/// have their share of the tolerance, so that all together have it at most.
void BodyMotion::take_loads_of_clumps() {
  for (const ClumpHere& c : clumps_) {
    const int first = c.atoms.front();
    Vec3 change = Vec3::Zero();
    for (const int i : c.atoms) change += bed_.shell[i].load_change;
    const double tolerance = c.share * bed_.scales.wake_up().tolerance(bed_.atoms.mass[first], bed_.shell[first].normal_load);
    const double excess = change.norm() / tolerance;
    bed_.shell.raise_excess(first, excess);
    largest_excess_ = std::max(largest_excess_, excess);
  }
}

void BodyMotion::sum_over_ranks() {
  struct Loads {
    Triple force, torque, change;
  };
  const std::size_t parts = bed_.groups.spanning_parts();
  differs_ = false;
  if (parts == 0) return;
  const bool tells = std::exchange(tells_, false) || told_.size() != parts;
  told_.resize(parts);
  std::vector<Loads> all(parts, Loads{});
  std::vector<char> stands(parts, 0);
  for (const ActiveBody& a : active_) {
    if (a.spanning < 0) continue;
    const std::size_t p = static_cast<std::size_t>(a.spanning);
    all[p] = {triple(a.force), triple(a.torque), triple(a.change)};
    stands[p] = a.stands;
    const double granule = a.body->mass.mass / static_cast<double>(a.body->mass.count) * bed_.scales.gravity();
    differs_ = differs_ || (a.stands && (a.change - told_[p].here).norm() > no_difference * granule);
    if (tells) told_[p].here = a.change;
  }
  bed_.groups.unite(
      all,
      [](Loads& one, const Loads& other) {
        for (int d = 0; d < 3; ++d) {
          one.force[d] += other.force[d];
          one.torque[d] += other.torque[d];
          one.change[d] += other.change[d];
        }
      },
      [&](int place) { return tells || !stands[static_cast<std::size_t>(place)]; });
  for (ActiveBody& a : active_) {
    if (a.spanning < 0) continue;
    const std::size_t p = static_cast<std::size_t>(a.spanning);
    a.force = vec(all[p].force);
    a.torque = vec(all[p].torque);
    if (tells) told_[p].all = vec(all[p].change);
    a.change = told_[p].all;
  }
}

// ------------------------------------------------------------------------------------------------------------ motion

void BodyMotion::kick_and_drift() {
  const Run& run = bed_.run;
  const Vec3 edges = run.edges();
  for (ActiveBody& a : active_) {
    if (a.stands) continue;
    SolidBody& b = *a.body;
    b.kick(a.force, a.torque, 0.5 * run.dt);
    b.drift(run.dt);
    a.way += way_in_a_step(a);
    for (int d = 0; d < 3; ++d) {
      const double c = b.motion.centre()[d];
      if (!run.periodic[d] || (c >= run.box.lo[d] && c < run.box.hi[d])) continue;
      Vec3 shift = Vec3::Zero();
      shift[d] = c < run.box.lo[d] ? edges[d] : -edges[d];
      b.shift(shift);
    }
    b.take_twist();
    if (!moves_by_numbers(b)) stop_at(a);
  }
}

/// A load too large for its time step has taken the body out of all numbers.
void BodyMotion::stop_at(const ActiveBody& a) const {
  const auto at = std::find_if(atoms_.begin(), atoms_.end(), [&](int i) { return bed_.shell[i].body == a.number; });
  if (at == atoms_.end())
    throw RunFailure("the motion of solid body " + std::to_string(a.number) + " is no number: take a smaller timestep");
  const Twist& t = a.body->twist;
  const bool goes = std::isfinite(t.velocity.sum());
  refuse_no_number(bed_.atoms.tag[*at], goes ? "spin" : "velocity", goes ? t.spin : t.velocity);
}

void BodyMotion::kick() {
  for (ActiveBody& a : active_) {
    if (a.stands) continue;
    a.body->kick(a.force, a.torque, 0.5 * bed_.run.dt);
    a.body->take_twist();
  }
}

double BodyMotion::way_in_a_step(const ActiveBody& a) const {
  return a.reach > 0 ? bed_.run.dt * (a.body->motion.velocity().norm() + a.body->motion.spin().norm() * a.reach) : 0.0;
}

bool BodyMotion::comes_too_far(int steps) const {
  return std::any_of(active_.begin(), active_.end(),
                     [&](const ActiveBody& a) { return a.way + steps * way_in_a_step(a) > 0.5 * bed_.run.skin; });
}

/// The velocity field over places in the body's frame: v = constant + gradient * place.
struct BodyMotion::FieldInFrame {
  Vec3 constant;
  Eigen::Matrix3d gradient;
  explicit FieldInFrame(const SolidBody& b) : constant(b.twist.at(b.pose.origin())) {
    for (int d = 0; d < 3; ++d) gradient.col(d) = b.twist.spin.cross(b.pose.turn().col(d));
  }
  Vec3 at(const Vec3& place) const { return constant + gradient * place; }
};

std::vector<BodyMotion::FieldInFrame> BodyMotion::fields() const {
  std::vector<FieldInFrame> fields;
  fields.reserve(active_.size());
  for (const ActiveBody& a : active_) fields.emplace_back(*a.body);
  return fields;
}

void BodyMotion::place() {
  const bool periodic = bed_.run.any_periodic();
  const std::vector<FieldInFrame> of = fields();
  Atoms& atoms = bed_.atoms;
  for (const std::size_t k : riding_) {
    const int i = atoms_[k];
    const SolidBody& b = *active_[slot_[k]].body;
    const Vec3 x = b.pose.to_world(place_[k]);
    atoms.set_place(i, periodic ? bed_.solid.nearest_image(x, atoms.place(i)) : x);
    atoms.set_velocity(i, of[slot_[k]].at(place_[k]));
    if (bed_.contacts.turn_granules) atoms.set_spin(i, b.twist.spin);
  }
}

void BodyMotion::give_velocity(std::size_t k, const std::vector<FieldInFrame>& of) {
  bed_.atoms.set_velocity(atoms_[k], of[slot_[k]].at(place_[k]));
  if (bed_.contacts.turn_granules) bed_.atoms.set_spin(atoms_[k], active_[slot_[k]].body->twist.spin);
}

void BodyMotion::give_velocities_to_riders() {
  const std::vector<FieldInFrame> of = fields();
  for (const std::size_t k : riding_) give_velocity(k, of);
}

void BodyMotion::give_velocities() {
  const std::vector<FieldInFrame> of = fields();
  for (std::size_t k = 0; k < atoms_.size(); ++k) give_velocity(k, of);
}

void BodyMotion::release_memory() { release(atoms_, slot_, place_, riding_); }

}  // namespace solidcull
