// Interface granules become interior and come back: out of the engine into the store, and the other way.
#pragma once

#include <cstdint>
#include <vector>

#include "bed.h"

namespace solidcull {

/// Whoever knows something of an interface granule follows it into the store and out again. Local.
class StoreFollower {
 public:
  virtual ~StoreFollower() = default;
  /// Interface granule i is about to go: how many walls it touches, and the loads of walls that it bears.
  virtual void goes(int /*i*/, int& /*walls*/, std::vector<WallLoad>& /*loads*/) {}
  /// It has come back as atom i, at this place of the world (m).
  virtual void came_back(int /*i*/, const StoredGranule& /*g*/, const Vec3& /*x*/) {}
};

/// Only while membership changes: atoms take other indices, which the index of tags follows. Local.
class StoreExchange {
 public:
  explicit StoreExchange(Bed& bed) : bed_(bed) {}
  void followed_by(StoreFollower& follower) { followers_.push_back(&follower); }

  /// Interface granule i goes to the store; the last owned atom takes its index.
  void put_away(int i);
  /// All of these, which stand from the last atom to the first.
  std::size_t put_away(const std::vector<int>& atoms);
  /// The granule is an interface granule again, where its body is; returns its index.
  int bring_back(std::int64_t tag);
  /// Spheres of clumps that have come back together, all of each: they are in one periodic image.
  void join_images(const std::vector<std::int64_t>& tags) const;
  /// So many numbers of the record of a granule that has a clump's mass, the last ones, are of the clump.
  static std::size_t numbers_of_clump(const std::vector<double>& record) {
    return clump_motion + static_cast<std::size_t>(record.back()) + 1;
  }
  /// The clump that a stored granule has in its record, in the frame of its body.
  static Clump clump_of(const std::vector<double>& record, const StoredGranule& g);
  /// All engine groups, as bits, that a granule that went in is in; of what came out again too, until they are counted anew.
  /// Local.
  int stored_groups() const { return stored_groups_; }
  void set_stored_groups(int groups) { stored_groups_ = groups; }
  /// Before granules of the store are asked where they are: the motions that they went in with hold for that step alone, and are
  /// forgotten once it is over. Returns bytes that were freed.
  std::size_t forget_past_motions();

  // lock_step in a compact store, and in one of no places, which need to know no more
  static constexpr std::int64_t locked_long_ago = -1, locked_as_it_was_stored = -2;

 private:
  static constexpr std::int64_t never = -1;
  static constexpr std::size_t clump_motion = 6;  // numbers

  static void add_clump(const Clump& c, std::vector<double>& record);

  Bed& bed_;
  std::vector<StoreFollower*> followers_;
  int stored_groups_ = 0;
  std::int64_t stored_at_ = never;  // step in which granules last went into the store
  std::vector<int> motion_words_;   // of a record: what is of no worth once that step has passed
};

}  // namespace solidcull
