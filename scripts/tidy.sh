#!/usr/bin/env bash
# Runs clang-tidy with the checks of .clang-tidy; any finding is an error. It installs clang-tidy where that is missing.
#   scripts/tidy.sh [FILE...]      default: every source file of the project
#   scripts/tidy.sh --changed [COMMIT]   those that differ from COMMIT, default: from main, where this branch left it
# Exit 77: --changed without git's history.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
[ $# -eq 0 ] || [ "$1" = --changed ] || mapfile -t files < <(realpath -- "$@")
cd "$root"

folders="fix_solid_cull region_interface_mesh tests/unit tests/decks benchmarks"
if [ "${1:-}" = --changed ]; then
  if ! base=$(git merge-base HEAD "${2:-origin/main}" 2>/dev/null || git merge-base HEAD "${2:-main}" 2>/dev/null); then
    echo "tidy: no git history here that has ${2:-a main}: what has changed is not known" >&2
    exit 77
  fi
  differ=$(git diff --name-only --diff-filter=d "$base" -- $folders)
  # a header is read with its .cpp, or with one beside it that includes it: alone it would have the flags of any file
  mapfile -t files < <(sed -nE '/\.(cpp|h)$/p' <<<"$differ" | while read -r f; do
    if [[ $f != *.h ]]; then echo "$f"
    elif [ -e "${f%.h}.cpp" ]; then echo "${f%.h}.cpp"
    else { grep -lF "\"$(basename "$f")\"" "$(dirname "$f")"/*.cpp || echo "$f"; } 2>/dev/null | sed -n 1p
    fi
  done | sort -u)
  [ ${#files[@]} -gt 0 ] || { echo "tidy: nothing has changed since $(git describe --always "$base")"; exit 0; }
elif [ $# -eq 0 ]; then
  mapfile -t files < <(find $folders -name '*.cpp' | sort)
fi

SOLIDCULL_PACKAGES="clang-tidy libbenchmark-dev" SOLIDCULL_BUILD=$root/build-tidy SOLIDCULL_CMAKE="-DSOLIDCULL_BENCHMARKS=ON -DCMAKE_UNITY_BUILD=OFF" \
  scripts/prepare.sh --configure
# a header that none beside it includes has the flags of a file beside it
printf '%s\0' "${files[@]}" | xargs -0 -n 1 -P "${SOLIDCULL_JOBS:-$(nproc)}" clang-tidy -p build-tidy --quiet
echo "tidy: ${#files[@]} files, nothing found"
