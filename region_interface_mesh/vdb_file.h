// Grids of OpenVDB as a file, whole or not at all. Inside the geometry only.
#pragma once

#include <openvdb/openvdb.h>

#include <string>

namespace solidcull {

/// Throws std::runtime_error "cannot write FILE: reason"; then nothing is left behind. Local.
void write_grids(const std::string& file, const openvdb::GridCPtrVec& grids);

}  // namespace solidcull
