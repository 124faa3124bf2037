#include "surface_parts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

namespace solidcull {

void SurfaceParts::add_whole(std::int64_t number, const InterfaceMesh& mesh, std::int64_t granules) {
  surfaces_[number] = {&mesh, granules};
}

void SurfaceParts::add_part(std::int64_t number, InterfaceMesh mesh, std::int64_t granules) {
  InterfaceMesh& joined = joined_.try_emplace(number, voxel_, closing_).first->second;
  joined.merge(std::move(mesh));
  Surface& surface = surfaces_[number];
  surface.mesh = &joined;
  surface.granules += granules;
}

/// Each number has a rank that adds it up.
void SurfaceParts::leave_out_below(std::int64_t granules) {
  if (ranks_.count > 1) {
    struct Count {
      std::int64_t number, granules;
    };
    std::map<int, std::vector<Count>> out;
    for (const auto& [number, surface] : surfaces_)
      out[static_cast<int>(number % ranks_.count)].push_back({number, surface.granules});
    std::map<int, std::vector<Count>> asked = ranks_.deliver(out);
    std::map<std::int64_t, std::int64_t> sums;
    for (const auto& [rank, counts] : asked)
      for (const Count& c : counts) sums[c.number] += c.granules;
    for (auto& [rank, counts] : asked)
      for (Count& c : counts) c.granules = sums[c.number];
    for (const auto& [rank, counts] : ranks_.deliver(asked))
      for (const Count& c : counts) surfaces_[c.number].granules = c.granules;
  }
  for (auto s = surfaces_.begin(); s != surfaces_.end();)
    if (s->second.granules < granules) {
      joined_.erase(s->first);
      s = surfaces_.erase(s);
    } else {
      ++s;
    }
}

/// Other ranks, and where their subdomains, their periodic images too, come near the mesh.
void SurfaceParts::reached(const InterfaceMesh& mesh, const std::function<void(int rank, const Box& there)>& visit) const {
  Vec3 lo, hi;
  if (!mesh.grid_box(lo, hi)) return;
  const Pose& pose = mesh.pose();
  const Vec3 middle = pose.to_world(0.5 * (lo + hi)), half = turned_half_box(pose.turn(), 0.5 * (hi - lo));
  const Box mine = Box{middle - half, middle + half}.grown_by(margin());
  const std::array<std::vector<double>, 3> cuts = ranks_.cuts();
  const Vec3 edges = run_.edges();
  struct Cell {
    double lo, hi;
  };
  std::array<std::vector<Cell>, 3> cells;
  for (int d = 0; d < 3; ++d) {
    const bool periodic = run_.periodic[static_cast<std::size_t>(d)];
    const auto& at = cuts[static_cast<std::size_t>(d)];
    const double first = periodic ? std::floor((mine.lo[d] - run_.box.lo[d]) / edges[d]) : 0;
    const double last = periodic ? std::floor((mine.hi[d] - run_.box.lo[d]) / edges[d]) : 0;
    for (double image = first; image <= last; ++image)
      for (std::size_t c = 0; c + 1 < at.size(); ++c) {
        // beyond a side that is not periodic all belongs to the ranks at it
        Cell cell{at[c] + image * edges[d], at[c + 1] + image * edges[d]};
        if (!periodic && c == 0) cell.lo = std::min(cell.lo, mine.lo[d]);
        if (!periodic && c + 2 == at.size()) cell.hi = std::max(cell.hi, mine.hi[d]);
        if (cell.lo < mine.hi[d] && mine.lo[d] < cell.hi) cells[static_cast<std::size_t>(d)].push_back(cell);
      }
  }
  for (const Cell& x : cells[0])
    for (const Cell& y : cells[1])
      for (const Cell& z : cells[2]) {
        const Box there{Vec3(x.lo, y.lo, z.lo), Vec3(x.hi, y.hi, z.hi)};
        const int rank = ranks_.owner(run_.wrapped(0.5 * (there.lo + there.hi)));
        if (rank != ranks_.me) visit(rank, there.grown_by(margin()));
      }
}

void SurfaceParts::join_here() {
  if (ranks_.count == 1) return;
  std::map<int, std::vector<Head>> heads;
  std::map<int, std::vector<char>> bytes;
  for (const auto& s : surfaces_)
    reached(*s.second.mesh, [&, number = s.first, surface = s.second](int rank, const Box& there) {
      const InterfaceMesh near = surface.mesh->within(there.lo, there.hi);
      if (near.empty()) return;
      const std::string part = near.to_bytes();
      heads[rank].push_back({number, surface.granules, part.size()});
      bytes[rank].insert(bytes[rank].end(), part.begin(), part.end());
    });
  const auto heads_came = ranks_.deliver(heads);
  const auto bytes_came = ranks_.deliver(bytes);
  for (const auto& [rank, of_rank] : heads_came) receive(of_rank, bytes_came.at(rank).data());
}

void SurfaceParts::join_on_root() {
  if (ranks_.count == 1) return;
  std::vector<Head> heads;
  std::vector<char> bytes;
  if (ranks_.me != 0) {
    for (const auto& [number, surface] : surfaces_) {
      const std::string part = surface.mesh->to_bytes();
      heads.push_back({number, surface.granules, part.size()});
      bytes.insert(bytes.end(), part.begin(), part.end());
    }
    surfaces_.clear();
    joined_.clear();
  }
  heads = ranks_.gather_on_root(heads);
  bytes = ranks_.gather_on_root(bytes);
  receive(heads, bytes.data());
}

/// A surface that nobody else has a part of keeps its frame.
void SurfaceParts::receive(const std::vector<Head>& heads, const char* bytes) {
  for (const Head& head : heads) {
    InterfaceMesh mesh = InterfaceMesh::from_bytes(std::string(bytes, head.bytes), voxel_, closing_);
    bytes += head.bytes;
    const auto there = joined_.find(head.number);
    if (there != joined_.end())
      there->second.merge(std::move(mesh));
    else
      surfaces_[head.number] = {&joined_.emplace(head.number, std::move(mesh)).first->second, head.granules};
  }
}

void SurfaceParts::make_one() {
  InterfaceMesh one(voxel_, closing_);
  for (const auto& s : surfaces_) one.merge(s.second.mesh->copy());
  surfaces_.clear();
  joined_.clear();
  add_part(0, std::move(one), 0);
}

TriangleMesh SurfaceParts::triangles(const InterfaceMesh& mesh) const {
  if (ranks_.count == 1) return mesh.triangles();
  return part_of(mesh.triangles(), [&](const Vec3& middle) { return ranks_.owns(run_.wrapped(middle)); });
}

}  // namespace solidcull
