#!/usr/bin/python3
"""Scenes that wake a sleeping bed, and scenes where culling cannot pay, culled and unculled.

    validation/activity/activity.py [scene ...] [--runs N] [--fix KEYWORDS] [--check] [--few-steps]

Makes the beds once (out/*.restart), runs each scene's deck N times unculled (granules 1e-5 d apart, tools 10 um: the noise floor)
and N times culled, in turns, prints a table per scene and leaves all figures in out/SCENE.json. A culled figure is good within the larger of 2 % and
the noise floor of the unculled mean; a check has the bar beside it. Exit: 0 nothing lost, 1 a granule lost, 2 a run failed;
with --strict 1 also when a figure is outside its margin.
"""
import argparse
import importlib.util
import json
import os
import resource
import statistics
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
MOTION = HERE.parent / "motion"
sys.path[:0] = [str(HERE.parent), str(MOTION)]
import twin    # noqa: E402
import motion  # noqa: E402
import numpy as np  # noqa: E402

OUT = HERE / "out"                               # meshes and beds
LAUNCHER = os.environ.get("SOLIDCULL_LAUNCHER")  # default: as twin finds it
GRAVITY = 9.81
DIAMETER = 0.00275                               # m: mean, of the beds that wake
TRAY, HALL = (0.15, 0.06), (0.06, 0.06)          # m: L and W of the beds that wake
CELL = 0.0005                                    # m, of the height map
ASIDE = [k * 1e-5 for k in (0, 1, -1, 2, -2, 3, -3, 4, -4, 5)]  # m: the place of a tool in each run
HARM = 1.02                                      # loop time culled over unculled that is allowed where nothing rests
FELL = 0.5                                       # mean diameters: what has sunk by more has fallen

options = argparse.Namespace(runs=3, fix=None, few_steps=False)


def results():
    """The folder for what the scenes leave."""
    return OUT / "few" if options.few_steps else OUT


# --- meshes ---------------------------------------------------------------------------------------------------------

def grid(corner, side_u, side_v, n_u, n_v):
    """Triangles of a parallelogram, n_u x n_v cells of two."""
    corner, u, v = (np.array(a, float) for a in (corner, side_u, side_v))
    triangles = []
    for i in range(n_u):
        for j in range(n_v):
            a, b, c, d = (corner + u * (i + di) / n_u + v * (j + dj) / n_v for di, dj in ((0, 0), (1, 0), (1, 1), (0, 1)))
            triangles += [(a, b, c), (a, c, d)]
    return triangles


def block(low, high):
    """Triangles of a closed box."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    x, y, z = (x1 - x0, 0, 0), (0, y1 - y0, 0), (0, 0, z1 - z0)
    return [t for corner, u, v in ((low, y, x), (low, x, z), (low, z, y), ((x0, y0, z1), x, y), ((x1, y0, z0), y, z), ((x0, y1, z0), z, x))
            for t in grid(corner, u, v, 1, 1)]


def stl(name, triangles):
    text = f"solid {name}\n" + "".join(
        "facet normal 0 0 0\nouter loop\n" + "".join("vertex {:.9g} {:.9g} {:.9g}\n".format(*v) for v in t) + "endloop\nendfacet\n"
        for t in triangles) + f"endsolid {name}\n"
    file = OUT / f"{name}.stl"
    if not file.exists() or file.read_text() != text:
        file.write_text(text)


def floor(size, n_u, n_v, out=0.0009):
    """A floor that reaches `out` under the sides."""
    return grid((-out, -out, 0), (size[0] + 2 * out, 0, 0), (0, size[1] + 2 * out, 0), n_u, n_v)


def make_meshes():
    stl("tray", floor(TRAY, 30, 12))
    stl("blade", grid((0.03, 0.02, 0), (0, 0.02, 0), (0, 0, 0.02), 4, 4))
    stl("block", block((0.06, 0.015, 0), (0.09, 0.045, 0.01)))
    (l, w), low, tall = HALL, -0.0205, 0.1005
    stl("hall-floor", floor(HALL, 12, 12))
    stl("hall-sides", [t for corner, u in (((0, 0), (l, 0)), ((0, w), (l, 0)), ((0, 0), (0, w)), ((l, 0), (0, w)))
                       for t in grid((*corner, low), (*u, 0), (0, 0, tall), 6, 10)])
    # 80 degrees, the outlet 12 diameters wide
    stl("hopper", [t for bottom, top in ((0.03, 0.0), (0.09, 0.12))
                   for t in grid((bottom, -0.0009, 0), (0, 0.0318, 0), (top - bottom, 0, 0.17), 1, 1)])
    stl("plug", grid((0.029, -0.0009, 0), (0.062, 0, 0), (0, 0.0318, 0), 1, 1))
    angles = np.radians([0, 90, 180, 270])
    stl("mixer", [t for a in angles for t in grid((0, 0, 0.004), (0.046 * np.cos(a), 0.046 * np.sin(a), 0), (0, 0, 0.03), 2, 2)])
    stl_text = drum_example().drum_stl()
    if not (OUT / "drum.stl").exists() or (OUT / "drum.stl").read_text() != stl_text:
        (OUT / "drum.stl").write_text(stl_text)


def drum_example():
    spec = importlib.util.spec_from_file_location("drum_example", ROOT / "examples" / "drum" / "example.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


# --- beds -----------------------------------------------------------------------------------------------------------

def short(**few):
    """Variables of a deck for --few-steps, nothing otherwise."""
    return few if options.few_steps else {}


def made(bed, folder, deck, sources, **variables):
    """The restart file of a bed, relative to this folder, made by a deck that is run in `folder` unless it is there, of the same."""
    file = OUT / f"{bed}{'-few' if options.few_steps else ''}.restart"
    note = file.with_suffix(".recipe")
    recipe = "\n".join([json.dumps(variables), *(f.read_text() for f in [folder / deck, *sources])])
    if not (file.exists() and note.exists() and note.read_text() == recipe):
        print(f"  making {file.name}", flush=True)
        part = file.with_suffix(".part")
        twin.run_liggghts(twin.find_launcher(LAUNCHER), folder / deck, folder, OUT / f"{file.stem}.log", {**variables, "restart": part})
        part.rename(file)
        note.write_text(recipe)
    return file.relative_to(HERE)


def settled(bed, walls, size, granules, **variables):
    """A bed of the scenes that wake, poured and calmed by motion's settle.in."""
    few = short(granules=1000, pour=0.12, damp=0.03, free=0.01)
    sources = [MOTION / "engine.in", MOTION / "material.in", HERE / f"{walls}.in", *OUT.glob(f"{walls}*.stl")]
    return made(bed, MOTION, "settle.in", sources, **{"name": f"../activity/{walls}", "L": size[0], "W": size[1], "granules": granules,
                "small": 0.0013, "large": 0.00145, "dt": 2.5e-5, "top": 0.08, "pour": 0.2, "damp": 0.25, "free": 0.1, "stills": 2,
                **variables, **few})


def tray_bed():
    return settled("tray", "tray", TRAY, 12000, low=-0.003)


def hall_bed():
    return settled("hall", "hall", HALL, 5000, low=-0.03, top=0.09)


def filled(room, **variables):
    """A bed of a scene in which nothing rests, poured by fill.in."""
    sources = [HERE / f for f in ("flow.in", f"{room}_room.in", f"{room}_walls.in")] + [MOTION / "material.in"]
    return made(room, HERE, "fill.in", sources, **{"room": room, **variables, **short(granules=150, pour=400, calm=0)})


def drum_bed():
    drum = ROOT / "examples" / "drum"
    return made("drum", drum, "fill.in", [drum / "material.in"], drum=str(OUT / "drum.stl"), period=1,
                **{"poursteps": 8000, "turnsteps": 8000, **short(granules=300, poursteps=300, turnsteps=300)})


# --- figures of a run -----------------------------------------------------------------------------------------------

def rows_of(run, part, column):
    """A thermo column's rows of the `part`-th run command behind the fix line, the first (of the step before) left out."""
    tables = [t for t in run.tables if t.counted and t.rows]
    table = tables[part]
    bare = column if column in table.columns else column[2:]
    return np.array([row[table.columns.index(bare)] for row in table.rows[1:] or table.rows])


def height_map(granules, size):
    """Height of the surface (m) over a grid of CELL, 0 where there is only floor."""
    n, m = round(size[0] / CELL), round(size[1] / CELL)
    height = np.zeros((n, m))
    reach = int(np.ceil(granules["radius"].max() / CELL))
    i, j = np.floor(granules["x"] / CELL).astype(int), np.floor(granules["y"] / CELL).astype(int)
    for di in range(-reach, reach + 1):
        for dj in range(-reach, reach + 1):
            left = granules["radius"]**2 - ((i + di + 0.5) * CELL - granules["x"])**2 - ((j + dj + 0.5) * CELL - granules["y"])**2
            k = (left > 0) & (i + di >= 0) & (i + di < n) & (j + dj >= 0) & (j + dj < m)
            np.maximum.at(height, (i[k] + di, j[k] + dj), granules["z"][k] + np.sqrt(left[k]))
    return height


def bed_figures(run, size):
    """What every scene with a bed compares at its end; keeps the run's height map."""
    if run.final is None:
        raise twin.TwinError(f"{run.name} ended without writing its granules")
    run.map = height_map(run.final, size)
    return {"mean height of the surface (m)": float(run.map.mean()), "centre of mass (m)": motion.centre_height(run.final),
            "granules outside": motion.outside(run.final, size, -0.021)}


def check(what, value, bar, good=None):
    """A figure with a bar of its own; good when not above it, unless said. NaN is not good."""
    return {"what": what, "value": float(value), "bar": float(bar), "good": bool(value <= bar if good is None else good)}


def map_check(runs, start, size):
    """Rms difference of the surfaces: culled from unculled (mean over pairs), against the largest of two unculled ones."""
    def rms(a, b):
        return float(np.sqrt(((a - b)**2).mean()))

    us, cs = ([r.map for r in runs[kind]] for kind in ("unculled", "culled"))
    error = statistics.fmean(rms(u, c) for u in us for c in cs)
    noise = max((rms(a, b) for i, a in enumerate(us) for b in us[:i]), default=0.0)
    relief = rms(us[0], height_map(twin.read_final(start), size))
    return [check("surface, rms difference culled - unculled (m), of the unculled runs'", error, max(noise, 0.02 * relief))]


# --- runs -----------------------------------------------------------------------------------------------------------

def compare(part, deck, figures, variables, runs=None, vary=None):
    """twin's comparison of one deck; `figures(run)` gives its metrics. `vary`: a variable and its value in each run."""
    n = runs or options.runs
    given = {**variables, **({"keywords": options.fix} if options.fix else {})}
    return twin.compare(HERE / deck, (), LAUNCHER, results() / part, unculled=n, culled=n, variables=given, extra=figures,
                        vary=vary, say=lambda line: print(f"  {part}: {line}", flush=True))


def report(scene, parts, checks=(), notes=()):
    """Prints a scene's tables and checks, writes its JSON; its verdict: "good", "outside" or "lost"."""
    for name, result in parts.items():
        print(f"\n{name}\n{twin.table(result)}")
    if checks:
        width = max(len(c["what"]) for c in checks)
        print(f"\n{'check':{width}} {'value':>12} {'bar':>12}")
        for c in checks:
            print(f"{c['what']:{width}} {c['value']:12.5g} {c['bar']:12.5g} {'good' if c['good'] else 'OUTSIDE'}")
    for note in notes:
        print(note)
    books = [r["ledger"] for r in parts.values()]
    lost = any(b is None or b["lost"] or b["ids_missing"] for b in books)
    good = all(r["good"] for r in parts.values()) and all(c["good"] for c in checks)
    verdict = "lost" if lost else "good" if good else "outside"
    (results() / f"{scene}.json").write_text(json.dumps({"verdict": verdict, "fix": options.fix, "runs": options.runs, "few_steps": options.few_steps,
                                                     "parts": parts, "checks": list(checks), "notes": list(notes)}, indent=1) + "\n")
    return verdict


# --- scenes that wake -----------------------------------------------------------------------------------------------

def blade():
    """A blade dips into a sleeping bed and ploughs through it."""
    def figures(run):
        x, z = rows_of(run, 2, "f_force[1]"), rows_of(run, 2, "f_force[2]")
        return {"drag, mean (N)": float(-x.mean()), "drag, largest (N)": float((-x).max()), "lift, mean (N)": float(z.mean()),
                "lift while dipping, largest (N)": float(rows_of(run, 1, "f_force[2]").max()), **bed_figures(run, TRAY)}

    start = results() / "blade-start.dump"
    result, runs = compare("blade", "blade.in", figures, {"restart": tray_bed(), "start_dump": start.relative_to(HERE),
                                                          **short(before=100, dip=0.001, path=0.0005)}, vary=("aside", ASIDE))
    return report("blade", {"blade": result}, map_check(runs, start, TRAY))


def lower():
    """A block is lowered into a sleeping bed by 8 mm, held, and withdrawn."""
    def figures(run):
        hold = rows_of(run, 2, "f_force[2]")
        return {"force, largest (N)": float(rows_of(run, 1, "f_force[2]").max()),
                "force on hold, second half (N)": float(hold[len(hold) // 2:].mean()), **bed_figures(run, TRAY)}

    start = results() / "lower-start.dump"
    result, runs = compare("lower", "lower.in", figures, {"restart": tray_bed(), "start_dump": start.relative_to(HERE),
                                                          **short(before=100, depth=0.0005, hold=200, after=200)}, vary=("aside", ASIDE))
    return report("lower", {"lower": result}, map_check(runs, start, TRAY))


def pour():
    """More granules are poured on a sleeping bed."""
    def figures(run):
        load = rows_of(run, 1, "f_force")
        return {"floor load, largest (N)": float(load.max()), "floor load, last tenth (N)": float(load[-max(1, len(load) // 10):].mean()),
                **bed_figures(run, TRAY)}

    start = results() / "pour-start.dump"
    result, runs = compare("pour", "pour.in", figures, {"restart": tray_bed(), "start_dump": start.relative_to(HERE),
                                                        **short(before=100, granules=100, after=300)})
    return report("pour", {"pour": result}, map_check(runs, start, TRAY))


def element_loads(file):
    """Force (N) on each element of a mesh, from a dump `stresscomponents area`: (elements, 3)."""
    _, _, cells = file.read_text().partition("CELL_DATA")
    words = cells.split()
    n = int(words[0])
    at = words.index("stress") + 4  # name, components, tuples, type, values
    stress = np.array(words[at:at + 3 * n], float).reshape(n, 3)
    at = words.index("area") + 4
    return stress * np.array(words[at:at + n], float)[:, None]


def weight():
    """A bed in a hall of meshes: the load on each element, free and asleep; then its floor drops away, or is unfixed."""
    parts, checks, notes = {}, [], []
    rows = 50 if options.few_steps else 800
    for drop, part in ((1, "weight-drop"), (0, "weight-unfix")):
        start = results() / f"{part}-start.dump"

        def figures(run):
            before = twin.read_final(start)
            return {"granules that fell": int((before["z"] - run.final["z"] > FELL * DIAMETER).sum()),
                    "mean fall (m)": float((before["z"] - run.final["z"]).mean()), **bed_figures(run, HALL)}

        result, runs = compare(part, "weight.in", figures, {"restart": hall_bed(), "start_dump": start.relative_to(HERE), "drop": drop,
                                                            "part": (results() / part).relative_to(OUT), "rows": rows, **short(after=300)})
        parts[part] = result
        for mesh in ("floor", "sides"):
            change, total = {}, {}
            for kind in ("unculled", "culled"):  # the first run of each: in the others the granules have been moved by 1e-5 d
                free, late = (element_loads(results() / part / f"{kind}-1.{mesh}.{k * rows}.vtk") for k in (5, 15))
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


# --- scenes in which nothing rests ----------------------------------------------------------------------------------

def children_seconds():
    """Processor time (s) of all runs so far."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def no_harm(scene, restart, **variables):
    """A scene in which culling cannot pay: loop time with the fix over without it, runs in turns."""
    seconds, last = {}, [children_seconds()]

    def figures(run):
        seconds[run.name], last[0] = children_seconds() - last[0], children_seconds()
        ke = run.series("c_ke")[1] + (run.series("f_cull[19]")[1] if run.counts else 0)
        return {"kinetic energy, mean (J)": float(ke.mean())}

    result, runs = compare(scene, f"{scene}.in", figures, {**({"restart": restart} if restart else {}), **variables, **short(steps=200, start=100)})
    ratio = 1 / result["speed_up"]
    pairs = [c.loop_time / max(u.loop_time, 1e-9) for u, c in zip(runs["unculled"], runs["culled"])]
    by_kind = [statistics.median(seconds[r.name] for r in runs[kind]) for kind in ("culled", "unculled")]
    inside = max(float(r.series("f_cull[3]")[1].max()) for r in runs["culled"])
    share = result["culled"]["seconds"] / max(result["culled"]["loop_time"], 1e-9)
    notes = [f"{scene}: ratio of each pair of runs {', '.join(f'{p:.3f}' for p in pairs)}; time in the fix {100 * share:.1f} %; "
             f"processor time of whole runs, medians, {by_kind[0] / by_kind[1]:.3f}; "
             f"most interior granules {inside:.0f}"]
    return report(scene, {scene: result}, [check("loop time culled / unculled, medians", ratio, HARM)], notes)


def drum():
    """A drum that turns once a second: the whole bed tumbles."""
    return no_harm("drum", drum_bed(), period=1)


def mixer():
    """A mixer of four blades, four turns a second, in a bed."""
    fine = {"dt": 3e-5}
    return no_harm("mixer", filled("mixer", small=0.0018, large=0.0022, calm=0, **fine), **fine)


def gas():
    """A loose gas in a box, without gravity; long enough for a clock to tell 2 %."""
    return no_harm("gas", None, steps=40000, **short(granules=200))


def silo():
    """A steep hopper that empties in mass flow."""
    return no_harm("silo", filled("silo"))


SCENES = {f.__name__: f for f in (blade, pour, lower, weight, drum, mixer, gas, silo)}


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
    if not 1 <= options.runs <= len(ASIDE):
        p.error(f"--runs takes 1 to {len(ASIDE)}")
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
        except twin.TwinError as e:
            print(f"activity: {name}: {e}", file=sys.stderr, flush=True)
            verdict, status = "failed", 2
        if verdict == "lost" or options.strict and verdict == "outside":
            status = status or 1
        print(f"=== {name}: {verdict}, {time.monotonic() - began:.0f} s\n", flush=True)
    return status


if __name__ == "__main__":
    sys.exit(main())
