// The end of a run: what the user is told, in a few lines.
#pragma once

#include "ports.h"
#include "report.h"
#include "scales.h"
#include "work_meter.h"

namespace solidcull {

class RunEnd {
 public:
  RunEnd(const Ports& ports, const Scales& scales, WorkMeter& meter, Report& report)
      : ports_(ports), scales_(scales), meter_(meter), report_(report) {}

  /// Nothing after a run of no step; with `report full`, all counters too, after any. Collective.
  void tell();

 private:
  const Ports& ports_;
  const Scales& scales_;
  WorkMeter& meter_;
  Report& report_;
};

}  // namespace solidcull
