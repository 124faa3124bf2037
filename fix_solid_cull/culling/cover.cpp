#include "cover.h"

#include <cmath>

#include "release.h"

namespace solidcull {
namespace {

// an interface granule is exposed when this much of its cover (in mean diameters) is gone: less would cull and wake in turns
constexpr double cover_slack = 0.5;
// a granule that moved by less than this share of a voxel since it was last drawn leaves the implicit surface as it is
constexpr double drawn_share = 0.25;
// a wall closer than this share of a granule's radius closes the implicit surface behind itself
constexpr double wall_closes = 0.2;

}  // namespace

void Cover::make_surface() {
  if (surface_) return;
  surface_ = std::make_unique<ImplicitSurface>(
      bed_.scales.voxel(), bed_.scales.closing(),
      [this](const Vec3& lo, const Vec3& hi, const std::function<void(const Sphere&)>& visit) { gather(lo, hi, visit); });
}

/// All spheres that may overlap the box, which is the observer's.
void Cover::gather(const Vec3& lo, const Vec3& hi, const std::function<void(const Sphere&)>& visit) const {
  for (const SphereCells* cells : {&around_, &plug_cells_}) {
    const Vec3 reach = Vec3::Constant(cells->largest_radius() + bed_.scales.closing());
    cells->for_each_in_box(lo - reach, hi + reach, [&](std::size_t, const Sphere& s) {
      visit(s);
      return true;
    });
  }
  const Vec3 middle = observer_.to_world(0.5 * (lo + hi));
  const Vec3 half = turned_half_box(
      observer_.turn(), 0.5 * (hi - lo) + Vec3::Constant(bed_.solid.store().largest_radius() + bed_.scales.closing()));
  bed_.stored.for_each_in_box(middle - half, middle + half, [&](const Resident& g) {
    visit({observer_.to_frame(bed_.solid.nearest_image(bed_.solid.in_world(g), middle)), g.radius});
  });
}

void Cover::merged(int gone, int kept, bool same_frame) {
  drawn_bodies_.erase(gone);
  if (!same_frame) drawn_bodies_.erase(kept);
  if (observed_ == gone) observed_ = 0;
}

// ------------------------------------------------------------------------------------------------------------ walls

void Cover::begin_run(bool a_wall_has_gone) {
  if (!a_wall_has_gone) return;
  plugs_.clear();
  plugged_.clear();
  plugs_changed_ = true;
  if (surface_) surface_->touch_all();
}

double Cover::plug_radius() const { return 0.5 * (bed_.scales.depth() + bed_.scales.closing()) + bed_.scales.diameter(); }

void Cover::plug(const WallContact& c, const Vec3& at, const Vec3& outward, FlatMap<Sphere>& moving) {
  const double radius = plug_radius();
  constexpr int bits = 19;  // of a place along an axis; what is 2^18 diameters away may have the same
  const auto grid = [&](double x) {
    const auto cell = static_cast<std::int64_t>(std::floor(x / (0.5 * bed_.scales.diameter())));
    return static_cast<std::uint64_t>(cell) & ((std::uint64_t{1} << bits) - 1);
  };
  // a thin plate has one on either side
  std::uint64_t side = 0;
  for (int d = 0; d < 3; ++d) side = 3 * side + (outward[d] > 0.5 ? 1 : outward[d] < -0.5 ? 2 : 0);
  const std::int64_t place = static_cast<std::int64_t>(((grid(at[0]) << bits | grid(at[1])) << bits | grid(at[2])) << 5 | side);
  const Sphere plug{at + radius * outward, radius};
  if (c.moving) {
    const Sphere* before = moving_plugs_.find(place);
    moving[place] = before ? *before : plug;
    if (before) return;
    plug_changes(plug);
  } else {
    char& known = plugged_[place];
    if (known) return;
    known = 1;
    plugs_.push_back(plug);
    plug_changes({observer_.to_frame(plug.centre), plug.radius});
  }
}

/// It is there now, or no more; the observer's frame.
void Cover::plug_changes(const Sphere& plug) {
  plugs_changed_ = true;
  surface_->touch(plug);
  if (bed_.ranks.has_neighbours()) changed_plugs_.push_back({observer_.to_world(plug.centre), plug.radius});
}

void Cover::close_behind_walls(const std::vector<WallContact>& contacts, const std::function<bool(int)>& rests) {
  make_surface();
  FlatMap<Sphere> moving;
  for (const WallContact& c : contacts) {
    const int i = c.granule;
    if (c.gap > wall_closes * bed_.atoms.radius[i]) continue;
    if (c.moving && !bed_.shell[i].locked && !rests(i)) continue;
    const double distance = c.to_wall.norm();
    if (distance == 0) continue;
    Vec3 at = bed_.atoms.place(i) + c.to_wall, outward = c.to_wall / distance;
    if (c.moving) {
      at = observer_.to_frame(at);
      outward = observer_.turned_to_frame(outward);
    }
    plug(c, at, outward, moving);
  }
  moving_plugs_.for_each([&](std::int64_t place, const Sphere& plug) {
    if (!moving.contains(place)) plug_changes(plug);
  });
  moving_plugs_ = std::move(moving);
}

// ------------------------------------------------------------------------------------------------------------ drawing

void Cover::follow_largest_body() {
  if (bed_.run.any_periodic()) return;
  const GranuleStore& store = bed_.solid.store();
  int largest = 0;
  std::int64_t count = 0;
  store.for_each_body([&](int body, const Vec3&, const Vec3&) {
    const std::int64_t n = bed_.solid.bodies().body(body).mass.count;
    if (body == observed_) largest = body, count = 2 * n;  // it stays until another one is twice as large
    if (n > count) largest = body, count = n;
  });
  if (!largest) {
    observed_ = 0;
    return;
  }
  if (largest != observed_) {
    observed_ = largest;
    observed_then_ = bed_.solid.bodies().pose(largest);
    return;
  }
  const Pose& now = bed_.solid.bodies().pose(observed_);
  double way = 0;
  store.for_each_body([&](int body, const Vec3& lo, const Vec3& hi) {
    if (body == observed_) way = largest_way(observed_then_, now, lo, hi);
  });
  if (way <= drawn_share * bed_.scales.voxel()) return;
  const Pose before = observer_;
  const Eigen::Quaterniond turn = now.quaternion() * observed_then_.quaternion().conjugate();
  observer_ =
      Pose(now.origin() + turn * (observer_.origin() - observed_then_.origin()), (turn * observer_.quaternion()).normalized());
  observed_then_ = now;
  if (bed_.ranks.has_neighbours()) surface_->touch_all();
  for (const Sphere& plug : plugs_)
    for (const Pose* pose : {&before, const_cast<const Pose*>(&observer_)})
      surface_->touch({pose->to_frame(plug.centre), plug.radius});
  plugs_changed_ = plugs_changed_ || !plugs_.empty() || !plugs_of_neighbours_.empty();
}

/// Over all ranks.
std::int64_t Cover::atoms_and_stored(bool drawn_only) const {
  std::int64_t n = static_cast<std::int64_t>(bed_.solid.store().size());
  for (int i = 0; i < bed_.atoms.owned; ++i) n += !drawn_only || rows_[i].drawn;
  bed_.ranks.sum(&n, 1);
  return n;
}

void Cover::draw_atoms(double moved, std::vector<Sphere>& spheres) {
  const bool shared = bed_.ranks.has_neighbours();
  for (int i = 0; i < bed_.atoms.owned; ++i) {
    Drawn& d = rows_[i];
    const Vec3 x = bed_.atoms.place(i);
    const Sphere s{observer_.to_frame(x), bed_.atoms.radius[i]};
    spheres.push_back(s);
    Vec3 from = x;
    if (!d.drawn || (s.centre - d.at).squaredNorm() > moved * moved) {
      if (d.drawn) surface_->touch({d.at, s.radius});
      surface_->touch(s);
      from = d.drawn ? observer_.to_world(d.at) : Vec3(x + Vec3::Constant(bed_.scales.diameter()));
      d.drawn = true;
      d.at = s.centre;
    }
    if (shared) to_neighbours_.push_back({triple(x), s.radius, triple(from - x)});
  }
}

/// Interior granules of bodies that move against the observer.
void Cover::draw_bodies(double moved) {
  bed_.solid.store().for_each_body([&](int body, const Vec3& lo, const Vec3& hi) {
    const Pose& pose = bed_.solid.bodies().pose(body);
    const Eigen::Quaterniond back = observer_.quaternion().conjugate();
    const Pose seen(observer_.to_frame(pose.origin()), back * pose.quaternion());
    const auto then = drawn_bodies_.find(body);
    if (then == drawn_bodies_.end()) {
      drawn_bodies_[body] = seen;
      return;
    }
    if (largest_way(then->second, seen, lo, hi) <= moved) return;
    bed_.solid.store().for_each_in_box(body, lo, hi, [&](const Resident& g) {
      surface_->touch({then->second.to_world(g.position), g.radius});
      surface_->touch({seen.to_world(g.position), g.radius});
    });
    then->second = seen;
  });
}

/// What other ranks and periodic images have near this rank, and the other way.
void Cover::draw_neighbours(std::vector<Sphere>& spheres) {
  if (!bed_.ranks.has_neighbours()) return;
  bed_.solid.store().for_each([&](const Resident& g) {
    to_neighbours_.push_back({triple(bed_.solid.in_world(g)), g.radius, triple(Vec3::Zero())});
  });
  // how far a granule can change another one's depth
  const double reach = bed_.scales.depth() + 2 * bed_.scales.closing() + 0.5 * contact_reach(bed_);
  for (const Row& r : bed_.ranks.exchange(to_neighbours_, reach)) {
    const Sphere s{observer_.to_frame(vec(r.at)), r.radius};
    const Vec3 step = observer_.turned_to_frame(vec(r.step));
    spheres.push_back(s);
    if (step.isZero(0) && neighbours_drawn_) continue;
    surface_->touch({s.centre + step, s.radius});
    surface_->touch(s);
  }
  to_neighbours_.clear();
  neighbours_drawn_ = true;
}

/// The place behind a wall is no void for those beyond a border either.
void Cover::share_plugs() {
  if (!bed_.ranks.has_neighbours()) return;
  struct PlugRow {
    Triple at;
    double radius;
    bool stays;
  };
  std::vector<PlugRow> rows;
  for (const Sphere& p : changed_plugs_) rows.push_back({triple(p.centre), p.radius, false});
  for (const Sphere& p : plugs_) rows.push_back({triple(p.centre), p.radius, true});
  moving_plugs_.for_each([&](std::int64_t, const Sphere& p) {
    rows.push_back({triple(observer_.to_world(p.centre)), p.radius, true});
  });
  changed_plugs_.clear();
  const std::size_t before = plugs_of_neighbours_.size();
  plugs_of_neighbours_.clear();
  for (const PlugRow& r : bed_.ranks.exchange(rows, bed_.scales.depth() + 2 * bed_.scales.closing() + plug_radius())) {
    if (r.stays) {
      plugs_of_neighbours_.push_back({vec(r.at), r.radius});
    } else {
      surface_->touch({observer_.to_frame(vec(r.at)), r.radius});
      plugs_changed_ = true;
    }
  }
  plugs_changed_ = plugs_changed_ || plugs_of_neighbours_.size() != before;
}

void Cover::draw() {
  make_surface();
  follow_largest_body();
  const double moved = drawn_share * bed_.scales.voxel();
  // a granule that was drawn and is neither an atom nor stored any more has left the simulation
  if (atoms_and_stored(true) < drawn_at_last_look_) surface_->touch_all();
  std::vector<Sphere> spheres;
  draw_atoms(moved, spheres);
  draw_bodies(moved);
  draw_neighbours(spheres);
  share_plugs();
  drawn_at_last_look_ = atoms_and_stored(false);
  around_.build(std::move(spheres), 2 * bed_.scales.diameter());
  if (!plugs_changed_) return;
  std::vector<Sphere> plugs;
  for (const std::vector<Sphere>* some : {&plugs_, &plugs_of_neighbours_})
    for (const Sphere& p : *some) plugs.push_back({observer_.to_frame(p.centre), p.radius});
  moving_plugs_.for_each([&](std::int64_t, const Sphere& p) { plugs.push_back(p); });
  plug_cells_.build(std::move(plugs), 4 * bed_.scales.diameter());
  plugs_changed_ = false;
}

// ------------------------------------------------------------------------------------------------------------ questions

bool Cover::is_deep(int i) {
  Drawn& d = rows_[i];
  d.nearest_void = surface_->void_within(observer_.to_frame(bed_.atoms.place(i)), bed_.scales.depth(), d.nearest_void);
  return d.nearest_void.none();
}

void Cover::wake_exposed() {
  const double depth =
      (bed_.scales.settings().depth - std::min(cover_slack, 0.5 * bed_.scales.settings().depth)) * bed_.scales.diameter();
  for (const int i : motion_.interface_atoms()) {
    Drawn& d = rows_[i];
    const Vec3 x = observer_.to_frame(bed_.atoms.place(i));
    if (!surface_->touched_near(x, depth + bed_.scales.closing())) continue;
    d.nearest_void = surface_->void_within(x, depth, d.nearest_void);
    if (!d.nearest_void.none()) bed_.wake.ask(bed_.atoms.place(i), 0.5 * bed_.atoms.radius[i], Woke::exposed);
  }
  surface_->clear_touched();
}

void Cover::release_memory() { release(around_); }

}  // namespace solidcull
