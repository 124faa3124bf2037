// Granules of bodies go to the rank that owns their place: those in the store at once, interface granules with the engine's
// exchange.
#pragma once

#include <map>
#include <vector>

#include "parcels.h"

namespace solidcull {

class Handover : public BodyFollower {
 public:
  Handover(const Ports& ports, Solid& solid, Shell& shell, const AtomIndex& index, const GranuleMasses& masses, Parcels& parcels,
           const BodyGroups& groups, const StoredSearch& stored, Arrivals& arrivals)
      : ports_(ports),
        solid_(solid),
        shell_(shell),
        index_(index),
        masses_(masses),
        parcels_(parcels),
        groups_(groups),
        stored_(stored),
        arrivals_(arrivals) {}

  /// At the end of a membership change. True if something went. Collective.
  bool send_home();
  /// After the engine's exchange: interface granules that have come find their bodies. Gives those that were announced and did
  /// not come: they went farther than to the next rank, and the engine has lost them. std::exception for one that was not
  /// announced. Local.
  std::vector<LostGranule> take_over();
  /// Subdomains are others. Local.
  void forget_homes() { at_home_.clear(); }

  void merged(int gone, int kept, bool same_frame) override;
  void frame_changed(int body) override { at_home_.erase(body); }

  /// Stored granules whose places are another rank's, of bodies that have moved since the last time. Local.
  std::vector<std::int64_t> stored_elsewhere();

 private:
  void leave(const std::vector<std::int64_t>& atoms, const std::vector<std::int64_t>& stored);

  const Ports& ports_;
  Solid& solid_;
  Shell& shell_;
  const AtomIndex& index_;
  const GranuleMasses& masses_;
  Parcels& parcels_;
  const BodyGroups& groups_;
  const StoredSearch& stored_;
  Arrivals& arrivals_;
  std::map<int, Pose> at_home_;  // frames of the store when their granules were last compared with the subdomain
};

}  // namespace solidcull
