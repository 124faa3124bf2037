#include "stored_search.h"

#include <algorithm>

namespace solidcull {

double contact_reach(const Ports& ports, const Solid& solid) {
  double largest = 0;
  for (int i = 0; i < ports.atoms.owned; ++i) largest = std::max(largest, ports.atoms.radius[i]);
  if (solid.has_store()) largest = std::max(largest, solid.store().largest_radius());
  ports.ranks.largest(&largest, 1);
  return 2 * largest + ports.run.skin;
}

}  // namespace solidcull
