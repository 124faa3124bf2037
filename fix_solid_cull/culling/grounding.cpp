#include "grounding.h"

#include <algorithm>
#include <cmath>

namespace solidcull {
namespace {

// looks in a row at rest, and in balance, before walls are taken to hold a body: what it weighs on them then is what they will
// feel
constexpr int looks_to_ground = 2;
// a body that merges with a grounded one is grounded, but not for long where it is the larger of the two and may still move
constexpr double grounded_share = 0.5;
// what a grounded body presses on its walls with beyond what is frozen, in its weight: beyond, the walls might not hold it, and
// it moves as a rigid body with live contacts at the walls again
constexpr double along_share = 0.1, against_share = 0.5;
// a wall's load below this share of a granule's weight is none
constexpr double no_load = 1e-6;

}  // namespace

void Grounding::goes(int i, int&, std::vector<WallLoad>& loads) {
  if (walls_[i].near && bed_.scales.sleeping()) loads = wall_loads_on(i);
}

std::vector<WallLoad> Grounding::wall_loads_on(int i) const {
  const Locked& e = bed_.shell[i];
  const double mass = bed_.atoms.mass[i];
  std::vector<WallLoad> loads = bed_.walls.loads_on(bed_.atoms.tag[i]);
  WallLoad rest;
  rest.mesh = WallLoad::no_mesh;
  rest.force = bed_.solid.bodies().pose(e.body).turned_to_world(e.reference + e.load_change) - mass * bed_.run.gravity();
  for (const WallLoad& load : loads) rest.force -= load.force;
  if (rest.force.norm() < no_load * mass * bed_.scales.gravity()) return loads;
  // walls are not told apart, but by the side from which they push most
  int axis = 0;
  rest.force.cwiseAbs().maxCoeff(&axis);
  rest.element = 2 * axis + (rest.force[axis] > 0);
  loads.push_back(rest);
  return loads;
}

// ------------------------------------------------------------------------------------------------------------ bodies

void Grounding::let_go() {
  for (const int body : to_let_go_)
    if (bed_.solid.exists(body)) bed_.solid.ground(body, false);
  to_let_go_.clear();
}

// ------------------------------------------------------------------------------------------------------------ a look

/// Of bodies that span ranks: which have a part that walls hold.
std::vector<char> Grounding::held_over_ranks() const {
  std::vector<char> held;
  for (std::size_t p = 0; p < bed_.groups.spanning_parts(); ++p) {
    const SolidBody* const part = bed_.groups.part(p);
    held.push_back(part && part->mass.held > 0);
  }
  bed_.groups.unite(held, [](char& whole, char other) { whole |= other; });
  return held;
}

bool Grounding::may_be_let_go(const SolidBody& body, bool held) const {
  if (body.grounded_mass < grounded_share * body.mass.mass) return true;
  if (!body.pressed) return !held;
  const Vec3 g = bed_.run.gravity();
  const Vec3 down = g.norm() > 0 ? Vec3(g.normalized()) : Vec3(Vec3::Zero());
  const double weight = body.motion.mass() * bed_.scales.gravity(), along = body.extra_load.dot(down);
  const bool holds =
      -along < against_share * weight && (body.extra_load - along * down).norm() < along_share * (weight + std::max(0.0, along));
  return !held || !holds;
}

bool Grounding::is_at_rest(const SolidBody& body, const ActiveBody& loads, const int* only_atom) const {
  const double slow = SolidStateLaw::drift_share * bed_.scales.solid_state().speed;
  const double size = std::cbrt(static_cast<double>(body.mass.count)) * bed_.scales.diameter();
  const double balance = Solid::balance_share * body.motion.mass() * bed_.scales.gravity(), turns = body.twist.spin.norm() * size;
  // one granule may spin on the spot for ever: nothing brakes it where it touches the wall
  const bool spins_on_the_spot =
      only_atom && walls_[*only_atom].slip < slow && loads.torque.norm() < balance * bed_.atoms.radius[*only_atom];
  return loads.force.norm() < balance &&
         body.twist.at(body.pose.to_world(body.mass.centre())).norm() + (spins_on_the_spot ? 0.0 : turns) < slow;
}

std::vector<char> Grounding::update() {
  const std::vector<char> held_over_all = held_over_ranks();
  std::vector<char> grounds(held_over_all.size(), 0);
  FlatMap<const ActiveBody*> loads;
  for (const ActiveBody& a : motion_.active()) loads[a.number] = &a;
  FlatMap<int> only_atom;  // of bodies of one granule
  for (const int i : motion_.interface_atoms())
    if (bed_.solid.bodies().body(bed_.shell[i].body).is_one_sphere()) only_atom[bed_.shell[i].body] = i;
  for (auto& [number, body] : bed_.solid.bodies_in_motion()) {
    const int over_ranks = bed_.groups.spanning(number);
    const bool held = over_ranks < 0 ? body.mass.held > 0 : held_over_all[static_cast<std::size_t>(over_ranks)] != 0;
    if (body.grounded) {
      if (may_be_let_go(body, held)) to_let_go_.insert(number);
      continue;
    }
    const ActiveBody* const* of = loads.find(number);
    const int* one = only_atom.find(number);
    if (body.rests(held && of && is_at_rest(body, **of, one)) < looks_to_ground) continue;
    if (over_ranks >= 0) {
      grounds[static_cast<std::size_t>(over_ranks)] = 1;
      continue;
    }
    // a body of one granule has moved as the granule alone would: it is culled only now that it stands
    if (one && body.pose != Pose()) {
      bed_.shell.to_world_frame(*one, body.pose);
      bed_.solid.reframe_one(number, bed_.masses.of_atom(*one));
    }
    bed_.solid.ground(number, true);
  }
  // a body that turns may rest for one of its ranks first
  bed_.groups.unite(grounds, [](char& whole, char other) { whole |= other; });
  for (std::size_t p = 0; p < grounds.size(); ++p)
    if (grounds[p] && bed_.groups.part(p)) bed_.solid.ground(bed_.groups.body_of_part(p), true);
  return grounds;
}

void Grounding::share_out_loads() {
  std::vector<double> weights(bed_.groups.spanning_parts(), 0.0);
  std::vector<std::pair<const ActiveBody*, double>> sums;
  for (const ActiveBody& a : motion_.active()) {
    if (!a.stands || !a.body->pressed) continue;
    sums.emplace_back(&a, bed_.solid.weigh_wall_loads(a.number, a.body->extra_load));
    if (a.spanning >= 0) weights[static_cast<std::size_t>(a.spanning)] += sums.back().second;
  }
  bed_.groups.unite(weights, [](double& whole, double other) { whole += other; });
  for (const auto& [a, sum] : sums)
    bed_.solid.share_out_wall_loads(a->number, a->spanning >= 0 ? weights[static_cast<std::size_t>(a->spanning)] : sum);
}

// ------------------------------------------------------------------------------------------------------------ a step

void Grounding::press_on_walls() {
  for (const auto& [place, force, torque] : bed_.solid.wall_loads().on_meshes())
    bed_.walls.press(place.first, place.second, -force, -torque);
  // a body that stands still in spite of a load hands it on to the walls that hold it
  for (const ActiveBody& a : motion_.active()) {
    if (!a.stands) continue;
    a.body->bear(a.change, bed_.scales.look_every());
    if (a.change.isZero(0)) continue;
    for (const auto& [place, share, at] : bed_.solid.wall_loads().bearing(a.number)) {
      const Vec3 extra = share * a.change;
      bed_.walls.press(place.first, place.second, extra, at.cross(extra));  // where the element bears its own load
    }
  }
}

}  // namespace solidcull
