// The closed shell (theory.md#closed-shell; invariant I1): what exterior granules, other bodies or walls come near to becomes an
// atom again.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "bed.h"
#include "per_granule.h"
#include "sphere_cells.h"
#include "store_exchange.h"

namespace solidcull {

/// When an exterior granule was far enough from what is stored.
struct Cleared {
  int version = never;     ///< of what stands in the store
  float way = 0;           ///< that it may go before it can be near (m)
  Vec3 at = Vec3::Zero();  ///< where it was then (m)
  static constexpr int never = -1;
  static constexpr int made = -2;  ///< since the last membership change: it may be anywhere

  static constexpr int packed_size = 0;  // is found again
  void pack(double*) const {}
  static Cleared unpack(const double*) { return {}; }
};

/// Keeps what it knows of who is far from what is stored, so that most of it is not asked again. Writes Cleared.
class ShellClosure : public BodyFollower {
 public:
  /// An exterior granule or one of a shell, as stored granules of other bodies see it.
  struct Foreign {
    Sphere sphere;
    BodyGroups::Key body;  // 0: exterior
    bool stands;           // the body does, and what is stored of it
  };

  ShellClosure(Bed& bed, StoreExchange& exchange) : bed_(bed), exchange_(exchange) {}

  PerGranule<Cleared>& rows() { return rows_; }
  void unlocked(int i) { rows_[i].version = Cleared::never; }

  // --- granules that were made since the last membership change
  void was_made(int i) {  ///< local
    rows_[i].version = Cleared::made;
    some_made_ = true;
  }
  struct Overlapped {
    std::int64_t in_stored = 0;  ///< tag of a new granule that overlaps a stored one; 0: none does. On all ranks
    bool some = false;           ///< a new one overlaps a culled one, on any rank
    std::vector<Vec3> places;    ///< of the culled granules of this rank that new ones overlap
  };
  bool some_made() const { return some_made_; }  ///< on this rank. Local
  /// Where some were made, on any rank. Collective.
  Overlapped by_new_granules() const;
  void forget_new();  ///< local

  /// A run begins: walls may be others, and stored granules at them are atoms until they are seen to rest.
  void begin_run(bool other_walls) { new_run_ = walls_unfelt_ = other_walls; }
  void end_setup() { new_run_ = false; }
  bool walls_are_new() const { return new_run_; }
  /// Whether what came out for that has not felt its walls yet: it is about to.
  bool take_walls_unfelt() { return std::exchange(walls_unfelt_, false); }

  /// Ranks tell each other what they have that is exterior, or the shell of another body. Collective.
  void share();
  /// Whatever comes near stored granules makes them atoms; so does an insertion at this step or the next. Returns how many came
  /// back. Local, after share().
  std::size_t fetch_what_is_near();
  /// What would leave the box becomes an atom, and the engine does with it what it does with any that leaves. Local.
  std::size_t fetch_from_outside();
  // --- what may be near stored granules, local
  /// A nearer one brings what is stored out; what goes to the store must be farther from all, so that it does not flap (skins).
  static constexpr double store_gap_in_skins = 2.5;
  /// Walls are looked at again when a body has moved by the first; what is nearer to them than the second becomes an atom
  /// (skins).
  static constexpr double wall_check_in_skins = 0.25, wall_gap_in_skins = 1.5;
  /// Atom i of this rank.
  Foreign as_foreign(int i) const;
  /// Other ranks' and periodic images', of the last share().
  const std::vector<Foreign>& foreign() const { return foreign_; }
  /// Where everything is to be an atom, whatever is near: `gap` wider than it must be (m).
  std::vector<Box> opened(double gap) const;

  void merged(int gone, int kept, bool same_frame) override;
  void grounded_or_let_go(int body) override { seen_walls_.erase(body); }
  void left_shared_grid(int body) override { seen_walls_.erase(body); }
  void forgotten(int body) override { seen_walls_.erase(body); }

  void release_memory();

 private:
  struct Visitor {
    Foreign who;
    int atom;        // an exterior granule of this rank, else -1
    bool clear;      // of what is stored in frames that stand
    double nearest;  // of what is stored there and stays: between surfaces, up to the gap (m)
  };
  struct Frame;
  class Frames;
  struct SeenWalls {
    Pose pose;                  // of the body, against still walls
    std::vector<Vec3> corners;  // of triangles that can move, seen from the body
  };

  bool is_clear(int i) const;
  std::size_t fetch(std::vector<std::int64_t> tags);
  std::vector<Visitor> visitors(const Frames& frames) const;
  void find_near_granules(std::set<std::int64_t>& near);
  void find_near_walls(std::set<std::int64_t>& near);
  void find_near_primitives(const std::vector<int>& frames, std::set<std::int64_t>& near) const;

  Bed& bed_;
  StoreExchange& exchange_;

  PerGranule<Cleared> rows_;
  std::vector<Foreign> foreign_;
  std::map<int, SeenWalls> seen_walls_;  // when frames of the store were last compared with walls
  bool some_made_ = false;               // on this rank
  bool new_run_ = false, walls_unfelt_ = false;
};

}  // namespace solidcull
