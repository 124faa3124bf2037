// The culled state in a restart file.
#pragma once

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
  /// What write() gave: scales, counters and largest radii are known at once, the rest waits for take_up(). InputError for what
  /// another version wrote. Local.
  void read(const double* numbers);
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
