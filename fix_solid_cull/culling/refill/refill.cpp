#include "refill.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "near_walls.h"
#include "shell_closure.h"
#include "site_choice.h"
#include "sphere_relaxation.h"

namespace solidcull {
namespace {

constexpr int sweeps_alone = 200;
// ranks show each other what they have packed, so many times for each turn
constexpr int rounds_of_a_turn = 4, sweeps_in_a_round = 40;
constexpr double overlap_allowed = 1e-3;  // of the radii's sum: as resting granules have
constexpr double clear_of_walls = 0.5;    // diameters: nobody asks for walls within so far of a place where none was so near
// what overlaps by more after that is caught between others: it looks for room elsewhere, so many times at most
constexpr double caught = 0.03;  // of the radii's sum
constexpr int new_beginnings = 4, sweeps_again = 60;
constexpr double longest_way = 4, next_place = 3;  // diameters

/// In turns ranks look for room, so that no two find the same: those that share a border have other turns.
struct Turns {
  int count, mine;
};
Turns turns(const Bed& bed) {
  Turns t{1, 0};
  const std::array<std::vector<double>, 3> cuts = bed.ranks.cuts();
  const Box own = bed.ranks.own();
  for (std::size_t d = 0; d < 3; ++d) {
    const int ranks = static_cast<int>(cuts[d].size()) - 1;
    if (ranks == 1) continue;
    const double middle = 0.5 * (own.lo[d] + own.hi[d]);
    const int at = static_cast<int>(std::upper_bound(cuts[d].begin(), cuts[d].end(), middle) - cuts[d].begin()) - 1;
    const bool closed_ring = bed.run.periodic[d] && ranks % 2 == 1;  // the last one's neighbours have both turns
    t.mine += t.count * (closed_ring && at + 1 == ranks ? 2 : at % 2);
    t.count *= closed_ring ? 3 : 2;
  }
  t.count = std::max(t.count, 2);  // one rank beside its own images pauses, too
  return t;
}

}  // namespace

void Refill::begin_change() { newcomers_.clear(); }

void Refill::came_back(int i, const StoredGranule&, const Vec3&) {
  if (acts()) came_back_.push_back(bed_.atoms.tag[i]);
}

bool Refill::fetch(const std::vector<std::int64_t>& stored) {
  for (const std::int64_t tag : stored) exchange_.bring_back(tag);
  return !stored.empty();
}

// ------------------------------------------------------------------------------------------------------------ into the store

/// It may have been unlocked in this change.
void Refill::relocate(int i, const Vec3& place) {
  const Locked& e = bed_.shell[i];
  Atoms& atoms = bed_.atoms;
  const Vec3 by = bed_.solid.bodies().pose(e.body).turned_to_world(place - e.place);
  bed_.solid.count_refilled(-atoms.mass[i] * bed_.run.gravity().dot(by));
  bed_.solid.relocate(e.body, {atoms.mass[i], e.place, atoms.radius[i], e.held}, place);
  bed_.shell.set_place(i, {e.body, place});
  atoms.set_place(i, atoms.place(i) + by);
}

std::size_t Refill::put_away(const std::vector<int>& atoms, const std::function<bool(int, const Sphere&)>& near) {
  const double wall_gap = (ShellClosure::wall_gap_in_skins + ShellClosure::wall_check_in_skins) * bed_.run.skin;
  const SiteChoice choice(bed_, atoms, wall_gap, [&](int i, const Sphere& there) {
    // where it would lie: through a periodic side others are near than beyond it
    const Sphere in_box{bed_.run.wrapped(there.centre), there.radius};
    return bed_.ranks.owns(in_box.centre) && !near(i, in_box);
  });
  std::size_t went = 0;
  for (std::size_t k = 0; k < atoms.size(); ++k)
    if (const auto site = choice.of(k)) {
      relocate(atoms[k], *site);
      exchange_.put_away(atoms[k]);
      ++went;
    }
  return went;
}

// ------------------------------------------------------------------------------------------------------------ and back

bool Refill::pack() {
  if (!acts()) return false;
  const std::vector<std::int64_t> came = std::exchange(came_back_, {});
  if (!bed_.ranks.any(!came.empty())) return false;
  newcomers_.insert(newcomers_.end(), came.begin(), came.end());
  std::sort(newcomers_.begin(), newcomers_.end());
  newcomers_.erase(std::unique(newcomers_.begin(), newcomers_.end()), newcomers_.end());
  if (!bed_.ranks.has_neighbours()) {
    pack(sweeps_alone, true);
    return true;
  }
  const Turns t = turns(bed_);
  const int rounds = rounds_of_a_turn * t.count;
  for (int round = 0; round < rounds; ++round) pack(sweeps_in_a_round, round + 1 < rounds && round % t.count == t.mine);
  return true;
}

void Refill::pack(int sweeps, bool look_for_room) {
  const Atoms& atoms = bed_.atoms;
  struct Row {
    Triple at;
    double radius;
    int rank;
    bool moves;
  };
  std::vector<char> moves(static_cast<std::size_t>(atoms.owned), 0);
  std::vector<int> movable;
  SphereRelaxation::Spheres spheres;
  Vec3 lo = Vec3::Constant(HUGE_VAL), hi = Vec3::Constant(-HUGE_VAL);
  for (const std::int64_t tag : newcomers_) {
    const int* i = bed_.index.find(tag);
    if (!i || bed_.shell[*i].body <= 0) continue;  // it went to the store again, or has left its body
    moves[static_cast<std::size_t>(*i)] = 1;
    movable.push_back(*i);
    spheres.free.push_back(atoms.sphere(*i));
    lo = lo.cwiseMin(atoms.place(*i));
    hi = hi.cwiseMax(atoms.place(*i));
  }
  const double way = longest_way * bed_.scales.diameter(), reach = contact_reach(bed_) + way;
  const auto is_near = [&](const Vec3& x) {
    return (x.array() > lo.array() - reach).all() && (x.array() < hi.array() + reach).all();
  };
  std::vector<Row> rows;
  for (int i = 0; i < atoms.owned; ++i) {
    char& mine = moves[static_cast<std::size_t>(i)];
    if (!mine && is_near(atoms.place(i))) {
      mine = !bed_.shell[i].locked && bed_.shell[i].body > 0;  // freed in this change, and of its body still
      (mine ? spheres.stiff : spheres.fixed).push_back(atoms.sphere(i));
      if (mine) movable.push_back(i);
    }
    rows.push_back({triple(atoms.place(i)), atoms.radius[i], bed_.ranks.me, mine != 0});
  }
  if (bed_.ranks.has_neighbours())
    for (const Row& r : bed_.ranks.exchange(rows, reach))
      if ((!r.moves || r.rank != bed_.ranks.me) && is_near(vec(r.at)))  // its own see each other across a side
        spheres.fixed.push_back({vec(r.at), r.radius});
  if (spheres.free.empty()) return;
  std::set<std::int64_t> seen;
  for (const Sphere& s : spheres.free)
    bed_.stored.for_each_near(s, bed_.scales.diameter(), [&](const Resident& g) {
      if (seen.insert(g.tag).second)
        spheres.soft.push_back({bed_.solid.nearest_image(bed_.solid.in_world(g), s.centre), g.radius});
    });
  Vec3 periods = bed_.run.edges();
  for (int d = 0; d < 3; ++d)
    if (!bed_.run.periodic[d]) periods[d] = 0;
  SphereRelaxation relaxation(std::move(spheres), periods);
  const std::vector<Sphere> before = relaxation.spheres();
  const NearWalls walls(bed_.walls, before, way);
  const double clear = clear_of_walls * bed_.scales.diameter();
  std::vector<Vec3> clear_at(before.size(), Vec3::Constant(HUGE_VAL));
  relaxation.keep_to([&](std::size_t k, const Vec3& place) {
    if ((place - before[k].centre).squaredNorm() >= way * way || !bed_.run.keeps(place)) return false;
    if ((place - clear_at[k]).squaredNorm() < clear * clear) return true;
    if (walls.near(k, {place, before[k].radius}, clear)) return !walls.near(k, {place, before[k].radius}, 0);
    clear_at[k] = place;
    return true;
  });
  double least = relaxation.relax(sweeps, overlap_allowed);
  std::vector<Sphere> best = relaxation.spheres();
  for (int n = 0; look_for_room && n < new_beginnings && least > caught; ++n) {
    if (relaxation.reseat(caught, next_place * bed_.scales.diameter()) == 0) break;
    const double overlap = relaxation.relax(sweeps_again, overlap_allowed);
    if (overlap >= least) continue;
    least = overlap;
    best = relaxation.spheres();
  }
  place(movable, best);
}

void Refill::place(const std::vector<int>& atoms, const std::vector<Sphere>& now) {
  for (std::size_t k = 0; k < atoms.size(); ++k) {
    const int i = atoms[k];
    const Vec3 by = now[k].centre - bed_.atoms.place(i);
    if (!by.isZero(0)) relocate(i, bed_.shell[i].place + bed_.solid.bodies().pose(bed_.shell[i].body).turned_to_frame(by));
  }
}

// ------------------------------------------------------------------------------------------------------------ energy

void Refill::note_freed(const FlatMap<char>& freed) {
  if (!acts()) return;
  freed_ = freed;
  kept_.clear();
  const HistoryRows rows = bed_.contacts.histories();
  for (int i = 0; i < bed_.atoms.owned; ++i)
    rows.for_each_partner(i, [&](std::int64_t partner, const double*) {
      if (freed.contains(bed_.atoms.tag[i]) || freed.contains(partner)) kept_.insert(ordered(bed_.atoms.tag[i], partner));
    });
}

/// Half of force times overlap: exact for Hooke's law, a quarter too much for Hertz's.
void Refill::count_energy_of_new_contacts() {
  if (freed_.empty()) return;
  const Atoms& atoms = bed_.atoms;
  double energy = 0;
  bed_.contacts.neighbours().for_each_pair(atoms.owned, [&](int i, int j, int k) {
    if (!freed_.contains(atoms.tag[i]) && !freed_.contains(atoms.tag[j])) return;
    const double overlap = atoms.radius[i] + atoms.radius[j] - (atoms.place(i) - atoms.place(j)).norm();
    if (overlap <= 0 || kept_.count(ordered(atoms.tag[i], atoms.tag[j]))) return;
    const double share = j < atoms.owned ? 1.0 : 0.5;  // another rank sees it, too
    energy += share * 0.5 * bed_.contacts.force_on_first(i, k).norm() * overlap;
  });
  bed_.solid.count_refilled(energy);
  freed_.clear();
}

}  // namespace solidcull
