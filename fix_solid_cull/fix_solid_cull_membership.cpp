// Exterior <-> interface <-> interior. All that changes the engine's atoms happens here, in pre_exchange or between runs.
#include <mpi.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <set>

#include "atom.h"
#include "comm.h"
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
#include "update.h"

namespace solidcull {
namespace {

// a shell granule goes to the store when nothing exterior is within this many skins; it is fetched at one skin (no flapping)
constexpr double store_gap_in_skins = 2.5;
// after this share of the atoms came or went, the engine sorts its arrays at once
constexpr double sort_share = 0.05;

double kinetic_energy(double mass, double radius, const Vec3& v, const Vec3& spin) {
  return 0.5 * mass * v.squaredNorm() + 0.2 * mass * radius * radius * spin.squaredNorm();
}

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

GranuleMass FixSolidCull::mass_of(std::int64_t tag) {
  if (const int* i = index_of_.find(tag)) return {atom->rmass[*i], vec(atom->x[*i]), atom->radius[*i]};
  const StoredGranule* g = store_->find(tag);
  return {g->mass, g->position, g->radius};
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

void FixSolidCull::change_membership() {
  const auto timed = watch_.time(Part::membership);
  balls_ = collect_balls();
  const bool all = any_rank(wake_all_);
  const bool change =
      any_rank(all || !balls_.empty() || !chosen_.empty() || open_for_insertion_);
  freed_.clear();
  locked_now_.clear();
  freed_anywhere_.clear();
  locked_anywhere_.clear();
  if (change) {
    index_of_.clear();
    index_of_.reserve(static_cast<std::size_t>(atom->nlocal));
    for (int i = 0; i < atom->nlocal; ++i) index_of_[atom->tag[i]] = i;
    free_what_wakes(all);
    if (!all) lock_what_was_chosen();
    tell_neighbours();
  }
  if (change || stored_everywhere_ > 0) share_exterior();
  if (stored_everywhere_ > 0) keep_shell_closed();
  if (change) {
    std::set<std::pair<int, std::size_t>> cuts;  // which ball took granules from which body
    for (const std::int64_t tag : freed_) {
      if (meshes_wanted_)
        for (std::size_t b = 0; b < balls_.size(); ++b)
          if ((mass_of(tag).position - balls_[b].centre).norm() <= balls_[b].radius) cuts.emplace(bodies_.body_of(tag), b);
      bodies_.unlock(tag, mass_of(tag), contacts_);
    }
    for (const auto& cut : cuts) {
      const auto mesh = meshes_.find(cut.first);
      if (mesh != meshes_.end()) mesh->second.carve({balls_[cut.second].centre, balls_[cut.second].radius});
    }
    thaw_contacts();
    bodies_.split(contacts_, [&](std::int64_t tag) { return mass_of(tag); });
    freeze_contacts();
    for (const std::int64_t tag : locked_now_) bodies_.lock(tag, mass_of(tag), contacts_);
    if (meshes_wanted_) {
      for (const int body : bodies_.split_parents()) meshes_.erase(body);  // made anew from what is left, as is what came off
      update_meshes();
    }
    store_what_is_deep();
  }
  if (change || any_rank(shell_reopened_)) publish_atom_counts();
  shell_reopened_ = false;
  wake_all_ = false;
  open_for_insertion_ = false;
  chosen_.clear();
  side_changes_.clear();
  normal_loads_.clear();
  touches_.clear();
  locked_index_stale_ = true;
}

void FixSolidCull::lock(int i) {
  ShellEntry& e = shell_[i];
  e.locked = true;
  e.fresh = true;
  e.load_change = Vec3::Zero();
  e.excess = 0;
  e.calm = 0;
  e.waited = 0;
  e.walls_at_locking = e.walls;
  e.lock_step = update->ntimestep;
  e.velocity = vec(atom->v[i]);
  e.spin = vec(atom->omega[i]);
  const double* load = normal_loads_.find(atom->tag[i]);
  e.normal_load = load ? *load : 0;
  set(atom->v[i], Vec3::Zero());
  set(atom->omega[i], Vec3::Zero());
  atom->mask[i] |= group->bitmask[interface_group_];
  ledger_.locked();
}

void FixSolidCull::unlock(int i) {
  ShellEntry& e = shell_[i];
  // nothing has moved since it was locked: it goes on as if it had never been; else it starts from its body's motion
  if (e.lock_step == update->ntimestep) {
    set(atom->v[i], e.velocity);
    set(atom->omega[i], e.spin);
  }
  ledger_.restored(kinetic_energy(atom->rmass[i], atom->radius[i], vec(atom->v[i]), vec(atom->omega[i])));
  e.locked = false;
  e.fresh = false;
  e.excess = 0;
  e.calm = 0;
  e.waited = 0;
  e.lock_step = -1;
  atom->mask[i] &= ~group->bitmask[interface_group_];
  vector_atom[i] = 0;
}

int FixSolidCull::bring_back(std::int64_t tag) {
  std::vector<double> record;
  const StoredGranule g = store_->take(tag, record);
  ledger_.returned(g);
  const int i = records_.append(record, g.layout);
  ShellEntry& e = shell_[i];
  e = ShellEntry();
  e.locked = true;
  e.fresh = true;
  e.load_change = g.load_change;
  e.normal_load = g.normal_load;
  e.lock_step = g.lock_step;
  e.velocity = vec(atom->v[i]);
  e.spin = vec(atom->omega[i]);
  e.registered = true;  // the implicit surface does not care who holds a granule
  e.registered_at = g.position;
  set(atom->v[i], Vec3::Zero());
  set(atom->omega[i], Vec3::Zero());
  index_of_[tag] = i;
  return i;
}

void FixSolidCull::put_away(int i) {
  ShellEntry& e = shell_[i];
  set(atom->v[i], e.velocity);
  set(atom->omega[i], e.spin);
  histories_.clear(i);
  std::vector<double> record;
  StoredGranule g;
  records_.pack(i, record, g.layout);
  g.position = vec(atom->x[i]);
  g.radius = atom->radius[i];
  g.mass = atom->rmass[i];
  g.tag = atom->tag[i];
  g.type = atom->type[i];
  g.lock_step = e.lock_step;
  g.load_change = e.load_change;
  g.normal_load = e.normal_load;
  store_->add(g, record.data(), static_cast<int>(record.size()));
  ledger_.stored(g);
  double& largest = largest_radius_by_type_[g.type];
  largest = std::max(largest, g.radius);
  records_.remove(i);
}

void FixSolidCull::free_what_wakes(bool all) {
  if (!all && balls_.empty()) return;
  for (int i = 0; i < atom->nlocal; ++i)
    if (shell_[i].locked && (all || in_ball(vec(atom->x[i]), 0))) {
      unlock(i);
      freed_.push_back(atom->tag[i]);
    }
  std::vector<std::int64_t> stored;
  if (all) store_->for_each([&](const StoredGranule& g) { stored.push_back(g.tag); });
  for (const Ball& b : balls_)
    if (!all)
      store_->for_each_in_box(b.centre - Vec3::Constant(b.radius), b.centre + Vec3::Constant(b.radius), [&](const StoredGranule& g) {
        if ((g.position - b.centre).squaredNorm() <= b.radius * b.radius) stored.push_back(g.tag);
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
    if (!i || shell_[*i].locked || in_ball(vec(atom->x[*i]), diameter_) ||
        !solid_state_.at_rest(vec(atom->v[*i]), vec(atom->omega[*i]), atom->radius[*i]))
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
  rows = halo_.exchange(rows, 5, contact_reach());
  for (std::size_t r = 0; r < rows.size(); r += 5)
    (rows[r + 4] == 0 ? freed_anywhere_ : locked_anywhere_)[static_cast<std::int64_t>(rows[r + 3])] = 1;
}

void FixSolidCull::share_exterior() {
  halo_exterior_.clear();
  if (!halo_.needed()) return;
  std::vector<double> rows;
  for (int i = 0; i < atom->nlocal; ++i)
    if (!shell_[i].locked) rows.insert(rows.end(), {atom->x[i][0], atom->x[i][1], atom->x[i][2], atom->radius[i]});
  rows = halo_.exchange(rows, 4, contact_reach() + store_gap_in_skins * neighbor->skin);
  for (std::size_t r = 0; r < rows.size(); r += 4) halo_exterior_.push_back({vec(&rows[r]), rows[r + 3]});
}

void FixSolidCull::keep_shell_closed() {
  const auto timed = watch_.time(Part::shell);
  const double gap = neighbor->skin;
  std::set<std::int64_t> near;
  const auto look_around = [&](const Sphere& s) {
    store_->for_each_near(s, gap, [&](const StoredGranule& g) { near.insert(g.tag); });
  };
  for (int i = 0; i < atom->nlocal; ++i)
    if (!shell_[i].locked) look_around(sphere(i));
  for (const Sphere& s : halo_exterior_) look_around(s);
  // what may have moved since the last reneighbouring: moving meshes; at the start of a run any wall
  const std::vector<WallContacts::Box> boxes = new_run_ ? walls_.triangle_boxes() : walls_.moving_triangle_boxes();
  const Vec3 reach = Vec3::Constant(store_->largest_radius() + gap);
  for (const WallContacts::Box& b : boxes)
    store_->for_each_in_box(b.lo - reach, b.hi + reach, [&](const StoredGranule& g) {
      if (!near.count(g.tag) && walls_.near({g.position, g.radius}, gap, !new_run_)) near.insert(g.tag);
    });
  if (new_run_)
    store_->for_each([&](const StoredGranule& g) {
      if (walls_.primitive_near({g.position, g.radius}, gap)) near.insert(g.tag);
    });
  if (open_for_insertion_)
    for (int f = 0; f < modify->nfix; ++f) {
      if (std::strncmp(modify->fix[f]->style, "insert/pack", 11) != 0 && std::strncmp(modify->fix[f]->style, "insert/rate", 11) != 0)
        continue;
      const LAMMPS_NS::Region* region = engine::insertion_region(modify->fix[f]);
      if (!region || !region->bboxflag) continue;
      store_->for_each_in_box(Vec3(region->extent_xlo, region->extent_ylo, region->extent_zlo) - reach,
                              Vec3(region->extent_xhi, region->extent_yhi, region->extent_zhi) + reach,
                              [&](const StoredGranule& g) { near.insert(g.tag); });
    }
  for (const std::int64_t tag : near) bring_back(tag);
  shell_reopened_ = !near.empty();
}

void FixSolidCull::freeze_contacts() {
  // contact between two granules that are locked now is left out of the engine's lists from here on
  const auto is_locked = [&](std::int64_t tag) {
    if (const int* i = index_of_.find(tag)) return shell_[*i].locked;
    return locked_anywhere_.contains(tag) || (ghost_interface_.contains(tag) && !freed_anywhere_.contains(tag));
  };
  // the load of a contact that goes inside stays in the balance that the older granule was locked with (invariant I5)
  const auto rebase = [&](int i, std::int64_t partner, const double* history) {
    if (shell_[i].fresh) return;
    if (const int* j = index_of_.find(partner)) shell_[i].reference -= pair_force_.on_first(i, *j, history);
  };
  for (int i = 0; i < atom->nlocal; ++i) {
    if (!shell_[i].locked) continue;
    const std::int64_t tag = atom->tag[i];
    histories_.for_each_partner(i, [&](int partner, const double* history) {
      if (!is_locked(partner)) return;
      if (!contacts_.contains(tag, partner)) contacts_.add(tag, partner, contacts_.width() ? history : nullptr);
      rebase(i, partner, history);
    });
  }
  for (const Touch& t : touches_)
    if (is_locked(t.a) && is_locked(t.b) && !contacts_.contains(t.a, t.b)) {
      contacts_.add(t.a, t.b, nullptr);
      if (contacts_.width()) continue;  // touching within the gap: no force
      if (const int* a = index_of_.find(t.a)) rebase(*a, t.b, nullptr);
      if (const int* b = index_of_.find(t.b)) rebase(*b, t.a, nullptr);
    }
  for (const SideChange& c : side_changes_) {
    const int* i = index_of_.find(c.interface_tag);
    if (i && shell_[*i].locked && !shell_[*i].fresh && is_locked(c.other_tag)) shell_[*i].reference -= c.force;
  }
}

void FixSolidCull::thaw_contacts() {
  std::map<int, std::vector<ContactHistories::Contact>> given;
  freed_anywhere_.for_each([&](std::int64_t tag, char) {
    const int* mine = index_of_.find(tag);
    contacts_.for_each(tag, [&](std::int64_t partner, const double* history) {
      if (!history) return;
      if (mine) given[*mine].push_back({partner, std::vector<double>(history, history + contacts_.width())});
      if (const int* theirs = index_of_.find(partner)) given[*theirs].push_back({tag, contacts_.turned(history)});
    });
    contacts_.erase(tag);
  });
  for (const auto& g : given) histories_.give(g.first, g.second);
  thawed_ = !freed_anywhere_.empty();
}

void FixSolidCull::store_what_is_deep() {
  std::int64_t highest = 0, highest_anywhere = 0;
  for (int i = 0; i < atom->nlocal; ++i) highest = std::max<std::int64_t>(highest, atom->tag[i]);
  MPI_Allreduce(&highest, &highest_anywhere, 1, MPI_INT64_T, MPI_MAX, world);
  if (locked_now_.empty()) return;

  std::vector<Sphere> exterior;
  for (int i = 0; i < atom->nlocal; ++i)
    if (!shell_[i].locked) exterior.push_back(sphere(i));
  exterior.insert(exterior.end(), halo_exterior_.begin(), halo_exterior_.end());
  SphereCells cells;
  cells.build(std::move(exterior), 2 * diameter_);
  const double gap = store_gap_in_skins * neighbor->skin;
  for (int i = atom->nlocal - 1; i >= 0; --i) {
    // the highest tag must stay an atom: new atoms are numbered from it
    if (!shell_[i].locked || shell_[i].wall_near || atom->tag[i] == highest_anywhere) continue;
    if (!cells.any_near(sphere(i), gap)) put_away(i);
  }
}

void FixSolidCull::publish_atom_counts() {
  LAMMPS_NS::bigint owned = atom->nlocal;
  MPI_Allreduce(&owned, &atom->natoms, 1, MPI_LMP_BIGINT, MPI_SUM, world);
  std::int64_t stored = static_cast<std::int64_t>(store_->size());
  const std::int64_t before = stored_everywhere_;
  MPI_Allreduce(&stored, &stored_everywhere_, 1, MPI_INT64_T, MPI_SUM, world);
  if (output->thermo) engine::expect_atoms(*output->thermo, static_cast<long>(before - stored_everywhere_));
  if (atom->map_style) {
    atom->nghost = 0;
    atom->map_init();
    atom->map_set();
  }
  const double moved = static_cast<double>(freed_.size() + locked_now_.size());
  if (any_rank(moved > sort_share * atom->nlocal) && atom->sortfreq > 0) atom->nextsort = update->ntimestep;
  ++membership_version_;
  label_bodies();
}

void FixSolidCull::label_bodies() {
  const std::map<int, int> number = global_bodies();
  for (int i = 0; i < atom->nlocal; ++i) {
    if (!shell_[i].locked) {
      vector_atom[i] = 0;
      continue;
    }
    const int body = bodies_.body_of(atom->tag[i]);
    const auto found = number.find(body);
    vector_atom[i] = found == number.end() ? body : found->second;
  }
}

std::map<int, int> FixSolidCull::global_bodies() {
  std::map<int, int> number;
  if (comm->nprocs == 1) return number;
  // a contact across ranks joins the bodies of its two ends: each rank sends its end, all ranks join the same pairs
  const double ranks = comm->nprocs;
  std::vector<double> rows;
  contacts_.for_each_contact([&](std::int64_t low, std::int64_t high, const double*) {
    const int a = bodies_.body_of(low), b = bodies_.body_of(high);
    if ((a == 0) == (b == 0)) return;
    rows.insert(rows.end(), {double(low), double(high), (a ? a : b) * ranks + comm->me});
  });
  rows = halo_.gather_all(rows);
  std::map<std::pair<double, double>, int> first_end;
  std::map<int, int> parent;
  const auto root = [&](int key) {
    while (parent.count(key) && parent[key] != key) key = parent[key];
    return key;
  };
  for (std::size_t r = 0; r < rows.size(); r += 3) {
    const int key = static_cast<int>(rows[r + 2]);
    const auto end = first_end.emplace(std::make_pair(rows[r], rows[r + 1]), key);
    if (end.second) continue;
    const int a = root(key), b = root(end.first->second);
    if (a != b) parent[std::max(a, b)] = std::min(a, b);
  }
  for (const auto& body : bodies_.bodies()) {
    const int key = body.first * comm->nprocs + comm->me;
    number[body.first] = root(key);
  }
  return number;
}

void FixSolidCull::restore_all() {
  histories_.bring_up_to_date();
  wake_all_ = true;
  change_membership();
  if (store_->size() != 0 || bodies_.locked() != 0 || contacts_.size() != 0)
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
    store_->for_each_near(s, neighbor->skin, [&](const StoredGranule& g) {
      near = true;
      if ((g.position - s.centre).norm() < g.radius + s.radius) overlapping = atom->tag[i];
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
