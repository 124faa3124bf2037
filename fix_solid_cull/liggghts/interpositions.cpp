#include "interpositions.h"

#include <dlfcn.h>

#include <algorithm>

#include "engine_access.h"
#include "interposed.h"
#include "relocations.h"

namespace solidcull::engine {
namespace {

/// The file that holds an address of the engine.
std::string file_of(const void* address) {
  Dl_info info;
  return dladdr(address, &info) && info.dli_fname ? info.dli_fname : "the program";
}

/// Members of the engine's structures depend on how it was built; with this class it has them.
bool has_superquadrics(const std::string& engine_file) {
  void* const engine = dlopen(engine_file.c_str(), RTLD_LAZY | RTLD_NOLOAD);
  const bool has = dlsym(engine ? engine : RTLD_DEFAULT, "_ZTVN9LAMMPS_NS19AtomVecSuperquadricE") != nullptr;
  if (engine) dlclose(engine);
  return has;
}

#ifdef SUPERQUADRIC_ACTIVE_FLAG
constexpr bool superquadrics_expected = true;
#else
constexpr bool superquadrics_expected = false;
#endif

std::string find_out() {
  for (const Interposed& row : interposed) {
    const void* const own = next_symbol(row.symbol);
    const std::vector<const void*> targets = call_targets(own, row.symbol);
    const auto where = [&] { return std::string(row.name) + " of this LIGGGHTS (" + file_of(own) + ")"; };
    if (targets.empty())
      return "calls of " + where() + " cannot be redirected: build LIGGGHTS without -Bsymbolic-functions, -Ofast";
    if (std::find(targets.begin(), targets.end(), own) != targets.end())
      return "calls of " + where() + " do not come here: link or preload libsolidcull.so before LIGGGHTS is loaded";
  }
  const std::string file = file_of(next_symbol(symbol_of(Call::add_fix)));
  if (has_superquadrics(file) != superquadrics_expected)
    return "this LIGGGHTS (" + file + ") was built " + (superquadrics_expected ? "without" : "with") +
           " SUPERQUADRIC_ACTIVE_FLAG, unlike the one that solidcull was built for: build solidcull for this one";
  return "";
}

}  // namespace

const std::string& why_not_live() {
  static const std::string why = find_out();
  return why;
}

}  // namespace solidcull::engine
