#include "engine_memory.h"

#include <malloc.h>

#include <algorithm>
#include <vector>

#include "atom.h"
#include "atom_vec.h"
#include "comm.h"
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

constexpr int worth_the_trouble = 30000;  // atoms
constexpr int room = 2;                   // times the atoms that are left

}  // namespace

bool EngineMemory::too_large() const {
  return atom->nmax > worth_the_trouble && atom->nmax > 2 * room * (atom->nlocal + atom->nghost / 2 + 1000);
}

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
  malloc_trim(0);
}

}  // namespace solidcull
