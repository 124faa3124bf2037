// Interface granules on their way from another rank, and those that never came.
#pragma once

#include <cstdint>

#include "flat_map.h"
#include "solid_bodies.h"

namespace solidcull {

/// An interface granule that another rank has announced in this reneighbouring; the engine brings its atom.
struct Arrival {
  SolidBodies::Place at;
  double mass = 0, radius = 0;
  bool held = false;
};
using Arrivals = FlatMap<Arrival>;

/// One that the engine does not have any more, and its body has still; in the frame of that.
struct LostGranule {
  std::int64_t tag;
  GranuleMass granule;
};

}  // namespace solidcull
