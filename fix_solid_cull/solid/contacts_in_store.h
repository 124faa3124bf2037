// Granules of one body that touch, or nearly so, and are both in the store, found from where they lie.
#pragma once

#include <cstdint>
#include <vector>

#include "granule_store.h"
#include "solid_bodies.h"

namespace solidcull {

/// Adds to `partners`, each once, the stored granules of the same body whose centres are within 1 + `gap` times the radii's sum
/// of that of `tag`, through periodic sides too; none if `tag` is not in the store. A body does not change its shape, so the
/// answer is the same for as long as both are stored. Costs O(neighbours). Local.
void contacts_in_store(const GranuleStore& store, const SolidBodies& bodies, std::int64_t tag, double gap,
                       std::vector<std::int64_t>& partners);
/// The same for one that need not be in the store yet.
void contacts_in_store(const GranuleStore& store, const SolidBodies& bodies, const Resident& granule, double gap,
                       std::vector<Resident>& partners);

}  // namespace solidcull
