#!/usr/bin/env bash
# Builds the unit and deck tests in build-sanitize/ with the address, leak and undefined behaviour sanitizers and runs them;
# arguments go to ctest: tests/sanitize.sh -R motion. What a sanitizer finds ends its test.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
build=$root/build-sanitize
# no build type: assertions stay in
SOLIDCULL_BUILD=$build SOLIDCULL_CMAKE="-DCMAKE_BUILD_TYPE=None -DSOLIDCULL_SANITIZE=ON" \
  "$root/scripts/prepare.sh" core_tests culling_tests geometry_tests relocation_tests deck_tests
. "$root/scripts/mpi-env.sh"
export LSAN_OPTIONS=suppressions=$root/tests/lsan.supp:print_suppressions=0 UBSAN_OPTIONS=print_stacktrace=1
cd "$build"
# what tests/*.py run is the launcher, and the stock engine with the library preloaded: without sanitizers
exec ctest --output-on-failure -j 2 -E '^(python|style)\.' "$@"
