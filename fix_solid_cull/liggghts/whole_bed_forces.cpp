#include "whole_bed_forces.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "atom.h"
#include "comm.h"
#include "compute.h"
#include "compute_styles.h"
#include "domain.h"
#include "fix.h"
#include "fix_solid_cull.h"
#include "force.h"
#include "lammps.h"
#include "modify.h"
#include "neigh_request.h"
#include "neighbor.h"
#include "pair.h"
#include "swapped.h"
#include "update.h"

namespace solidcull {
namespace {

bool is(const LAMMPS_NS::Fix* fix, const char* style) { return std::strcmp(fix->style, style) == 0; }
bool begins(const LAMMPS_NS::Fix* fix, const char* style) { return std::strncmp(fix->style, style, std::strlen(style)) == 0; }

bool has_list(LAMMPS_NS::LAMMPS* lmp, const LAMMPS_NS::Compute* c) {
  const LAMMPS_NS::Neighbor* neighbor = lmp->neighbor;
  return std::any_of(neighbor->requests, neighbor->requests + neighbor->nrequest,
                     [&](const LAMMPS_NS::NeighRequest* r) { return r->requestor == c; });
}

bool is_current(const LAMMPS_NS::Compute* c, LAMMPS_NS::bigint step) {
  return (c->peratom_flag && c->invoked_peratom == step) || (c->local_flag && c->invoked_local == step) ||
         (c->scalar_flag && c->invoked_scalar == step) || (c->vector_flag && c->invoked_vector == step) ||
         (c->array_flag && c->invoked_array == step);
}

/// Granular contacts have no potential energy in LIGGGHTS: the sum over all atoms is 0 whatever they are.
bool is_zero(const LAMMPS_NS::Compute* c) { return c->peflag && !c->peatomflag; }

bool needs_forces(LAMMPS_NS::LAMMPS* lmp, const LAMMPS_NS::Compute* c) {
  return measure_of(c->style).measure == Measure::contacts || c->pressflag || c->peatomflag || c->pressatomflag ||
         has_list(lmp, c);
}

}  // namespace

bool WholeBedForces::computing_ = false;

WholeBedForces::WholeBedForces(LAMMPS_NS::LAMMPS* lmp, FixSolidCull& fix) : Pointers(lmp), fix_(fix) {
  fix_.lend_contacts();
  const Swapped working(computing_, true);
  const Swapped setup(update->setupflag, 1);  // the engine's word for: do not advance histories
  const std::vector<Out> out = take_out();
  list_pairs();
  list_walls();
  compute();
  put_back(out);
}

/// A granule without contacts, as it was.
struct WholeBedForces::Out {
  int atom;
  double radius;
  std::array<double, 3> place;
};

/// The engine's bins and ghosts are those of the last run: what they do not reach they would write beside their memory.
auto WholeBedForces::take_out() const -> std::vector<Out> {
  std::vector<Out> all;
  const double reach = neighbor->cutneighmax, largest = (1 + 1e-9) * (reach - neighbor->skin);
  for (int i = 0; i < atom->nlocal; ++i) {
    double* const x = atom->x[i];
    bool reached = 2 * atom->radius[i] * neighbor->contactDistanceFactor <= largest;
    for (int d = 0; d < 3; ++d) reached = reached && x[d] >= domain->sublo[d] - reach && x[d] <= domain->subhi[d] + reach;
    if (reached) continue;
    all.push_back({i, atom->radius[i], {x[0], x[1], x[2]}});
    atom->radius[i] = radius_without_contacts;
    for (int d = 0; d < 3; ++d) x[d] = 0.5 * (domain->sublo[d] + domain->subhi[d]);
  }
  return all;
}

void WholeBedForces::put_back(const std::vector<Out>& all) const {
  for (const Out& out : all) {
    atom->radius[out.atom] = out.radius;
    std::copy(out.place.begin(), out.place.end(), atom->x[out.atom]);
  }
}

WholeBedForces::~WholeBedForces() {
  int unused = 0;
  auto* const lists_are_newer = static_cast<int*>(force->pair->extract("computeflag", unused));
  if (lists_are_newer) *lists_are_newer = 0;  // histories are with the atoms, as they were
  // as a run leaves them: lists of meshes keep the bins of each element, and the next run may have others at the same step
  for (int f = 0; f < modify->nfix; ++f)
    if (is(modify->fix[f], "neighlist/mesh")) modify->fix[f]->post_run();
  fix_.take_contacts_back();
}

/// Atoms stay on their ranks: none has gone farther than ghosts reach since the last exchange.
void WholeBedForces::list_pairs() {
  if (atom->map_style) atom->map_clear();
  atom->nghost = 0;
  comm->borders();
  fix_.tell_ghosts_their_clumps();  // pairs within a clump have no contact
  neighbor->build();
}

void WholeBedForces::list_walls() {
  for (int f = 0; f < modify->nfix; ++f) {
    LAMMPS_NS::Fix* const fix = modify->fix[f];
    if (is(fix, "neighlist/mesh") || is(fix, "contacthistory/mesh")) {
      fix->setup_pre_force(0);
    } else if (begins(fix, "wall/gran")) {
      fix->pre_neighbor();
      fix->pre_force(0);
    }
  }
}

void WholeBedForces::compute() {
  for (int i = 0; i < atom->nlocal; ++i)
    for (int d = 0; d < 3; ++d) atom->f[i][d] = atom->torque[i][d] = 0;
  constexpr int energy_of_all = 1, energy_of_each = 2, virial_of_all = 1, virial_of_each = 4;
  int energies = 0, virials = 0;
  for (int c = 0; c < modify->ncompute; ++c) {
    const LAMMPS_NS::Compute* compute = modify->compute[c];
    energies |= (compute->peflag ? energy_of_all : 0) | (compute->peatomflag ? energy_of_each : 0);
    virials |= (compute->pressflag ? virial_of_all : 0) | (compute->pressatomflag ? virial_of_each : 0);
  }
  if (force->pair->compute_flag) force->pair->compute(energies, virials);
  for (int f = 0; f < modify->nfix; ++f)
    if ((modify->fmask[f] & LAMMPS_NS::FixConst::POST_FORCE) && !is(modify->fix[f], "external"))
      modify->fix[f]->post_force(virials);
}

bool some_current_number_needs_forces(LAMMPS_NS::LAMMPS* lmp) {
  const LAMMPS_NS::Modify* modify = lmp->modify;
  if (std::any_of(modify->fix, modify->fix + modify->nfix, [](const LAMMPS_NS::Fix* f) { return is(f, "store/force"); }))
    return true;  // a number of the deck may be made of them
  return std::any_of(modify->compute, modify->compute + modify->ncompute, [&](const LAMMPS_NS::Compute* c) {
    return is_current(c, lmp->update->ntimestep) && !is_zero(c) && needs_forces(lmp, c);
  });
}

bool may_need_forces(LAMMPS_NS::LAMMPS* lmp, const char* compute) {
  LAMMPS_NS::Modify* modify = lmp->modify;
  const int number = modify->find_compute(compute);
  if (number < 0 || is_current(modify->compute[number], lmp->update->ntimestep)) return false;
  return std::any_of(modify->compute, modify->compute + modify->ncompute,
                     [&](const LAMMPS_NS::Compute* c) { return !is_zero(c) && needs_forces(lmp, c); });
}

void compute_again(LAMMPS_NS::LAMMPS* lmp) {
  LAMMPS_NS::Modify* modify = lmp->modify;
  const LAMMPS_NS::bigint step = lmp->update->ntimestep;
  modify->clearstep_compute();
  for (int c = 0; c < modify->ncompute; ++c) {
    LAMMPS_NS::Compute* compute = modify->compute[c];
    if (is_zero(compute)) continue;
    if (compute->peratom_flag && compute->invoked_peratom == step) compute->compute_peratom();
    if (compute->local_flag && compute->invoked_local == step) compute->compute_local();
    if (compute->scalar_flag && compute->invoked_scalar == step) compute->compute_scalar();
    if (compute->vector_flag && compute->invoked_vector == step) compute->compute_vector();
    if (compute->array_flag && compute->invoked_array == step) compute->compute_array();
  }
  modify->clearstep_compute();
}

}  // namespace solidcull
