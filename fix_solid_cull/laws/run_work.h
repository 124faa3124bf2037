// What runs cost, and what they would have cost without the fix: a model of time, in what the run itself has measured.
#pragma once

#include <vector>

#include "awake.h"

namespace solidcull {

/// Counted over a run. Plain data: a row that ranks exchange.
struct RunWork {
  double steps = 0;
  double exterior = 0, interface = 0, interior = 0;  ///< granule-steps
  double pairs = 0;          ///< in the engine's neighbour lists, pairs within bodies left out; summed over steps
  double exterior_ends = 0;  ///< of those pairs: granules in them that are exterior, 0 to 2 a pair
  double seconds = 0;        ///< of the run
  double in_fix = 0;         ///< of those, in this fix
  double in_pairs = 0;       ///< of those, in the engine's forces of pairs
  double restored = 0;       ///< granules
  double in_vain = 0;        ///< granules that were culled again and had not moved since they were restored
  AwakeSteps awake;
  WokenBy woken;  ///< granules

  /// Each of them, so many times: +1 adds a run, -1 takes what came before.
  void add(const RunWork& other, double times);
  double all() const { return exterior + interface + interior; }  ///< granule-steps
  double computed() const { return exterior + interface; }        ///< likewise, of the engine's atoms
  double mean(double granule_steps) const { return steps > 0 ? granule_steps / steps : 0; }
};

/// Counts are summed over ranks. Steps and seconds are those of the run, which all ranks share: the largest.
RunWork sum_of(const std::vector<RunWork>& ranks);

/// Seconds that the run would have taken without the fix; 0 where what was measured does not tell: too short a run, or too few
/// granules in it for what a step costs besides them not to matter. Local.
double seconds_without(const std::vector<RunWork>& ranks);

}  // namespace solidcull
