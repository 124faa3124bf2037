// Keyword `balance`: the cuts between ranks go where all of them have the same work (theory.md#ranks).
#pragma once

#include <cstdint>

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

  int moves() const { return moves_; }
  /// The largest work of a rank over the mean, when they were compared last; 0: not yet.
  double imbalance() const { return imbalance_; }

 private:
  double measure() const;

  const Bed& bed_;
  bool due_ = false;
  double imbalance_ = 0;
  int moves_ = 0;
};

}  // namespace solidcull
