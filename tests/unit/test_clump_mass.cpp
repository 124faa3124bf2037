#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <array>

#include "clump_mass.h"

namespace solidcull {
namespace {

constexpr double mass_of_a_point = 0.3;  // kg
const std::array<Vec3, 5> points = {Vec3(1, 0, 0), Vec3(-1, 0.5, 0), Vec3(0.2, -0.4, 0.9), Vec3(0.1, 0.3, -0.7), Vec3(0, 0, 0.4)};

Vec3 centre_of_points() {
  Vec3 sum = Vec3::Zero();
  for (const Vec3& x : points) sum += x;
  return sum / points.size();
}

/// Sum of m x x^T about their centre.
Eigen::Matrix3d second_of_points() {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const Vec3& x : points) sum += mass_of_a_point * (x - centre_of_points()) * (x - centre_of_points()).transpose();
  return sum;
}

ClumpMass of_points() {
  const Eigen::Matrix3d second = second_of_points();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(second.trace() * Eigen::Matrix3d::Identity() - second);
  Eigen::Matrix3d turn = axes.eigenvectors();
  if (turn.determinant() < 0) turn.col(0) *= -1;
  return {centre_of_points(), Eigen::Quaterniond(turn), axes.eigenvalues()};
}

TEST(ClumpMass, says_how_masses_lie_about_their_centre) {
  const ClumpMass c = of_points();
  const Eigen::Matrix3d second = second_of_points();
  EXPECT_LT((c.second() - second).norm(), 1e-14 * second.norm());
  EXPECT_LT((c.tensor() - (second.trace() * Eigen::Matrix3d::Identity() - second)).norm(), 1e-14 * second.norm());
}

TEST(ClumpMass, lies_in_a_frame_as_its_masses_do) {
  const Pose here(Vec3(0.1, -2, 3), Eigen::Quaterniond(0.3, 0.5, -0.7, 0.1).normalized()),
      there(Vec3(-1, 0.5, 0.2), Eigen::Quaterniond(0.9, -0.1, 0.2, 0.4).normalized());
  const ClumpMass c = of_points(), world = c.in_world(here), seen = c.seen_from(here, there);
  const Eigen::Matrix3d turn = here.turn(), second = turn * c.second() * turn.transpose();
  EXPECT_LT((world.centre - here.to_world(c.centre)).norm(), 1e-15);
  EXPECT_LT((world.second() - second).norm(), 1e-14 * second.norm());
  EXPECT_GT((world.second() - c.second()).norm(), 0.1 * second.norm());  // it matters
  EXPECT_LT((seen.in_world(there).centre - world.centre).norm(), 1e-14);
  EXPECT_LT((seen.in_world(there).second() - second).norm(), 1e-14 * second.norm());

  ClumpMass changed = c;
  changed.reframe(here, there);
  EXPECT_EQ(changed.centre, seen.centre);
  changed.to_world(there);
  changed.to_frame(here);
  EXPECT_LT((changed.centre - c.centre).norm(), 1e-14);
  EXPECT_LT((changed.second() - c.second()).norm(), 1e-14 * second.norm());
  changed.move(Vec3(1, 2, 3));
  EXPECT_LT((changed.centre - c.centre - Vec3(1, 2, 3)).norm(), 1e-14);
  EXPECT_LT((changed.second() - c.second()).norm(), 1e-14 * second.norm());
}

}  // namespace
}  // namespace solidcull
