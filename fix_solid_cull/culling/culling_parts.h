// The parts of the culling, wired to each other.
#pragma once

#include <vector>

#include "atom_index.h"
#include "body_groups.h"
#include "body_meshes.h"
#include "body_motion.h"
#include "census.h"
#include "contact_freezing.h"
#include "cover.h"
#include "deck_claims.h"
#include "effective_gravity.h"
#include "granule_masses.h"
#include "grounding.h"
#include "handover.h"
#include "invariants.h"
#include "lost_atoms.h"
#include "membership_change.h"
#include "output_files.h"
#include "pacing.h"
#include "parcels.h"
#include "ports.h"
#include "refill.h"
#include "report.h"
#include "run_end.h"
#include "scales.h"
#include "shell.h"
#include "shell_closure.h"
#include "shown_bed.h"
#include "snapshot.h"
#include "solid.h"
#include "store_exchange.h"
#include "stored_search.h"
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
  /// What a membership change works on.
  MembershipChange::Parts for_change() {
    return {ports, scales, solid, shell, index, masses, arrivals, groups, walls, survey, stored, exchange, closure, freezing};
  }

  const Ports ports;
  Scales scales;

  // what is culled, and where it is
  Solid solid;
  Shell shell;
  AtomIndex index;
  Arrivals arrivals;
  StoredSearch stored;
  GranuleMasses masses;
  BodyGroups groups;
  Census census;

  // what is seen and asked
  WakeRequests wake;
  BodyMotion motion;
  EffectiveGravity gravity;
  WallSurvey walls;
  Grounding grounding;
  Cover cover;
  Survey survey;
  Pacing pacing;

  // what changes it
  StoreExchange exchange;
  Refill refill;
  ShellClosure closure;
  ContactFreezing freezing;
  Parcels parcels;
  Handover handover;
  LostAtoms lost;
  Snapshot snapshot;
  ShownBed shown;
  BodyMeshes meshes;
  DeckClaims claims;

  WorkMeter meter;
  Report report;
  RunEnd run_end;
  OutputFiles files;
  Invariants invariants;
  std::vector<FollowsAtoms*> followers;  // what keeps something for each atom
};

}  // namespace solidcull
