// Mass and place of a locked granule by its tag: in the store, in the shell, or on its way from another rank.
#pragma once

#include <cstdint>

#include "bed_state.h"

namespace solidcull {

/// Local.
class GranuleMasses {
 public:
  explicit GranuleMasses(const BedState& bed) : bed_(bed) {}

  /// In the frame of its present body. std::exception for a tag that is not there.
  GranuleMass operator()(std::int64_t tag) const {
    GranuleMass m{};
    int stands_in = 0;
    const bool stored = bed_.solid.store().contains(tag);
    const int* i = stored ? nullptr : bed_.index.find(tag);
    if (stored) {
      const StoredGranule g = bed_.solid.store().get(tag);
      m = {g.mass, g.position, g.radius, g.held, g.clump_mass()};
      stands_in = g.body;
    } else if (i) {
      const Locked& e = bed_.shell[*i];
      m = of_atom(*i);
      stands_in = e.body;
    } else {
      const Arrival* a = bed_.arrivals.find(tag);
      if (!a) throw InternalError("granule " + std::to_string(tag) + " is neither an atom nor stored nor announced");
      m = a->granule;
      stands_in = a->body;
    }
    const int body = bed_.solid.bodies().body_of(tag);
    if (body && stands_in != body) {
      const Pose &from = bed_.solid.bodies().pose(stands_in), &to = bed_.solid.bodies().pose(body);
      if (from != to) {
        m.position = to.to_frame(from.to_world(m.position));
        if (m.clump) m.clump = m.clump->seen_from(from, to);
      }
    }
    return m;
  }
  /// Interface granule i, in the frame of the body in which it stands.
  GranuleMass of_atom(int i) const {
    const Locked& e = bed_.shell[i];
    GranuleMass m{bed_.atoms.mass[i], e.place, bed_.atoms.radius[i], e.held, std::nullopt};
    if (e.clump == 0) return m;
    const Clump* const c = bed_.locked_clumps.find(bed_.atoms.tag[i]);
    m.mass = c ? c->mass : 0;
    if (c) m.clump = c->lies;
    return m;
  }
  Solid::MassOf by_tag() const {
    return [this](std::int64_t tag) { return (*this)(tag); };
  }

 private:
  const BedState& bed_;
};

}  // namespace solidcull
