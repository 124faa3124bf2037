// Bodies that walls hold: they stand still, so that their granules at walls may go to the store too, and hand on to the walls
// what presses on them.
#include <mpi.h>

#include <algorithm>
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

// looks in a row at rest, and in balance to this share of its weight, before walls are taken to hold a body: what it weighs on
// them then is what they will feel
constexpr int looks_at_rest = 2;
constexpr double balance_share = 0.002;
// a body that merges with a grounded one is grounded, but not for long where it is the larger of the two and may still move
constexpr double grounded_share = 0.5;
// what a grounded body presses on its walls with beyond what is frozen, in its weight: beyond, the walls might not hold it, and
// it moves as a rigid body with live contacts at the walls again
constexpr double along_share = 0.1, against_share = 0.5;
// interface granules that nothing holds any more go to the store at the next rebuild of the neighbour lists; for this share of
// all atoms, at once
constexpr double worth_of_a_build = 0.05;

}  // namespace

/// The walls' frozen loads on this rank's stored granules of the body are in balance with its weight.
bool FixSolidCull::walls_bear(int body) const {
  const double mass = bodies_.body(body).mass.mass;
  return (wall_loads_.force(body) + mass * gravity()).norm() < balance_share * mass * weight_scale_;
}

/// What walls do to an interface granule that nothing else touches: what meshes that report their load do to it, and the rest.
std::vector<WallLoad> FixSolidCull::wall_loads_on(int i) {
  const ShellEntry& e = shell_[i];
  std::vector<WallLoad> loads = mesh_loads_.of(atom->tag[i]);
  WallLoad rest;
  rest.mesh = WallLoad::no_mesh;
  rest.force = bodies_.pose(e.body).turned_to_world(e.reference + e.load_change) - atom->rmass[i] * gravity();
  for (const WallLoad& load : loads) rest.force -= load.force;
  if (rest.force.norm() < 1e-6 * atom->rmass[i] * weight_scale_) return loads;
  // walls are not told apart, but by the side from which they push most
  int axis = 0;
  rest.force.cwiseAbs().maxCoeff(&axis);
  rest.element = 2 * axis + (rest.force[axis] > 0);
  loads.push_back(rest);
  return loads;
}

bool FixSolidCull::stands_still(int body) const { return !rigid() || bodies_.body(body).grounded; }

void FixSolidCull::set_grounded(int body, bool on) {
  SolidBody& b = bodies_.body(body);
  if (b.grounded == on) return;
  b.grounded = on;
  b.grounded_mass = on ? b.mass.mass : 0.0;
  if (on && store_->holds(body)) ++clear_version_;
  b.changed = true;
  b.step_then = -1;
  b.acceleration = Vec3::Zero();
  // a sphere that spins on the spot stands still too
  b.twist = {b.pose.to_world(b.mass.centre()), Vec3::Zero(), b.is_one_granule() ? b.twist.spin : Vec3(Vec3::Zero())};
  rested_.erase(body);
  pressed_.erase(body);
  clear_of_walls_.erase(body);
  locked_index_stale_ = true;
  find_frame(body);
}

/// Bodies that stand still and have never moved share the world's frame.
void FixSolidCull::find_frame(int body) {
  const SolidBody& b = bodies_.body(body);
  const bool shares = b.grounded && b.pose == Pose();
  if (!shares && store_->frame_of(body) == GranuleStore::shared_frame) clear_of_walls_.erase(body);
  store_->share(body, shares);
}

/// A body of one granule has moved as the granule alone would: it is culled only now that it stands. A sphere is the same
/// whatever way it is turned: its frame becomes the world's, which grounded bodies share.
void FixSolidCull::ground_one(int body, int i) {
  SolidBody& b = bodies_.body(body);
  ShellEntry& e = shell_[i];
  if (b.pose == Pose() || meshes_wanted_) return;
  e.place = b.pose.to_world(e.place);
  e.reference = b.pose.turned_to_world(e.reference);
  e.load_change = b.pose.turned_to_world(e.load_change);
  b.felt = b.pose.turned_to_world(b.felt);
  b.mass = MassProperties();
  b.mass.add(atom->rmass[i], e.place, atom->radius[i], 1, e.held);
  b.pose = Pose();
  at_home_.erase(body);
  drawn_.erase(body);
}

void FixSolidCull::forget_body(int body) {
  store_->forget(body);
  rested_.erase(body);
  pressed_.erase(body);
  clear_of_walls_.erase(body);
}

void FixSolidCull::ground_bodies() {
  if (!rigid()) {
    share_out_loads();
    return;
  }
  // over all ranks a body that spans them is one: which of its parts touch walls
  std::set<int> spanning_held;
  if (comm->nprocs > 1) {
    std::vector<double> keys;
    for (const auto& [number, body] : bodies_.bodies())
      if (body.mass.held > 0 && std::binary_search(spanning_.begin(), spanning_.end(), key_of(number)))
        keys.push_back(key_of(number));
    for (const double key : halo_.gather_all(keys)) spanning_held.insert(static_cast<int>(key));
  }
  const Vec3 g = gravity();
  const Vec3 down = g.norm() > 0 ? Vec3(g.normalized()) : Vec3(Vec3::Zero());
  const double slow = SolidStateLaw::drift_share * solid_state_.speed;
  FlatMap<const ActiveBody*> net;
  for (const ActiveBody& a : active_) net[a.number] = &a;
  FlatMap<int> only;  // body of one granule -> its atom
  for (const int i : locked_index_)
    if (bodies_.body(shell_[i].body).is_one_granule()) only[shell_[i].body] = i;
  for (auto& [number, body] : bodies_.bodies()) {
    const bool held = body.mass.held > 0 || spanning_held.count(key_of(number));
    if (body.grounded) {
      if (rigid() && body.grounded_mass < grounded_share * body.mass.mass) {
        lifting_.insert(number);
        continue;
      }
      const Sum* mean = pressed_.find(number);
      const Vec3* p = mean ? &mean->value : nullptr;
      if (!p && held) continue;
      const double weight = body.motion.mass() * weight_scale_, along = p ? p->dot(down) : 0.0;
      const bool holds =
          !p || (-along < against_share * weight && (*p - along * down).norm() < along_share * (weight + std::max(0.0, along)));
      if (!held || !holds) lifting_.insert(number);  // when its granules at walls can come back
      continue;
    }
    const double size = std::cbrt(static_cast<double>(body.mass.count)) * diameter_;
    const ActiveBody* const* loads = net.find(number);
    const int* one = only.find(number);
    const double balance = balance_share * body.motion.mass() * weight_scale_, turns = body.twist.spin.norm() * size;
    // one granule may spin on the spot for ever: nothing brakes it where it touches the wall
    const bool spins_on_the_spot =
        one && loads && shell_[*one].wall_slip < slow && (*loads)->torque.norm() < balance * atom->radius[*one];
    const bool at_rest = held && loads && (*loads)->force.norm() < balance &&
                         body.twist.at(body.pose.to_world(body.mass.centre())).norm() + (spins_on_the_spot ? 0.0 : turns) < slow;
    if (!at_rest) {
      rested_.erase(number);
      continue;
    }
    if (++rested_[number] < looks_at_rest) continue;
    if (one) ground_one(number, *one);
    set_grounded(number, true);
  }
  if (any_rank(locked_index_stale_)) {
    index_atoms();  // they were sorted since membership changed
    settle_bodies();
    refresh_locked();
    give_velocities();
  }
  share_out_loads();
  // interface granules that might go to the store, but for those that something was near to the last time
  std::size_t may_go = 0;
  for (const int i : locked_index_) may_go += may_leave_its_walls(shell_[i]);
  const double gain = static_cast<double>(may_go) - static_cast<double>(stay_near_);
  store_asked_ = gain > std::max(worth_of_a_build * atom->nlocal, 10.0);
  if (any_rank(!lifting_.empty() || store_asked_)) ask_for_build(update->ntimestep + 1);
}

void FixSolidCull::share_out_loads() {
  // which elements bear what presses on a body: those that bear the body
  std::vector<double> weights(spanning_.size(), 0.0);
  std::vector<std::pair<const ActiveBody*, double>> sums;
  for (const ActiveBody& a : active_) {
    const Sum* p = a.stands ? pressed_.find(a.number) : nullptr;
    if (!p) continue;
    sums.emplace_back(&a, wall_loads_.weigh(a.number, p->value));
    if (a.spanning >= 0) weights[a.spanning] += sums.back().second;
  }
  if (!weights.empty()) MPI_Allreduce(MPI_IN_PLACE, weights.data(), static_cast<int>(weights.size()), MPI_DOUBLE, MPI_SUM, world);
  for (const auto& [a, sum] : sums) wall_loads_.share_out(a->number, a->spanning >= 0 ? weights[a->spanning] : sum);
}

void FixSolidCull::press_on_walls() {
  for (const auto& [place, e] : wall_loads_.of_all()) mesh_loads_.press(place.first, place.second, -e.force, -e.torque);
  // a body that stands still in spite of a load hands it on to the walls that hold it
  for (const ActiveBody& a : active_) {
    if (!a.stands) continue;
    Vec3& mean = pressed_[a.number].value;
    mean += (a.change - mean) / look_every_;
    if (a.change.isZero(0)) continue;
    for (const auto& [place, e] : wall_loads_.of(a.number)) {
      if (!(e.share > 0)) continue;
      const Vec3 extra = e.share * a.change, at = e.force.cross(e.torque) / e.force.squaredNorm();
      mesh_loads_.press(place.first, place.second, extra, at.cross(extra));  // where the element bears its own load
    }
  }
}

}  // namespace solidcull
