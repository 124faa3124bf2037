// An error ends with its line. The engine follows one in five with a joke from memory that it has freed: a line of random
// characters. Its compiler has put the function that makes the joke into those that print errors, so these are met. They make
// none where the engine's version is not a PUBLIC one, and nothing asks for the version after an error. No rows of interposed.h:
// an engine whose calls do not arrive here works as well, and jokes.
#include "engine_access.h"
#include "error.h"
#include "universe.h"

namespace LAMMPS_NS {
namespace {

/// Does not come back.
template <class... Given>
void end_run(Universe& universe, const char* symbol, Error* error, Given... given) {
  using Original = void (*)(Error*, Given...);
  universe.version[0] = '\0';
  reinterpret_cast<Original>(solidcull::engine::next_symbol(symbol))(error, given...);
}

}  // namespace

void Error::all(const char* file, int line, const char* text) {
  end_run(*universe, "_ZN9LAMMPS_NS5Error3allEPKciS2_", this, file, line, text);
}

void Error::one(const char* file, int line, const char* text) {
  end_run(*universe, "_ZN9LAMMPS_NS5Error3oneEPKciS2_", this, file, line, text);
}

/// The one with fewer arguments calls this one.
void Error::fix_error(const char* file, int line, Fix* fix, const char* style, const char* text) {
  end_run(*universe, "_ZN9LAMMPS_NS5Error9fix_errorEPKciPNS_3FixES2_S2_", this, file, line, fix, style, text);
}

void Error::compute_error(const char* file, int line, Compute* compute, const char* text) {
  end_run(*universe, "_ZN9LAMMPS_NS5Error13compute_errorEPKciPNS_7ComputeES2_", this, file, line, compute, text);
}

void Error::universe_all(const char* file, int line, const char* text) {
  end_run(*universe, "_ZN9LAMMPS_NS5Error12universe_allEPKciS2_", this, file, line, text);
}

void Error::universe_one(const char* file, int line, const char* text) {
  end_run(*universe, "_ZN9LAMMPS_NS5Error12universe_oneEPKciS2_", this, file, line, text);
}

}  // namespace LAMMPS_NS
