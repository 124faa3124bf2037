// Surfaces of bodies over several ranks, for files: each rank has what lies in its own subdomain, so that none has all of it.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <vector>

#include "box.h"
#include "interface_mesh.h"
#include "ports.h"

namespace solidcull {

/// Surfaces by the number of their body, which is the same on all ranks. Of a body over several ranks each has one, in the
/// world's frame, of its own granules alone, to which that of others can be joined.
class SurfaceParts {
 public:
  struct Surface {
    const InterfaceMesh* mesh = nullptr;
    std::int64_t granules = 0;  ///< of the body
  };

  /// voxel, closing: of all meshes (m).
  SurfaceParts(const Run& run, const Ranks& ranks, double voxel, double closing)
      : run_(run), ranks_(ranks), voxel_(voxel), closing_(closing) {}

  /// A body that is on this rank alone. The mesh must stay. Local.
  void add_whole(std::int64_t number, const InterfaceMesh& mesh, std::int64_t granules);
  /// A body, or a part of one, of which other ranks may have parts, too. Local.
  void add_part(std::int64_t number, InterfaceMesh mesh, std::int64_t granules);
  /// Bodies of fewer granules, those of all ranks counted, are left out. Collective.
  void leave_out_below(std::int64_t granules);

  /// All are one, in the world's frame, as a part of number 0. Local.
  void make_one();

  /// Each surface is as all ranks together have it, in this rank's subdomain and a little around. Surfaces of other ranks' bodies
  /// that reach there come to them. Collective.
  void join_here();
  /// Rank 0 has all surfaces whole, the others have none. Collective.
  void join_on_root();
  const std::map<std::int64_t, Surface>& surfaces() const { return surfaces_; }
  /// After join_here(), of one of these: the triangles of all ranks are the whole surface, each once. Local.
  TriangleMesh triangles(const InterfaceMesh& mesh) const;

 private:
  struct Head {
    std::int64_t number, granules;
    std::size_t bytes;
  };
  double margin() const { return 6 * voxel_; }
  void reached(const InterfaceMesh& mesh, const std::function<void(int rank, const Box& there)>& visit) const;
  void receive(const std::vector<Head>& heads, const char* bytes);

  const Run& run_;
  const Ranks& ranks_;
  double voxel_, closing_;
  std::map<std::int64_t, Surface> surfaces_;
  std::map<std::int64_t, InterfaceMesh> joined_;  // those that are of several parts, or could be
};

}  // namespace solidcull
