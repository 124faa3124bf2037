// `restore refill`: what comes out of a store that knows no places is packed anew, between what is there (theory.md#refill).
#pragma once

#include <cstdint>
#include <vector>

#include "atom_index.h"
#include "ports.h"
#include "scales.h"
#include "shell.h"
#include "solid.h"
#include "store_exchange.h"
#include "stored_search.h"

namespace solidcull {

/// Granules that have come out of the store begin at their sites and are moved off each other, off other granules and walls.
class Refill {
 public:
  Refill(const Ports& ports, const Scales& scales, const Solid& solid, const Shell& shell, const AtomIndex& index,
         StoreExchange& exchange, const StoredSearch& stored)
      : ports_(ports), scales_(scales), solid_(solid), shell_(shell), index_(index), exchange_(exchange), stored_(stored) {}

  /// A membership change begins. Local.
  void begin_change() { newcomers_.clear(); }
  /// All that came out in this change, so far, is packed between what is there. False, and nothing happens, if since the last
  /// call nothing came out on any rank. Collective.
  bool pack();

 private:
  void pack(int sweeps, bool look_for_room);
  void place(const std::vector<int>& atoms, const std::vector<Sphere>& now);

  const Ports& ports_;
  const Scales& scales_;
  const Solid& solid_;
  const Shell& shell_;
  const AtomIndex& index_;
  StoreExchange& exchange_;
  const StoredSearch& stored_;
  std::vector<std::int64_t> newcomers_;
};

}  // namespace solidcull
