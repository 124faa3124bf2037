#include "culling_parts.h"

#include <initializer_list>

namespace solidcull {

CullingParts::CullingParts(const Ports& engine, const Settings& settings, int types)
    : bed(engine, settings, types),
      motion(bed),
      gravity(bed, motion),
      walls(bed),
      grounding(bed, motion, walls),
      cover(bed, motion),
      survey(bed, motion, walls),
      pacing(bed.scales),
      audit(bed, motion, walls, survey),
      exchange(bed),
      refill(bed, exchange),
      closure(bed, exchange),
      deep(bed, walls, closure),
      freezing(bed),
      parcels(bed, cover),
      handover(bed, parcels),
      snapshot(bed, parcels, gravity, cover),
      shown(bed),
      meshes(bed, shown),
      claims(bed),
      balance(bed),
      meter(bed),
      report(bed, motion, meter, audit),
      run_end(bed, meter, report, balance, audit),
      forecaster(bed, meter, report),
      files(bed, meshes, survey, report),
      invariants(bed),
      followers{&bed.shell, &walls.rows(), &survey.rows(), &cover.rows(), &closure.rows(), &shown, &bed.locked_clumps} {
  for (BodyFollower* f : std::initializer_list<BodyFollower*>{&motion, &closure, &handover, &cover, &meshes})
    bed.solid.followed_by(*f);
  for (StoreFollower* f : std::initializer_list<StoreFollower*>{&walls, &grounding, &cover, &refill}) exchange.followed_by(*f);
}

}  // namespace solidcull
