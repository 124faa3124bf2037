// liggghts-solidcull: the stock LIGGGHTS with solidcull's styles. Takes every argument and signal that `liggghts` takes.
#include <mpi.h>
#include <signal.h>

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

}  // namespace

int main(int argc, char** argv) {
  on_signal(SIGINT, LAMMPS_NS::SignalHandler::int_handler);
  on_signal(SIGTERM, LAMMPS_NS::SignalHandler::int_handler);  // mpirun turns SIGINT into SIGTERM
  on_signal(SIGUSR1, LAMMPS_NS::SignalHandler::usr1_handler);
  MPI_Init(&argc, &argv);
  auto* lmp = new LAMMPS_NS::LAMMPS(argc, argv, MPI_COMM_WORLD);
  solidcull_register(lmp);
  lmp->input->file();
  delete lmp;
  MPI_Finalize();
  return 0;
}
