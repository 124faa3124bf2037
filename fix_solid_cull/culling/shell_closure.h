// The closed shell (theory.md#closed-shell; invariant I1), both ways: what exterior granules, other bodies or walls come near to
// becomes an atom again, and shell granules that nothing is near any more go to the store.
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
#include "wall_survey.h"

namespace solidcull {

/// When nothing stored was near an exterior granule.
struct Cleared {
  int version = never;     ///< of what stands in the store
  bool made = false;       ///< since the last membership change: it may be anywhere
  Vec3 at = Vec3::Zero();  ///< where it was then (m)
  static constexpr int never = -1;

  static constexpr int packed_size = 0;  // is found again
  void pack(double*) const {}
  static Cleared unpack(const double*) { return {}; }
};

/// Keeps what it knows of who is far from what is stored, so that most of it is not asked again. Writes Cleared.
class ShellClosure : public BodyFollower {
 public:
  ShellClosure(Bed& bed, const WallSurvey& walls, StoreExchange& exchange) : bed_(bed), walls_(walls), exchange_(exchange) {}

  PerGranule<Cleared>& rows() { return rows_; }
  void unlocked(int i) { rows_[i].version = Cleared::never; }

  // --- granules that were made since the last membership change
  void was_made(int i) { rows_[i].made = some_made_ = true; }  ///< local
  struct Overlapped {
    std::int64_t in_stored = 0;  ///< tag of a new granule that overlaps a stored one; 0: none does. On all ranks
    std::vector<Vec3> places;    ///< of the culled granules of this rank that new ones overlap
  };
  /// Collective.
  Overlapped by_new_granules() const;
  void forget_new();  ///< local

  /// A run begins: walls may be others, and stored granules at them are atoms until they are seen to rest.
  void begin_run(bool other_walls) { new_run_ = walls_unfelt_ = other_walls; }
  void end_setup() { new_run_ = false; }
  /// Whether what came out for that has not felt its walls yet: it is about to.
  bool take_walls_unfelt() { return std::exchange(walls_unfelt_, false); }

  /// Ranks tell each other what they have that is exterior, or the shell of another body. Collective.
  void share();
  /// Whatever comes near stored granules makes them atoms; so does an insertion at this step or the next. Returns how many came
  /// back. Local, after share().
  std::size_t fetch_what_is_near();
  /// What would leave the box becomes an atom, and the engine does with it what it does with any that leaves. Local.
  std::size_t fetch_from_outside();
  /// What nothing is near any more goes to the store: what was just locked (`locked_now`) and what the looks ask for at once,
  /// what is left over now and then. `membership_changes`: for other reasons; else a few wait for more. Returns how many went.
  /// Collective, after share().
  std::size_t store_what_is_deep(bool locked_now, bool membership_changes);

  /// At a look: whether so many interface granules might go to the store that it is worth a rebuild. Local.
  bool ask_to_store(const std::vector<int>& interface_atoms);

  void merged(int gone, int kept, bool same_frame) override;
  void grounded_or_let_go(int body) override { seen_walls_.erase(body); }
  void left_shared_grid(int body) override { seen_walls_.erase(body); }
  void forgotten(int body) override { seen_walls_.erase(body); }

  void release_memory();

 private:
  /// An exterior granule or one of a shell, as stored granules of other bodies see it.
  struct Foreign {
    Sphere sphere;
    int body;     // key; 0: exterior
    bool stands;  // the body does
  };
  struct Visitor {
    Foreign who;
    int atom;    // an exterior granule of this rank, else -1
    bool clear;  // of what is stored in frames that stand
  };
  struct Frame;
  class Frames;
  class Surroundings;
  struct SeenWalls {
    Pose pose;                  // of the body, against still walls
    std::vector<Vec3> corners;  // of triangles that can move, seen from the body
  };

  Foreign as_foreign(int i) const;
  bool is_clear(int i) const;
  std::vector<Visitor> visitors(const Frames& frames) const;
  std::vector<Box> opened(double gap) const;
  void find_near_granules(std::set<std::int64_t>& near);
  void find_near_walls(std::set<std::int64_t>& near);
  void find_near_primitives(const std::vector<int>& frames, std::set<std::int64_t>& near) const;
  bool may_leave_its_walls(int i) const;
  void leave_out_near_meshes(std::vector<int>& atoms) const;
  std::size_t put_away_at_sites(const std::vector<int>& deep, const Surroundings& surroundings);

  Bed& bed_;
  const WallSurvey& walls_;
  StoreExchange& exchange_;

  PerGranule<Cleared> rows_;
  std::vector<Foreign> foreign_;         // other ranks' and periodic images'
  std::map<int, SeenWalls> seen_walls_;  // when frames of the store were last compared with walls
  bool some_made_ = false;               // on this rank
  bool new_run_ = false, walls_unfelt_ = false;
  bool store_asked_ = false;        // a look saw interface granules that nothing holds any more
  int builds_without_storing_ = 0;  // since they were last looked for
  std::size_t stay_near_ = 0;       // interface granules that stayed atoms the last time because something is near
};

}  // namespace solidcull
