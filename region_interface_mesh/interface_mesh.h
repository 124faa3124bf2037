// The interface mesh: the implicit surface around one solid body (paper, section "interface surfaces"; DESIGN section 10).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
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

/// A persistent level set around the granules of a solid body, negative inside, closed over the pores between granules.
/// Additions and carvings are queued and done when a question is asked, so a run that never asks pays nothing (but for a queue of
/// four million spheres at most). The mesh depends on the order of these calls, never on when a question came between them.
/// The mesh stands in the frame of its body: what is added and carved is given in that frame, what is asked in the world's,
/// through the pose (the identity until set_pose). Lengths in m. Every member is local to the calling rank. Not thread-safe.
class InterfaceMesh {
 public:
  /// voxel: edge of a voxel (> 0). closing: pores into which a ball of this radius does not fit are filled (>= 0).
  /// Throws std::invalid_argument for a voxel that is not positive and finite, or a negative closing.
  InterfaceMesh(double voxel, double closing);
  ~InterfaceMesh();
  InterfaceMesh(InterfaceMesh&&) noexcept;
  InterfaceMesh& operator=(InterfaceMesh&&) noexcept;
  InterfaceMesh(const InterfaceMesh&) = delete;
  InterfaceMesh& operator=(const InterfaceMesh&) = delete;

  /// CSG union with the closed union of these granules (frame of the body). Pores between new granules and `context` (granules
  /// that are in the body already, near the new ones) are closed too; of the context only what lies within r + 2 closing of a new
  /// granule is added again: nothing farther away changes. Throws std::invalid_argument for what is no sphere. No sphere is
  /// dropped for being small against the voxel: below 0.9 voxels it is held with a radius of 0.9 voxels.
  void add(const std::vector<Sphere>& granules, const std::vector<Sphere>& context = {});

  /// Where the body is now. Costs nothing: the mesh rides along.
  void set_pose(const Pose& pose);
  const Pose& pose() const;

  /// CSG difference with a ball (frame of the body): what the carve law takes away.
  void carve(const Sphere& ball);

  /// CSG union with the other body's surface (bodies that merged), where it is now: one that stands in another frame is
  /// resampled. The other one is left empty and may be used again. Throws std::invalid_argument if its voxel differs.
  void merge(InterfaceMesh&& other);

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
