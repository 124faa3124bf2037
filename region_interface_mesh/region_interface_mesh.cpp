#include "region_interface_mesh.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "comm.h"
#include "error.h"
#include "fix.h"
#include "interface_mesh_source.h"
#include "modify.h"

namespace solidcull {

RegInterfaceMesh::RegInterfaceMesh(LAMMPS_NS::LAMMPS* lmp, int narg, char** arg) : Region(lmp, narg, arg) {
  if (narg < 3) error->all(FLERR, "region interface/mesh: give the ID of a fix solid/cull");
  fix_ = arg[2];
  options(narg - 3, &arg[3]);
  varshape = 1;
  cmax = 1;
  contact = new Contact[cmax];
  shape_update();
  made_ = true;
}

RegInterfaceMesh::~RegInterfaceMesh() { delete[] contact; }

/// Only the command is given on all ranks alike: of the questions, ranks without atoms ask none.
void RegInterfaceMesh::refuse() const {
  const std::string line = "region interface/mesh: '" + fix_ + "' is no fix solid/cull: define the fix before the region, and " +
                           "delete the region before the fix";
  if (!made_ || comm->nprocs == 1) error->all(FLERR, line.c_str());
  std::fprintf(stderr, "ERROR: %s\n", line.c_str());  // MPI_Abort drops what is buffered
  std::fflush(nullptr);
  error->one(FLERR, line.c_str());
  std::abort();  // both end the program
}

void RegInterfaceMesh::shape_update() {
  const int f = modify->find_fix(fix_.c_str());
  auto* source = f >= 0 ? dynamic_cast<InterfaceMeshSource*>(modify->fix[f]) : nullptr;
  if (!source) refuse();
  meshes_ = &source->interface_meshes();
  source_ = source->source();
  Vec3 lo = Vec3::Constant(HUGE_VAL), hi = Vec3::Constant(-HUGE_VAL);
  for (const auto& mesh : *meshes_) {
    if (mesh.second.empty()) continue;
    Vec3 a, b;
    mesh.second.bounds(a, b);
    lo = lo.cwiseMin(a);
    hi = hi.cwiseMax(b);
  }
  // the box is this rank's; an empty region has an empty box
  bboxflag = interior;
  if ((lo.array() > hi.array()).any()) lo = hi = Vec3::Zero();
  extent_xlo = lo[0];
  extent_ylo = lo[1];
  extent_zlo = lo[2];
  extent_xhi = hi[0];
  extent_yhi = hi[1];
  extent_zhi = hi[2];
}

double RegInterfaceMesh::distance(const Vec3& p, const InterfaceMesh*& nearest) {
  if (source_.expired()) shape_update();  // the engine asks for that once in a time step only, and fixes go between runs
  double least = HUGE_VAL;
  nearest = nullptr;
  for (const auto& mesh : *meshes_) {
    if (mesh.second.empty()) continue;
    const double d = mesh.second.signed_distance(p);
    if (d < least) {
      least = d;
      nearest = &mesh.second;
    }
  }
  return least;
}

int RegInterfaceMesh::inside(double x, double y, double z) {
  const InterfaceMesh* body = nullptr;
  return distance(Vec3(x, y, z), body) < 0;
}

int RegInterfaceMesh::contact_with(double* x, double distance, double cutoff, const InterfaceMesh* body) {
  // beyond the narrow band the distance is not known, only that it is larger
  if (!body || distance >= cutoff || distance >= body->half_width()) return 0;
  const Vec3 away = body->normal(Vec3(x[0], x[1], x[2]));
  const double side = interior ? -1 : 1;
  contact[0].r = distance;
  contact[0].delx = side * distance * away[0];
  contact[0].dely = side * distance * away[1];
  contact[0].delz = side * distance * away[2];
  return 1;
}

int RegInterfaceMesh::surface_interior(double* x, double cutoff) {
  const InterfaceMesh* body = nullptr;
  const double d = distance(Vec3(x[0], x[1], x[2]), body);
  return d < 0 ? contact_with(x, -d, cutoff, body) : 0;
}

int RegInterfaceMesh::surface_exterior(double* x, double cutoff) {
  const InterfaceMesh* body = nullptr;
  const double d = distance(Vec3(x[0], x[1], x[2]), body);
  return body && d > 0 ? contact_with(x, d, cutoff, body) : 0;
}

}  // namespace solidcull
