// What a run costs on this rank: granule-steps, pairs in the engine's lists, seconds.
#pragma once

#include <chrono>

#include "bed.h"
#include "run_work.h"

namespace solidcull {

/// Local.
class WorkMeter {
 public:
  explicit WorkMeter(const Bed& bed) : bed_(bed) {}

  /// A run makes its first step. `in_fix`: seconds that this fix has taken until now; likewise below.
  void begin_run(double in_fix);
  /// Neighbour lists were built, and pairs within bodies left out of them.
  void note_new_lists() { lists_are_new_ = true; }
  /// Once a step, after its forces. `run ... pre no` sets up nothing: its first step begins the run.
  void count_step(double in_fix);
  /// A look sees so many, by what keeps them awake: they stand for the steps since the look before.
  void see_awake(const AwakeSteps& now);
  /// What was counted since the run began; nothing before its first step.
  RunWork now(double in_fix) const;
  /// Likewise; the next one begins anew.
  RunWork end_run(double in_fix);
  /// Granule-steps of all runs since the fix was made, this one too.
  RunWork so_far() const;

  /// A run took so many seconds, and would have taken so many without the fix.
  void compare(double seconds, double seconds_without) {
    seconds_ += seconds;
    seconds_without_ += seconds_without;
    ++compared_;
  }
  int compared() const { return compared_; }  ///< runs
  /// How many times longer they would have taken; 0 where there are none.
  double times_less() const { return seconds_ > 0 ? seconds_without_ / seconds_ : 0; }

 private:
  using Clock = std::chrono::steady_clock;
  void count_pairs();
  double in_vain() const;

  const Bed& bed_;
  bool runs_ = false;
  RunWork work_, before_;    // of this run, and of those before
  Clock::time_point began_;  // this run
  double in_fix_then_ = 0;   // s
  double seen_to_ = 0;       // steps of it that looks have seen
  double restored_then_ = 0, in_vain_then_ = 0;
  WokenBy woken_then_;
  double seconds_ = 0, seconds_without_ = 0;
  int compared_ = 0;
  bool lists_are_new_ = true;
  double pairs_ = 0, exterior_ends_ = 0;  // in the lists as they are
};

}  // namespace solidcull
