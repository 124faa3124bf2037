// The invariants I1 and I2 (theory.md#invariants), checked at run time (debug builds; SOLIDCULL_CHECK in the environment).
#pragma once

#include "bed.h"

namespace solidcull {

/// After the engine's exchange, when ghosts are there. InternalError names what does not hold. Local.
class Invariants {
 public:
  explicit Invariants(const Bed& bed) : bed_(bed) {}

  void check() const {
    check_shell_is_closed();
    check_ledger();
    check_bodies();
    check_contacts_across_ranks();
    if (bed_.clumps.possible) check_clumps();
  }
  static bool asked();

 private:
  void check_shell_is_closed() const;
  void check_ledger() const;
  void check_bodies() const;
  void check_contacts_across_ranks() const;
  void check_clumps() const;

  const Bed& bed_;
};

}  // namespace solidcull
