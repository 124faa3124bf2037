#!/usr/bin/python3
"""Beds and blocks that are tilted, shaken, let go, emptied, or that slide and drop, culled and unculled.

    validation/motion/motion.py [--few-steps] [scene ...]

Settles the beds once (out/*.restart), runs each scene's deck three times unculled (1e-5 d apart: the noise floor) and three
times culled, prints a table per scene and leaves all figures in out/SCENE.json. A culled figure is good within the larger
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
sys.path.insert(0, str(HERE.parent))
from solidcull_runs import beds, errors, few_steps, tables, twins  # noqa: E402
from solidcull_runs.dumps import read_final, snapshots  # noqa: E402
from solidcull_runs.metrics import check  # noqa: E402
from solidcull_runs.surfaces import centre_height, outside  # noqa: E402

OUT = HERE / "out"  # out/few with --few-steps
GRAVITY = 9.81      # m/s^2
DIAMETER = 0.005    # m: mean
TIME_STEP = 5e-5    # s
BOX, SILO = (0.09, 0.035), (0.12, 0.03)  # m: L and W of the decks
BLOCK = 8 * 8 * 4                        # granules of the block that slides or drops
FEW_KEYWORDS = "depth 0.25 voxel 0.125 every 20 calm 1 speed 0.1"  # so that a small bed locks granules within few steps

few = False         # set by --few-steps


# --- beds -----------------------------------------------------------------------------------------------------------

def shortened(**variables):
    """Variables of a deck for --few-steps, nothing otherwise."""
    return variables if few else {}


def settled(bed, deck="settle.in", after=None, **variables):
    """The restart file of a bed at rest. `after`: the bed that it starts from."""
    sources = [HERE / f for f in ("engine.in", "material.in", "sides.in", "box.in", "tray.in", "silo.in", "tray.stl", "shoulders.stl", "plug.stl")]
    file = OUT / f"{bed}.restart"
    if after:
        variables["restart"] = after
    return beds.settled(file, HERE / deck, sources, variables, writes="leaning" if after else "restart",
                        more=beds.recipe_of(HERE / after) if after else "").relative_to(HERE)


def start_dump(part):
    """Where a scene writes its granules before the fix line; relative to this folder, as its deck wants it."""
    return (OUT / f"{part}-start.dump").relative_to(HERE)


SHORT_POUR = {"granules": 150, "pour": 0.15, "damp": 0.15, "free": 0.02, "top": 0.1}


def granules_of(full):
    """Granules of a bed that has so many, or what SHORT_POUR makes of it."""
    return SHORT_POUR["granules"] if few else full


def box_bed():
    return settled("box", name="box", **shortened(**SHORT_POUR))


# --- figures of a run -----------------------------------------------------------------------------------------------

def with_stored(run, column, stored):
    """Steps and values of a column that sums over atoms, plus the fix's sum over the stored granules."""
    steps, values = run.series(column)
    return steps, values + (run.series(stored)[1] if run.counts else 0)


def kinetic_energy(run):
    """Steps and kinetic energy of all granules (J)."""
    return with_stored(run, "c_ke", "f_cull[19]")


def centre(run, column, stored):
    """Steps and a coordinate of the centre of mass of all granules (m)."""
    steps, x = run.series(column)
    if not run.counts:
        return steps, x
    mass, stored_mass = run.series("v_mass")[1], run.series("f_cull[5]")[1]
    return steps, (mass * x + stored_mass * run.series(stored)[1]) / (mass + stored_mass)


def height(granules):
    """Height of a bed's surface (m): the mean top of its highest twentieth."""
    tops = np.sort(granules["z"] + granules["radius"])
    return float(tops[-max(1, len(tops) // 20):].mean())


def bed_figures(run, size):
    """What every scene with a bed compares at its end."""
    return {"bed height (m)": height(run.final), "centre of mass (m)": centre_height(run.final),
            "granules outside": outside(run.final, size)}


# --- runs and bars --------------------------------------------------------------------------------------------------

def compare(part, deck, figures, variables, granules, steps_if_few, least_margins=None, keywords=FEW_KEYWORDS):
    """The comparison of one deck; `figures(run)` gives its metrics. `granules`: that the deck holds; `steps_if_few`: after the fix line.
    `least_margins`: by metric, where 2 % of the mean says nothing (a mean near zero). `keywords`: more of them, with few steps."""
    n = 1 if few else 3
    result, done = twins.compare(HERE / deck, out=OUT / part, unculled=n, culled=n, variables=variables, extra=figures, granules=granules,
                                 least_margins=least_margins, keywords=keywords if few else None,
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

AVALANCHE = 0.05  # mean diameters that the bed's centre of mass has moved down the slope


def tilt():
    """A leaning bed leans further until it avalanches."""
    lean = settled("lean", "lean.in", box_bed(), **shortened(start=1, rest=0.01))

    def figures(run):
        angle = run.series("v_angle")[1]
        x = centre(run, "v_x", "f_cull[20]")[1]
        gone = np.flatnonzero(x - x[0] > AVALANCHE * DIAMETER)
        energy = kinetic_energy(run)[1]
        return {"avalanche angle (deg)": float(angle[gone[0]] if len(gone) else angle[-1]),
                "slide of centre, end (m)": float(x[-1] - x[0]), "kinetic energy, largest (J)": float(energy.max()),
                **bed_figures(run, BOX)}

    result, runs = compare("tilt", "tilt.in", figures, {"restart": lean, "start_dump": start_dump("tilt"),
                                                        **shortened(steps=500, start=1)}, granules_of(1200), 500)
    before = read_final(HERE / start_dump("tilt"))
    notes = [f"before: bed height {height(before):.6g} m, centre of mass {centre_height(before):.6g} m",
             "angles: " + "; ".join(f"{r.name} {r.metrics['avalanche angle (deg)']:.2f}" for r in runs["unculled"] + runs["culled"])]
    return report("tilt", {"tilt": result}, [], notes)


def shake():
    """A bed on a floor shaken below and above 1 g."""
    bed = settled("tray", name="tray", low=-0.003, **shortened(**SHORT_POUR))
    parts = {}
    for peak in (0.5, 2):
        def figures(run):
            energy = kinetic_energy(run)[1]
            load = run.series("v_floor")[1]
            return {"kinetic energy, largest (J)": float(energy.max()), "kinetic energy, mean (J)": float(energy.mean()),
                    "floor load, largest (N)": float(load.max()), "floor load, mean (N)": float(load.mean()), **bed_figures(run, BOX)}
        part = f"shake-{peak:g}g"
        parts[part], _ = compare(part, "shake.in", figures, {"restart": bed, "peak": peak, "start_dump": start_dump(part),
                                                             **shortened(before=150, after=50, cycles=0.1)},
                                 granules_of(1200), 300)
    return report("shake", parts, [])


def switch():
    """Gravity goes, and comes back."""
    bed = box_bed()

    def figures(run):
        steps, energy = kinetic_energy(run)
        return {"kinetic energy, largest (J)": float(energy.max()), "kinetic energy, mean (J)": float(energy.mean()),
                "centre of mass, highest (m)": float(centre(run, "v_z", "f_cull[22]")[1].max()), **bed_figures(run, BOX)}

    result, _ = compare("switch", "switch.in", figures, {"restart": bed, "start_dump": start_dump("switch"),
                                                         **shortened(before=150, without=100, after=100)},
                        granules_of(1200), 350)
    return report("switch", {"switch": result}, [])


DISCHARGE_TIMES = (0.1, 0.2, 0.3, 0.5, 0.8, 1.2)  # s after the plug drops


def discharge(file, mass):
    """Times (s) and mass (kg) that has passed the outlet. Who is seen below has passed: nothing is culled there for long after."""
    below, times, passed, first = set(), [], [], None
    for step, _, rows in snapshots(file):
        first = step if first is None else first
        below.update(rows[rows[:, 1] < 0, 0].astype(int).tolist())
        times.append((step - first) * TIME_STEP)
        passed.append(sum(mass[tag] for tag in below))
    return np.array(times), np.array(passed)


def outlet():
    """A slit opens under a bed."""
    short = SHORT_POUR if few else {"granules": 2000}
    bed = settled("silo", name="silo", L=SILO[0], W=SILO[1], low=-0.085, **short)

    def figures(run):
        mass = dict(zip(run.final["id"].tolist(), run.final["mass"].tolist()))
        times, passed = discharge(OUT / "outlet" / f"{run.name}.seen", mass)
        left = run.final[run.final["z"] > 0]
        side = np.sign(left["x"] - SILO[0] / 2)
        return {**{f"discharged at {t:g} s (kg)": float(np.interp(t, times, passed)) for t in DISCHARGE_TIMES},
                "left behind (kg)": float(left["mass"].sum()),
                "(right - left) / left behind": float((side * left["mass"]).sum() / left["mass"].sum()),
                "granules outside": outside(run.final, SILO, -0.08)}

    result, _ = compare("outlet", "outlet.in", figures, {"restart": bed, "start_dump": start_dump("outlet"), "folder": (OUT / "outlet").relative_to(HERE),
                                                         **shortened(before=150, after=500)},
                        granules_of(2000), 730, {"(right - left) / left behind": 0.02})
    return report("outlet", {"outlet": result}, [])


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
                                 {} if turn else {"spin (rad/s)": slack}, keywords=None)
    return report("drop", parts, [])


SCENES = {f.__name__: f for f in (tilt, shake, switch, outlet, slide, drop)}


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
