#!/usr/bin/python3
"""Scenes that wake a sleeping bed, and one where culling cannot pay, culled and unculled.

    validation/activity/activity.py [scene ...] [--runs N] [--fix KEYWORDS] [--check] [--few-steps]

Makes the beds once (out/*.restart), runs each scene's deck N times unculled (granules 1e-5 d apart: the noise floor)
and N times culled, in turns, prints a table per scene and leaves all figures in out/SCENE.json. A culled figure is good within the larger of 2 % and
the noise floor of the unculled mean; a check has the bar beside it. Exit: 0 nothing lost, 1 a granule lost, 2 a run failed;
with --strict 1 also when a figure is outside its margin. `--few-steps`: every deck for a few steps; what can be checked then is
(solidcull_runs/few_steps.py).
"""
import argparse
import json
import os
import statistics
import sys
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
MOTION = HERE.parent / "motion"
sys.path.insert(0, str(HERE.parents[1]))
from solidcull_runs import beds, comparisons, errors, few_steps, meshes, tables, twins  # noqa: E402
from solidcull_runs.dumps import element_forces, read_final  # noqa: E402
from solidcull_runs.meshes import grid  # noqa: E402
from solidcull_runs.comparisons import check  # noqa: E402
from solidcull_runs.measures import centre_height, height_map, outside, rms  # noqa: E402

OUT = HERE / "out"                               # meshes and beds
DIAMETER = 0.00275                               # m: mean, of the beds that wake
TRAY, HALL = (0.15, 0.06), (0.06, 0.06)          # m: L and W of the beds that wake
CELL = 0.0005                                    # m, of the height map
HARM = 1.02                                      # loop time culled over unculled that is allowed where nothing rests
MOST_RUNS = 10
FELL = 0.5                                       # mean diameters: what has sunk by more has fallen

options = argparse.Namespace(runs=3, fix=None, few_steps=False)


def results():
    """The folder for what the scenes leave."""
    return OUT / "few" if options.few_steps else OUT


# --- meshes ---------------------------------------------------------------------------------------------------------

def floor(size, n_u, n_v, out=0.0009):
    """A floor that reaches `out` under the sides."""
    return grid((-out, -out, 0), (size[0] + 2 * out, 0, 0), (0, size[1] + 2 * out, 0), n_u, n_v)


def make_meshes():
    def write(name, triangles):
        meshes.write_stl(OUT / f"{name}.stl", triangles)

    write("tray", floor(TRAY, 30, 12))
    (l, w), low, tall = HALL, -0.0205, 0.1005
    write("hall-floor", floor(HALL, 12, 12))
    write("hall-sides", [t for corner, u in (((0, 0), (l, 0)), ((0, w), (l, 0)), ((0, 0), (0, w)), ((l, 0), (0, w)))
                       for t in grid((*corner, low), (*u, 0), (0, 0, tall), 6, 10)])
    # 80 degrees, the outlet 12 diameters wide
    write("hopper", [t for bottom, top in ((0.03, 0.0), (0.09, 0.12))
                   for t in grid((bottom, -0.0009, 0), (0, 0.0318, 0), (top - bottom, 0, 0.17), 1, 1)])
    write("plug", grid((0.029, -0.0009, 0), (0.062, 0, 0), (0, 0.0318, 0), 1, 1))


# --- beds -----------------------------------------------------------------------------------------------------------

FEW = 1000  # granules of a bed that wakes, with few steps


def short(**few):
    """Variables of a deck for --few-steps, nothing otherwise."""
    return few if options.few_steps else {}


def either(few, full):
    return few if options.few_steps else full


def made(bed, folder, deck, sources, **variables):
    """The restart file of a bed, relative to this folder, made by a deck that is run in `folder`."""
    return beds.settled(OUT / f"{bed}{'-few' if options.few_steps else ''}.restart", folder / deck, sources, variables).relative_to(HERE)


def settled(bed, walls, size, granules, **variables):
    """A bed of the scenes that wake, poured and calmed by motion's settle.in."""
    few = short(granules=FEW, pour=0.12, damp=0.03, free=0.01)
    sources = [MOTION / "engine.in", MOTION / "material.in", HERE / f"{walls}.in", *OUT.glob(f"{walls}*.stl")]
    return made(bed, MOTION, "settle.in", sources, **{"name": f"../activity/{walls}", "L": size[0], "W": size[1], "granules": granules,
                "small": 0.0013, "large": 0.00145, "dt": 2.5e-5, "top": 0.08, "pour": 0.2, "damp": 0.25, "free": 0.1, "stills": 2,
                **variables, **few})


def tray_bed():
    return settled("tray", "tray", TRAY, 12000, low=-0.003)


def hall_bed():
    return settled("hall", "hall", HALL, 5000, low=-0.03, top=0.09)


def filled(room, **variables):
    """A bed in which nothing rests, poured by fill.in."""
    sources = [HERE / f for f in ("flow.in", f"{room}_room.in", f"{room}_walls.in")] + [MOTION / "material.in"]
    return made(room, HERE, "fill.in", sources, **{"room": room, **variables, **short(granules=150, pour=400, calm=0)})


# --- figures of a run -----------------------------------------------------------------------------------------------

def rows_of(run, part, column):
    """A thermo column's rows of the `part`-th run command behind the fix line, the first (of the step before) left out."""
    tables = [t for t in run.tables if t.counted and t.rows]
    table = tables[part]
    bare = column if column in table.columns else column[2:]
    return np.array([row[table.columns.index(bare)] for row in table.rows[1:] or table.rows])


def bed_figures(run, size):
    """What every scene with a bed compares at its end; keeps the run's height map."""
    run.map = height_map(run.final, (0, 0), size, CELL)
    return {"mean height of the surface (m)": float(run.map.mean()), "centre of mass (m)": centre_height(run.final),
            "granules outside": outside(run.final, size, -0.021)}


def map_check(runs, start, size):
    """Rms difference of the surfaces: culled from unculled (mean over pairs), against the largest of two unculled ones."""
    maps = {kind: [r.map for r in runs[kind]] for kind in twins.KINDS}
    error, noise = comparisons.apart(maps["unculled"], maps["culled"], rms)
    relief = rms(maps["unculled"][0], height_map(read_final(start), (0, 0), size, CELL))
    return [check("surface, rms difference culled - unculled (m), of the unculled runs'", error, max(noise, 0.02 * relief))]


# --- runs -----------------------------------------------------------------------------------------------------------

def compare(part, deck, figures, variables, granules, steps_if_few, locks=True, poured=0):
    """The comparison of one deck; `figures(run)` gives its metrics. `granules`: at the end, of which `poured` are added on
    the way; `steps_if_few`: after the fix line; `locks`: whether few of them lock granules."""
    given = {**variables, **({"keywords": options.fix} if options.fix else {})}
    result, runs = twins.compare(HERE / deck, out=results() / part, unculled=options.runs, culled=options.runs, variables=given, extra=figures,
                                 granules=granules, say=lambda line: print(f"  {part}: {line}", flush=True))
    if options.few_steps:
        few_steps.check(runs, granules, steps_if_few, locks, poured, where=f"{part}, ")
    return result, runs


def report(scene, parts, checks=(), notes=()):
    """Prints a scene's tables and checks, writes its JSON; its verdict: "good", "outside" or "lost"."""
    tables.print_scene(parts, checks, notes)
    lost = any(comparisons.is_lost(r["ledger"]) for r in parts.values())
    good = all(r["good"] for r in parts.values()) and all(c["good"] for c in checks)
    verdict = "lost" if lost else "good" if good else "outside"
    (results() / f"{scene}.json").write_text(json.dumps({"verdict": verdict, "fix": options.fix, "runs": options.runs, "few_steps": options.few_steps,
                                                         "parts": parts, "checks": list(checks), "notes": list(notes)}, indent=1) + "\n")
    return verdict


# --- scenes that wake -----------------------------------------------------------------------------------------------

def in_tray(scene, figures, granules, steps_if_few, few, **how):
    """A scene in the tray; `few`: variables of its deck with few steps."""
    start = results() / f"{scene}-start.dump"
    result, runs = compare(scene, f"{scene}.in", lambda run: {**figures(run), **bed_figures(run, TRAY)},
                           {"restart": tray_bed(), "start_dump": start.relative_to(HERE), **short(**few)}, granules, steps_if_few, **how)
    return report(scene, {scene: result}, map_check(runs, start, TRAY))


def pour():
    """More granules are poured on a sleeping bed."""
    def figures(run):
        load = rows_of(run, 1, "f_force")
        return {"floor load, largest (N)": float(load.max()), "floor load, last tenth (N)": float(load[-max(1, len(load) // 10):].mean())}

    return in_tray("pour", figures, either(FEW + 100, 15000), 400, {"before": 100, "granules": 100, "after": 300}, poured=either(100, 3000))


def weight():
    """A bed in a hall of meshes: the load on each element, free and asleep; then its floor drops away, or is unfixed."""
    parts, checks, notes = {}, [], []
    rows = 50 if options.few_steps else 800
    for drop, part in ((1, "weight-drop"), (0, "weight-unfix")):
        start = results() / f"{part}-start.dump"

        def figures(run):
            before = read_final(start)
            return {"granules that fell": int((before["z"] - run.final["z"] > FELL * DIAMETER).sum()),
                    "mean fall (m)": float((before["z"] - run.final["z"]).mean()), **bed_figures(run, HALL)}

        result, runs = compare(part, "weight.in", figures, {"restart": hall_bed(), "start_dump": start.relative_to(HERE), "drop": drop,
                                                            "part": (results() / part).relative_to(OUT), "rows": rows, **short(after=300)},
                               either(FEW, 5000), 1100)
        parts[part] = result
        for mesh in ("floor", "sides"):
            change, total = {}, {}
            for kind in ("unculled", "culled"):  # the first run of each: in the others the granules have been moved by 1e-5 d
                free, late = (element_forces(results() / part / f"{kind}-1.{mesh}.{k * rows}.vtk") for k in (5, 15))
                size = float(np.linalg.norm(free, axis=1).mean()) or 1.0
                change[kind] = float(np.linalg.norm(late - free, axis=1).max()) / size
                total[kind] = late.sum(axis=0)
                notes.append(f"{part}, {kind}, {mesh}: mean load of an element {size:.4g} N, largest change until asleep {change[kind]:.2e} of it, "
                             f"rms {float(np.sqrt(((late - free)**2).sum(axis=1).mean())) / size:.2e}; load {np.round(total[kind], 6).tolist()} N")
            checks.append(check(f"{part}, {mesh}: load change of an element until asleep, over the mean load", change["culled"],
                                max(0.02, change["unculled"])))
        asleep = statistics.fmean(float(r.series("f_cull[3]")[1][8 * rows // 50]) for r in runs["culled"])
        notes.append(f"{part}: interior granules when the floor goes {asleep:.0f}")
    return report("weight", parts, checks, notes)


# --- a scene in which nothing rests ----------------------------------------------------------------------------------

def no_harm(scene, restart, whole, **variables):
    """A scene in which culling cannot pay: loop time with the fix over without it, runs in turns."""
    def figures(run):
        ke = run.series("c_ke")[1] + (run.series("f_cull[19]")[1] if run.counts else 0)
        return {"kinetic energy, mean (J)": float(ke.mean())}

    result, runs = compare(scene, f"{scene}.in", figures, {**({"restart": restart} if restart else {}), **variables, **short(steps=200, start=100)},
                           whole, 200, locks=False)
    ratio = 1 / result["speed_up"]
    pairs = [c.loop_time / max(u.loop_time, 1e-9) for u, c in zip(runs["unculled"], runs["culled"])]
    by_kind = [statistics.median(r.cpu for r in runs[kind]) for kind in ("culled", "unculled")]
    inside = max(float(r.series("f_cull[3]")[1].max()) for r in runs["culled"])
    share = result["culled"]["seconds"] / max(result["culled"]["loop_time"], 1e-9)
    notes = [f"{scene}: ratio of each pair of runs {', '.join(f'{p:.3f}' for p in pairs)}; time in the fix {100 * share:.1f} %; "
             f"processor time of whole runs, medians, {by_kind[0] / by_kind[1]:.3f}; "
             f"most interior granules {inside:.0f}"]
    return report(scene, {scene: result}, [check("loop time culled / unculled, medians", ratio, HARM)], notes)


def silo():
    """A steep hopper that empties in mass flow."""
    return no_harm("silo", filled("silo"), either(150, 6000))


SCENES = {f.__name__: f for f in (pour, weight, silo)}


def main(argv=None):
    global options
    p = argparse.ArgumentParser(prog="activity.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("scene", nargs="*", choices=[*SCENES, []], help="default: all")
    p.add_argument("--runs", type=int, default=3, metavar="N", help="unculled, and as many culled (default 3)")
    p.add_argument("--fix", metavar="KEYWORDS", help='of the fix, in one word: "exterior sleep depth 1"')
    p.add_argument("--check", action="store_true", help="culled runs check the fix's invariants at every reneighbouring")
    p.add_argument("--strict", action="store_true", help="a figure outside its margin counts")
    p.add_argument("--few-steps", action="store_true", help="every deck for a few steps, one run of each")
    options = p.parse_args(argv)
    if not 1 <= options.runs <= MOST_RUNS:
        p.error(f"--runs takes 1 to {MOST_RUNS}")
    if options.few_steps:
        options.runs = 1
    if options.check:
        os.environ["SOLIDCULL_CHECK"] = "1"
    results().mkdir(parents=True, exist_ok=True)
    make_meshes()
    status = 0
    for name in options.scene or SCENES:
        began = time.monotonic()
        print(f"=== {name}: {SCENES[name].__doc__}", flush=True)
        try:
            verdict = SCENES[name]()
        except errors.RunError as e:
            print(f"activity: {name}: {e}", file=sys.stderr, flush=True)
            verdict, status = "failed", 2
        if verdict == "lost" or options.strict and verdict == "outside":
            status = status or 1
        print(f"=== {name}: {verdict}, {time.monotonic() - began:.0f} s\n", flush=True)
    return status


if __name__ == "__main__":
    errors.command("activity", main)
