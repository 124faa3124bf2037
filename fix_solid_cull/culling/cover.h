// The cover (`exterior live`): how deep a granule lies below the bed's outer surface (theory.md#which-granules-are-culled).
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <vector>

#include "bed.h"
#include "body_motion.h"
#include "flat_map.h"
#include "implicit_surface.h"
#include "per_granule.h"
#include "sphere_cells.h"
#include "store_exchange.h"

namespace solidcull {

/// Where the implicit surface has an atom.
struct Drawn {
  bool drawn = false;
  Vec3 at = Vec3::Zero();  ///< the observer's frame (m)
  Voxel nearest_void = Voxel::nothing();

  static constexpr int packed_size = 4;
  void pack(double* to) const {
    to[0] = drawn;
    set(to + 1, at);
  }
  static Drawn unpack(const double* v) {
    Drawn d;
    d.drawn = v[0] != 0;
    d.at = vec(v + 1);
    return d;
  }
};

/// The surface is drawn in the frame of an observer who rides on the largest body, so that a mass that falls or turns as one
/// leaves it as it is. Walls are no surface: plugs behind them close it. m.
class Cover : public BodyFollower, public StoreFollower {
 public:
  Cover(const Bed& bed, const BodyMotion& motion) : bed_(bed), motion_(motion) {}

  PerGranule<Drawn>& rows() { return rows_; }
  /// The surface does not care who holds a granule: it has come out of the store.
  void came_back(int i, const StoredGranule&, const Vec3& x) override {
    rows_[i] = {true, observer_.to_frame(x), Voxel::nothing()};
  }
  /// Out of a restart file: the surface is drawn anew.
  void forget(int i) { rows_[i].drawn = false; }

  /// A run begins; `a_wall_has_gone`: it leaves nothing behind that would close the surface. Local.
  void begin_run(bool a_wall_has_gone);
  /// Plugs behind walls: behind still ones they stay, for the place behind a wall is no void whoever stands before it; behind one
  /// that moves they are where granules stand at it now that are locked or rest(i). Local.
  void close_behind_walls(const std::vector<WallContact>& contacts, const std::function<bool(int)>& rests);

  // --- a look
  /// Draws what has changed. Collective.
  void draw();
  /// Whether owned exterior granule i lies deeper than the cover. Local.
  bool is_deep(int i);
  /// Asks for interface granules to wake that have lost too much of their cover. Local.
  void wake_exposed();

  std::size_t plugs() const { return plugs_.size() + moving_plugs_.size(); }
  const Pose& observer() const { return observer_; }
  const Pose& observed_then() const { return observed_then_; }
  void set_observer(const Pose& observer, const Pose& observed_then) {
    observer_ = observer;
    observed_then_ = observed_then;
  }

  void merged(int gone, int kept, bool same_frame) override;
  void frame_changed(int body) override { drawn_bodies_.erase(body); }

  void release_memory();

 private:
  void make_surface();
  void gather(const Vec3& lo, const Vec3& hi, const std::function<void(const Sphere&)>& visit) const;
  void follow_largest_body();
  void draw_atoms(double moved, std::vector<Sphere>& spheres);
  void draw_bodies(double moved);
  void draw_neighbours(std::vector<Sphere>& spheres);
  double plug_radius() const;
  void plug(const WallContact& c, const Vec3& at, const Vec3& outward, FlatMap<Sphere>& moving);
  void plug_changes(const Sphere& plug);
  void share_plugs();
  std::int64_t atoms_and_stored(bool drawn_only) const;

  /// Something to be drawn by neighbours, and where it was drawn until now, from there.
  struct Row {
    Triple at;
    double radius;
    Triple step;
  };

  const Bed& bed_;
  const BodyMotion& motion_;

  PerGranule<Drawn> rows_;
  std::unique_ptr<ImplicitSurface> surface_;
  SphereCells around_;                       // owned granules and halo at the last look; the observer's frame
  std::vector<Row> to_neighbours_;           // in this look
  std::vector<Sphere> plugs_;                // behind still walls; world frame
  FlatMap<char> plugged_;                    // places that have one
  FlatMap<Sphere> moving_plugs_;             // behind walls that can move, as seen at the last look; the observer's frame
  std::vector<Sphere> changed_plugs_;        // in this look, to be told to neighbours; world frame
  std::vector<Sphere> plugs_of_neighbours_;  // near this rank at the last look; world frame
  SphereCells plug_cells_;                   // all plugs; the observer's frame
  bool plugs_changed_ = false;
  bool neighbours_drawn_ = false;
  std::int64_t drawn_at_last_look_ = 0;  // atoms and stored granules, over all ranks
  std::map<int, Pose> drawn_bodies_;     // where bodies with stored granules were when they were drawn
  Pose observer_;
  int observed_ = 0;    // the body on which the observer rides
  Pose observed_then_;  // where it was when the observer last followed
};

}  // namespace solidcull
