// Drives LIGGGHTS through its C library, with the fix. embeds DECK: prints how many granules there are and how many are interior.
// It names no function of solidcull, but for its version where it is compiled with it.
#include <library.h>
#include <mpi.h>

#include <cstdio>

#ifdef WITH_HEADER
#include <solidcull.h>
#endif

int main(int argc, char** argv) {
  MPI_Init(&argc, &argv);
  const char* words[] = {"embeds", "-log", "none", "-screen", "screen"};
  void* engine = nullptr;
  lammps_open(5, const_cast<char**>(words), MPI_COMM_WORLD, &engine);
  lammps_file(engine, argv[1]);
  char fix[] = "cull";
  auto* interior = static_cast<double*>(lammps_extract_fix(engine, fix, 0, 0, 0, 0));
  std::printf("%d granules, %g interior", lammps_get_natoms(engine), *interior);
#ifdef WITH_HEADER
  std::printf(", solidcull %s", solidcull_version());
#endif
  std::printf("\n");
  lammps_free(interior);
  lammps_close(engine);
  MPI_Finalize();
}
