// One body over ranks: parts on several ranks that touch are one rigid body (theory.md#ranks).
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "flat_map.h"
#include "granule_masses.h"
#include "rank_trees.h"
#include "stored_search.h"

namespace solidcull {

/// Keys number bodies over all ranks, from 1; on one rank a body's key is its number. 0: no body.
class BodyGroups {
 public:
  using Key = std::int64_t;

  BodyGroups(BedState& bed, const StoredSearch& stored, const GranuleMasses& masses)
      : bed_(bed), stored_(stored), masses_(masses), trees_(bed.ranks) {
    if (bed.ranks.count > 1) bed_.solid.begin_reviews();
  }

  // --- local
  Key key_of(int body) const;
  Key key_of_atom(int i) const;  ///< owned or ghost, after share(); 0: exterior
  /// Key of the body of an interface ghost; nullptr: the ghost is no interface granule, or its tag no ghost.
  const Key* ghost(std::int64_t tag) const { return ghost_key_.find(tag); }
  /// Place among this rank's parts of bodies that span ranks; -1: all of it is here.
  int spanning(int body) const { return trees_.place_of(body); }
  bool spans(int body) const { return spanning(body) >= 0; }
  std::size_t spanning_parts() const { return trees_.parts().size(); }
  /// The body of such a part, by its number here; nullptr where nothing is left of it since bodies were settled.
  int body_of_part(std::size_t place) const { return trees_.parts()[place].body; }
  const SolidBody* part(std::size_t place) const {
    const auto& all = bed_.solid.bodies().bodies();
    const auto found = all.find(body_of_part(place));
    return found == all.end() ? nullptr : &found->second;
  }
  /// So that each body over all ranks is counted once.
  bool has_key_of_first_part(int body) const { return key_of(body) == trees_.own_key(body); }

  void forget_ghosts() { ghost_key_.clear(); }  ///< nothing is culled on any rank
  /// Bodies that are on this rank alone have the motion of their granules; what is tied to other ranks waits for settle().
  void settle_those_here();

  // --- among the ranks of each body that spans some
  /// See RankTrees::unite: a row for each of this rank's parts.
  template <class Row, class Unite, class... TakesPart>
  void unite(std::vector<Row>& rows, Unite unite, TakesPart... takes_part) const {
    trees_.unite(rows, unite, takes_part...);
  }

  /// The same after a look has grounded some: `changed`, some here; `over_ranks`, which of this rank's parts.
  void settle_grounded(bool changed, const std::vector<char>& over_ranks);

  // --- collective
  /// Which parts are one body: those that contacts across ranks tie together.
  void group();
  /// group(), and the motion of each body that has changed follows from that of its parts.
  void settle();
  /// Ghosts learn their bodies.
  void share();

  void release_memory();

 private:
  void tell_links(std::map<int, std::vector<PartLink>>& links, const std::vector<int>& ranks) const;
  template <class TakesPart>
  void settle_those_over_ranks(TakesPart takes_part);

  BedState& bed_;
  const StoredSearch& stored_;
  const GranuleMasses& masses_;
  RankTrees trees_;
  FlatMap<Key> ghost_key_;  // tag -> key of the body of an interface ghost
};

}  // namespace solidcull
