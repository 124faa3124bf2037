// Where a run stands.
#pragma once

namespace solidcull {

enum class Phase {
  between_runs,
  beginning,  // of a run: nothing has been computed yet
  ready,      // set up; the first step takes the loads, in this run or, after `run 0`, in the next one
  stepping
};

}  // namespace solidcull
