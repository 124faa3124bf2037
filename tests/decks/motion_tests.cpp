// Solid masses that move: free flight, ledgers in flight, restores after a rigid motion, bodies across ranks.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "atom.h"
#include "engine.h"
#include "lammps.h"
#include "rigid_motion.h"

namespace decks {
namespace {

using Eigen::Vector3d;
using solidcull::RigidMotion;
using solidcull::RigidPart;

constexpr double diameter = 0.0026, dt = 3e-5;

Vector3d eigen(const Vec& v) { return Vector3d(v[0], v[1], v[2]); }

/// A block of 8 x 6 x 5 granules that stick together, pushed out of order and at rest again: no gravity, no walls. more: lines
/// that make further granules (LIGGGHTS loses contact histories between ranks when atoms are created later).
std::string sticky_block(const std::string& more = "") {
  Bed bed;
  bed.contact = "model hertz tangential history cohesion sjkr rolling_friction epsd2";
  bed.cohesion = true;
  return head(bed) +
         "region box block 0 0.08 0 0.08 0 0.08 units box\ncreate_box 2 box\nneighbor 0.0004 bin\nneigh_modify delay 0\n" +
         body(bed) +
         "unfix m7\nfix m7 all property/global cohesionEnergyDensity peratomtypepair 2 100000 100000 100000 100000\n"
         "unfix grav\nunfix x1\nunfix x2\nunfix y1\nunfix y2\nunfix z1\n"
         "lattice sc 0.00258\nregion lattice block 0.0299 0.0495 0.0299 0.0442 0.0299 0.0417 units box\ncreate_atoms 1 region "
         "lattice\n" +
         more +
         "set group all diameter 0.0026\nset group all density 2500\nfix integr all nve/sphere\nthermo 100000\nthermo_modify "
         "norm no\n"
         "run 0\ndisplace_atoms all random 3e-6 3e-6 3e-6 49979687 units box\n"
         "fix visc all viscous 0.002\nrun 20000\nunfix visc\nvelocity all set 0 0 0\nset group all omegax 0 omegay 0 omegaz "
         "0\nrun 0\n";
}

/// Gives every granule the velocity field of a rigid body.
void throw_spinning(Engine& e, const Vector3d& velocity, const Vector3d& spin) {
  const State s = e.state();
  double mass = 0;
  Vector3d centre = Vector3d::Zero();
  for (const auto& g : s) {
    mass += g.second.mass;
    centre += g.second.mass * eigen(g.second.x);
  }
  centre /= mass;
  LAMMPS_NS::Atom* atom = e.lammps()->atom;
  for (int i = 0; i < atom->nlocal; ++i) {
    const Vector3d v = velocity + spin.cross(Vector3d(atom->x[i][0], atom->x[i][1], atom->x[i][2]) - centre);
    for (int d = 0; d < 3; ++d) {
      atom->v[i][d] = v[d];
      atom->omega[i][d] = spin[d];
    }
  }
}

struct Ledger {
  double mass = 0;
  Vector3d momentum = Vector3d::Zero(), turning = Vector3d::Zero();  // about the origin
};

/// Over everything: atoms, and what the fix says of its interior granules.
Ledger ledger(Engine& e, bool culled) {
  Ledger l;
  for (const auto& g : e.state()) {
    const Granule& a = g.second;
    l.mass += a.mass;
    l.momentum += a.mass * eigen(a.v);
    l.turning += a.mass * eigen(a.x).cross(eigen(a.v)) + 0.4 * a.mass * a.radius * a.radius * eigen(a.omega);
  }
  if (!culled) return l;
  l.mass += e.vector("cull", 5);
  for (int d = 0; d < 3; ++d) {
    l.momentum[d] += e.vector("cull", 13 + d);
    l.turning[d] += e.vector("cull", 16 + d);
  }
  return l;
}

/// The rotation that brings the places of `from` to those of `to`, least squares.
Eigen::Matrix3d rotation_between(const State& from, const State& to, double* residual = nullptr) {
  Vector3d a = Vector3d::Zero(), b = Vector3d::Zero();
  for (const auto& g : from) {
    a += eigen(g.second.x) / static_cast<double>(from.size());
    b += eigen(to.at(g.first).x) / static_cast<double>(from.size());
  }
  Eigen::Matrix3d h = Eigen::Matrix3d::Zero();
  for (const auto& g : from) h += (eigen(g.second.x) - a) * (eigen(to.at(g.first).x) - b).transpose();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(h, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d flip = Eigen::Matrix3d::Identity();
  flip(2, 2) = (svd.matrixV() * svd.matrixU().transpose()).determinant();
  const Eigen::Matrix3d r = svd.matrixV() * flip * svd.matrixU().transpose();
  if (residual) {
    *residual = 0;
    for (const auto& g : from)
      *residual = std::max(*residual, (r * (eigen(g.second.x) - a) - (eigen(to.at(g.first).x) - b)).norm());
  }
  return r;
}

/// Free flight of the same mass by Runge and Kutta's rule of fourth order on the rotation matrix, in steps a tenth as long: right
/// to 1e-12 here.
Eigen::Matrix3d flight(const State& s, double seconds) {
  std::vector<RigidPart> parts;
  for (const auto& g : s)
    parts.push_back(
        RigidPart::granule(g.second.mass, g.second.radius, eigen(g.second.x), eigen(g.second.v), eigen(g.second.omega)));
  Vector3d centre = Vector3d::Zero();
  double mass = 0;
  for (const RigidPart& p : parts) {
    centre += p.mass * p.centre;
    mass += p.mass;
  }
  centre /= mass;
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
  Vector3d turning = Vector3d::Zero();
  for (const RigidPart& p : parts) {
    const Vector3d arm = p.centre - centre;
    turning += p.angular_momentum(centre);
    inertia += p.inertia + p.mass * (arm.squaredNorm() * Eigen::Matrix3d::Identity() - arm * arm.transpose());
  }
  const Eigen::Matrix3d inverse = inertia.inverse();
  const auto rate = [&](const Eigen::Matrix3d& r) {
    const Vector3d w = r * inverse * r.transpose() * turning;
    Eigen::Matrix3d cross;
    cross << 0, -w[2], w[1], w[2], 0, -w[0], -w[1], w[0], 0;
    return Eigen::Matrix3d(cross * r);
  };
  Eigen::Matrix3d r = Eigen::Matrix3d::Identity();
  const int steps = 20000;
  const double h = seconds / steps;
  for (int k = 0; k < steps; ++k) {
    const Eigen::Matrix3d a = rate(r), b = rate(r + 0.5 * h * a), c = rate(r + 0.5 * h * b), d = rate(r + h * c);
    r += h / 6 * (a + 2 * b + 2 * c + d);
  }
  return r;
}

const char* all_locked = "fix cull all solid/cull exterior live depth 0.25 voxel 0.125 every 50 calm 2 tolerance 1e9 0\n";

TEST(Motion, FreeFlightKeepsMomentumAndTurnsAsARigidBodyDoes) {
  Engine never;  // the same mass up to the step in which the other one is locked
  never.run(sticky_block());
  throw_spinning(never, Vector3d(0.004, -0.006, 0.05), Vector3d(1.5, 2.5, -2));
  never.run("run 100\nrun 0\n");
  const State start = never.state();
  const Ledger before = ledger(never, false);
  Engine e;
  e.run(sticky_block());
  throw_spinning(e, Vector3d(0.004, -0.006, 0.05), Vector3d(1.5, 2.5, -2));
  e.run(std::string(all_locked) + "run 100\nrun 0\n");  // the last look chooses, the next run's setup culls
  ASSERT_EQ(e.vector("cull", 1), 0) << "exterior granules: the whole mass should be one body";
  ASSERT_EQ(e.vector("cull", 4), 1);
  const Ledger locked = ledger(e, true);
  EXPECT_LE((locked.momentum - before.momentum).norm(), 1e-12 * before.momentum.norm());
  EXPECT_LE((locked.turning - before.turning).norm(), 1e-12 * before.turning.norm());
  double worst[2] = {0, 0};
  for (int k = 0; k < 10; ++k) {
    e.run("run 1000\n");
    const Ledger now = ledger(e, true);
    worst[0] = std::max(worst[0], (now.momentum - locked.momentum).norm() / locked.momentum.norm());
    worst[1] = std::max(worst[1], (now.turning - locked.turning).norm() / locked.turning.norm());
  }
  EXPECT_LE(worst[0], 1e-11);  // 10,000 roundings
  EXPECT_LE(worst[1], 1e-11);
  e.run("unfix cull\nrun 0\n");
  const State end = e.state();
  double residual = 0;
  const Eigen::Matrix3d turned = rotation_between(start, end, &residual);
  const double off = (turned - flight(start, 10000 * dt)).norm();
  EXPECT_LE(off, 1e-8);
  EXPECT_LE(residual, 1e-12 * diameter);
  if (e.rank() == 0)
    std::printf(
        "10,000 steps, %.3g rad: momentum constant to %.2g, angular momentum to %.2g, orientation off the free top's by %.2g, "
        "places off a rigid motion by %.2g d\n",
        std::acos(0.5 * (turned.trace() - 1)), worst[0], worst[1], off, residual / diameter);
}

TEST(Motion, FreeFlightIsThatOfTheUnculledMass) {
  const Vector3d velocity(0.004, -0.006, 0.05);
  State at_end[2];
  Ledger end[2];
  double angle = 0;
  for (const bool culled : {false, true}) {
    Engine e;
    e.run(sticky_block());
    throw_spinning(e, velocity, Vector3d(0.03, 0.05, -0.04));  // slow: a fast one stretches the contacts of the unculled mass
    const State start = e.state();
    if (culled) e.run(all_locked);
    e.run("run 10000\n");
    if (culled) {
      EXPECT_EQ(e.vector("cull", 1), 0);
      e.run("unfix cull\nrun 0\n");
    }
    at_end[culled] = e.state();
    end[culled] = ledger(e, false);
    angle = std::acos(0.5 * (rotation_between(start, at_end[culled]).trace() - 1));
  }
  const double way = velocity.norm() * 10000 * dt;
  const double apart = largest_difference(at_end[0], at_end[1], &Granule::x);
  const double momentum = (end[1].momentum - end[0].momentum).norm() / end[0].momentum.norm();
  const double turning = (end[1].turning - end[0].turning).norm() / end[0].turning.norm();
  EXPECT_LE(momentum, 1e-13);
  EXPECT_LE(turning, 1e-11);
  EXPECT_LE(apart, 1e-6 * way);  // of the unculled mass's contacts, which give
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  if (rank == 0)
    std::printf("%.3g rad, culled against unculled: momentum %.2g, angular momentum %.2g, places %.2g of the way\n", angle,
                momentum, turning, apart / way);
}

TEST(Motion, RestoreAfterARigidMotionIsTheSamePackingTurned) {
  const Vector3d velocity(0.004, 0.005, 0.04), spin(2, -1.5, 2.5);
  Engine never;
  never.run(sticky_block());
  throw_spinning(never, velocity, spin);
  never.run("run 100\nrun 0\n");
  const State before = never.state();
  const Histories h_before = never.histories();
  Engine e;
  e.run(sticky_block());
  throw_spinning(e, velocity, spin);
  e.run(std::string(all_locked) + "run 100\nrun 0\n");  // the last look chooses, the next run's setup culls
  ASSERT_EQ(e.vector("cull", 1), 0);
  ASSERT_GT(e.vector("cull", 3), 100);
  e.run("run 9000\nunfix cull\nrun 0\n");
  const State after = e.state();
  const Histories h_after = e.histories();
  double residual = 0;
  const Eigen::Matrix3d r = rotation_between(before, after, &residual);
  const double angle = std::acos(std::min(1.0, 0.5 * (r.trace() - 1)));
  EXPECT_GT(angle, 0.5);
  EXPECT_LE(residual, 1e-12 * 0.02);  // of the mass's size
  ASSERT_EQ(h_before.size(), h_after.size());
  double history_off[2] = {0, 0}, scale[2] = {0, 0};
  for (const auto& h : h_before) {
    ASSERT_TRUE(h_after.count(h.first)) << h.first.first << " with " << h.first.second;
    const std::vector<double>& now = h_after.at(h.first);
    ASSERT_EQ(h.second.size(), 6u);
    for (const int v : {0, 1}) {  // shear, rolling torque
      const Vector3d then(h.second[3 * v], h.second[3 * v + 1], h.second[3 * v + 2]);
      history_off[v] = std::max(history_off[v], (r * then - Vector3d(now[3 * v], now[3 * v + 1], now[3 * v + 2])).norm());
      scale[v] = std::max(scale[v], then.norm());
    }
  }
  for (const int v : {0, 1}) {
    EXPECT_GT(scale[v], 0);
    EXPECT_LE(history_off[v], 1e-12 * scale[v]);
  }
  // forces: what the granules' relative motion does to them is not there any more after a rigid motion, so elastic ones alone are
  // the same; the block is at rest but for the centrifugal stretching, and the scale is the attraction in a contact
  double off = 0;
  for (const auto& g : before) off = std::max(off, (r * eigen(g.second.f) - eigen(after.at(g.first).f)).norm());
  const double contact_force = 100 * before.begin()->second.mass * 9.81;
  if (e.rank() == 0)
    std::printf(
        "turned by %.3g rad: places off a rigid motion by %.2g d, shear histories by %.2g, rolling ones by %.2g, net forces by "
        "%.2g "
        "of 100 weights\n",
        angle, residual / diameter, history_off[0] / scale[0], history_off[1] / scale[1], off / contact_force);
  EXPECT_LE(off, 1e-4 * contact_force);
}

TEST(Motion, ABodyFallsOnWhileOthersAreGrounded) {
  // a block falls as one body; meanwhile single granules come to rest on the floor, are culled and grounded, one after the other
  std::string singles;
  for (int k = 0; k < 4; ++k) {
    char line[80];
    std::snprintf(line, sizeof line, "create_atoms 1 single %g 0.07 %g units box\n", 0.01 + 0.01 * k, 0.0013 + 2e-5 * k);
    singles += line;
  }
  Engine e;
  e.run(sticky_block(singles) +
        "fix grav all gravity 9.81 vector 0 0 -1\nfix floor all wall/gran model hertz tangential history cohesion sjkr "
        "rolling_friction epsd2 primitive type 1 zplane 0\n"
        "fix cull all solid/cull exterior sleep depth 0 every 25 calm 2\nrun 0\n");
  const auto block_momentum = [&] {  // kg m/s, upwards: all but what the single granules have that are atoms; stored ones stand
    double p = ledger(e, true).momentum[2];
    for (const auto& g : e.state())
      if (g.first > 240) p -= g.second.mass * g.second.v[2];
    return p;
  };
  for (int k = 0; k < 20 && e.vector("cull", 2) + e.vector("cull", 3) < 240; ++k) e.run("run 25\n");
  ASSERT_GE(e.vector("cull", 2) + e.vector("cull", 3), 240) << "the block should be culled in the air";
  const double begin = block_momentum(), mass = 240 * e.state().begin()->second.mass;
  const int steps = 1500;  // it hits the floor after 2,500
  e.run("run " + std::to_string(steps) + "\n");
  EXPECT_EQ(e.vector("cull", 1), 0) << "all are culled: the block and, by now, each single granule";
  const double due = -9.81 * mass * steps * dt, fell = block_momentum() - begin;
  EXPECT_NEAR(fell, due, 1e-9 * std::abs(due));
  if (e.rank() == 0) std::printf("fell by %.12g of what is due\n", fell / due);
}

TEST(Motion, LedgerInFlight) {
  // a spinning mass is struck by three fast granules: parts are carved out, may come off, and are culled again
  Engine e;
  e.run(
      sticky_block("create_atoms 1 single 0.041 0.038 0.055 units box\ncreate_atoms 1 single 0.02 0.037 0.036 units box\n"
                   "create_atoms 1 single 0.038 0.055 0.037 units box\n"));
  throw_spinning(e, Vector3d(0.01, 0.01, 0.02), Vector3d(2, 3, -1));
  e.run(
      "group s1 id 241\ngroup s2 id 242\ngroup s3 id 243\nvelocity s1 set 0 0 -0.8\nvelocity s2 set 0.6 0 0\nvelocity s3 set 0 "
      "-0.5 0\nrun 0\n");
  const Ledger before = ledger(e, false);
  double momenta = 0, turnings = 0;  // scales: sums of magnitudes
  for (const auto& g : e.state()) {
    momenta += g.second.mass * eigen(g.second.v).norm();
    turnings += g.second.mass * eigen(g.second.x).cross(eigen(g.second.v)).norm();
  }
  e.run("fix cull all solid/cull exterior live depth 0.25 voxel 0.125 every 25 calm 2 carve 1.5 2\nrun 0\n");
  double worst[2] = {0, 0}, most_bodies = 0, mass_off = 0;
  for (int k = 0; k < 150; ++k) {
    e.run("run 20 pre no post no\n");
    const Ledger now = ledger(e, true);
    expect_all_there(e, "cull", 243);
    mass_off = std::max(mass_off, std::abs(now.mass - before.mass) / before.mass);
    worst[0] = std::max(worst[0], (now.momentum - before.momentum).norm() / momenta);
    worst[1] = std::max(worst[1], (now.turning - before.turning).norm() / turnings);
    most_bodies = std::max(most_bodies, e.vector("cull", 4));
  }
  EXPECT_GT(e.vector("cull", 8), 0) << "nothing was carved";
  EXPECT_GT(e.vector("cull", 7), 20) << "nothing was restored";
  EXPECT_GT(e.vector("cull", 6), e.vector("cull", 7));
  EXPECT_LE(mass_off, 1e-12);
  EXPECT_LE(worst[0], 1e-12);
  EXPECT_LE(worst[1], 1e-12);
  if (e.rank() == 0)
    std::printf("culled %g, restored %g, carves %g, bodies at most %g: mass off by %.2g, momentum %.2g, angular momentum %.2g\n",
                e.vector("cull", 6), e.vector("cull", 7), e.vector("cull", 8), most_bodies, mass_off, worst[0], worst[1]);
}

TEST(Motion, AMassFallsOnTheFloorAndNothingGoesThrough) {
  // loose granules that fall as one, hit the floor of the box, and settle again: I1 and I2 are checked at every reneighbouring
  Bed bed;
  bed.name = "fall";
  Engine e;
  e.run(read_bed(bed) +
        "run 0\nunfix grav\nfix visc all viscous 0.002\nrun 6000\nunfix visc\nvelocity all set 0 0 0\n"
        "set group all omegax 0 omegay 0 omegaz 0\ndisplace_atoms all move 0 0 0.03 units box\n"
        "fix cull all solid/cull exterior live every 50 calm 2 depth 1.5\nrun 300\n");
  EXPECT_GT(e.vector("cull", 3), 200) << "it hangs in the air as one mass";
  e.run("fix grav all gravity 9.81 vector 0 0 -1\nrun 500\n");
  const double falling = e.vector("cull", 3);
  EXPECT_GT(falling, 200) << "it falls as one mass, and is culled while it does";
  for (int k = 0; k < 20; ++k) {
    e.run("run 250\n");
    expect_all_there(e, "cull", 1300);
  }
  EXPECT_GT(e.vector("cull", 7), 500) << "the floor woke it";
  e.run("unfix cull\nrun 0\n");
  const State end = e.state();
  ASSERT_EQ(end.size(), 1300u);
  double lowest = 1;
  for (const auto& g : end) lowest = std::min(lowest, g.second.x[2] - g.second.radius);
  EXPECT_GT(lowest, -0.05 * diameter);
  if (e.rank() == 0) std::printf("%g interior while it fell; lowest point %.3g d\n", falling, lowest / diameter);
}

TEST(Motion, AMassThatLeavesTheBoxIsGoneAsItWouldBeWithoutTheFix) {
  std::size_t left[2];
  for (const bool culled : {false, true}) {
    Engine e;
    e.run(sticky_block());
    throw_spinning(e, Vector3d(0.25, 0, 0), Vector3d(0, 2, 1));
    e.run(std::string("thermo_modify lost ignore norm no\n") + (culled ? all_locked : "") + "run 2000\n");
    if (culled) {
      EXPECT_GT(e.vector("cull", 3), 20);
      EXPECT_NEAR(e.vector("cull", 11), 0, 1e-15);  // kg, of 5 mg
    }
    // half of it is out after 0.16 s; the fix says nothing that it should not
    e.run("run 3300\n");
    if (culled) e.run("unfix cull\nrun 0\n");
    left[culled] = e.state().size();
    e.run("run 4000\n");
    EXPECT_EQ(e.state().size(), 0u);
  }
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  if (rank == 0) std::printf("half out: %zu left unculled, %zu culled\n", left[0], left[1]);
  EXPECT_GT(left[0], 20u);
  EXPECT_LT(left[0], 220u);
  EXPECT_NEAR(static_cast<double>(left[1]), static_cast<double>(left[0]), 1);  // one may stand in the side of the box
}

TEST(Motion, ABodyThatLosesItsSupportFalls) {
  Bed bed;
  bed.name = "support";
  std::vector<double> fallen;
  // unculled, the default, a ball so small that only the law for fronts helps
  for (const std::string carve : {"", "carve 2 4", "carve 1 4"}) {
    const bool culled = !carve.empty();
    Engine e;
    const std::string fix = culled ? "fix cull all solid/cull exterior live every 50 calm 2 depth 1.5 " + carve + "\n" : "";
    e.run(read_bed(bed) + "run 0\n" + fix + "run 500\n");
    const auto height = [&] {
      double mass = culled ? e.vector("cull", 5) : 0, moment = culled ? mass * e.vector("cull", 22) : 0;
      for (const auto& g : e.state()) {
        mass += g.second.mass;
        moment += g.second.mass * g.second.x[2];
      }
      return moment / mass;
    };
    if (culled) {
      ASSERT_GT(e.vector("cull", 3), 100);
    }
    const double before = height();
    e.run("unfix z1\nfix z1 all wall/gran " + bed.contact + " primitive type 1 zplane -0.0019\nrun 150\n");
    if (culled) {
      EXPECT_GT(e.vector("cull", 7), 100) << "what rested on the floor wakes";
    }
    fallen.push_back(before - height());
  }
  const double seconds = 150 * dt, way = 0.5 * 9.81 * seconds * seconds;
  EXPECT_LT(fallen[0], way);
  EXPECT_GT(fallen[0], 0.7 * way) << "side walls hold back a little";
  for (const double way_of_culled : {fallen[1], fallen[2]})
    EXPECT_NEAR(way_of_culled, fallen[0], 0.03 * fallen[0]);  // some steps go by before a granule is woken: 2 % were measured
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  if (rank == 0)
    std::printf("it fell %.4g and %.4g of the way of a free fall, unculled %.4g\n", fallen[1] / way, fallen[2] / way,
                fallen[0] / way);
}

}  // namespace
}  // namespace decks
