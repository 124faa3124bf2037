#include "region_interface_mesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "comm.h"
#include "domain.h"
#include "error.h"
#include "fix.h"
#include "interface_mesh_source.h"
#include "modify.h"

namespace solidcull {

RegInterfaceMesh::RegInterfaceMesh(LAMMPS_NS::LAMMPS* lmp, int narg, char** arg) : Region(lmp, narg, arg) {
  if (narg < 3) error->all(FLERR, "region interface/mesh: give the ID of a fix solid/cull");
  fix_ = arg[2];
  options(narg - 3, &arg[3]);
  if (dynamic_check())
    error->all(FLERR,
               "region interface/mesh: it moves with its bodies, and the keywords move and rotate would do nothing: leave "
               "them out");
  // LIGGGHTS would take a box once and for all, and the region follows its bodies
  bboxflag = 0;
  extent_xlo = extent_ylo = extent_zlo = extent_xhi = extent_yhi = extent_zhi = 0;
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
  reach_.clear();
  for (const auto& [body, mesh] : *meshes_) {
    if (mesh.empty()) continue;
    Reach r{&mesh, Vec3::Zero(), Vec3::Zero()};
    mesh.bounds(r.lo, r.hi);
    r.lo -= Vec3::Constant(mesh.half_width());
    r.hi += Vec3::Constant(mesh.half_width());
    reach_.push_back(r);
  }
}

/// Bodies hang together through periodic sides, some over several periods: the place counts in all of its images.
double RegInterfaceMesh::distance(const Vec3& p, const InterfaceMesh*& nearest, Vec3& image) {
  if (source_.expired()) shape_update();  // the engine asks for that once in a time step only, and fixes go between runs
  double least = HUGE_VAL;
  nearest = nullptr;
  const Vec3 edges(domain->xprd, domain->yprd, domain->zprd);
  for (const Reach& r : reach_) {
    std::array<int, 3> first{}, last{};
    for (int d = 0; d < 3; ++d) {
      if (!domain->periodicity[d]) continue;
      first[d] = static_cast<int>(std::ceil((r.lo[d] - p[d]) / edges[d]));
      last[d] = static_cast<int>(std::floor((r.hi[d] - p[d]) / edges[d]));
    }
    for (int i = first[0]; i <= last[0]; ++i)
      for (int j = first[1]; j <= last[1]; ++j)
        for (int k = first[2]; k <= last[2]; ++k) {
          const Vec3 x = p + Vec3(i, j, k).cwiseProduct(edges);
          if ((x.array() < r.lo.array()).any() || (x.array() > r.hi.array()).any()) continue;
          const double d = r.mesh->signed_distance(x);
          if (d >= least) continue;
          least = d;
          nearest = r.mesh;
          image = x;
        }
  }
  return least;
}

int RegInterfaceMesh::inside(double x, double y, double z) {
  const InterfaceMesh* body = nullptr;
  Vec3 image;
  return distance(Vec3(x, y, z), body, image) < 0;
}

int RegInterfaceMesh::contact_with(double distance, double cutoff, const InterfaceMesh* body, const Vec3& image) {
  // beyond the narrow band the distance is not known, only that it is larger
  if (!body || distance >= cutoff || distance >= body->half_width()) return 0;
  const Vec3 away = body->normal(image);
  const double side = interior ? -1 : 1;
  contact[0].r = distance;
  contact[0].delx = side * distance * away[0];
  contact[0].dely = side * distance * away[1];
  contact[0].delz = side * distance * away[2];
  return 1;
}

int RegInterfaceMesh::surface_interior(double* x, double cutoff) {
  const InterfaceMesh* body = nullptr;
  Vec3 image;
  const double d = distance(Vec3(x[0], x[1], x[2]), body, image);
  return d < 0 ? contact_with(-d, cutoff, body, image) : 0;
}

int RegInterfaceMesh::surface_exterior(double* x, double cutoff) {
  const InterfaceMesh* body = nullptr;
  Vec3 image;
  const double d = distance(Vec3(x[0], x[1], x[2]), body, image);
  return body && d > 0 ? contact_with(d, cutoff, body, image) : 0;
}

}  // namespace solidcull
