// WallContacts and MeshLoads: distances against closed forms, loads against the engine's sums and Hertz's formula.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <functional>
#include <map>

#include "atom.h"
#include "domain.h"
#include "engine.h"
#include "engine_access.h"
#include "fix.h"
#include "fix_mesh_surface.h"
#include "lammps.h"
#include "mesh_loads.h"
#include "modify.h"
#include "neighbor.h"
#include "tri_mesh.h"
#include "wall_contacts.h"

namespace decks {
namespace {

using solidcull::MeshLoads;
using solidcull::Sphere;
using solidcull::Vec3;
using solidcull::WallContact;
using solidcull::WallContacts;
using solidcull::WallLoad;
using solidcull::WallTriangle;

constexpr double radius = 0.0015, skin = 0.0004, side = 0.04;  // m
constexpr double rounding = 1e-15;                             // m: of places of some cm
const char* contact = "model hertz tangential history";

std::string text(double x) {
  char digits[32];
  std::snprintf(digits, sizeof digits, "%.17g", x);
  return digits;
}

/// Collective. Corners of triangles, one after the other.
void write_stl(const std::string& file, const std::vector<std::array<Vec, 3>>& triangles) {
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  if (rank == 0) {
    std::ofstream out(file);
    out.precision(17);
    out << "solid wall\n";
    for (const auto& t : triangles) {
      out << "facet normal 0 0 1\nouter loop\n";
      for (const Vec& corner : t) out << "vertex " << corner[0] << ' ' << corner[1] << ' ' << corner[2] << "\n";
      out << "endloop\nendfacet\n";
    }
    out << "endsolid wall\n";
  }
  MPI_Barrier(MPI_COMM_WORLD);
}

/// A box without gravity or walls, then these lines, then a granule at each place.
std::string box(const std::string& walls, const std::vector<Vec3>& places, double dt = 3e-5) {
  Bed bed;
  bed.contact = contact;
  bed.dt = dt;
  std::string deck = head(bed) + "region box block 0 0.04 0 0.04 0 0.04 units box\ncreate_box 2 box\nneighbor " + text(skin) +
                     " bin\nneigh_modify delay 0\n" + body(bed) +
                     "unfix grav\nunfix x1\nunfix x2\nunfix y1\nunfix y2\nunfix z1\n" + walls;
  for (const Vec3& x : places)
    deck += "create_atoms 1 single " + text(x[0]) + ' ' + text(x[1]) + ' ' + text(x[2]) + " units box\n";
  return deck + "set group all diameter " + text(2 * radius) +
         " density 2500\nfix integr all nve/sphere\nthermo 100000\nthermo_modify norm no\n";
}

/// What WallContacts finds, by tag, from all ranks; a granule may touch several walls.
struct Found {
  int tag, moving;
  Vec to_wall;
  double gap;
};
std::multimap<int, Found> find_all(Engine& e, const WallContacts& walls) {
  std::vector<Found> mine;
  for (const WallContact& c : walls.find())
    mine.push_back({e.lammps()->atom->tag[c.granule], c.moving, {c.to_wall[0], c.to_wall[1], c.to_wall[2]}, c.gap});
  int bytes = static_cast<int>(mine.size() * sizeof(Found)), total = 0;
  std::vector<int> counts(e.ranks()), at(e.ranks());
  MPI_Allgather(&bytes, 1, MPI_INT, counts.data(), 1, MPI_INT, MPI_COMM_WORLD);
  for (int r = 0; r < e.ranks(); ++r) {
    at[r] = total;
    total += counts[r];
  }
  std::vector<Found> all(static_cast<std::size_t>(total) / sizeof(Found));
  MPI_Allgatherv(mine.data(), bytes, MPI_BYTE, all.data(), counts.data(), at.data(), MPI_BYTE, MPI_COMM_WORLD);
  std::multimap<int, Found> found;
  for (const Found& f : all) found.emplace(f.tag, f);
  return found;
}

/// Expects granule `tag`, at x, once among the contacts, with its nearest point of the wall there.
void expect_contact(const std::multimap<int, Found>& found, int tag, const Vec3& x, const Vec3& nearest) {
  ASSERT_EQ(found.count(tag), 1u) << "granule " << tag;
  const Found& f = found.find(tag)->second;
  for (int d = 0; d < 3; ++d) EXPECT_NEAR(f.to_wall[d], nearest[d] - x[d], rounding) << "granule " << tag << ", component " << d;
  EXPECT_NEAR(f.gap, (nearest - x).norm() - radius, rounding) << "granule " << tag;
}

TEST(WallContacts, OfPlanesAndACylinder) {
  const double round = 0.017;
  const Vec3 axis(0.02, 0.02, 0);
  const Vec3 at_floor(0.02, 0.021, radius - 5e-5), over_floor(0.011, 0.02, radius + 3e-4),
      in_corner(0.02, 0.02 + round - radius - 1e-4, radius + 2e-4);
  const Vec3 outwards = Vec3(0.6, 0.8, 0), at_mantle = axis + (round - radius + 2e-5) * outwards + Vec3(0, 0, 0.02);
  const Vec3 free(0.02, 0.02, 0.02), beside(0.024, 0.02, 0.02), out_of_skin(0.02, 0.014, radius + skin + 1e-5);
  const std::string wall = std::string("all wall/gran ") + contact + " primitive type 1 ";
  Engine e;
  e.run(box("fix floor " + wall + "zplane 0\nfix drum " + wall + "zcylinder " + text(round) + " 0.02 0.02\n",
            {at_floor, over_floor, in_corner, at_mantle, free, out_of_skin}) +
        "run 0\n");
  WallContacts walls(e.lammps());
  walls.connect();
  EXPECT_EQ(walls.names(), (std::vector<std::string>{"drum", "floor"}));
  EXPECT_TRUE(walls.triangles().empty());
  const auto found = find_all(e, walls);
  expect_contact(found, 1, at_floor, Vec3(at_floor[0], at_floor[1], 0));
  expect_contact(found, 2, over_floor, Vec3(over_floor[0], over_floor[1], 0));
  expect_contact(found, 4, at_mantle, axis + round * outwards + Vec3(0, 0, 0.02));
  EXPECT_EQ(found.count(5) + found.count(6), 0u);
  // one at the floor and the mantle
  ASSERT_EQ(found.count(3), 2u);
  double gaps[2];
  int n = 0;
  for (auto f = found.lower_bound(3); f != found.upper_bound(3); ++f) gaps[n++] = f->second.gap;
  EXPECT_NEAR(std::min(gaps[0], gaps[1]), 1e-4, rounding);
  EXPECT_NEAR(std::max(gaps[0], gaps[1]), 2e-4, rounding);
  for (const auto& f : found) EXPECT_FALSE(f.second.moving);

  // a sphere that is no atom
  EXPECT_TRUE(walls.primitive_near({beside, 0.0125}, 0.0006));  // 0.5 mm from the mantle
  EXPECT_FALSE(walls.primitive_near({beside, 0.0125}, 0.0004));
  // on the axis and, for the engine, on it
  for (const double off : {0.0, 5e-9}) {
    const Vec3 on_axis = axis + Vec3(off, 0, 0.02);
    EXPECT_TRUE(walls.primitive_near({on_axis, 0.0125}, 0.0046));  // 4.5 mm from the mantle
    EXPECT_FALSE(walls.primitive_near({on_axis, 0.0125}, 0.0044));
  }
  EXPECT_TRUE(walls.primitive_near({at_floor, radius}, 0.0));
  EXPECT_FALSE(walls.primitive_near({over_floor, radius}, 0.0));

  e.run("unfix drum\nrun 0\n");
  walls.connect();
  EXPECT_EQ(walls.names(), std::vector<std::string>{"floor"});
  EXPECT_EQ(find_all(e, walls).size(), 3u);
}

TEST(WallContacts, OfATrianglesFaceEdgesAndCorners) {
  // a right angle at a, legs of 2 cm along x and y
  const double z = 0.02;
  const Vec3 a(0.01, 0.01, z), b(0.03, 0.01, z), c(0.01, 0.03, z), slope(std::sqrt(0.5), std::sqrt(0.5), 0), up(0, 0, 1);
  write_stl("triangle.stl", {{Vec{a[0], a[1], a[2]}, Vec{b[0], b[1], b[2]}, Vec{c[0], c[1], c[2]}}});
  struct Case {
    Vec3 nearest, way;  // from there to the centre
  };
  const double r = radius;
  const std::vector<Case> cases = {
      {Vec3(0.014, 0.013, z), (r - 4e-5) * up},                      // face, pressed
      {Vec3(0.013, 0.0205, z), -(r - 3e-5) * up},                    // face, from below
      {Vec3(0.0185, 0.0155, z), (r + 1e-4) * up},                    // face, a gap
      {Vec3(0.0145, 0.0175, z), -(r + 1e-4) * up},                   // face, a gap, from below
      {Vec3(0.0235, 0.01, z), (r - 2e-5) * Vec3(0, -0.8, 0.6)},      // edge ab
      {Vec3(0.01, 0.0165, z), (r + 1e-4) * Vec3(-1, 0, 0)},          // edge ac, from its side
      {Vec3(0.02, 0.02, z), (r - 3e-5) * (0.8 * slope - 0.6 * up)},  // edge bc, obliquely from below
      {a, (r - 1e-5) * Vec3(-2, -1, 2) / 3},                         // corners
      {b, (r + 2e-4) * Vec3(0.8, -0.6, 0)},
      {c, (r - 1e-5) * Vec3(-0.6, 0.8, 0)},
      {Vec3(0.0125, 0.0235, z), (r + skin + 1e-6) * up},  // out of the skin
  };
  std::vector<Vec3> places;
  for (const Case& one : cases) places.emplace_back(one.nearest + one.way);
  Engine e;
  e.run(box("fix mesh all mesh/surface file triangle.stl type 1\nfix wall all wall/gran " + std::string(contact) +
                " mesh n_meshes 1 meshes mesh\n",
            places) +
        "run 0\n");
  WallContacts walls(e.lammps());
  walls.connect();
  EXPECT_EQ(walls.names(), (std::vector<std::string>{"mesh", "wall"}));
  auto found = find_all(e, walls);
  EXPECT_EQ(found.size(), cases.size() - 1);
  for (std::size_t k = 0; k + 1 < cases.size(); ++k) {
    expect_contact(found, static_cast<int>(k) + 1, places[k], cases[k].nearest);
    EXPECT_FALSE(found.find(static_cast<int>(k) + 1)->second.moving);
  }

  // each rank that has the triangle knows its corners; spheres that are no atoms are asked of it
  const std::vector<WallTriangle> triangles = walls.triangles();
  int mine = static_cast<int>(triangles.size()), anywhere = 0;
  MPI_Allreduce(&mine, &anywhere, 1, MPI_INT, MPI_MAX, MPI_COMM_WORLD);
  EXPECT_EQ(anywhere, 1);
  for (const WallTriangle& t : triangles) {
    EXPECT_LE((t.box.lo - a).norm(), rounding);
    EXPECT_LE((t.box.hi - Vec3(0.03, 0.03, z)).norm(), rounding);
    EXPECT_FALSE(t.moving);
    for (const Case& one : cases) {
      const Sphere s{one.nearest + one.way, 0.001};
      const double gap = one.way.norm() - s.radius;
      EXPECT_TRUE(walls.near(t, s, gap + 1e-9));
      EXPECT_FALSE(walls.near(t, s, gap - 1e-9));
    }
  }

  e.run("fix away all move/mesh mesh mesh linear 0 0 0.001\nrun 0\n");
  walls.connect();
  found = find_all(e, walls);
  EXPECT_EQ(found.size(), cases.size() - 1);
  for (const auto& f : found) EXPECT_TRUE(f.second.moving);
}

/// A fix that lets a test in between the engine's forces and what the engine does with them.
struct Hooks {
  std::function<void()> before_forces, after_forces;
};
Hooks* hooks = nullptr;

class FixHooks : public LAMMPS_NS::Fix {
 public:
  using Fix::Fix;
  int setmask() override { return LAMMPS_NS::FixConst::PRE_FORCE | LAMMPS_NS::FixConst::POST_FORCE; }
  void pre_force(int) override {
    if (hooks && hooks->before_forces) hooks->before_forces();
  }
  void post_force(int) override {
    if (hooks && hooks->after_forces) hooks->after_forces();
  }
};

LAMMPS_NS::Fix* make_hooks(LAMMPS_NS::LAMMPS* lmp, int narg, char** arg) { return new FixHooks(lmp, narg, arg); }

/// Some granules that press on a floor of two triangles, without gravity, and a step so short that nothing moves.
struct Floor {
  Engine e;
  MeshLoads loads;
  Hooks mine;

  static constexpr double overlap[] = {2e-5, 3e-5, 4e-5, 5e-5};

  Floor() : loads(e.lammps()) {
    write_stl("floor.stl", {{Vec{0, 0, 0.01}, Vec{side, 0, 0.01}, Vec{side, side, 0.01}},
                            {Vec{0, 0, 0.01}, Vec{side, side, 0.01}, Vec{0, side, 0.01}}});
    solidcull::engine::fix_styles(*e.lammps()->modify)["test/hooks"] = make_hooks;
    std::vector<Vec3> places;
    const double x[] = {0.011, 0.029, 0.031, 0.012}, y[] = {0.004, 0.007, 0.036, 0.033};
    for (int k = 0; k < 4; ++k) places.emplace_back(x[k], y[k], 0.01 + radius - overlap[k]);
    places.emplace_back(0.007, 0.015, 0.01 + radius + 1e-4);  // over it
    e.run(box("fix floor all mesh/surface/stress file floor.stl type 1\nfix wall all wall/gran " + std::string(contact) +
                  " mesh n_meshes 1 meshes floor\n",
              places, 1e-15) +
          "fix hooks all test/hooks\n");
    loads.connect();
    hooks = &mine;
  }
  ~Floor() { hooks = nullptr; }

  /// Force and torque on the mesh as the engine sums them.
  std::array<double, 6> total() {
    std::array<double, 6> sum;
    for (int d = 0; d < 6; ++d) sum[d] = e.vector("floor", 1 + d);
    return sum;
  }
  /// On each element of this rank.
  std::vector<Vec> on_elements() {
    LAMMPS_NS::Modify* modify = e.lammps()->modify;
    auto* mesh = static_cast<LAMMPS_NS::FixMeshSurface*>(modify->fix[modify->find_fix("floor")])->triMesh();
    auto* f = mesh->prop().getElementProperty<LAMMPS_NS::VectorContainer<double, 3>>("f");
    std::vector<Vec> all;
    for (int t = 0; t < mesh->sizeLocal(); ++t) all.push_back({(*f)(t)[0], (*f)(t)[1], (*f)(t)[2]});
    return all;
  }
};

TEST(MeshLoads, OnGranulesAreTheOppositeOfWhatTheEngineSums) {
  Floor floor;
  std::map<int, std::vector<WallLoad>> seen;  // of this rank's granules
  floor.mine.before_forces = [&] { floor.loads.begin_step(true); };
  floor.mine.after_forces = [&] {
    const LAMMPS_NS::Atom* atom = floor.e.lammps()->atom;
    for (int i = 0; i < atom->nlocal; ++i) seen[atom->tag[i]] = floor.loads.of(atom->tag[i]);
  };
  floor.e.run("run 1\n");
  double mine[6] = {}, sum[6];
  const double stiffness = 5e6 / (2 * (1 - 0.3 * 0.3));
  const std::vector<Vec> on_elements = floor.on_elements();
  std::vector<Vec> by_element(on_elements.size(), Vec{0, 0, 0});
  int contacts = 0, all = 0;
  for (const auto& [tag, loads] : seen) {
    if (tag == 5) {
      EXPECT_TRUE(loads.empty()) << "it does not touch";
      continue;
    }
    ASSERT_EQ(loads.size(), 1u) << "granule " << tag;
    const WallLoad& load = loads[0];
    const double hertz = 4.0 / 3 * stiffness * std::sqrt(radius) * std::pow(Floor::overlap[tag - 1], 1.5);
    EXPECT_NEAR(load.force[2], hertz, 1e-10 * hertz) << "granule " << tag;
    EXPECT_LE(std::hypot(load.force[0], load.force[1]), 1e-12 * hertz);
    EXPECT_EQ(load.mesh, 0);
    for (int d = 0; d < 3; ++d) {
      mine[d] += load.force[d];
      mine[3 + d] += load.torque[d];
      if (load.element < static_cast<int>(by_element.size())) by_element[load.element][d] += load.force[d];
    }
    ++contacts;
  }
  MPI_Allreduce(&contacts, &all, 1, MPI_INT, MPI_SUM, MPI_COMM_WORLD);
  EXPECT_EQ(all, 4);
  MPI_Allreduce(mine, sum, 6, MPI_DOUBLE, MPI_SUM, MPI_COMM_WORLD);
  const std::array<double, 6> total = floor.total();
  ASSERT_LT(total[2], 0);
  for (int d = 0; d < 6; ++d)
    EXPECT_NEAR(sum[d], -total[d], 1e-13 * std::abs(total[2]) * (d < 3 ? 1 : side)) << "component " << d;
  if (floor.e.ranks() == 1)
    for (std::size_t t = 0; t < on_elements.size(); ++t) {
      EXPECT_LT(on_elements[t][2], 0) << "two stand on each";
      for (int d = 0; d < 3; ++d) EXPECT_NEAR(by_element[t][d], -on_elements[t][d], 1e-13 * std::abs(total[2]));
    }
}

TEST(MeshLoads, PressedOnAnElementAreReadInTheMeshsSums) {
  Floor without;
  without.e.run("run 1\n");
  const std::array<double, 6> bare = without.total();
  const std::vector<Vec> bare_elements = without.on_elements();

  Floor floor;
  const Vec3 force(0.25, -0.5, -2), torque(0.01, 0.02, -0.03);
  const bool mine = floor.e.rank() == 0;  // one rank presses, all read it
  floor.mine.after_forces = [&] {
    if (mine) floor.loads.press(0, 1, force, torque);
    floor.loads.press(7, 0, force, torque);   // no such mesh
    floor.loads.press(0, 99, force, torque);  // no such element
    floor.loads.press(0, -1, force, torque);
  };
  floor.e.run("run 1\n");
  const std::array<double, 6> pressed = floor.total();
  for (int d = 0; d < 3; ++d) {
    EXPECT_NEAR(pressed[d] - bare[d], force[d], 1e-14) << "force " << d;
    EXPECT_NEAR(pressed[3 + d] - bare[3 + d], torque[d], 1e-14) << "torque " << d;
  }
  if (floor.e.ranks() == 1) {
    const std::vector<Vec> elements = floor.on_elements();
    ASSERT_EQ(elements.size(), 2u);
    for (int d = 0; d < 3; ++d) {
      EXPECT_EQ(elements[0][d], bare_elements[0][d]);
      EXPECT_NEAR(elements[1][d] - bare_elements[1][d], force[d], 1e-14);
    }
  }
  // granules feel nothing of it
  EXPECT_EQ(largest_difference(without.e.state(), floor.e.state(), &Granule::f), 0.0);

  // the next step begins with what granules press
  floor.mine.after_forces = nullptr;
  floor.e.run("run 1\n");
  for (int d = 0; d < 6; ++d) EXPECT_NEAR(floor.total()[d], bare[d], 1e-9 * std::abs(bare[2]));
}

TEST(MeshLoads, OfAMeshThatMovesOrHasGoneOrThatNobodyAsksAboutAreNone) {
  Floor floor;
  std::size_t loads = 0;
  floor.mine.before_forces = [&] { floor.loads.begin_step(true); };
  floor.mine.after_forces = [&] {
    loads = 0;
    for (int tag = 1; tag <= 5; ++tag) loads += floor.loads.of(tag).size();
    floor.loads.press(0, 0, Vec3(0, 0, -1), Vec3::Zero());
  };
  const auto seen = [&] {
    int mine = static_cast<int>(loads), all = 0;
    MPI_Allreduce(&mine, &all, 1, MPI_INT, MPI_SUM, MPI_COMM_WORLD);
    return all;
  };
  floor.e.run("run 1\n");
  EXPECT_EQ(seen(), 4);
  floor.mine.before_forces = [&] { floor.loads.begin_step(false); };
  floor.e.run("run 1\n");
  EXPECT_EQ(seen(), 0) << "nobody will ask";
  floor.mine.before_forces = [&] { floor.loads.begin_step(true); };
  floor.e.run("run 1\n");
  EXPECT_EQ(seen(), 4);
  floor.e.run("fix away all move/mesh mesh floor linear 0 0 -1e-6\nrun 0\n");
  floor.loads.connect();
  floor.e.run("run 1\n");
  EXPECT_EQ(seen(), 0) << "a mesh that moves keeps no loads";
  floor.e.run("unfix away\nunfix wall\nunfix floor\n");
  floor.loads.connect();
  floor.e.run("run 1\n");  // pressing on it is nothing
  EXPECT_EQ(seen(), 0);
}

}  // namespace
}  // namespace decks
