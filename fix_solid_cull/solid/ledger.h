// What went in and out of the store: counts, mass and energy (theory.md#restoring; invariants I2 and I4). Local to the rank.
#pragma once

#include <array>
#include <cstdint>

#include "awake.h"
#include "exact_sum.h"
#include "granule_store.h"

namespace solidcull {

class Ledger {
 public:
  /// The granule leaves the engine for the store.
  void stored(const StoredGranule& g) {
    ++in_;
    book(g, +1);
  }
  /// It comes back to the engine.
  void returned(const StoredGranule& g) {
    ++out_;
    book(g, -1);
  }
  void locked() { ++locked_; }
  /// A granule is free again; `energy` (J) is what that added to the kinetic energy of granule and body: zero but for a restore
  /// in the very step of the cull, which gives back what that cull took.
  void restored(double energy) {
    ++restored_;
    energy_ += energy;
  }
  /// A granule will be free again.
  void woken(Woke by) { woken_[by] += 1; }
  /// What a granule gained in height and by overlaps because it was given another place (J).
  void refilled(double energy) { energy_ += energy; }
  void carved() { ++carves_; }
  /// A granule that was free again is locked anew; `moved`: by more than d/100 in between.
  void locked_again(bool moved) {
    ++locked_again_;
    moved_ += moved;
  }

  /// What the books say should be in the store, against what is there. Exact but for rounding.
  double mass_error(const GranuleStore& store) const { return store.mass() - mass_.value(); }
  std::int64_t count_due() const { return in_ - out_; }

  std::int64_t granules_locked() const { return locked_; }
  std::int64_t granules_restored() const { return restored_; }
  const WokenBy& granules_woken() const { return woken_; }  ///< since the fix was made, in this program
  std::int64_t carves() const { return carves_; }
  std::int64_t granules_locked_again() const { return locked_again_; }
  std::int64_t granules_that_moved() const { return moved_; }  ///< of those
  double energy_added() const { return energy_.value(); }

  /// Counters as numbers for a restart file, and back: sums over ranks.
  static constexpr int counters_size = 6;
  using Counters = std::array<double, counters_size>;
  Counters counters() const {
    return {static_cast<double>(locked_),       static_cast<double>(restored_), static_cast<double>(carves_), energy_.value(),
            static_cast<double>(locked_again_), static_cast<double>(moved_)};
  }
  void set_counters(const Counters& c) {
    locked_ = static_cast<std::int64_t>(c[0]);
    restored_ = static_cast<std::int64_t>(c[1]);
    carves_ = static_cast<std::int64_t>(c[2]);
    energy_ = ExactSum();
    energy_ += c[3];
    locked_again_ = static_cast<std::int64_t>(c[4]);
    moved_ = static_cast<std::int64_t>(c[5]);
  }

 private:
  void book(const StoredGranule& g, int sign) { mass_ += sign * g.mass; }

  std::int64_t in_ = 0, out_ = 0, locked_ = 0, restored_ = 0, carves_ = 0, locked_again_ = 0, moved_ = 0;
  ExactSum mass_, energy_;
  WokenBy woken_;
};

}  // namespace solidcull
