// Whether the engine's grid of ranks leaves one of them nearly nothing to do.
#pragma once

#include <string>

#include "bed.h"

namespace solidcull {

/// A line for the user, where a rank has less than a fifth of the mean number of granules, stored ones too; else empty. Too few
/// granules for several ranks are no matter. The same on all ranks. Collective.
std::string uneven_ranks(const Bed& bed);

}  // namespace solidcull
