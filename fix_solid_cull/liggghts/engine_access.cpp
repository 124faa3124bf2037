// A pointer to a private member may be named in an explicit template instantiation ([temp.explicit]): legal C++, and checked by
// the compiler against the engine's own headers, so a LIGGGHTS that names these members otherwise does not compile.
#include "engine_access.h"

#include <dlfcn.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "atom.h"
#include "domain.h"
#include "fix.h"
#include "fix_contact_history.h"
#include "fix_insert.h"
#include "fix_insert_pack.h"
#include "fix_insert_stream.h"
#include "fix_massflow_mesh.h"
#include "fix_multisphere.h"
#include "memory.h"
#include "modify.h"
#include "neigh_list.h"
#include "neighbor.h"
#include "region_intersect.h"
#include "region_union.h"
#include "thermo.h"

namespace solidcull::engine {

template <class Tag, typename Tag::type Member>
struct Expose {
  friend typename Tag::type member(Tag) { return Member; }
};

#define SOLIDCULL_EXPOSE(NAME, CLASS, TYPE, MEMBER) \
  struct NAME {                                     \
    using type = TYPE LAMMPS_NS::CLASS::*;          \
    friend type member(NAME);                       \
  };                                                \
  template struct Expose<NAME, &LAMMPS_NS::CLASS::MEMBER>;

using FixStyles = std::map<std::string, FixCreator>;
SOLIDCULL_EXPOSE(ModifyFixMap, Modify, FixStyles*, fix_map)
SOLIDCULL_EXPOSE(ModifyStateIds, Modify, char**, id_restart_global)
SOLIDCULL_EXPOSE(ModifyStateStyles, Modify, char**, style_restart_global)
SOLIDCULL_EXPOSE(ModifyStates, Modify, char**, state_restart_global)
SOLIDCULL_EXPOSE(HistoryNewton, FixContactHistory, int*, newtonflag_)
SOLIDCULL_EXPOSE(HistoryNames, FixContactHistory, char**, history_id_)
SOLIDCULL_EXPOSE(HistoryCounts, FixContactHistory, int*, npartner_)
SOLIDCULL_EXPOSE(HistoryPartners, FixContactHistory, int**, partner_)
SOLIDCULL_EXPOSE(HistoryNumbers, FixContactHistory, double**, contacthistory_)
SOLIDCULL_EXPOSE(InsertCompress, FixInsert, bool, compress_flag)
SOLIDCULL_EXPOSE(PackRegion, FixInsertPack, LAMMPS_NS::Region*, ins_region)
using Three = double[3];
SOLIDCULL_EXPOSE(InsertVelocity, FixInsert, Three, v_insert)
SOLIDCULL_EXPOSE(StreamLength, FixInsertStream, double, extrude_length)
SOLIDCULL_EXPOSE(StreamOffset, FixInsertStream, double, extrude_length_min)
SOLIDCULL_EXPOSE(StreamDuration, FixInsertStream, int, duration)
SOLIDCULL_EXPOSE(UnionParts, RegUnion, int*, list)
SOLIDCULL_EXPOSE(UnionCount, RegUnion, int, nregion)
SOLIDCULL_EXPOSE(IntersectParts, RegIntersect, int*, list)
SOLIDCULL_EXPOSE(IntersectCount, RegIntersect, int, nregion)
SOLIDCULL_EXPOSE(BeforeExchange, Modify, int*, list_pre_exchange)
SOLIDCULL_EXPOSE(BeforeExchangeCount, Modify, int, n_pre_exchange)
SOLIDCULL_EXPOSE(CountingMesh, FixMassflowMesh, LAMMPS_NS::FixMeshSurface*, fix_mesh_)
SOLIDCULL_EXPOSE(ThermoAtoms, Thermo, LAMMPS_NS::bigint, last_natoms)
SOLIDCULL_EXPOSE(HistoryIntPages, FixContactHistory, LAMMPS_NS::MyPage<int>*, ipage_)
SOLIDCULL_EXPOSE(HistoryPages, FixContactHistory, LAMMPS_NS::MyPage<double>*, dpage_)
SOLIDCULL_EXPOSE(ListAtoms, NeighList, int, maxatoms)
SOLIDCULL_EXPOSE(NeighborAtoms, Neighbor, int, maxatom)
SOLIDCULL_EXPOSE(HeldPlaces, Neighbor, double**, xhold)
SOLIDCULL_EXPOSE(HeldRadii, Neighbor, double*, rhold)
SOLIDCULL_EXPOSE(HeldAtoms, Neighbor, int, maxhold)
SOLIDCULL_EXPOSE(NeighborBins, Neighbor, int, mbins)
SOLIDCULL_EXPOSE(NeighborBinHeads, Neighbor, int*, binhead)
SOLIDCULL_EXPOSE(NeighborMostBins, Neighbor, int, maxhead)
SOLIDCULL_EXPOSE(NeighborBinsOwn, Neighbor, int, binsizeflag)
SOLIDCULL_EXPOSE(NeighborBinEdge, Neighbor, double, binsize_user)
SOLIDCULL_EXPOSE(NeighborNext, Neighbor, int*, bins)
SOLIDCULL_EXPOSE(NeighborMostNext, Neighbor, int, maxbin)
using Procedure = void();
SOLIDCULL_EXPOSE(SortBinHeads, Atom, int*, binhead)
SOLIDCULL_EXPOSE(SortMostBins, Atom, int, maxbin)
SOLIDCULL_EXPOSE(SortBinEdge, Atom, double, userbinsize)
SOLIDCULL_EXPOSE(SortSetup, Atom, Procedure, setup_sort_bins)
SOLIDCULL_EXPOSE(SortNext, Atom, int*, next)
SOLIDCULL_EXPOSE(SortPermutation, Atom, int*, permute)
SOLIDCULL_EXPOSE(SortMostAtoms, Atom, int, maxnext)
SOLIDCULL_EXPOSE(SameTagAtoms, Atom, int, smax)
SOLIDCULL_EXPOSE(ClumpsHere, Multisphere, int, nbody_)
SOLIDCULL_EXPOSE(ClumpsEverywhere, Multisphere, int, nbody_all_)
SOLIDCULL_EXPOSE(RowsOfClumps, Multisphere, int*, mapArray_)
SOLIDCULL_EXPOSE(HighestClump, Multisphere, int, mapTagMax_)
SOLIDCULL_EXPOSE(ClumpsOfAtoms, FixMultisphere, int*, body_)
SOLIDCULL_EXPOSE(Displacements, FixMultisphere, double**, displace_)
#undef SOLIDCULL_EXPOSE

std::map<std::string, FixCreator>& fix_styles(LAMMPS_NS::Modify& modify) { return *(modify.*member(ModifyFixMap())); }

std::vector<RestartState> restart_states(const LAMMPS_NS::Modify& modify) {
  std::vector<RestartState> states;
  for (int s = 0; s < modify.nfix_restart_global; ++s)
    states.push_back(
        {(modify.*member(ModifyStateIds()))[s], (modify.*member(ModifyStateStyles()))[s], (modify.*member(ModifyStates()))[s]});
  return states;
}

const int* history_newton_flags(const LAMMPS_NS::FixContactHistory& fix) { return fix.*member(HistoryNewton()); }

const char* history_name(const LAMMPS_NS::FixContactHistory& fix, int number) { return (fix.*member(HistoryNames()))[number]; }

const int* history_counts(const LAMMPS_NS::FixContactHistory& fix) { return fix.*member(HistoryCounts()); }

const int* const* history_partners(const LAMMPS_NS::FixContactHistory& fix) { return fix.*member(HistoryPartners()); }

const double* const* history_numbers(const LAMMPS_NS::FixContactHistory& fix) { return fix.*member(HistoryNumbers()); }

bool compresses_tags(const LAMMPS_NS::FixInsert& fix) { return fix.*member(InsertCompress()); }

void expect_atoms(LAMMPS_NS::Thermo& thermo, long change) {
  LAMMPS_NS::bigint& last = thermo.*member(ThermoAtoms());
  if (last > 0) last += change;  // 0 from the start of a run to its first output
}

const LAMMPS_NS::Region* insertion_region(const LAMMPS_NS::FixInsertPack& fix) { return fix.*member(PackRegion()); }

Stream stream_of(const LAMMPS_NS::FixInsertStream& fix) {
  const double* const v = fix.*member(InsertVelocity());
  return {Vec3(v[0], v[1], v[2]), fix.*member(StreamLength()), fix.*member(StreamOffset()), fix.*member(StreamDuration())};
}

std::vector<const LAMMPS_NS::Region*> parts_of(const LAMMPS_NS::Region* region, const LAMMPS_NS::Domain& domain) {
  const int *list = nullptr, *end = nullptr;
  if (const auto* united = dynamic_cast<const LAMMPS_NS::RegUnion*>(region)) {
    list = united->*member(UnionParts());
    end = list + united->*member(UnionCount());
  } else if (const auto* common = dynamic_cast<const LAMMPS_NS::RegIntersect*>(region)) {
    list = common->*member(IntersectParts());
    end = list + common->*member(IntersectCount());
  } else {
    return {region};
  }
  std::vector<const LAMMPS_NS::Region*> all;
  for (; list != end; ++list)
    for (const LAMMPS_NS::Region* part : parts_of(domain.regions[*list], domain)) all.push_back(part);
  return all;
}

void act_last_before_exchange(LAMMPS_NS::Modify& modify, const LAMMPS_NS::Fix* fix) {
  int* const list = modify.*member(BeforeExchange());
  int* const end = list + modify.*member(BeforeExchangeCount());
  int* const own = std::find_if(list, end, [&](int f) { return modify.fix[f] == fix; });
  if (own != end) std::rotate(own, own + 1, end);
}

LAMMPS_NS::FixMeshSurface* counting_mesh(const LAMMPS_NS::Fix* fix) {
  const auto* counts = dynamic_cast<const LAMMPS_NS::FixMassflowMesh*>(fix);
  return counts ? counts->*member(CountingMesh()) : nullptr;
}

void renew_pages(LAMMPS_NS::FixContactHistory& fix, int one_atom, int page) {
  (fix.*member(HistoryIntPages()))->init(one_atom, page);
  (fix.*member(HistoryPages()))->init(one_atom * std::max(1, fix.get_dnum()), page);
}

void empty_lists(LAMMPS_NS::Neighbor& neighbor) {
  for (int l = 0; l < neighbor.nlist; ++l) {
    LAMMPS_NS::NeighList* list = neighbor.lists[l];
    if (!list || !list->growflag) continue;
    if (list->ipage) list->ipage->init(list->oneatom, list->pgsize);
    if (list->dpage) list->dpage->init(list->dnum * list->oneatom, list->dnum * list->pgsize);
    list->inum = 0;
  }
}

void shrink_lists(LAMMPS_NS::Neighbor& neighbor, LAMMPS_NS::Memory& memory, int atoms) {
  empty_lists(neighbor);
  for (int l = 0; l < neighbor.nlist; ++l) {
    LAMMPS_NS::NeighList* list = neighbor.lists[l];
    if (!list || !list->growflag) continue;
    list->*member(ListAtoms()) = 0;
    list->grow(atoms);
  }
  neighbor.*member(NeighborAtoms()) = atoms;
  // where atoms were at the last build; the next build makes it anew
  double**& places = neighbor.*member(HeldPlaces());
  double*& radii = neighbor.*member(HeldRadii());
  if (places) memory.destroy(places);
  if (radii) memory.destroy(radii);
  places = nullptr;
  radii = nullptr;
  neighbor.*member(HeldAtoms()) = 0;
}

void shrink_work_arrays(LAMMPS_NS::Neighbor& neighbor, LAMMPS_NS::Atom& atom, LAMMPS_NS::Memory& memory) {
  const auto renew = [&](int*& array, int& size, const char* name) {
    if (!array || size <= atom.nmax) return;
    memory.destroy(array);
    memory.create(array, atom.nmax, name);
    size = atom.nmax;
  };
  renew(neighbor.*member(NeighborNext()), neighbor.*member(NeighborMostNext()), "bins");
  renew(atom.sametag, atom.*member(SameTagAtoms()), "atom:sametag");
  // the engine makes these two when it sorts next
  memory.destroy(atom.*member(SortNext()));
  memory.destroy(atom.*member(SortPermutation()));
  atom.*member(SortNext()) = atom.*member(SortPermutation()) = nullptr;
  atom.*member(SortMostAtoms()) = 0;
}

int neighbor_bins(const LAMMPS_NS::Neighbor& neighbor) { return neighbor.*member(NeighborBins()); }

BinEdges bin_edges(const LAMMPS_NS::Neighbor& neighbor, const LAMMPS_NS::Atom& atom) {
  return {neighbor.*member(NeighborBinsOwn()) ? neighbor.*member(NeighborBinEdge()) : 0.0, atom.*member(SortBinEdge())};
}

void plan_bin_edges(LAMMPS_NS::Neighbor& neighbor, LAMMPS_NS::Atom& atom, const BinEdges& edges) {
  neighbor.*member(NeighborBinsOwn()) = edges.neighbor > 0;
  neighbor.*member(NeighborBinEdge()) = edges.neighbor;
  atom.*member(SortBinEdge()) = edges.sort;
}

void set_bin_edges(LAMMPS_NS::Neighbor& neighbor, LAMMPS_NS::Atom& atom, LAMMPS_NS::Memory& memory, const BinEdges& edges) {
  plan_bin_edges(neighbor, atom, edges);
  const auto drop = [&](int*& heads, int& size) {
    memory.destroy(heads);
    heads = nullptr;
    size = 0;
  };
  drop(neighbor.*member(NeighborBinHeads()), neighbor.*member(NeighborMostBins()));
  neighbor.setup_bins();
  if (atom.sortfreq == 0) return;
  drop(atom.*member(SortBinHeads()), atom.*member(SortMostBins()));
  (atom.*member(SortSetup()))();
}

int& clumps_here(LAMMPS_NS::Multisphere& clumps) { return clumps.*member(ClumpsHere()); }
int& clumps_everywhere(LAMMPS_NS::Multisphere& clumps) { return clumps.*member(ClumpsEverywhere()); }
int*& rows_of_clumps(LAMMPS_NS::Multisphere& clumps) { return clumps.*member(RowsOfClumps()); }
int& highest_clump(LAMMPS_NS::Multisphere& clumps) { return clumps.*member(HighestClump()); }
int* const& clumps_of_atoms(const LAMMPS_NS::FixMultisphere& fix) { return fix.*member(ClumpsOfAtoms()); }
double* const* displacements(const LAMMPS_NS::FixMultisphere& fix) { return fix.*member(Displacements()); }

void* found_symbol(const char* name) { return dlsym(RTLD_NEXT, name); }

void* next_symbol(const char* mangled) {
  if (void* const found = found_symbol(mangled)) return found;
  std::fprintf(stderr, "ERROR: solidcull: this LIGGGHTS has no '%s': use LIGGGHTS-PUBLIC 3.8.0 as Debian builds it\n", mangled);
  std::abort();
}

}  // namespace solidcull::engine
