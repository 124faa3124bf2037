// One body over ranks: parts on several ranks that touch are one rigid body (theory.md#ranks).
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <vector>

#include "flat_map.h"
#include "granule_masses.h"
#include "stored_search.h"

namespace solidcull {

/// Keys number bodies over all ranks, from 1; on one rank a body's key is its number. 0: no body.
class BodyGroups {
 public:
  BodyGroups(BedState& bed, const StoredSearch& stored, const GranuleMasses& masses)
      : bed_(bed), stored_(stored), masses_(masses) {}

  // --- local
  int key_of(int body) const;
  int key_of_atom(int i) const;  ///< owned or ghost, after share(); 0: exterior
  /// Key of the body of an interface ghost; nullptr: the ghost is no interface granule, or its tag no ghost.
  const int* ghost(std::int64_t tag) const { return ghost_key_.find(tag); }
  /// Place among the bodies that span ranks, the same on all ranks; -1: all of it is here.
  int spanning(int body) const;
  bool spans(int body) const { return spanning(body) >= 0; }
  std::size_t spanning_bodies() const { return spanning_.size(); }
  bool has_key_of_first_part(int body) const;  ///< so that each body over all ranks is counted once

  void forget_ghosts() { ghost_key_.clear(); }  ///< nothing is culled on any rank

  // --- collective
  /// Which parts are one body: those that contacts across ranks tie together.
  void group();
  /// group(), and the motion of each body that has changed follows from that of its parts.
  void settle();
  /// Ghosts learn their bodies.
  void share();

  void release_memory();

 private:
  struct Group {
    int key;     // the body's number on all ranks
    Vec3 shift;  // brings this rank's part to the image in which the whole is summed (m)
  };
  std::vector<std::int64_t> stored_at_borders() const;

  BedState& bed_;
  const StoredSearch& stored_;
  const GranuleMasses& masses_;
  std::map<int, Group> groups_;              // local body -> the body that it is a part of; empty on one rank
  std::vector<int> spanning_;                // keys of bodies that span ranks, the same on all ranks
  std::map<int, std::array<bool, 3>> tied_;  // key -> tied to its own periodic image in these directions
  FlatMap<int> ghost_key_;                   // tag -> key of the body of an interface ghost
};

}  // namespace solidcull
