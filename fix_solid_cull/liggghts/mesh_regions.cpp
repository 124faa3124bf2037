#include "mesh_regions.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <initializer_list>
#include <set>

#include "comm.h"
#include "compute_styles.h"
#include "domain.h"
#include "fix_styles.h"
#include "lammps.h"
#include "region_interface_mesh.h"

namespace solidcull {
namespace {

/// Unions and intersections. One that was deleted stays until another takes its place.
std::set<const LAMMPS_NS::Region*> made_of_meshes;

bool is_mesh(const LAMMPS_NS::Region* region) {
  return dynamic_cast<const RegInterfaceMesh*>(region) != nullptr || made_of_meshes.count(region) != 0;
}

bool is_mesh(LAMMPS_NS::LAMMPS* lmp, const char* id) {
  for (int r = 0; r < lmp->domain->nregion; ++r)
    if (std::strcmp(lmp->domain->regions[r]->id, id) == 0) return is_mesh(lmp->domain->regions[r]);
  return false;
}

bool begins_with(const char* word, const char* with) { return std::strncmp(word, with, std::strlen(with)) == 0; }

std::string line(const std::string& who, const char* id) {
  return "region interface/mesh: each rank knows it for its own granules, and it follows them: " + who + " cannot use '" + id +
         "'; give a region of another style";
}

/// Its group is not culled, so none of it is ever in a solid body.
std::string line_of_empty_region(const std::string& who, const char* id) {
  return "region interface/mesh: granules of the group of " + who + " are not culled, so none of them would be in '" + id +
         "'; give a region of another style, or a group";
}

/// The word that names such a region after a keyword of regions, from `first` on; wall/region has none, and names it at `first`.
/// -1: there is none.
int mesh_after_a_keyword(LAMMPS_NS::LAMMPS* lmp, int first, int narg, const char* const* arg) {
  for (int w = first; w < narg; ++w)
    if (std::strstr(arg[w - 1], "region") != nullptr && is_mesh(lmp, arg[w])) return w;
  return -1;
}

}  // namespace

void region_was_made(LAMMPS_NS::LAMMPS* lmp, int narg, const char* const* arg) {
  if (lmp->domain->nregion == 0 || narg < 2) return;
  const LAMMPS_NS::Region* const newest = lmp->domain->regions[lmp->domain->nregion - 1];
  if (std::strcmp(newest->id, arg[0]) != 0) return;  // it was deleted
  made_of_meshes.erase(newest);
  if (narg < 3 || (std::strcmp(arg[1], "union") != 0 && std::strcmp(arg[1], "intersect") != 0)) return;
  const int last = std::min(narg, 3 + std::atoi(arg[2]));
  if (std::any_of(arg + 3, arg + last, [&](const char* id) { return is_mesh(lmp, id); })) made_of_meshes.insert(newest);
}

bool has_interface_mesh(LAMMPS_NS::LAMMPS* lmp) {
  LAMMPS_NS::Region** const regions = lmp->domain->regions;
  return std::any_of(regions, regions + lmp->domain->nregion, [](const LAMMPS_NS::Region* r) { return is_mesh(r); });
}

std::string why_no_interface_mesh_for_fix(LAMMPS_NS::LAMMPS* lmp, int narg, const char* const* arg) {
  if (narg < 4) return "";
  const Treatment treatment = treatment_of(arg[2]).treatment;
  if (treatment == Treatment::holds || treatment == Treatment::drives) {
    const int first = begins_with(arg[2], "wall/region") ? 3 : 4;
    const int w = mesh_after_a_keyword(lmp, first, narg, arg);
    return w < 0 ? "" : line_of_empty_region("fix " + std::string(arg[0]) + " " + arg[2], arg[w]);
  }
  const bool names_only = begins_with(arg[2], "region/variable");
  const auto takes_it = {"insert/", "particletemplate/", "mesh/surface", "ave/euler"};
  if (!names_only && std::none_of(takes_it.begin(), takes_it.end(), [&](const char* s) { return begins_with(arg[2], s); }))
    return "";
  for (int w = 3; w < narg; ++w) {
    const bool named = names_only || std::strcmp(arg[w - 1], "region") == 0 || std::strcmp(arg[w - 1], "basevolume_region") == 0;
    if (named && is_mesh(lmp, arg[w])) return line("fix " + std::string(arg[0]) + " " + arg[2], arg[w]);
  }
  return "";
}

/// Random places of create_atoms are drawn alike on all ranks, and tried alike.
std::string why_no_interface_mesh_for_command(LAMMPS_NS::LAMMPS* lmp, const std::string& command, int narg,
                                              const char* const* arg) {
  const bool counts = command == "compute" && narg > 3 && measure_of(arg[2]).measure == Measure::whole;
  if (const int w = counts ? mesh_after_a_keyword(lmp, 4, narg, arg) : -1; w >= 0)
    return line_of_empty_region("compute " + std::string(arg[0]) + " " + arg[2], arg[w]);
  const bool random = command == "create_atoms" && narg > 4 && std::strcmp(arg[1], "random") == 0;
  if (!random || lmp->comm->nprocs == 1 || !is_mesh(lmp, arg[4])) return "";
  return line(command + " random on several ranks", arg[4]);
}

}  // namespace solidcull
