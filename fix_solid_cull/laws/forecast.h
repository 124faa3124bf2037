// What a run will gain by the line, if it goes on as it did at its first looks (theory.md#forecast).
#pragma once

#include <algorithm>
#include <vector>

#include "run_work.h"

namespace solidcull {

struct Forecast {
  double times_less = 0;  ///< work of the whole run without the fix over that with it; 0: not known
  double awake = 0;       ///< mean share of the granules that is exterior
  double moving = 0;      ///< and that moves: touches nothing, or is faster than `speed`
};

/// Of a run of so many steps. `so_far` and, of it, `lately`: each rank's work since it began, and over steps that stand for those
/// to come. Local.
Forecast forecast(const std::vector<RunWork>& so_far, const std::vector<RunWork>& lately, double steps);

/// Which steps these are: begun when something is culled for the first time, the last third of three tenths of the run or of
/// fifteen looks, whichever is longer, and longer where that is not enough to tell. Not after six tenths of the run.
class ForecastTimes {
 public:
  ForecastTimes() = default;
  ForecastTimes(double steps, double look_every) : steps_(steps), least_(std::max(share * steps, fewest_looks * look_every)) {}

  /// `step`: of the run, 0 at its start.
  void begin(double step) { began_ = step; }
  bool begun() const { return began_ >= 0; }
  bool is_marked(double step) const { return step - began_ >= from * least_; }
  bool is_due(double step) const { return step - began_ >= least_; }
  bool too_late(double step) const { return step > last_share * steps_; }
  /// It was not enough: as many steps again.
  void wait() { least_ *= 2; }

 private:
  // what a scene shakes at its start sleeps again by then, where it does
  static constexpr double share = 0.3, from = 2.0 / 3, fewest_looks = 15, last_share = 0.6;

  double steps_ = 0, least_ = 0, began_ = -1;
};

}  // namespace solidcull
