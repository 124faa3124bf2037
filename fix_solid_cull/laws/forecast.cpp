#include "forecast.h"

namespace solidcull {

Forecast forecast(const std::vector<RunWork>& so_far, const std::vector<RunWork>& lately, double steps) {
  const RunWork spent = sum_of(so_far), rate = sum_of(lately);
  const double without = seconds_without(lately);
  Forecast f;
  if (without == 0 || rate.all() == 0) return f;
  const double left = std::max(0.0, steps - spent.steps) / rate.steps;
  // what is past was dearer: the first cull is in it
  f.times_less = without * (steps / rate.steps) / (spent.seconds + left * rate.seconds);
  f.awake = rate.exterior / rate.all();
  f.moving = (rate.awake[Awake::moving] + rate.awake[Awake::alone]) / rate.all();
  return f;
}

}  // namespace solidcull
