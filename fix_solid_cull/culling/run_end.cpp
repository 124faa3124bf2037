#include "run_end.h"

#include <string>
#include <vector>

#include "run_summary.h"

namespace solidcull {

void RunEnd::tell() {
  const std::vector<RunWork> ranks = bed_.ranks.gather(std::vector<RunWork>{meter_.end_run(report_.seconds())});
  RunSummary run;
  run.work = sum_of(ranks);
  run.seconds_without = seconds_without(ranks);
  if (run.seconds_without > 0) meter_.compare(run.work.seconds, run.seconds_without);
  run.runs = meter_.compared();
  run.times_less = meter_.times_less();
  run.audit = text_of(audit_.tally(), audit_.steps(), bed_.scales.diameter());
  if (run.work.steps > 0) bed_.run.say(text_of(run, bed_.scales.settings()));
  const std::string balanced = balance_.end_run();
  if (bed_.scales.settings().report != ReportLength::full) return;
  report_.tell_counters();
  if (!balanced.empty()) bed_.run.say(balanced);
}

}  // namespace solidcull
