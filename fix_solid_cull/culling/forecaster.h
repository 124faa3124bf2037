// Tells once in each run, from what its first looks have seen, what the line will gain.
#pragma once

#include <cstdint>

#include "bed.h"
#include "forecast.h"
#include "report.h"
#include "work_meter.h"

namespace solidcull {

class Forecaster {
 public:
  Forecaster(const Bed& bed, const WorkMeter& meter, Report& report) : bed_(bed), meter_(meter), report_(report) {}

  void begin_run();
  /// At the end of each look. Collective.
  void see_look();

 private:
  const Bed& bed_;
  const WorkMeter& meter_;
  Report& report_;
  ForecastTimes times_;
  std::int64_t first_step_ = 0;
  bool waits_ = false;  // this run is to tell
  bool marked_ = false;
  RunWork at_mark_;
};

}  // namespace solidcull
