// Numbers that tell walls of one run from those of another, in another process and on any number of ranks: sums by the bits of
// all that what is pressed on walls hangs on.
#pragma once

#include <cstdint>
#include <vector>

namespace LAMMPS_NS {
class FixWallGran;
class Modify;
class TriMesh;
}  // namespace LAMMPS_NS

namespace solidcull {

/// Of the deck's fixes property/global. On all ranks the same.
std::uint64_t sum_of_materials(LAMMPS_NS::Modify& modify);
/// Of names, types, contact models, and whether a wall moves; of primitive walls their places too. On all ranks the same.
std::uint64_t sum_of_walls(const std::vector<LAMMPS_NS::FixWallGran*>& walls);
/// Of the triangles of meshes that stand still, and of the velocities of belts: this rank's part.
std::uint64_t sum_of_triangles(const std::vector<LAMMPS_NS::TriMesh*>& meshes, int rank);

}  // namespace solidcull
