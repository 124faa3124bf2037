// Compiled by engine.cmake when an engine is chosen, and never linked. What it asks of the engine must be in the engine's
// library: the functions by their argument types, the classes by the sizes of their tables of virtual functions.
#include <mpi.h>

#include "domain.h"
#include "fix.h"
#include "lammps.h"
#include "memory.h"
#include "modify.h"
#include "pair.h"

namespace solidcull_probe {

struct Fix : LAMMPS_NS::Fix {
  ~Fix();
};
struct Domain : LAMMPS_NS::Domain {
  ~Domain();
};
struct Modify : LAMMPS_NS::Modify {
  ~Modify();
};
struct Pair : LAMMPS_NS::Pair {
  ~Pair();
};
Fix::~Fix() {}
Domain::~Domain() {}
Modify::~Modify() {}
Pair::~Pair() {}

LAMMPS_NS::LAMMPS* mpi(int words, char** word, MPI_Comm ranks) { return new LAMMPS_NS::LAMMPS(words, word, ranks); }
void* counts(LAMMPS_NS::Memory& memory, LAMMPS_NS::bigint bytes) { return memory.smalloc(bytes, ""); }
void images(LAMMPS_NS::Domain& domain, double* place, LAMMPS_NS::tagint image) { domain.unmap(place, image); }

}  // namespace solidcull_probe
