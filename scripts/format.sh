#!/usr/bin/env bash
# Is every source file formatted as .clang-format says?
#   scripts/format.sh            names the places that are not, exit 1
#   scripts/format.sh --fix      formats them
# Exit 77: there is no clang-format 14, the one whose style this is.
set -euo pipefail
cd "$(dirname "$0")/.."
version=$(clang-format --version 2>/dev/null | sed -n 's/.*version \([0-9]*\)\..*/\1/p')
if [ "$version" != 14 ]; then
  echo "format: clang-format 14 is needed, and here is ${version:-none}: apt-get install clang-format on Debian 12" >&2
  exit 77
fi
mapfile -t files < <(find benchmarks fix_solid_cull region_interface_mesh tests validation \( -name '*.cpp' -o -name '*.h' \) -not -path '*/out/*' | sort)
if [ "${1:-}" = --fix ]; then
  clang-format -i "${files[@]}"
else
  clang-format --dry-run -Werror "${files[@]}" || { echo "format: run scripts/format.sh --fix" >&2; exit 1; }
fi
echo "format: ${#files[@]} files"
