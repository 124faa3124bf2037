// Walls and meshes of `fix wall/gran`, asked which granules they touch.
#pragma once

#include <string>
#include <vector>

#include "pointers.h"
#include "sphere.h"

namespace LAMMPS_NS {
class FixWallGran;
class TriMesh;
}

namespace solidcull {

/// An owned granule within the skin of a wall. Lengths in m, world frame.
struct WallContact {
  int granule;      ///< index of the owned atom
  Vec3 to_wall;     ///< from the granule's centre to the nearest point of the wall
  double gap;       ///< surface to wall; negative: overlap
  bool moving;      ///< the wall can move
};

/// Local to the rank.
class WallContacts : protected LAMMPS_NS::Pointers {
 public:
  explicit WallContacts(LAMMPS_NS::LAMMPS* lmp) : Pointers(lmp) {}

  /// Finds the deck's walls again; they come and go between runs.
  void connect();

  /// All granules near a wall. Valid while neighbour lists are.
  std::vector<WallContact> find() const;

  /// A sphere that is no atom: is it closer than `gap` to any wall (`moving_only`: to any that can move)? Walks all triangles:
  /// for few spheres, or give a box test first through triangle_boxes.
  bool near(const Sphere& s, double gap, bool moving_only) const;

  struct Box {
    Vec3 lo, hi;
  };
  /// Boxes around the triangles of the meshes that can move, on this rank.
  std::vector<Box> moving_triangle_boxes() const;
  /// Boxes around all triangles of the meshes on this rank.
  std::vector<Box> triangle_boxes() const;
  bool primitive_near(const Sphere& s, double gap) const;

 private:
  std::vector<Box> boxes(bool moving_only) const;
  bool mesh_near(LAMMPS_NS::TriMesh* mesh, const Sphere& s, double gap) const;

  std::vector<LAMMPS_NS::FixWallGran*> walls_;
};

}  // namespace solidcull
