#include "run_end.h"

#include <vector>

#include "run_summary.h"

namespace solidcull {

void RunEnd::tell() {
  const std::vector<RunWork> ranks = ports_.ranks.gather(std::vector<RunWork>{meter_.end_run(report_.seconds())});
  RunSummary run;
  run.work = sum_of(ranks);
  run.seconds_without = seconds_without(ranks);
  if (run.seconds_without > 0) meter_.compare(run.work.seconds, run.seconds_without);
  run.runs = meter_.compared();
  run.times_less = meter_.times_less();
  if (run.work.steps > 0) ports_.run.say(text_of(run, scales_.settings()));
  if (scales_.settings().report == ReportLength::full) report_.tell_counters();
}

}  // namespace solidcull
