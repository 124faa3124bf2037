// Granules of bodies go to the rank that owns their place: those in the store at once, interface granules with the engine's
// exchange. What the engine loses on the way, or anywhere else, is a member of no body any more.
#pragma once

#include <map>
#include <vector>

#include "bed.h"
#include "deep_granules.h"
#include "parcels.h"

namespace solidcull {

/// Owns what is on its way between ranks, and what was in the shell when the engine was given its atoms.
class Handover : public BodyFollower {
 public:
  Handover(Bed& bed, Parcels& parcels) : bed_(bed), parcels_(parcels) {}

  /// At the end of a membership change: whether something here is another rank's; so is what `away` says. Local.
  bool find_leaving(const std::vector<DeepGranules::AwayFromHome>& away);
  /// It goes there; called where something goes on any rank. Collective.
  void send_home();
  /// After the engine's exchange: interface granules that have come find their bodies. Those that were announced and did not
  /// come went farther than to the next rank, and the engine has lost them: returns how many. InternalError for one that was not
  /// announced. Local.
  std::size_t take_over();

  // --- granules that have left the box, or were deleted
  /// The engine is given its atoms: what is in the shell now. Local.
  void remember();
  /// Those that are not there any more leave their bodies. True if there were any; then bodies are to be settled anew. Local.
  bool forget_lost();
  void release_memory() { before_.shrink_to_fit(); }

  /// Subdomains are others. Local.
  void forget_homes() { at_home_.clear(); }

  void merged(int gone, int kept, bool) override;
  void frame_changed(int body) override { at_home_.erase(body); }

  /// Stored granules whose places are another rank's, of bodies that have moved since the last time. Local.
  std::vector<std::int64_t> stored_elsewhere();

 private:
  struct Leaving {
    std::vector<std::int64_t> atoms, stored;  // tags, ascending
  };
  /// When its granules were last compared with the subdomain.
  struct Home {
    Pose pose;
    double way = 0;  // since then, when last looked (m)
    double lag = 0;  // how far those may be outside already that wait, or have come from other frames without being compared (m)
  };
  std::vector<int> neighbours() const;
  bool follows_another(std::int64_t tag) const;
  void keep_clumps_whole(const std::vector<DeepGranules::AwayFromHome>& away);
  void forget_clumps_that_left();
  void wake_rest_of_clumps(const std::vector<LostGranule>& lost);
  void leave();

  Bed& bed_;
  Parcels& parcels_;
  std::vector<LostGranule> before_;      // interface granules of this rank when the engine was last given its atoms
  std::vector<LostGranule> on_the_way_;  // announced by another rank, and lost
  std::map<int, Leaving> leaving_;       // by the rank where they go
  std::map<int, Home> at_home_;          // frames of the store
};

}  // namespace solidcull
