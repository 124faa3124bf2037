// The engine's granular neighbour build, by size: the same pairs in the same order with the same contact histories, found through
// SphereLevels. The engine's bins are as wide as half the reach of the largest granule, and each granule looks at all within
// them: with a ball of eight diameters in the bed a build costs ten steps. Decks that have a fix solid/cull get this one, others
// and those with exclusions, included groups or triclinic boxes the engine's own. Local.
#include <algorithm>
#include <cstdint>
#include <cstring>
#include <utility>
#include <vector>

#include "atom.h"
#include "engine_access.h"
#include "error.h"
#include "fix.h"
#include "fix_contact_history.h"
#include "modify.h"
#include "neigh_list.h"
#include "neighbor.h"
#include "sphere_levels.h"

namespace {

using LAMMPS_NS::Modify;

bool culls(const Modify& modify) {
  return std::any_of(modify.fix, modify.fix + modify.nfix,
                     [](const LAMMPS_NS::Fix* fix) { return std::strcmp(fix->style, "solid/cull") == 0; });
}

}  // namespace

namespace LAMMPS_NS {

using solidcull::engine::Call;
using solidcull::engine::own;

// interposed as those in register_styles.cpp; a member, for the engine's bins and histories are its own
void Neighbor::granular_bin_no_newton(NeighList* list) {
  if (exclude || includegroup || triclinic || !culls(*modify)) {
    using Original = void (*)(Neighbor*, NeighList*);
    static const auto original = own<Call::neighbor_build, Original>();
    original(this, list);
    return;
  }
  bin_atoms();  // triangle meshes look for their granules in them
  const int owned = atom->nlocal, all = owned + atom->nghost;
  std::vector<int> bin(static_cast<std::size_t>(all));
  for (int i = 0; i < all; ++i) bin[i] = coord2bin(atom->x[i]);
  solidcull::SphereLevels levels;
  levels.build(all, atom->x, atom->radius, contactDistanceFactor, skin);

  FixContactHistory* const histories = list->fix_history;
  NeighList* const kept = histories ? list->listgranhistory : nullptr;
  const int width = kept ? kept->dnum : 0;
  list->ipage->reset();
  if (kept) {
    kept->ipage->reset();
    kept->dpage->reset();
  }
  struct Near {
    std::uint64_t order;  // bin, then index: the engine's order, and with it the order of sums
    double apart;
  };
  std::vector<Near> near;
  for (int i = 0; i < owned; ++i) {
    near.clear();
    levels.for_each_near(atom->x[i], atom->radius[i], [&](int j, double apart) {
      if (j > i) near.push_back({static_cast<std::uint64_t>(bin[j]) << 32 | static_cast<std::uint32_t>(j), apart});
    });
    std::sort(near.begin(), near.end(), [](const Near& a, const Near& b) { return a.order < b.order; });
    const int n = static_cast<int>(near.size());
    int* const partners = list->ipage->get(n);
    int* const touched = kept ? kept->ipage->get(n) : nullptr;
    double* const history = kept ? kept->dpage->get(n * width) : nullptr;
    if (!partners || (kept && (!touched || !history))) error->one(FLERR, "Neighbor list overflow, boost neigh_modify one");
    for (int k = 0; k < n; ++k) {
      const int j = partners[k] = static_cast<int>(near[k].order & 0xffffffffu);
      if (!kept) continue;
      const double touch = (atom->radius[i] + atom->radius[j]) * contactDistanceFactor;
      int m = histories->npartner_[i];
      if (near[k].apart < touch * touch) {
        const int* const known = histories->partner_[i];
        m = static_cast<int>(std::find(known, known + histories->npartner_[i], atom->tag[j]) - known);
      }
      touched[k] = m < histories->npartner_[i];
      double* const values = history + static_cast<std::ptrdiff_t>(width) * k;
      if (touched[k])
        std::copy_n(histories->contacthistory_[i] + static_cast<std::ptrdiff_t>(width) * m, width, values);
      else
        std::fill_n(values, width, 0.0);
    }
    list->ilist[i] = i;
    list->firstneigh[i] = partners;
    list->numneigh[i] = n;
    if (kept) {
      kept->firstneigh[i] = touched;
      kept->firstdouble[i] = history;
    }
  }
  list->inum = owned;
}

}  // namespace LAMMPS_NS
