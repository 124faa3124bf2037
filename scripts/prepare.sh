#!/usr/bin/env bash
# Makes build/ ready: installs what Debian 12 lacks (root, or a user with sudo), configures, builds.
#   scripts/prepare.sh [TARGET...]      default: everything
#   scripts/prepare.sh --configure      builds nothing
# What it ran quietly is in build/prepare.log. SOLIDCULL_JOBS sets the number of compilers at once. Other scripts set
# SOLIDCULL_BUILD (another folder), SOLIDCULL_CMAKE (options of cmake), SOLIDCULL_PACKAGES (more of Debian's) and
# SOLIDCULL_ENGINE=OFF (the core alone, without LIGGGHTS and MPI).
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
build=${SOLIDCULL_BUILD:-$root/build}
log=$build/prepare.log
packages=(cmake make g++ libopenvdb-dev libtbb-dev libboost-dev libeigen3-dev libgtest-dev zlib1g-dev ${SOLIDCULL_PACKAGES:-})
if [ "${SOLIDCULL_ENGINE:=ON}" = ON ]; then
  packages+=(liggghts libliggghts-dev libopenmpi-dev openmpi-bin python3 python3-numpy python3-matplotlib)
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

[ "${1:-}" = --configure ] || echo "prepare: building (${*:-everything})"
cmake -S "$root" -B "$build" -DCMAKE_BUILD_TYPE=Release "-DSOLIDCULL_ENGINE=$SOLIDCULL_ENGINE" ${SOLIDCULL_CMAKE:-} >>"$log" 2>&1 ||
  fail "cmake could not configure; see above and $log"
[ "${1:-}" != --configure ] || exit 0
cmake --build "$build" -j "${SOLIDCULL_JOBS:-$jobs}" ${*:+--target "$@"} >>"$log" 2>&1 || fail "the build failed; see above and $log"
