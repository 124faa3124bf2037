// The bed: its state, and what is asked of it again and again. Most parts of the culling hold this and little else.
#pragma once

#include <cstdint>

#include "bed_state.h"
#include "body_groups.h"
#include "census.h"
#include "clump_spheres.h"
#include "granule_masses.h"
#include "stored_search.h"
#include "wake_requests.h"

namespace solidcull {

/// Interface granules follow their bodies.
struct Bed : BedState, BodyFollower {
  Bed(const Ports& engine, const Settings& settings, int types);

  /// After granules were unlocked: bodies that came apart become several. Local.
  void split_bodies() { solid.split(masses.by_tag()); }
  void came_off(std::int64_t tag, int body, const Vec3& place) override;
  /// After bodies merged: granules of swallowed ones move to the frames of the bodies that they are part of now: interface
  /// granules, those that are to arrive, interior ones. Local.
  void adopt_places();
  /// Interface granule i as its body knows it, with what it has in the shell. Local.
  StoredGranule interface_granule(int i) const;
  /// Interface granule i leaves this rank, or has come to stand in a body of it.
  void leaves_rank(int i);
  void arrives(int i, const SolidBodies::Place& at);
  /// All atoms and clumps go to the ranks that own their places, however far. Atoms have other indices then. Collective.
  void send_far();
  /// The largest radius is known on all ranks. Collective; a change does it, too.
  void see_largest_radius();
  /// All that wakes on this rank, `all` if some rank has asked so. Collective.
  Wakes take_wakes(Woke all);
  /// Each atom is labelled with its body's number over all ranks. Local.
  void label_bodies();

  const StoredSearch stored;
  const GranuleMasses masses;
  const ClumpSpheres clump_spheres;
  BodyGroups groups;
  Census census;
  mutable WakeRequests wake;  ///< whoever sees the bed may ask it to wake
};

}  // namespace solidcull
