#!/usr/bin/python3
"""What it costs that between runs a deck sees the whole bed: a hundred `run 100` with a `set` between them, 20,000 granules asleep.

    benchmarks/set_between_runs.py        needs a build in build/, LIGGGHTS and perf

Prints instructions in user mode, which are the same in each run to 0.1 %; those of the same deck up to there are taken off.
"""
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
from solidcull_runs import engine, errors  # noqa: E402
from solidcull_runs.beds import settled  # noqa: E402
from solidcull_runs.errors import RunError  # noqa: E402

IMPACT = ROOT / "examples" / "impact"
ASLEEP = """\
atom_style granular
atom_modify map array
boundary f f f
newton off
communicate single vel yes
units si
variable L index 0.075
read_restart {bed}
neighbor 0.0004 bin
neigh_modify delay 0
include bed.in
run 0
group bed id > 0
create_atoms 1 single 0.03 0.03 0.15 units box   # hangs there: no integrator moves it
group lone subtract all bed
set group lone diameter 0.0026 density 2500
fix integrate bed nve/sphere
{cull}thermo 1000
run 1000
"""
CULL = "fix cull all solid/cull exterior sleep\n"
LOOP = "variable k loop 100\nlabel again\n{}\nnext k\njump SELF again\n"
MEASURED = (("one run of 10,000 steps", CULL, "run 10000\n"),
            ("a hundred of 100", CULL, LOOP.format("run 100")),
            ("a hundred of 100, `set` on a granule that is not culled between", CULL, LOOP.format("set group lone type 1\nrun 100")),
            ("the same with `set` on all granules", CULL, LOOP.format("set group all type 1\nrun 100")),
            ("a hundred `set` on all granules and `run 0` in LIGGGHTS", "", LOOP.format("set group all type 1\nrun 0")),
            ("a hundred `set` on all granules in LIGGGHTS, no run", "", LOOP.format("set group all type 1")))


def instructions(text, folder):
    (folder / "deck.in").write_text(text)
    command = ["perf", "stat", "-x,", "-e", "instructions:u", "-o", str(folder / "count"), engine.find_launcher(), "-in", str(folder / "deck.in"),
               "-log", "none"]
    done = subprocess.run(command, cwd=IMPACT, env=engine.environment(), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True, errors="replace")
    if done.returncode:
        raise RunError(f"LIGGGHTS {engine.ending(done.returncode)}: {engine.error_in(done.stdout)}")
    return int((folder / "count").read_text().splitlines()[-1].split(",")[0])


def main():
    bed = settled(ROOT / "benchmarks" / "out" / "impact.restart", IMPACT / "settle.in", [IMPACT / "bed.in", IMPACT / "floor.stl"])
    with tempfile.TemporaryDirectory(prefix="solidcull-") as name:
        folder = Path(name)
        before = {cull: instructions(ASLEEP.format(bed=bed, cull=cull), folder) for cull in (CULL, "")}
        print(f"{before[CULL] / 1e9:8.2f} G  the deck up to there: reading, 1,000 steps, all asleep")
        for what, cull, then in MEASURED:
            print(f"{(instructions(ASLEEP.format(bed=bed, cull=cull) + then, folder) - before[cull]) / 1e9:8.2f} G  {what}", flush=True)
    return 0


if __name__ == "__main__":
    errors.command("set_between_runs", main)
