// Walls and meshes of `fix wall/gran`, asked which granules they touch.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pointers.h"
#include "ports.h"

namespace LAMMPS_NS {
class FixWallGran;
class TriMesh;
}  // namespace LAMMPS_NS

namespace solidcull {

/// Local to the rank.
class WallContacts : protected LAMMPS_NS::Pointers {
 public:
  explicit WallContacts(LAMMPS_NS::LAMMPS* lmp) : Pointers(lmp) {}

  /// Finds the deck's walls again; they come and go between runs.
  void connect();

  /// All granules near a wall. Valid while neighbour lists are.
  std::vector<WallContact> find() const;

  /// Each triangle of a mesh wall on this rank.
  std::vector<WallTriangle> triangles() const;
  /// A sphere that is no atom: is it closer than `gap` to the triangle, or to any primitive wall?
  bool near(const WallTriangle& t, const Sphere& s, double gap) const;
  bool primitive_near(const Sphere& s, double gap) const;

  /// IDs of the walls and their meshes, sorted: to see that one has gone.
  std::vector<std::string> names() const;
  /// See Walls.
  std::vector<double> fingerprint() const;
  std::uint64_t part_of_sum() const;
  /// A fix of this style was made: what walls are made of, or how they move, may be other.
  static void fix_was_made(const char* style);

 private:
  std::vector<LAMMPS_NS::FixWallGran*> walls_;
  std::vector<LAMMPS_NS::TriMesh*> meshes_;  // of the walls, by WallTriangle::mesh
};

}  // namespace solidcull
