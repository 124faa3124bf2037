// Upkeep of an interface mesh: what is made anew where granules of the body come and go, and where others lie in its pores.
#include <openvdb/tools/Interpolation.h>
#include <openvdb/tools/Morphology.h>
#include <openvdb/tools/Prune.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "interface_mesh_impl.h"
#include "sphere_order.h"

namespace solidcull {
namespace {

using openvdb::Coord;
using openvdb::FloatTree;
using Leaf = FloatTree::LeafNodeType;

// what was touched is noted in cells, eight to a leaf of the grid
constexpr int cell_shift = 2, cell_edge = 1 << cell_shift;  // voxels
constexpr int cells_of_leaf = 8, all_cells = (1 << cells_of_leaf) - 1;
static_assert(Leaf::DIM == 2 * cell_edge, "a leaf has eight cells");

/// An exterior granule that reaches so far into the surface is let be: it only touches granules of the body.
constexpr double hardly = 0.1;  // voxels

/// Exterior granules are told to move when they do so by this, so that what lies still costs nothing.
constexpr double place_grain = 1.0 / 32;  // voxels

void check(const Sphere& s) {
  if (s.centre.allFinite() && std::isfinite(s.radius) && s.radius > 0) return;
  throw std::invalid_argument("InterfaceMesh: a granule at (" + std::to_string(s.centre.x()) + ", " +
                              std::to_string(s.centre.y()) + ", " + std::to_string(s.centre.z()) + ") with radius " +
                              std::to_string(s.radius) + " is no sphere");
}

/// The voxel whose centre is nearest.
Coord nearest_voxel(const Vec3& p, double voxel) {
  return Coord::round(openvdb::Vec3d(p.x() / voxel, p.y() / voxel, p.z() / voxel));
}
/// Voxel centres belong to the cell that begins at a multiple of its edge.
Coord cell_of(const Vec3& p, double voxel) { return nearest_voxel(p, voxel) >> cell_shift; }
Coord leaf_of_cell(const Coord& cell) {
  return Coord((cell.x() >> 1) * Leaf::DIM, (cell.y() >> 1) * Leaf::DIM, (cell.z() >> 1) * Leaf::DIM);
}
/// Which of a leaf's cells, as a bit.
int bit_of(const Coord& cell) { return 1 << ((cell.x() & 1) << 2 | (cell.y() & 1) << 1 | (cell.z() & 1)); }

template <class Visit>
void for_each_in(const openvdb::CoordBBox& box, Visit visit) {
  for (auto at = box.begin(); at; ++at) visit(*at);
}

bool same(const Sphere& a, const Sphere& b) { return a.centre == b.centre && a.radius == b.radius; }
bool same(const std::vector<Sphere>& a, const std::vector<Sphere>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const Sphere& x, const Sphere& y) { return same(x, y); });
}

/// On a grain, in an order that does not depend on who told them, each once.
void put_in_order(std::vector<Sphere>& spheres, double voxel) {
  const double grain = place_grain * voxel;
  for (Sphere& s : spheres) s.centre = (s.centre / grain).array().round() * grain;
  std::sort(spheres.begin(), spheres.end(), before);
  spheres.erase(std::unique(spheres.begin(), spheres.end(), [](const Sphere& a, const Sphere& b) { return same(a, b); }),
                spheres.end());
}

/// A leaf is without this sphere: the CSG difference.
void take_out_of(Leaf& leaf, const Sphere& s, double voxel, float width) {
  // in voxels, from the leaf's first centre
  const Coord origin = leaf.origin();
  const Vec3 c = s.centre / voxel - Vec3(origin.x(), origin.y(), origin.z());
  const double reach = (s.radius + width) / voxel, reach2 = reach * reach;
  int lo[3], hi[3];
  for (int d = 0; d < 3; ++d) {
    lo[d] = static_cast<int>(std::max(0.0, std::ceil(c[d] - reach)));
    hi[d] = static_cast<int>(std::min(Leaf::DIM - 1.0, std::floor(c[d] + reach)));
  }
  for (int i = lo[0]; i <= hi[0]; ++i)
    for (int j = lo[1]; j <= hi[1]; ++j) {
      const double across2 = (i - c[0]) * (i - c[0]) + (j - c[1]) * (j - c[1]);
      if (across2 >= reach2) continue;
      for (int k = lo[2]; k <= hi[2]; ++k) {
        const auto n = static_cast<openvdb::Index>((i * Leaf::DIM + j) * Leaf::DIM + k);
        const auto left = static_cast<float>(s.radius - voxel * std::sqrt(across2 + (k - c[2]) * (k - c[2])));
        if (left <= leaf.getValue(n)) continue;
        if (left < width)
          leaf.setValueOn(n, left);
        else
          leaf.setValueOff(n, width);
      }
    }
}

/// Some cells of a leaf become those of another grid.
void copy_cells(Leaf& to, const FloatTree& from, int cells) {
  const Leaf* const leaf = from.probeConstLeaf(to.origin());
  const float tile = leaf ? 0.0f : from.getValue(to.origin());
  for (openvdb::Index n = 0; n < Leaf::SIZE; ++n) {
    const Coord local = Leaf::offsetToLocalCoord(n);
    if (!(cells & bit_of(local >> cell_shift))) continue;
    if (leaf && leaf->isValueOn(n))
      to.setValueOn(n, leaf->getValue(n));
    else
      to.setValueOff(n, leaf ? leaf->getValue(n) : tile);
  }
}

}  // namespace

void InterfaceMesh::touch(const Sphere& granule) {
  check(granule);
  Impl& m = *impl_;
  if (m.whole) return;
  const double held = std::max(granule.radius, level_set::smallest_radius * m.voxel);
  const Vec3 reach = Vec3::Constant(held + level_set::reach(m.closing, m.voxel));
  const Vec3 lo = granule.centre - reach, hi = granule.centre + reach;
  openvdb::tree::ValueAccessor<openvdb::MaskTree, /*IsSafe=*/false> touched(m.touched);
  for_each_in({cell_of(lo, m.voxel), cell_of(hi, m.voxel)}, [&](const Coord& cell) { touched.setValueOn(cell); });
}

void InterfaceMesh::update(const Gather& granules, double largest_radius) {
  Impl& m = *impl_;
  if (!m.whole && m.touched.empty()) return;
  if (m.whole)
    m.make_whole(granules);
  else
    m.make_touched(granules, largest_radius);
  m.exterior_is_out = false;
  m.grid_has_changed();
  m.prune_when_due();
}

void InterfaceMesh::leave_out(std::vector<Sphere> exterior, const Gather& granules, double largest_radius) {
  for (const Sphere& s : exterior) check(s);
  Impl& m = *impl_;
  const auto is_far = [&](const Sphere& s) {
    const double width = level_set::half_band * m.voxel;
    return s.radius < width && m.closed_value(nearest_voxel(s.centre, m.voxel)) >= static_cast<float>(width);
  };
  exterior.erase(std::remove_if(exterior.begin(), exterior.end(), is_far), exterior.end());
  put_in_order(exterior, m.voxel);
  if (m.exterior_is_out && same(exterior, m.exterior)) return;
  m.exterior = std::move(exterior);
  m.hollow_out(granules, largest_radius);
  m.exterior_is_out = true;
  m.grid_has_changed();
}

bool InterfaceMesh::grid_box(Vec3& lo, Vec3& hi) const {
  openvdb::CoordBBox box;
  if (!impl_->grid->constTree().evalLeafBoundingBox(box)) return false;
  lo = Vec3(box.min().x(), box.min().y(), box.min().z()) * impl_->voxel;
  hi = Vec3(box.max().x(), box.max().y(), box.max().z()) * impl_->voxel;
  return true;
}

void InterfaceMesh::Impl::make_whole(const Gather& granules) {
  const Vec3 everywhere = Vec3::Constant(std::numeric_limits<double>::infinity());
  std::vector<Sphere> all;
  granules(-everywhere, everywhere, [&](const Sphere& s) {
    check(s);
    all.push_back(s);
  });
  grid = level_set::closed_union(std::move(all), closing, voxel);
  whole = false;
  touched.clear();
  hollowed.clear();
  leaves_when_pruned = grid->tree().leafCount();
}

/// From the granules around what was touched.
void InterfaceMesh::Impl::make_touched(const Gather& granules, double largest_radius) {
  if (touched.empty()) return;
  const double held = std::max(largest_radius, level_set::smallest_radius * voxel);
  openvdb::MaskTree needed(touched);
  const int cells = static_cast<int>(std::ceil((held + level_set::context(closing, voxel)) / (cell_edge * voxel)));
  openvdb::tools::dilateActiveValues(needed, cells, openvdb::tools::NN_FACE_EDGE_VERTEX, openvdb::tools::EXPAND_TILES);

  std::vector<Sphere> around;
  for (auto leaf = needed.cbeginLeaf(); leaf; ++leaf) {
    openvdb::CoordBBox box;
    leaf->evalActiveBoundingBox(box, /*visitVoxels=*/true);
    const auto corner = [&](const Coord& cell) -> Vec3 {  // of voxels, half a voxel before the first centre
      return Vec3(Vec3(cell.x(), cell.y(), cell.z()) * cell_edge - Vec3::Constant(0.5)) * voxel;
    };
    granules(corner(box.min()), corner(box.max().offsetBy(1)), [&](const Sphere& s) {
      const Coord cell = cell_of(s.centre, voxel);
      if ((cell & ~(openvdb::MaskTree::LeafNodeType::DIM - 1)) == leaf->origin() && leaf->isValueOn(cell)) around.push_back(s);
    });
  }
  const openvdb::FloatGrid::Ptr fresh = level_set::closed_union(std::move(around), closing, voxel);

  std::map<Coord, int> leaves;  // and which of their cells
  for (auto cell = touched.cbeginValueOn(); cell; ++cell)
    for_each_in(cell.getBoundingBox(), [&](const Coord& c) { leaves[leaf_of_cell(c)] |= bit_of(c); });
  touched.clear();

  FloatTree& tree = grid->tree();
  const FloatTree& from = fresh->constTree();
  for (const auto& [origin, which] : leaves) {
    const auto hollow = hollowed.find(origin);
    if (hollow != hollowed.end()) {
      *tree.touchLeaf(origin) = hollow->second.closed;
      hollowed.erase(hollow);
    }
    if (which == all_cells && !from.probeConstLeaf(origin)) {
      const float value = from.getValue(origin);
      if (tree.probeConstLeaf(origin) || tree.getValue(origin) != value) tree.addTile(1, origin, value, false);
    } else {
      copy_cells(*tree.touchLeaf(origin), from, which);
    }
  }
}

/// Without what is left out.
float InterfaceMesh::Impl::closed_value(const Coord& at) const {
  const auto hollow = hollowed.find(at & ~(Leaf::DIM - 1));
  return hollow == hollowed.end() ? grid->constTree().getValue(at) : hollow->second.closed.getValue(at);
}

double InterfaceMesh::Impl::closed_distance(const Vec3& p) const {
  struct Closed {  // as OpenVDB's sampler wants a tree
    using ValueType = float;
    const Impl& of;
    float getValue(const Coord& at) const { return of.closed_value(at); }
  };
  return openvdb::tools::BoxSampler::sample(Closed{*this}, in_voxels(p));
}

/// Of the exterior granules those that reach into the closed surface, by the leaves in which they do.
std::map<Coord, std::vector<Sphere>> InterfaceMesh::Impl::spheres_by_leaf(const Gather& granules, double largest_radius) const {
  const double least = level_set::smallest_radius * voxel, width = level_set::half_band * voxel;
  std::map<Coord, std::vector<Sphere>> by_leaf;
  for (Sphere s : exterior) {
    s.radius = std::max(s.radius, least);
    const double distance = closed_distance(s.centre);
    if (distance < 0.99 * width && distance >= s.radius - hardly * voxel) continue;
    // granules of the body go first: contacts overlap, and small ones are held larger
    const Vec3 reach = Vec3::Constant(s.radius + std::max(largest_radius, least));
    double radius = s.radius;
    granules(s.centre - reach, s.centre + reach,
             [&](const Sphere& g) { radius = std::min(radius, (g.centre - s.centre).norm() - std::max(g.radius, least)); });
    if (radius <= 0) continue;
    s.radius = radius;
    const Vec3 around = Vec3::Constant(radius + width);
    openvdb::CoordBBox box(nearest_voxel(s.centre - around, voxel), nearest_voxel(s.centre + around, voxel));
    box = {Coord(box.min().x() >> 3, box.min().y() >> 3, box.min().z() >> 3),
           Coord(box.max().x() >> 3, box.max().y() >> 3, box.max().z() >> 3)};
    for_each_in(box, [&](const Coord& leaf) {
      constexpr int leaf_edge = 8;  // voxels; a shift of what is negative is undefined
      const Coord origin(leaf_edge * leaf.x(), leaf_edge * leaf.y(), leaf_edge * leaf.z());
      if (grid->constTree().probeConstLeaf(origin) || grid->constTree().getValue(origin) < 0.0f) by_leaf[origin].push_back(s);
    });
  }
  return by_leaf;
}

/// Exterior granules are taken out of the closed surface, where they or it have changed.
void InterfaceMesh::Impl::hollow_out(const Gather& granules, double largest_radius) {
  FloatTree& tree = grid->tree();
  std::map<Coord, std::vector<Sphere>> due = spheres_by_leaf(granules, largest_radius);
  for (auto h = hollowed.begin(); h != hollowed.end();) {
    const auto wanted = due.find(h->first);
    if (wanted != due.end() && same(wanted->second, h->second.spheres)) {
      due.erase(wanted);
      ++h;
      continue;
    }
    *tree.touchLeaf(h->first) = h->second.closed;
    h = hollowed.erase(h);
  }
  const auto width = static_cast<float>(level_set::half_band * voxel);
  for (auto& [origin, spheres] : due) {
    Leaf& leaf = *tree.touchLeaf(origin);
    const Leaf closed = leaf;
    for (const Sphere& sphere : spheres) take_out_of(leaf, sphere, voxel, width);
    hollowed.emplace(origin, Hollowed{closed, std::move(spheres)});
  }
}

void InterfaceMesh::Impl::prune_when_due() {
  constexpr std::size_t too_few_to_matter = 256;
  const std::size_t leaves = grid->tree().leafCount();
  if (leaves < too_few_to_matter || 2 * leaves < 3 * leaves_when_pruned) return;
  openvdb::tools::pruneLevelSet(grid->tree());
  leaves_when_pruned = grid->tree().leafCount();
}

}  // namespace solidcull
