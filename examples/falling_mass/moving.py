"""The bound on any culling here: how many granules move in each frame of the unculled drop. Prints a row a frame, N / N_moving,
and the speed-up of a fix that costs nothing in an engine whose frame takes N_moving / N of the unculled frame's own time: frames
in which much moves take longer, for their lists are built more often.

    examples/falling_mass/moving.py [--frames N]

A granule moves when it is faster than a share of sqrt(g d), 0.01 or 0.001. In the air, where the mass falls as one, none counts.
Counts are means over a frame. About two minutes; needs out/bed.restart, which example.py makes.
"""
import argparse
import re
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))
from solidcull_runs import engine, errors, logs  # noqa: E402

OUT = HERE / "out"
GRANULES, DIAMETER, GRAVITY = 15600, 0.02, 9.81
SHARES = (0.01, 0.001)  # of sqrt(g d)
EVERY, PER_FRAME = 20, 400  # steps: between counts, of a frame


def deck(file="out/moving.txt"):
    """fall.in without its fix; the granules that are faster than each share are counted in `file`, beside the load on the floor."""
    lines = []
    for line in (HERE / "fall.in").read_text().splitlines():
        if line.startswith("fix cull"):
            for k, share in enumerate(SHARES):
                limit = share * (GRAVITY * DIAMETER)**0.5
                lines += [f"variable fast{k} atom (vx*vx+vy*vy+vz*vz)>{limit**2:.9g}", f"compute moving{k} all reduce sum v_fast{k}"]
            columns = " ".join(f"c_moving{k}" for k in range(len(SHARES)))
            lines.append(f"fix moving all ave/time {EVERY} 1 {EVERY} {columns} v_load file {file}")
        elif line.startswith("unfix cull"):
            break
        else:
            lines.append(re.sub(r" f_cull\[\d+\]", "", line))
    return "\n".join(lines) + "\n"


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--frames", type=int, default=63)
    settings = p.parse_args()
    if settings.frames < 1:
        p.error("--frames is at least 1")
    if not (OUT / "bed.restart").exists():
        raise errors.RunError("there is no out/bed.restart: run example.py first, it makes the oval")
    (OUT / "moving.in").write_text(deck())
    text = engine.run_liggghts(OUT / "moving.in", HERE, OUT / "moving.log", {"frames": settings.frames})
    table = np.loadtxt(OUT / "moving.txt", ndmin=2)
    counts, load = table[:, 1:-1], table[:, -1]
    counts[load == 0] = 0  # in the air
    frame = np.ceil(table[:, 0] / PER_FRAME).astype(int) - 1
    moving = np.array([counts[frame == k].mean(axis=0) for k in range(settings.frames)])
    printed = max((t for t in logs.parse_log(text) if "CPU" in t.columns), key=lambda t: len(t.rows))
    seconds = np.diff([row[printed.columns.index("CPU")] for row in printed.rows])
    print("frame  seconds" + "".join(f"  faster than {s:g} sqrt(g d)" for s in SHARES))
    for k, row in enumerate(moving):
        print(f"{k + 1:5d}{seconds[k]:9.2f}" + "".join(f"{n:27,.0f}" for n in row))
    for k, share in enumerate(SHARES):
        if not moving[:, k].any():
            print(f"{share:g} sqrt(g d): none moves")
            continue
        print(f"{share:g} sqrt(g d): N / N_moving {GRANULES / moving[:, k].mean():.2f}, "
              f"speed-up bounded by {seconds.sum() / (seconds * moving[:, k] / GRANULES).sum():.2f}")


if __name__ == "__main__":
    errors.command("moving", main)
