// GoogleTest under MPI: rank 0 reports, the others name what fails on them; a failure on any rank fails the run.
#include <gtest/gtest.h>
#include <mpi.h>

#include <cstdio>
#include <string>

// Open MPI leaves memory of plug-ins behind that it loads and drops again: such leaks have no name to suppress them by. So what
// it allocates while it starts is not looked at, and the rest is while its plug-ins are still there.
#ifdef __SANITIZE_ADDRESS__
#include <sanitizer/lsan_interface.h>
#define SANITIZED(CALL) CALL
#else
#define SANITIZED(CALL)
#endif

namespace {

class FailuresOfARank : public testing::EmptyTestEventListener {
 public:
  explicit FailuresOfARank(int rank) : rank_(rank) {}

 private:
  void OnTestStart(const testing::TestInfo& test) override { test_ = std::string(test.test_suite_name()) + "." + test.name(); }
  void OnTestPartResult(const testing::TestPartResult& part) override {
    if (!part.failed()) return;
    std::printf("rank %d: %s, %s:%d: Failure\n%s\n", rank_, test_.c_str(), part.file_name(), part.line_number(), part.message());
    std::fflush(stdout);
  }

  std::string test_;
  int rank_;
};

}  // namespace

int main(int argc, char** argv) {
  SANITIZED(__lsan_disable());
  MPI_Init(&argc, &argv);
  SANITIZED(__lsan_enable());
  testing::InitGoogleTest(&argc, argv);
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  if (rank != 0) {
    testing::TestEventListeners& listeners = testing::UnitTest::GetInstance()->listeners();
    delete listeners.Release(listeners.default_result_printer());
    listeners.Append(new FailuresOfARank(rank));
  }
  int failed = RUN_ALL_TESTS(), anywhere = 0;
  MPI_Allreduce(&failed, &anywhere, 1, MPI_INT, MPI_MAX, MPI_COMM_WORLD);
  SANITIZED(__lsan_do_leak_check());
  MPI_Finalize();
  return anywhere;
}
