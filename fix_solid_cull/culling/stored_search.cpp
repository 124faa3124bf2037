#include "stored_search.h"

#include <algorithm>

namespace solidcull {

double contact_reach(const BedState& bed) {
  double largest = 0;
  for (int i = 0; i < bed.atoms.owned; ++i) largest = std::max(largest, bed.atoms.radius[i]);
  if (bed.solid.has_store()) largest = std::max(largest, bed.solid.store().largest_radius());
  bed.ranks.largest(&largest, 1);
  return 2 * largest + bed.run.skin;
}

}  // namespace solidcull
