// A look: which exterior granules are in solid state and deep enough to be culled, which interface granules are exposed.
#include <mpi.h>

#include <algorithm>
#include <cmath>

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "engine_vectors.h"
#include "fix_solid_cull.h"
#include "force.h"
#include "group.h"
#include "neigh_list.h"
#include "neighbor.h"
#include "pair.h"
#include "update.h"

namespace solidcull {
namespace {

// an interface granule is exposed when this much of its cover (in mean diameters) is gone: less would cull and wake in turns
constexpr double cover_slack = 0.5;
// a granule that moved by less than this share of a voxel since it was last drawn leaves the implicit surface as it is
constexpr double drawn_share = 0.25;
// a wall closer than this share of a granule's radius closes the implicit surface behind itself
constexpr double wall_closes = 0.2;
// culling costs a rebuild of the neighbour lists: it waits for one that comes anyway, until it takes this share of the exterior
// granules, or until a granule has waited for that many looks; where nothing is culled no surface is drawn for fewer
constexpr double worth_share = 0.05;
constexpr int longest_wait = 10;
// a granule still stands at a wall that is this share of its radius away, or nearer
constexpr double wall_still_there = 0.01;
// where culling waits, so little that is culled is not worth the looks that watch it: it is given back; where nothing is culled,
// so few in solid state are left alone
constexpr double worth_watching = 0.01;
// looks that culling waits after bodies woke as a whole
constexpr int shortest_pause = 2, longest_pause = 32;
// culling that waits comes back when the kinetic energy of what is exterior has fallen to this share
constexpr double calmed_share = 0.25;
constexpr int looks_between_glances = 15;
// the first looks of a run, until something is culled, come this many times as often; so many in a row are enough of them
constexpr int quick = 5, quick_calm = 3;

}  // namespace

void FixSolidCull::look() {
  const auto timed = watch_.time(Part::look);
  const bool any_culled = any_rank(!locked_index_.empty() || store_->size() > 0);
  const Vec3 g = gravity();
  watch_effective_gravity(false);
  gravity_then_ = g;
  pause_where_bodies_wake();
  come_back_where_it_calmed();
  const bool may_cull = update->ntimestep >= no_cull_until_;
  if (may_cull || any_culled) see_walls(false);
  std::int64_t candidates[2] = {0, atom->nlocal};  // of so many
  joins_.clear();
  if (may_cull)
    candidates[0] = find_calm();
  else
    for (int i = 0; i < atom->nlocal; ++i)
      if (!shell_[i].locked) shell_[i].calm = 0;
  MPI_Allreduce(MPI_IN_PLACE, candidates, 2, MPI_INT64_T, MPI_SUM, world);
  const double few = (needs_surface() ? worth_share : worth_watching) * static_cast<double>(candidates[1]);
  const bool some_candidates = candidates[0] > 0 && static_cast<double>(candidates[0]) >= few;
  chosen_.clear();
  if (!some_candidates && !any_culled) {
    leave_out_what_is_not_steady();
  } else if (!needs_surface()) {
    leave_out_what_is_not_steady();
    choose_asleep();
    ground_bodies();
  } else {
    const auto timed_depth = watch_.time(Part::depth);
    follow_with_surface();
    register_with_surface();
    choose();
    leave_out_what_is_not_steady();
    find_exposed();
  }
  if (any_rank(!chosen_.empty())) prepare_locking();
  std::int64_t counts[3] = {static_cast<std::int64_t>(chosen_.size()), 0, 0};
  for (int i = 0; i < atom->nlocal; ++i) counts[1] += !shell_[i].locked;
  for (const std::int64_t tag : chosen_) counts[2] += overdue_.contains(tag);
  MPI_Allreduce(MPI_IN_PLACE, counts, 3, MPI_INT64_T, MPI_SUM, world);
  if (counts[0] > 0 && (counts[0] >= worth_share * static_cast<double>(counts[1]) || counts[2] > 0))
    ask_for_build(update->ntimestep + 1);
  if (any_rank(!joins_.empty())) ask_for_build(update->ntimestep + 1);
  if (may_cull && quick_looks_ == 0) {
    judge_worth(counts[0], counts[1]);
  } else {
    builds_asked_ = 0;
    restored_then_ = ledger_.granules_restored();
  }
  schedule_next_look();
}

double FixSolidCull::kinetic_energy_of_exterior() const {
  double energy = 0;
  for (int i = 0; i < atom->nlocal; ++i)
    if (!shell_[i].locked) energy += 0.5 * atom->rmass[i] * vec(atom->v[i]).squaredNorm();
  MPI_Allreduce(MPI_IN_PLACE, &energy, 1, MPI_DOUBLE, MPI_SUM, world);
  return energy;
}

/// Culling waits because it did not pay: what was true then need not be true of a scene that has come to rest since.
void FixSolidCull::come_back_where_it_calmed() {
  if (update->ntimestep >= no_cull_until_) energy_then_ = 0;  // the wait is over
  if (energy_then_ <= 0) return;
  if (kinetic_energy_of_exterior() > calmed_share * energy_then_) return;
  energy_then_ = 0;
  no_cull_until_ = update->ntimestep;
  worth_ = WorthWatch();
}

void FixSolidCull::pause_where_bodies_wake() {
  // a scene that is shaken wakes most of what is culled again and again: culling waits, longer each time, until it stops
  std::int64_t counts[2] = {0, static_cast<std::int64_t>(locked_here())};
  for (const auto& b : bodies_.bodies())
    if (waking_bodies_.count(key_of(b.first))) counts[0] += b.second.mass.count;
  MPI_Allreduce(MPI_IN_PLACE, counts, 2, MPI_INT64_T, MPI_SUM, world);
  if (2 * counts[0] > counts[1]) {
    pause_ = std::min(std::max(2 * pause_, shortest_pause), longest_pause);
    no_cull_until_ = update->ntimestep + pause_ * look_every_;
    energy_then_ = 0;  // not a wait for lack of worth: calm alone does not end it
  } else if (pause_ > 0 && update->ntimestep > no_cull_until_ + 4 * pause_ * look_every_) {
    pause_ = 0;
  }
}

void FixSolidCull::see_walls(bool new_run) {
  if (new_run) {
    // a wall that has gone leaves nothing behind that would close the surface
    std::vector<std::string> now = walls_.names();
    if (!std::includes(now.begin(), now.end(), walls_then_.begin(), walls_then_.end())) {
      plugs_.clear();
      plugged_.clear();
      plugs_changed_ = true;
      if (surface_) surface_->touch_all();
    }
    walls_then_ = std::move(now);
  }
  const int owned = atom->nlocal;
  std::vector<int> touched(owned, 0), there(owned, 0);
  std::vector<char> moves(owned, 0), near(owned, 0), near_moving(owned, 0), stands(owned, 0);
  std::vector<double> slip(owned, 0.0);
  FlatMap<Sphere> moving_plugs;
  const double plug_radius = 0.5 * (settings_.depth * diameter_ + closing()) + diameter_;
  for (const WallContact& c : walls_.find()) {
    const int i = c.granule;
    near[i] = true;
    near_moving[i] |= c.moving;
    if (c.gap <= wall_still_there * atom->radius[i]) ++there[i];
    if (c.gap <= 0) {
      ++touched[i];
      moves[i] = moves[i] || c.moving;
      stands[i] = stands[i] || !c.moving;
      slip[i] = std::max(slip[i], (vec(atom->v[i]) + vec(atom->omega[i]).cross(c.to_wall)).norm());
    }
    if (!needs_surface()) continue;
    const ShellEntry& e = shell_[i];
    if (settings_.walls == Walls::surface || c.gap > wall_closes * atom->radius[i]) continue;
    if (c.moving && !e.locked && e.calm == 0) continue;
    // a plug behind the wall: behind a still one it stays, for the place behind a wall is no void whoever stands before it; one
    // that moves has plugs where granules at rest stand at it now
    const double distance = c.to_wall.norm();
    if (distance == 0) continue;
    Vec3 at = vec(atom->x[i]) + c.to_wall, outward = c.to_wall / distance;
    if (c.moving) {
      at = observer_.to_frame(at);
      outward = observer_.turned_to_frame(outward);
    }
    const auto grid = [&](double x) {
      return static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(x / (0.5 * diameter_)))) & 0xfffff;
    };
    const std::uint64_t side = (outward[0] > 0.5) + 2 * (outward[0] < -0.5) + 3 * (outward[1] > 0.5) + 6 * (outward[1] < -0.5);
    const std::int64_t place = static_cast<std::int64_t>(((grid(at[0]) << 20 | grid(at[1])) << 20 | grid(at[2])) << 4 | side);
    const Sphere plug{at + plug_radius * outward, plug_radius};
    if (c.moving) {
      const Sphere* before = moving_plugs_.find(place);
      moving_plugs[place] = before ? *before : plug;
      if (before) continue;
      plugs_changed_ = true;
      if (surface_) surface_->touch(plug);
      continue;
    }
    char& known = plugged_[place];
    if (known) continue;
    known = 1;
    plugs_.push_back(plug);
    plugs_changed_ = true;
    if (surface_) surface_->touch({observer_.to_frame(plug.centre), plug.radius});
  }
  moving_plugs_.for_each([&](std::int64_t place, const Sphere& plug) {
    if (moving_plugs.contains(place)) return;
    plugs_changed_ = true;
    if (surface_) surface_->touch(plug);
  });
  moving_plugs_ = std::move(moving_plugs);
  for (int i = 0; i < owned; ++i) {
    ShellEntry& e = shell_[i];
    // between runs a wall may have been taken away; within one, a wall that moves may have left
    const bool gone = new_run ? there[i] < e.walls : e.wall_moves && there[i] == 0;
    if (e.locked && gone) waking_.push_back({vec(atom->x[i]), 0.5 * atom->radius[i]});
    e.walls = touched[i];
    e.wall_moves = moves[i];
    e.wall_near = near[i];
    e.moving_wall_near = near_moving[i];
    e.stands = stands[i];
    e.wall_slip = slip[i];
  }
}

std::vector<Vec3> FixSolidCull::accelerations() const {
  std::vector<Vec3> a(static_cast<std::size_t>(atom->nlocal + atom->nghost), Vec3::Zero());
  for (int i = 0; i < atom->nlocal; ++i)
    if (!shell_[i].locked) a[i] = vec(atom->f[i]) / atom->rmass[i];
  if (rigid())
    for (std::size_t k = 0; k < locked_index_.size(); ++k) {
      const ActiveBody& b = active_[locked_slot_[k]];
      const int i = locked_index_[k];
      if (!b.stands) a[i] = b.body->motion.acceleration(b.body->pose.to_world(shell_[i].place), b.force, b.torque);
    }
  if (!halo_.needed()) return a;
  std::vector<double> rows;
  for (int i = 0; i < atom->nlocal; ++i)
    rows.insert(rows.end(), {atom->x[i][0], atom->x[i][1], atom->x[i][2], double(atom->tag[i]), a[i][0], a[i][1], a[i][2]});
  rows = halo_.exchange(rows, 7, contact_reach());
  FlatMap<std::size_t> row_of;
  for (std::size_t r = 0; r < rows.size(); r += 7) row_of[static_cast<std::int64_t>(rows[r + 3])] = r;
  for (int i = atom->nlocal; i < atom->nlocal + atom->nghost; ++i)
    if (const std::size_t* r = row_of.find(atom->tag[i])) a[i] = vec(&rows[*r + 4]);
  return a;
}

/// How many are in solid state on this rank.
std::int64_t FixSolidCull::find_calm() {
  const int owned = atom->nlocal;
  // over a shorter time less motion tells it from rest
  SolidStateLaw law = solid_state_;
  if (looks_quickly()) law.speed /= quick;
  std::vector<char> touching(owned, 0), moving(owned, 0), loaded(owned, 0), drifting(owned, 0);
  std::vector<Vec3> around(owned, Vec3::Zero());  // sum of mass times acceleration of what each granule touches
  std::vector<double> mass(owned, 0.0);
  const std::vector<Vec3> acceleration = accelerations();
  const LAMMPS_NS::NeighList* list = force->pair->list;
  const auto state = [&](int i) { return MovingSphere{vec(atom->x[i]), vec(atom->v[i]), vec(atom->omega[i]), atom->radius[i]}; };
  struct Pair {
    int i, j;
  };
  std::vector<Pair> between_bodies;
  const double bears = neighbor->contactDistanceFactor;
  for (int row = 0; row < list->inum; ++row) {
    const int i = list->ilist[row];
    if (i >= owned) continue;
    const MovingSphere a = state(i);
    for (int k = 0; k < list->numneigh[i]; ++k) {
      const int j = list->firstneigh[i][k] & NEIGHMASK;
      const double reach = (a.radius + atom->radius[j]) * (1 + SolidStateLaw::gap);
      const double square = (vec(atom->x[j]) - a.position).squaredNorm();
      if (square > reach * reach) continue;
      const MovingSphere b = state(j);
      const double radii = a.radius + b.radius;
      const bool pressed = square < radii * radii;
      if (!pressed && square > bears * bears * radii * radii && law.spins_beside(a, b)) continue;
      const bool drifts = !pressed && !law.still_neighbour(a, b);
      loaded[i] |= pressed;
      drifting[i] |= drifts;
      if (j < owned) {
        loaded[j] |= pressed;
        drifting[j] |= drifts;
      }
      touching[i] = 1;
      around[i] += atom->rmass[j] * acceleration[j];
      mass[i] += atom->rmass[j];
      if (j < owned) {
        touching[j] = 1;
        around[j] += atom->rmass[i] * acceleration[i];
        mass[j] += atom->rmass[i];
      }
      const bool quiet = law.quiet_contact(a, b);
      if (shell_[i].locked && key_of_atom(j)) {
        between_bodies.push_back({i, j});
        if (quiet) continue;
      } else if (quiet) {
        continue;
      }
      moving[i] = 1;
      if (j < owned) moving[j] = 1;
    }
  }
  std::int64_t candidates = 0;
  for (int i = 0; i < owned; ++i) {
    ShellEntry& e = shell_[i];
    if (e.locked) continue;
    if (e.walls > 0) loaded[i] = 1;
    // a granule that touches nothing but a wall that stands still is one with it where it stays: not where it rolls or slides
    const double fastest = std::max(vec(atom->v[i]).norm(), e.wall_slip);
    if (!touching[i] && e.stands && fastest >= law.speed) moving[i] = 1;
    bool solid = (touching[i] || e.walls > 0) && !moving[i] && (loaded[i] || !drifting[i]) && (atom->mask[i] & groupbit) &&
                 can_be_culled(atom->mask[i]);
    if (solid && rigid()) {
      // a wall is a neighbour too; that it is accelerated itself is not known here
      const double all = mass[i] + (e.walls > 0 ? atom->rmass[i] : 0.0);
      const Vec3 v = vec(atom->v[i]), frame = around[i] / all;
      solid = law.balanced(acceleration[i], frame);
      const double passed = static_cast<double>(update->ntimestep - e.lock_step) * update->dt;
      if (solid && (e.calm == 0 || !law.went_on(v - e.velocity, e.reference, frame, passed))) {
        e.calm = 0;  // calm begins here, with this motion
        e.velocity = v;
        e.reference = frame;
        e.lock_step = update->ntimestep;
      }
    } else if (solid) {
      solid = law.at_rest(vec(atom->v[i]), vec(atom->omega[i]), atom->radius[i]) && law.balanced(acceleration[i], Vec3::Zero());
    }
    e.calm = solid ? e.calm + 1 : 0;
    candidates += e.calm >= looks_in_a_row();
  }
  joins_.clear();
  for (const Pair& p : between_bodies)
    for (const int end : {p.i, p.j})
      if (end < owned) shell_[end].calm = moving[end] ? 0 : shell_[end].calm + 1;
  for (const Pair& p : between_bodies) {
    const bool long_enough = shell_[p.i].calm >= looks_in_a_row() && (p.j >= owned || shell_[p.j].calm >= looks_in_a_row());
    if (!long_enough || moving[p.i] || (p.j < owned && moving[p.j])) continue;
    const double* x = atom->x[p.i];
    joins_.insert(joins_.end(), {x[0], x[1], x[2], double(atom->tag[p.i]), double(atom->tag[p.j])});
  }
  return candidates;
}

bool FixSolidCull::can_be_culled(int mask) const {
  return (mask & movable_) && !(mask & held_) && (!gravity_bit_ || (mask & gravity_bit_));
}

void FixSolidCull::follow_with_surface() {
  // the surface is drawn in the frame of the largest body, so that a mass that falls or turns as one leaves it as it is
  if (!rigid() || domain->xperiodic || domain->yperiodic || domain->zperiodic) return;
  const double enough = drawn_share * settings_.voxel * diameter_;
  int largest = 0;
  std::int64_t count = 0;
  store_->for_each_body([&](int body, const Vec3&, const Vec3&) {
    const std::int64_t n = bodies_.body(body).mass.count;
    if (body == observed_) largest = body, count = 2 * n;  // it stays until another one is twice as large
    if (n > count) largest = body, count = n;
  });
  if (!largest) {
    observed_ = 0;
    return;
  }
  if (largest != observed_) {
    observed_ = largest;
    observed_then_ = bodies_.pose(largest);
    return;
  }
  const Pose& now = bodies_.pose(observed_);
  double way = 0;
  store_->for_each_body([&](int body, const Vec3& lo, const Vec3& hi) {
    if (body == observed_) way = largest_way(observed_then_, now, lo, hi);
  });
  if (way <= enough) return;
  const Pose before = observer_;
  const Eigen::Quaterniond turn = now.quaternion() * observed_then_.quaternion().conjugate();
  observer_ =
      Pose(now.origin() + turn * (observer_.origin() - observed_then_.origin()), (turn * observer_.quaternion()).normalized());
  observed_then_ = now;
  if (halo_.needed()) surface_->touch_all();
  for (const Sphere& plug : plugs_)
    for (const Pose* pose : {&before, const_cast<const Pose*>(&observer_)})
      surface_->touch({pose->to_frame(plug.centre), plug.radius});
  plugs_changed_ = plugs_changed_ || !plugs_.empty();
}

void FixSolidCull::register_with_surface() {
  const double moved = drawn_share * settings_.voxel * diameter_;
  // a granule that was drawn and is neither an atom nor stored any more has left the simulation
  std::int64_t drawn = static_cast<std::int64_t>(store_->size());
  for (int i = 0; i < atom->nlocal; ++i) drawn += shell_[i].registered;
  MPI_Allreduce(MPI_IN_PLACE, &drawn, 1, MPI_INT64_T, MPI_SUM, world);
  if (drawn < drawn_at_last_look_) surface_->touch_all();

  std::vector<Sphere> spheres;
  std::vector<double> rows;
  const bool shared = halo_.needed();
  const auto share = [&](const Vec3& x, double radius, const Vec3& from) {
    rows.insert(rows.end(), {x[0], x[1], x[2], radius, from[0] - x[0], from[1] - x[1], from[2] - x[2]});
  };
  for (int i = 0; i < atom->nlocal; ++i) {
    ShellEntry& e = shell_[i];
    const Vec3 x = vec(atom->x[i]);
    const Sphere s{observer_.to_frame(x), atom->radius[i]};
    spheres.push_back(s);
    Vec3 from = x;
    if (!e.registered || (s.centre - e.registered_at).squaredNorm() > moved * moved) {
      if (e.registered) surface_->touch({e.registered_at, s.radius});
      surface_->touch(s);
      from = e.registered ? observer_.to_world(e.registered_at) : Vec3(x + Vec3::Constant(diameter_));
      e.registered = true;
      e.registered_at = s.centre;
    }
    if (shared) share(x, s.radius, from);
  }
  // interior granules of bodies that move against the observer
  store_->for_each_body([&](int body, const Vec3& lo, const Vec3& hi) {
    const Pose& pose = bodies_.pose(body);
    const Eigen::Quaterniond back = observer_.quaternion().conjugate();
    const Pose seen(observer_.to_frame(pose.origin()), back * pose.quaternion());
    const auto then = drawn_.find(body);
    if (then == drawn_.end()) {
      drawn_[body] = seen;
      return;
    }
    if (largest_way(then->second, seen, lo, hi) <= moved) return;
    store_->for_each_in_box(body, lo, hi, [&](const Resident& g) {
      surface_->touch({then->second.to_world(g.position), g.radius});
      surface_->touch({seen.to_world(g.position), g.radius});
    });
    then->second = seen;
  });
  if (shared) {
    store_->for_each([&](const Resident& g) {
      const Vec3 x = in_world(g);
      share(x, g.radius, x);
    });
    rows = halo_.exchange(rows, 7, surface_reach());
    for (std::size_t r = 0; r < rows.size(); r += 7) {
      const Sphere s{observer_.to_frame(vec(&rows[r])), rows[r + 3]};
      const Vec3 step = observer_.turned_to_frame(vec(&rows[r + 4]));
      spheres.push_back(s);
      if (!step.isZero(0) || !halo_drawn_) {
        surface_->touch({s.centre + step, s.radius});
        surface_->touch(s);
      }
    }
    halo_drawn_ = true;
  }
  drawn_at_last_look_ = static_cast<std::int64_t>(store_->size()) + atom->nlocal;
  MPI_Allreduce(MPI_IN_PLACE, &drawn_at_last_look_, 1, MPI_INT64_T, MPI_SUM, world);
  around_.build(std::move(spheres), 2 * diameter_);
  if (plugs_changed_) {
    std::vector<Sphere> plugs;
    for (const Sphere& p : plugs_) plugs.push_back({observer_.to_frame(p.centre), p.radius});
    moving_plugs_.for_each([&](std::int64_t, const Sphere& p) { plugs.push_back(p); });
    plug_cells_.build(std::move(plugs), 4 * diameter_);
    plugs_changed_ = false;
  }
}

void FixSolidCull::choose() {
  overdue_.clear();
  const double depth = settings_.depth * diameter_;
  for (int i = 0; i < atom->nlocal; ++i) {
    ShellEntry& e = shell_[i];
    if (e.locked || e.calm < looks_in_a_row()) continue;
    e.nearest_void = surface_->void_within(observer_.to_frame(vec(atom->x[i])), depth, e.nearest_void);
    if (!e.nearest_void.none()) {
      e.waited = 0;
      continue;
    }
    chosen_.push_back(atom->tag[i]);
    if (++e.waited >= longest_wait) overdue_[atom->tag[i]] = 1;
  }
}

void FixSolidCull::leave_out_what_is_not_steady() {
  // one look before they could go, so that none is lost
  const int from = std::max(1, looks_in_a_row() - 1);
  FlatMap<char> chosen;
  for (const std::int64_t tag : chosen_) chosen[tag] = 1;
  std::vector<char> asked(atom->nlocal, 0);
  for (int i = 0; i < atom->nlocal; ++i) {
    const int calm = shell_[i].locked ? 0 : shell_[i].calm;
    asked[i] = needs_surface() ? calm == from || chosen.contains(atom->tag[i]) : calm >= from;
  }
  const std::vector<char> steady = find_steady(asked);
  for (int i = 0; i < atom->nlocal; ++i) {
    if (!asked[i] || steady[i]) continue;
    if (needs_surface())
      chosen.erase(atom->tag[i]);
    else
      shell_[i].calm = std::min(shell_[i].calm, looks_in_a_row() - 1);
  }
  const auto left_out = [&](std::int64_t tag) { return !chosen.contains(tag); };
  chosen_.erase(std::remove_if(chosen_.begin(), chosen_.end(), left_out), chosen_.end());
}

/// Calm for as many looks as what presses on it asks for.
bool FixSolidCull::calm_enough(int i) const {
  const double patience = looks_quickly() ? 1 : SolidStateLaw::patience(atom->rmass[i] * weight_scale_, shell_[i].normal_load);
  return shell_[i].calm >= patience * looks_in_a_row();
}

void FixSolidCull::choose_asleep() {
  // whoever is in solid state sleeps, but for a cover around what is not
  overdue_.clear();
  SphereCells awake;
  const double cover = settings_.depth * diameter_;
  if (cover > 0) {
    std::vector<Sphere> spheres;
    std::vector<double> rows;
    for (int i = 0; i < atom->nlocal; ++i) {
      if (shell_[i].locked || calm_enough(i)) continue;
      const Sphere s = sphere(i);
      spheres.push_back(s);
      rows.insert(rows.end(), {s.centre[0], s.centre[1], s.centre[2], s.radius});
    }
    if (halo_.needed()) rows = halo_.exchange(rows, 4, cover + contact_reach());
    if (halo_.needed())
      for (std::size_t r = 0; r < rows.size(); r += 4) spheres.push_back({vec(&rows[r]), rows[r + 3]});
    awake.build(std::move(spheres), std::max(cover, 2 * diameter_));
  }
  for (int i = 0; i < atom->nlocal; ++i) {
    ShellEntry& e = shell_[i];
    if (e.locked) continue;
    if (!calm_enough(i) || (cover > 0 && awake.any_near(sphere(i), cover))) {
      e.waited = 0;
      continue;
    }
    chosen_.push_back(atom->tag[i]);
    if (++e.waited >= longest_wait) overdue_[atom->tag[i]] = 1;
  }
}

void FixSolidCull::find_exposed() {
  const double depth = (settings_.depth - std::min(cover_slack, 0.5 * settings_.depth)) * diameter_;
  for (const int i : locked_index_) {
    ShellEntry& e = shell_[i];
    const Vec3 x = observer_.to_frame(vec(atom->x[i]));
    if (!surface_->touched_near(x, depth + closing())) continue;
    e.nearest_void = surface_->void_within(x, depth, e.nearest_void);
    if (!e.nearest_void.none()) waking_.push_back({vec(atom->x[i]), 0.5 * atom->radius[i]});
  }
  surface_->clear_touched();
}

void FixSolidCull::prepare_locking() {
  FlatMap<char> chosen;
  for (const std::int64_t tag : chosen_) chosen[tag] = 1;
  const int owned = atom->nlocal;
  const int interface_bit = group->bitmask[interface_group_];
  const LAMMPS_NS::NeighList* list = force->pair->list;
  const auto will_be_locked = [&](int i) {
    return (atom->mask[i] & interface_bit) || i >= owned || chosen.contains(atom->tag[i]);
  };
  const auto state = [&](int i) { return MovingSphere{vec(atom->x[i]), vec(atom->v[i]), vec(atom->omega[i]), atom->radius[i]}; };
  side_changes_.clear();
  touches_.clear();
  std::vector<char> touching(owned, 0), goes_along(owned, 0);
  for (int row = 0; row < list->inum; ++row) {
    const int i = list->ilist[row];
    if (i >= owned) continue;
    for (int k = 0; k < list->numneigh[i]; ++k) {
      const int j = list->firstneigh[i][k] & NEIGHMASK;
      const double radii = atom->radius[i] + atom->radius[j];
      const double distance = (vec(atom->x[i]) - vec(atom->x[j])).norm();
      if (distance > radii * (1 + SolidStateLaw::gap)) continue;
      const bool first = will_be_locked(i), second = will_be_locked(j);
      const bool bears = distance <= radii * neighbor->contactDistanceFactor;
      if (!bears && solid_state_.spins_beside(state(i), state(j))) continue;
      if (first && second) touches_.push_back({atom->tag[i], atom->tag[j]});
      touching[i] = 1;
      goes_along[i] |= second;
      if (j < owned) {
        touching[j] = 1;
        goes_along[j] |= first;
      }
      // between owned granules the force is taken in the very state that is frozen; across ranks it is taken now
      const bool side_change = first && second && j >= owned && shell_[i].locked && !(atom->mask[j] & interface_bit);
      if (side_change && bears) side_changes_.push_back({atom->tag[i], atom->tag[j], pair_force_.on_first(i, k)});
    }
  }
  // alone among neighbours that all stay exterior it would make no solid: nothing is saved until one of them comes along
  for (int i = 0; i < owned; ++i) {
    if (!touching[i] || goes_along[i] || !chosen.contains(atom->tag[i])) continue;
    chosen.erase(atom->tag[i]);
    shell_[i].waited = 0;
  }
  chosen_.erase(std::remove_if(chosen_.begin(), chosen_.end(), [&](std::int64_t tag) { return !chosen.contains(tag); }),
                chosen_.end());
}

/// The load on these owned granules, from look to look: one that still changes is no solid state, however slowly its granule
/// moves.
std::vector<char> FixSolidCull::find_steady(const std::vector<char>& asked) {
  const int owned = atom->nlocal;
  std::vector<double> normal(owned, 0.0);
  std::vector<Vec3> pair_sum(owned, Vec3::Zero());
  const LAMMPS_NS::NeighList* list = force->pair->list;
  const int rows = std::find(asked.begin(), asked.end(), 1) == asked.end() ? 0 : list->inum;
  for (int row = 0; row < rows; ++row) {
    const int i = list->ilist[row];
    if (i >= owned) continue;
    for (int k = 0; k < list->numneigh[i]; ++k) {
      const int j = list->firstneigh[i][k] & NEIGHMASK;
      if (!asked[i] && !(j < owned && asked[j])) continue;
      const Vec3 apart = vec(atom->x[i]) - vec(atom->x[j]);
      if (apart.norm() > (atom->radius[i] + atom->radius[j]) * neighbor->contactDistanceFactor) continue;
      const Vec3 f = pair_force_.on_first(i, k);
      const double n = std::abs(f.dot(apart)) / apart.norm();
      normal[i] += n;
      pair_sum[i] += f;
      if (j >= owned) continue;
      normal[j] += n;
      pair_sum[j] -= f;
    }
  }
  std::vector<char> steady(owned, 0);
  const Vec3 g = gravity();
  for (int i = 0; i < owned; ++i) {
    ShellEntry& e = shell_[i];
    if (e.locked) continue;
    if (!asked[i]) {
      e.normal_load = ShellEntry::not_known;
      continue;
    }
    // what neither pairs nor weight explain is the walls'
    const Vec3 wall = vec(atom->f[i]) - pair_sum[i] - atom->rmass[i] * g;
    const double load = normal[i] + (e.walls > 0 ? wall.norm() : 0.0), then = e.normal_load;
    const double change = solid_state_.force * atom->rmass[i] * weight_scale_ +
                          SolidStateLaw::out_of_balance_share * settings_.tolerance_relative * load;
    steady[i] = then != ShellEntry::not_known && std::abs(load - then) <= change;
    e.normal_load = load;
  }
  return steady;
}

void FixSolidCull::judge_worth(std::int64_t chosen, std::int64_t exterior) {
  std::int64_t counts[4] = {static_cast<std::int64_t>(locked_index_.size()), static_cast<std::int64_t>(store_->size()),
                            ledger_.granules_restored() - restored_then_, atom->nlocal};
  MPI_Allreduce(MPI_IN_PLACE, counts, 4, MPI_INT64_T, MPI_SUM, world);
  const double steps = static_cast<double>(update->ntimestep - std::max(judged_at_, update->ntimestep - look_every_));
  const double saved =
      steps * (WorthWatch::interior * static_cast<double>(counts[1]) + WorthWatch::interface * static_cast<double>(counts[0]));
  const double spent =
      static_cast<double>(counts[3]) * (WorthWatch::look + WorthWatch::build * static_cast<double>(builds_asked_)) +
      WorthWatch::wake * static_cast<double>(counts[2]);
  judged_at_ = update->ntimestep;
  builds_asked_ = 0;
  restored_then_ = ledger_.granules_restored();
  const bool culling = chosen + counts[0] + counts[1] > 0;
  const int wait = worth_.judge(saved, spent, culling, chosen > counts[0] + counts[1]);
  if (wait == 0) return;
  no_cull_until_ = std::max(no_cull_until_, update->ntimestep + static_cast<std::int64_t>(wait) * look_every_);
  energy_then_ = kinetic_energy_of_exterior();
  if (static_cast<double>(counts[0] + counts[1]) < worth_watching * static_cast<double>(exterior) && counts[0] + counts[1] > 0) {
    wake_all_ = true;
    ask_for_build(update->ntimestep + 1);
  }
  if (told_no_worth_ || !worth_.waits_long()) return;
  told_no_worth_ = true;
  say("fix " + std::string(id) + " solid/cull: among " + std::to_string(exterior) +
      " granules too few can be culled for it to pay; trying again every " + std::to_string(wait * look_every_) +
      " steps or more");
}

void FixSolidCull::ask_for_build(std::int64_t step) {
  if (next_reneighbor != step) ++builds_asked_;
  next_reneighbor = step;
}

void FixSolidCull::schedule_next_look() {
  // a bed that rests when the run begins is culled at once; else a look comes in time for what it must watch
  const std::int64_t now = last_look_ = update->ntimestep;
  if (looks_quickly()) {
    --quick_looks_;
    next_look_ = now + quick_interval();
    return;
  }
  quick_looks_ = 0;
  next_look_ = (now / look_every_ + 1) * look_every_;
  if (locked_everywhere_ > 0 || stored_everywhere_ > 0) return;
  std::int64_t wait = (no_cull_until_ + look_every_ - 1) / look_every_ * look_every_;
  if (energy_then_ > 0) wait = std::min(wait, next_look_ + looks_between_glances * look_every_);
  next_look_ = std::max(next_look_, wait);
}

bool FixSolidCull::looks_quickly() const { return quick_looks_ > 0 && locked_everywhere_ == 0; }

int FixSolidCull::looks_in_a_row() const { return looks_quickly() ? std::min(settings_.calm, quick_calm) : settings_.calm; }

int FixSolidCull::quick_interval() const { return settings_.every ? look_every_ : std::max(look_every_ / quick, 5); }

}  // namespace solidcull
