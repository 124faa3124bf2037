// GoogleTest under MPI: rank 0 reports, a failure on any rank fails the run.
#include <gtest/gtest.h>
#include <mpi.h>

// Open MPI leaves memory of plug-ins behind that it loads and drops again: such leaks have no name to suppress them by. So what
// it allocates while it starts is not looked at, and the rest is while its plug-ins are still there.
#ifdef __SANITIZE_ADDRESS__
#include <sanitizer/lsan_interface.h>
#define SANITIZED(CALL) CALL
#else
#define SANITIZED(CALL)
#endif

int main(int argc, char** argv) {
  SANITIZED(__lsan_disable());
  MPI_Init(&argc, &argv);
  SANITIZED(__lsan_enable());
  testing::InitGoogleTest(&argc, argv);
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  if (rank != 0)
    delete testing::UnitTest::GetInstance()->listeners().Release(
        testing::UnitTest::GetInstance()->listeners().default_result_printer());
  int failed = RUN_ALL_TESTS(), anywhere = 0;
  MPI_Allreduce(&failed, &anywhere, 1, MPI_INT, MPI_MAX, MPI_COMM_WORLD);
  SANITIZED(__lsan_do_leak_check());
  MPI_Finalize();
  return anywhere;
}
