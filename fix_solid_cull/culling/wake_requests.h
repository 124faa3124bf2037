// Who asked to wake since the last reneighbouring (theory.md#carve).
#pragma once

#include <algorithm>
#include <cstddef>
#include <set>
#include <utility>
#include <vector>

#include "awake.h"
#include "ports.h"
#include "sphere_cells.h"
#include "wake_up.h"

namespace solidcull {

/// What a waking granule carves out of its body (m, world frame).
struct Ball {
  Vec3 centre;
  double radius;
  Woke by = Woke::load;

  bool holds(const Vec3& x, double margin) const {
    const double reach = radius + margin;
    return (x - centre).squaredNorm() <= reach * reach;
  }
};

/// All that wakes in one reneighbouring, on this rank.
struct Wakes {
  Woke all = Woke::never;   ///< all that is culled wakes, by this
  std::vector<Ball> balls;  ///< of all ranks, and their periodic images, that reach what this one may hold
  std::size_t carves = 0;   ///< that were asked for here
  std::set<int> bodies;     ///< of this rank, that wake as a whole

  bool wakes_all() const { return all != Woke::never; }
  bool none() const { return !wakes_all() && balls.empty() && bodies.empty(); }
  /// What wakes this place, in a body or not; `never`: nothing does.
  Woke in_balls(const Vec3& x) const {
    const auto ball = std::find_if(balls.begin(), balls.end(), [&](const Ball& b) { return b.holds(x, 0); });
    return ball == balls.end() ? Woke::never : ball->by;
  }
  bool in_ball(const Vec3& x, double margin) const {
    return std::any_of(balls.begin(), balls.end(), [&](const Ball& b) { return b.holds(x, margin); });
  }
  bool wakes_body(int body) const { return bodies.count(body) != 0; }
};

/// Collects on this rank; take() gives what concerns this one of all that ranks have collected, and is empty afterwards.
class WakeRequests {
 public:
  /// Where many ask by their loads beside each other, their balls are those of a front.
  void ask(const Vec3& centre, double radius, Woke by) { asked_.push_back({triple(centre), radius, by}); }
  /// It is shaken as a whole.
  void ask_body(int body) { bodies_.insert(body); }
  void ask_all(Woke by) { all_ = by; }
  /// The deck wants what is at these places. A ball around each, as large as in a front: what touches it wakes too. Where these
  /// are a large share of the granules that are locked, `locked` on this rank, or would take long to compare with them, all
  /// wakes. Collective.
  void ask_many(const Ranks& ranks, const std::vector<Vec3>& places, const WakeUpLaw& law, std::size_t locked) {
    constexpr double most = 0.25;             // of all that is locked
    constexpr double most_comparisons = 2e8;  // of granules that wake with granules that may
    std::int64_t counts[2] = {static_cast<std::int64_t>(places.size()), static_cast<std::int64_t>(locked)};
    ranks.sum(counts, 2);
    const double asking = static_cast<double>(counts[0]), all = static_cast<double>(counts[1]);
    if (asking > most * all || asking * all > most_comparisons) {
      if (asking > 0) ask_all(Woke::deck);
    } else {
      for (const Vec3& place : places) ask(place, law.radius(1) * law.front_growth(), Woke::deck);
    }
  }

  bool any_here() const { return !asked_.empty() || !bodies_.empty(); }  ///< but for ask_all()
  Woke asks_all() const { return all_; }                                 ///< `never`: it was not asked
  bool asks_body(int body) const { return bodies_.count(body) != 0; }

  /// all: what some rank has asked all for; margin: how far from its subdomain what a rank holds may be, and more where it asks
  /// whether something is near a ball (m). Parts of a body that spans ranks are to be asked for on each of them. Collective.
  Wakes take(const Ranks& ranks, const WakeUpLaw& law, Woke all, double margin) {
    Wakes w;
    w.all = all;
    w.carves = asked_.size();
    w.bodies = std::exchange(bodies_, {});
    all_ = Woke::never;
    const double growth = law.front_growth();
    if (growth > 1) {
      const std::vector<Asked> others = ranks.exchange(asked_, law.front_reach() + margin);
      const Fronts fronts(asked_, others, law.front_reach());
      for (Asked& a : asked_)
        if (a.by == Woke::load && fronts.hold(vec(a.at))) a.radius *= growth;
    }
    const auto add = [&](const Asked& a) { w.balls.push_back({vec(a.at), a.radius, a.by}); };
    for (const Asked& a : asked_) add(a);
    for (const Asked& a : ranks.exchange(asked_, law.largest_radius() + margin)) add(a);
    asked_.clear();
    return w;
  }

 private:
  struct Asked {
    Triple at;
    double radius;
    Woke by;
  };
  /// Where many wake beside each other by their loads.
  class Fronts {
   public:
    Fronts(const std::vector<Asked>& own, const std::vector<Asked>& others, double reach) : reach_(reach) {
      std::vector<Sphere> places;
      for (const auto* some : {&own, &others})
        for (const Asked& a : *some)
          if (a.by == Woke::load) places.push_back({vec(a.at), 0});
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
  std::set<int> bodies_;  // of this rank
  Woke all_ = Woke::never;
};

}  // namespace solidcull
