// Who asked to wake since the last reneighbouring (DESIGN section 8).
#pragma once

#include <algorithm>
#include <cstddef>
#include <set>
#include <vector>

#include "ports.h"

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
  void ask(const Vec3& centre, double radius) { balls_.push_back({centre, radius}); }
  void ask_body(int key) { bodies_.insert(key); }
  void ask_all() { all_ = true; }
  /// A ball around each place. Where these are a large share of the granules that are locked, `locked` on this rank, or would
  /// take long to compare with them, all wakes. Collective.
  void ask_many(const Ranks& ranks, const std::vector<Vec3>& places, double radius, std::size_t locked) {
    constexpr double most = 0.25;             // of all that is locked
    constexpr double most_comparisons = 2e8;  // of granules that wake with granules that may
    std::int64_t counts[2] = {static_cast<std::int64_t>(places.size()), static_cast<std::int64_t>(locked)};
    ranks.sum(counts, 2);
    const double asking = static_cast<double>(counts[0]), all = static_cast<double>(counts[1]);
    if (asking > most * all || asking * all > most_comparisons) {
      if (asking > 0) ask_all();
    } else {
      for (const Vec3& place : places) ask(place, radius);
    }
  }

  bool any_here() const { return !balls_.empty() || !bodies_.empty(); }  ///< but for ask_all()
  bool any_at_all() const { return any_here() || all_; }
  bool asks_body(int key) const { return bodies_.count(key) != 0; }

  /// Collective.
  Wakes take(const Ranks& ranks) {
    struct Row {
      Triple centre;
      double radius;
    };
    std::vector<Row> rows;
    for (const Ball& b : balls_) rows.push_back({triple(b.centre), b.radius});
    balls_.clear();
    Wakes w;
    for (const Row& r : ranks.gather(rows)) {
      ++w.carves;
      for (const Vec3& shift : ranks.image_shifts()) w.balls.push_back({vec(r.centre) + shift, r.radius});
    }
    w.bodies = ranks.gather(std::vector<int>(bodies_.begin(), bodies_.end()));
    bodies_.clear();
    w.all = ranks.any(all_);
    all_ = false;
    return w;
  }

 private:
  std::vector<Ball> balls_;
  std::set<int> bodies_;  // keys
  bool all_ = false;
};

}  // namespace solidcull
