// Who asked to wake since the last reneighbouring (theory.md#carve).
#pragma once

#include <algorithm>
#include <cstddef>
#include <set>
#include <vector>

#include "ports.h"
#include "sphere_cells.h"
#include "wake_up.h"

namespace solidcull {

/// What a waking granule carves out of its body (m, world frame).
struct Ball {
  Vec3 centre;
  double radius;

  bool holds(const Vec3& x, double margin) const {
    const double reach = radius + margin;
    return (x - centre).squaredNorm() <= reach * reach;
  }
};

/// All that wakes in one reneighbouring.
struct Wakes {
  bool all = false;
  std::vector<Ball> balls;  ///< of all ranks, with their periodic images
  std::size_t carves = 0;   ///< balls without their images
  std::vector<int> bodies;  ///< that wake as a whole, by key, of all ranks

  bool none() const { return !all && balls.empty() && bodies.empty(); }
  bool in_ball(const Vec3& x, double margin) const {
    return std::any_of(balls.begin(), balls.end(), [&](const Ball& b) { return b.holds(x, margin); });
  }
  bool wakes_body(int key) const { return std::find(bodies.begin(), bodies.end(), key) != bodies.end(); }
};

/// Collects on this rank; take() gives what all ranks collected, and is empty afterwards.
class WakeRequests {
 public:
  void ask(const Vec3& centre, double radius) { asked_.push_back({triple(centre), radius, false}); }
  /// Its load has changed: where many ask so beside each other, their balls are those of a front.
  void ask_by_load(const Vec3& centre, double radius) { asked_.push_back({triple(centre), radius, true}); }
  void ask_body(int key) { bodies_.insert(key); }
  void ask_all() { all_ = true; }
  /// A ball around each place, as large as in a front: what touches it wakes too. Where these are a large share of the granules
  /// that are locked, `locked` on this rank, or would take long to compare with them, all wakes. Collective.
  void ask_many(const Ranks& ranks, const std::vector<Vec3>& places, const WakeUpLaw& law, std::size_t locked) {
    constexpr double most = 0.25;             // of all that is locked
    constexpr double most_comparisons = 2e8;  // of granules that wake with granules that may
    std::int64_t counts[2] = {static_cast<std::int64_t>(places.size()), static_cast<std::int64_t>(locked)};
    ranks.sum(counts, 2);
    const double asking = static_cast<double>(counts[0]), all = static_cast<double>(counts[1]);
    if (asking > most * all || asking * all > most_comparisons) {
      if (asking > 0) ask_all();
    } else {
      for (const Vec3& place : places) ask(place, law.radius(1) * law.front_growth());
    }
  }

  bool any_here() const { return !asked_.empty() || !bodies_.empty(); }  ///< but for ask_all()
  bool any_at_all() const { return any_here() || all_; }
  bool asks_body(int key) const { return bodies_.count(key) != 0; }

  /// Collective.
  Wakes take(const Ranks& ranks, const WakeUpLaw& law) {
    Wakes w;
    const std::vector<Asked> all = ranks.gather(asked_);
    asked_.clear();
    w.carves = all.size();
    const std::vector<Vec3>& shifts = ranks.image_shifts();
    const double growth = law.front_growth();
    const Fronts fronts(growth > 1 ? all : std::vector<Asked>(), shifts, law.front_reach());
    for (const Asked& a : all) {
      const double radius = a.by_load && fronts.hold(vec(a.centre)) ? growth * a.radius : a.radius;
      for (const Vec3& shift : shifts) w.balls.push_back({vec(a.centre) + shift, radius});
    }
    w.bodies = ranks.gather(std::vector<int>(bodies_.begin(), bodies_.end()));
    bodies_.clear();
    w.all = ranks.any(all_);
    all_ = false;
    return w;
  }

 private:
  struct Asked {
    Triple centre;
    double radius;
    bool by_load;
  };
  /// Where many wake beside each other by their loads.
  class Fronts {
   public:
    Fronts(const std::vector<Asked>& all, const std::vector<Vec3>& shifts, double reach) : reach_(reach) {
      std::vector<Sphere> places;
      for (const Asked& a : all)
        if (a.by_load)
          for (const Vec3& shift : shifts) places.push_back({vec(a.centre) + shift, 0});
      places_.build(std::move(places), reach_);
    }
    bool hold(const Vec3& x) const {
      int near = -1;  // itself
      const Vec3 reach = Vec3::Constant(reach_);
      return !places_.for_each_in_box(x - reach, x + reach, [&](std::size_t, const Sphere& other) {
        if ((other.centre - x).squaredNorm() < reach_ * reach_) ++near;
        return near < WakeUpLaw::front_size;
      });
    }

   private:
    double reach_;
    SphereCells places_;
  };

  std::vector<Asked> asked_;
  std::set<int> bodies_;  // keys
  bool all_ = false;
};

}  // namespace solidcull
