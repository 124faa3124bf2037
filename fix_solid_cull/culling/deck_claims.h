// Culled granules that the deck, as it is now, holds or drives: they may not stay culled.
#pragma once

#include <vector>

#include "bed.h"

namespace solidcull {

/// Looks at the groups of what is culled; nothing comes out of the store for it.
class DeckClaims {
 public:
  explicit DeckClaims(const Bed& bed) : bed_(bed) {}

  /// What may not be culled any more asks to wake. Returns all engine groups, as bits, of the stored granules of this rank.
  /// Collective.
  int wake_claimed();

 private:
  const Bed& bed_;
};

}  // namespace solidcull
