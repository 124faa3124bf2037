#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numeric>
#include <random>
#include <stdexcept>

#include "interface_mesh.h"
#include "mesh_of.h"

namespace solidcull {
namespace {

constexpr double pi = 3.14159265358979323846;

double ball_volume(double radius) { return 4.0 / 3.0 * pi * radius * radius * radius; }

struct Topology {
  int components = 0;
  int euler = 0;
  bool closed = true;  // each edge borders exactly one triangle each way round
};

Topology topology_of(const TriangleMesh& mesh) {
  std::vector<std::uint32_t> parent(mesh.vertices.size());
  std::iota(parent.begin(), parent.end(), 0u);
  const auto root = [&](std::uint32_t v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> half_edges;
  for (const auto& t : mesh.triangles)
    for (int n = 0; n < 3; ++n) {
      const std::uint32_t a = t[n], b = t[(n + 1) % 3];
      ++half_edges[{a, b}];
      parent[root(a)] = root(b);
    }
  Topology topology;
  for (std::uint32_t v = 0; v < parent.size(); ++v) topology.components += parent[v] == v;
  for (const auto& [edge, times] : half_edges) {
    const auto twin = half_edges.find({edge.second, edge.first});
    if (times != 1 || twin == half_edges.end()) topology.closed = false;
  }
  topology.euler =
      static_cast<int>(mesh.vertices.size()) - static_cast<int>(half_edges.size() / 2) + static_cast<int>(mesh.triangles.size());
  return topology;
}

/// Points on a fixed pattern around a body, where two meshes are compared.
template <class Compare>
void at_sample_points(const Vec3& lo, const Vec3& hi, const Compare& compare) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> u(0.0, 1.0);
  for (int n = 0; n < 5000; ++n) compare(Vec3(lo.array() + (hi - lo).array() * Vec3(u(random), u(random), u(random)).array()));
}

TEST(InterfaceMesh, refuses_lengths_without_meaning) {
  EXPECT_THROW(InterfaceMesh(0.0, 0.0), std::invalid_argument);
  EXPECT_THROW(InterfaceMesh(-1.0, 0.0), std::invalid_argument);
  EXPECT_THROW(InterfaceMesh(std::nan(""), 0.0), std::invalid_argument);
  EXPECT_THROW(InterfaceMesh(1.0, -0.1), std::invalid_argument);
  InterfaceMesh mesh(voxel, 0.0);
  const std::vector<Sphere> wrong = {{Vec3::Zero(), 0.0}, {Vec3(std::nan(""), 0, 0), 1.0}, {Vec3::Zero(), -1.0}}, none;
  for (const Sphere& s : wrong) {
    EXPECT_THROW(mesh.touch(s), std::invalid_argument);
    EXPECT_THROW(mesh.leave_out({s}, granules_of(none), 0.0), std::invalid_argument);
    const InterfaceMesh::Gather gives_it = [&](const Vec3&, const Vec3&, const auto& visit) { visit(s); };
    EXPECT_THROW(mesh.update(gives_it, 1.0), std::invalid_argument);
  }
  EXPECT_THROW(mesh.merge(InterfaceMesh(2 * voxel, 0.0)), std::invalid_argument);
}

TEST(InterfaceMesh, is_empty_at_first) {
  const InterfaceMesh mesh(voxel, voxel);
  Vec3 lo, hi;
  mesh.bounds(lo, hi);
  EXPECT_TRUE(mesh.empty());
  EXPECT_FALSE(mesh.inside(Vec3::Zero()));
  EXPECT_EQ(mesh.volume(), 0.0);
  EXPECT_EQ(lo, Vec3(Vec3::Zero()));
  EXPECT_EQ(hi, Vec3(Vec3::Zero()));
  EXPECT_TRUE(mesh.triangles().triangles.empty());
  EXPECT_NEAR(mesh.half_width(), 3 * voxel, 1e-9);
}

TEST(InterfaceMesh, of_one_ball_is_that_ball) {
  const Sphere ball{Vec3(0.0123, -0.0271, 0.0048), 10.3 * voxel};
  const InterfaceMesh mesh = mesh_of({ball}, voxel, 0.0);
  EXPECT_NEAR(mesh.volume(), ball_volume(ball.radius), 1e-3 * ball_volume(ball.radius));
  EXPECT_TRUE(mesh.inside(ball.centre));

  Vec3 lo, hi;
  mesh.bounds(lo, hi);
  for (int d = 0; d < 3; ++d) {
    EXPECT_NEAR(lo[d], ball.centre[d] - ball.radius, 0.05 * voxel);
    EXPECT_NEAR(hi[d], ball.centre[d] + ball.radius, 0.05 * voxel);
  }
  const Vec3 out = Vec3(1, 2, -0.5).normalized();
  for (const double offset : {-1.5, -0.5, 0.0, 0.5, 1.5}) {
    const Vec3 p = ball.centre + (ball.radius + offset * voxel) * out;
    EXPECT_NEAR(mesh.signed_distance(p), offset * voxel, 0.05 * voxel);
    EXPECT_GT(mesh.normal(p).dot(out), 0.999);
  }
  EXPECT_EQ(mesh.normal(Vec3(1, 1, 1)), Vec3(Vec3::Zero()));

  const TriangleMesh triangles = mesh.triangles();
  for (const auto& t : triangles.triangles) {
    const Vec3 &a = triangles.vertices[t[0]], &b = triangles.vertices[t[1]], &c = triangles.vertices[t[2]];
    EXPECT_GT((b - a).cross(c - a).dot(a - ball.centre), 0.0) << "a triangle's normal points inwards";
  }
}

TEST(InterfaceMesh, closing_gives_a_ball_back) {
  const Sphere ball{Vec3(0.0123, -0.0271, 0.0048), 6.3 * voxel};
  for (const double closing : {0.4 * voxel, 1.0 * voxel, 2.7 * voxel, 8.0 * voxel}) {
    const InterfaceMesh mesh = mesh_of({ball}, voxel, closing);
    // The closed surface may lie 0.04 voxels off, which is 2 % of this ball.
    EXPECT_NEAR(mesh.volume(), ball_volume(ball.radius), 0.02 * ball_volume(ball.radius)) << closing;
    const Vec3 out = Vec3(1, 2, -0.5).normalized();
    for (const double offset : {-2.0, -1.0, 0.0, 1.0, 2.0})
      EXPECT_NEAR(mesh.signed_distance(ball.centre + (ball.radius + offset * voxel) * out), offset * voxel, 0.1 * voxel)
          << closing;
  }
}

TEST(InterfaceMesh, a_union_does_not_depend_on_the_order) {
  std::vector<Sphere> granules = lattice(5, 2.1 * voxel, Vec3(0.3e-3, 0, 0));
  for (std::size_t n = 0; n < granules.size(); ++n) granules[n].radius *= 1.0 + 0.1 * std::sin(double(n));
  std::vector<Sphere> shuffled = granules;
  std::shuffle(shuffled.begin(), shuffled.end(), std::mt19937(3));
  for (const double closing : {0.0, 1.2 * voxel}) {
    const InterfaceMesh a = mesh_of(granules, voxel, closing), b = mesh_of(shuffled, voxel, closing);
    at_sample_points(Vec3::Constant(-3 * voxel), Vec3::Constant(14 * voxel),
                     [&](const Vec3& p) { EXPECT_NEAR(a.signed_distance(p), b.signed_distance(p), 1e-6 * voxel); });
  }
}

TEST(InterfaceMesh, two_solids_one_voxel_apart_stay_two) {
  for (const double shift : {0.0, 0.25, 0.5, 0.8}) {
    const Vec3 at = Vec3(shift, 0.3 * shift, 0.0) * voxel;
    // Two plates, each of granules that overlap much, so that their flat sides face each other over one voxel.
    std::vector<Sphere> plates;
    for (int j = 0; j < 12; ++j)
      for (int k = 0; k < 12; ++k)
        for (const int side : {-1, 1}) plates.push_back({at + Vec3(side * 3.5, j, k) * voxel, 3 * voxel});
    const Topology topology = topology_of(mesh_of(plates, voxel, 0.0).triangles());
    EXPECT_EQ(topology.components, 2) << "shift " << shift;
    EXPECT_TRUE(topology.closed);
  }
}

TEST(InterfaceMesh, loses_no_small_sphere) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> u(0.0, 1.0);
  for (const double closing : {0.0, 0.5 * voxel, 1.5 * voxel}) {
    std::vector<Sphere> granules;
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j)
        for (int k = 0; k < 4; ++k)
          granules.push_back({(Vec3(i, j, k) * 9 + Vec3(u(random), u(random), u(random))) * voxel, 0.3 * voxel});
    granules.push_back({Vec3(-8.5, 0.5, 0.5) * voxel, 0.01 * voxel});  // as far from all voxel centres as can be
    const InterfaceMesh mesh = mesh_of(granules, voxel, closing);
    EXPECT_EQ(topology_of(mesh.triangles()).components, static_cast<int>(granules.size())) << closing;
  }
}

TEST(InterfaceMesh, of_a_lattice_has_no_inner_surface) {
  const double d = 2 * voxel;
  for (const double closing : {0.5 * d, 1.0 * d}) {
    const InterfaceMesh mesh = mesh_of(lattice(10, d, Vec3(0.21, 0.37, 0.11) * voxel), voxel, closing);
    const TriangleMesh triangles = mesh.triangles();
    const Topology topology = topology_of(triangles);
    EXPECT_EQ(topology.components, 1);
    EXPECT_EQ(topology.euler, 2);
    EXPECT_TRUE(topology.closed);
    // Between the granules' centres all is solid, and nothing stands out of the granules' box.
    for (int n = 0; n < 1000; ++n) {
      const Vec3 p = Vec3(0.21, 0.37, 0.11) * voxel + d * Vec3(n % 10, n / 10 % 10, n / 100) * 0.999;
      EXPECT_TRUE(mesh.inside(p));
    }
    EXPECT_LT(mesh.volume(), std::pow(10 * d, 3));
    EXPECT_GT(mesh.volume(), std::pow(9 * d, 3));
    Vec3 lo, hi;
    mesh.bounds(lo, hi);
    EXPECT_NEAR(hi.x() - lo.x(), 10 * d, 0.3 * voxel);
  }
}

TEST(InterfaceMesh, a_cavity_wider_than_closing_stays_open) {
  const double d = 2 * voxel;
  std::vector<Sphere> shell;
  for (const Sphere& s : lattice(13, d))
    if ((s.centre - Vec3::Constant(6 * d)).norm() > 3.5 * d) shell.push_back(s);
  const InterfaceMesh mesh = mesh_of(shell, voxel, 0.6 * d);
  EXPECT_FALSE(mesh.inside(Vec3::Constant(6 * d)));
  EXPECT_EQ(topology_of(mesh.triangles()).components, 2);
}

TEST(InterfaceMesh, bytes_give_the_same_mesh_back) {
  const InterfaceMesh mesh = mesh_of(without(lattice(5, 2 * voxel), {Vec3(8, 8, 8) * voxel, 5 * voxel}), voxel, voxel);
  const std::string bytes = mesh.to_bytes();
  const InterfaceMesh copy = InterfaceMesh::from_bytes(bytes, voxel, voxel);
  EXPECT_EQ(copy.active_voxels(), mesh.active_voxels());
  EXPECT_EQ(copy.volume(), mesh.volume());
  at_sample_points(Vec3::Constant(-3 * voxel), Vec3::Constant(12 * voxel),
                   [&](const Vec3& p) { EXPECT_EQ(copy.signed_distance(p), mesh.signed_distance(p)); });
  EXPECT_TRUE(InterfaceMesh::from_bytes(InterfaceMesh(voxel, 0.0).to_bytes(), voxel, 0.0).empty());
  EXPECT_THROW(InterfaceMesh::from_bytes(bytes, 2 * voxel, voxel), std::runtime_error);
  EXPECT_THROW(InterfaceMesh::from_bytes("no grid at all", voxel, voxel), std::runtime_error);
  EXPECT_THROW(InterfaceMesh::from_bytes(bytes.substr(0, bytes.size() / 2), voxel, voxel), std::runtime_error);
}

TEST(InterfaceMesh, one_thread_or_two_give_the_same_mesh) {
  std::vector<double> volumes;
  for (const int threads : {1, 2}) {
    set_geometry_threads(threads);
    const InterfaceMesh mesh = mesh_of(lattice(9, 2.05 * voxel), voxel, voxel);
    volumes.push_back(mesh.volume());
  }
  EXPECT_EQ(volumes[0], volumes[1]);
  EXPECT_THROW(set_geometry_threads(0), std::invalid_argument);
}

TEST(InterfaceMesh, questions_cost_no_pass_over_the_grid_while_nothing_changes) {
  std::vector<Sphere> granules = lattice(6, 8e-3);
  InterfaceMesh mesh = mesh_of(granules, voxel, 0.0);
  Vec3 lo, hi;
  const auto ask = [&] {
    EXPECT_FALSE(mesh.empty());
    mesh.bounds(lo, hi);
    mesh.signed_distance(Vec3::Zero());
    mesh.volume();
  };
  ask();
  const std::size_t first = mesh.passes();
  EXPECT_LE(first, 3u);
  for (int n = 0; n < 100; ++n) {
    mesh.set_pose(Pose(Vec3(1e-3 * n, 0, 0), Eigen::Quaterniond::Identity()));
    ask();
  }
  EXPECT_EQ(mesh.passes(), first);
  mesh.touch(granules.back());
  granules.pop_back();
  mesh.update(granules_of(granules), largest_of(granules));
  ask();
  EXPECT_EQ(mesh.passes(), 2 * first);
}

TEST(InterfaceMesh, merged_bodies_are_their_union_and_leave_nothing_behind) {
  const std::vector<Sphere> left = lattice(4, 2 * voxel);
  const std::vector<Sphere> right = without(lattice(4, 2 * voxel, Vec3(8, 1, 0) * voxel), {Vec3(12, 1, 0) * voxel, 4 * voxel});
  InterfaceMesh a = mesh_of(left, voxel, voxel), b = mesh_of(right, voxel, voxel);
  const double separate = a.volume() + b.volume();
  a.merge(std::move(b));
  EXPECT_TRUE(b.empty());
  EXPECT_NEAR(a.volume(), separate, 0.03 * separate);  // they touch
  EXPECT_TRUE(a.inside(right[5].centre));
  b.update(granules_of(right), largest_of(right));  // an emptied mesh may be used again
  EXPECT_FALSE(b.empty());
}

}  // namespace
}  // namespace solidcull
