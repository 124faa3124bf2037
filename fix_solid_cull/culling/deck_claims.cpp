#include "deck_claims.h"

namespace solidcull {

int DeckClaims::wake_claimed() {
  std::vector<Vec3> asking;
  Atoms& atoms = bed_.atoms;
  for (int i = 0; i < atoms.owned; ++i)
    if (bed_.shell.locked(i) && !atoms.may_be_culled(i, bed_.shell[i].clump)) asking.push_back(atoms.place(i));
  int groups_of_stored = 0;
  bed_.solid.store().for_each_record([&](const StoredGranule& g, const std::vector<double>& record, bool) {
    const int groups = atoms.groups_of(record, g.layout);
    groups_of_stored |= groups;
    if (!atoms.groups_may_be_culled(groups, g.clump)) asking.push_back(bed_.solid.bodies().pose(g.body).to_world(g.position));
  });
  bed_.wake.ask_many(bed_.ranks, asking, bed_.scales.wake_up(), bed_.solid.locked());
  return groups_of_stored;
}

}  // namespace solidcull
