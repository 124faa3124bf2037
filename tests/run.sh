#!/usr/bin/env bash
# Sets everything up and runs all tests, then those of parts and decks again with sanitizers.
# Arguments go to ctest, and nothing runs again: tests/run.sh -R twin
# tests/sanitize.sh is the second half alone; tests/core.sh runs the core's tests without an engine.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
# for what is not run but read: the package, the style, the comments
SOLIDCULL_PACKAGES="dpkg-dev file clang-format doxygen" "$root/scripts/prepare.sh"
. "$root/scripts/mpi-env.sh"
cd "$root/build"
ctest --output-on-failure -j 2 "$@"
[ $# -gt 0 ] || "$root/tests/sanitize.sh"
