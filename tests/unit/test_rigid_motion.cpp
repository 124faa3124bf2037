#include <gtest/gtest.h>

#include <algorithm>
#include <boost/math/quadrature/gauss.hpp>
#include <boost/math/special_functions/jacobi_elliptic.hpp>
#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

#include "rigid_motion.h"

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
  /// Granules of 1 mm in a cube of 2 cm, with motions of their own.
  std::vector<RigidPart> granules(int n, double speed = 1.0, double spin = 50.0) {
    std::vector<RigidPart> all;
    for (int k = 0; k < n; ++k) {
      const double r = between(0.5e-3, 1e-3);
      const Vec3 x = vector(0.01), v = vector(speed), w = vector(spin);
      all.push_back(RigidPart::granule(1e4 * r * r * r, r, x, v, w));
    }
    return all;
  }
  /// Parts that are no balls: inertia of any principal axes.
  std::vector<RigidPart> parts(int n) {
    std::vector<RigidPart> all = granules(n);
    for (RigidPart& p : all) {
      const Matrix3d axes = turn().toRotationMatrix();
      const double a = between(1, 3), b = between(1, 3), c = between(2, 4);
      p.inertia = p.inertia(0, 0) * axes * Vec3(b + c, a + c, a + b).asDiagonal() * axes.transpose();
    }
    return all;
  }

 private:
  std::mt19937 engine_;
};

/// Momentum, angular momentum about the world's origin, and the sums of their sizes: what is kept, and against what it is
/// measured.
struct Momenta {
  Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
  double linear_sizes = 0, angular_sizes = 0, energy = 0;
};

Momenta momenta_of(const std::vector<RigidPart>& parts) {
  Momenta m;
  for (const RigidPart& p : parts) {
    const Vec3 angular = p.angular_momentum(Vec3::Zero());
    m.linear += p.mass * p.velocity;
    m.linear_sizes += p.mass * p.velocity.norm();
    m.angular += angular;
    m.angular_sizes += angular.norm();
    m.energy += p.kinetic_energy();
  }
  return m;
}

/// The parts where a rigid body carries them: placed by the pose, moved by the velocity field.
std::vector<RigidPart> carried(const std::vector<RigidPart>& parts, const Pose& pose, const Twist& field) {
  std::vector<RigidPart> now = parts;
  for (RigidPart& p : now) {
    p.centre = pose.to_world(p.centre);
    p.inertia = pose.turn() * p.inertia * pose.turn().transpose();
    p.velocity = field.at(p.centre);
    p.spin = field.spin;
  }
  return now;
}

double angle_between(const Matrix3d& a, const Matrix3d& b) {
  return 2 * std::asin(std::min(1.0, (a - b).norm() / std::sqrt(8.0)));  // |A - B| = sqrt(8) sin(angle / 2)
}

Matrix3d turned(double angle, const Vec3& axis) { return AngleAxisd(angle, axis.normalized()).toRotationMatrix(); }

/// A body at the origin with this inertia and spin.
RigidMotion top(const Matrix3d& inertia, const Vec3& spin) {
  const RigidPart part{2.0, Vec3::Zero(), inertia, Vec3::Zero(), spin};
  return RigidMotion(&part, 1);
}

/// Attitude after n steps of free flight, from the identity.
Pose flown(RigidMotion& motion, int n, double dt) {
  Pose pose;
  for (int k = 0; k < n; ++k) pose.advance(motion.drift(dt));
  return pose;
}

/// A step of the engine's integrator with a force and torque that do not change.
RigidStep verlet(RigidMotion& motion, const Vec3& force, const Vec3& torque, double dt) {
  motion.kick(force, torque, 0.5 * dt);
  const RigidStep step = motion.drift(dt);
  motion.kick(force, torque, 0.5 * dt);
  return step;
}

// ------------------------------------------------------------------------------------------------------------ small pieces

TEST(Rotation, is_that_of_the_vector_down_to_the_smallest) {
  const Vec3 axis = Vec3(1, -2, 3).normalized();
  for (const double angle : {0.0, 1e-300, 1e-12, 1e-5, 1.99e-4, 2.01e-4, 1e-3, 0.3, 3.0, M_PI, 6.0}) {
    const Quaterniond q = rotation(angle * axis);
    EXPECT_NEAR(q.norm(), 1.0, 1e-15) << angle;
    EXPECT_LE((q.coeffs() - Quaterniond(AngleAxisd(angle, axis)).coeffs()).norm(), 1e-15) << angle;
    EXPECT_LE((q.vec() - std::sin(0.5 * angle) * axis).norm(), 1e-15 * angle) << angle << ": relative to a small angle";
  }
}

TEST(Twist, is_the_velocity_field_of_a_rigid_motion) {
  const Twist t{Vec3(1, 2, 3), Vec3(0.1, 0.2, 0.3), Vec3(0, 0, 2)};
  EXPECT_EQ(t.at(t.point), t.velocity);
  EXPECT_LE((t.at(Vec3(2, 2, 9)) - Vec3(0.1, 2.2, 0.3)).norm(), 1e-15);
}

TEST(RigidPart, a_granule_is_a_homogeneous_ball) {
  const RigidPart g = RigidPart::granule(3.0, 0.5, Vec3(1, 2, 3), Vec3(0, 4, 0), Vec3(0, 0, 10));
  EXPECT_LE((g.inertia - 0.4 * 3.0 * 0.25 * Matrix3d::Identity()).norm(), 1e-16);
  EXPECT_LE((g.angular_momentum(Vec3(0, 2, 3)) - Vec3(0, 0, 3.0 + 12.0)).norm(), 1e-14);
  EXPECT_DOUBLE_EQ(g.kinetic_energy(), 0.5 * 3 * 16 + 0.5 * 0.3 * 100);
}

// ------------------------------------------------------------------------------------------------------------- free flight

TEST(RigidMotion, free_flight_keeps_momentum_and_angular_momentum) {
  double worst_linear = 0, worst_angular = 0, worst_energy = 0, worst_place = 0;
  for (unsigned seed = 0; seed < 5; ++seed) {
    Random random(seed);
    const std::vector<RigidPart> parts = random.granules(12);
    RigidMotion motion(parts.data(), 12);
    const Momenta before = momenta_of(carried(parts, Pose(), motion.twist()));
    const Vec3 start = motion.centre(), velocity = motion.velocity();
    Pose pose;
    for (int n = 1; n <= 10000; ++n) {
      pose.advance(motion.drift(1e-4));
      if (n % 100) continue;
      const Momenta now = momenta_of(carried(parts, pose, motion.twist()));
      worst_linear = std::max(worst_linear, (now.linear - before.linear).norm() / before.linear.norm());
      worst_angular = std::max(worst_angular, (now.angular - before.angular).norm() / before.angular.norm());
      worst_energy = std::max(worst_energy, std::abs(now.energy - before.energy) / before.energy);
      worst_place = std::max(worst_place, (motion.centre() - start - n * 1e-4 * velocity).norm() / (n * 1e-4 * velocity.norm()));
    }
    EXPECT_GT(motion.spin().norm(), 1.0) << "a body that does not turn shows nothing";
  }
  std::printf(
      "10000 steps of free flight: momentum %.1e, angular momentum %.1e, energy %.1e, place of the centre %.1e (relative)\n",
      worst_linear, worst_angular, worst_energy, worst_place);
  EXPECT_LE(worst_linear, 1e-10);
  EXPECT_LE(worst_angular, 1e-10);
  EXPECT_LE(worst_energy, 1e-6);  // the midpoint rule keeps it to second order
  EXPECT_LE(worst_place, 1e-10);
}

/// A top with I1 = I2, standing askew: precession about L at L / I1, turning about its own axis at L3 (1/I3 - 1/I1).
struct SymmetricTop {
  double i1, i3;
  Matrix3d axes;
  Vec3 spin;  // world frame, at t = 0

  Matrix3d inertia() const { return axes * Vec3(i1, i1, i3).asDiagonal() * axes.transpose(); }
  Matrix3d attitude(double t) const {
    const Vec3 angular = inertia() * spin, own = axes.col(2);
    const double precession = angular.norm() / i1, nutation_free = angular.dot(own) * (1 / i3 - 1 / i1);
    return turned(precession * t, angular) * turned(nutation_free * t, own);
  }
};

TEST(RigidMotion, a_symmetric_top_precesses_as_the_formula_says) {
  Random random(11);
  double worst = 0;
  for (const double i3 : {0.3, 1.9}) {  // a needle and a disc
    const SymmetricTop t{1.0, i3, random.turn().toRotationMatrix(), Vec3(4, -5, 7)};
    RigidMotion motion = top(t.inertia(), t.spin);
    Pose pose;
    for (int n = 1; n <= 10000; ++n) {
      pose.advance(motion.drift(1e-4));
      if (n % 500 == 0) worst = std::max(worst, angle_between(pose.turn(), t.attitude(n * 1e-4)));
    }
    EXPECT_GT(angle_between(pose.turn(), Matrix3d::Identity()), 0.1);
  }
  std::printf("symmetric top, 10000 steps of 1e-4 s at 9.5 rad/s: attitude off by %.1e rad\n", worst);
  EXPECT_LE(worst, 1e-6);
}

/// Euler's top with I1 < I2 < I3 and L^2 > 2 E I2 (Landau and Lifshitz, Mechanics, section 37). L is along z in the formula's
/// frame, and `frame` turns that into the world's.
struct TriaxialTop {
  Vec3 inertia;
  double energy, angular;
  Matrix3d frame;

  double rate() const {
    return std::sqrt((inertia[2] - inertia[1]) * (angular * angular - 2 * energy * inertia[0]) /
                     (inertia[0] * inertia[1] * inertia[2]));
  }
  double modulus() const {
    return std::sqrt((inertia[1] - inertia[0]) * (2 * energy * inertia[2] - angular * angular) /
                     ((inertia[2] - inertia[1]) * (angular * angular - 2 * energy * inertia[0])));
  }
  /// Spin in the frame of the principal axes.
  Vec3 spin(double t) const {
    double cn, dn;
    const double sn = boost::math::jacobi_elliptic(modulus(), rate() * t, &cn, &dn);
    const double a = 2 * energy * inertia[2] - angular * angular, b = angular * angular - 2 * energy * inertia[0];
    return Vec3(std::sqrt(a / (inertia[0] * (inertia[2] - inertia[0]))) * cn,
                std::sqrt(a / (inertia[1] * (inertia[2] - inertia[1]))) * sn,
                std::sqrt(b / (inertia[2] * (inertia[2] - inertia[0]))) * dn);
  }
  /// Rate of the precession about L: the third Euler angle, which takes a quadrature.
  double precession_rate(double t) const {
    const Vec3 w = spin(t), l = inertia.cwiseProduct(w);
    return angular * (l[0] * w[0] + l[1] * w[1]) / (l[0] * l[0] + l[1] * l[1]);
  }
  double precession(double t) const {
    const int pieces = 1 + static_cast<int>(20 * t);
    double sum = 0;
    for (int p = 0; p < pieces; ++p)
      sum += boost::math::quadrature::gauss<double, 20>::integrate([this](double s) { return precession_rate(s); },
                                                                   t * p / pieces, t * (p + 1) / pieces);
    return sum;
  }
  /// From the principal axes to the world.
  Matrix3d axes(double t) const {
    const Vec3 l = inertia.cwiseProduct(spin(t)) / angular;
    const double nutation = std::acos(l[2]), own = std::atan2(l[0], l[1]);
    return frame * turned(precession(t), Vec3::UnitZ()) * turned(nutation, Vec3::UnitX()) * turned(own, Vec3::UnitZ());
  }
  Matrix3d attitude(double t) const { return axes(t) * axes(0).transpose(); }
  RigidMotion motion() const {
    const Matrix3d a = axes(0);
    return top(a * inertia.asDiagonal() * a.transpose(), a * spin(0));
  }
};

/// Spin near the middle axis, so that it tumbles.
TriaxialTop tumbling(double speed) {
  const Vec3 inertia(1.0, 1.7, 2.2), spin(0.35, 0, 0.95);  // in units of `speed`, at t = 0
  const Vec3 w = speed * spin, l = inertia.cwiseProduct(w);
  return {inertia, 0.5 * w.dot(l), l.norm(), Random(12).turn().toRotationMatrix()};
}

TEST(RigidMotion, the_tumbling_top_s_formula_is_right) {
  // so that a test that fails is the code's fault: Euler's equations hold, L stands still in the world
  const TriaxialTop t = tumbling(9.0);
  ASSERT_GT(t.angular * t.angular, 2 * t.energy * t.inertia[1]);
  ASSERT_LT(t.modulus(), 1.0);
  const Vec3 along = t.frame * Vec3(0, 0, t.angular);
  for (const double s : {0.0, 0.3, 0.7, 1.1}) {
    constexpr double h = 1e-4;
    const Vec3 change = (t.spin(s + h) - t.spin(s - h)) / (2 * h), w = t.spin(s), l = t.inertia.cwiseProduct(w);
    EXPECT_LE((t.inertia.cwiseProduct(change) - l.cross(w)).norm(), 1e-5 * l.norm() * w.norm());
    EXPECT_LE((t.axes(s) * l - along).norm(), 1e-12 * t.angular);
    if (s == 0.0) continue;
    const Matrix3d rate = (t.axes(s + h) - t.axes(s - h)) / (2 * h) * t.axes(s).transpose();
    EXPECT_LE((Vec3(rate(2, 1), rate(0, 2), rate(1, 0)) - t.axes(s) * w).norm(), 1e-5 * w.norm());
  }
}

TEST(RigidMotion, a_tumbling_top_is_where_jacobi_s_functions_say) {
  const TriaxialTop t = tumbling(9.0);
  RigidMotion motion = t.motion();
  const double energy = motion.kinetic_energy();
  EXPECT_NEAR(energy, t.energy, 1e-13 * t.energy);
  Pose pose;
  double worst = 0, worst_spin = 0, worst_energy = 0, lowest = 1e9, highest = -1e9;
  for (int n = 1; n <= 10000; ++n) {
    pose.advance(motion.drift(1e-4));
    worst_energy = std::max(worst_energy, std::abs(motion.kinetic_energy() - energy) / energy);
    if (n % 250) continue;
    const double time = n * 1e-4;
    worst = std::max(worst, angle_between(pose.turn(), t.attitude(time)));
    const Vec3 in_body = t.axes(0).transpose() * pose.turn().transpose() * motion.spin();
    worst_spin = std::max(worst_spin, (in_body - t.spin(time)).norm() / t.spin(time).norm());
    lowest = std::min(lowest, in_body[1]);
    highest = std::max(highest, in_body[1]);
  }
  std::printf(
      "tumbling top, 10000 steps of 1e-4 s at 9 rad/s: attitude off by %.1e rad, spin in the body by %.1e, energy by %.1e "
      "(relative)\n",
      worst, worst_spin, worst_energy);
  EXPECT_LT(lowest, -1.0);
  EXPECT_GT(highest, 1.0) << "it does not tumble";
  EXPECT_LE(worst, 1e-6);
  EXPECT_LE(worst_spin, 1e-6);
  EXPECT_LE(worst_energy, 1e-6);
}

TEST(RigidMotion, the_integrator_is_of_second_order) {
  const TriaxialTop tumbler = tumbling(9.0);
  const SymmetricTop symmetric{1.0, 0.3, Random(11).turn().toRotationMatrix(), Vec3(4, -5, 7)};
  const auto errors = [](const RigidMotion& start, const Matrix3d& due) {
    std::vector<double> e;
    for (const int steps : {500, 1000, 2000}) {
      RigidMotion motion = start;
      e.push_back(angle_between(flown(motion, steps, 1.0 / steps).turn(), due));
    }
    return e;
  };
  for (const std::vector<double>& e : {errors(tumbler.motion(), tumbler.attitude(1.0)),
                                       errors(top(symmetric.inertia(), symmetric.spin), symmetric.attitude(1.0))}) {
    std::printf("halving the step divides the error by %.3f and %.3f\n", e[0] / e[1], e[1] / e[2]);
    EXPECT_NEAR(e[0] / e[1], 4.0, 0.05);
    EXPECT_NEAR(e[1] / e[2], 4.0, 0.05);
  }
}

TEST(RigidMotion, a_drift_back_is_the_inverse_to_third_order) {
  // what the step does to space is what the motion did: points of the body stay at their places in it
  const TriaxialTop t = tumbling(9.0);
  for (const double dt : {1e-3, 5e-4}) {
    RigidMotion motion = t.motion();
    Pose pose;
    pose.advance(motion.drift(dt));
    pose.advance(motion.drift(-dt));
    EXPECT_LE(angle_between(pose.turn(), Matrix3d::Identity()), std::pow(9 * dt, 3));
  }
}

TEST(RigidMotion, a_step_tells_what_it_did_to_space) {
  Random random(14);
  const std::vector<RigidPart> parts = random.granules(8);
  RigidMotion motion(parts.data(), 8);
  const Vec3 from = motion.centre(), spin = motion.spin();
  const RigidStep step = motion.drift(1e-4);
  EXPECT_EQ(step.from, from);
  EXPECT_EQ(step.to, motion.centre());
  EXPECT_NEAR(step.turn.norm(), 1.0, 1e-15);
  // a point of the body moves with the velocity field that is halfway between
  const Vec3 x = from + Vec3(0.01, 0.02, -0.01), now = step.to + step.turn * (x - step.from);
  const Twist halfway{0.5 * (step.from + step.to), motion.velocity(), 0.5 * (spin + motion.spin())};
  EXPECT_LE((now - x - 1e-4 * halfway.at(0.5 * (x + now))).norm(), 1e-3 * (now - x).norm());
  const RigidPart still{1.0, Vec3(1, 2, 3), Matrix3d::Identity(), Vec3(1, 0, 0), Vec3::Zero()};
  RigidMotion slides(&still, 1);
  EXPECT_EQ(slides.drift(0.5).turn.coeffs(), Quaterniond::Identity().coeffs());
  EXPECT_EQ(slides.centre(), Vec3(1.5, 2, 3));
  slides.shift(Vec3(-10, 0, 0));
  EXPECT_EQ(slides.centre(), Vec3(-8.5, 2, 3));
  EXPECT_EQ(slides.velocity(), Vec3(1, 0, 0));
}

// ------------------------------------------------------------------------------------------------------------------ kicks

TEST(RigidMotion, falls_as_velocity_verlet_does_on_the_parabola) {
  const RigidPart part{0.7, Vec3(1, 2, 3), Matrix3d::Identity(), Vec3(3, -1, 8), Vec3::Zero()};
  const Vec3 force = 0.7 * Vec3(1.5, 0, -9.81);
  RigidMotion motion(&part, 1);
  Vec3 x = part.centre, v = part.velocity;
  const double dt = 1e-3;
  for (int n = 1; n <= 1000; ++n) {
    verlet(motion, force, Vec3::Zero(), dt);
    v += 0.5 * dt / part.mass * force;
    x += dt * v;
    v += 0.5 * dt / part.mass * force;
    ASSERT_EQ(motion.centre(), x) << "the engine's integrator gives this to the last bit";
    ASSERT_EQ(motion.velocity(), v);
  }
  const double t = 1.0;
  EXPECT_LE((motion.centre() - (part.centre + t * part.velocity + 0.5 * t * t / part.mass * force)).norm(), 1e-12);
  EXPECT_LE((motion.velocity() - (part.velocity + t / part.mass * force)).norm(), 1e-12);
  EXPECT_EQ(motion.spin(), Vec3(Vec3::Zero()));
}

TEST(RigidMotion, a_torque_about_a_principal_axis_turns_it_as_the_formula_says) {
  Random random(15);
  const Vec3 principal(1.0, 1.7, 2.2);
  double worst = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const Matrix3d axes = random.turn().toRotationMatrix();
    const Vec3 along = axes.col(axis);
    const double start = axis == 1 ? 0.0 : 0.8, rate = 2.5;  // rad/s, rad/s^2
    RigidMotion motion = top(axes * principal.asDiagonal() * axes.transpose(), start * along);
    Pose pose;
    for (int n = 0; n < 2000; ++n) pose.advance(verlet(motion, Vec3::Zero(), rate * principal[axis] * along, 1e-3));
    worst = std::max(worst, angle_between(pose.turn(), turned(start * 2 + 0.5 * rate * 4, along)));
    worst = std::max(worst, (motion.spin() - (start + 2 * rate) * along).norm());
    EXPECT_EQ(motion.centre(), Vec3(Vec3::Zero()));
  }
  std::printf("torque about a principal axis, 2000 steps: attitude and spin off by %.1e\n", worst);
  EXPECT_LE(worst, 1e-11);
}

TEST(RigidMotion, a_kick_changes_the_momenta_by_force_and_torque_times_time) {
  Random random(16);
  const std::vector<RigidPart> parts = random.parts(5);
  RigidMotion motion(parts.data(), 5);
  const Vec3 v = motion.velocity(), l = motion.angular_momentum(), force(1, -2, 3), torque(0.01, 0.02, -0.03);
  motion.kick(force, torque, 1e-3);
  EXPECT_LE((motion.mass() * (motion.velocity() - v) - 1e-3 * force).norm(), 1e-15);
  EXPECT_LE((motion.angular_momentum() - l - 1e-3 * torque).norm(), 1e-18);
}

/// Where a point of the body is after the time t (which may be negative) under a force and torque that stay.
Vec3 later(RigidMotion motion, const Vec3& x, const Vec3& force, const Vec3& torque, double t) {
  constexpr int steps = 200;
  Pose pose;
  const Vec3 place = pose.to_frame(x);
  for (int n = 0; n < steps; ++n) pose.advance(verlet(motion, force, torque, t / steps));
  return pose.to_world(place);
}

TEST(RigidMotion, acceleration_is_the_second_difference_of_the_motion) {
  Random random(17);
  double worst = 0;
  for (const FreeAxes& free : {FreeAxes{true, true, true}, FreeAxes{false, true, false}, FreeAxes{false, false, false}})
    for (int n = 0; n < 10; ++n) {
      const std::vector<RigidPart> parts = random.parts(6);
      RigidMotion motion(parts.data(), 6, free);
      flown(motion, 100, 1e-3);  // away from where it was tied together
      const Vec3 force = 20 * motion.mass() * random.vector(1), torque = 3 * motion.angular_momentum().norm() * random.vector(1);
      const Vec3 x = motion.centre() + random.vector(0.02);
      constexpr double h = 2e-5;
      const Vec3 difference = (later(motion, x, force, torque, h) - 2 * x + later(motion, x, force, torque, -h)) / (h * h);
      const Vec3 is = motion.acceleration(x, force, torque);
      worst = std::max(worst, (difference - is).norm() / is.norm());
      EXPECT_LE((motion.acceleration(motion.centre(), force, torque) - force / motion.mass()).norm(), 1e-14 * is.norm());
    }
  std::printf("acceleration against second differences: %.1e (relative)\n", worst);
  EXPECT_LE(worst, 1e-5);  // h^2 spin^2 / 12, and the rounding of x / h^2
}

TEST(RigidMotion, acceleration_of_a_body_that_spins_is_centripetal) {
  const RigidPart part{1.0, Vec3(1, 0, 0), Vec3(1, 2, 3).asDiagonal(), Vec3(5, 5, 5), Vec3(0, 0, 4)};
  const RigidMotion motion(&part, 1);
  EXPECT_LE((motion.acceleration(Vec3(3, 0, 7), Vec3::Zero(), Vec3::Zero()) - Vec3(-32, 0, 0)).norm(), 1e-13);
  EXPECT_LE((motion.acceleration(Vec3(3, 0, 7), Vec3(0, 0, 2), Vec3(0, 0, 6)) - Vec3(-32, 4, 2)).norm(), 1e-13);
}

// -------------------------------------------------------------------------------------------------------------- free axes

TEST(RigidMotion, tied_in_one_direction_it_turns_about_that_axis_only) {
  Random random(18);
  for (int axis = 0; axis < 3; ++axis) {
    FreeAxes free{false, false, false};
    free[axis] = true;
    const std::vector<RigidPart> parts = random.parts(6);
    const RigidMotion whole(parts.data(), 6);
    RigidMotion motion(parts.data(), 6, free);
    EXPECT_EQ(motion.velocity(), whole.velocity());
    EXPECT_EQ(motion.angular_momentum()[axis], whole.angular_momentum()[axis]);
    const Vec3 along = Vec3::Unit(axis);
    // inertia about the axis through the centre
    double inertia = 0;
    for (const RigidPart& p : parts) {
      const Vec3 arm = p.centre - motion.centre();
      inertia += p.inertia(axis, axis) + p.mass * (arm - arm.dot(along) * along).squaredNorm();
    }
    const double start = motion.angular_momentum()[axis] / inertia, rate = 30;
    EXPECT_LE((motion.spin() - start * along).norm(), 1e-12 * std::abs(start));
    const Vec3 torque = inertia * (rate * along + 100 * Vec3(Vec3::Ones() - along));  // what is across goes to what ties it
    Pose pose;
    for (int n = 0; n < 1000; ++n) {
      pose.advance(verlet(motion, Vec3::Zero(), torque, 1e-3));
      for (int d = 0; d < 3; ++d)
        if (d != axis) {
          ASSERT_EQ(motion.spin()[d], 0.0);
          ASSERT_EQ(motion.angular_momentum()[d], 0.0);
        }
    }
    EXPECT_LE(angle_between(pose.turn(), turned(start + 0.5 * rate, along)), 1e-10);
    EXPECT_LE((motion.spin() - (start + rate) * along).norm(), 1e-10 * rate);
    EXPECT_NEAR(motion.kinetic_energy(),
                0.5 * motion.mass() * motion.velocity().squaredNorm() + 0.5 * inertia * std::pow(start + rate, 2),
                1e-10 * motion.kinetic_energy());
  }
}

TEST(RigidMotion, tied_in_two_directions_it_does_not_turn_at_all) {
  Random random(19);
  const std::vector<RigidPart> parts = random.parts(6);
  const RigidMotion whole(parts.data(), 6);
  RigidMotion motion(parts.data(), 6, {false, false, false});
  EXPECT_EQ(motion.velocity(), whole.velocity());
  Pose pose;
  const Vec3 force(1e-4, 2e-4, -1e-4);
  for (int n = 0; n < 100; ++n) pose.advance(verlet(motion, force, Vec3(1, 2, 3), 1e-3));
  EXPECT_EQ(motion.spin(), Vec3(Vec3::Zero()));
  EXPECT_EQ(pose.turn(), Matrix3d(Matrix3d::Identity()));
  EXPECT_LE((motion.velocity() - whole.velocity() - 0.1 / motion.mass() * force).norm(), 1e-13);
}

// ------------------------------------------------------------------------------------------------------- tied together

TEST(RigidMotion, parts_that_are_tied_together_keep_momentum_and_angular_momentum) {
  double worst_linear = 0, worst_angular = 0;
  for (unsigned seed = 0; seed < 200; ++seed) {
    Random random(100 + seed);
    const int n = 1 + static_cast<int>(seed % 20);
    const std::vector<RigidPart> parts = random.parts(n);
    const RigidMotion motion(parts.data(), n);
    const Momenta before = momenta_of(parts), after = momenta_of(carried(parts, Pose(), motion.twist()));
    worst_linear = std::max({worst_linear, (after.linear - before.linear).norm() / before.linear_sizes,
                             (motion.mass() * motion.velocity() - before.linear).norm() / before.linear_sizes});
    const Vec3 about_origin = motion.angular_momentum() + motion.centre().cross(motion.mass() * motion.velocity());
    worst_angular = std::max({worst_angular, (after.angular - before.angular).norm() / before.angular_sizes,
                              (about_origin - before.angular).norm() / before.angular_sizes});
    EXPECT_NEAR(motion.kinetic_energy(), after.energy, 1e-12 * before.energy);
    EXPECT_LE(after.energy, before.energy * (1 + 1e-12));
    if (n > 1) {
      EXPECT_LT(after.energy, 0.999 * before.energy) << "relative motion is lost";
    }
  }
  std::printf("parts tied together: momentum %.1e, angular momentum %.1e (relative)\n", worst_linear, worst_angular);
  EXPECT_LE(worst_linear, 1e-12);
  EXPECT_LE(worst_angular, 1e-12);
}

TEST(RigidMotion, two_balls_tied_together_lose_the_energy_of_their_relative_motion) {
  const double m1 = 2, m2 = 3, r1 = 0.3, r2 = 0.2, d = r1 + r2;
  const double reduced = m1 * m2 / (m1 + m2), i1 = 0.4 * m1 * r1 * r1, i2 = 0.4 * m2 * r2 * r2,
               across = i1 + i2 + reduced * d * d;
  const auto lost = [&](const Vec3& relative, double spin1, double spin2) {  // line of centres along x, spins about it
    const Vec3 drift(3, 2, 1);
    const RigidPart balls[] = {RigidPart::granule(m1, r1, Vec3(1, 1, 1), drift, Vec3(spin1, 0, 0)),
                               RigidPart::granule(m2, r2, Vec3(1 + d, 1, 1), drift + relative, Vec3(spin2, 0, 0))};
    return balls[0].kinetic_energy() + balls[1].kinetic_energy() - RigidMotion(balls, 2).kinetic_energy();
  };
  EXPECT_NEAR(lost(Vec3(-2, 0, 0), 0, 0), 0.5 * reduced * 4, 1e-12) << "head on: all of it";
  EXPECT_NEAR(lost(Vec3(0, 2, 0), 0, 0), 0.5 * reduced * 4 * (i1 + i2) / across, 1e-12)
      << "past each other: they go round each other";
  EXPECT_NEAR(lost(Vec3::Zero(), 5, -3), 0.5 * i1 * i2 / (i1 + i2) * 64, 1e-12) << "spins about the line of centres";
  EXPECT_NEAR(lost(Vec3(-2, 1, -3), 5, -3), 0.5 * reduced * (4 + 10 * (i1 + i2) / across) + 0.5 * i1 * i2 / (i1 + i2) * 64,
              1e-12);
  EXPECT_NEAR(lost(Vec3::Zero(), 4, 4), 0.0, 1e-12) << "one rigid motion: nothing";
}

/// What turns a body by a torque: the inverse of its inertia, column by column.
Matrix3d inverse_inertia(RigidMotion motion) {
  motion.kick(Vec3::Zero(), -motion.angular_momentum(), 1.0);
  Matrix3d columns;
  for (int d = 0; d < 3; ++d) {
    RigidMotion turning = motion;
    turning.kick(Vec3::Zero(), Vec3::Unit(d), 1.0);
    columns.col(d) = turning.spin();
  }
  return columns;
}

TEST(RigidMotion, far_from_the_origin_and_in_fast_frames_inertia_and_spin_are_right) {
  // places and speeds on a grid of powers of two, so that the shifted ones are the same body to the bit
  const auto on_grid = [](const Vec3& v, double step) { return Vec3((v / step).array().round() * step); };
  double worst_inertia = 0, worst_spin = 0;
  for (unsigned seed = 0; seed < 20; ++seed) {
    Random random(300 + seed);
    std::vector<RigidPart> near = random.granules(10);
    for (RigidPart& p : near) {
      p.centre = on_grid(p.centre, std::ldexp(1, -30));
      p.velocity = on_grid(p.velocity, std::ldexp(1, -30));
    }
    std::vector<RigidPart> far = near;
    const Vec3 there(1000, -1000, 500), fast(-1000, 1000, 1000);
    for (RigidPart& p : far) {
      p.centre += there;
      p.velocity += fast;
    }
    const RigidMotion a(near.data(), 10), b(far.data(), 10);
    const Matrix3d due = inverse_inertia(a);
    worst_inertia = std::max(worst_inertia, (inverse_inertia(b) - due).norm() / due.norm());
    worst_spin = std::max(worst_spin, (b.spin() - a.spin()).norm() / a.spin().norm());
    EXPECT_LE((b.centre() - there - a.centre()).norm(), 1e-12);
    EXPECT_LE((b.velocity() - fast - a.velocity()).norm(), 1e-12);
  }
  std::printf("1000 m away at 1000 m/s: inertia off by %.1e, spin by %.1e (relative)\n", worst_inertia, worst_spin);
  EXPECT_LE(worst_inertia, 1e-9);
  EXPECT_LE(worst_spin, 1e-9);
}

TEST(RigidMotion, inertia_turns_with_the_body) {
  Random random(20);
  const std::vector<RigidPart> parts = random.parts(7);
  RigidMotion motion(parts.data(), 7);
  const Matrix3d before = inverse_inertia(motion);
  const Matrix3d turn = flown(motion, 300, 1e-3).turn();
  EXPECT_GT(angle_between(turn, Matrix3d::Identity()), 0.1);
  EXPECT_LE((inverse_inertia(motion) - turn * before * turn.transpose()).norm(), 1e-12 * before.norm());
}

TEST(RigidMotion, quaternions_stay_normal_and_agree_after_a_million_drifts) {
  const TriaxialTop t = tumbling(900.0);
  RigidMotion motion = t.motion();
  const Matrix3d before = inverse_inertia(motion);
  const double energy = motion.kinetic_energy();
  const Pose pose = flown(motion, 1000000, 1e-5);
  const double off = std::abs(pose.quaternion().norm() - 1),
               skew = (pose.turn() * pose.turn().transpose() - Matrix3d::Identity()).norm();
  // the motion keeps an attitude of its own
  const double apart = (inverse_inertia(motion) - pose.turn() * before * pose.turn().transpose()).norm() / before.norm();
  const double energy_off = std::abs(motion.kinetic_energy() - energy) / energy;
  std::printf("a million drifts at 900 rad/s: quaternion %.1e, orthogonality %.1e, pose against motion %.1e, energy %.1e\n", off,
              skew, apart, energy_off);
  EXPECT_LE(off, 1e-15);
  EXPECT_LE(skew, 1e-14);
  EXPECT_LE(apart, 1e-9);
  EXPECT_LE(energy_off, 1e-4);  // (9e-3 rad per step)^2, not growing
}

}  // namespace
}  // namespace solidcull
