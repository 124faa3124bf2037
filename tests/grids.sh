#!/usr/bin/env bash
# The deck tests on grids of ranks that CTest does not run, with the invariants checked at each reneighbouring: hours on few cores.
#   tests/grids.sh ["2 2 2" "8 1 1" ...]     with SUITES="Scenes.* Refill*" those alone
# What each printed stays in build/tests/decks/grids. Exit status 1 if a test fails, or a suite does not end within LIMIT seconds.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
"$root/scripts/prepare.sh" deck_tests naps
. "$root/scripts/mpi-env.sh"
build=$root/build/tests/decks
export SOLIDCULL_CHECK=1 SOLIDCULL_KEEP_BEDS=1 OMPI_MCA_mpi_yield_when_idle=1
[ $# -gt 0 ] || set -- "3 1 1" "8 1 1" "1 8 1" "1 1 8" "2 2 2" "4 2 1"
mkdir -p "$build/grids"
cd "$build/grids"
# beds are poured once for all grids; another program may pour others
[ poured -nt ../deck_tests ] || { rm -f ./*.restart; touch poured; }
status=0
# one suite after the other: a rank that fails alone leaves the others waiting
suites=${SUITES:-$(../deck_tests --gtest_list_tests | sed -n 's/^\([^ ]*\.\)$/\1*/p')}
for grid; do
  ranks=$((${grid// / * }))
  for suite in $suites; do
    said=${grid// /x}_$(tr -c 'A-Za-z0-9\n' _ <<<"$suite")
    SECONDS=0
    code=0
    SOLIDCULL_GRID=$grid timeout "${LIMIT:-1200}" mpirun -np "$ranks" -x LD_PRELOAD="$build/libnaps.so" ../deck_tests \
      --gtest_filter="$suite" --gtest_color=no >"$said" 2>&1 || code=$?
    # the engine's own lines may stand before, on the same line
    failed=$(grep -ao '\[  FAILED  \].* ms)' "$said" | sort -u || true)
    echo "$grid  $suite  $(grep -ac '\[       OK \]' "$said" || true) passed, $(grep -c . <<<"$failed" || true) failed, $SECONDS s"
    [ -z "$failed" ] || echo "$failed"
    if [ $code -eq 124 ]; then
      echo "    no end in ${LIMIT:-1200} s: $(grep -ao '\[ RUN .*' "$said" | tail -1)"
    elif [ $code -gt 1 ]; then
      echo "    status $code: $(grep -a ERROR deck_tests.screen "$said" | tail -1)"
    fi
    [ $code -eq 0 ] || status=1
  done
done
exit $status
