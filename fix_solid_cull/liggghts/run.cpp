#include "run.h"

#include <cstdio>
#include <cstring>
#include <limits>

#include "comm.h"
#include "domain.h"
#include "fix_gravity.h"
#include "modify.h"
#include "neighbor.h"
#include "timer.h"
#include "update.h"

namespace solidcull {

void EngineRun::renew() {
  step = update->ntimestep - reset_by;
  steps_left = update->laststep - update->ntimestep;
  dt = update->dt;
  skin = neighbor->skin;
  box = {vec(domain->boxlo), vec(domain->boxhi)};
  periodic = {domain->xperiodic != 0, domain->yperiodic != 0, domain->zperiodic != 0};
  constexpr int fixed = 1;  // of Domain::boundary
  constexpr double never = std::numeric_limits<double>::infinity();
  for (int d = 0; d < 3; ++d) {
    kept.lo[d] = domain->boundary[d][0] == fixed ? box.lo[d] : -never;
    kept.hi[d] = domain->boundary[d][1] == fixed ? box.hi[d] : never;
  }
}

Vec3 EngineRun::gravity() const {
  Vec3 g = Vec3::Zero();
  for (int f = 0; f < modify->nfix; ++f)
    if (std::strcmp(modify->fix[f]->style, "gravity") == 0) {
      double one[3];
      static_cast<LAMMPS_NS::FixGravity*>(modify->fix[f])->get_gravity(one);
      g += vec(one);
    }
  return g;
}

Vec3 EngineRun::wrapped(const Vec3& place) const {
  double x[3];
  set(x, place);
  domain->remap(x);
  return vec(x);
}

bool EngineRun::ask_for_reneighbouring(std::int64_t at) {
  const bool is_new = own_->next_reneighbor != at + reset_by;
  own_->next_reneighbor = at + reset_by;
  return is_new;
}

double EngineRun::seconds_of_pair_forces() const { return timer->array[TIME_PAIR]; }

void EngineRun::say(const std::string& line) const {
  if (comm->me != 0) return;
  for (FILE* to : {screen, logfile})
    if (to) std::fprintf(to, "fix %s solid/cull: %s\n", name.c_str(), line.c_str());
}

}  // namespace solidcull
