// Every now and then, patches of what sleeps near what is awake are woken and run along: what they do until they would have
// woken anyway, their body would not have done. What culling misses, measured in the run itself (theory.md#audit).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "audit_tally.h"
#include "bed.h"
#include "body_motion.h"
#include "flat_map.h"
#include "survey.h"
#include "wall_survey.h"

namespace solidcull {

/// One audit at a time, of so many looks; its granules stay awake until it ends. Collective, unless a function says otherwise.
class Audit {
 public:
  Audit(Bed& bed, const BodyMotion& motion, const WallSurvey& walls, Survey& survey)
      : bed_(bed), motion_(motion), walls_(walls), survey_(survey) {}

  /// An audit that the run before left is none: the deck may have moved anything. Local.
  void begin_run();
  /// At each look, after it has chosen: an audit ends, or begins.
  void see_look();
  /// The engine has built neighbour lists. Local.
  void note_new_lists() { listed_ = false; }
  /// In each step, after its forces.
  void see_forces();
  /// What else wakes now. Local, and alike on all ranks where all does.
  void see_wakes(const Wakes& wakes);

  const AuditTally& tally() const { return tally_; }
  /// Of an audit. Local.
  int steps() const { return looks * bed_.scales.look_every(); }

 private:
  static constexpr int looks = 6;             // in which a granule without support falls by d/20
  static constexpr double patch_reach = 3.5;  // d: some two hundred granules, of which a part sleeps

  struct Centre {
    std::uint64_t lot;
    Triple at;
    std::int64_t tag;
  };
  /// A granule that was woken. If it would have woken by now without that, it has ended.
  struct Woken {
    std::int64_t tag;
    int patch;
    int atom;                       // while lists are the same
    bool deep, ended;               // deep: it touched nothing that was awake
    double tolerance;               // N
    double load;                    // what its contacts pressed with at first (N)
    AuditedPatch did;               // it alone, until it ended
    Vec3 carried = Vec3::Zero();    // velocity of its body there (m/s)
    Vec3 felt_then = Vec3::Zero();  // from what is awake without this, at first (N)
  };
  struct Pair {
    int i, k, j;                // atom, partner of its row, that partner
    std::ptrdiff_t one, other;  // numbers of them in woken_, none where they are no such
  };
  static constexpr std::ptrdiff_t none = -1;

  bool wanted() const { return bed_.scales.settings().audit_every > 0; }
  bool runs() const { return !balls_.empty(); }
  double reach() const;
  std::vector<Centre> draw_centres() const;
  void begin();
  void meet_woken();
  void list_pairs();
  std::vector<double> pressing() const;
  std::vector<Vec3> felt() const;
  void end_around(const std::vector<Ball>& balls);
  bool rests(const ActiveBody& b, const Vec3& there) const;
  double way(const Woken& w) const;
  void take_leave(Woken& w, double load) const;
  void end();
  void stop();

  Bed& bed_;
  const BodyMotion& motion_;
  const WallSurvey& walls_;
  Survey& survey_;
  AuditTally tally_;
  std::vector<Ball> balls_;  // the patches
  std::vector<Woken> woken_;
  FlatMap<std::ptrdiff_t> number_of_;  // in woken_, by tag; `none` of those on other ranks
  std::vector<Pair> pairs_;            // of which one was woken
  bool listed_ = false;
  std::int64_t began_ = 0, next_ = 0;
};

}  // namespace solidcull
