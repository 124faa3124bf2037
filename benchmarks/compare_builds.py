#!/usr/bin/python3
"""What a change costs: two builds run the same decks in turns, on one core.

    benchmarks/compare_builds.py --before OLD/liggghts-solidcull --after NEW/liggghts-solidcull [--pairs 5] [CASE ...]

Cases: impact-live, impact-sleep, gas, 160k-sleep; all of them, if none is named. Beds that are missing are made first, in
benchmarks/out/ (six minutes). For each pair of runs it prints user seconds, and after : before of user seconds, instructions and
cycles in user mode. Instructions are counted by the processor, where the machine lets it, and hardly vary between two runs of one
build: they tell what seconds on a busy machine cannot. Exit: 0 all runs ended well, 2 one did not.
"""
import argparse
import ctypes
import os
import statistics
import struct
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
OUT = Path(__file__).resolve().parent / "out"
sys.path[:0] = [str(ROOT), str(ROOT / "validation" / "scale")]
import numpy as np  # noqa: E402
import scale  # noqa: E402
from solidcull_runs import beds, errors  # noqa: E402

IMPACT, ACTIVITY, SCALE = ROOT / "examples" / "impact", ROOT / "validation" / "activity", ROOT / "validation" / "scale"
INSTRUCTIONS, CYCLES = 1, 0         # PERF_COUNT_HW_...
PERF_EVENT_OPEN = {"x86_64": 298, "aarch64": 241}.get(os.uname().machine)
QUANTITIES = ("instructions", "cycles", "user s")


# --- cases: a deck, where it runs, its variables -----------------------------------------------------------------------

def impact(keywords):
    def case():
        bed = beds.settled(OUT / "bed-20k.restart", IMPACT / "settle.in", [IMPACT / "bed.in"], {})
        deck = OUT / f"impact-{keywords.split()[-1]}.in"
        deck.write_text((IMPACT / "impact.in").read_text().replace("fix cull all solid/cull\n", f"fix cull all solid/cull {keywords}\n"))
        return deck, IMPACT, {"restart": bed, "folder": OUT, "steps": 3000}
    return case


def gas():
    return ACTIVITY / "gas.in", ACTIVITY, {"steps": 9000}


def large():
    scale.OUT, scale.BEDS = OUT, {"160k": ((4, 2), None, 2500, 6, 250)}
    bed = scale.bed("160k")
    rests, (length, width) = np.load(bed["granules"]), bed["sides"]
    return SCALE / "impact.in", SCALE, {
        "granules": 160000, "L": length, "W": width, "steps": 1200, "every": 1200, "elements": OUT / "elements-*.vtk",
        "z": f"{scale.first_touch(rests, length / 2, width / 2) + scale.FALL:.12g}", "top": f"{rests['z'].max():.12g}",
        "restart": bed["restart"], "floormesh": bed["floor"]}


CASES = {"impact-live": impact("exterior live"), "impact-sleep": impact("exterior sleep"), "gas": gas, "160k-sleep": large}


# --- runs ----------------------------------------------------------------------------------------------------------------

def counter(event):
    """Counts an event in user mode, in the program that this process starts next; None where the machine does not let it."""
    if PERF_EVENT_OPEN is None:
        return None
    disabled, inherit, exclude_kernel, exclude_hv, enable_on_exec = 1 << 0, 1 << 1, 1 << 5, 1 << 6, 1 << 12
    attributes = struct.pack("IIQQQQQ", 0, 112, event, 0, 0, 0, disabled | inherit | exclude_kernel | exclude_hv | enable_on_exec)
    descriptor = ctypes.CDLL(None).syscall(PERF_EVENT_OPEN, attributes.ljust(112, b"\0"), 0, -1, -1, 0)
    return descriptor if descriptor >= 0 else None


def one_run(launcher, deck, folder, variables):
    """Instructions, cycles (None where they cannot be counted), user seconds."""
    log = OUT / "run.log"
    words = [str(launcher), "-in", str(deck), "-log", str(log), "-screen", str(OUT / "run.screen")]
    for name, value in variables.items():
        words += ["-var", name, str(value)]
    counters = [counter(INSTRUCTIONS), counter(CYCLES)]
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    core = {min(os.sched_getaffinity(0))}
    process = subprocess.Popen(words, cwd=folder, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                               preexec_fn=lambda: os.sched_setaffinity(0, core))
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    counts = []
    for c in counters:
        counts.append(struct.unpack("Q", os.read(c, 8))[0] if c is not None else None)
        if c is not None:
            os.close(c)
    if process.returncode:
        raise errors.RunError(f"{launcher} ended with {process.returncode}: see {log}")
    return (*counts, used.ru_utime)


def ratio(after, before):
    return after / before if after and before else float("nan")


def compare(name, launchers, pairs):
    deck, folder, variables = CASES[name]()
    runs = {"before": [], "after": []}
    for k in range(pairs):
        for which in ("before", "after") if k % 2 == 0 else ("after", "before"):
            runs[which].append(one_run(launchers[which], deck, folder, variables))
        b, a = runs["before"][-1], runs["after"][-1]
        print(f"{name} {k + 1}: user {b[2]:.2f} s and {a[2]:.2f} s; "
              + ", ".join(f"{q} {ratio(a[n], b[n]):.4f}" for n, q in enumerate(QUANTITIES)), flush=True)
    told = []
    for n, quantity in enumerate(QUANTITIES):
        medians = [statistics.median(r[n] for r in runs[w]) if runs[w][0][n] is not None else None for w in ("after", "before")]
        told.append(f"{quantity} {ratio(*medians):.4f}")
    print(f"{name}: medians, after : before: {', '.join(told)}", flush=True)


def main():
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--before", type=Path, required=True)
    asked.add_argument("--after", type=Path, required=True)
    asked.add_argument("--pairs", type=int, default=5)
    asked.add_argument("cases", nargs="*", metavar="CASE")
    a = asked.parse_args()
    unknown = [c for c in a.cases if c not in CASES]
    if unknown or a.pairs < 1:
        asked.error(f"no case {unknown[0]}; there are {', '.join(CASES)}" if unknown else f"--pairs {a.pairs}: one at least")
    launchers = {"before": a.before.resolve(), "after": a.after.resolve()}
    for launcher in launchers.values():
        if not os.access(launcher, os.X_OK):
            asked.error(f"{launcher} is no program: build it, or name another")
    OUT.mkdir(exist_ok=True)
    try:
        for name in a.cases or CASES:
            compare(name, launchers, a.pairs)
    except errors.RunError as e:
        print(f"compare_builds: {e}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
