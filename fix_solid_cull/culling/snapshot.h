// The culled state in a restart file.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "effective_gravity.h"
#include "parcels.h"
#include "ports.h"
#include "scales.h"
#include "solid.h"

namespace solidcull {

class Snapshot {
 public:
  Snapshot(const Ports& ports, Scales& scales, Solid& solid, const Shell& shell, AtomIndex& index, Parcels& parcels,
           EffectiveGravity& gravity)
      : ports_(ports), scales_(scales), solid_(solid), shell_(shell), index_(index), parcels_(parcels), gravity_(gravity) {}

  /// On rank 0 the numbers of the whole state, the first of them how many they are; empty elsewhere. InputError where a restart
  /// file cannot hold them. Collective.
  std::vector<double> write();
  /// What write() gave, of its bytes, which need not be aligned. InputError for what another version wrote, or what is not what
  /// was written. Local.
  static std::vector<double> from_bytes(const char* bytes);
  static std::int64_t interior_of(const std::vector<double>& state);  ///< granules that it holds besides atoms
  /// Scales, counters and largest radii are known at once, the rest waits for take_up(). Local.
  void read(const std::vector<double>& state);
  bool waits() const { return !state_.empty(); }
  /// Once there are atoms. InputError for another contact model. Collective.
  void take_up();

 private:
  const Ports& ports_;
  Scales& scales_;
  Solid& solid_;
  const Shell& shell_;
  AtomIndex& index_;
  Parcels& parcels_;
  EffectiveGravity& gravity_;
  std::vector<double> state_;
};

}  // namespace solidcull
