// Interface granules on their way from another rank.
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "flat_map.h"
#include "internal_error.h"
#include "solid.h"

namespace solidcull {

/// One that another rank has announced in this reneighbouring; the engine brings its atom.
struct Arrival {
  int body = 0;
  GranuleMass granule{0, Vec3::Zero(), 0};  ///< in the frame of the body
  int clump = 0;                            ///< that it is a sphere of
};

/// One that the engine does not have any more, and its body has still; in the frame of that.
struct LostGranule {
  std::int64_t tag;
  GranuleMass granule;
  int clump = 0;  ///< that it was a sphere of
};

/// Local.
class Arrivals {
 public:
  void announce(std::int64_t tag, const Arrival& a) { announced_[tag] = a; }
  const Arrival* find(std::int64_t tag) const { return announced_.find(tag); }
  /// It has come. InternalError for one that was not announced.
  Arrival take(std::int64_t tag) {
    const Arrival* a = announced_.find(tag);
    if (!a) throw InternalError("interface granule " + std::to_string(tag) + " came from another rank without its body");
    const Arrival taken = *a;
    announced_.erase(tag);
    return taken;
  }
  /// Those that have not come, by tag; none is announced afterwards.
  std::vector<LostGranule> take_missing() {
    std::vector<LostGranule> lost;
    announced_.for_each([&](std::int64_t tag, const Arrival& a) { lost.push_back({tag, a.granule, a.clump}); });
    std::sort(lost.begin(), lost.end(), [](const LostGranule& a, const LostGranule& b) { return a.tag < b.tag; });
    clear();
    return lost;
  }
  /// Bodies have merged: they will stand in the frames of those that they are part of now.
  void adopt_places(Solid& solid) {
    const SolidBodies& bodies = solid.bodies();
    FlatMap<Arrival> moved;
    announced_.for_each([&](std::int64_t tag, Arrival a) {
      const int body = bodies.body_of(tag);
      const Pose &from = bodies.pose(a.body), &to = bodies.pose(body);
      if (from != to) {
        a.granule.position = to.to_frame(from.to_world(a.granule.position));
        if (a.granule.clump) a.granule.clump = a.granule.clump->seen_from(from, to);
      }
      if (a.body != body) solid.tell_granule(body, {a.granule.position, a.granule.radius});
      a.body = body;
      moved[tag] = a;
    });
    announced_ = std::move(moved);
  }
  void clear() { announced_.clear(); }

 private:
  FlatMap<Arrival> announced_;
};

}  // namespace solidcull
