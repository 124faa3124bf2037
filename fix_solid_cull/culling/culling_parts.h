// The parts of the culling, wired to each other.
#pragma once

#include <cstdint>
#include <vector>

#include "audit.h"
#include "balance.h"
#include "bed.h"
#include "body_meshes.h"
#include "body_motion.h"
#include "contact_freezing.h"
#include "cover.h"
#include "deck_claims.h"
#include "deep_granules.h"
#include "effective_gravity.h"
#include "forecaster.h"
#include "grounding.h"
#include "handover.h"
#include "invariants.h"
#include "membership_change.h"
#include "output_files.h"
#include "pacing.h"
#include "parcels.h"
#include "refill.h"
#include "report.h"
#include "run_end.h"
#include "shell_closure.h"
#include "shown_bed.h"
#include "snapshot.h"
#include "store_exchange.h"
#include "survey.h"
#include "wake_requests.h"
#include "wall_survey.h"
#include "work_meter.h"

namespace solidcull {

/// Owned by Culling; the tests of decisions own one too, and ask its parts. Local.
struct CullingParts {
  /// types: how many types of granules the engine has.
  CullingParts(const Ports& engine, const Settings& settings, int types);
  CullingParts(const CullingParts&) = delete;
  /// The only place where the rebuilds of neighbour lists that the culling asks for are counted. Local.
  void ask_for_build(std::int64_t step) {
    if (bed.run.ask_for_reneighbouring(step)) pacing.count_build();
  }
  /// What a membership change works on besides the bed.
  MembershipChange::Parts for_change() { return {survey, exchange, closure, freezing}; }

  Bed bed;

  // what is seen and asked
  BodyMotion motion;
  EffectiveGravity gravity;
  WallSurvey walls;
  Grounding grounding;
  Cover cover;
  Survey survey;
  Pacing pacing;
  Audit audit;

  // what changes it
  StoreExchange exchange;
  Refill refill;
  ShellClosure closure;
  DeepGranules deep;
  ContactFreezing freezing;
  Parcels parcels;
  Handover handover;
  Snapshot snapshot;
  ShownBed shown;
  BodyMeshes meshes;
  DeckClaims claims;
  Balance balance;

  WorkMeter meter;
  Report report;
  RunEnd run_end;
  Forecaster forecaster;
  OutputFiles files;
  Invariants invariants;
  std::vector<FollowsAtoms*> followers;  // what keeps something for each atom
};

}  // namespace solidcull
