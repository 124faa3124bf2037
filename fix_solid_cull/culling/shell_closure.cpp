#include "shell_closure.h"

#include <algorithm>
#include <cmath>

#include "release.h"

namespace solidcull {
namespace {

// the farthest that an exterior granule may go before it is looked at again, in skins: it may have gone as far the other way when
// the last went to the store, so twice this and one skin is the gap
constexpr double clear_way_in_skins = 0.75;
// so many moving frames are compared with a granule one by one, more as one box
constexpr std::size_t few_frames = 8;

}  // namespace

void ShellClosure::merged(int gone, int kept, bool same_frame) {
  seen_walls_.erase(gone);
  if (!same_frame) seen_walls_.erase(kept);
}

ShellClosure::Foreign ShellClosure::as_foreign(int i) const {
  const Locked& e = bed_.shell[i];
  const bool in_body = e.in_body();  // else it has just been chosen
  return {bed_.atoms.sphere(i), in_body ? bed_.groups.key_of(e.body) : 0, in_body && bed_.solid.stands_in_store(e.body)};
}

void ShellClosure::share() {
  foreign_.clear();
  if (!bed_.ranks.has_neighbours()) return;
  struct Row {
    Triple at;
    double radius;
    BodyGroups::Key body;
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
  struct Row {
    Triple at;
    double radius;
    std::int64_t tag;
  };
  const Atoms& atoms = bed_.atoms;
  std::vector<Row> rows;
  for (int i = 0; some_made_ && i < atoms.owned; ++i)
    if (rows_[i].version == Cleared::made) rows.push_back({triple(atoms.place(i)), atoms.radius[i], atoms.tag[i]});
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
  std::int64_t agreed[2] = {found.in_stored, !found.places.empty()};
  bed_.ranks.largest(agreed, 2);
  found.in_stored = agreed[0];
  found.some = agreed[1] != 0;
  return found;
}

void ShellClosure::forget_new() {
  if (!some_made_) return;
  some_made_ = false;
  for (int i = 0; i < bed_.atoms.owned; ++i)
    if (rows_[i].version == Cleared::made) rows_[i].version = Cleared::never;
}

/// Since it was last looked at it has moved less than would bring it near to what was stored then, in frames that stand, and only
/// what is farther than store_gap_in_skins from all exterior granules went to the store.
bool ShellClosure::is_clear(int i) const {
  const Cleared& row = rows_[i];
  const double way = row.way;
  return row.version == bed_.solid.standing_version() && (bed_.atoms.place(i) - row.at).squaredNorm() < way * way;
}

// ------------------------------------------------------------------------------------------------- what comes near stored
// granules

struct ShellClosure::Frame {
  int number;
  BodyGroups::Key key;
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
  const double gap = store_gap_in_skins * bed_.run.skin;
  const auto comes = [&](const Visitor& v) {
    if (!(v.who.stands || v.clear) || frames.near_moving(v.who.sphere)) visitors.push_back(v);
  };
  for (const Foreign& f : foreign_)
    if (!frames.far_from_all(f.sphere.centre, f.sphere.radius)) comes({f, -1, false, gap});
  for (int i = 0; i < bed_.atoms.owned; ++i) {
    const bool locked = bed_.shell[i].locked, clear = !locked && is_clear(i);
    if ((locked && !bed_.census.several_bodies()) || (clear && frames.none_moves()) ||
        frames.far_from_all(bed_.atoms.place(i), bed_.atoms.radius[i]))
      continue;
    comes({as_foreign(i), locked ? -1 : i, clear, gap});
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
          const double between = (g.position - at).norm() - s.radius - g.radius;
          if (between < skin)
            near.insert(g.tag);
          else if (f.stands)
            v.nearest = std::min(v.nearest, between);
        });
        return true;
      });
  }
  for (const Visitor& v : all)
    if (v.atom >= 0 && !v.clear)
      rows_[v.atom] = {bed_.solid.standing_version(), static_cast<float>(std::min(clear_way_in_skins * skin, v.nearest - skin)),
                       v.who.sphere.centre};
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
  return fetch({near.begin(), near.end()});
}

/// With the other spheres of their clumps.
std::size_t ShellClosure::fetch(std::vector<std::int64_t> tags) {
  if (bed_.clumps.possible) bed_.solid.add_rest_of_clumps(tags);
  for (const std::int64_t tag : tags) exchange_.bring_back(tag);
  if (bed_.clumps.possible) exchange_.join_images(tags);
  return tags.size();
}

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
  return fetch(std::move(leaving));
}

void ShellClosure::release_memory() { release(foreign_); }

}  // namespace solidcull
