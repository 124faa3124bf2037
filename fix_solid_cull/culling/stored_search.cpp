#include "stored_search.h"

#include <algorithm>

namespace solidcull {

double largest_radius_here(const BedState& bed) {
  double largest = 0;
  for (int i = 0; i < bed.atoms.owned; ++i) largest = std::max(largest, bed.atoms.radius[i]);
  for (const double r : bed.solid.largest_radius_by_type()) largest = std::max(largest, r);
  return bed.solid.has_store() ? std::max(largest, bed.solid.store().largest_radius()) : largest;
}

}  // namespace solidcull
