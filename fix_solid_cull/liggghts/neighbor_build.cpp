// The engine's granular neighbour build, faster: the same pairs in the same order with the same contact histories. The engine's
// bins are as wide as half the reach of the largest granule, and each granule looks at all within them, wherever in memory they
// are. Here granules of one bin lie side by side (SphereBins). With a ball of eight diameters in the bed such a build costs ten
// steps: granules of unequal sizes are found through SphereLevels. Decks that have a fix solid/cull get this one, others and
// those with exclusions but for pairs within clumps, included groups or triclinic boxes the engine's own. Local.
#include <algorithm>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <numeric>
#include <vector>

#include "atom.h"
#include "engine_access.h"
#include "error.h"
#include "fix.h"
#include "fix_contact_history.h"
#include "modify.h"
#include "neigh_list.h"
#include "neighbor.h"
#include "sphere_bins.h"
#include "sphere_levels.h"
#include "whole_bed_forces.h"

namespace {

using LAMMPS_NS::Modify;
using Near = solidcull::SphereBins::Near;

constexpr double bins_for_reach = 1.5;          // reach of the largest granules over that of the mean up to which bins are good
constexpr int most_bins = 32, few_bins = 4096;  // bins per atom, and beside them, likewise

bool culls(const Modify& modify) {
  return std::any_of(modify.fix, modify.fix + modify.nfix,
                     [](const LAMMPS_NS::Fix* fix) { return std::strcmp(fix->style, "solid/cull") == 0; });
}

/// Finds those of higher index near a granule, in the engine's order and with it that of sums: by bins, then by indices.
class FoundByLevels {
 public:
  void build(const LAMMPS_NS::Atom& atom, double factor, double skin) {
    levels_.build(atom.nlocal + atom.nghost, atom.x, atom.radius, factor, skin);
  }
  const std::vector<Near>& above(int i, const double* at, double radius, const std::vector<int>& bin) {
    ordered_.clear();
    levels_.for_each_near(at, radius, [&](int j, double apart) {
      if (j > i) ordered_.push_back({static_cast<std::uint64_t>(bin[j]) << 32 | static_cast<std::uint32_t>(j), apart});
    });
    std::sort(ordered_.begin(), ordered_.end(), [](const Ordered& a, const Ordered& b) { return a.order < b.order; });
    near_.clear();
    for (const Ordered& o : ordered_) near_.push_back({static_cast<int>(o.order & 0xffffffffu), o.apart});
    return near_;
  }
  std::size_t found() const { return near_.size(); }

 private:
  struct Ordered {
    std::uint64_t order;  // bin, then index
    double apart;
  };
  solidcull::SphereLevels levels_;
  std::vector<Ordered> ordered_;
  std::vector<Near> near_;
};

}  // namespace

namespace LAMMPS_NS {

using solidcull::engine::Call;
using solidcull::engine::own;

// interposed as those in register_styles.cpp; a member, for the engine's bins and histories are its own
void Neighbor::granular_bin_no_newton(NeighList* list) {
  const bool excludes_more = exclude && (nex_type || nex_group);
  if (excludes_more || includegroup || triclinic || !culls(*modify)) {
    using Original = void (*)(Neighbor*, NeighList*);
    static const auto original = own<Call::neighbor_build, Original>();
    original(this, list);
    return;
  }
  bin_atoms();  // triangle meshes look for their granules in them
  const int owned = atom->nlocal, all = owned + atom->nghost;
  std::vector<int> bin(static_cast<std::size_t>(all));
  for (int i = 0; i < all; ++i) bin[i] = coord2bin(atom->x[i]);
  // the engine's bins are good for granules that are about as large as the largest; few in many bins are sorted by place
  const double mean = all > 0 ? std::accumulate(atom->radius, atom->radius + all, 0.0) / all : 0.0;
  const bool alike = all > 0 && cutneighmax <= bins_for_reach * (2 * mean * contactDistanceFactor + skin);
  const auto used = std::minmax_element(bin.begin(), bin.end());
  const bool by_bins = alike && *used.second - *used.first <= most_bins * all + few_bins;
  solidcull::SphereBins near_bins;
  FoundByLevels by_levels;
  if (by_bins)
    near_bins.build(all, atom->x, atom->radius, bin.data(), list->stencil, list->nstencil, contactDistanceFactor, skin);
  else
    by_levels.build(*atom, contactDistanceFactor, skin);

  FixContactHistory* const histories = list->fix_history;
  NeighList* const kept = histories ? list->listgranhistory : nullptr;
  const int width = kept ? kept->dnum : 0;
  list->ipage->reset();
  if (kept) {
    kept->ipage->reset();
    kept->dpage->reset();
  }
  const auto touches_nothing = [&](int i) { return atom->radius[i] == solidcull::WholeBedForces::radius_without_contacts; };
  bool some_touch_nothing = false;
  for (int i = 0; solidcull::WholeBedForces::at_work() && i < all; ++i)
    some_touch_nothing = some_touch_nothing || touches_nothing(i);
  const bool leaves_some_out = some_touch_nothing || exclude;
  const auto within_a_clump = [&](int i, int j) {
    return exclusion(i, j, atom->type[i], atom->type[j], atom->mask, atom->molecule) != 0;
  };
  std::vector<Near> those_that_touch;
  for (int i = 0; i < owned; ++i) {
    const std::vector<Near>& found =
        by_bins ? near_bins.above(i, atom->x[i], atom->radius[i], bin[i]) : by_levels.above(i, atom->x[i], atom->radius[i], bin);
    int n = static_cast<int>(by_bins ? near_bins.found() : by_levels.found());
    if (leaves_some_out) {
      those_that_touch.clear();
      if (!some_touch_nothing || !touches_nothing(i))
        std::copy_if(found.begin(), found.begin() + n, std::back_inserter(those_that_touch), [&](const Near& one) {
          return !(some_touch_nothing && touches_nothing(one.index)) && !(exclude && within_a_clump(i, one.index));
        });
      n = static_cast<int>(those_that_touch.size());
    }
    const std::vector<Near>& near = leaves_some_out ? those_that_touch : found;
    int* const partners = list->ipage->get(n);
    int* const touched = kept ? kept->ipage->get(n) : nullptr;
    double* const history = kept ? kept->dpage->get(n * width) : nullptr;
    if (!partners || (kept && (!touched || !history))) error->one(FLERR, "Neighbor list overflow, boost neigh_modify one");
    for (int k = 0; k < n; ++k) {
      const int j = partners[k] = near[k].index;
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
