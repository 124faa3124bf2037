// When to look, when culling waits, and when it is given up for a while (theory.md#pacing; invariant I7).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "culling_benefit.h"
#include "scales.h"

namespace solidcull {

/// How many looks a granule must be calm for, and how much motion is rest: in the first looks of a run less of both.
struct Patience {
  bool quick;                ///< one of the quick looks at the start of a run
  int looks;                 ///< in a row; 1: this one decides alone
  double speed_divisor;      ///< of the solid-state speed: over a shorter time less motion tells it from rest
  double force_divisor = 1;  ///< likewise of the out-of-balance force

  bool at_once() const { return looks == 1 && quick; }
};

/// What was counted between two looks, over all ranks.
struct Work {
  std::int64_t interface_granules, interior_granules, atoms;
  std::int64_t restored;  ///< since the last look at which culling was judged
  std::int64_t chosen;    ///< to be culled by this look
  std::int64_t exterior;
  bool surface_drawn = false;  ///< at this look
};

/// Pure and local: it is told everything, and all ranks are told the same.
class Pacing {
 public:
  explicit Pacing(const Scales& scales) : scales_(scales) {}

  /// A run begins at this step, with something culled or not.
  void begin_run(std::int64_t step, bool something_locked) {
    next_look_ = ((step - 1) / every() + 1) * every();
    looks_at_once_ = !something_locked && !scales_.settings().every;
    if (looks_at_once_) {
      quick_looks_ = scales_.settings().calm;
      if (last_look_ >= step) last_look_ = INT32_MIN;  // time was set back
      next_look_ = std::max(step, last_look_ + quick_interval());
    }
    no_cull_until_ = -1;
    benefit_ = CullingBenefit();
    told_no_benefit_ = false;
  }
  /// What the last look chose was dropped. A deck whose runs end with a look each would never cull: this run looks earlier.
  void look_earlier(std::int64_t step) { next_look_ = std::min(next_look_, step + every() / 2); }
  /// The scales were found in the middle of a run: the first look is one interval away.
  void begin_within_run(std::int64_t step) { next_look_ = step + every(); }

  /// Steps after which granules that wake are handled together, and whether this step is one of them. Looks are among these
  /// steps: one rebuild of the neighbour lists does for what wakes and what is culled.
  int wake_period() const { return (wake_cycle() + wakes_in_a_cycle() - 1) / wakes_in_a_cycle(); }
  bool wakes_now(std::int64_t step) const { return step % wake_cycle() % wake_period() == 0; }
  /// A load change of so many tolerances does not wait: what it strikes would stand like a rock until then.
  static constexpr double blow = 10;

  /// The first look comes before the first step: a bed that was read at rest is culled by its velocities and forces alone.
  bool looks_at_once() const { return looks_at_once_; }
  void has_looked_at_once() { looks_at_once_ = false; }
  bool due(std::int64_t step) const { return step == next_look_; }
  bool may_cull(std::int64_t step) const { return step >= no_cull_until_; }
  Patience patience(bool something_locked) const {
    if (looks_at_once_) return {true, 1, at_once_speed, at_once_force};
    const bool quick = quick_looks_ > 0 && !something_locked;
    const int calm = scales_.settings().calm;
    return quick ? Patience{true, std::min(calm, quick_calm), quick_rate} : Patience{false, calm, 1};
  }

  /// `waking` of `locked` granules are in bodies that wake as a whole: a scene that is shaken wakes most of what is culled again
  /// and again. Culling waits, longer each time, until that stops.
  void see_waking_bodies(std::int64_t waking, std::int64_t locked, std::int64_t step) {
    if (2 * waking > locked) {
      pause_ = std::min(std::max(2 * pause_, shortest_pause), longest_pause);
      no_cull_until_ = step + pause_ * every();
      energy_then_ = 0;  // not a wait for lack of benefit: calm alone does not end it
    } else if (pause_ > 0 && step > no_cull_until_ + 4 * pause_ * every()) {
      pause_ = 0;
    }
  }
  /// Whether the wait for lack of benefit may end early: then ask_energy() wants to know how much moves.
  bool waits_for_calm(std::int64_t step) {
    if (may_cull(step)) energy_then_ = 0;  // the wait is over
    return energy_then_ > 0;
  }
  /// Kinetic energy (J) of what is exterior: what was true of a scene then need not be true once it has come to rest.
  void see_energy(double energy, std::int64_t step) {
    if (energy > calmed_share * energy_then_) return;
    energy_then_ = 0;
    no_cull_until_ = step;
    benefit_ = CullingBenefit();
  }

  /// A rebuild of the neighbour lists that only this fix asked for.
  void count_build() { ++builds_asked_; }
  /// A look at which culling was not judged.
  void forget_work() { builds_asked_ = 0; }

  struct Verdict {
    int wait = 0;            ///< looks for which culling is to wait
    bool give_back = false;  ///< what is culled is not worth the looks that watch it
    bool tell = false;       ///< the user should know
  };
  /// Did culling pay since the last look? Where it is to wait, see_wait() must follow.
  Verdict judge(const Work& w, std::int64_t step) {
    const double steps = static_cast<double>(step - std::max(judged_at_, step - every()));
    const double saved = steps * (CullingBenefit::interior * static_cast<double>(w.interior_granules) +
                                  CullingBenefit::interface * static_cast<double>(w.interface_granules));
    const double spent = static_cast<double>(w.atoms) * (CullingBenefit::look + (w.surface_drawn ? CullingBenefit::surface : 0) +
                                                         CullingBenefit::build * static_cast<double>(builds_asked_)) +
                         CullingBenefit::wake * static_cast<double>(w.restored);
    judged_at_ = step;
    builds_asked_ = 0;
    const std::int64_t culled = w.interface_granules + w.interior_granules;
    Verdict v;
    v.wait = benefit_.judge(saved, spent, w.chosen + culled > 0, w.chosen > culled);
    if (v.wait == 0) return v;
    v.give_back = culled > 0 && static_cast<double>(culled) < worth_watching * static_cast<double>(w.exterior);
    v.tell = !told_no_benefit_ && benefit_.waits_long();
    told_no_benefit_ = told_no_benefit_ || v.tell;
    return v;
  }
  /// `energy`: kinetic energy of what is exterior, when the wait begins (J).
  void see_wait(int looks, double energy, std::int64_t step) {
    no_cull_until_ = std::max(no_cull_until_, step + static_cast<std::int64_t>(looks) * every());
    energy_then_ = energy;
  }

  /// After a look: a bed that rests when the run begins is culled at once; else a look comes in time for what it must watch.
  void schedule(std::int64_t step, bool something_locked, bool something_stored) {
    last_look_ = step;
    if (quick_looks_ > 0 && !something_locked) {
      --quick_looks_;
      next_look_ = step + quick_interval();
      return;
    }
    quick_looks_ = 0;
    next_look_ = (step / every() + 1) * every();
    if (something_locked || something_stored) return;
    std::int64_t wait = (no_cull_until_ + every() - 1) / every() * every();
    if (energy_then_ > 0) wait = std::min(wait, next_look_ + looks_between_glances * every());
    next_look_ = std::max(next_look_, wait);
  }
  /// Culling is judged at this look: it is allowed, and the run's quick looks are over.
  bool judges(bool may_cull) const { return may_cull && quick_looks_ == 0; }

  // culling costs a rebuild of the neighbour lists: it waits for one that comes anyway, until it takes this share of the exterior
  // granules; where nothing is culled no surface is drawn for fewer
  static constexpr double worth_share = 0.05;
  // where culling waits, so little that is culled is not worth the looks that watch it: it is given back; where nothing is
  // culled, so few in solid state are left alone
  static constexpr double worth_watching = 0.01;

 private:
  // looks that culling waits after bodies woke as a whole
  static constexpr int shortest_pause = 2, longest_pause = 32;
  // culling that waits comes back when the kinetic energy of what is exterior has fallen to this share
  static constexpr double calmed_share = 0.25;
  static constexpr int looks_between_glances = 15;
  // the first looks of a run, until something is culled, come this many times as often; so many in a row are enough of them
  static constexpr int quick_rate = 5, quick_calm = 3;
  // a look that decides alone asks for far less motion and imbalance: what a bed has that was saved at rest is less still
  static constexpr double at_once_speed = 25, at_once_force = 15;

  // waking granules are handled together after about so many steps: a sound wave crosses one or two granules in that time
  static constexpr int wake_together = 20;

  static int fits(int in, int of) { return std::max(1, static_cast<int>(std::lround(static_cast<double>(in) / of))); }
  int wake_cycle() const { return every() * fits(wake_together, every()); }
  int wakes_in_a_cycle() const { return fits(wake_cycle(), wake_together); }
  int every() const { return scales_.look_every(); }
  int quick_interval() const { return scales_.settings().every ? every() : std::max(every() / quick_rate, 5); }

  const Scales& scales_;
  std::int64_t next_look_ = -1, last_look_ = INT32_MIN;
  bool looks_at_once_ = false;
  int quick_looks_ = 0;  // left at the start of a run in which nothing is culled yet
  std::int64_t no_cull_until_ = -1;
  int pause_ = 0;           // looks that culling waits after a body woke as a whole; doubles while that goes on
  double energy_then_ = 0;  // kinetic energy of what was exterior when culling began to wait (J); 0: it does not
  CullingBenefit benefit_;
  bool told_no_benefit_ = false;
  std::int64_t judged_at_ = -1;    // step of the last judgement
  std::int64_t builds_asked_ = 0;  // neighbour lists built because this fix asked, since then
};

}  // namespace solidcull
