#!/usr/bin/python3
"""Blocks that slide and drop, culled and unculled.

    validation/motion/motion.py [--few-steps] [scene ...]

Runs each scene's deck three times unculled (1e-5 d apart: the noise floor) and three times culled, prints a table per scene and leaves all figures in out/SCENE.json. A culled figure is good within the larger
of 2 % and the noise floor of the unculled mean; what has another bar says so. `--few-steps`: every deck for a few steps, without
bars; what can be checked then is (solidcull_runs/few_steps.py). Exit: 0 all good, 1 a bar missed, 2 no result.
"""
import argparse
import json
import math
import sys
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))
from solidcull_runs import errors, few_steps, tables, twins  # noqa: E402
from solidcull_runs.comparisons import check  # noqa: E402

OUT = HERE / "out"  # out/few with --few-steps
GRAVITY = 9.81      # m/s^2
DIAMETER = 0.005    # m: mean
TIME_STEP = 5e-5    # s
BLOCK = 8 * 8 * 4   # granules of the block that slides or drops

few = False         # set by --few-steps


def shortened(**variables):
    """Variables of a deck for --few-steps, nothing otherwise."""
    return variables if few else {}


# --- figures of a run -----------------------------------------------------------------------------------------------

def with_stored(run, column, stored):
    """Steps and values of a column that sums over atoms, plus the fix's sum over the stored granules."""
    steps, values = run.series(column)
    return steps, values + (run.series(stored)[1] if run.counts else 0)


def centre(run, column, stored):
    """Steps and a coordinate of the centre of mass of all granules (m)."""
    steps, x = run.series(column)
    if not run.counts:
        return steps, x
    mass, stored_mass = run.series("v_mass")[1], run.series("f_cull[5]")[1]
    return steps, (mass * x + stored_mass * run.series(stored)[1]) / (mass + stored_mass)


# --- runs and bars --------------------------------------------------------------------------------------------------

def compare(part, deck, figures, variables, granules, steps_if_few, least_margins=None):
    """The comparison of one deck; `figures(run)` gives its metrics. `granules`: that the deck holds; `steps_if_few`: after the fix line.
    `least_margins`: by metric, where 2 % of the mean says nothing (a mean near zero)."""
    n = 1 if few else 3
    result, done = twins.compare(HERE / deck, out=OUT / part, unculled=n, culled=n, variables=variables, extra=figures, granules=granules,
                                 least_margins=least_margins,
                                 say=lambda line: print(f"  {part}: {line}", flush=True))
    if few:
        few_steps.check(done, granules, steps_if_few, where=f"{part}, ")
    result["good"] = result["good"] and result["ledger"] is not None
    return result, done


def culled_run(part, deck, variables, granules, steps_if_few, k=0):
    """One culled run alone, for what is held against a formula."""
    run, = twins.run_jobs([twins.Job(HERE / deck, OUT / part, "culled", k, variables)])
    if few:
        few_steps.check({"unculled": [run], "culled": [run]}, granules, steps_if_few, where=f"{part}, ")
    if run.final is None or len(run.final) != granules:
        raise errors.RunError(f"{part}: {run.name} did not end with {granules} granules")
    return run


def report(scene, parts, checks, notes=()):
    """Prints the scene's tables, writes its JSON; whether all is good."""
    good = all(p["good"] for p in parts.values()) and all(c["good"] for c in checks)
    tables.print_scene(parts, checks, notes)
    (OUT / f"{scene}.json").write_text(json.dumps({"good": good, "parts": parts, "checks": checks, "notes": list(notes)}, indent=1) + "\n")
    return good


# --- scenes ---------------------------------------------------------------------------------------------------------

FRICTION = 0.4


def slide():
    """A block that is one body, on a plane: the formula is g (sin a - mu cos a)."""
    checks = []
    for angle in (30, 15):
        runs = [culled_run(f"slide-{angle}", "slide.in", {"angle": angle, "mu": FRICTION, **shortened(push=50, steps=200)}, BLOCK, 450, k)
                for k in range(1 if few else 3)]
        due = max(0.0, GRAVITY * (math.sin(math.radians(angle)) - FRICTION * math.cos(math.radians(angle))))
        for run in runs:
            steps, momentum = with_stored(run, "v_px", "f_cull[13]")
            mass = run.final["mass"].sum()
            x = centre(run, "v_x", "f_cull[20]")[1]
            late = steps > steps[0] + (steps[-1] - steps[0]) * (1 / 2 if due else 2 / 3)  # at 15 degrees it stops shortly after half time
            acceleration = np.polyfit(steps[late] * TIME_STEP, momentum[late] / mass, 1)[0]
            name = f"slide {angle} deg, {run.name}"
            if due:
                checks.append(check(f"{name}: acceleration {acceleration:.5g} m/s^2, error of {due:.5g}", abs(acceleration / due - 1), 0.01))
            else:
                checks.append(check(f"{name}: slid in the last third (d)", abs(x[late][-1] - x[late][0]) / DIAMETER, 0.01))
                checks.append(check(f"{name}: speed at the end (m/s)", abs(momentum[-1] / mass), 1e-3))
            checks.append(check(f"{name}: exterior granules, most in that time", run.series("f_cull[1]")[1][late].max(), 0))
    return report("slide", {}, checks)


def gyration(granules):
    """Radius of gyration (m) of equal granules: grows when a block falls apart."""
    return float(math.sqrt(sum(granules[c].var() for c in "xyz")))


def drop():
    """A block that sticks together drops flat and on an edge, and jumps off."""
    parts = {}
    for turn, name in ((0, "flat"), (45, "edge")):
        def figures(run):
            return {"rebound (m/s)": float(run.series("v_vz")[1][-1]), "spin (rad/s)": float(run.series("v_wy")[1][-1]),
                    "radius of gyration, end (m)": gyration(run.final)}
        part = f"drop-{name}"
        # flat: no spin is due; 2 % of the falling speed over the block's half length
        slack = 0.02 * math.sqrt(2 * GRAVITY * 2 * DIAMETER) / (4 * DIAMETER)
        parts[part], _ = compare(part, "drop.in", figures, {"turn": turn, **shortened(before=400, steps=400)}, BLOCK, 800,
                                 {} if turn else {"spin (rad/s)": slack})
    return report("drop", parts, [])


SCENES = {f.__name__: f for f in (slide, drop)}


def main(argv=None):
    global few, OUT
    p = argparse.ArgumentParser(prog="motion.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("scene", nargs="*", choices=[*SCENES, []], help="default: all")
    p.add_argument("--few-steps", action="store_true")
    a = p.parse_args(argv)
    few = a.few_steps
    OUT = OUT / "few" if few else OUT
    OUT.mkdir(parents=True, exist_ok=True)
    good = True
    for name in a.scene or SCENES:
        began = time.monotonic()
        print(f"=== {name}: {SCENES[name].__doc__}", flush=True)
        good = bool(SCENES[name]()) and good
        print(f"=== {name}: {time.monotonic() - began:.0f} s\n", flush=True)
    return 0 if good or few else 1


if __name__ == "__main__":
    errors.command("motion", main)
