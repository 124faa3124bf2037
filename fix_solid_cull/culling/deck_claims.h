// Culled granules that the deck, as it is now, holds or drives: they may not stay culled.
#pragma once

#include <vector>

#include "bed.h"
#include "wake_requests.h"

namespace solidcull {

/// Looks at the groups of what is culled; nothing comes out of the store for it.
class DeckClaims {
 public:
  DeckClaims(const Bed& bed, WakeRequests& wake) : bed_(bed), wake_(wake) {}

  /// What may not be culled any more asks to wake. Returns all engine groups, as bits, of the stored granules of this rank.
  /// Collective.
  int wake_claimed();

 private:
  const Bed& bed_;
  WakeRequests& wake_;
};

}  // namespace solidcull
