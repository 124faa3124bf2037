#include "mesh_regions.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <initializer_list>
#include <set>

#include "comm.h"
#include "domain.h"
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

/// Random places are drawn alike on all ranks, and tried alike.
std::string why_no_interface_mesh_for_command(LAMMPS_NS::LAMMPS* lmp, const std::string& command, int narg,
                                              const char* const* arg) {
  const bool random = command == "create_atoms" && narg > 4 && std::strcmp(arg[1], "random") == 0;
  if (!random || lmp->comm->nprocs == 1 || !is_mesh(lmp, arg[4])) return "";
  return line(command + " random on several ranks", arg[4]);
}

}  // namespace solidcull
