// Does culling pay here? Work is counted, in steps of one granule, so that the answer is the same on every machine (I7;
// theory.md#pacing).
#pragma once

#include <algorithm>

namespace solidcull {

class CullingBenefit {
 public:
  // what things cost, in steps of one granule: of beds of 2,000 to 20,000 the run time was least with these
  static constexpr double look = 2;         ///< per atom
  static constexpr double surface = 1;      ///< per atom, of a look that draws the outer surface
  static constexpr double build = 3;        ///< per atom, of a neighbour list that was built only because the fix asked
  static constexpr double wake = 120;       ///< per granule that is culled and woken again
  static constexpr double interior = 1.0;   ///< saved per step and interior granule
  static constexpr double interface = 0.7;  ///< and per interface granule

  /// At each look at which culling was allowed: what was saved and spent since the last one, over all ranks, and whether anything
  /// was culled or is. `begins`: most of what is culled from now on is culled at this look; a trial begins with the first such
  /// look, for what was saved and spent before, waiting for calm, says nothing of it. Returns for how many looks culling is to
  /// wait, 0 to go on.
  int judge(double saved, double spent, bool culling, bool begins = false) {
    culled_ = culled_ || culling;
    if (begins && !begun_) {
      begun_ = true;
      saved_ = spent_ = 0;
      looks_ = 0;
      return 0;
    }
    saved_ = memory * saved_ + saved;
    spent_ = memory * spent_ + spent;
    if (++looks_ < (culled_ ? trial : idle_trial)) return 0;
    if (spent_ <= saved_) {
      if (looks_ > 4 * pause_) pause_ = 0;
      return 0;
    }
    pause_ = std::clamp(2 * pause_, shortest, culled_ ? longest : longest_idle);
    saved_ = spent_ = 0;
    looks_ = 0;
    culled_ = begun_ = false;
    return pause_;
  }
  /// The deck hardly lets anything be culled: worth a line.
  bool waits_long() const { return pause_ >= worth_a_line; }

 private:
  static constexpr double memory = 0.9;  // of earlier looks
  static constexpr int trial = 6, idle_trial = 4, shortest = 4, longest_idle = 64, longest = 256, worth_a_line = 16;

  double saved_ = 0, spent_ = 0;
  int looks_ = 0, pause_ = 0;
  bool culled_ = false, begun_ = false;
};

}  // namespace solidcull
