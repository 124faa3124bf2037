// `restore refill`: what comes out of a store that knows no places is packed anew, between what is there (theory.md#refill).
#pragma once

#include <cstdint>
#include <vector>

#include "bed.h"
#include "store_exchange.h"

namespace solidcull {

/// Granules that have come out of the store begin at their sites and are moved off each other, off other granules and walls.
class Refill {
 public:
  Refill(const Bed& bed, StoreExchange& exchange) : bed_(bed), exchange_(exchange) {}

  /// A membership change begins. Local.
  void begin_change() { newcomers_.clear(); }
  /// All that came out in this change, so far, is packed between what is there. False, and nothing happens, if since the last
  /// call nothing came out on any rank. Collective.
  bool pack();

 private:
  void pack(int sweeps, bool look_for_room);
  void place(const std::vector<int>& atoms, const std::vector<Sphere>& now);

  const Bed& bed_;
  StoreExchange& exchange_;
  std::vector<std::int64_t> newcomers_;
};

}  // namespace solidcull
