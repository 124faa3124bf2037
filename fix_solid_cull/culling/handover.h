// Granules of bodies go to the rank that owns their place: those in the store at once, interface granules with the engine's
// exchange.
#pragma once

#include <map>
#include <vector>

#include "bed.h"
#include "parcels.h"

namespace solidcull {

class Handover : public BodyFollower {
 public:
  Handover(Bed& bed, Parcels& parcels) : bed_(bed), parcels_(parcels) {}

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

  Bed& bed_;
  Parcels& parcels_;
  std::map<int, Pose> at_home_;  // frames of the store when their granules were last compared with the subdomain
};

}  // namespace solidcull
