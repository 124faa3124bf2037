#!/usr/bin/python3
"""A wave through a chain of granules that stands on a floor, with and without the line: what goes through a part that is asleep, and
what it throws back.

    validation/chain/chain.py [--speeds V ...] [--dt S ...] [--few-steps]

Exit status: 0 all were run, 1 the chain at rest or the wave without the line is not as in closed form, 2 a run failed.
"""
import argparse
import json
import math
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))
from solidcull_runs import decks, engine, errors, meshes  # noqa: E402

OUT = HERE / "out"
GRANULES, FEW = 100, 20
SPEEDS, STEPS = (0.005, 0.01, 0.02, 0.05, 0.1, 0.3, 1), (2e-5, 5e-6)  # m/s; s
FEW_SPEEDS, FEW_STEPS = (0.003, 0.3), (2e-5,)
DIAMETER, DENSITY, YOUNG, POISSON, GRAVITY = 0.002, 2500, 5e6, 0.3, 9.81
REST = 0.02           # s, before the strike
ECHO = 1.9            # times the way down: what the floor throws back is not at the top yet
LOAD_MARGIN = 1e-5    # of the floor's load at rest
ARRIVAL_MARGIN = 0.05  # of the time that a long wave takes: a front is some granules long
WEAK = 0.1            # of the chain's weight: a stronger wave runs faster


class Chain:
    """Spheres one above the other, each pressed as deep into the next as what is above it weighs: Hertz."""

    def __init__(self, granules):
        self.granules, radius = granules, DIAMETER / 2
        self.mass = DENSITY * math.pi * DIAMETER**3 / 6
        modulus = YOUNG / (2 * (1 - POISSON**2))

        def depth(force, of_radius):
            return (force / (4 / 3 * modulus * math.sqrt(of_radius)))**(2 / 3)
        loads = [(granules - k) * self.weight for k in range(granules)]  # the floor's first
        depths = [depth(loads[0], radius)] + [depth(load, radius / 2) for load in loads[1:]]
        self.places = np.cumsum([radius - depths[0]] + [DIAMETER - d for d in depths[1:]])
        # a long wave: stiffness is 3/2 of force over depth
        self.way_down = sum(math.sqrt(self.mass * d / (1.5 * load)) for d, load in zip(depths, loads))

    @property
    def weight(self):
        return self.mass * GRAVITY

    def write(self, data, floor):
        atoms = "".join(f"{k + 1} 1 {DIAMETER:.17g} {DENSITY} 0 0 {z:.17g}\n" for k, z in enumerate(self.places))
        data.write_text(f"chain\n\n{self.granules} atoms\n1 atom types\n\n-0.01 0.01 xlo xhi\n-0.01 0.01 ylo yhi\n"
                        f"-0.001 {self.places[-1] + 0.02:g} zlo zhi\n\nAtoms\n\n{atoms}")
        meshes.write_stl(floor, meshes.grid((-0.01, -0.01, 0), (0.02, 0, 0), (0, 0.02, 0), 1, 1))


def run(chain, kind, speed, dt, place):
    """What the floor and the top granule do: load at rest, largest rise of the load, when half of it is reached, and what comes back up."""
    base = f"{kind}-{speed:g}-{dt:g}"
    data, floor, rows, deck, log = (place / name for name in ("chain.data", "floor.stl", f"{base}.rows", f"{base}.in", f"{base}.log"))
    chain.write(data, floor)
    lines = decks.make_deck(decks.read_deck(HERE / "chain.in"), "cull", kind == "culled", None, place / base)
    deck.write_text("\n".join(line for line in lines if "twin_counts" not in line) + "\n")
    steps = round(ECHO * chain.way_down / dt)
    engine.run_liggghts(deck, HERE, log,
                        {"data": data, "floor": floor, "rows": rows, "granules": chain.granules, "dt": dt, "rest": round(REST / dt), "steps": steps,
                         "speed": repr(speed), "culling": "exterior sleep"})
    step, load, top = np.loadtxt(rows)[1:].T  # the row before the first step counts the mesh's load twice
    load = np.abs(load) / chain.weight
    rest, rise = load[0], load.max() - load[0]
    half = int(np.argmax(load - rest > rise / 2))
    return {"rest": rest, "rise": rise, "arrival": (step[half] - step[0]) * dt, "back": max(0.0, top.max()) / speed}


def main(argv=None):
    p = argparse.ArgumentParser(prog="chain.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--speeds", type=float, nargs="+", default=SPEEDS, help="of the struck granule (m/s)")
    p.add_argument("--dt", type=float, nargs="+", default=STEPS, help="time steps (s)")
    p.add_argument("--few-steps", action="store_true", help="a short chain, two speeds and one time step")
    settings = p.parse_args(argv)
    if min(*settings.speeds, *settings.dt) <= 0:
        p.error("speeds and time steps are more than 0")
    chain = Chain(FEW if settings.few_steps else GRANULES)
    speeds, steps = (FEW_SPEEDS, FEW_STEPS) if settings.few_steps else (settings.speeds, settings.dt)
    place = OUT / "few" if settings.few_steps else OUT
    place.mkdir(parents=True, exist_ok=True)
    found, wrong = [], []
    print(f"{chain.granules} granules; a long wave takes {1e3 * chain.way_down:.2f} ms to the floor. Loads are in weights of a granule.\n")
    print(f"{'dt (s)':>8} {'strike (m/s)':>12} {'rise, without':>14} {'with':>8} {'share':>6} {'half of it after (ms)':>22} {'with':>6} {'back up, without':>17} {'with':>7}")
    for dt in steps:
        for speed in speeds:
            a, b = (run(chain, kind, speed, dt, place) for kind in ("unculled", "culled"))
            found.append({"dt": dt, "speed": speed, "unculled": a, "culled": b})
            print(f"{dt:>8g} {speed:>12g} {a['rise']:>14.2f} {b['rise']:>8.2f} {b['rise'] / a['rise']:>6.2f} {1e3 * a['arrival']:>22.2f} {1e3 * b['arrival']:>6.2f} "
                  f"{100 * a['back']:>15.1f} % {100 * b['back']:>5.1f} %", flush=True)
            for kind, of in (("without the line", a), ("with it", b)):
                if abs(of["rest"] / chain.granules - 1) > LOAD_MARGIN:
                    wrong.append(f"{kind} the floor bears {of['rest']:.6f} weights of {chain.granules} at rest")
            if a["rise"] < WEAK * chain.granules and abs(a["arrival"] / chain.way_down - 1) > ARRIVAL_MARGIN:
                wrong.append(f"at {speed:g} m/s the wave takes {1e3 * a['arrival']:.3g} ms")
    (place / "chain.json").write_text(json.dumps({"granules": chain.granules, "way_down": chain.way_down, "runs": found}, indent=1) + "\n")
    for line in wrong:
        print(f"NOT AS IN CLOSED FORM: {line}")
    return 1 if wrong else 0


if __name__ == "__main__":
    errors.command("chain", main)
