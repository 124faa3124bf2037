#!/usr/bin/python3
"""How much of the unculled discharge moves: what bounds the speed-up of an engine that simulates only that.

    examples/plate_discharge/moving.py [FILE]        default: out/unculled-1.places, which example.py leaves

A granule has moved from one snapshot to the next if no granule is within d/200 of its place (x, y) any more; places that others
take by chance are counted at shifted places and taken off. Prints the share for each half second, the mean and its inverse.
"""
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))
from solidcull_runs import errors  # noqa: E402
from solidcull_runs.dumps import snapshots  # noqa: E402

DIAMETER = 0.01  # m


def still(then, now, shift=0.0):
    """Share of the places of `then` that are taken in `now`, to a cell of d/200 and its neighbours."""
    cells = {(int(x), int(y)) for x, y in np.floor((now + [shift, 0]) / (DIAMETER / 200))}
    places = np.floor(then / (DIAMETER / 200)).astype(int)
    return np.mean([any((x + i, y + j) in cells for i in (-1, 0, 1) for j in (-1, 0, 1)) for x, y in places])


def main():
    file = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "out" / "unculled-1.places"
    if not file.is_file():
        raise errors.RunError(f"{file} is not there: run example.py first")
    frames, shares = [(step, rows[:, :2]) for step, _, rows in snapshots(file)], []
    if len(frames) < 2:
        raise errors.RunError(f"{file} holds one snapshot: nothing can have moved")
    for (step, then), (after, now) in zip(frames, frames[1:]):
        chance = still(then, now, 0.3 * DIAMETER)
        shares.append(1 - (still(then, now) - chance) / (1 - chance))
        print(f"steps {step:6d} to {after:6d}: {shares[-1]:.3f} move")
    print(f"mean {np.mean(shares):.3f}: N / N_moving = {1 / np.mean(shares):.2f}")


if __name__ == "__main__":
    errors.command("moving", main)
