// What the user is told at the end of a run.
#pragma once

#include <string>

#include "forecast.h"
#include "run_work.h"
#include "settings.h"

namespace solidcull {

struct RunSummary {
  RunWork work;                ///< of the run, over all ranks
  double seconds_without = 0;  ///< that it would have taken without the fix; 0: not known
  int runs = 0;                ///< of this fix of which that is known, this one included
  double times_less = 0;       ///< how many times longer those would have taken
  std::string audit;           ///< see audit_tally.h
};

/// Lines, without the last one's end: the first says how long the run was, the others are indented. What is not known has no
/// line.
std::string text_of(const RunSummary& run, const Settings& settings);

/// A forecast, in one line; `lately`: what it rests on.
std::string text_of(const Forecast& f, const RunWork& lately, const Settings& settings);

/// What would let more sleep, in words; empty where the counts do not show it.
std::string advice_on(const RunWork& w, const Settings& settings);

}  // namespace solidcull
