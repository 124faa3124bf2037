// The level set of a closed union of spheres, as a grid of OpenVDB (theory.md#interface-mesh). Inside the geometry only: nothing
// else sees OpenVDB.
#pragma once

#include <openvdb/openvdb.h>

#include <vector>

#include "pose.h"
#include "sphere.h"

namespace solidcull::level_set {

constexpr double half_band = 3.0;  ///< half width of the narrow band, in voxels

/// A sphere of more than half a voxel's diagonal holds a voxel centre wherever it lies; smaller ones could vanish from the grid.
constexpr double smallest_radius = 0.9;  // voxels

/// Makes OpenVDB ready; may be called again.
void start();
/// Empty, in the frame of the body.
openvdb::FloatGrid::Ptr nothing(double voxel);
/// The union of these spheres, closed over the pores into which a ball of radius `closing` does not fit; cavities stay open.
/// A sphere below `smallest_radius` is held with that radius. voxel, closing: m.
openvdb::FloatGrid::Ptr closed_union(std::vector<Sphere> spheres, double closing, double voxel);
/// How far from its surface a sphere changes the level set of closed_union() (m).
inline double reach(double closing, double voxel) { return 2.0 * closing + half_band * voxel; }
/// Spheres that are farther than this from a place do not matter to what is right there; the grid may be wrong beside it (m).
inline double context(double closing, double voxel) { return 2.0 * closing + (half_band + 1.0) * voxel; }

/// What of it lies in the box.
openvdb::FloatGrid::Ptr part(const openvdb::FloatGrid& grid, const openvdb::CoordBBox& box);

/// Voxels of the body's frame seen from the world.
openvdb::math::Transform::Ptr transform(double voxel, const Pose& pose);

}  // namespace solidcull::level_set
