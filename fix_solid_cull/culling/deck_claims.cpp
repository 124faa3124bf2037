#include "deck_claims.h"

namespace solidcull {

int DeckClaims::wake_claimed() {
  std::vector<Vec3> asking;
  Atoms& atoms = ports_.atoms;
  for (int i = 0; i < atoms.owned; ++i)
    if (shell_.locked(i) && !atoms.may_be_culled(i)) asking.push_back(atoms.place(i));
  int groups_of_stored = 0;
  solid_.store().for_each_record([&](const StoredGranule& g, const std::vector<double>& record, bool) {
    const int groups = atoms.groups_of(record, g.layout);
    groups_of_stored |= groups;
    if (!atoms.groups_may_be_culled(groups)) asking.push_back(solid_.bodies().pose(g.body).to_world(g.position));
  });
  wake_.ask_many(ports_.ranks, asking, scales_.wake_up(), solid_.locked());
  return groups_of_stored;
}

}  // namespace solidcull
