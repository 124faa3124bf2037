#include "engine_memory.h"

#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "atom.h"
#include "atom_vec.h"
#include "comm.h"
#include "domain.h"
#include "engine_access.h"
#include "fix_contact_history.h"
#include "force.h"
#include "memory.h"
#include "modify.h"
#include "neigh_list.h"
#include "neighbor.h"
#include "pair.h"

namespace solidcull {
namespace {

constexpr int worth_the_trouble = 15000;       // atoms: more than the engine adds at once to arrays that were cut to a few
constexpr std::size_t worth_a_trim = 4 << 20;  // bytes
constexpr int room = 2;                        // times the atoms that are left
constexpr int bin_style = 1;                   // Neighbor::style
constexpr int few_bins = 100000;               // so many are not worth the trouble
// with fewer atoms than a share of the bins these become wider, with more than another share they become what they were
constexpr double few_atoms = 1.0 / 64, many_atoms = 1.0 / 16;  // per bin as the deck has it
constexpr double wider_neighbor = 2, wider_sort = 4;           // triangles look at all that is in the bins near them

}  // namespace

void EngineMemory::make_room(std::size_t granules) {
  if (granules < static_cast<std::size_t>(worth_the_trouble)) return;
  engine::empty_lists(*neighbor);
  malloc_trim(0);
}

int EngineMemory::fair(int left) const { return std::max(worth_the_trouble, 2 * room * (left + atom->nghost / 2 + 1000)); }

void EngineMemory::give_rows_back(int left) {
  const int rows = std::max(atom->nlocal, fair(left) + 1);
  if (arrays_stay_ || rows >= atom->nmax) return;
  atom->avec->grow(rows);
  atoms_.renew();
}

bool EngineMemory::too_large() const { return !arrays_stay_ && atom->nmax > fair(atom->nlocal); }

void EngineMemory::fit() {
  const int fitting = room * (atom->nlocal + 1000);

  // histories of the atoms that stay lie in pages that hold those of all
  auto* history = static_cast<LAMMPS_NS::FixContactHistory*>(modify->find_fix_style_strict("contacthistory", 0));
  std::vector<std::vector<double>> packed;
  if (history) {
    std::vector<double> buffer(1 << 16);
    for (int i = 0; i < atom->nlocal; ++i) {
      const int length = history->pack_exchange(i, buffer.data());
      packed.emplace_back(buffer.begin(), buffer.begin() + length);
    }
  }
  atom->avec->grow(fitting);
  if (history) {
    engine::renew_pages(*history, neighbor->oneatom, neighbor->pgsize);
    for (int i = 0; i < atom->nlocal; ++i) history->unpack_exchange(i, packed[i].data());
  }

  engine::shrink_lists(*neighbor, *memory, fitting);
  engine::shrink_work_arrays(*neighbor, *atom, *memory);
  contacts_.release_memory();
  atoms_.renew();
}

void EngineMemory::freed(std::size_t bytes) {
  freed_ += bytes;
  if (freed_ < worth_a_trim) return;
  malloc_trim(0);
  freed_ = 0;
}

void EngineMemory::fit_bins(bool some_stored) {
  const double atoms = atom->nlocal + atom->nghost, bins = engine::neighbor_bins(*neighbor);
  if (wide_) {
    if (!some_stored || atoms > many_atoms * std::pow(wider_neighbor, 3) * bins) give_bins_back();
    return;
  }
  if (!some_stored || bins < few_bins || atoms > few_atoms * bins || neighbor->style != bin_style) return;
  widen_bins(0.5 * neighbor->cutneighmax);
  if (wide_) engine::set_bin_edges(*neighbor, *atom, *memory, ours_);
}

/// From an edge that is the engine's choice; not where the deck has its own.
void EngineMemory::widen_bins(double edge) {
  const engine::BinEdges now = engine::bin_edges(*neighbor, *atom);
  if (now.neighbor > 0 || now.sort > 0) return;
  ours_ = {wider_neighbor * edge, wider_sort * edge};
  wide_ = true;
}

void EngineMemory::expect_stored(double largest_radius) {
  if (wide_ || neighbor->style != bin_style) return;
  const double edge = largest_radius + 0.5 * neighbor->skin;
  double bins = 1;
  for (int d = 0; d < 3; ++d) bins *= (domain->subhi[d] - domain->sublo[d]) / edge;
  if (bins < few_bins || atom->nlocal > few_atoms * bins) return;
  widen_bins(edge);
  if (wide_) engine::plan_bin_edges(*neighbor, *atom, ours_);
}

void EngineMemory::give_bins_back() {
  const engine::BinEdges now = engine::bin_edges(*neighbor, *atom);
  if (wide_ && now.neighbor == ours_.neighbor && now.sort == ours_.sort)  // else the deck has set its own since
    engine::set_bin_edges(*neighbor, *atom, *memory, {0, 0});
  wide_ = false;
}

}  // namespace solidcull
