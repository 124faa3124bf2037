#include "contacts.h"

#include <algorithm>
#include <cstdint>

#include "atom.h"
#include "deck_commands.h"
#include "force.h"
#include "modify.h"
#include "neigh_list.h"
#include "neighbor.h"
#include "pair_gran.h"

namespace solidcull {
namespace {

constexpr int last_cohesion_without_torque = 2;  // sjkr2; capillary bridges drag on surfaces

}  // namespace

void EngineContacts::connect() {
  histories_.connect();
  // a contact model is five numbers of six bits: normal, tangential, cohesion, rolling, surface; 0 is off
  const auto model = static_cast<std::uint64_t>(static_cast<LAMMPS_NS::PairGran*>(force->pair)->hashcode());
  const auto part = [model](int n) { return static_cast<int>(model >> 6 * n & 63); };
  const int tangential = part(1), cohesion = part(2), rolling = part(3);
  const bool clumps = modify->n_fixes_style("multisphere") > 0;  // these are turned by what presses on their spheres
  turn_granules = tangential != 0 || rolling != 0 || cohesion > last_cohesion_without_torque || clumps;
}

void EngineContacts::renew() { reach_factor = neighbor->contactDistanceFactor; }

NeighbourRows EngineContacts::neighbours() const {
  const LAMMPS_NS::NeighList* list = force->pair->list;
  return {list->inum, list->ilist, list->numneigh, list->firstneigh, NEIGHMASK};
}

void EngineContacts::forget_neighbours() {
  for (int l = 0; l < neighbor->nlist; ++l)
    if (neighbor->lists[l]) neighbor->lists[l]->inum = 0;
  leave_lists(lmp);
}

/// `neigh_modify exclude` would do it, at a test for every candidate pair: neighbour builds take 1.7 times as long with it.
void EngineContacts::leave_out_pairs_within(const std::vector<std::int64_t>& body) {
  LAMMPS_NS::NeighList* list = force->pair->list;
  LAMMPS_NS::NeighList* histories = force->pair->listgranhistory;
  const int width = static_cast<LAMMPS_NS::PairGran*>(force->pair)->dnum();
  for (int row = 0; row < list->inum; ++row) {
    const int i = list->ilist[row];
    if (i >= atom->nlocal || !body[i]) continue;
    int kept = 0;
    for (int k = 0; k < list->numneigh[i]; ++k) {
      if (body[list->firstneigh[i][k] & NEIGHMASK] == body[i]) continue;
      list->firstneigh[i][kept] = list->firstneigh[i][k];
      if (histories) {
        histories->firstneigh[i][kept] = histories->firstneigh[i][k];
        std::copy_n(histories->firstdouble[i] + static_cast<std::ptrdiff_t>(width) * k, width,
                    histories->firstdouble[i] + static_cast<std::ptrdiff_t>(width) * kept);
      }
      ++kept;
    }
    list->numneigh[i] = kept;
  }
}

}  // namespace solidcull
