#!/usr/bin/env bash
# Sets everything up and runs all tests; arguments go to ctest: tests/run.sh -R twin
# tests/sanitize.sh runs unit and deck tests with sanitizers, tests/core.sh the core's tests without an engine.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
"$root/scripts/prepare.sh"
. "$root/scripts/mpi-env.sh"
cd "$root/build"
exec ctest --output-on-failure -j 2 "$@"
