// Bodies that walls hold: they stand still, so that their granules at walls may go to the store too, and hand on to the walls
// what presses on them (theory.md#grounding, theory.md#wall-loads).
#pragma once

#include <set>
#include <vector>

#include "bed.h"
#include "body_motion.h"
#include "store_exchange.h"
#include "wall_survey.h"

namespace solidcull {

/// Which bodies stand on walls, for how long, and what they hand on to them.
class Grounding : public StoreFollower {
 public:
  Grounding(Bed& bed, const BodyMotion& motion, const WallSurvey& walls) : bed_(bed), motion_(motion), walls_(walls) {}

  /// At each look: bodies at rest at walls that stand still are grounded; those that the walls might not hold any more wait to be
  /// let go. Which bodies over several ranks were grounded, by BodyGroups::spanning(). Among the ranks of each of these.
  std::vector<char> update();
  /// Which elements bear what presses on a body: those that bear the body. Each look ends with it. Among the ranks of
  /// each body.
  void share_out_loads();
  /// Bodies that were to be let go are. When their granules at walls can come back. Local.
  void let_go();
  bool lets_go() const { return !to_let_go_.empty(); }
  /// In each step: walls feel what stored granules press on them. Local.
  void press_on_walls();
  /// What walls do to an interface granule that nothing else touches: what meshes that report their load do to it, and the rest.
  /// Local.
  std::vector<WallLoad> wall_loads_on(int i) const;
  void goes(int i, int& walls, std::vector<WallLoad>& loads) override;

 private:
  std::vector<char> held_over_ranks() const;
  bool may_be_let_go(const SolidBody& body, bool held) const;
  bool is_at_rest(const SolidBody& body, const ActiveBody& loads, const int* only_atom) const;

  Bed& bed_;
  const BodyMotion& motion_;
  const WallSurvey& walls_;
  std::set<int> to_let_go_;  // grounded bodies that the walls might not hold any more
};

}  // namespace solidcull
