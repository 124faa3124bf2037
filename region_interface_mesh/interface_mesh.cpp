#include "interface_mesh.h"

#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/Composite.h>
#include <openvdb/tools/GridTransformer.h>
#include <openvdb/tools/Interpolation.h>
#include <openvdb/tools/LevelSetSphere.h>
#include <openvdb/tools/ParticlesToLevelSet.h>
#include <openvdb/tools/Prune.h>
#include <openvdb/tools/SignedFloodFill.h>
#include <openvdb/tools/VolumeToMesh.h>
#include <openvdb/tree/LeafManager.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <variant>

#include "mesh_files.h"
#include "whole_file.h"

namespace solidcull {

namespace {

using openvdb::FloatGrid;
using openvdb::FloatTree;

constexpr float band = 3.0f;  // half width of the narrow band, in voxels

/// A sphere of more than half a voxel's diagonal holds a voxel centre wherever it lies; smaller ones could vanish from the grid.
constexpr double smallest_radius = 0.9;  // voxels

/// OpenVDB skips spheres below this radius in createLevelSetSphere.
constexpr double nyquist_radius = 1.5;  // voxels

/// A queue longer than this is worked off without a question, so that a run that never asks does not grow for ever (32 B each).
constexpr std::size_t queue_limit = 4'000'000;  // spheres

void start_openvdb() {
  static std::once_flag once;
  std::call_once(once, [] { openvdb::initialize(); });
}

FloatGrid::Ptr new_level_set(double voxel) {
  auto grid = FloatGrid::create(static_cast<float>(voxel) * band);
  grid->setTransform(openvdb::math::Transform::createLinearTransform(voxel));
  grid->setGridClass(openvdb::GRID_LEVEL_SET);
  return grid;
}

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
  auto grid = new_level_set(voxel);
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
  const auto shrunk = new_level_set(voxel);
  const float width = shrunk->background(), back = static_cast<float>(closing);
  const auto tree = std::make_shared<FloatTree>(depth_inside(grown, voxel, closing + (band + 1.0) * voxel));
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

FloatGrid::Ptr ball(const Sphere& s, double voxel) {
  if (s.radius < nyquist_radius * voxel) return rasterise({s}, 0.0, voxel);
  const openvdb::Vec3f centre(openvdb::Vec3d(s.centre.x(), s.centre.y(), s.centre.z()));
  return openvdb::tools::createLevelSetSphere<FloatGrid>(static_cast<float>(s.radius), centre, static_cast<float>(voxel), band);
}

/// Voxels of the body's frame seen from the world; OpenVDB's matrices act on row vectors.
openvdb::math::Transform::Ptr transform(double voxel, const Pose& pose) {
  openvdb::Mat4R m = openvdb::Mat4R::identity();
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column) m(row, column) = voxel * pose.turn()(column, row);
  for (int d = 0; d < 3; ++d) m(3, d) = pose.origin()[d];
  return openvdb::math::Transform::createLinearTransform(m);
}

void check(const Sphere& s, const char* what) {
  if (s.centre.allFinite() && std::isfinite(s.radius) && s.radius > 0) return;
  throw std::invalid_argument(std::string("InterfaceMesh: ") + what + " at (" + std::to_string(s.centre.x()) + ", " +
                              std::to_string(s.centre.y()) + ", " + std::to_string(s.centre.z()) + ") with radius " +
                              std::to_string(s.radius) + " is no sphere");
}

}  // namespace

struct InterfaceMesh::Impl {
  struct Addition {
    std::vector<Sphere> granules, context;
  };
  using Operation = std::variant<Addition, Sphere, std::unique_ptr<Impl>>;  // add, carve, merge

  double voxel, closing;
  Pose pose;
  FloatGrid::Ptr stored;  // its own transform is the voxel's scale alone: the body's frame
  std::vector<Operation> queue;
  std::size_t queued_spheres = 0;
  std::size_t leaves_when_pruned = 0;

  struct Box {
    Vec3 lo, hi;
  };
  // answers that cost a pass over the grid, kept until it changes
  std::optional<Box> box;
  std::optional<double> enclosed;
  std::optional<bool> holds_nothing;
  std::size_t passes = 0;

  Impl(double voxel_, double closing_) : voxel(voxel_), closing(closing_) {
    start_openvdb();
    stored = new_level_set(voxel);
  }

  void enqueue(Operation op, std::size_t spheres) {
    queue.push_back(std::move(op));
    queued_spheres += spheres;
    if (queued_spheres > queue_limit) apply();
  }

  FloatGrid& grid() {
    if (!queue.empty()) apply();
    return *stored;
  }

  void apply() {
    // One after another and never two additions as one: what the mesh is may not depend on when it was asked for.
    for (Operation& op : queue) {
      if (auto* addition = std::get_if<Addition>(&op))
        unite(*additional_solid(*addition));
      else if (auto* carved = std::get_if<Sphere>(&op))
        subtract(*carved);
      else
        unite(std::get<std::unique_ptr<Impl>>(op)->grid());
    }
    queue.clear();
    queued_spheres = 0;
    box.reset();
    enclosed.reset();
    holds_nothing.reset();
    prune_when_due();
  }

  FloatGrid::Ptr additional_solid(Addition& a) const {
    for (auto* spheres : {&a.granules, &a.context})
      for (Sphere& s : *spheres) s.radius = std::max(s.radius, smallest_radius * voxel);
    if (closing == 0.0) return rasterise(a.granules, 0.0, voxel);
    if (a.context.empty()) return shrink(*rasterise(a.granules, closing, voxel), closing, voxel);

    std::vector<Sphere> all = a.granules;
    all.insert(all.end(), a.context.begin(), a.context.end());
    const FloatGrid::Ptr solid = shrink(*rasterise(all, closing, voxel), closing, voxel);
    // A pore that the new granules close was void, so some ball of radius `closing` covered it whose centre now lies within
    // r + closing of a new granule: no such point is farther than r + 2 closing from it. Beyond that nothing is to change.
    openvdb::tools::csgIntersection(*solid, *rasterise(a.granules, 2.0 * closing, voxel), /*prune=*/false);
    return solid;
  }

  // Pruning in each CSG would cost a pass over the whole body, however small the change.
  void unite(FloatGrid& solid) { openvdb::tools::csgUnion(*stored, solid, /*prune=*/false); }
  void subtract(const Sphere& s) { openvdb::tools::csgDifference(*stored, *ball(s, voxel), /*prune=*/false); }

  void prune_when_due() {
    constexpr std::size_t too_few_to_matter = 256;
    const std::size_t leaves = stored->tree().leafCount();
    if (leaves < too_few_to_matter || 2 * leaves < 3 * leaves_when_pruned) return;
    openvdb::tools::pruneLevelSet(stored->tree());
    leaves_when_pruned = stored->tree().leafCount();
  }

  double value_at(const openvdb::Vec3d& voxel_position) {
    openvdb::tree::ValueAccessor<const FloatTree, /*IsSafe=*/false> at(grid().constTree());
    return openvdb::tools::BoxSampler::sample(at, voxel_position);
  }

  openvdb::Vec3d in_voxels(const Vec3& p) const { return openvdb::Vec3d(p.x(), p.y(), p.z()) / voxel; }

  const Box& bounding_box();
  bool nothing_inside();
};

/// The box around the zero set of the trilinear field: each coordinate of that set is extreme on an edge between two voxel
/// centres.
const InterfaceMesh::Impl::Box& InterfaceMesh::Impl::bounding_box() {
  const FloatTree& tree = grid().constTree();
  if (box) return *box;
  ++passes;
  using openvdb::Coord;
  Vec3 lo = Vec3::Constant(std::numeric_limits<double>::infinity()), hi = -lo;
  openvdb::tree::ValueAccessor<const FloatTree, /*IsSafe=*/false> at(tree);
  for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf)
    for (auto value = leaf->cbeginValueOn(); value; ++value) {
      if (*value >= 0.0f || *value < -voxel * 1.001) continue;
      const Coord c = value.getCoord();
      for (int d = 0; d < 3; ++d)
        for (const int side : {-1, 1}) {
          Coord next = c;
          next[d] += side;
          const float beyond = at.getValue(next);
          if (beyond < 0.0f) continue;
          const double crossing = (c[d] + side * (*value / (*value - beyond))) * voxel;
          lo[d] = std::min(lo[d], crossing);
          hi[d] = std::max(hi[d], crossing);
        }
    }
  box = lo.allFinite() ? Box{lo, hi} : Box{Vec3::Zero(), Vec3::Zero()};
  return *box;
}

InterfaceMesh::InterfaceMesh(double voxel, double closing) {
  if (!(voxel > 0) || !std::isfinite(voxel))
    throw std::invalid_argument("InterfaceMesh: voxel " + std::to_string(voxel) + " must be positive and finite");
  if (!(closing >= 0) || !std::isfinite(closing))
    throw std::invalid_argument("InterfaceMesh: closing " + std::to_string(closing) + " must be zero or more");
  impl_ = std::make_unique<Impl>(voxel, closing);
}

InterfaceMesh::~InterfaceMesh() = default;
InterfaceMesh::InterfaceMesh(InterfaceMesh&&) noexcept = default;
InterfaceMesh& InterfaceMesh::operator=(InterfaceMesh&&) noexcept = default;

void InterfaceMesh::add(const std::vector<Sphere>& granules, const std::vector<Sphere>& context) {
  if (granules.empty()) return;
  for (const Sphere& s : granules) check(s, "a granule");
  for (const Sphere& s : context) check(s, "a granule");
  impl_->enqueue(Impl::Addition{granules, context}, granules.size() + context.size());
}

void InterfaceMesh::set_pose(const Pose& pose) { impl_->pose = pose; }
const Pose& InterfaceMesh::pose() const { return impl_->pose; }

void InterfaceMesh::carve(const Sphere& ball) {
  check(ball, "a carving ball");
  impl_->enqueue(ball, 1);
}

void InterfaceMesh::merge(InterfaceMesh&& other) {
  if (&other == this) return;
  if (other.impl_->voxel != impl_->voxel)
    throw std::invalid_argument("InterfaceMesh: a mesh with voxel " + std::to_string(other.impl_->voxel) +
                                " cannot join one with voxel " + std::to_string(impl_->voxel));
  auto emptied = std::make_unique<Impl>(other.impl_->voxel, other.impl_->closing);
  std::swap(emptied, other.impl_);
  other.impl_->pose = emptied->pose;
  if (emptied->pose != impl_->pose) {
    // seen from this frame: turn(here)^-1 turn(there), origins likewise
    const Pose seen(impl_->pose.to_frame(emptied->pose.origin()),
                    impl_->pose.quaternion().conjugate() * emptied->pose.quaternion());
    const auto there = emptied->grid().copy();
    there->setTransform(transform(impl_->voxel, seen));
    auto here = std::make_unique<Impl>(impl_->voxel, impl_->closing);
    // doResampleToMatch and not resampleToMatch, which makes level sets anew from triangles: cavities would be filled
    openvdb::util::NullInterrupter interrupter;
    openvdb::tools::doResampleToMatch<openvdb::tools::BoxSampler>(*there, *here->stored, interrupter);
    emptied = std::move(here);
  }
  const std::size_t spheres = emptied->queued_spheres;
  impl_->enqueue(std::move(emptied), spheres);
}

bool InterfaceMesh::Impl::nothing_inside() {
  const FloatTree& tree = grid().constTree();
  ++passes;
  for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf)
    for (openvdb::Index n = 0; n < FloatTree::LeafNodeType::SIZE; ++n)
      if (leaf->getValue(n) < 0.0f) return false;
  return true;
}

bool InterfaceMesh::empty() const {
  impl_->grid();
  if (!impl_->holds_nothing) impl_->holds_nothing = impl_->nothing_inside();
  return *impl_->holds_nothing;
}

std::size_t InterfaceMesh::passes() const { return impl_->passes; }

bool InterfaceMesh::inside(const Vec3& p) const { return signed_distance(p) < 0.0; }

double InterfaceMesh::signed_distance(const Vec3& p) const { return impl_->value_at(impl_->in_voxels(impl_->pose.to_frame(p))); }

Vec3 InterfaceMesh::normal(const Vec3& p) const {
  const openvdb::Vec3d at = impl_->in_voxels(impl_->pose.to_frame(p));
  Vec3 gradient;
  for (int d = 0; d < 3; ++d) {
    openvdb::Vec3d step(0.0);
    step[d] = 0.5;
    gradient[d] = impl_->value_at(at + step) - impl_->value_at(at - step);
  }
  const double steepness = gradient.norm();
  return steepness > 0 ? impl_->pose.turned_to_world(gradient / steepness) : Vec3(Vec3::Zero());
}

void InterfaceMesh::bounds(Vec3& lo, Vec3& hi) const {
  const Impl::Box& box = impl_->bounding_box();
  if (empty()) {
    lo = hi = Vec3::Zero();
    return;
  }
  const Vec3 centre = impl_->pose.to_world(0.5 * (box.lo + box.hi));
  const Vec3 half = turned_half_box(impl_->pose.turn(), 0.5 * (box.hi - box.lo));
  lo = centre - half;
  hi = centre + half;
}

/// From the distances at the voxel centres. A voxel counts with its share on the inner side of a plane at that distance; the mix
/// of two such ramps, one and two voxels wide, has no error of second order in voxel / radius of curvature. (The triangles have:
/// they enclose 1 % less at a radius of ten voxels.)
double InterfaceMesh::volume() const {
  const FloatTree& tree = impl_->grid().constTree();
  if (impl_->enclosed) return *impl_->enclosed;
  ++impl_->passes;
  const auto ramp = [](double voxels, double width) { return std::clamp(0.5 - voxels / width, 0.0, 1.0); };
  double voxels_inside = 0.0;
  for (auto value = tree.cbeginValueAll(); value; ++value) {
    if (value.getLevel() > 0) {
      if (*value < 0.0f) voxels_inside += static_cast<double>(value.getVoxelCount());
    } else {
      const double at = *value / impl_->voxel;
      voxels_inside += (4.0 * ramp(at, 1.0) - ramp(at, 2.0)) / 3.0;
    }
  }
  impl_->enclosed = voxels_inside * std::pow(impl_->voxel, 3);
  return *impl_->enclosed;
}

double InterfaceMesh::half_width() const { return impl_->stored->background(); }

TriangleMesh InterfaceMesh::triangles(double adaptivity) const {
  std::vector<openvdb::Vec3s> points;
  std::vector<openvdb::Vec3I> threes;
  std::vector<openvdb::Vec4I> fours;
  openvdb::tools::volumeToMesh(impl_->grid(), points, threes, fours, 0.0, adaptivity);

  TriangleMesh mesh;
  mesh.vertices.reserve(points.size());
  for (const openvdb::Vec3s& p : points) mesh.vertices.push_back(impl_->pose.to_world(Vec3(p.x(), p.y(), p.z())));
  mesh.triangles.reserve(threes.size() + 2 * fours.size());
  // OpenVDB winds its polygons the other way round.
  for (const openvdb::Vec3I& t : threes) mesh.triangles.push_back({t[0], t[2], t[1]});
  for (const openvdb::Vec4I& q : fours) {
    mesh.triangles.push_back({q[0], q[2], q[1]});
    mesh.triangles.push_back({q[0], q[3], q[2]});
  }
  return mesh;
}

std::string InterfaceMesh::to_bytes() const {
  const auto grid = impl_->grid().copy();  // shares the tree
  const Pose& p = impl_->pose;
  const Eigen::Quaterniond& q = p.quaternion();
  grid->insertMeta("pose_origin", openvdb::Vec3DMetadata({p.origin()[0], p.origin()[1], p.origin()[2]}));
  grid->insertMeta("pose_turn", openvdb::Vec3DMetadata({q.x(), q.y(), q.z()}));
  grid->insertMeta("pose_turn_w", openvdb::DoubleMetadata(q.w()));
  std::ostringstream out(std::ios::binary);
  openvdb::io::Stream(out).write(openvdb::GridCPtrVec{grid});
  return out.str();
}

InterfaceMesh InterfaceMesh::from_bytes(const std::string& bytes, double voxel, double closing) {
  InterfaceMesh mesh(voxel, closing);
  FloatGrid::Ptr grid;
  try {
    std::istringstream in(bytes, std::ios::binary);
    const openvdb::GridPtrVecPtr grids = openvdb::io::Stream(in, /*delayLoad=*/false).getGrids();
    if (grids && grids->size() == 1) grid = openvdb::gridPtrCast<FloatGrid>(grids->front());
    if (grid) {
      const openvdb::Vec3d o = grid->metaValue<openvdb::Vec3d>("pose_origin"), q = grid->metaValue<openvdb::Vec3d>("pose_turn");
      mesh.impl_->pose =
          Pose(Vec3(o[0], o[1], o[2]), Eigen::Quaterniond(grid->metaValue<double>("pose_turn_w"), q[0], q[1], q[2]));
      for (const char* name : {"pose_origin", "pose_turn", "pose_turn_w"}) grid->removeMeta(name);
    }
  } catch (const std::exception& e) {
    throw std::runtime_error(std::string("InterfaceMesh: these bytes are no interface mesh: ") + e.what());
  }
  if (!grid) throw std::runtime_error("InterfaceMesh: these bytes are no interface mesh");
  if (grid->transform() != mesh.impl_->stored->transform())
    throw std::runtime_error("InterfaceMesh: these bytes hold a mesh with voxel " + std::to_string(grid->voxelSize()[0]) +
                             ", not " + std::to_string(voxel));
  mesh.impl_->stored = grid;
  return mesh;
}

std::size_t InterfaceMesh::active_voxels() const { return impl_->grid().activeVoxelCount(); }

std::size_t InterfaceMesh::memory_bytes() const {
  return impl_->grid().memUsage() + impl_->queue.capacity() * sizeof(Impl::Operation);
}

void write_vdb(const std::string& file, const std::vector<const InterfaceMesh*>& meshes, const std::vector<std::string>& names) {
  if (meshes.size() != names.size())
    throw std::invalid_argument("write_vdb: " + std::to_string(names.size()) + " names for " + std::to_string(meshes.size()) +
                                " meshes");
  start_openvdb();
  WholeFile out(file);
  out.close();  // OpenVDB opens the file by its name; that this is possible is known now, or the reason why not
  openvdb::GridCPtrVec grids;
  for (std::size_t n = 0; n < meshes.size(); ++n) {
    meshes[n]->impl_->grid();
    const auto named = meshes[n]->impl_->stored->copy();  // shares the tree
    named->setName(names[n]);
    named->setTransform(transform(meshes[n]->impl_->voxel, meshes[n]->impl_->pose));
    grids.push_back(named);
  }
  try {
    openvdb::io::File(out.part()).write(grids);
  } catch (const std::exception& e) {
    out.fail(e.what());
  }
  out.commit();
}

void set_geometry_threads(int n) {
  if (n < 1) throw std::invalid_argument("set_geometry_threads: " + std::to_string(n) + " must be at least 1");
  static std::unique_ptr<tbb::global_control> limit;
  limit.reset();  // two controls at once would keep the smaller number
  limit = std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism, n);
}

}  // namespace solidcull
