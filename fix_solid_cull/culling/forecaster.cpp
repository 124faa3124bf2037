#include "forecaster.h"

#include <string>

#include "run_summary.h"

namespace solidcull {

void Forecaster::begin_run() {
  first_step_ = bed_.run.step;
  waits_ = true;
  report_.set_forecast({});
  marked_ = false;
  times_ = {static_cast<double>(bed_.run.steps_left), static_cast<double>(bed_.scales.look_every())};
}

void Forecaster::see_look() {
  if (!waits_) return;
  const double step = static_cast<double>(bed_.run.step - first_step_);
  if (!times_.begun()) {
    if (!bed_.census.something_locked()) return;
    times_.begin(step);
  }
  if (!marked_ && times_.is_marked(step)) {
    at_mark_ = meter_.now(report_.seconds());
    marked_ = true;
  }
  if (!times_.is_due(step)) return;
  waits_ = !times_.too_late(step);
  if (!waits_) return;
  const RunWork now = meter_.now(report_.seconds());
  RunWork lately = now;
  lately.add(at_mark_, -1);
  const std::vector<RunWork> ranks = bed_.ranks.gather(std::vector<RunWork>{now, lately});
  std::vector<RunWork> so_far, recent;
  for (std::size_t r = 0; r < ranks.size(); ++r) (r % 2 ? recent : so_far).push_back(ranks[r]);
  const Forecast f = forecast(so_far, recent, step + static_cast<double>(bed_.run.steps_left));
  if (f.times_less == 0) {
    times_.wait();
    return;
  }
  report_.set_forecast(f);
  waits_ = false;
  bed_.run.say(text_of(f, sum_of(recent), bed_.scales.settings()));
}

}  // namespace solidcull
