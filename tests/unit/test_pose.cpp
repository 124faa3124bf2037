// Where bodies are, and interface meshes that ride along with them.
#include <gtest/gtest.h>
#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/Interpolation.h>

#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <random>
#include <sstream>

#include "interface_mesh.h"
#include "mesh_files.h"
#include "mesh_of.h"
#include "pose.h"
#include "temporary_folder.h"

namespace solidcull {
namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Quaterniond;

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double between(double lo, double hi) { return std::uniform_real_distribution<double>(lo, hi)(engine_); }
  Vec3 vector(double size) {
    const double x = between(-size, size), y = between(-size, size), z = between(-size, size);
    return Vec3(x, y, z);
  }
  Quaterniond turn() { return Quaterniond(AngleAxisd(between(0, M_PI), vector(1).normalized())); }
  Pose pose(double size) {
    const Vec3 origin = vector(size);
    return Pose(origin, turn());
  }

 private:
  std::mt19937 engine_;
};

bool same_bits(const Vec3& a, const Vec3& b) { return std::memcmp(a.data(), b.data(), 3 * sizeof(double)) == 0; }

// ------------------------------------------------------------------------------------------------------------------- poses

TEST(Pose, the_identity_maps_to_the_last_bit) {
  Random random(1);
  const Pose fresh, made(Vec3::Zero(), Quaterniond::Identity());
  EXPECT_EQ(fresh, made);
  constexpr double tiny = std::numeric_limits<double>::denorm_min(), huge = std::numeric_limits<double>::max();
  std::vector<Vec3> points{Vec3(tiny, -tiny, huge), Vec3(-huge, 1.0 / 3, 5e-324), Vec3(1e-308, -1e308, 1)};
  for (int n = 0; n < 1000; ++n) points.push_back(std::pow(10.0, random.between(-12, 12)) * random.vector(1));
  for (const Vec3& p : points)
    for (const Pose& pose : {fresh, made}) {
      EXPECT_TRUE(same_bits(pose.to_world(p), p));
      EXPECT_TRUE(same_bits(pose.to_frame(p), p));
      EXPECT_TRUE(same_bits(pose.turned_to_world(p), p));
      EXPECT_TRUE(same_bits(pose.turned_to_frame(p), p));
    }
}

TEST(Pose, a_shift_alone_is_an_addition) {
  Pose pose;
  pose.shift(Vec3(0.25, -1, 8));
  pose.shift(Vec3(0.25, 0, 0));
  EXPECT_EQ(pose.to_world(Vec3(1, 2, 3)), Vec3(1.5, 1, 11));
  EXPECT_EQ(pose.to_frame(Vec3(1.5, 1, 11)), Vec3(1, 2, 3));
  EXPECT_EQ(pose.turned_to_world(Vec3(1, 2, 3)), Vec3(1, 2, 3));
  EXPECT_EQ(pose.quaternion().coeffs(), Quaterniond::Identity().coeffs());
}

TEST(Pose, to_frame_is_the_inverse_of_to_world) {
  Random random(2);
  constexpr double rounding = 20 * std::numeric_limits<double>::epsilon();  // two products with a 3x3 matrix, entries up to 1
  for (int n = 0; n < 1000; ++n) {
    const Pose pose = random.pose(10);
    const Vec3 p = random.vector(1), world = pose.to_world(p);
    const double far = rounding * (pose.origin().norm() + p.norm());
    EXPECT_LE((pose.to_frame(world) - p).norm(), far);
    EXPECT_LE((pose.to_world(pose.to_frame(p)) - p).norm(), far);
    EXPECT_LE((world - (pose.quaternion() * p + pose.origin())).norm(), far);
    EXPECT_LE((pose.turned_to_world(p) - (world - pose.origin())).norm(), far);
    EXPECT_LE((pose.turned_to_frame(pose.turned_to_world(p)) - p).norm(), rounding * p.norm());
    EXPECT_LE((pose.turn() * pose.turn().transpose() - Matrix3d::Identity()).norm(), rounding);
    EXPECT_NEAR(pose.turn().determinant(), 1.0, rounding);
  }
}

TEST(Pose, turns_counterclockwise) {
  const Pose pose(Vec3(1, 0, 0), Quaterniond(AngleAxisd(M_PI / 2, Vec3::UnitZ())));
  EXPECT_LE((pose.to_world(Vec3(1, 0, 5)) - Vec3(1, 1, 5)).norm(), 1e-15);
}

TEST(Pose, an_advance_does_to_the_frame_what_the_step_does_to_space) {
  Random random(3);
  for (int n = 0; n < 200; ++n) {
    Pose pose = random.pose(3);
    const Pose before = pose;
    const RigidStep step{random.vector(3), random.vector(3), random.turn()};
    pose.advance(step);
    for (int k = 0; k < 5; ++k) {
      const Vec3 place = random.vector(2), x = before.to_world(place);
      EXPECT_LE((pose.to_world(place) - (step.to + step.turn * (x - step.from))).norm(), 1e-14);
    }
    EXPECT_LE((pose.to_world(before.to_frame(step.from)) - step.to).norm(), 1e-14);
  }
}

TEST(Pose, advances_compose) {
  Random random(4);
  for (int n = 0; n < 200; ++n) {
    const RigidStep a{random.vector(1), random.vector(1), random.turn()}, b{random.vector(1), random.vector(1), random.turn()};
    const RigidStep both{a.from, b.to + b.turn * (a.to - b.from), b.turn * a.turn};
    Pose one = random.pose(1), two = one;
    one.advance(a);
    one.advance(b);
    two.advance(both);
    const Vec3 place = random.vector(1);
    EXPECT_LE((one.to_world(place) - two.to_world(place)).norm(), 1e-14);
    EXPECT_LE((one.turn() - two.turn()).norm(), 1e-14);
  }
  // a thousand small turns about a fixed point are the large one
  Pose pose(Vec3(1, 2, 3), Quaterniond::Identity());
  const Vec3 fixed(4, 0, 0), axis = Vec3(1, 1, -1).normalized();
  const Pose before = pose;
  for (int n = 0; n < 1000; ++n) pose.advance({fixed, fixed, Quaterniond(AngleAxisd(2e-3, axis))});
  EXPECT_NEAR(pose.quaternion().norm(), 1.0, 1e-15);
  const Vec3 x = before.to_world(Vec3(1, 1, 1));
  EXPECT_LE((pose.to_world(Vec3(1, 1, 1)) - (fixed + AngleAxisd(2.0, axis) * (x - fixed))).norm(), 1e-12);
}

TEST(Pose, is_the_same_only_where_place_and_turn_are) {
  const Quaterniond turn = Quaterniond(AngleAxisd(0.3, Vec3::UnitX()));
  EXPECT_EQ(Pose(Vec3(1, 2, 3), turn), Pose(Vec3(1, 2, 3), turn));
  EXPECT_NE(Pose(Vec3(1, 2, 3), turn), Pose(Vec3(1, 2, 3.0000001), turn));
  EXPECT_NE(Pose(Vec3(1, 2, 3), turn), Pose(Vec3(1, 2, 3), Quaterniond::Identity()));
}

TEST(Pose, the_box_around_a_turned_box_holds_it_and_no_more) {
  Random random(5);
  for (int n = 0; n < 200; ++n) {
    const Matrix3d turn = random.turn().toRotationMatrix();
    const Vec3 half = random.vector(1).cwiseAbs(), box = turned_half_box(turn, half);
    Vec3 reached = Vec3::Zero();
    for (int c = 0; c < 8; ++c) {
      const Vec3 corner(c & 1 ? half[0] : -half[0], c & 2 ? half[1] : -half[1], c & 4 ? half[2] : -half[2]);
      reached = reached.cwiseMax(turn * corner);
    }
    EXPECT_LE((box - reached).norm(), 1e-15);
  }
  EXPECT_EQ(turned_half_box(Matrix3d::Identity(), Vec3(1, 2, 3)), Vec3(1, 2, 3));
}

// ------------------------------------------------------------------------------------------------- interface meshes in flight

const Pose flown(Vec3(0.31, -0.24, 0.52), Quaterniond(AngleAxisd(1.1, Vec3(1, 2, 3).normalized())));

/// A lattice with a bite, of which one stands at the origin and one where it was carried.
InterfaceMesh bitten(const Pose& pose = Pose()) {
  return mesh_of(without(lattice(5, 2 * voxel), {Vec3(8, 8, 8) * voxel, 5 * voxel}), voxel, voxel, pose);
}

TEST(InterfaceMeshInFlight, stands_at_the_origin_at_first) {
  const InterfaceMesh mesh(voxel, 0.0);
  EXPECT_EQ(mesh.pose(), Pose());
}

TEST(InterfaceMeshInFlight, answers_at_a_world_place_as_it_would_at_the_place_in_its_frame) {
  const InterfaceMesh still = bitten(), moved = bitten(flown);
  EXPECT_EQ(moved.pose(), flown);
  Random random(6);
  int inside = 0, with_normal = 0;
  for (int n = 0; n < 5000; ++n) {
    const Vec3 place = Vec3::Constant(4 * voxel) + random.vector(8 * voxel), x = flown.to_world(place);
    const double distance = still.signed_distance(place);
    ASSERT_NEAR(moved.signed_distance(x), distance, 1e-9 * voxel);
    if (std::abs(distance) > 1e-6 * voxel) {
      ASSERT_EQ(moved.inside(x), still.inside(place));
    }
    inside += still.inside(place);
    const Vec3 normal = still.normal(place);
    // where the field is all but flat its direction is rounding
    if (normal.norm() == 0 || std::abs(distance) > 2 * voxel) continue;
    ++with_normal;
    ASSERT_LE((moved.normal(x) - flown.turned_to_world(normal)).norm(), 1e-6);
  }
  EXPECT_GT(inside, 500);
  EXPECT_GT(with_normal, 500);
}

TEST(InterfaceMeshInFlight, keeps_its_volume_and_carries_its_triangles) {
  const InterfaceMesh still = bitten(), moved = bitten(flown);
  EXPECT_EQ(moved.volume(), still.volume());
  EXPECT_EQ(moved.active_voxels(), still.active_voxels());
  const TriangleMesh a = still.triangles(), b = moved.triangles();
  ASSERT_EQ(a.vertices.size(), b.vertices.size());
  EXPECT_EQ(a.triangles, b.triangles);
  ASSERT_FALSE(a.triangles.empty());
  for (std::size_t v = 0; v < a.vertices.size(); ++v) ASSERT_LE((flown.to_world(a.vertices[v]) - b.vertices[v]).norm(), 1e-15);
  const auto enclosed = [](const TriangleMesh& m, const Vec3& from) {  // as they are wound: positive where normals point out
    double volume = 0;
    for (const auto& t : m.triangles)
      volume += (m.vertices[t[0]] - from).dot((m.vertices[t[1]] - from).cross(m.vertices[t[2]] - from)) / 6;
    return volume;
  };
  EXPECT_GT(enclosed(b, flown.origin()), 0.9 * moved.volume());
  EXPECT_NEAR(enclosed(b, flown.origin()), enclosed(a, Vec3::Zero()), 1e-12 * moved.volume());
}

TEST(InterfaceMeshInFlight, moves_on_without_being_made_anew) {
  InterfaceMesh mesh = bitten();
  const Vec3 place = Vec3(2, 2, 2) * voxel;
  const double volume = mesh.volume();
  Random random(7);
  for (int n = 0; n < 10; ++n) {
    const Pose pose = random.pose(1);
    mesh.set_pose(pose);
    EXPECT_TRUE(mesh.inside(pose.to_world(place)));
    EXPECT_FALSE(mesh.inside(pose.to_world(Vec3(-2, 2, 2) * voxel)));
    EXPECT_EQ(mesh.volume(), volume);
  }
}

TEST(InterfaceMeshInFlight, its_bounds_hold_all_that_is_inside) {
  const InterfaceMesh still = bitten(), moved = bitten(flown);
  const Pose shifted(Vec3(1, -2, 3), Quaterniond::Identity());
  Vec3 lo, hi, moved_lo, moved_hi, shifted_lo, shifted_hi;
  still.bounds(lo, hi);
  moved.bounds(moved_lo, moved_hi);
  bitten(shifted).bounds(shifted_lo, shifted_hi);
  EXPECT_LE((shifted_lo - lo - shifted.origin()).norm(), 1e-15);
  EXPECT_LE((shifted_hi - hi - shifted.origin()).norm(), 1e-15);
  // the box around its turned box, and all the surface in it
  EXPECT_LE((0.5 * (moved_hi + moved_lo) - flown.to_world(0.5 * (lo + hi))).norm(), 1e-15);
  EXPECT_LE((0.5 * (moved_hi - moved_lo) - flown.turn().cwiseAbs() * (0.5 * (hi - lo))).norm(), 1e-15);
  for (const Vec3& v : moved.triangles().vertices) {
    ASSERT_TRUE((v.array() >= moved_lo.array() - 1e-6 * voxel).all()) << v.transpose();
    ASSERT_TRUE((v.array() <= moved_hi.array() + 1e-6 * voxel).all()) << v.transpose();
  }
  InterfaceMesh nothing(voxel, 0.0);
  nothing.set_pose(flown);
  nothing.bounds(lo, hi);
  EXPECT_EQ(lo, Vec3(Vec3::Zero()));
  EXPECT_EQ(hi, Vec3(Vec3::Zero()));
}

TEST(InterfaceMeshInFlight, bytes_keep_the_pose) {
  const InterfaceMesh mesh = bitten(flown), copy = InterfaceMesh::from_bytes(mesh.to_bytes(), voxel, voxel);
  EXPECT_EQ(copy.pose(), flown);
  EXPECT_EQ(copy.volume(), mesh.volume());
  Random random(8);
  for (int n = 0; n < 1000; ++n) {
    const Vec3 x = flown.to_world(Vec3::Constant(4 * voxel) + random.vector(8 * voxel));
    ASSERT_EQ(copy.signed_distance(x), mesh.signed_distance(x));
  }
  EXPECT_EQ(InterfaceMesh::from_bytes(copy.to_bytes(), voxel, voxel).pose(), flown) << "and a second time";
  EXPECT_EQ(InterfaceMesh::from_bytes(bitten().to_bytes(), voxel, voxel).pose(), Pose());
  EXPECT_EQ(mesh.pose(), flown) << "the one that was written is as it was";
}

TEST(InterfaceMeshInFlight, bytes_of_a_grid_without_a_pose_are_refused_as_the_contract_says) {
  openvdb::initialize();
  const auto grid = openvdb::FloatGrid::create(static_cast<float>(3 * voxel));
  grid->setTransform(openvdb::math::Transform::createLinearTransform(voxel));
  grid->setGridClass(openvdb::GRID_LEVEL_SET);
  std::ostringstream out(std::ios::binary);
  openvdb::io::Stream(out).write(openvdb::GridCPtrVec{grid});
  EXPECT_THROW(InterfaceMesh::from_bytes(out.str(), voxel, voxel), std::runtime_error);
}

// ------------------------------------------------------------------------------------------------- merging in different poses

/// One body's granules and another's, given in the frame of the first; the other one is built in a frame of its own.
struct TwoBodies {
  std::vector<Sphere> here, there;
  Pose first, second;  // poses of the two frames

  std::vector<Sphere> there_in_its_frame() const {
    std::vector<Sphere> spheres = there;
    for (Sphere& s : spheres) s.centre = second.to_frame(first.to_world(s.centre));
    return spheres;
  }
};

void expect_same_solid(const InterfaceMesh& is, const InterfaceMesh& due, const Pose& pose, const Vec3& lo, const Vec3& hi) {
  // two surfaces a tenth of a voxel apart are the same to the accuracy of the triangles between; edges are rounded off
  Random random(9);
  int inside = 0, outside = 0;
  for (int n = 0; n < 5000; ++n) {
    const Vec3 u = (random.vector(0.5).array() + 0.5).matrix(), x = pose.to_world(lo + u.cwiseProduct(hi - lo));
    const double distance = due.signed_distance(x);
    if (std::abs(distance) < voxel) continue;
    (distance < 0 ? inside : outside) += 1;
    ASSERT_EQ(is.inside(x), distance < 0) << "at " << pose.to_frame(x).transpose() / voxel << " voxels, distance "
                                          << distance / voxel;
  }
  EXPECT_GT(inside, 100);
  EXPECT_GT(outside, 100);
}

TEST(InterfaceMeshInFlight, meshes_in_different_poses_merge_where_they_are) {
  Random random(10);
  for (int n = 0; n < 5; ++n) {
    TwoBodies two{lattice(6, 2 * voxel), lattice(5, 2 * voxel, Vec3(12, 1, -1) * voxel), random.pose(0.1), random.pose(0.1)};
    if (n == 0) two.first = Pose();
    InterfaceMesh a = mesh_of(two.here, voxel, voxel, two.first);
    InterfaceMesh b = mesh_of(two.there_in_its_frame(), voxel, voxel, two.second);
    InterfaceMesh reference = mesh_of(two.here, voxel, voxel, two.first), other = mesh_of(two.there, voxel, voxel, two.first);
    reference.merge(std::move(other));
    a.merge(std::move(b));
    EXPECT_EQ(a.pose(), two.first);
    EXPECT_TRUE(b.empty());
    EXPECT_EQ(b.pose(), two.second);
    std::printf("merged in different poses: volume off by %.1e (relative)\n", a.volume() / reference.volume() - 1);
    EXPECT_NEAR(a.volume(), reference.volume(), 0.02 * reference.volume());
    expect_same_solid(a, reference, two.first, Vec3(-4, -4, -4) * voxel, Vec3(24, 15, 15) * voxel);
    const std::vector<Sphere> again = two.there_in_its_frame();
    b.update(granules_of(again), largest_of(again));  // may be used again, where it was
    EXPECT_TRUE(b.inside(two.first.to_world(two.there[0].centre)));
  }
}

TEST(InterfaceMeshInFlight, a_merge_turns_by_the_difference_of_the_poses_only) {
  // both carried together by a quarter turn and whole voxels: the grids match, and the surface is the one in one frame
  const Pose quarter(Vec3(3, -2, 5) * voxel, Quaterniond(AngleAxisd(M_PI / 2, Vec3::UnitY())));
  const Sphere ball{Vec3(0.3, 0.1, -0.2) * voxel, 8 * voxel};
  InterfaceMesh a(voxel, 0.0), b = mesh_of({ball}, voxel, 0.0, quarter);
  a.merge(std::move(b));
  const Vec3 centre = quarter.to_world(ball.centre);
  EXPECT_NEAR(a.volume(), 4.0 / 3.0 * M_PI * std::pow(ball.radius, 3), 0.02 * a.volume());
  for (const Vec3& out : {Vec3(1, 0, 0), Vec3(0, -1, 0), Vec3(0.6, 0, 0.8), Vec3(-0.6, 0.48, 0.64)}) {
    for (const double offset : {-1.5, -0.5, 0.0, 0.5, 1.5})
      EXPECT_NEAR(a.signed_distance(centre + (ball.radius + offset * voxel) * out), offset * voxel, 0.1 * voxel);
    EXPECT_GT(a.normal(centre + ball.radius * out).dot(out), 0.995);
  }
}

TEST(InterfaceMeshInFlight, a_merge_keeps_cavities_open) {
  // of granules that overlap and leave no pores, around a hole
  std::vector<Sphere> granules = without(lattice(10, 3 * voxel, Vec3(-13, -13, -13) * voxel), {Vec3(2, 1, 0) * voxel, 8 * voxel});
  for (Sphere& s : granules) s.radius = 3 * voxel;
  InterfaceMesh a = mesh_of({{Vec3(-30, 0, 0) * voxel, 5 * voxel}}, voxel, 0.0), b = mesh_of(granules, voxel, 0.0, flown);
  const double separate = a.volume() + b.volume();
  ASSERT_FALSE(b.inside(flown.to_world(Vec3(2, 1, 0) * voxel)));
  a.merge(std::move(b));
  EXPECT_FALSE(a.inside(flown.to_world(Vec3(2, 1, 0) * voxel))) << "a hole within the body is filled";
  EXPECT_NEAR(a.volume(), separate, 0.02 * separate);
}

TEST(InterfaceMeshInFlight, a_merge_with_nothing_changes_nothing) {
  InterfaceMesh mesh = bitten(), nothing(voxel, voxel);
  nothing.set_pose(flown);
  const double volume = mesh.volume();
  mesh.merge(std::move(nothing));
  EXPECT_NEAR(mesh.volume(), volume, 1e-12 * volume);
  EXPECT_FALSE(mesh.inside(flown.to_world(Vec3::Zero())));
  InterfaceMesh into(voxel, voxel);
  into.merge(bitten(flown));
  EXPECT_NEAR(into.volume(), volume, 0.02 * volume);
  EXPECT_TRUE(into.inside(flown.to_world(Vec3(2, 2, 2) * voxel)));
  EXPECT_EQ(into.pose(), Pose());
}

TEST(InterfaceMeshInFlight, a_merge_after_a_merge_stays_where_it_is) {
  Random random(11);
  const Pose a_pose = random.pose(0.1), b_pose = random.pose(0.1), c_pose = random.pose(0.1), later = random.pose(0.5);
  const Vec3 x(0.05, 0.02, 0.01), y(0.06, 0.02, 0.01), z(0.07, 0.02, 0.01);  // world
  InterfaceMesh a = mesh_of({{a_pose.to_frame(x), 6 * voxel}}, voxel, 0.0, a_pose);
  InterfaceMesh b = mesh_of({{b_pose.to_frame(y), 6 * voxel}}, voxel, 0.0, b_pose);
  InterfaceMesh c = mesh_of({{c_pose.to_frame(z), 6 * voxel}}, voxel, 0.0, c_pose);
  b.merge(std::move(c));
  a.merge(std::move(b));
  for (const Vec3& centre : {x, y, z})
    for (const Vec3& side : {Vec3(0, 1, 0), Vec3(0, -0.6, 0.8)})
      EXPECT_NEAR(a.signed_distance(centre + 6 * voxel * side), 0.0, 0.15 * voxel);
  a.set_pose(later);
  EXPECT_NEAR(a.signed_distance(later.to_world(a_pose.to_frame(z + 6 * voxel * Vec3(0, 1, 0)))), 0.0, 0.15 * voxel);
}

// ------------------------------------------------------------------------------------------------------------------- files

TEST(InterfaceMeshInFlight, a_vdb_file_shows_it_where_it_is) {
  const TemporaryFolder folder;
  const std::string file = folder / "m.vdb";
  const InterfaceMesh still = bitten(), moved = bitten(flown);
  write_vdb(file, {&still, &moved}, {"still", "moved"});
  openvdb::io::File in(file);
  in.open();
  Random random(12);
  for (const auto& [title, mesh] : {std::pair<const char*, const InterfaceMesh*>{"still", &still}, {"moved", &moved}}) {
    const auto grid = openvdb::gridPtrCast<openvdb::FloatGrid>(in.readGrid(title));
    ASSERT_TRUE(grid);
    EXPECT_EQ(grid->getGridClass(), openvdb::GRID_LEVEL_SET);
    for (int d = 0; d < 3; ++d) EXPECT_NEAR(grid->voxelSize()[d], voxel, 1e-12 * voxel);
    int inside = 0;
    for (int n = 0; n < 2000; ++n) {
      const Vec3 x = mesh->pose().to_world(Vec3::Constant(4 * voxel) + random.vector(8 * voxel));
      const openvdb::Vec3d at = grid->worldToIndex(openvdb::Vec3d(x[0], x[1], x[2]));
      const float value = openvdb::tools::BoxSampler::sample(grid->constTree(), at);
      ASSERT_NEAR(value, mesh->signed_distance(x), 1e-5 * voxel);
      inside += value < 0;
    }
    EXPECT_GT(inside, 200) << title;
  }
  in.close();
}

}  // namespace
}  // namespace solidcull
