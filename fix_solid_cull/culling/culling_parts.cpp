#include "culling_parts.h"

#include <initializer_list>

namespace solidcull {

CullingParts::CullingParts(const Ports& engine, const Settings& settings, int types)
    : ports(engine),
      scales(settings),
      solid(scales),
      shell(solid.bodies()),
      stored(solid, ports.ranks, scales),
      masses(solid, ports.atoms, shell, index, arrivals),
      groups(ports, scales, solid, shell, stored, masses, arrivals),
      census(ports, solid),
      motion(ports, scales, solid, shell, groups),
      gravity(ports, scales, solid, motion, groups, wake),
      walls(ports, shell, wake),
      grounding(ports, scales, solid, shell, groups, motion, walls),
      cover(ports, scales, solid, shell, motion, stored, wake),
      survey(ports, scales, solid, shell, motion, groups, walls),
      pacing(scales),
      exchange(ports, scales, solid, shell, index, walls, cover, grounding),
      refill(ports, scales, solid, shell, index, exchange, stored),
      closure(ports, scales, solid, shell, groups, stored, census, walls, exchange),
      freezing(ports, scales, solid, shell, index, groups),
      parcels(ports, scales, solid, shell, index, masses, arrivals, groups, cover),
      handover(ports, solid, shell, index, masses, parcels, groups, stored, arrivals),
      lost(ports, solid, shell, index, masses),
      snapshot(ports, scales, solid, shell, index, parcels, gravity, cover),
      shown(ports, scales, solid, shell, index, groups, wake),
      meshes(ports, scales, solid, shell, index, masses, shown),
      claims(ports, scales, solid, shell, wake),
      meter(ports, solid),
      report(ports, solid, shell, groups, motion, meter),
      run_end(ports, scales, meter, report),
      files(ports, scales, solid, shell, groups, meshes, report),
      invariants(ports, scales, solid, shell, groups, stored, census),
      followers{&shell, &walls.rows(), &survey.rows(), &cover.rows(), &closure.rows(), &shown} {
  solid.set_types(types);
  for (BodyFollower* f : std::initializer_list<BodyFollower*>{&motion, &grounding, &closure, &handover, &cover, &meshes})
    solid.followed_by(*f);
}

}  // namespace solidcull
