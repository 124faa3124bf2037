#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numeric>
#include <random>
#include <stdexcept>

#include "interface_mesh.h"

namespace solidcull {
namespace {

constexpr double pi = 3.14159265358979323846;
constexpr double voxel = 1e-3;  // m

double ball_volume(double radius) { return 4.0 / 3.0 * pi * radius * radius * radius; }

/// Volume that two balls at this distance have in common.
double lens_volume(double a, double b, double distance) {
  const double overlap = a + b - distance;
  return pi * overlap * overlap * (distance * distance + 2 * distance * (a + b) - 3 * (a - b) * (a - b)) / (12 * distance);
}

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

/// A lattice of n^3 touching granules of diameter d, its first centre at `corner`.
std::vector<Sphere> lattice(int n, double d, const Vec3& corner = Vec3::Zero()) {
  std::vector<Sphere> spheres;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      for (int k = 0; k < n; ++k) spheres.push_back({corner + d * Vec3(i, j, k), d / 2});
  return spheres;
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
  EXPECT_THROW(mesh.add({{Vec3::Zero(), 0.0}}), std::invalid_argument);
  EXPECT_THROW(mesh.add({{Vec3(std::nan(""), 0, 0), 1.0}}), std::invalid_argument);
  EXPECT_THROW(mesh.carve({Vec3::Zero(), -1.0}), std::invalid_argument);
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
  InterfaceMesh mesh(voxel, 0.0);
  mesh.add({ball});
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
    InterfaceMesh mesh(voxel, closing);
    mesh.add({ball});
    // The closed surface may lie 0.04 voxels off, which is 2 % of this ball.
    EXPECT_NEAR(mesh.volume(), ball_volume(ball.radius), 0.02 * ball_volume(ball.radius)) << closing;
    const Vec3 out = Vec3(1, 2, -0.5).normalized();
    for (const double offset : {-2.0, -1.0, 0.0, 1.0, 2.0})
      EXPECT_NEAR(mesh.signed_distance(ball.centre + (ball.radius + offset * voxel) * out), offset * voxel, 0.1 * voxel)
          << closing;
  }
}

TEST(InterfaceMesh, a_carve_takes_the_lens_away) {
  const Sphere body{Vec3(0.001, 0.002, 0.0), 14.0 * voxel};
  InterfaceMesh mesh(voxel, 0.0);
  mesh.add({body});
  const double before = mesh.volume();
  const Sphere carve{body.centre + Vec3(10.2, 3.3, -2.1) * voxel, 8.5 * voxel};
  mesh.carve(carve);
  const double lens = lens_volume(body.radius, carve.radius, (carve.centre - body.centre).norm());
  EXPECT_NEAR(before - mesh.volume(), lens, 0.01 * lens);
  EXPECT_FALSE(mesh.inside(carve.centre));
}

TEST(InterfaceMesh, a_carve_within_leaves_a_cavity_of_its_own_size) {
  InterfaceMesh mesh(voxel, 0.0);
  mesh.add({{Vec3::Zero(), 16.0 * voxel}});
  const double before = mesh.volume();
  mesh.carve({Vec3(1, 2, 3) * voxel, 7.0 * voxel});
  EXPECT_NEAR(before - mesh.volume(), ball_volume(7.0 * voxel), 5e-3 * ball_volume(7.0 * voxel));
  EXPECT_EQ(topology_of(mesh.triangles()).components, 2);
}

TEST(InterfaceMesh, a_carve_that_swallows_the_body_empties_it) {
  InterfaceMesh mesh(voxel, voxel);
  mesh.add(lattice(3, 2 * voxel));
  EXPECT_FALSE(mesh.empty());
  mesh.carve({Vec3(2, 2, 2) * voxel, 12 * voxel});
  EXPECT_TRUE(mesh.empty());
  EXPECT_TRUE(mesh.triangles().triangles.empty());
}

TEST(InterfaceMesh, carves_equal_their_union_whatever_their_order) {
  const Sphere body{Vec3::Zero(), 20.0 * voxel};
  const std::vector<std::vector<Sphere>> cases = {
      {{Vec3(8, 0, 0) * voxel, 9 * voxel}, {Vec3(9, 1, 0) * voxel, 4 * voxel}},   // nested
      {{Vec3(-7, 0, 0) * voxel, 6 * voxel}, {Vec3(5, 0, 0) * voxel, 6 * voxel}},  // touching
      {{Vec3(-4, 0, 3) * voxel, 7 * voxel}, {Vec3(4, 2, 0) * voxel, 8 * voxel}, {Vec3(0, 15, 0) * voxel, 9 * voxel}}};
  for (const auto& carves : cases) {
    InterfaceMesh forward(voxel, 0.0), backward(voxel, 0.0), in_steps(voxel, 0.0);
    for (InterfaceMesh* m : {&forward, &backward, &in_steps}) m->add({body});
    for (std::size_t n = 0; n < carves.size(); ++n) {
      forward.carve(carves[n]);
      backward.carve(carves[carves.size() - 1 - n]);
      in_steps.carve(carves[n]);
      in_steps.active_voxels();  // a question works off the queue
    }
    at_sample_points(Vec3::Constant(-0.022), Vec3::Constant(0.022), [&](const Vec3& p) {
      EXPECT_EQ(forward.signed_distance(p), backward.signed_distance(p));
      EXPECT_EQ(forward.signed_distance(p), in_steps.signed_distance(p));
      double expected = p.norm() - body.radius;
      for (const Sphere& c : carves) expected = std::max(expected, c.radius - (p - c.centre).norm());
      // Trilinear interpolation rounds the edges where carves meet, by less than half a voxel's diagonal.
      if (std::abs(expected) > 0.87 * voxel) {
        EXPECT_EQ(forward.inside(p), expected < 0) << p.transpose();
      }
    });
  }
}

TEST(InterfaceMesh, a_union_does_not_depend_on_the_order) {
  std::vector<Sphere> granules = lattice(5, 2.1 * voxel, Vec3(0.3e-3, 0, 0));
  for (std::size_t n = 0; n < granules.size(); ++n) granules[n].radius *= 1.0 + 0.1 * std::sin(double(n));
  std::vector<Sphere> shuffled = granules;
  std::shuffle(shuffled.begin(), shuffled.end(), std::mt19937(3));
  for (const double closing : {0.0, 1.2 * voxel}) {
    InterfaceMesh a(voxel, closing), b(voxel, closing);
    a.add(granules);
    b.add(shuffled);
    at_sample_points(Vec3::Constant(-3 * voxel), Vec3::Constant(14 * voxel),
                     [&](const Vec3& p) { EXPECT_NEAR(a.signed_distance(p), b.signed_distance(p), 1e-6 * voxel); });
  }
  InterfaceMesh one_by_one(voxel, 0.0), backwards(voxel, 0.0), together(voxel, 0.0);
  for (std::size_t n = 0; n < granules.size(); ++n) {
    one_by_one.add({granules[n]});
    backwards.add({granules[granules.size() - 1 - n]});
  }
  together.add(granules);
  at_sample_points(Vec3::Constant(-3 * voxel), Vec3::Constant(14 * voxel), [&](const Vec3& p) {
    EXPECT_EQ(one_by_one.signed_distance(p), backwards.signed_distance(p));
    EXPECT_EQ(one_by_one.inside(p), together.inside(p));
  });
}

TEST(InterfaceMesh, questions_do_not_change_the_answer) {
  InterfaceMesh asked(voxel, voxel), unasked(voxel, voxel);
  for (int n = 0; n < 6; ++n)
    for (InterfaceMesh* m : {&asked, &unasked}) {
      m->add(lattice(2, 2 * voxel, Vec3(4.5 * n, 0, 0) * voxel));
      if (n == 3) m->carve({Vec3(10, 0, 0) * voxel, 4 * voxel});
      if (m == &asked) m->volume();
    }
  EXPECT_EQ(asked.volume(), unasked.volume());
  EXPECT_EQ(asked.active_voxels(), unasked.active_voxels());
}

TEST(InterfaceMesh, two_solids_one_voxel_apart_stay_two) {
  for (const double shift : {0.0, 0.25, 0.5, 0.8}) {
    InterfaceMesh mesh(voxel, 0.0);
    const Vec3 at = Vec3(shift, 0.3 * shift, 0.0) * voxel;
    // Two plates, each of granules that overlap much, so that their flat sides face each other over one voxel.
    std::vector<Sphere> plates;
    for (int j = 0; j < 12; ++j)
      for (int k = 0; k < 12; ++k)
        for (const int side : {-1, 1}) plates.push_back({at + Vec3(side * 3.5, j, k) * voxel, 3 * voxel});
    mesh.add(plates);
    const Topology topology = topology_of(mesh.triangles());
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
    InterfaceMesh mesh(voxel, closing);
    mesh.add(granules);
    EXPECT_EQ(topology_of(mesh.triangles()).components, static_cast<int>(granules.size())) << closing;
  }
}

TEST(InterfaceMesh, of_a_lattice_has_no_inner_surface) {
  const double d = 2 * voxel;
  for (const double closing : {0.5 * d, 1.0 * d}) {
    InterfaceMesh mesh(voxel, closing);
    mesh.add(lattice(10, d, Vec3(0.21, 0.37, 0.11) * voxel));
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
  InterfaceMesh mesh(voxel, 0.6 * d);
  mesh.add(shell);
  EXPECT_FALSE(mesh.inside(Vec3::Constant(6 * d)));
  EXPECT_EQ(topology_of(mesh.triangles()).components, 2);
}

TEST(InterfaceMesh, closes_the_pores_between_new_granules_and_context) {
  const double d = 2 * voxel, closing = 0.5 * d;
  std::vector<Sphere> below, above, all = lattice(8, d);
  for (const Sphere& s : all) (s.centre.z() < 3.5 * d ? below : above).push_back(s);
  InterfaceMesh together(voxel, closing), in_turn(voxel, closing), apart(voxel, closing);
  together.add(all);
  in_turn.add(below);
  in_turn.add(above, below);
  apart.add(below);
  apart.add(above);
  const Vec3 pore = d * Vec3(3.5, 3.5, 3.5);
  EXPECT_TRUE(in_turn.inside(pore));
  EXPECT_EQ(topology_of(in_turn.triangles()).components, 1);
  EXPECT_NEAR(in_turn.volume(), together.volume(), 0.01 * together.volume());
  EXPECT_LT(apart.volume(), in_turn.volume());
}

TEST(InterfaceMesh, an_addition_changes_nothing_farther_than_two_closings) {
  const double d = 2 * voxel, closing = 0.5 * d;
  InterfaceMesh mesh(voxel, closing);
  const std::vector<Sphere> bed = lattice(12, d);
  mesh.add(bed);
  const Vec3 hole = d * Vec3(5.5, 5.5, 5.5);
  mesh.carve({hole, 4 * d});
  const Sphere back{hole, d / 2};
  std::vector<Sphere> context;
  for (const Sphere& s : bed)
    if ((s.centre - hole).norm() < 6 * d) context.push_back(s);
  mesh.add({back}, context);
  EXPECT_TRUE(mesh.inside(hole));
  const Vec3 out = Vec3(1, 1, 0.2).normalized();
  EXPECT_FALSE(mesh.inside(hole + 3 * d * out)) << "the context filled the hole again";
}

TEST(InterfaceMesh, merged_bodies_are_their_union_and_leave_nothing_behind) {
  InterfaceMesh a(voxel, voxel), b(voxel, voxel), both(voxel, voxel);
  const std::vector<Sphere> left = lattice(4, 2 * voxel), right = lattice(4, 2 * voxel, Vec3(8, 1, 0) * voxel);
  a.add(left);
  b.add(right);
  b.carve({Vec3(12, 1, 0) * voxel, 4 * voxel});
  both.add(left);
  const double separate = a.volume() + b.volume();
  a.merge(std::move(b));
  EXPECT_TRUE(b.empty());
  EXPECT_NEAR(a.volume(), separate, 0.03 * separate);  // they touch
  EXPECT_TRUE(a.inside(right[5].centre));
  b.add(right);  // an emptied mesh may be used again
  EXPECT_FALSE(b.empty());
}

TEST(InterfaceMesh, bytes_give_the_same_mesh_back) {
  InterfaceMesh mesh(voxel, voxel);
  mesh.add(lattice(5, 2 * voxel));
  mesh.carve({Vec3(8, 8, 8) * voxel, 5 * voxel});
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
    InterfaceMesh mesh(voxel, voxel);
    mesh.add(lattice(9, 2.05 * voxel));
    volumes.push_back(mesh.volume());
  }
  EXPECT_EQ(volumes[0], volumes[1]);
  EXPECT_THROW(set_geometry_threads(0), std::invalid_argument);
}

TEST(InterfaceMesh, questions_cost_no_pass_over_the_grid_while_nothing_changes) {
  InterfaceMesh mesh(voxel, 0.0);
  mesh.add(lattice(6, 8e-3));
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
  mesh.carve({Vec3::Zero(), 5e-3});
  ask();
  EXPECT_EQ(mesh.passes(), 2 * first);
  mesh.carve({Vec3(20e-3, 20e-3, 20e-3), 0.1});
  EXPECT_TRUE(mesh.empty());
}

}  // namespace
}  // namespace solidcull
