#!/usr/bin/python3
"""Lays the culled restart file of a large bed of that of a smaller one: no granule of it is ever an atom.

    validation/scale/lay_culled.py SOURCE NX NY FILE MX MY --floors FLOOR NEW-FLOOR [--period P] [--margin M] [--top Z] [--shift DX]

SOURCE: restart file that doze.in wrote on one rank, of a bed of NX x NY tiles, three at least each way, or as many as FILE has.
FILE: the bed of MX x MY tiles. FLOOR, NEW-FLOOR: the floors' STL files, grids as scale.py writes them. The ball goes over the middle,
DX beside it, as far above the first granule that it will touch. How it works stands in solidcull_runs/laid/beds.py.
"""
import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from solidcull_runs import errors  # noqa: E402
from solidcull_runs.laid.beds import lay  # noqa: E402
from solidcull_runs.laid.floors import Floor  # noqa: E402
from solidcull_runs.laid.sources import Source  # noqa: E402


def main(argv=None):
    p = argparse.ArgumentParser(prog="lay_culled.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("source", type=Path)
    p.add_argument("from_copies", type=int, nargs=2, metavar="N")
    p.add_argument("file", type=Path)
    p.add_argument("copies", type=int, nargs=2, metavar="M")
    p.add_argument("--floors", nargs=2, required=True, metavar="STL")
    p.add_argument("--period", type=float, default=0.075, help="m: edge of a tile")
    p.add_argument("--margin", type=float, default=0.0014, help="m: from the tiles to the sides")
    p.add_argument("--top", type=float, default=0.12, help="m: height of the box")
    p.add_argument("--shift", type=float, default=0.0, help="m: the ball, along x")
    a = p.parse_args(argv)
    source = Source(a.source, tuple(a.from_copies), a.period, a.margin, Floor(a.floors[0]))
    n = lay(source, a.file, tuple(a.copies), Floor(a.floors[1]), a.top, a.shift)
    print(f"{a.file}: {n} granules")
    return 0


if __name__ == "__main__":
    errors.command("lay_culled", main)
