// Keyword `balance`: the cuts between ranks go where all of them have the same work (theory.md#ranks).
#pragma once

#include <cstdint>
#include <string>

#include "balanced_cuts.h"
#include "bed.h"

namespace solidcull {

/// Granules and what is kept of them follow with the hand-over at the end of the change in which the cuts move.
class Balance {
 public:
  explicit Balance(const Bed& bed) : bed_(bed) {}

  /// Now and then: whether the cuts are to move, so that the next step needs a membership change. Collective.
  bool look(std::int64_t step);
  /// Moves them, where look() said so. True if some moved. Collective.
  bool move();

  /// What the run's comparisons have found, in words; empty where there were none. The next run begins anew. Local.
  std::string end_run();

 private:
  double measure() const;
  WorkGrid work_in(const Cuts& cuts) const;
  double strayed(const Cuts& cuts) const;

  const Bed& bed_;
  bool due_ = false;
  double imbalance_ = 0;          // largest work of a rank over the mean, when they were compared last
  int moves_ = 0, compared_ = 0;  // in this run; compared since the first move, if there was one
  double sum_ = 0, largest_ = 0;  // of those imbalances
};

}  // namespace solidcull
