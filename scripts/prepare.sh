#!/usr/bin/env bash
# Makes build/ ready: installs what Debian 12 lacks (root, or a user with sudo), configures, builds.
#   scripts/prepare.sh [-DNAME=VALUE...] [TARGET...]      default: everything
#   scripts/prepare.sh [-DNAME=VALUE...] --configure      builds nothing
# Words that begin with -D go to cmake and are kept in build/: -DLIGGGHTS_LIBRARY=… names a LIGGGHTS of your own, see
# fix_solid_cull/own_liggghts.md, and Debian's is not installed then.
# What it ran quietly is in build/prepare.log. SOLIDCULL_JOBS sets the number of compilers at once. Other scripts set
# SOLIDCULL_BUILD (another folder), SOLIDCULL_CMAKE (options of cmake), SOLIDCULL_PACKAGES (more of Debian's) and
# SOLIDCULL_ENGINE=OFF (the core alone, without LIGGGHTS and MPI).
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
build=${SOLIDCULL_BUILD:-$root/build}
log=$build/prepare.log
cmake_words=(${SOLIDCULL_CMAKE:-})
targets=()
for word in "$@"; do
  if [[ $word == -D* ]]; then cmake_words+=("$word"); else targets+=("$word"); fi
done

# of those words, or of a build that was configured before
engine_library() {
  printf '%s\n' "${cmake_words[@]}" | sed -n 's/^-DLIGGGHTS_LIBRARY\(:[A-Z]*\)\{0,1\}=//p' | grep . | tail -n 1 ||
    sed -n 's/^LIGGGHTS_LIBRARY:[A-Z]*=//p' "$build/CMakeCache.txt" 2>/dev/null || true
}
packages=(cmake make g++ libopenvdb-dev libtbb-dev libboost-dev libeigen3-dev libgtest-dev zlib1g-dev ${SOLIDCULL_PACKAGES:-})
if [ "${SOLIDCULL_ENGINE:=ON}" = ON ]; then
  packages+=(python3 python3-numpy python3-scipy python3-matplotlib)
  case $(engine_library) in
    '' | *-NOTFOUND | /usr/lib/*/libliggghts.so) packages+=(liggghts libliggghts-dev libopenmpi-dev openmpi-bin) ;;
    *) command -v mpicxx >/dev/null || packages+=(libopenmpi-dev openmpi-bin) ;;
  esac
fi
gib_per_job=2  # a file that includes OpenVDB takes about 1.5

fail() { [ -s "$log" ] && tail -n 15 "$log" >&2; echo "prepare: $1" >&2; exit 1; }

mkdir -p "$build" || { echo "prepare: cannot write to $root; check its owner" >&2; exit 1; }
: >"$log"

if command -v dpkg-query >/dev/null; then
  missing=()
  for p in "${packages[@]}"; do
    dpkg-query -W -f='${Status}' "$p" 2>/dev/null | grep -q 'ok installed' || missing+=("$p")
  done
  if [ ${#missing[@]} -gt 0 ]; then
    sudo=
    if [ "$(id -u)" != 0 ]; then
      command -v sudo >/dev/null || fail "not root and no sudo: have root run 'apt-get install ${missing[*]}'"
      sudo=sudo
    fi
    echo "prepare: installing ${missing[*]}"
    apt=($sudo env DEBIAN_FRONTEND=noninteractive apt-get -q -o Acquire::Retries=3 -o DPkg::Lock::Timeout=300)
    "${apt[@]}" update >>"$log" 2>&1 || fail "'apt-get update' failed; check the network and /etc/apt/sources.list"
    "${apt[@]}" install -y --no-install-recommends "${missing[@]}" >>"$log" 2>&1 ||
      fail "'apt-get install ${missing[*]}' failed; this needs Debian 12 (bookworm) and its main section"
  fi
fi

cores=$(env -u OMP_NUM_THREADS nproc)  # nproc would take OMP_NUM_THREADS for the number of cores
free_gib=$(awk '/^MemAvailable/ {print int($2 / 1048576)}' /proc/meminfo)
jobs=$((free_gib / gib_per_job))
[ "$jobs" -gt "$cores" ] && jobs=$cores
[ "$jobs" -lt 1 ] && jobs=1

[ "${targets[0]:-}" = --configure ] || echo "prepare: building (${targets[*]:-everything})"
if ! cmake -S "$root" -B "$build" -DCMAKE_BUILD_TYPE=Release "-DSOLIDCULL_ENGINE=$SOLIDCULL_ENGINE" "${cmake_words[@]}" \
  >>"$log" 2>&1; then
  refusal=$(sed -n 's/^ *solidcull: //p' "$log" | tail -n 1)
  [ -z "$refusal" ] || { echo "prepare: $refusal" >&2; exit 1; }
  fail "cmake could not configure; see above and $log"
fi
[ "${targets[0]:-}" != --configure ] || exit 0
cmake --build "$build" -j "${SOLIDCULL_JOBS:-$jobs}" ${targets[*]:+--target "${targets[@]}"} >>"$log" 2>&1 ||
  fail "the build failed; see above and $log"
