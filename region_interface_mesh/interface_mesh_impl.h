// What an interface mesh is made of. Inside the geometry only: nothing else sees OpenVDB.
#pragma once

#include <map>
#include <optional>
#include <vector>

#include "interface_mesh.h"
#include "level_set.h"

namespace solidcull {

struct InterfaceMesh::Impl {
  double voxel, closing;
  Pose pose;
  openvdb::FloatGrid::Ptr grid;  // its own transform is the voxel's scale alone: the body's frame

  Impl(double voxel, double closing);

  // --- questions
  struct Box {
    Vec3 lo, hi;
  };
  // answers that cost a pass over the grid, kept until it changes
  std::optional<Box> box;
  std::optional<double> enclosed;
  std::optional<bool> holds_nothing;
  std::size_t passes = 0;

  void grid_has_changed();
  void is_united();
  double value_at(const openvdb::Vec3d& voxel_position) const;
  openvdb::Vec3d in_voxels(const Vec3& p) const { return openvdb::Vec3d(p.x(), p.y(), p.z()) / voxel; }
  const Box& bounding_box();
  bool nothing_inside();

  // --- upkeep
  using Leaf = openvdb::FloatTree::LeafNodeType;
  /// A leaf's part of the closed surface, and the spheres that it is without in the grid.
  struct Hollowed {
    Leaf closed;
    std::vector<Sphere> spheres;
  };

  bool whole = true;          // all of it is to be made
  openvdb::MaskTree touched;  // in cells, see touch()
  bool exterior_is_out = true;
  std::vector<Sphere> exterior;                 // as they were told last
  std::map<openvdb::Coord, Hollowed> hollowed;  // by a leaf's origin
  std::size_t leaves_when_pruned = 0;

  void make_touched(const Gather& granules, double largest_radius);
  void make_whole(const Gather& granules);
  void hollow_out(const Gather& granules, double largest_radius);
  std::map<openvdb::Coord, std::vector<Sphere>> spheres_by_leaf(const Gather& granules, double largest_radius) const;
  float closed_value(const openvdb::Coord& at) const;
  double closed_distance(const Vec3& p) const;
  void prune_when_due();
};

}  // namespace solidcull
