#include "survey.h"

#include <array>
#include <cmath>
#include <map>

#include "sphere_cells.h"
#include "stored_search.h"

namespace solidcull {
namespace {

// culling waits for neighbour lists that are built anyway, until a granule has waited for so many looks
constexpr int longest_wait = 10;

MovingSphere state_of(const Atoms& atoms, int i) { return {atoms.place(i), atoms.velocity(i), atoms.spin(i), atoms.radius[i]}; }

void keep_only(const FlatMap<char>& kept, std::vector<std::int64_t>& tags) {
  tags.erase(std::remove_if(tags.begin(), tags.end(), [&](std::int64_t tag) { return !kept.contains(tag); }), tags.end());
}

FlatMap<char> set_of(const std::vector<std::int64_t>& tags) {
  FlatMap<char> set;
  for (const std::int64_t tag : tags) set[tag] = 1;
  return set;
}

}  // namespace

std::int64_t Survey::exterior_here() const {
  std::int64_t n = 0;
  for (int i = 0; i < bed_.atoms.owned; ++i) n += !bed_.shell[i].locked;
  return n;
}

double Survey::kinetic_energy_of_exterior() const {
  double energy = 0;
  for (int i = 0; i < bed_.atoms.owned; ++i)
    if (!bed_.shell[i].locked && !bed_.clumps.of(i)) energy += 0.5 * bed_.atoms.mass[i] * bed_.atoms.velocity(i).squaredNorm();
  if (bed_.clumps.possible)
    for (int k = 0; k < bed_.clumps.count(); ++k) energy += bed_.clumps.clump(k).kinetic_energy();
  bed_.ranks.sum(&energy, 1);
  return energy;
}

void Survey::forget_calm() {
  begin_count();
  for (int i = 0; i < bed_.atoms.owned; ++i)
    if (!bed_.shell[i].locked) rows_[i].calm = 0;
}

// ------------------------------------------------------------------------------------------------------------ what is watched

void Survey::watch(bool lasts) {
  watches_ = lasts;
  // of audits before
  for (int i = 0; lasts && i < bed_.atoms.owned; ++i)
    if (rows_[i].woke_by == Woke::audit) rows_[i].woke_by = Woke::load;
}

// ------------------------------------------------------------------------------------------------------------ what is awake

void Survey::begin_count() {
  awake_ = {};
  why_.assign(static_cast<std::size_t>(bed_.atoms.owned), Awake::paused);
}

AwakeSteps Survey::see_awake(const Patience& patience, const Proposal& proposal) {
  const FlatMap<char> chosen = set_of(proposal.chosen);
  const bool covers = bed_.scales.depth() > 0;
  AwakeSteps awake = awake_;
  for (int i = 0; i < bed_.atoms.owned; ++i) {
    if (bed_.shell[i].locked) continue;
    const bool covered = covers && why_[i] == Awake::settling && calm_enough(i, patience) && !chosen.contains(bed_.atoms.tag[i]);
    rows_[i].awake = covered ? Awake::covered : why_[i];
    awake[rows_[i].awake] += 1;
    awake.in_vain += rows_[i].woken() && way_since_woken(i) <= moved_share * bed_.scales.diameter();
  }
  return awake;
}

/// m
double Survey::way_since_woken(int i) const {
  return (bed_.solid.nearest_image(bed_.atoms.place(i), rows_[i].woke_at) - rows_[i].woke_at).norm();
}

// ------------------------------------------------------------------------------------------------------------ solid state

/// Of owned granules and ghosts (m/s^2).
std::vector<Vec3> Survey::accelerations() const {
  const Atoms& atoms = bed_.atoms;
  std::vector<Vec3> a(static_cast<std::size_t>(atoms.owned + atoms.ghosts), Vec3::Zero());
  for (int i = 0; i < atoms.owned; ++i)
    if (!bed_.shell[i].locked) a[i] = atoms.force(i) / atoms.mass[i];
  for (std::size_t k = 0; k < motion_.interface_atoms().size(); ++k) {
    const ActiveBody& b = motion_.active()[motion_.slot(k)];
    const int i = motion_.interface_atoms()[k];
    if (!b.stands) a[i] = b.body->motion.acceleration(b.body->pose.to_world(bed_.shell[i].place), b.force, b.torque);
  }
  if (bed_.clumps.possible) accelerate_clumps(a);
  if (!bed_.ranks.has_neighbours()) return a;
  struct Row {
    Triple at;
    std::int64_t tag;
    Triple acceleration;
  };
  std::vector<Row> rows;
  for (int i = 0; i < atoms.owned; ++i) rows.push_back({triple(atoms.place(i)), atoms.tag[i], triple(a[i])});
  rows = bed_.ranks.exchange(rows, contact_reach(bed_));
  FlatMap<std::size_t> row_of;
  for (std::size_t r = 0; r < rows.size(); ++r) row_of[rows[r].tag] = r;
  for (int i = atoms.owned; i < atoms.owned + atoms.ghosts; ++i)
    if (const std::size_t* r = row_of.find(atoms.tag[i])) a[i] = vec(rows[*r].acceleration);
  return a;
}

/// Spheres of exterior clumps have the acceleration of their places: forces and torques on all spheres of one turn it, too.
void Survey::accelerate_clumps(std::vector<Vec3>& a) const {
  const Atoms& atoms = bed_.atoms;
  const std::map<int, Clump> clumps = bed_.clump_spheres.near();
  struct OfSphere {
    int i;
    const Clump* clump;
    Vec3 arm;
  };
  std::vector<OfSphere> spheres;
  using Load = std::array<double, 6>;  // force and torque
  std::vector<Load> loads(static_cast<std::size_t>(atoms.owned), Load{});
  for (int i = 0; i < atoms.owned; ++i) {
    const auto c = bed_.shell.locked(i) ? clumps.end() : clumps.find(bed_.clumps.of(i));
    if (c == clumps.end()) continue;
    const Vec3 arm = atoms.place(i) - bed_.solid.nearest_image(c->second.lies.centre, atoms.place(i)), f = atoms.force(i),
               torque = vec(atoms.torque + 3 * std::size_t(i)) + arm.cross(f);
    spheres.push_back({i, &c->second, arm});
    for (int d = 0; d < 3; ++d) {
      loads[i][d] = f[d];
      loads[i][3 + d] = torque[d];
    }
  }
  bed_.clump_spheres.unite(loads, [](Load& one, const Load& other) {
    for (int k = 0; k < 6; ++k) one[k] += other[k];
  });
  const Vec3 g = bed_.run.gravity();
  for (const OfSphere& s : spheres) {
    const Clump& c = *s.clump;
    const Vec3 spin = c.spin(), torque = vec(loads[s.i].data() + 3) - spin.cross(c.angular_momentum);
    const Vec3 turning = c.lies.turn * (c.lies.turn.conjugate() * torque).cwiseQuotient(c.lies.inertia);
    a[s.i] = vec(loads[s.i].data()) / c.mass + g + turning.cross(s.arm) + spin.cross(spin.cross(s.arm));
  }
}

// how it moves against what it touches: by less than twice `speed`, or faster
constexpr char nearly_quiet = 1, fast = 2;

/// What the neighbour lists say of each owned granule.
struct Survey::Seen {
  std::vector<Vec3> acceleration;  // of owned granules and ghosts (m/s^2)
  std::vector<char> touching;      // it has a neighbour within the gap
  std::vector<char> moving;        // it moves against one of them: nearly_quiet or fast
  std::vector<char> loaded;        // one of them presses on it
  std::vector<char> drifting;      // it drifts away from one that does not
  std::vector<Vec3> around;        // sum of mass times acceleration of what it touches (N)
  std::vector<double> mass;        // of what it touches (kg)
  std::vector<char> at_wall;       // it, or its clump, touches one
  std::vector<Pair> between_bodies;

  explicit Seen(std::size_t owned)
      : touching(owned, 0),
        moving(owned, 0),
        loaded(owned, 0),
        drifting(owned, 0),
        around(owned, Vec3::Zero()),
        mass(owned, 0.0),
        at_wall(owned, 0) {}
};

Survey::Seen Survey::see_contacts(const SolidStateLaw& law) const {
  const Atoms& atoms = bed_.atoms;
  const int owned = atoms.owned;
  Seen seen(static_cast<std::size_t>(owned));
  seen.acceleration = accelerations();
  SolidStateLaw twice = law;
  twice.speed *= 2;
  const double bears = bed_.contacts.reach_factor;
  for (int i = 0; i < owned; ++i) seen.at_wall[i] = walls_[i].touched > 0;
  const NeighbourRows list = bed_.contacts.neighbours();
  for (int row = 0; row < list.rows; ++row) {
    const int i = list.row[row];
    if (i >= owned) continue;
    const MovingSphere a = state_of(atoms, i);
    for (int k = 0; k < list.count[i]; ++k) {
      const int j = list.partners[i][k] & list.mask;
      const double reach = (a.radius + atoms.radius[j]) * (1 + SolidStateLaw::gap);
      const double square = (atoms.place(j) - a.position).squaredNorm();
      if (square > reach * reach) continue;
      const MovingSphere b = state_of(atoms, j);
      const double radii = a.radius + b.radius;
      const bool pressed = square < radii * radii;
      if (!pressed && square > bears * bears * radii * radii && law.spins_beside(a, b)) continue;
      const bool drifts = !pressed && !law.still_neighbour(a, b);
      const bool quiet = law.quiet_contact(a, b);
      const bool nearly = !quiet && twice.quiet_contact(a, b);
      const auto note = [&](int one, int other) {
        seen.loaded[one] |= pressed;
        seen.drifting[one] |= drifts;
        seen.touching[one] = 1;
        seen.around[one] += atoms.mass[other] * seen.acceleration[other];
        seen.mass[one] += atoms.mass[other];
        if (!quiet) seen.moving[one] = std::max(seen.moving[one], nearly ? nearly_quiet : fast);
      };
      note(i, j);
      if (j < owned) note(j, i);
      if (bed_.shell[i].locked && bed_.groups.key_of_atom(j)) seen.between_bodies.push_back({i, j});
    }
  }
  return seen;
}

/// What one sphere of a clump touches, all of it touch.
void Survey::see_clumps(Seen& seen) const {
  struct Sphere {
    char touching, moving, loaded, drifting, at_wall;
    Triple around;
    double mass;
  };
  std::vector<Sphere> spheres;
  for (std::size_t i = 0; i < seen.touching.size(); ++i)
    spheres.push_back({seen.touching[i], seen.moving[i], seen.loaded[i], seen.drifting[i], seen.at_wall[i],
                       triple(seen.around[i]), seen.mass[i]});
  bed_.clump_spheres.unite(spheres, [](Sphere& one, const Sphere& other) {
    one.touching |= other.touching;
    one.moving = std::max(one.moving, other.moving);
    one.loaded |= other.loaded;
    one.drifting |= other.drifting;
    one.at_wall |= other.at_wall;
    for (int d = 0; d < 3; ++d) one.around[d] += other.around[d];
    one.mass += other.mass;
  });
  for (std::size_t i = 0; i < spheres.size(); ++i) {
    if (bed_.shell.locked(static_cast<int>(i))) continue;
    const Sphere& s = spheres[i];
    seen.touching[i] = s.touching;
    seen.moving[i] = s.moving;
    seen.loaded[i] = s.loaded;
    seen.drifting[i] = s.drifting;
    seen.at_wall[i] = s.at_wall;
    seen.around[i] = vec(s.around);
    seen.mass[i] = s.mass;
  }
}

/// Acceleration of what it touches (m/s^2): a wall is a neighbour too; that it is accelerated itself is not known here.
Vec3 Survey::frame_of(int i, const Seen& seen) const {
  return seen.around[i] / (seen.mass[i] + (seen.at_wall[i] ? bed_.atoms.mass[i] : 0.0));
}

/// What keeps it awake now; `settling` if nothing does.
Awake Survey::see(int i, const Seen& seen, const SolidStateLaw& law) {
  const Atoms& atoms = bed_.atoms;
  const AtWall& wall = walls_[i];
  const bool at_wall = seen.at_wall[i] != 0, loaded = seen.loaded[i] || at_wall;
  const Vec3 v = atoms.velocity(i);
  // a granule that touches nothing but a wall that stands still is one with it where it stays: not where it rolls or slides
  const bool leaves_wall = !seen.touching[i] && wall.stands && std::max(v.norm(), wall.slip) >= law.speed;
  if (!atoms.may_be_culled(i, bed_.clumps.of(i))) return Awake::held;
  if (!(seen.touching[i] || at_wall) || !(loaded || !seen.drifting[i])) return Awake::alone;
  if (seen.moving[i] || leaves_wall) return Awake::moving;
  const Vec3 frame = frame_of(i, seen);
  if (!law.balanced(seen.acceleration[i], frame)) return Awake::unsteady;
  AtRest& r = rows_[i];
  const double passed = static_cast<double>(bed_.run.step - r.since) * bed_.run.dt;
  if (r.calm == 0 || !law.went_on(v - r.velocity, r.acceleration_around, frame, passed)) {
    r.calm = 0;  // calm begins here, with this motion
    r.velocity = v;
    r.acceleration_around = frame;
    r.since = bed_.run.step;
  }
  return Awake::settling;
}

std::int64_t Survey::find_calm(const Patience& patience, Proposal& proposal) {
  SolidStateLaw law = bed_.scales.solid_state();
  law.speed /= patience.speed_divisor;
  law.force /= patience.force_divisor;
  Seen seen = see_contacts(law);
  if (bed_.clumps.possible) see_clumps(seen);
  SolidStateLaw twice = law;
  twice.force *= 2;
  std::int64_t candidates = 0;
  begin_count();
  for (int i = 0; i < bed_.atoms.owned; ++i) {
    if (bed_.shell[i].locked) continue;
    why_[i] = see(i, seen, law);
    const bool solid = why_[i] == Awake::settling && !is_watched(i);
    rows_[i].calm = solid ? rows_[i].calm + 1 : 0;
    if (why_[i] == Awake::moving && seen.moving[i] == nearly_quiet)
      awake_.nearly_slow += law.balanced(seen.acceleration[i], frame_of(i, seen));
    if (why_[i] == Awake::unsteady) awake_.nearly_balanced += twice.balanced(seen.acceleration[i], frame_of(i, seen));
  }
  if (bed_.clumps.possible) unite_calm();
  for (int i = 0; i < bed_.atoms.owned; ++i) candidates += !bed_.shell[i].locked && rows_[i].calm >= looks_for(i, patience);
  join_bodies(seen, patience.looks, proposal);
  return candidates;
}

/// A clump is calm if all of its spheres are.
void Survey::unite_calm() {
  struct Sphere {
    Awake why;
    int calm;
  };
  std::vector<Sphere> spheres;
  for (std::size_t i = 0; i < why_.size(); ++i) spheres.push_back({why_[i], rows_[static_cast<int>(i)].calm});
  bed_.clump_spheres.unite(spheres, [](Sphere& one, const Sphere& other) {
    one.why = std::min(one.why, other.why);
    one.calm = std::min(one.calm, other.calm);
  });
  for (std::size_t i = 0; i < spheres.size(); ++i) {
    if (bed_.shell.locked(static_cast<int>(i))) continue;
    why_[i] = spheres[i].why;
    rows_[static_cast<int>(i)].calm = spheres[i].calm;
  }
}

/// Bodies that have rested against each other for so many looks are one.
void Survey::join_bodies(const Seen& seen, int looks, Proposal& proposal) {
  const Atoms& atoms = bed_.atoms;
  const int owned = atoms.owned;
  std::vector<char> rests(static_cast<std::size_t>(owned), 0);  // against another body, once however many it touches
  for (const Pair& p : seen.between_bodies)
    for (const int end : {p.i, p.j})
      if (end < owned) rests[end] = !seen.moving[end];
  for (int i = 0; i < owned; ++i)
    if (bed_.shell[i].locked) rows_[i].calm = rests[i] ? rows_[i].calm + 1 : 0;
  for (const Pair& p : seen.between_bodies) {
    const bool long_enough = rows_[p.i].calm >= looks && (p.j >= owned || rows_[p.j].calm >= looks);
    if (!long_enough || seen.moving[p.i] || (p.j < owned && seen.moving[p.j])) continue;
    proposal.joins.push_back({triple(atoms.place(p.i)), atoms.tag[p.i], atoms.tag[p.j]});
  }
}

// ------------------------------------------------------------------------------------------------------------ steady loads

/// Whether the loads on these owned granules are what they were at the last look.
std::vector<char> Survey::find_steady(const std::vector<char>& asked) {
  const Atoms& atoms = bed_.atoms;
  const std::size_t owned = static_cast<std::size_t>(atoms.owned);
  std::vector<double> normal(owned, 0.0);
  std::vector<Vec3> pair_sum(owned, Vec3::Zero());
  if (std::find(asked.begin(), asked.end(), 1) != asked.end())
    bed_.contacts.neighbours().for_each_pair(atoms.owned, [&](int i, int j, int k) {
      const bool second = j < atoms.owned;
      if (!asked[i] && !(second && asked[j])) return;
      const Vec3 apart = atoms.place(i) - atoms.place(j);
      if (apart.norm() > (atoms.radius[i] + atoms.radius[j]) * bed_.contacts.reach_factor) return;
      const Vec3 f = bed_.contacts.force_on_first(i, k);
      const double n = std::abs(f.dot(apart)) / apart.norm();
      normal[i] += n;
      pair_sum[i] += f;
      if (!second) return;
      normal[j] += n;
      pair_sum[j] -= f;
    });
  std::vector<char> steady(owned, 0);
  const Vec3 g = bed_.run.gravity();
  for (int i = 0; i < atoms.owned; ++i) {
    if (!asked[i] || walls_[i].touched == 0) continue;
    // what neither pairs nor weight explain is the walls'
    const Vec3 wall = atoms.force(i) - pair_sum[i] - weight_in_force(i) * g;
    normal[i] += wall.norm();
  }
  bed_.clump_spheres.unite(normal, [](double& one, double other) { one += other; });
  for (int i = 0; i < atoms.owned; ++i) {
    if (bed_.shell[i].locked) continue;
    AtRest& r = rows_[i];
    if (!asked[i]) {
      r.normal_load = Locked::not_known;
      continue;
    }
    const double load = normal[i], then = r.normal_load;
    const double change = bed_.scales.solid_state().force * atoms.mass[i] * bed_.scales.gravity() +
                          SolidStateLaw::out_of_balance_share * bed_.scales.settings().tolerance_relative * load;
    steady[i] = then != Locked::not_known && std::abs(load - then) <= change;
    r.normal_load = load;
  }
  return steady;
}

/// Mass whose weight is in what the engine says is the force on atom i: what moves clumps adds theirs itself (kg).
double Survey::weight_in_force(int i) const { return bed_.clumps.of(i) ? 0.0 : bed_.atoms.mass[i]; }

void Survey::leave_out_unsteady(const Patience& patience, Proposal& proposal) {
  const bool live = bed_.scales.needs_surface();
  const Atoms& atoms = bed_.atoms;
  FlatMap<char> chosen = set_of(proposal.chosen);
  std::vector<char> asked(static_cast<std::size_t>(atoms.owned), 0);
  for (int i = 0; i < atoms.owned; ++i) {
    const int calm = bed_.shell[i].locked ? 0 : rows_[i].calm;
    const int from = std::max(1, looks_for(i, patience) - 1);
    asked[i] = live ? calm == from || chosen.contains(atoms.tag[i]) : calm >= from;
  }
  bed_.clump_spheres.any_of(asked);
  const std::vector<char> steady = find_steady(asked);
  for (int i = 0; i < atoms.owned; ++i) {
    if (!asked[i] || steady[i] || patience.at_once()) continue;  // one look alone knows no change
    if (live)
      chosen.erase(atoms.tag[i]);
    else
      rows_[i].calm = std::min(rows_[i].calm, looks_for(i, patience) - 1);
  }
  keep_only(chosen, proposal.chosen);
}

// ------------------------------------------------------------------------------------------------------------ choice

void Survey::choose(int i, Proposal& proposal) {
  proposal.chosen.push_back(bed_.atoms.tag[i]);
  if (++rows_[i].waited >= longest_wait) proposal.overdue_tags.push_back(bed_.atoms.tag[i]);
}

void Survey::choose_deep(const Patience& patience, Cover& cover, Proposal& proposal) {
  std::vector<char> calm(static_cast<std::size_t>(bed_.atoms.owned)), deep(calm.size());
  for (int i = 0; i < bed_.atoms.owned; ++i) {
    calm[i] = !bed_.shell[i].locked && rows_[i].calm >= looks_for(i, patience);
    deep[i] = calm[i] && cover.is_deep(i);
  }
  bed_.clump_spheres.all_of(deep);
  for (int i = 0; i < bed_.atoms.owned; ++i) {
    if (!calm[i]) continue;
    if (deep[i])
      choose(i, proposal);
    else
      rows_[i].waited = 0;
  }
}

/// A granule that woke and still stands where it stood has shown before that it bears its load there: half of the looks.
int Survey::looks_for(int i, const Patience& patience) const {
  if (patience.quick || !rows_[i].woken()) return patience.looks;
  return way_since_woken(i) > stands_share * bed_.scales.diameter() ? patience.looks : (patience.looks + 1) / 2;
}

/// Calm for as many looks as what presses on it asks for.
bool Survey::calm_enough(int i, const Patience& patience) const {
  const double factor =
      patience.quick ? 1 : SolidStateLaw::patience(bed_.atoms.mass[i] * bed_.scales.gravity(), rows_[i].normal_load);
  return rows_[i].calm >= factor * looks_for(i, patience);
}

void Survey::choose_asleep(const Patience& patience, Proposal& proposal) {
  const Atoms& atoms = bed_.atoms;
  SphereCells awake;
  const double cover = bed_.scales.depth();
  if (cover > 0) {
    std::vector<Sphere> spheres;
    struct Row {
      Triple at;
      double radius;
    };
    std::vector<Row> rows;
    for (int i = 0; i < atoms.owned; ++i) {
      if (bed_.shell[i].locked || calm_enough(i, patience)) continue;
      spheres.push_back(atoms.sphere(i));
      rows.push_back({triple(atoms.place(i)), atoms.radius[i]});
    }
    if (bed_.ranks.has_neighbours())
      for (const Row& r : bed_.ranks.exchange(rows, cover + contact_reach(bed_))) spheres.push_back({vec(r.at), r.radius});
    awake.build(std::move(spheres), std::max(cover, 2 * bed_.scales.diameter()));
  }
  std::vector<char> asleep(static_cast<std::size_t>(atoms.owned), 0);
  for (int i = 0; i < atoms.owned; ++i)
    asleep[i] = !bed_.shell[i].locked && calm_enough(i, patience) && !(cover > 0 && awake.any_near(atoms.sphere(i), cover));
  bed_.clump_spheres.all_of(asleep);
  for (int i = 0; i < atoms.owned; ++i) {
    if (bed_.shell[i].locked) continue;
    if (asleep[i])
      choose(i, proposal);
    else
      rows_[i].waited = 0;
  }
}

bool Survey::some_chosen_near(const Proposal& proposal) const {
  if (bed_.ranks.count == 1) return !proposal.chosen.empty();
  struct Row {
    Triple at;
  };
  std::vector<Row> rows;
  const FlatMap<char> chosen = set_of(proposal.chosen);
  for (int i = 0; i < bed_.atoms.owned && !proposal.chosen.empty(); ++i)
    if (chosen.contains(bed_.atoms.tag[i])) rows.push_back({triple(bed_.atoms.place(i))});
  return !bed_.ranks.exchange(rows, contact_reach(bed_)).empty() || !proposal.chosen.empty();
}

void Survey::tie(Proposal& proposal) {
  const Atoms& atoms = bed_.atoms;
  const int owned = atoms.owned;
  FlatMap<char> chosen = set_of(proposal.chosen);
  std::vector<char> will_be_locked(static_cast<std::size_t>(owned + atoms.ghosts), 1);
  for (int i = 0; i < owned; ++i) will_be_locked[i] = atoms.is_interface(i) || chosen.contains(atoms.tag[i]);
  std::vector<char> touching(static_cast<std::size_t>(owned), 0), goes_along(static_cast<std::size_t>(owned), 0);
  bed_.contacts.neighbours().for_each_pair(owned, [&](int i, int j, int k) {
    const double radii = atoms.radius[i] + atoms.radius[j];
    const double distance = (atoms.place(i) - atoms.place(j)).norm();
    if (distance > radii * (1 + SolidStateLaw::gap)) return;
    const bool first = will_be_locked[i], second = will_be_locked[j];
    const bool bears = distance <= radii * bed_.contacts.reach_factor;
    if (!bears && bed_.scales.solid_state().spins_beside(state_of(atoms, i), state_of(atoms, j))) return;
    if (first && second) proposal.touches.push_back({atoms.tag[i], atoms.tag[j]});
    touching[i] = 1;
    goes_along[i] |= second;
    if (j < owned) {
      touching[j] = 1;
      goes_along[j] |= first;
    }
    // between owned granules the force is taken in the very state that is frozen; across ranks it is taken now
    const bool side_change = first && second && j >= owned && bed_.shell[i].locked && !atoms.is_interface(j);
    if (side_change && bears) proposal.side_changes.push_back({atoms.tag[i], atoms.tag[j], bed_.contacts.force_on_first(i, k)});
  });
  bed_.clump_spheres.any_of(touching);
  bed_.clump_spheres.any_of(goes_along);
  // alone among neighbours that all stay exterior it would make no solid: nothing is saved until one of them comes along
  for (int i = 0; i < owned; ++i) {
    if (!touching[i] || goes_along[i] || !chosen.contains(atoms.tag[i])) continue;
    chosen.erase(atoms.tag[i]);
    rows_[i].waited = 0;
  }
  keep_only(chosen, proposal.chosen);
  keep_only(chosen, proposal.overdue_tags);
}

}  // namespace solidcull
