// Culled granules that the deck, as it is now, holds or drives: they may not stay culled.
#pragma once

#include <vector>

#include "ports.h"
#include "scales.h"
#include "shell.h"
#include "solid.h"
#include "wake_requests.h"

namespace solidcull {

/// Looks at the groups of what is culled; nothing comes out of the store for it.
class DeckClaims {
 public:
  DeckClaims(const Ports& ports, const Scales& scales, const Solid& solid, const Shell& shell, WakeRequests& wake)
      : ports_(ports), scales_(scales), solid_(solid), shell_(shell), wake_(wake) {}

  /// What may not be culled any more asks to wake. Returns all engine groups, as bits, of the stored granules of this rank.
  /// Collective.
  int wake_claimed();

 private:
  const Ports& ports_;
  const Scales& scales_;
  const Solid& solid_;
  const Shell& shell_;
  WakeRequests& wake_;
};

}  // namespace solidcull
