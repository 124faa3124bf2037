#include "shell_closure.h"

#include <algorithm>
#include <cmath>

#include "release.h"
#include "site_choice.h"

namespace solidcull {
namespace {

// a shell granule goes to the store when nothing exterior is within this many skins; it is fetched at one skin (no flapping)
constexpr double store_gap_in_skins = 2.5;
// an exterior granule that nothing stored was so near to need not be looked at again until it has moved by this many skins: it
// may have gone as far the other way when the last went to the store, so twice this and one skin is the gap
constexpr double clear_way_in_skins = 0.75;
// so many moving frames are compared with a granule one by one, more as one box
constexpr std::size_t few_frames = 8;
// interface granules that nothing is near any more go to the store when they are this share of the atoms, or when more changes
constexpr double store_share = 0.05;
// they are looked for so often, and when something was locked
constexpr int builds_between_storing = 4;
// at a look: for this share of all atoms that might go to the store, at once
constexpr double worth_of_a_build = 0.05, least_worth = 10;
// so many granules go to the store before the engine's arrays are cut, which would hold them and the store else
constexpr std::size_t rows_at_once = 100000;
// walls are looked at again when a body has moved by this many skins; what is nearer than that and a margin becomes an atom
constexpr double wall_check_in_skins = 0.25;
constexpr double wall_gap_in_skins = 1.5;

}  // namespace

void ShellClosure::merged(int gone, int kept, bool same_frame) {
  seen_walls_.erase(gone);
  if (!same_frame) seen_walls_.erase(kept);
}

ShellClosure::Foreign ShellClosure::as_foreign(int i) const {
  const Locked& e = bed_.shell[i];
  const bool in_body = e.in_body();  // else it has just been chosen
  // bodies that stand do not touch what is stored in each other, but at sites
  const bool stands = in_body && bed_.solid.stands(e.body) && !bed_.scales.refills();
  return {bed_.atoms.sphere(i), in_body ? bed_.groups.key_of(e.body) : 0, stands};
}

void ShellClosure::share() {
  foreign_.clear();
  if (!bed_.ranks.has_neighbours()) return;
  struct Row {
    Triple at;
    double radius;
    int body;
    bool stands;
  };
  std::vector<Row> rows;
  for (int i = 0; i < bed_.atoms.owned; ++i) {
    if (bed_.shell[i].locked && !bed_.census.several_bodies()) continue;
    const Foreign f = as_foreign(i);
    rows.push_back({triple(f.sphere.centre), f.sphere.radius, f.body, f.stands});
  }
  const double reach = contact_reach(bed_) + store_gap_in_skins * bed_.run.skin + bed_.stored.slack();
  for (const Row& r : bed_.ranks.exchange(rows, reach)) foreign_.push_back({{vec(r.at), r.radius}, r.body, r.stands});
}

ShellClosure::Overlapped ShellClosure::by_new_granules() const {
  Overlapped found;
  if (!bed_.ranks.any(some_made_)) return found;
  struct Row {
    Triple at;
    double radius;
    std::int64_t tag;
  };
  const Atoms& atoms = bed_.atoms;
  std::vector<Row> rows;
  for (int i = 0; some_made_ && i < atoms.owned; ++i)
    if (rows_[i].made) rows.push_back({triple(atoms.place(i)), atoms.radius[i], atoms.tag[i]});
  const std::vector<Row> others = bed_.ranks.exchange(rows, contact_reach(bed_) + bed_.stored.slack());
  rows.insert(rows.end(), others.begin(), others.end());
  std::vector<Sphere> made;
  for (const Row& r : rows) {
    made.push_back({vec(r.at), r.radius});
    bed_.stored.for_each_near(made.back(), 0, [&](const Resident& g) {
      found.in_stored = r.tag;
      found.places.push_back(bed_.solid.in_world(g));
    });
  }
  SphereCells cells;
  cells.build(std::move(made), 2 * bed_.scales.diameter());
  for (int i = 0; i < atoms.owned; ++i)
    if (bed_.shell.locked(i) && cells.any_near(atoms.sphere(i), 0)) found.places.push_back(atoms.place(i));
  bed_.ranks.largest(&found.in_stored, 1);
  return found;
}

void ShellClosure::forget_new() {
  if (!some_made_) return;
  some_made_ = false;
  for (int i = 0; i < bed_.atoms.owned; ++i) rows_[i].made = false;
}

/// Nothing that is stored in a frame that stands was within store_gap_in_skins of it when it was last looked at; since then it
/// has hardly moved, and only what is as far from all exterior granules went to the store.
bool ShellClosure::is_clear(int i) const {
  const double way = clear_way_in_skins * bed_.run.skin;
  return rows_[i].version == bed_.solid.standing_version() && (bed_.atoms.place(i) - rows_[i].at).squaredNorm() < way * way;
}

// ------------------------------------------------------------------------------------------------- what comes near stored
// granules

struct ShellClosure::Frame {
  int number, key;
  bool stands;
  const Pose* pose;
  Vec3 middle, half;  // of a box around its stored granules, and the gap, in the world
};

/// Frames of the store, with boxes around all of them and around those that move.
class ShellClosure::Frames {
 public:
  Frames(const ShellClosure& c, double gap) : shifts_(c.bed_.ranks.image_shifts()) {
    const Solid& solid = c.bed_.solid;
    solid.store().for_each_frame([&](int frame, const Vec3& own_lo, const Vec3& own_hi) {
      const Pose& pose = solid.pose_of_frame(frame);
      const Vec3 half =
          turned_half_box(pose.turn(), 0.5 * (own_hi - own_lo)) + Vec3::Constant(solid.store().largest_radius() + gap);
      const Frame f{frame,
                    frame == GranuleStore::shared_frame ? no_key : c.bed_.groups.key_of(frame),
                    solid.frame_stands(frame),
                    &pose,
                    pose.to_world(0.5 * (own_lo + own_hi)),
                    half};
      all_.push_back(f);
      around_all_.add(f);
      if (f.stands) return;
      moving_.push_back(f);
      around_moving_.add(f);
    });
  }
  bool far_from_all(const Vec3& x, double radius) const {
    return std::none_of(shifts_.begin(), shifts_.end(), [&](const Vec3& shift) { return around_all_.holds(x + shift, radius); });
  }
  bool near_moving(const Sphere& s) const {
    if (moving_.empty()) return false;
    return std::any_of(shifts_.begin(), shifts_.end(), [&](const Vec3& shift) {
      const Vec3 x = s.centre + shift;
      if (!around_moving_.holds(x, s.radius)) return false;
      if (moving_.size() > few_frames) return true;
      return std::any_of(moving_.begin(), moving_.end(),
                         [&](const Frame& f) { return ((x - f.middle).array().abs() <= f.half.array() + s.radius).all(); });
    });
  }
  const std::vector<Frame>& all() const { return all_; }
  bool none_moves() const { return moving_.empty(); }

 private:
  static constexpr int no_key = -1;
  struct Around {
    Vec3 lo = Vec3::Constant(HUGE_VAL), hi = Vec3::Constant(-HUGE_VAL);
    void add(const Frame& f) {
      lo = lo.cwiseMin(f.middle - f.half);
      hi = hi.cwiseMax(f.middle + f.half);
    }
    bool holds(const Vec3& x, double radius) const {
      return (x.array() >= lo.array() - radius).all() && (x.array() <= hi.array() + radius).all();
    }
  };
  const std::vector<Vec3>& shifts_;
  std::vector<Frame> all_, moving_;
  Around around_all_, around_moving_;
};

/// Exterior granules, and the shells of other bodies, that may be near something stored.
std::vector<ShellClosure::Visitor> ShellClosure::visitors(const Frames& frames) const {
  std::vector<Visitor> visitors;
  const auto comes = [&](const Visitor& v) {
    if (!(v.who.stands || v.clear) || frames.near_moving(v.who.sphere)) visitors.push_back(v);
  };
  for (const Foreign& f : foreign_)
    if (!frames.far_from_all(f.sphere.centre, f.sphere.radius)) comes({f, -1, false});
  for (int i = 0; i < bed_.atoms.owned; ++i) {
    const bool locked = bed_.shell[i].locked, clear = !locked && is_clear(i);
    if ((locked && !bed_.census.several_bodies()) || (clear && frames.none_moves()) ||
        frames.far_from_all(bed_.atoms.place(i), bed_.atoms.radius[i]))
      continue;
    comes({as_foreign(i), locked ? -1 : i, clear});
  }
  return visitors;
}

void ShellClosure::find_near_granules(std::set<std::int64_t>& near) {
  const double skin = bed_.run.skin, gap = store_gap_in_skins * skin;
  const Frames frames(*this, gap);
  std::vector<Visitor> all = visitors(frames);
  std::vector<Sphere> places;
  for (const Visitor& v : all) places.push_back(v.who.sphere);
  SphereCells cells;
  cells.build(std::move(places), 2 * bed_.scales.diameter() + gap);
  for (const Frame& f : frames.all()) {
    const Vec3 half = f.half + Vec3::Constant(cells.largest_radius());
    for (const Vec3& shift : bed_.ranks.image_shifts())
      cells.for_each_in_box(f.middle - half - shift, f.middle + half - shift, [&](std::size_t k, const Sphere& s) {
        Visitor& v = all[k];
        if (v.who.body == f.key || (f.stands && (v.who.stands || v.clear))) return true;
        const Vec3 at = f.pose->to_frame(s.centre + shift);
        bed_.solid.store().for_each_near(f.number, {at, s.radius}, gap, [&](const Resident& g) {
          if (v.who.body && bed_.groups.key_of(g.body) == v.who.body) return;  // in the frame that bodies share
          const double reach = s.radius + g.radius + skin;
          if ((g.position - at).squaredNorm() < reach * reach) near.insert(g.tag);
          if (f.stands) v.atom = -1;
        });
        return true;
      });
  }
  for (const Visitor& v : all)
    if (v.atom >= 0 && !v.clear) rows_[v.atom] = {bed_.solid.standing_version(), false, v.who.sphere.centre};
}

/// Walls and bodies are compared when they have moved against each other since the last time, and at the start of a run.
void ShellClosure::find_near_walls(std::set<std::int64_t>& near) {
  if (new_run_) seen_walls_.clear();
  const double skin = bed_.run.skin, gap = wall_gap_in_skins * skin, enough = wall_check_in_skins * skin;
  const std::vector<WallTriangle> triangles = bed_.walls.triangles();
  const Vec3 reach = Vec3::Constant(bed_.solid.store().largest_radius() + gap);
  std::vector<int> moved;  // frames that are to be compared with what stands still
  bed_.solid.store().for_each_frame([&](int frame, const Vec3& lo, const Vec3& hi) {
    const Pose& pose = bed_.solid.pose_of_frame(frame);
    const auto known = seen_walls_.find(frame);
    // walls that hold a body may have stored granules of it at them
    const bool at_walls = bed_.scales.sleeping() && bed_.solid.frame_stands(frame) && !new_run_;
    const bool against_still =
        !at_walls && (known == seen_walls_.end() || largest_way(known->second.pose, pose, lo, hi) >= enough);
    // what moves is seen from the body: a wall that turns with it stays where it is
    std::vector<Vec3> corners;
    for (const WallTriangle& t : triangles)
      if (t.moving)
        for (const Vec3& c : t.corner) corners.push_back(pose.to_frame(c));
    bool against_moving = known == seen_walls_.end() || known->second.corners.size() != corners.size();
    for (std::size_t k = 0; !against_moving && k < corners.size(); ++k)
      against_moving = (corners[k] - known->second.corners[k]).squaredNorm() >= enough * enough;
    if (!against_still && !against_moving) return;
    SeenWalls& seen = seen_walls_[frame];
    if (at_walls || against_still) seen.pose = pose;
    if (against_still) moved.push_back(frame);
    if (against_moving) seen.corners = std::move(corners);
    for (const WallTriangle& t : triangles)
      if (t.moving ? against_moving : against_still)
        bed_.stored.for_each_in_box(
            t.box.lo - reach, t.box.hi + reach,
            [&](const Resident& g) {
              const Vec3 x = bed_.solid.nearest_image(bed_.solid.in_world(g), 0.5 * (t.box.lo + t.box.hi));
              if (!near.count(g.tag) && bed_.walls.near(t, {x, g.radius}, gap)) near.insert(g.tag);
            },
            frame);
  });
  find_near_primitives(moved, near);
}

void ShellClosure::find_near_primitives(const std::vector<int>& frames, std::set<std::int64_t>& near) const {
  if (frames.empty()) return;
  const double gap = wall_gap_in_skins * bed_.run.skin;
  bed_.solid.store().for_each_frame([&](int frame, const Vec3& lo, const Vec3& hi) {
    if (std::find(frames.begin(), frames.end(), frame) == frames.end()) return;
    // a ball around all of them first
    const Sphere all{bed_.solid.pose_of_frame(frame).to_world(0.5 * (lo + hi)),
                     0.5 * (hi - lo).norm() + bed_.solid.store().largest_radius()};
    if (!bed_.walls.primitive_near(all, gap)) return;
    bed_.solid.store().for_each_in_box(frame, lo, hi, [&](const Resident& g) {
      if (bed_.walls.primitive_near({bed_.solid.in_world(g), g.radius}, gap)) near.insert(g.tag);
    });
  });
}

std::size_t ShellClosure::fetch_what_is_near() {
  std::set<std::int64_t> near;
  find_near_granules(near);
  find_near_walls(near);
  for (const Box& box : opened(bed_.run.skin))
    bed_.stored.for_each_in_box(box.lo, box.hi, [&](const Resident& g) { near.insert(g.tag); });
  for (const std::int64_t tag : near) exchange_.bring_back(tag);
  return near.size();
}

/// Where everything is to be an atom, whatever is near: `gap` wider than it must be.
std::vector<Box> ShellClosure::opened(double gap) const {
  const double largest = bed_.solid.store().largest_radius();
  std::vector<Box> all = bed_.insertions.counting(largest + gap);
  for (const Box& box : bed_.insertions.due_boxes(largest)) all.push_back(box.grown_by(gap));
  return all;
}

std::size_t ShellClosure::fetch_from_outside() {
  const Run& run = bed_.run;
  const auto outside = [&](const Vec3& x, double margin) {
    return (x.array() - margin < run.kept.lo.array()).any() || (x.array() + margin >= run.kept.hi.array()).any();
  };
  std::vector<std::int64_t> leaving;
  bed_.solid.store().for_each_frame([&](int frame, const Vec3& lo, const Vec3& hi) {
    if (bed_.solid.frame_stands(frame)) return;
    const Pose& pose = bed_.solid.pose_of_frame(frame);
    if (!outside(pose.to_world(0.5 * (lo + hi)), 0.5 * (hi - lo).norm())) return;
    // the ball around them may stick out where they do not
    const Vec3 half = turned_half_box(pose.turn(), 0.5 * (hi - lo)), middle = pose.to_world(0.5 * (lo + hi));
    if (!outside(middle - half, 0) && !outside(middle + half, 0)) return;
    bed_.solid.store().for_each_in_box(frame, lo, hi, [&](const Resident& g) {
      if (outside(bed_.solid.in_world(g), 0)) leaving.push_back(g.tag);
    });
  });
  for (const std::int64_t tag : leaving) exchange_.bring_back(tag);
  return leaving.size();
}

// ------------------------------------------------------------------------------------------------------------ into the store

/// Walls do not hinder it from going to the store: there are none, or they and its body stand still, and what they do to it is
/// known. What has no place presses on no wall: it stays.
bool ShellClosure::may_leave_its_walls(int i) const {
  const AtWall& wall = walls_[i];
  if (!wall.near) return true;
  if (bed_.scales.refills()) return false;
  const Locked& e = bed_.shell[i];
  return bed_.scales.sleeping() && !wall.moving_near && bed_.solid.stands(e.body) && e.came_back != bed_.run.step && !e.fresh &&
         !new_run_;
}

/// Engines list what a still mesh is near to for contacts only, not as far as a body may move until somebody looks: of these
/// atoms those stay whose body may move, and a mesh is within the skin of them.
void ShellClosure::leave_out_near_meshes(std::vector<int>& atoms) const {
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

bool ShellClosure::ask_to_store(const std::vector<int>& interface_atoms) {
  // but for those that something was near to the last time
  std::size_t may_go = 0;
  for (const int i : interface_atoms) may_go += may_leave_its_walls(i);
  const double gain = static_cast<double>(may_go) - static_cast<double>(stay_near_);
  store_asked_ = gain > std::max(worth_of_a_build * bed_.atoms.owned, least_worth);
  return store_asked_;
}

/// What an interface granule may have near it: exterior granules, shells and stored granules of other bodies, insertions.
class ShellClosure::Surroundings {
 public:
  explicit Surroundings(const ShellClosure& c) : c_(c), gap_(store_gap_in_skins * c.bed_.run.skin) {
    std::vector<Sphere> exterior, shells;
    const bool several = c.bed_.census.several_bodies();
    const auto sort_in = [&](const Foreign& f) {
      if (!f.body) {
        exterior.push_back(f.sphere);
      } else if (several) {
        shells.push_back(f.sphere);
        of_shell_.push_back(f);
      }
    };
    for (int i = 0; i < c.bed_.atoms.owned; ++i) sort_in(c.as_foreign(i));
    for (const Foreign& f : c.foreign_) sort_in(f);
    exterior_.build(std::move(exterior), 2 * c.bed_.scales.diameter());
    shells_.build(std::move(shells), 2 * c.bed_.scales.diameter());
    if (several) find_others();
    opened_ = c.opened(gap_);
  }
  bool near(int i) const { return near(i, c_.bed_.atoms.sphere(i)); }
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
    const SolidBodies& bodies = c_.bed_.solid.bodies();
    std::size_t most = 0;
    for (const auto& [number, body] : bodies.bodies())
      if (static_cast<std::size_t>(body.mass.count) > most)
        most = static_cast<std::size_t>(body.mass.count), largest_ = c_.bed_.groups.key_of(number);
    const GranuleStore& store = c_.bed_.solid.store();
    std::vector<Sphere> small;
    store.for_each_body([&](int body, const Vec3& lo, const Vec3& hi) {
      if (c_.bed_.groups.key_of(body) == largest_) return;
      const Pose& pose = bodies.pose(body);
      const Vec3 half = turned_half_box(pose.turn(), 0.5 * (hi - lo)) + Vec3::Constant(store.largest_radius());
      const Vec3 middle = pose.to_world(0.5 * (lo + hi));
      if (half.norm() < c_.bed_.scales.diameter())
        small.push_back({middle, half.norm()});  // it holds their spheres
      else
        others_.push_back({middle - half, middle + half});
    });
    small_others_.build(std::move(small), 2 * c_.bed_.scales.diameter());
  }
  bool is_open(const Vec3& x) const {
    return std::any_of(opened_.begin(), opened_.end(), [&](const Box& box) { return box.holds(x); });
  }
  bool near_another_body(int i, const Sphere& s) const {
    if (!c_.bed_.census.several_bodies()) return false;
    const Foreign self = c_.as_foreign(i);
    // bodies that both stand still may be as near as they like, but what they do to each other needs two atoms
    const auto touches = [&](const Sphere& other) {
      const double reach = c_.bed_.contacts.reach_factor * (s.radius + other.radius);
      return (c_.bed_.solid.nearest_image(other.centre, s.centre) - s.centre).squaredNorm() < reach * reach;
    };
    if (shells_.any_near(s, gap_, [&](std::size_t k) {
          const Foreign& other = of_shell_[k];
          return other.body != self.body && (!(self.stands && other.stands) || touches(other.sphere));
        }))
      return true;
    const double reach = s.radius + gap_;
    const bool images = c_.bed_.ranks.image_shifts().size() > 1;
    if (self.body == largest_ && !images && !small_others_.any_near(s, gap_) &&
        std::none_of(others_.begin(), others_.end(), [&](const Extent& e) {
          return (s.centre.array() > e.lo.array() - reach).all() && (s.centre.array() < e.hi.array() + reach).all();
        }))
      return false;
    bool near = false;
    c_.bed_.stored.for_each_near(
        s, gap_,
        [&](const Resident& g) {
          near = near || !(self.stands && c_.bed_.solid.stands(g.body)) || touches({c_.bed_.solid.in_world(g), g.radius});
        },
        [&](int body) { return self.body && c_.bed_.groups.key_of(body) == self.body; });
    return near;
  }

  const ShellClosure& c_;
  const double gap_;
  SphereCells exterior_, shells_;
  std::vector<Foreign> of_shell_;
  SphereCells small_others_;  // around bodies of few stored granules
  std::vector<Extent> others_;
  int largest_ = 0;
  std::vector<Box> opened_;
};

std::size_t ShellClosure::store_what_is_deep(bool locked_now, bool membership_changes) {
  const bool asked = bed_.ranks.any(locked_now || store_asked_);
  store_asked_ = false;
  if (!asked && (!bed_.scales.sleeping() || ++builds_without_storing_ < builds_between_storing)) return 0;
  builds_without_storing_ = 0;
  // the highest tag must stay an atom: new atoms are numbered from it
  std::int64_t highest = 0;
  for (int i = 0; i < bed_.atoms.owned; ++i) highest = std::max<std::int64_t>(highest, bed_.atoms.tag[i]);
  bed_.ranks.largest(&highest, 1);
  if (!locked_now && !bed_.scales.sleeping()) return 0;

  const Surroundings surroundings(*this);
  std::vector<int> deep;
  stay_near_ = 0;
  for (int i = bed_.atoms.owned - 1; i >= 0; --i) {
    if (!bed_.shell[i].locked || !may_leave_its_walls(i) || bed_.atoms.tag[i] == highest) continue;
    if (surroundings.near(i))
      ++stay_near_;
    else
      deep.push_back(i);
  }
  leave_out_near_meshes(deep);
  // where nothing else changes, a few wait for more
  if (!membership_changes && static_cast<double>(deep.size()) < store_share * bed_.atoms.owned) return 0;
  if (bed_.scales.refills()) return put_away_at_sites(deep, surroundings);
  bed_.solid.expects(deep.size());
  const int left = bed_.atoms.owned - static_cast<int>(deep.size());
  for (std::size_t k = 0; k < deep.size(); ++k) {
    exchange_.put_away(deep[k]);
    if ((k + 1) % rows_at_once == 0) bed_.memory.give_rows_back(left);
  }
  return deep.size();
}

/// Where no site will do they stay.
std::size_t ShellClosure::put_away_at_sites(const std::vector<int>& deep, const Surroundings& surroundings) {
  const double wall_gap = (wall_gap_in_skins + wall_check_in_skins) * bed_.run.skin;
  const SiteChoice choice(bed_, deep, wall_gap, [&](int i, const Sphere& there) {
    // where it would lie: through a periodic side others are near than beyond it
    const Sphere in_box{bed_.run.wrapped(there.centre), there.radius};
    return bed_.ranks.owns(in_box.centre) && !surroundings.near(i, in_box);
  });
  std::size_t went = 0;
  for (std::size_t k = 0; k < deep.size(); ++k)
    if (const auto site = choice.of(k)) {
      exchange_.relocate(deep[k], *site);
      exchange_.put_away(deep[k]);
      ++went;
    }
  return went;
}

void ShellClosure::release_memory() { release(foreign_); }

}  // namespace solidcull
