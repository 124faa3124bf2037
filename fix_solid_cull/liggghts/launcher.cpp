// liggghts-solidcull: the stock LIGGGHTS with solidcull's styles. Takes every argument and signal that `liggghts` takes; and
// `-version`, alone.
#include <mpi.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "input.h"
#include "lammps.h"
#include "signal_handling.h"
#include "solidcull.h"

namespace {

void on_signal(int number, void (*handler)(int)) {
  struct sigaction action = {};
  action.sa_handler = handler;
  sigaction(number, &action, nullptr);
}

/// Open MPI starts a daemon for each program that neither mpirun nor srun started, so that it could start others
/// (MPI_Comm_spawn). LIGGGHTS never does, and on a busy machine the daemon may fail to start, and the run with it. Without one
/// all such programs share a folder for sockets, which one rank has no use for; one that ends takes it away from one that starts,
/// whose MPI_Init then fails. Nor does one rank need a network, whose drivers take 0.2 s to measure the processor's clock. Other
/// MPIs do not read this, and what the user has set stays.
void alone() {
  for (const char* started_by : {"OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_RANK"}) {
    if (getenv(started_by)) return;
  }
  const int keep = 0;
  setenv("OMPI_MCA_ess_singleton_isolated", "1", keep);
  setenv("OMPI_MCA_orte_create_session_dirs", "0", keep);
  setenv("OMPI_MCA_pml", "ob1", keep);
}

/// `-v` with two more words is LIGGGHTS's `-var`.
bool asks_for_version(int argc, char** argv) {
  if (argc != 2) return false;
  for (const char* word : {"-version", "--version", "-v"})
    if (strcmp(argv[1], word) == 0) return true;
  return false;
}

}  // namespace

/// LIGGGHTS ends here where one rank alone has an error: what it wrote to screen and log, why above all on screen, is
/// not lost with it.
extern "C" int MPI_Abort(MPI_Comm ranks, int status) {
  fflush(nullptr);
  return PMPI_Abort(ranks, status);
}

int main(int argc, char** argv) {
  if (asks_for_version(argc, argv)) {
    printf("solidcull %s\n", solidcull_version());
    return 0;
  }
  on_signal(SIGINT, LAMMPS_NS::SignalHandler::int_handler);
  on_signal(SIGTERM, LAMMPS_NS::SignalHandler::int_handler);  // mpirun turns SIGINT into SIGTERM
  on_signal(SIGUSR1, LAMMPS_NS::SignalHandler::usr1_handler);
  alone();
  MPI_Init(&argc, &argv);
  auto* lmp = new LAMMPS_NS::LAMMPS(argc, argv, MPI_COMM_WORLD);
  solidcull_register(lmp);
  lmp->input->file();
  delete lmp;
  MPI_Finalize();
  return 0;
}
