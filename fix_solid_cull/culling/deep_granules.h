// Interface granules that nothing is near any more go to the store (theory.md#closed-shell).
#pragma once

#include <cstddef>
#include <functional>
#include <utility>
#include <vector>

#include "bed.h"
#include "shell_closure.h"
#include "wall_survey.h"

namespace solidcull {

/// Finds them: what a change has just locked, what a look asks for, and what is left over now and then.
class DeepGranules {
 public:
  /// Whether something would be near atom i if it was there, in the world.
  using Near = std::function<bool(int i, const Sphere& there)>;
  /// Takes what may go, from the last atom to the first; returns how many went.
  using PutAway = std::function<std::size_t(const std::vector<int>& atoms, const Near& near)>;

  DeepGranules(const Bed& bed, const WallSurvey& walls, const ShellClosure& closure)
      : bed_(bed), walls_(walls), closure_(closure) {}

  /// At a look: whether so many interface granules might go that it is worth a rebuild. Local.
  bool ask_to_store(const std::vector<int>& interface_atoms);
  bool asked() const { return asked_; }
  struct Occasion {
    bool locked_now;          ///< something was locked in this change
    bool asked;               ///< some rank has asked_to_store()
    bool membership_changes;  ///< atoms come and go for other reasons too; else a few wait for more
    std::int64_t highest;     ///< tag of an atom on any rank
  };
  /// A stored sphere of a clump, and the rank that stores the others.
  struct AwayFromHome {
    std::int64_t tag;
    int rank;
  };
  /// Those that went since the last time. Local.
  std::vector<AwayFromHome> take_away_from_home() { return std::exchange(away_from_home_, {}); }
  /// Returns how many went. Local, after ShellClosure::share(); where there are clumps, collective.
  std::size_t store(const Occasion& now, const PutAway& put_away);

 private:
  class Surroundings;

  bool looks_for_some(const Occasion& now);
  bool may_leave_its_walls(int i) const;
  void leave_out_parts_of_clumps(std::vector<int>& atoms);
  void leave_out_near_meshes(std::vector<int>& atoms) const;

  const Bed& bed_;
  const WallSurvey& walls_;
  const ShellClosure& closure_;
  std::vector<AwayFromHome> away_from_home_;
  bool asked_ = false;              // a look saw interface granules that nothing holds any more
  int builds_without_storing_ = 0;  // since they were last looked for
  std::size_t stay_near_ = 0;       // interface granules that stayed atoms the last time because something is near
};

}  // namespace solidcull
