// What the run is told: f_ID, f_ID[...]; and all counters at its end, where the user asks for them.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "audit.h"
#include "bed.h"
#include "body_motion.h"
#include "forecast.h"
#include "stop_watch.h"
#include "work_meter.h"

namespace solidcull {

class Report {
 public:
  static constexpr int counts = 12;   ///< f_ID[1..12]
  static constexpr int carried = 10;  ///< after them: what interior granules carry
  static constexpr int of_all = 6;    ///< and what all granules have together
  static constexpr int again = 2;     ///< how many were culled again, and how many of them had moved
  static constexpr int spent = 3;     ///< granule-steps: exterior, interface, interior
  static constexpr int gains = 4;     ///< times less work as measured and as forecast, and shares awake and moving that rests on
  static constexpr int audited = 7;   ///< patches, and the ends of the intervals of AuditTally's figures
  static constexpr int size = counts + carried + of_all + again + spent + gains + audited;
  static constexpr int interior = 2;  ///< index of f_ID itself among them

  Report(const Bed& bed, const BodyMotion& motion, const WorkMeter& meter, const Audit& audit)
      : bed_(bed), motion_(motion), meter_(meter), audit_(audit) {}

  /// What f_ID says of it from now on; before, nothing is known. Alike on all ranks.
  void set_forecast(const Forecast& f) { forecast_ = f; }

  /// f_ID[n + 1]. Collective.
  double value(int n);
  /// Numbers of granules are others. Local.
  void membership_changed() { ++membership_version_; }
  /// Two lines: how many granules and bodies there are now and what has happened so far, and seconds by part. Collective.
  void tell_counters();

  double seconds() const { return watch_.total(); }  ///< in the fix since it was made. Local
  StopWatch::Running time(Part part) { return watch_.time(part); }

 private:
  void count_totals();
  double of_audits(int n) const;
  void sum_carried();
  void sum_all();

  const Bed& bed_;
  const BodyMotion& motion_;
  const WorkMeter& meter_;
  const Audit& audit_;
  StopWatch watch_;
  Forecast forecast_;
  std::array<double, again> rests_again_{};
  std::array<double, spent> spent_{};
  std::vector<double> totals_, carried_, all_;  // as of:
  std::int64_t totals_step_ = -1, totals_version_ = -1;
  std::int64_t membership_version_ = 0;
};

}  // namespace solidcull
