// The end of a run: what the user is told, in a few lines.
#pragma once

#include "audit.h"
#include "balance.h"
#include "bed.h"
#include "report.h"
#include "work_meter.h"

namespace solidcull {

class RunEnd {
 public:
  RunEnd(const Bed& bed, WorkMeter& meter, Report& report, Balance& balance, const Audit& audit)
      : bed_(bed), meter_(meter), report_(report), balance_(balance), audit_(audit) {}

  /// Nothing after a run of no step; with `report full`, all counters too, after any. Collective.
  void tell();

 private:
  const Bed& bed_;
  WorkMeter& meter_;
  Report& report_;
  Balance& balance_;
  const Audit& audit_;
};

}  // namespace solidcull
