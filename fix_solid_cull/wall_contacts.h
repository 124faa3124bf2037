// Walls and meshes of `fix wall/gran`, asked which granules they touch.
#pragma once

#include <string>
#include <vector>

#include "pointers.h"
#include "sphere.h"

namespace LAMMPS_NS {
class FixWallGran;
class TriMesh;
}  // namespace LAMMPS_NS

namespace solidcull {

/// An owned granule within the skin of a wall. Lengths in m, world frame.
struct WallContact {
  int granule;   ///< index of the owned atom
  Vec3 to_wall;  ///< from the granule's centre to the nearest point of the wall
  double gap;    ///< surface to wall; negative: overlap
  bool moving;   ///< the wall can move
};

/// Local to the rank.
class WallContacts : protected LAMMPS_NS::Pointers {
 public:
  explicit WallContacts(LAMMPS_NS::LAMMPS* lmp) : Pointers(lmp) {}

  /// Finds the deck's walls again; they come and go between runs.
  void connect();

  /// All granules near a wall. Valid while neighbour lists are.
  std::vector<WallContact> find() const;

  struct Box {
    Vec3 lo, hi;
  };
  struct Triangle {
    LAMMPS_NS::TriMesh* mesh;
    int index;
    Vec3 corner[3];
    Box box;      ///< around its corners
    bool moving;  ///< the mesh can move
  };
  /// Each triangle of a mesh wall on this rank.
  std::vector<Triangle> triangles() const;
  /// A sphere that is no atom: is it closer than `gap` to the triangle, or to any primitive wall?
  bool near(const Triangle& t, const Sphere& s, double gap) const;
  bool primitive_near(const Sphere& s, double gap) const;

  /// IDs of the walls and their meshes, sorted: to see that one has gone.
  std::vector<std::string> names() const;

 private:
  std::vector<LAMMPS_NS::FixWallGran*> walls_;
};

}  // namespace solidcull
