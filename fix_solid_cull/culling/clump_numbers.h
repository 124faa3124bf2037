// A clump as numbers, for other ranks, stores and files.
#pragma once

#include <cstddef>
#include <vector>

#include "ports.h"

namespace solidcull {

/// So many, and those of `rest`, which come last.
constexpr int clump_numbers = 19;
/// Appends them.
void pack(const Clump& clump, std::vector<double>& to);
Clump unpack_clump(const double* from, std::size_t rest_size);

}  // namespace solidcull
