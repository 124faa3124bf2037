// Members of LIGGGHTS 3.8 that have no accessor, reached in this one place.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "interposed.h"
#include "pose.h"

namespace LAMMPS_NS {
class Atom;
class Domain;
class Fix;
class FixContactHistory;
class FixInsert;
class FixInsertPack;
class FixInsertStream;
class FixMeshSurface;
class FixMultisphere;
class LAMMPS;
class Memory;
class Modify;
class Multisphere;
class Neighbor;
class Region;
class Thermo;
}  // namespace LAMMPS_NS

namespace solidcull::engine {

using FixCreator = LAMMPS_NS::Fix* (*)(LAMMPS_NS::LAMMPS*, int, char**);

/// The engine's own function behind one that this library interposes; ends the program with one line where there is none.
void* next_symbol(const char* mangled);
/// Likewise; nullptr where there is none.
void* found_symbol(const char* name);
template <Call call, class Function>
Function own() {
  constexpr const char* symbol = symbol_of(call);
  return reinterpret_cast<Function>(next_symbol(symbol));
}

/// The engine's table of fix styles.
std::map<std::string, FixCreator>& fix_styles(LAMMPS_NS::Modify& modify);

/// What a restart file holds for a fix, until the first run begins.
struct RestartState {
  std::string id, style;
  const char* bytes;
};
std::vector<RestartState> restart_states(const LAMMPS_NS::Modify& modify);

/// Per history number: 1 if it changes sign with the side it is seen from.
const int* history_newton_flags(const LAMMPS_NS::FixContactHistory& fix);

/// The engine's name for a history number.
const char* history_name(const LAMMPS_NS::FixContactHistory& fix, int number);

/// Rows of the partner lists: how many, their tags, their histories one after the other.
const int* history_counts(const LAMMPS_NS::FixContactHistory& fix);
const int* const* history_partners(const LAMMPS_NS::FixContactHistory& fix);
const double* const* history_numbers(const LAMMPS_NS::FixContactHistory& fix);

/// Whether the fix renumbers all granules when it inserts (compress_tags).
bool compresses_tags(const LAMMPS_NS::FixInsert& fix);
/// The mesh at which a fix massflow/mesh counts; nullptr for other fixes.
LAMMPS_NS::FixMeshSurface* counting_mesh(const LAMMPS_NS::Fix* fix);
/// Thermo output stops the run when it counts fewer atoms than the time before ("Lost atoms"): tells it of atoms that went into
/// the store (negative) or came back, so that truly lost ones are still found.
void expect_atoms(LAMMPS_NS::Thermo& thermo, long change);
/// Empties the pages that hold contact histories, for so many contacts of one atom and in a page.
void renew_pages(LAMMPS_NS::FixContactHistory& fix, int one_atom, int page);
/// Neighbour lists name no pair, and give back the pages that pairs and their histories were in.
void empty_lists(LAMMPS_NS::Neighbor& neighbor);
/// Likewise, and cuts their arrays to so many atoms.
void shrink_lists(LAMMPS_NS::Neighbor& neighbor, LAMMPS_NS::Memory& memory, int atoms);
/// Arrays of one number per atom that serve sorting, binning and the atom map, cut to Atom::nmax. Not between the engine's sort
/// and its neighbour build.
void shrink_work_arrays(LAMMPS_NS::Neighbor& neighbor, LAMMPS_NS::Atom& atom, LAMMPS_NS::Memory& memory);
/// Edges of the bins in which atoms are listed to find neighbours, and sorted (m); 0: the engine's choice.
struct BinEdges {
  double neighbor, sort;
};
BinEdges bin_edges(const LAMMPS_NS::Neighbor& neighbor, const LAMMPS_NS::Atom& atom);
/// Makes the bins anew; none smaller than they have to be. Likewise.
void set_bin_edges(LAMMPS_NS::Neighbor& neighbor, LAMMPS_NS::Atom& atom, LAMMPS_NS::Memory& memory, const BinEdges& edges);
/// For the bins that the engine makes next.
void plan_bin_edges(LAMMPS_NS::Neighbor& neighbor, LAMMPS_NS::Atom& atom, const BinEdges& edges);
/// How many bins the neighbour build has on this rank.
int neighbor_bins(const LAMMPS_NS::Neighbor& neighbor);
/// The region that an insert/pack or insert/rate fix fills.
const LAMMPS_NS::Region* insertion_region(const LAMMPS_NS::FixInsertPack& fix);
/// How a fix insert/stream puts granules behind its face.
struct Stream {
  Vec3 velocity;          ///< m/s
  double length, offset;  ///< so far behind it, and a little more where it inserts in parallel (m); 0 until they are known
  int duration;           ///< steps for which granules move with it; 0: until the next are inserted
};
Stream stream_of(const LAMMPS_NS::FixInsertStream& fix);
/// Regions that a union or an intersection is made of, all the way down; the region itself, if it is neither.
std::vector<const LAMMPS_NS::Region*> parts_of(const LAMMPS_NS::Region* region, const LAMMPS_NS::Domain& domain);
// --- clumps: the table of rows that this rank moves
int& clumps_here(LAMMPS_NS::Multisphere& clumps);
int& clumps_everywhere(LAMMPS_NS::Multisphere& clumps);
int*& rows_of_clumps(LAMMPS_NS::Multisphere& clumps);  ///< by number
int& highest_clump(LAMMPS_NS::Multisphere& clumps);
int* const& clumps_of_atoms(const LAMMPS_NS::FixMultisphere& fix);
double* const* displacements(const LAMMPS_NS::FixMultisphere& fix);  ///< of atoms from the centres of their clumps, along axes
/// The fix does its work before the exchange of atoms when all others have done theirs. Until lists of fixes are made anew.
void act_last_before_exchange(LAMMPS_NS::Modify& modify, const LAMMPS_NS::Fix* fix);

}  // namespace solidcull::engine
