// The interface mesh: the implicit surface around one solid body (theory.md#interface-mesh; paper, "interface surfaces").
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "pose.h"
#include "sphere.h"

namespace solidcull {

/// A triangle mesh: vertices in m, world frame; triangles are vertex indices, wound so that normals point out of the solid.
struct TriangleMesh {
  std::vector<Vec3> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// The triangles whose middle is wanted (m, world frame), and the vertices that they have. Local.
TriangleMesh part_of(const TriangleMesh& mesh, const std::function<bool(const Vec3& middle)>& wanted);

/// A level set around the granules of a solid body, negative inside, closed over the pores between granules. It is kept: where
/// granules come and go it is made anew, and nowhere else, and is then what it would be if it were made at once.
/// The mesh stands in the frame of its body: granules are given in that frame, what is asked in the world's, through the pose
/// (the identity until set_pose). Lengths in m. Every member is local to the calling rank. Not thread-safe.
class InterfaceMesh {
 public:
  /// voxel: edge of a voxel (> 0). closing: pores into which a ball of this radius does not fit are filled (>= 0).
  /// Throws std::invalid_argument for a voxel that is not positive and finite, or a negative closing.
  InterfaceMesh(double voxel, double closing);
  ~InterfaceMesh();
  InterfaceMesh(InterfaceMesh&&) noexcept;
  InterfaceMesh& operator=(InterfaceMesh&&) noexcept;
  /// Around these spheres, once, in the world's frame (m). Small ones are held as by update().
  static InterfaceMesh around(std::vector<Sphere> spheres, double voxel, double closing);
  /// The same surface; its upkeep begins anew.
  InterfaceMesh copy() const;
  /// The same of what lies in a box around this one (m, world frame), as if nothing were inside beyond it.
  InterfaceMesh within(const Vec3& lo, const Vec3& hi) const;
  InterfaceMesh(const InterfaceMesh&) = delete;
  InterfaceMesh& operator=(const InterfaceMesh&) = delete;

  // --- upkeep (frame of the body)
  /// Calls visit with every granule of the body whose centre is in the box; with others, too, if it likes.
  using Gather = std::function<void(const Vec3& lo, const Vec3& hi, const std::function<void(const Sphere&)>& visit)>;

  /// A granule of the body came or went here. Throws std::invalid_argument for what is no sphere. At first all is to be made.
  void touch(const Sphere& granule);
  /// Makes anew what was touched. largest_radius: no granule of the body has a larger one. No sphere is dropped for being small
  /// against the voxel: below 0.9 voxels it is held with a radius of 0.9 voxels.
  void update(const Gather& granules, double largest_radius);
  /// After update(): these granules are not in the body and lie outside its surface, though pores around them be closed. Where
  /// they overlap with granules of the body, those go first. Those that were left out before, and are not given, are not any
  /// more.
  void leave_out(std::vector<Sphere> exterior, const Gather& granules, double largest_radius);

  /// Where the body is now. Costs nothing: the mesh rides along.
  void set_pose(const Pose& pose);
  const Pose& pose() const;

  /// CSG union with the other body's surface, where it is now: one that stands in another frame is resampled. The other one is
  /// left empty. The next update() makes all of this one anew. Throws std::invalid_argument if its voxel differs.
  void merge(InterfaceMesh&& other);

  /// Corners of a box around the grid, in the frame of the body: beyond it all is far outside. False if there is nothing.
  bool grid_box(Vec3& lo, Vec3& hi) const;

  bool empty() const;                ///< nothing inside
  bool inside(const Vec3& p) const;  ///< level set negative at p; world frame, as all questions
  /// Level set value at p (m, negative inside), trilinear; clamped to +-(half width) away from the surface.
  double signed_distance(const Vec3& p) const;
  /// Unit outward normal of the level set at p (gradient); zero vector where the field is flat.
  Vec3 normal(const Vec3& p) const;
  /// Corners of an axis-aligned box around all that is inside (exact unless the body is turned); both zero if empty.
  void bounds(Vec3& lo, Vec3& hi) const;
  double volume() const;      ///< enclosed volume in m^3; of a ball of 10 voxels to 0.1 %
  double half_width() const;  ///< |signed_distance| saturates here (m)
  /// Granules whose surface is farther than this from a place (m) do not matter to what is there.
  static double context(double voxel, double closing);

  /// The surface as triangles. adaptivity 0..1 merges flat parts (OpenVDB volumeToMesh).
  TriangleMesh triangles(double adaptivity = 0.0) const;

  /// The grid as bytes (OpenVDB stream) for sending to another rank or into a restart file; from_bytes is the inverse, and
  /// throws std::runtime_error for bytes that are no mesh or have another voxel.
  std::string to_bytes() const;
  static InterfaceMesh from_bytes(const std::string& bytes, double voxel, double closing);

  std::size_t passes() const;  ///< how often an answer has cost a pass over the whole grid
  std::size_t active_voxels() const;
  std::size_t memory_bytes() const;

 private:
  friend void write_vdb(const std::string&, const std::vector<const InterfaceMesh*>&, const std::vector<std::string>&);
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Threads that geometry may use on this rank (OpenVDB runs on TBB). Default: all cores. Call once per process.
void set_geometry_threads(int n);

}  // namespace solidcull
