#include "deep_granules.h"

#include <algorithm>
#include <set>

#include "sphere_cells.h"

namespace solidcull {
namespace {

// interface granules that nothing is near any more go to the store when they are this share of the atoms, or when more changes
constexpr double store_share = 0.05;
// they are looked for so often, and when something was locked
constexpr int builds_between_storing = 4;
// at a look: for this share of all atoms that might go to the store, at once
constexpr double worth_of_a_build = 0.05, least_worth = 10;

}  // namespace

/// Walls do not hinder it from going to the store: there are none, or they and its body stand still, and what they do to it is
/// known.
bool DeepGranules::may_leave_its_walls(int i) const {
  const AtWall& wall = walls_[i];
  if (!wall.near) return true;
  const Locked& e = bed_.shell[i];
  return bed_.scales.sleeping() && !wall.moving_near && bed_.solid.stands_in_store(e.body) && e.came_back != bed_.run.step &&
         !e.fresh && !closure_.walls_are_new();
}

/// Engines list what a still mesh is near to for contacts only, not as far as a body may move until somebody looks: of these
/// atoms those stay whose body may move, and a mesh is within the skin of them.
void DeepGranules::leave_out_near_meshes(std::vector<int>& atoms) const {
  std::vector<Sphere> spheres;
  std::vector<int> of;
  for (const int i : atoms)
    if (!bed_.solid.stands(bed_.shell[i].body)) {
      spheres.push_back(bed_.atoms.sphere(i));
      of.push_back(i);
    }
  if (spheres.empty()) return;
  SphereCells cells;
  cells.build(std::move(spheres), 2 * bed_.scales.diameter());
  const double skin = bed_.run.skin;
  const Vec3 reach = Vec3::Constant(cells.largest_radius() + skin);
  std::set<int> near;
  for (const WallTriangle& t : bed_.walls.triangles())
    cells.for_each_in_box(t.box.lo - reach, t.box.hi + reach, [&](std::size_t k, const Sphere& s) {
      if (!near.count(of[k]) && bed_.walls.near(t, s, skin)) near.insert(of[k]);
      return true;
    });
  atoms.erase(std::remove_if(atoms.begin(), atoms.end(), [&](int i) { return near.count(i) != 0; }), atoms.end());
}

bool DeepGranules::ask_to_store(const std::vector<int>& interface_atoms) {
  // but for those that something was near to the last time
  std::size_t may_go = 0;
  for (const int i : interface_atoms) may_go += may_leave_its_walls(i);
  const double gain = static_cast<double>(may_go) - static_cast<double>(stay_near_);
  asked_ = gain > std::max(worth_of_a_build * bed_.atoms.owned, least_worth);
  return asked_;
}

/// What an interface granule may have near it: exterior granules, shells and stored granules of other bodies, insertions.
class DeepGranules::Surroundings {
 public:
  explicit Surroundings(const DeepGranules& d)
      : bed_(d.bed_), closure_(d.closure_), gap_(ShellClosure::store_gap_in_skins * bed_.run.skin) {
    std::vector<Sphere> exterior, shells;
    const bool several = bed_.census.several_bodies();
    const auto sort_in = [&](const ShellClosure::Foreign& f) {
      if (!f.body) {
        exterior.push_back(f.sphere);
      } else if (several) {
        shells.push_back(f.sphere);
        of_shell_.push_back(f);
      }
    };
    for (int i = 0; i < bed_.atoms.owned; ++i) sort_in(closure_.as_foreign(i));
    for (const ShellClosure::Foreign& f : closure_.foreign()) sort_in(f);
    exterior_.build(std::move(exterior), 2 * bed_.scales.diameter());
    shells_.build(std::move(shells), 2 * bed_.scales.diameter());
    if (several) find_others();
    opened_ = closure_.opened(gap_);
  }
  bool near(int i) const { return near(i, bed_.atoms.sphere(i)); }
  /// The same if atom i was there.
  bool near(int i, const Sphere& there) const {
    return exterior_.any_near(there, gap_) || near_another_body(i, there) || is_open(there.centre);
  }

 private:
  struct Extent {
    Vec3 lo, hi;
  };
  /// The largest body is everywhere: it asks whether it is near one of the others. Of these there may be thousands of few
  /// granules.
  void find_others() {
    const SolidBodies& bodies = bed_.solid.bodies();
    std::size_t most = 0;
    for (const auto& [number, body] : bodies.bodies())
      if (static_cast<std::size_t>(body.mass.count) > most)
        most = static_cast<std::size_t>(body.mass.count), largest_ = bed_.groups.key_of(number);
    const GranuleStore& store = bed_.solid.store();
    std::vector<Sphere> small;
    store.for_each_body([&](int body, const Vec3& lo, const Vec3& hi) {
      if (bed_.groups.key_of(body) == largest_) return;
      const Pose& pose = bodies.pose(body);
      const Vec3 half = turned_half_box(pose.turn(), 0.5 * (hi - lo)) + Vec3::Constant(store.largest_radius());
      const Vec3 middle = pose.to_world(0.5 * (lo + hi));
      if (half.norm() < bed_.scales.diameter())
        small.push_back({middle, half.norm()});  // it holds their spheres
      else
        others_.push_back({middle - half, middle + half});
    });
    small_others_.build(std::move(small), 2 * bed_.scales.diameter());
  }
  bool is_open(const Vec3& x) const {
    return std::any_of(opened_.begin(), opened_.end(), [&](const Box& box) { return box.holds(x); });
  }
  bool near_another_body(int i, const Sphere& s) const {
    if (!bed_.census.several_bodies()) return false;
    const ShellClosure::Foreign self = closure_.as_foreign(i);
    // bodies that both stand still may be as near as they like, but what they do to each other needs two atoms
    const auto touches = [&](const Sphere& other) {
      const double reach = bed_.contacts.reach_factor * (s.radius + other.radius);
      return (bed_.solid.nearest_image(other.centre, s.centre) - s.centre).squaredNorm() < reach * reach;
    };
    if (shells_.any_near(s, gap_, [&](std::size_t k) {
          const ShellClosure::Foreign& other = of_shell_[k];
          return other.body != self.body && (!(self.stands && other.stands) || touches(other.sphere));
        }))
      return true;
    const double reach = s.radius + gap_;
    const bool images = bed_.ranks.image_shifts().size() > 1;
    if (self.body == largest_ && !images && !small_others_.any_near(s, gap_) &&
        std::none_of(others_.begin(), others_.end(), [&](const Extent& e) {
          return (s.centre.array() > e.lo.array() - reach).all() && (s.centre.array() < e.hi.array() + reach).all();
        }))
      return false;
    bool near = false;
    bed_.stored.for_each_near(
        s, gap_,
        [&](const Resident& g) {
          near = near || !(self.stands && bed_.solid.stands(g.body)) || touches({bed_.solid.in_world(g), g.radius});
        },
        [&](int body) { return self.body && bed_.groups.key_of(body) == self.body; });
    return near;
  }

  const Bed& bed_;
  const ShellClosure& closure_;
  const double gap_;
  SphereCells exterior_, shells_;
  std::vector<ShellClosure::Foreign> of_shell_;
  SphereCells small_others_;  // around bodies of few stored granules
  std::vector<Extent> others_;
  BodyGroups::Key largest_ = 0;
  std::vector<Box> opened_;
};

bool DeepGranules::looks_for_some(const Occasion& now) {
  asked_ = false;
  if (!now.locked_now && !now.asked && (!bed_.scales.sleeping() || ++builds_without_storing_ < builds_between_storing))
    return false;
  builds_without_storing_ = 0;
  return now.locked_now || bed_.scales.sleeping();
}

/// Of clumps, whose spheres other ranks may have, those of which all may go; they come together where the one is that has the
/// mass.
void DeepGranules::leave_out_parts_of_clumps(std::vector<int>& atoms) {
  bed_.clump_spheres.keep_whole(atoms);
  if (bed_.ranks.count == 1) return;
  const std::size_t owned = static_cast<std::size_t>(bed_.atoms.owned);
  std::vector<int> home(owned, bed_.ranks.count);
  for (std::size_t i = 0; i < owned; ++i)
    if (bed_.locked_clumps.find(bed_.atoms.tag[i])) home[i] = bed_.ranks.me;
  bed_.clump_spheres.unite(home, [](int& one, int other) { one = std::min(one, other); });
  for (const int i : atoms)
    if (bed_.shell[i].clump && home[i] != bed_.ranks.me) away_from_home_.push_back({bed_.atoms.tag[i], home[i]});
}

std::size_t DeepGranules::store(const Occasion& now, const PutAway& put_away) {
  const bool looks = looks_for_some(now);
  if (!looks && !bed_.clumps.possible) return 0;

  const Surroundings surroundings(*this);
  std::vector<int> deep;
  if (looks) stay_near_ = 0;
  for (int i = looks ? bed_.atoms.owned - 1 : -1; i >= 0; --i) {
    // the highest tag must stay an atom: new atoms are numbered from it
    if (!bed_.shell[i].locked || !may_leave_its_walls(i) || bed_.atoms.tag[i] >= now.highest) continue;
    if (surroundings.near(i))
      ++stay_near_;
    else
      deep.push_back(i);
  }
  leave_out_near_meshes(deep);
  // where nothing else changes, a few wait for more
  const bool waits = !now.membership_changes && static_cast<double>(deep.size()) < store_share * bed_.atoms.owned;
  if (waits) deep.clear();
  if (bed_.clumps.possible) leave_out_parts_of_clumps(deep);
  if (waits || !looks) return 0;
  return put_away(deep, [&](int i, const Sphere& there) { return surroundings.near(i, there); });
}

}  // namespace solidcull
