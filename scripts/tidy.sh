#!/usr/bin/env bash
# Runs clang-tidy with the checks of .clang-tidy; any finding is an error. It installs clang-tidy where that is missing.
#   scripts/tidy.sh [FILE...]      default: every source file of the project
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
SOLIDCULL_PACKAGES="clang-tidy libbenchmark-dev" SOLIDCULL_BUILD=$root/build-tidy SOLIDCULL_CMAKE=-DSOLIDCULL_BENCHMARKS=ON \
  "$root/scripts/prepare.sh" --configure
if [ $# -eq 0 ]; then
  mapfile -t files < <(cd "$root" && find fix_solid_cull region_interface_mesh tests benchmarks -name '*.cpp' | sort)
  set -- "${files[@]/#/$root/}"
fi
# headers are read with the files that include them
printf '%s\0' "$@" | xargs -0 -n 1 -P "${SOLIDCULL_JOBS:-$(nproc)}" clang-tidy -p "$root/build-tidy" --quiet
echo "tidy: $# files, nothing found"
