// `store none restore refill`, the paper's scheme: what goes to the store takes a site, and what comes out of it is packed anew
// between what is there (theory.md#refill).
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "bed.h"
#include "flat_map.h"
#include "store_exchange.h"
#include "tag_pairs.h"

namespace solidcull {

/// All that this store does differently when granules come and go. With another store nothing of it acts.
class Refill : public StoreFollower {
 public:
  Refill(Bed& bed, StoreExchange& exchange) : bed_(bed), exchange_(exchange) {}

  bool acts() const { return bed_.scales.refills(); }

  /// A membership change begins. Local.
  void begin_change();
  /// These, which have come to stand in another rank's part of the box, become atoms: over there they may have other sites, where
  /// the shell is not closed. Local.
  bool fetch(const std::vector<std::int64_t>& stored);
  /// All that came out in this change, so far, is packed between what is there. False, and nothing happens, if since the last
  /// call nothing came out on any rank. Collective.
  bool pack();
  /// Each of these goes to a free site and into the store; where no site will do it stays. `near` as in DeepGranules. Local.
  std::size_t put_away(const std::vector<int>& atoms, const std::function<bool(int, const Sphere&)>& near);

  // --- the energy that new packings bring in
  /// These have just left their bodies, here or near; the engine has the contacts that they had. Local.
  void note_freed(const FlatMap<char>& freed);
  /// At the first forces after that: what contacts hold that they did not have is energy added. Local.
  void count_energy_of_new_contacts();

  void came_back(int i, const StoredGranule& g, const Vec3& x) override;

 private:
  void pack(int sweeps, bool look_for_room);
  void place(const std::vector<int>& atoms, const std::vector<Sphere>& now);
  void relocate(int i, const Vec3& place);

  Bed& bed_;
  StoreExchange& exchange_;
  std::vector<std::int64_t> came_back_;  // since the last packing
  std::vector<std::int64_t> newcomers_;  // of this change
  FlatMap<char> freed_;
  TagPairs kept_;  // contacts of these that have a history
};

}  // namespace solidcull
