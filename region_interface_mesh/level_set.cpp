#include "level_set.h"

#include <openvdb/tools/ParticlesToLevelSet.h>
#include <openvdb/tools/Prune.h>
#include <openvdb/tools/SignedFloodFill.h>
#include <openvdb/tree/LeafManager.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>
#include <stdexcept>
#include <string>

namespace solidcull::level_set {

using openvdb::FloatGrid;
using openvdb::FloatTree;

void start() {
  static std::once_flag once;
  std::call_once(once, [] { openvdb::initialize(); });
}

FloatGrid::Ptr nothing(double voxel) {
  auto grid = FloatGrid::create(static_cast<float>(half_band * voxel));
  grid->setTransform(openvdb::math::Transform::createLinearTransform(voxel));
  grid->setGridClass(openvdb::GRID_LEVEL_SET);
  return grid;
}

namespace {

/// Spheres as ParticlesToLevelSet wants them, each grown by `growth` (m).
struct GrownSpheres {
  using PosType = openvdb::Vec3R;
  const std::vector<Sphere>& spheres;
  double growth;

  std::size_t size() const { return spheres.size(); }
  void getPos(std::size_t n, PosType& position) const {
    const Vec3& c = spheres[n].centre;
    position = PosType(c.x(), c.y(), c.z());
  }
  void getPosRad(std::size_t n, PosType& position, openvdb::Real& radius) const {
    getPos(n, position);
    radius = spheres[n].radius + growth;
  }
};

/// The union of the spheres, each grown by `growth`: exact distances outside, the depth in the deepest sphere inside.
FloatGrid::Ptr rasterise(const std::vector<Sphere>& spheres, double growth, double voxel) {
  auto grid = nothing(voxel);
  openvdb::tools::ParticlesToLevelSet<FloatGrid> raster(*grid);
  raster.setRmin(0.0);  // the default drops what is smaller than 1.5 voxels, or larger than 100
  raster.setRmax(std::numeric_limits<float>::max());
  raster.rasterizeSpheres(GrownSpheres{spheres, growth});
  raster.finalize(/*prune=*/true);
  if (raster.getMinCount() + raster.getMaxCount() != 0)
    throw std::logic_error("InterfaceMesh: " + std::to_string(raster.getMinCount() + raster.getMaxCount()) +
                           " spheres were dropped from the level set");
  return grid;
}

/// Depth (m) of the voxels inside a union of spheres below the union's surface, down to `reach`; infinite where not known.
///
/// The value stored inside a union is the depth in the deepest sphere, which is less. But each voxel y in the void knows its
/// exact distance F(y) to the union, so the ball of radius F(y) around it is void, and no x lies deeper than |x - y| - F(y). The
/// least of these bounds is handed inwards from voxel to voxel, in the order of depth. It is off by a few hundredths of a voxel
/// where the surface is smooth, and by a quarter of a voxel in the sharp grooves between two spheres.
FloatTree depth_inside(const FloatGrid& grown, double voxel, double reach) {
  using openvdb::Coord;
  constexpr float site_layer = 2.0f;   // sites are void voxels this near to the surface, and start what is this near to them
  constexpr int start = 2;             // (both in voxels)
  constexpr double gain = 1e-3;        // voxels; a smaller one is not handed on
  constexpr double front_width = 0.5;  // voxels

  struct Site {
    Coord at;
    double clear;  // F, in voxels
  };
  std::vector<Site> sites;
  FloatTree depth(std::numeric_limits<float>::infinity());
  openvdb::Int32Tree site_of(-1);
  openvdb::tree::ValueAccessor<const FloatTree, /*IsSafe=*/false> union_at(grown.tree());
  openvdb::tree::ValueAccessor<FloatTree, /*IsSafe=*/false> depth_at(depth);
  openvdb::tree::ValueAccessor<openvdb::Int32Tree, /*IsSafe=*/false> site_at(site_of);

  const double reach_voxels = reach / voxel;
  std::vector<std::vector<Coord>> fronts(static_cast<std::size_t>(reach_voxels / front_width) + 1);
  const auto offer = [&](const Coord& x, std::int32_t site) {
    const openvdb::Vec3d to_site = (x - sites[site].at).asVec3d();
    const double value = std::max(to_site.length() - sites[site].clear, 0.0);
    if (value > reach_voxels || value * voxel > depth_at.getValue(x) - gain * voxel) return;
    if (union_at.getValue(x) >= 0.0f) return;
    depth_at.setValue(x, static_cast<float>(value * voxel));
    site_at.setValue(x, site);
    fronts[std::min(static_cast<std::size_t>(value / front_width), fronts.size() - 1)].push_back(x);
  };
  const auto offer_around = [&](const Coord& x, int width, std::int32_t site) {
    for (int i = -width; i <= width; ++i)
      for (int j = -width; j <= width; ++j)
        for (int k = -width; k <= width; ++k) offer(x.offsetBy(i, j, k), site);
  };

  for (auto leaf = grown.tree().cbeginLeaf(); leaf; ++leaf)
    for (auto value = leaf->cbeginValueOn(); value; ++value) {
      const double clear = *value / voxel;
      if (clear < 0.0 || clear >= site_layer) continue;
      sites.push_back({value.getCoord(), clear});
      offer_around(sites.back().at, start, static_cast<std::int32_t>(sites.size() - 1));
    }
  for (std::size_t n = 0; n < fronts.size(); ++n)
    for (std::size_t m = 0; m < fronts[n].size(); ++m) {  // the front may grow meanwhile
      const Coord x = fronts[n][m];
      const double value = depth_at.getValue(x) / voxel;
      if (value < n * front_width) continue;  // a better bound came, and was handed on with an earlier front
      offer_around(x, 1, site_at.getValue(x));
    }
  return depth;
}

/// Moves the surface of a union of spheres that were grown by `closing` back by `closing`. Only the band along the surface is
/// touched; re-normalising the whole inside would cost a sweep per fraction of a voxel. Cavities that are left stay open.
FloatGrid::Ptr shrink(const FloatGrid& grown, double closing, double voxel) {
  using namespace openvdb;
  const auto shrunk = nothing(voxel);
  const float width = shrunk->background(), back = static_cast<float>(closing);
  const auto tree = std::make_shared<FloatTree>(depth_inside(grown, voxel, closing + (half_band + 1.0) * voxel));
  for (auto leaf = grown.tree().cbeginLeaf(); leaf; ++leaf) tree->touchLeaf(leaf->origin());

  tree::LeafManager<FloatTree> leaves(*tree);
  leaves.foreach ([&](FloatTree::LeafNodeType& leaf, std::size_t) {
    tree::ValueAccessor<const FloatTree, /*IsSafe=*/false> union_at(grown.tree());
    for (Index n = 0; n < FloatTree::LeafNodeType::SIZE; ++n) {
      const float from_union = union_at.getValue(leaf.offsetToGlobalCoord(n));
      // Inside, no granule's own sphere may suffer from what the depth is off by.
      const float value = from_union >= 0.0f ? from_union + back : std::min(back - leaf.getValue(n), from_union + back);
      if (std::abs(value) < width)
        leaf.setValueOn(n, value);
      else
        leaf.setValueOff(n, value < 0.0f ? -width : width);
    }
  });
  tree->root().setBackground(width, /*updateChildNodes=*/false);
  tools::signedFloodFill(*tree);
  tools::pruneLevelSet(*tree);
  shrunk->setTree(tree);
  return shrunk;
}

}  // namespace

FloatGrid::Ptr closed_union(std::vector<Sphere> spheres, double closing, double voxel) {
  if (spheres.empty()) return nothing(voxel);
  for (Sphere& s : spheres) s.radius = std::max(s.radius, smallest_radius * voxel);
  if (closing == 0.0) return rasterise(spheres, 0.0, voxel);
  return shrink(*rasterise(spheres, closing, voxel), closing, voxel);
}

FloatGrid::Ptr part(const FloatGrid& grid, const openvdb::CoordBBox& box) {
  const FloatTree& from = grid.constTree();
  const float background = from.background();
  const auto tree = std::make_shared<FloatTree>(background);
  for (auto leaf = from.cbeginLeaf(); leaf; ++leaf)
    if (box.hasOverlap(leaf->getNodeBoundingBox())) tree->addLeaf(new FloatTree::LeafNodeType(*leaf));
  auto tile = from.cbeginValueAll();
  tile.setMaxDepth(FloatTree::ValueAllCIter::LEAF_DEPTH - 1);
  for (; tile; ++tile) {
    openvdb::CoordBBox there;
    if (!(*tile < background) || !tile.getBoundingBox(there)) continue;
    there.intersect(box);
    if (!there.empty()) tree->sparseFill(there, *tile, tile.isValueOn());
  }
  tree->clip(box);
  const auto found = grid.copyWithNewTree();
  found->setTree(tree);
  return found;
}

/// OpenVDB's matrices act on row vectors.
openvdb::math::Transform::Ptr transform(double voxel, const Pose& pose) {
  openvdb::Mat4R m = openvdb::Mat4R::identity();
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column) m(row, column) = voxel * pose.turn()(column, row);
  for (int d = 0; d < 3; ++d) m(3, d) = pose.origin()[d];
  return openvdb::math::Transform::createLinearTransform(m);
}

}  // namespace solidcull::level_set
