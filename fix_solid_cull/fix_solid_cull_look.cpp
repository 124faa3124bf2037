// A look: which exterior granules are in solid state and deep enough to be culled, which interface granules are exposed.
#include <mpi.h>

#include <algorithm>
#include <cmath>

#include "atom.h"
#include "comm.h"
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
// granules, or until a granule has waited for that many looks
constexpr double worth_share = 0.05;
constexpr int longest_wait = 10;
// where looks find nothing, they come up to this many times more seldom
constexpr int largest_look_factor = 16;


}  // namespace

void FixSolidCull::look() {
  const auto timed = watch_.time(Part::look);
  see_walls();
  const std::vector<char> quiet = find_quiet();
  bool candidates = false;
  for (int i = 0; i < atom->nlocal; ++i) {
    ShellEntry& e = shell_[i];
    if (e.locked) continue;
    const bool solid = quiet[i] && (atom->mask[i] & groupbit) && solid_state_.at_rest(vec(atom->v[i]), vec(atom->omega[i]), atom->radius[i]) &&
                       solid_state_.balanced(vec(atom->f[i]), atom->rmass[i]);
    e.calm = solid ? e.calm + 1 : 0;
    candidates = candidates || e.calm >= settings_.calm;
  }
  wake_where_walls_are_gone();
  const bool any_candidates = any_rank(candidates), any_locked = any_rank(!locked_index_.empty());
  chosen_.clear();
  if (any_candidates || any_locked) {
    const auto timed_depth = watch_.time(Part::depth);
    register_with_surface();
    choose();
    find_exposed();
  }
  std::int64_t counts[3] = {static_cast<std::int64_t>(chosen_.size()), 0, 0};
  for (int i = 0; i < atom->nlocal; ++i) counts[1] += !shell_[i].locked;
  for (const std::int64_t tag : chosen_) counts[2] += overdue_.contains(tag);
  MPI_Allreduce(MPI_IN_PLACE, counts, 3, MPI_INT64_T, MPI_SUM, world);
  if (counts[0] > 0) {
    prepare_locking();
    if (!any_locked) gravity_at_locking_ = gravity();
    if (counts[0] >= worth_share * static_cast<double>(counts[1]) || counts[2] > 0) next_reneighbor = update->ntimestep + 1;
  }
  schedule_next_look(counts[0], counts[1]);
}

void FixSolidCull::see_walls() {
  for (int i = 0; i < atom->nlocal; ++i) {
    shell_[i].walls = 0;
    shell_[i].wall_near = false;
  }
  const double plug_radius = 0.5 * (settings_.depth * diameter_ + closing()) + diameter_;
  for (const WallContact& c : walls_.find()) {
    ShellEntry& e = shell_[c.granule];
    e.wall_near = true;
    if (c.gap <= 0) ++e.walls;
    if (settings_.walls == Walls::surface || c.gap > wall_closes * atom->radius[c.granule] || c.moving) continue;
    // a plug behind the wall: once there it stays, for the place behind a wall is no void whoever stands before it
    const double distance = c.to_wall.norm();
    if (distance == 0) continue;
    const Vec3 at = vec(atom->x[c.granule]) + c.to_wall;
    const Vec3 outward = c.to_wall / distance;
    const auto grid = [&](double x) {
      return static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(x / (0.5 * diameter_)))) & 0xfffff;
    };
    const std::uint64_t side = (outward[0] > 0.5) + 2 * (outward[0] < -0.5) + 3 * (outward[1] > 0.5) + 6 * (outward[1] < -0.5);
    const std::uint64_t place = ((grid(at[0]) << 20 | grid(at[1])) << 20 | grid(at[2])) << 4 | side;
    char& there = plugged_[static_cast<std::int64_t>(place)];
    if (there) continue;
    there = 1;
    plugs_.push_back({at + plug_radius * outward, plug_radius});
    plugs_changed_ = true;
    if (surface_) surface_->touch(plugs_.back());
  }
}

void FixSolidCull::wake_where_walls_are_gone() {
  for (const int i : locked_index_)
    if (shell_[i].walls < shell_[i].walls_at_locking) waking_.push_back({vec(atom->x[i]), 0.5 * atom->radius[i]});
}

std::vector<char> FixSolidCull::find_quiet() {
  const int owned = atom->nlocal;
  std::vector<char> touching(owned, 0), moving(owned, 0);
  const LAMMPS_NS::NeighList* list = force->pair->list;
  const auto state = [&](int i) {
    return MovingSphere{vec(atom->x[i]), vec(atom->v[i]), vec(atom->omega[i]), atom->radius[i]};
  };
  for (int row = 0; row < list->inum; ++row) {
    const int i = list->ilist[row];
    if (i >= owned) continue;
    const MovingSphere a = state(i);
    for (int k = 0; k < list->numneigh[i]; ++k) {
      const int j = list->firstneigh[i][k] & NEIGHMASK;
      const double reach = (a.radius + atom->radius[j]) * (1 + SolidStateLaw::gap);
      if ((vec(atom->x[j]) - a.position).squaredNorm() > reach * reach) continue;
      touching[i] = 1;
      if (j < owned) touching[j] = 1;
      if (solid_state_.quiet_contact(a, state(j))) continue;
      moving[i] = 1;
      if (j < owned) moving[j] = 1;
    }
  }
  for (int i = 0; i < owned; ++i) touching[i] = (touching[i] || shell_[i].walls > 0) && !moving[i];
  return touching;
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
    const Sphere s = sphere(i);
    spheres.push_back(s);
    Vec3 from = s.centre;
    if (!e.registered || (s.centre - e.registered_at).squaredNorm() > moved * moved) {
      if (e.registered) surface_->touch({e.registered_at, s.radius});
      surface_->touch(s);
      from = e.registered ? e.registered_at : Vec3(s.centre + Vec3::Constant(diameter_));
      e.registered = true;
      e.registered_at = s.centre;
    }
    if (shared) share(s.centre, s.radius, from);
  }
  if (shared) {
    store_->for_each([&](const StoredGranule& g) { share(g.position, g.radius, g.position); });
    rows = halo_.exchange(rows, 7, surface_reach());
    for (std::size_t r = 0; r < rows.size(); r += 7) {
      const Sphere s{vec(&rows[r]), rows[r + 3]};
      const Vec3 step = vec(&rows[r + 4]);
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
    plug_cells_.build(plugs_, 4 * diameter_);
    plugs_changed_ = false;
  }
}

void FixSolidCull::choose() {
  overdue_.clear();
  const double depth = settings_.depth * diameter_;
  for (int i = 0; i < atom->nlocal; ++i) {
    ShellEntry& e = shell_[i];
    if (e.locked || e.calm < settings_.calm) continue;
    e.nearest_void = surface_->void_within(vec(atom->x[i]), depth, e.nearest_void);
    if (!e.nearest_void.none()) {
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
    const Vec3 x = vec(atom->x[i]);
    if (!surface_->touched_near(x, depth + closing())) continue;
    e.nearest_void = surface_->void_within(x, depth, e.nearest_void);
    if (!e.nearest_void.none()) waking_.push_back({x, 0.5 * atom->radius[i]});
  }
  surface_->clear_touched();
}

void FixSolidCull::prepare_locking() {
  FlatMap<char> chosen;
  for (const std::int64_t tag : chosen_) chosen[tag] = 1;
  const int owned = atom->nlocal;
  const int interface_bit = group->bitmask[interface_group_];
  const bool loads = settings_.tolerance_relative > 0;
  std::vector<double> normal(loads ? owned : 0, 0.0);
  std::vector<Vec3> pair_sum(loads ? owned : 0, Vec3::Zero());
  const LAMMPS_NS::NeighList* list = force->pair->list;
  const auto will_be_locked = [&](int i) {
    return (atom->mask[i] & interface_bit) || i >= owned || chosen.contains(atom->tag[i]);
  };
  side_changes_.clear();
  touches_.clear();
  for (int row = 0; row < list->inum; ++row) {
    const int i = list->ilist[row];
    if (i >= owned) continue;
    for (int k = 0; k < list->numneigh[i]; ++k) {
      const int j = list->firstneigh[i][k] & NEIGHMASK;
      const double radii = atom->radius[i] + atom->radius[j];
      const double distance = (vec(atom->x[i]) - vec(atom->x[j])).norm();
      if (distance > radii * (1 + SolidStateLaw::gap)) continue;
      const bool first = will_be_locked(i), second = will_be_locked(j);
      if (first && second) touches_.push_back({atom->tag[i], atom->tag[j]});
      // between owned granules the force is taken in the very state that is frozen; across ranks it is taken now
      const bool side_change = first && second && j >= owned && shell_[i].locked && !(atom->mask[j] & interface_bit);
      const bool counts = loads && ((chosen.contains(atom->tag[i])) || (j < owned && chosen.contains(atom->tag[j])));
      if ((!side_change && !counts) || distance > radii * neighbor->contactDistanceFactor) continue;
      const Vec3 f = pair_force_.on_first(i, k);
      if (side_change) side_changes_.push_back({atom->tag[i], atom->tag[j], f});
      if (!counts) continue;
      const double n = std::abs(f.dot(vec(atom->x[i]) - vec(atom->x[j]))) / distance;
      normal[i] += n;
      pair_sum[i] += f;
      if (j < owned) {
        normal[j] += n;
        pair_sum[j] -= f;
      }
    }
  }
  if (!loads) return;
  for (int i = 0; i < owned; ++i) {
    if (!chosen.contains(atom->tag[i])) continue;
    // what neither pairs nor weight explain is the walls'
    const Vec3 wall = vec(atom->f[i]) - pair_sum[i] - atom->rmass[i] * gravity();
    normal_loads_[atom->tag[i]] = normal[i] + (shell_[i].walls > 0 ? wall.norm() : 0.0);
  }
}

void FixSolidCull::schedule_next_look(std::int64_t chosen, std::int64_t exterior) {
  const bool worth = chosen > 0 || any_rank(!locked_index_.empty()) || stored_everywhere_ > 0;
  look_factor_ = worth ? 1 : std::min(2 * look_factor_, largest_look_factor);
  if (!worth && look_factor_ == largest_look_factor && !told_no_worth_) {
    told_no_worth_ = true;
    say("fix " + std::string(id) + " solid/cull: nothing among " + std::to_string(exterior) +
        " granules can be culled now; looking every " + std::to_string(look_every_ * look_factor_) + " steps from here on");
  }
  if (worth) told_no_worth_ = false;
  const std::int64_t interval = static_cast<std::int64_t>(look_every_) * look_factor_;
  next_look_ = (update->ntimestep / interval + 1) * interval;
}

}  // namespace solidcull
