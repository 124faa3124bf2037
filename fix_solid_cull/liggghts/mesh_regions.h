// Which regions of the deck are interface meshes, or made of some, and who may not be given one.
#pragma once

#include <string>

namespace LAMMPS_NS {
class LAMMPS;
}

namespace solidcull {

/// The newest region of the deck was made by this line. Local, alike on all ranks, as all here.
void region_was_made(LAMMPS_NS::LAMMPS* lmp, int narg, const char* const* arg);
/// Whether the deck has a region interface/mesh.
bool has_interface_mesh(LAMMPS_NS::LAMMPS* lmp);

/// Why a fix, or a command, may not be given such a region; empty where it may. They ask for points that are not on their own
/// rank, where the region is not known, take its volume once and for all, or keep their group out of solid bodies.
std::string why_no_interface_mesh_for_fix(LAMMPS_NS::LAMMPS* lmp, int narg, const char* const* arg);
std::string why_no_interface_mesh_for_command(LAMMPS_NS::LAMMPS* lmp, const std::string& command, int narg,
                                              const char* const* arg);

}  // namespace solidcull
