// Ranks that wait take naps, longer and longer up to 2 ms: many of them on few cores leave these to the ones that work. Preloaded
// by grids.sh; Open MPI waits by sched_yield() where it is told to (mpi_yield_when_idle).
#include <sys/prctl.h>
#include <time.h>

#include <algorithm>

namespace {

constexpr long shortest = 10'000, longest = 2'000'000, still_waiting = 20'000;  // ns

long now() {
  timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return t.tv_sec * 1'000'000'000L + t.tv_nsec;
}

thread_local long nap = 0, woke = 0;

}  // namespace

extern "C" int sched_yield() noexcept {
  if (nap == 0) prctl(PR_SET_TIMERSLACK, 1000UL, 0, 0, 0);
  nap = now() - woke > still_waiting ? shortest : std::min(nap + nap / 2, longest);
  const timespec how_long = {0, nap};
  nanosleep(&how_long, nullptr);
  woke = now();
  return 0;
}
