#!/usr/bin/env bash
# Builds the culling core without any engine in build-core/ and runs its unit tests: what they need is neither LIGGGHTS nor MPI.
# Arguments go to ctest.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
SOLIDCULL_BUILD=$root/build-core SOLIDCULL_ENGINE=OFF "$root/scripts/prepare.sh"
cd "$root/build-core"
exec ctest --output-on-failure -j 2 "$@"
