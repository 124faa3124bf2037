// Mass and place of a locked granule by its tag: in the store, in the shell, or on its way from another rank.
#pragma once

#include <cstdint>

#include "atom_index.h"
#include "flat_map.h"
#include "shell.h"
#include "solid.h"

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

/// Local.
class GranuleMasses {
 public:
  GranuleMasses(const Solid& solid, const Atoms& atoms, const Shell& shell, const AtomIndex& index, const Arrivals& arrivals)
      : solid_(solid), atoms_(atoms), shell_(shell), index_(index), arrivals_(arrivals) {}

  /// In the frame of its present body. std::exception for a tag that is not there.
  GranuleMass operator()(std::int64_t tag) const {
    GranuleMass m;
    int stands_in = 0;
    const bool stored = solid_.store().contains(tag);
    const int* i = stored ? nullptr : index_.find(tag);
    if (stored) {
      const StoredGranule g = solid_.store().get(tag);
      m = {g.mass, g.position, g.radius, g.held};
      stands_in = g.body;
    } else if (i) {
      const Locked& e = shell_[*i];
      m = {atoms_.mass[*i], e.place, atoms_.radius[*i], e.held};
      stands_in = e.body;
    } else {
      const Arrival* a = arrivals_.find(tag);
      if (!a) throw InternalError("granule " + std::to_string(tag) + " is neither an atom nor stored nor announced");
      m = {a->mass, a->at.position, a->radius, a->held};
      stands_in = a->at.body;
    }
    const int body = solid_.bodies().body_of(tag);
    if (body && stands_in != body) {
      const Pose &from = solid_.bodies().pose(stands_in), &to = solid_.bodies().pose(body);
      if (from != to) m.position = to.to_frame(from.to_world(m.position));
    }
    return m;
  }
  Solid::MassOf by_tag() const {
    return [this](std::int64_t tag) { return (*this)(tag); };
  }

 private:
  const Solid& solid_;
  const Atoms& atoms_;
  const Shell& shell_;
  const AtomIndex& index_;
  const Arrivals& arrivals_;
};

}  // namespace solidcull
