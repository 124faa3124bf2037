#include <openvdb/openvdb.h>
#include <openvdb/points/PointConversion.h>

#include <numeric>
#include <string>
#include <type_traits>
#include <vector>

#include "level_set.h"
#include "mesh_files.h"
#include "vdb_file.h"

namespace solidcull {
namespace {

namespace points = openvdb::points;

constexpr double voxel_of_radii = 4;  // a voxel of two diameters holds some eight granules of a packing

/// A column of values, as OpenVDB asks for it.
template <class Value, class Number>
class Column {
 public:
  using value_type = Value;
  using PosType = openvdb::Vec3f;  // of positions

  Column(const std::vector<Number>& numbers, std::size_t width) : numbers_(numbers), width_(width) {}
  std::size_t size() const { return numbers_.size() / width_; }
  template <class To>
  void get(To& to, std::size_t n, openvdb::Index /*of several in one*/ = 0) const {
    const Number* const at = numbers_.data() + n * width_;
    if constexpr (std::is_same_v<Value, openvdb::Vec3f>)
      to = To(at[0], at[1], at[2]);
    else
      to = static_cast<To>(*at);
  }
  void getPos(std::size_t n, openvdb::Vec3f& place) const { get(place, n); }

 private:
  const std::vector<Number>& numbers_;
  const std::size_t width_;
};

template <class Value, class Number>
void add(points::PointDataTree& tree, const openvdb::tools::PointIndexTree& order, const std::string& name,
         const std::vector<Number>& numbers, std::size_t width = 1) {
  points::appendAttribute<Value>(tree, name);
  points::populateAttribute(tree, order, name, Column<Value, Number>(numbers, width));
}

double voxel_of(const BedTable& bed) {
  if (bed.radius.empty()) return 1;
  return voxel_of_radii * std::accumulate(bed.radius.begin(), bed.radius.end(), 0.0) / static_cast<double>(bed.radius.size());
}

openvdb::GridBase::Ptr grid_of(const BedTable& bed) {
  using openvdb::Vec3f;
  const auto transform = openvdb::math::Transform::createLinearTransform(voxel_of(bed));
  const Column<Vec3f, float> places(bed.position, 3);
  const auto order = openvdb::tools::createPointIndexGrid<openvdb::tools::PointIndexGrid>(places, *transform);
  const auto grid = points::createPointDataGrid<points::NullCodec, points::PointDataGrid>(*order, places, *transform);
  grid->setName("points");
  points::PointDataTree& tree = grid->tree();
  if (bed.radius.empty()) return grid;  // no leaf that could hold a column
  add<int>(tree, order->tree(), "id", bed.id);
  add<float>(tree, order->tree(), "pscale", bed.radius);
  add<Vec3f>(tree, order->tree(), "v", bed.velocity, 3);
  if (!bed.spin.empty()) add<Vec3f>(tree, order->tree(), "w", bed.spin, 3);
  add<int>(tree, order->tree(), "type", bed.type);
  add<int>(tree, order->tree(), "state", bed.state);
  add<int>(tree, order->tree(), "awake", bed.awake);
  add<int>(tree, order->tree(), "woke", bed.woke);
  add<std::int64_t>(tree, order->tree(), "body", bed.body);
  return grid;
}

}  // namespace

void write_bed_vdb(const std::string& file, const BedTable& bed, double time) {
  check_columns(bed);
  level_set::start();
  const openvdb::GridBase::Ptr grid = grid_of(bed);
  grid->insertMeta("time", openvdb::DoubleMetadata(time));
  write_grids(file, {grid});
}

}  // namespace solidcull
