// The invariants I1 and I2 (theory.md#invariants), checked at run time (debug builds; SOLIDCULL_CHECK in the environment).
#pragma once

#include "body_groups.h"
#include "census.h"
#include "ports.h"
#include "scales.h"
#include "shell.h"
#include "solid.h"
#include "stored_search.h"

namespace solidcull {

/// After the engine's exchange, when ghosts are there. InternalError names what does not hold. Local.
class Invariants {
 public:
  Invariants(const Ports& ports, const Scales& scales, const Solid& solid, const Shell& shell, const BodyGroups& groups,
             const StoredSearch& stored, const Census& census)
      : ports_(ports), scales_(scales), solid_(solid), shell_(shell), groups_(groups), stored_(stored), census_(census) {}

  void check() const {
    check_shell_is_closed();
    check_ledger();
    check_bodies();
  }
  static bool asked();

 private:
  void check_shell_is_closed() const;
  void check_ledger() const;
  void check_bodies() const;

  const Ports& ports_;
  const Scales& scales_;
  const Solid& solid_;
  const Shell& shell_;
  const BodyGroups& groups_;
  const StoredSearch& stored_;
  const Census& census_;
};

}  // namespace solidcull
