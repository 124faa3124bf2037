#include "solid_bodies.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "internal_error.h"
#include "parts_that_came_off.h"

namespace solidcull {

void MassProperties::add(const GranuleMass& g, double turning_radius, int sign) {
  if (count == 0) {
    *this = MassProperties();
    about = g.position;
  }
  count += sign;
  if (g.held) held += sign;
  if (g.mass == 0) return;
  weighing += sign;
  const Vec3 arm = (g.clump ? g.clump->centre : g.position) - about;
  mass += sign * g.mass;
  first += sign * g.mass * arm;
  second += sign * g.mass * arm * arm.transpose();
  if (g.clump)
    second += sign * g.clump->second();
  else
    spin += sign * 0.4 * g.mass * turning_radius * turning_radius;
  drop_rounding();
}

/// What is left of the sums where nothing has mass.
void MassProperties::drop_rounding() {
  if (weighing > 0) return;
  mass = spin = 0;
  first = Vec3::Zero();
  second = Eigen::Matrix3d::Zero();
}

void MassProperties::add(const MassProperties& other, int sign) {
  if (count == 0) {
    *this = MassProperties();
    about = other.about;
  }
  const Vec3 arm = other.about - about;
  count += sign * other.count;
  weighing += sign * other.weighing;
  mass += sign * other.mass;
  first += sign * (other.first + other.mass * arm);
  second +=
      sign * (other.second + other.first * arm.transpose() + arm * other.first.transpose() + other.mass * arm * arm.transpose());
  spin += sign * other.spin;
  held += sign * other.held;
  drop_rounding();
}

Eigen::Matrix3d MassProperties::inertia() const {
  if (weighing == 0) return Eigen::Matrix3d::Zero();
  const Eigen::Matrix3d about_centre = second - first * first.transpose() / mass;
  return (about_centre.trace() + spin) * Eigen::Matrix3d::Identity() - about_centre;
}

MassProperties MassProperties::seen_from(const Pose& here, const Pose& there) const {
  const Eigen::Matrix3d turn = there.turn().transpose() * here.turn();
  MassProperties p = *this;
  p.about = there.to_frame(here.to_world(about));
  p.first = turn * first;
  p.second = turn * second * turn.transpose();
  return p;
}

RigidPart SolidBody::part() const {
  const Eigen::Matrix3d turn = pose.turn();
  const Vec3 centre = pose.to_world(mass.centre());
  return {mass.mass, centre, turn * mass.inertia() * turn.transpose(), twist.at(centre), twist.spin};
}

FreeAxes SolidBody::free_axes(const std::array<bool, 3>& spans) {
  return {!spans[1] && !spans[2], !spans[0] && !spans[2], !spans[0] && !spans[1]};
}

namespace {

// of a coordinate: what the sums of a body that has rested a while leave, and no granule of it shows
constexpr double last_digits = 16 * std::numeric_limits<double>::epsilon();

}  // namespace

void SolidBody::ground(bool on) {
  // the world's frame is cheaper, and all that stand in it share it
  if (on && pose.quaternion().vec().norm() <= last_digits && pose.origin().norm() <= last_digits * mass.centre().norm())
    pose = Pose();
  grounded = on;
  grounded_mass = on ? mass.mass : 0.0;
  begin_to_rest();
  changed = true;
  step_then = -1;
  acceleration = Vec3::Zero();
  twist = {pose.to_world(mass.centre()), Vec3::Zero(), is_one_sphere() ? twist.spin : Vec3(Vec3::Zero())};
}

void SolidBody::begin_to_rest() {
  looks_at_rest = 0;
  pressed = false;
  extra_load = Vec3::Zero();
}

void SolidBody::reframe_one(const GranuleMass& in_world, double turning_radius) {
  felt = pose.turned_to_world(felt);
  mass = MassProperties();
  mass.add(in_world, turning_radius);
  pose = Pose();
}

void SolidBody::settle() {
  changed = false;
  if (mass.weighing == 0) return;  // spheres of clumps whose mass has been lost: they will be, too
  const RigidPart all = part();
  motion = RigidMotion(&all, 1, free_axes());
  take_twist();
}

void SolidBody::stand_as(const SolidBody& from, double granule_mass) {
  const double before = grounded_mass;
  if (!grounded) ground(true);
  grounded_mass = before + (from.mass.mass > 0 ? granule_mass * from.grounded_mass / from.mass.mass : 0.0);
}

void SolidBody::settle_as_part(const RigidSum& whole, const FreeAxes& free, const Vec3& shift, double grounded_share) {
  if (grounded) grounded_mass = grounded_share * mass.mass;
  const Vec3 before = motion.velocity();
  motion = RigidMotion(whole, free);
  motion.shift(-shift);
  if (grounded) motion.stop();
  velocity_then += motion.velocity() - before;
  take_twist();
  changed = false;
}

void SolidBody::feel_as(const SolidBody& from) {
  if (felt_known || !from.felt_known) return;
  feel(pose.turned_to_frame(from.pose.turned_to_world(from.felt)));
  acceleration = from.acceleration;
}

int SolidBodies::root(int body) const {
  while (parent_[body] != body) body = parent_[body] = parent_[parent_[body]];
  return body;
}

int SolidBodies::body_of(std::int64_t tag) const {
  const int* body = member_.find(narrow_tag(tag));
  if (body) return root(*body);
  const int other = elsewhere_ ? elsewhere_(tag) : 0;
  return other ? root(other) : 0;
}

const Pose& SolidBodies::pose(int number) const {
  const auto gone = swallowed_.find(number);
  return gone == swallowed_.end() ? body(number).pose : gone->second;
}

Vec3 SolidBodies::to_image_of(const Vec3& there) const {
  Vec3 shift = Vec3::Zero();
  for (int d = 0; d < 3; ++d)
    if (periods_[d] > 0) shift[d] = -periods_[d] * std::round(there[d] / periods_[d]);
  return shift;
}

Vec3 SolidBodies::nearest_image(const Vec3& x, const Vec3& to) const { return x + to_image_of(x - to); }

int SolidBodies::found() { return found(SolidBody()); }

int SolidBodies::found(const SolidBody& body) {
  const int number = static_cast<int>(parent_.size());
  parent_.push_back(number);
  bodies_.emplace(number, body);
  return number;
}

/// Asking for a body that is not there must not found one without mass.
const SolidBody& SolidBodies::body(int number) const {
  const auto living = bodies_.find(number);
  if (living == bodies_.end()) throw InternalError("there is no solid body " + std::to_string(number));
  return living->second;
}

/// The mean acceleration is that of the centre of mass: where the centre is another one now, the velocity that it began with is
/// too. Of a body over ranks nobody knows it before it is settled.
void SolidBodies::centre_moved(SolidBody& body, const Vec3& from) {
  if (body.spanned) return;
  const Vec3 to = body.pose.to_world(body.mass.centre());
  body.velocity_then += body.twist.spin.cross(to - from);
}

RigidPart SolidBodies::part_of(const MovingGranule& g) const {
  if (g.clump) return {g.mass, g.clump->centre, g.clump->tensor(), g.velocity, g.spin};
  return RigidPart::granule(g.mass, turning_radius(g.radius), g.position, g.velocity,
                            granules_turn_ ? g.spin : Vec3(Vec3::Zero()));  // else it keeps its own
}

void SolidBodies::stand_still(SolidBody& body) { body.twist.velocity = body.twist.spin = Vec3::Zero(); }

/// The body's velocity field becomes that of body and part tied together. The mass properties are the caller's.
void SolidBodies::add(SolidBody& body, const RigidPart& part) {
  body.changed = true;
  if (part.mass == 0 && body.mass.count > 0) return;
  if (body.mass.weighing == 0) {
    body.twist = {part.centre, part.velocity, part.spin};
    if (body.grounded) stand_still(body);
    return;
  }
  if (body.grounded) {
    stand_still(body);
    return;
  }
  const RigidPart parts[] = {body.part(), part};
  body.twist = RigidMotion(parts, 2, body.free_axes()).twist();
}

int SolidBodies::merge(int a, int b, Vec3 shift) {
  // the larger body keeps its number, so that colours in pictures stay
  if (body(a).mass.count < body(b).mass.count || (body(a).mass.count == body(b).mass.count && a > b)) {
    std::swap(a, b);
    shift = -shift;
  }
  SolidBody& kept = body(a);
  SolidBody& gone = body(b);
  if (!shift.isZero(0)) {
    gone.pose.shift(shift);
    gone.twist.point += shift;
    for (auto& s : swallowed_)
      if (root(s.first) == b) s.second.shift(shift);
  }
  for (int d = 0; d < 3; ++d) kept.spans[d] = kept.spans[d] || gone.spans[d];
  kept.grounded = kept.grounded || gone.grounded;
  kept.grounded_mass += gone.grounded_mass;
  kept.pressed = kept.pressed || gone.pressed;
  kept.extra_load += gone.extra_load;
  add(kept, gone.part());
  if (kept.felt_known && gone.felt_known) {
    const double both = kept.mass.mass + gone.mass.mass, share = both > 0 ? gone.mass.mass / both : 0.0;
    kept.felt += share * (kept.pose.turned_to_frame(gone.pose.turned_to_world(gone.felt)) - kept.felt);
  }
  kept.step_then = -1;
  kept.mass.add(kept.pose == gone.pose ? gone.mass : gone.mass.seen_from(gone.pose, kept.pose));
  kept.summed = std::max(kept.summed, kept.mass.count);
  swallowed_[b] = gone.pose;
  bodies_.erase(b);
  parent_[b] = a;
  return a;
}

int SolidBodies::tie(int a, Vec3& position_in_a, int b, const Vec3& position_in_b) {
  const Vec3 shift = to_image_of(position_in_b - position_in_a);
  if (a == b) {
    for (int d = 0; d < 3; ++d)
      if (shift[d] != 0 && !body(a).spans[d]) body(a).spans[d] = body(a).changed = true;
    return a;
  }
  const int kept = merge(a, b, shift);
  if (kept != a) position_in_a -= shift;
  return kept;
}

SolidBodies::Place SolidBodies::lock(std::int64_t tag, const MovingGranule& granule, const FrozenContacts& contacts,
                                     const MassOf& mass_of) {
  int number = 0;
  Vec3 position = granule.position;
  const auto join = [&](int body) {
    SolidBody& b = this->body(body);
    const bool first = b.mass.count == 0;
    const Vec3 before = first ? Vec3(Vec3::Zero()) : b.pose.to_world(b.mass.centre());
    MovingGranule here = granule;
    here.position = position;
    if (here.clump) here.clump->move(position - granule.position);
    add(b, part_of(here));
    GranuleMass mass{granule.mass, b.pose.to_frame(position), granule.radius, granule.held, std::nullopt};
    if (here.clump) mass.clump = here.clump->in_frame(b.pose);
    b.mass.add(mass, turning_radius(granule.radius));
    b.summed = std::max(b.summed, b.mass.count);
    if (!first) centre_moved(b, before);
    member_[narrow_tag(tag)] = number = body;
  };
  contacts.for_each_partner(tag, [&](std::int64_t partner) {
    const int theirs = body_of(partner);
    if (!theirs) return;
    if (number == theirs && (periods_.array() == 0).all()) return;
    const Vec3 there = body(theirs).pose.to_world(mass_of(partner).position);
    if (!number) {
      position -= to_image_of(there - position);
      join(theirs);
    } else {
      number = tie(number, position, theirs, there);
    }
  });
  if (!number) join(found());
  return {number, body(number).pose.to_frame(position)};
}

void SolidBodies::join(std::int64_t a, std::int64_t b, const MassOf& mass_of) {
  const int of_a = body_of(a), of_b = body_of(b);
  if (!of_a || !of_b) return;
  Vec3 in_a = body(of_a).pose.to_world(mass_of(a).position);
  tie(of_a, in_a, of_b, body(of_b).pose.to_world(mass_of(b).position));
}

void SolidBodies::unlock(std::int64_t tag, const GranuleMass& granule, const FrozenContacts& contacts,
                         const MovingGranule* given) {
  const int number = body_of(tag);
  if (!number) return;
  member_.erase(narrow_tag(tag));
  contacts.for_each_partner(tag, [&](std::int64_t partner) { cut_.push_back(partner); });
  SolidBody& body = this->body(number);
  body.changed = true;
  const Vec3 before = body.pose.to_world(body.mass.centre());
  body.mass.add(granule, turning_radius(granule.radius), -1);
  if (body.mass.count == 0) {
    bodies_.erase(number);
    return;
  }
  centre_moved(body, before);
  if (body.grounded) stand_still(body);
  if (!given || given->mass == 0 || body.mass.weighing == 0 || body.grounded) return;
  // the difference to the body's own field stays with the body
  RigidPart rest = body.part();
  RigidPart difference = part_of(*given);
  difference.velocity = body.twist.at(difference.centre) - difference.velocity;
  difference.spin = body.twist.spin - difference.spin;
  const Vec3 momentum = difference.mass * difference.velocity;
  const Vec3 turning = difference.angular_momentum(rest.centre);
  RigidMotion motion(&rest, 1, body.free_axes());
  motion.kick(momentum, turning, 1.0);
  body.twist = motion.twist();
}

void SolidBodies::sum_anew(int number, std::int64_t member, const FrozenContacts& contacts, const MassOf& mass_of) {
  // what was added and taken away leaves rounding behind, which would grow against a body that shrinks
  std::vector<std::int64_t> reached = {member};
  FlatMap<char> seen;
  seen[member] = 1;
  for (std::size_t at = 0; at < reached.size(); ++at)
    contacts.for_each_partner(reached[at], [&](std::int64_t partner) {
      if (!is_member(partner) || seen.contains(partner)) return;
      seen[partner] = 1;
      reached.push_back(partner);
    });
  MassProperties sum;
  for (const std::int64_t tag : reached) {
    const GranuleMass g = mass_of(tag);
    sum.add(g, turning_radius(g.radius));
  }
  body(number).mass = sum;
  body(number).summed = sum.count;
}

void SolidBodies::split(const FrozenContacts& contacts, const MassOf& mass_of,
                        const std::function<void(std::int64_t, int, const Vec3&)>& moved) {
  std::map<int, std::vector<std::int64_t>> sources;
  for (const std::int64_t tag : cut_)
    if (const int body = body_of(tag)) sources[body].push_back(tag);
  cut_.clear();

  split_parents_.clear();
  for (auto& [body, tags] : sources) {
    std::sort(tags.begin(), tags.end());
    tags.erase(std::unique(tags.begin(), tags.end()), tags.end());
    const SolidBody& before = this->body(body);
    const bool was_grounded = before.grounded;
    const double grounded_mass = before.grounded_mass, whole = before.mass.mass;
    for (const std::vector<std::int64_t>& part : parts_that_came_off(
             tags, contacts, [&](std::int64_t tag) { return is_member(tag); },
             [&](std::int64_t tag) { return mass_of(tag).position; })) {
      const int fresh = found();
      SolidBody& off = this->body(fresh);
      SolidBody& rest = this->body(body);
      off = rest;  // same frame, same velocity field, same load at locking
      off.mass = MassProperties();
      off.begin_to_rest();
      off.step_then = rest.step_then = -1;
      off.changed = rest.changed = true;
      off.spans = {};
      MassProperties gone;
      for (const std::int64_t tag : part) {
        const GranuleMass g = mass_of(tag);
        gone.add(g, turning_radius(g.radius));
      }
      rest.mass.add(gone, -1);
      // what was tied to its own image may hang free of it now: its places are brought together again
      FlatMap<int> index;
      std::vector<Vec3> place;
      const bool tied = rest.spans[0] || rest.spans[1] || rest.spans[2];
      std::vector<std::int64_t> order = {part.front()};
      index[order.front()] = 0;
      place.push_back(mass_of(order.front()).position);
      for (std::size_t at = 0; at < order.size(); ++at) {
        const Vec3 here = place[at];
        contacts.for_each_partner(order[at], [&](std::int64_t partner) {
          if (!is_member(partner)) return;
          const int* known = index.find(partner);
          const Vec3 there = known ? place[*known] : mass_of(partner).position;
          const Vec3 shift = tied ? to_image_of(off.pose.turned_to_world(there - here)) : Vec3(Vec3::Zero());
          if (known) {
            for (int d = 0; d < 3; ++d) off.spans[d] = off.spans[d] || shift[d] != 0;
            return;
          }
          index[partner] = static_cast<int>(order.size());
          place.emplace_back(there + off.pose.turned_to_frame(shift));
          order.push_back(partner);
        });
      }
      for (std::size_t at = 0; at < order.size(); ++at) {
        GranuleMass g = mass_of(order[at]);
        if (g.clump) g.clump->move(place[at] - g.position);
        g.position = place[at];
        off.mass.add(g, turning_radius(g.radius));
        if (int* member = member_.find(narrow_tag(order[at]))) *member = fresh;
        moved(order[at], fresh, place[at]);
      }
      off.summed = off.mass.count;
      if (was_grounded) stand_still(off);
      off.grounded = was_grounded && off.mass.held > 0;
      rest.grounded = was_grounded && rest.mass.held > 0;
      const double share = whole > 0 ? std::min(1.0, grounded_mass / whole) : 0.0;
      off.grounded_mass = off.grounded ? share * off.mass.mass : 0.0;
      rest.grounded_mass = rest.grounded ? share * rest.mass.mass : 0.0;
      split_parents_.push_back(body);
    }
    for (const std::int64_t tag : tags) {
      const int left = body_of(tag);
      const SolidBody& b = this->body(left);
      if (2 * b.mass.count < b.summed) sum_anew(left, tag, contacts, mass_of);
    }
  }
}

}  // namespace solidcull
