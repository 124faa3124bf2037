// What all of the culling works on: the engine's side, what the user set, what is culled, and where each granule is.
#pragma once

#include "arrivals.h"
#include "atom_index.h"
#include "locked_clumps.h"
#include "ports.h"
#include "scales.h"
#include "shell.h"
#include "solid.h"

namespace solidcull {

/// Who holds it const reads it: of the engine's side a port may be asked to change something all the same. Local.
struct BedState : Ports {
  BedState(const Ports& engine, const Settings& settings)
      : Ports(engine),
        scales(settings),
        solid(scales),
        shell(solid.bodies()),
        locked_clumps(atoms, clumps, shell, solid.bodies()) {}
  BedState(const BedState&) = delete;

  Scales scales;
  Solid solid;
  Shell shell;
  LockedClumps locked_clumps;
  AtomIndex index;
  Arrivals arrivals;
  double largest_radius = 0;  ///< of any sphere of any rank, atom or stored, as of the last change (m)
  double largest_clump = 0;   ///< farthest that two spheres of one may be apart, on any rank, as of the last change (m)
};

}  // namespace solidcull
