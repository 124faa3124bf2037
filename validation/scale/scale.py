#!/usr/bin/python3
"""One impact on ever larger beds: what a granule that rests costs, culled, unculled, and frozen by hand.

    validation/scale/scale.py [--sizes 20k,160k,1.28M,10.24M] [--only unculled,culled,asleep,control] [--runs n] [--idle]
                              [--publish] [--few-steps]

Makes the beds that are missing (out/bed-SIZE.restart), then runs each size unculled (impact.in without its fix line), culled
(impact.in) and by hand (control.in), in turns, each on one core, and prints run times, parts, memory and errors. `asleep` runs
(asleep.in) start from culled restart files (out/asleep-SIZE.restart); 10.24M has these alone: its file is laid by lay_culled.py.
Every run is kept in out/runs/; a run that is there, made of the same decks, bed and (culled) launcher, is not repeated, so that an
interrupted series goes on where it stopped. All figures: out/scale.json, table out/scale.txt, plot out/scale.png.
`--idle`: no ball, nothing moves. `--few-steps`: tiny beds, a few steps, always run anew; what can be checked then is. `--table`: runs nothing, prints what is there.
`--publish`: keeps the figures with the sources, see published.py.
Exit: 0 all runs there and no granule lost, 1 else, 2 a run failed.
"""
import argparse
import hashlib
import json
import math
import os
import re
import statistics
import sys
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))
import published  # noqa: E402
from solidcull_runs import beds, comparisons, decks, engine, errors, examples, logs, measures, plots, struck, tables  # noqa: E402
from solidcull_runs.dumps import element_normal_loads, read_final  # noqa: E402
from solidcull_runs.laid import beds as laid_beds  # noqa: E402
from solidcull_runs.laid import culled_files, tiles  # noqa: E402
from solidcull_runs.laid.floors import Floor  # noqa: E402
from solidcull_runs.laid.floors import write_floor as write_grid  # noqa: E402
from solidcull_runs.laid.sources import Source  # noqa: E402
from solidcull_runs.laid.walls import box_of, number_of  # noqa: E402

impact = examples.load("impact")  # how it measures the crater

OUT = HERE / "out"
BALL = 0.006                   # m: radius
FALL = 0.00224                 # m: what the ball of examples/impact falls before it touches a granule
NEAR = 0.03                                   # m: of the blow's own crater, around its middle
SHIFTS = (0, 1e-5, -1e-5, 2e-5, -2e-5)      # m: the ball's x in each run
PERIOD, GRANULES, TOP = 0.075, 20000, 0.12       # m, of the tile; m: height of the box
MARGIN = 0.0014                # m, the largest radius: the sides stand as far outside of the tiles, so that no granule overlaps them
ELEMENT = 0.0375               # m: edge of the floor's triangles
SAMPLE = 0.5                   # s between two looks at the memory
KINDS = ("unculled", "culled", "asleep", "control")
CULLED = ("culled", "asleep")
SLEEP = "exterior sleep"       # the keywords of the fix, if no others are given

# name: tiles in x and y, the bed that it is laid of (none: of the tile itself), steps damped, then how often at most stopped and left free for how long
BEDS = {"20k": ((1, 1), None, 12000, 10, 1000), "base": ((3, 3), None, 5000, 4, 300),
        "rested": ((3, 3), "base", 6000, 6, 500), "160k": ((4, 2), "rested", 2500, 10, 250), "1.28M": ((8, 8), "rested", 1000, 5, 250)}
# name: tiles in x and y, the bed whose culled restart file it is laid of; it never was atoms, so there are no other runs of it
LAID = {"10.24M": ((32, 16), "1.28M")}
DOZE = 8000                    # steps in which a bed is put to sleep
FEW_BEDS = {"tiny": ((1, 1), None, 500, 2, 50), "few-base": ((3, 3), None, 150, 2, 20), "small": ((4, 2), "few-base", 50, 2, 20),
            "few-rested": ((3, 3), None, 3500, 4, 200)}
FEW = {"PERIOD": 0.015, "GRANULES": 700, "BEDS": FEW_BEDS, "LAID": {"laid": ((6, 4), "few-rested")}, "DOZE": 7000, "OUT": OUT / "few"}
FEW_TILE = {"poursteps": 3000, "dampsteps": 1500, "freesteps": 100}
FEW_RESTED_TILE = {"poursteps": 4000, "dampsteps": 8000, "freesteps": 1000}  # for a bed that is to sleep as a whole
HELPERS = ("base", "rested")      # beds that others are laid of, not sizes
few_steps = False


# --- beds -----------------------------------------------------------------------------------------------------------

def text_of(*files):
    """Decks without comments and empty lines: what a kept result depends on."""
    return decks.without_comments(line for f in files for line in (HERE / f).read_text().splitlines())


def sides_of(copies):
    return [round(n * PERIOD + 2 * MARGIN, 9) for n in copies]


def tile(of):
    """The settled tile of a bed, periodic in x and y."""
    rested = few_steps and of.endswith("rested")
    variables = {"P": PERIOD, "granules": GRANULES, **(FEW_RESTED_TILE if rested else FEW_TILE if few_steps else {})}
    name = "tile-rested" if rested else "tile"
    return beds.made(OUT / f"{name}.restart", json.dumps(variables) + text_of("tile.in", "material.in"),
                lambda part: engine.run_liggghts(HERE / "tile.in", HERE, OUT / f"{name}.log", {**variables, "restart": part}))


def write_floor(file, sides):
    write_grid(file, sides, 2 * MARGIN, ELEMENT)


def bed(name):
    """The bed at rest: files restart, floor, granules (.npy), and its recipe's hash."""
    copies, source, damp, stills, free = BEDS[name]
    sides, floor, granules = sides_of(copies), OUT / f"floor-{name}.stl", OUT / f"bed-{name}.npy"
    source_file = bed(source)["restart"] if source else tile(name)
    variables = {"L": sides[0], "W": sides[1], "dampsteps": damp, "stills": stills, "freesteps": free}
    recipe = json.dumps([variables, copies, ELEMENT, TOP]) + text_of("relax.in", "material.in", "bed.in") + Path(tiles.__file__).read_text() \
        + beds.recipe_of(source_file)

    def make(part):
        laid, dump = OUT / f"tiles-{name}.part", OUT / f"bed-{name}.dump"
        write_floor(floor, sides)
        # the middle of the bed is to be the middle of the tile that was poured, whatever the number of tiles
        of = tiles.Bed(source_file, BEDS[source][0], PERIOD, MARGIN, False) if source else \
            tiles.Bed(source_file, (1, 1), PERIOD, 0, copies != (1, 1))
        tiles.lay(of, laid, copies, PERIOD, MARGIN, TOP)
        began = time.monotonic()
        log = engine.run_liggghts(HERE / "relax.in", HERE, OUT / f"bed-{name}.log", {**variables, "floormesh": floor, "tiles": laid, "dump": dump, "restart": part})
        laid.unlink()
        np.save(granules, read_final(dump))
        dump.unlink()
        rows = [r for t in logs.parse_log(log) for r in [dict(zip(t.columns, t.rows[-1]))]]
        print(f"  {name}: {rows[-1]['Atoms']:,.0f} granules, kinetic energy {rows[-1]['KinEng']:.3g} J, fastest "
              f"{1e3 * rows[-1]['fastest']:.3g} mm/s; {time.monotonic() - began:.0f} s", flush=True)

    restart = beds.made(OUT / f"bed-{name}.restart", recipe, make)
    return {"restart": restart, "floor": floor, "granules": granules, "sides": sides, "hash": hashlib.sha1(recipe.encode()).hexdigest()}


def first_touch(granules, x, y):
    """Height (m) at which the centre of a ball that falls along z touches its first granule."""
    d2 = (granules["x"] - x)**2 + (granules["y"] - y)**2
    below = d2 < (BALL + granules["radius"])**2
    return float((granules["z"][below] + np.sqrt((BALL + granules["radius"][below])**2 - d2[below])).max())


def drop_of(made_bed):
    """Where the ball starts, and the height of the highest granule (m), as a deck's variables."""
    before = np.load(made_bed["granules"])
    touch = first_touch(before, made_bed["sides"][0] / 2, made_bed["sides"][1] / 2)
    return {"z": f"{touch + FALL:.12g}", "top": f"{before['z'].max():.12g}"}


def asleep_bed(name):
    """The culled restart file of a bed: a bed put to sleep under a ball, or laid of one."""
    file = OUT / f"asleep-{name}.restart"
    if name in LAID:
        copies, of = LAID[name]
        source, made_of = asleep_bed(of), BEDS[of][0]
        floor, sides = OUT / f"floor-{name}.stl", sides_of(copies)
        recipe = "\n".join([json.dumps([copies, made_of, ELEMENT, TOP]), *(f.read_text() for f in sorted(Path(tiles.__file__).parent.glob("*.py"))),
                            beds.recipe_of(source["restart"])])

        def make(part):
            write_floor(floor, sides)
            began = time.monotonic()
            of_tiles = Source(source["restart"], made_of, PERIOD, MARGIN, Floor(source["floor"]))
            walls = number_of((HERE / "asleep.in").read_text(), box_of(sides, 2 * of_tiles.radius, TOP), engine.find_launcher(), HERE,
                              {"floormesh": floor, "L": sides[0], "W": sides[1]})
            laid = laid_beds.lay(of_tiles, part, copies, Floor(floor), TOP, walls=walls)
            print(f"  {name}: {laid:,} granules laid in {time.monotonic() - began:.0f} s", flush=True)
        made = {**source, "floor": floor, "sides": sides, "granules": None}
    else:
        made = bed(name)
        copies, made = BEDS[name][0], {**made, **drop_of(made)}
        variables = {"granules": GRANULES * copies[0] * copies[1], "L": made["sides"][0], "W": made["sides"][1], "z": made["z"],
                     "top": made["top"], "culling": SLEEP, "steps": DOZE}
        recipe = "\n".join([json.dumps(variables), text_of("doze.in", "scene.in", "ball.in", "material.in", "bed.in"), made["hash"],
                            engine.hash_of_fix(engine.find_launcher())])

        def make(part):
            engine.run_liggghts(HERE / "doze.in", HERE, OUT / f"asleep-{name}.log",
                                {**variables, "restart": made["restart"], "floormesh": made["floor"], "culled": part})
    beds.made(file, recipe, make)
    return {**made, "restart": file, "hash": hashlib.sha1(recipe.encode()).hexdigest()}


# --- runs -----------------------------------------------------------------------------------------------------------

def busy_seconds():
    """What all cores of the machine have worked so far (s)."""
    words = [int(w) for w in Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:]]
    return (words[0] + words[1] + words[2] + words[5] + words[6]) / os.sysconf("SC_CLK_TCK")


def memory_of(pid):
    """VmRSS and VmHWM (MB), or none when the process has ended."""
    try:
        status = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return None
    sizes = [re.search(rf"{key}:\s+(\d+)", status) for key in ("VmRSS", "VmHWM")]
    return [int(s[1]) / 1024 for s in sizes] if all(sizes) else None


def run_engine(deck, log, variables):
    """Runs a deck and watches it: the text of its log, and the figures of the process."""
    samples, busy, before = [], busy_seconds(), time.monotonic()

    def watch(process):
        if not samples or time.monotonic() - before - samples[-1][0] > SAMPLE:
            if now := memory_of(process.child.pid):
                samples.append([round(time.monotonic() - before, 2), *now])
    process = engine.Process(engine.find_launcher(), deck, HERE, log, variables, screen=log.with_suffix(".screen"))
    text = process.wait(watch)
    thinned = samples[::max(1, len(samples) // 500)]
    return text, {"wall": process.wall, "others_busy": max(0.0, (busy_seconds() - busy - process.cpu) / process.wall), "memory": thinned,
                  "peak_mb": max((s[2] for s in samples), default=0), "cpu": process.cpu}


def deck_of(scene, kind):
    """The lines of one run's deck; what hangs on the fix is left out of an unculled one."""
    if kind == "control":
        return decks.read_deck(HERE / "control.in") + [f'print "{logs.TO_HERE}"'] + decks.end_of_deck("${final}")
    if kind == "asleep":
        scene = "asleep"
    lines = decks.make_deck(decks.read_deck(HERE / f"{scene}.in"), "cull", kind in CULLED, None, "${base}")
    lines = [line for line in lines if "twin_counts" not in line]
    return [line.replace("${base}.final", "${final}") for line in lines]


def window(granules, sides):
    """The granules of the square of impact.BOX around the middle, moved to where the bed of examples/impact is."""
    near = np.ones(len(granules), dtype=bool)
    for axis, side in zip("xy", sides):
        near &= abs(granules[axis] - side / 2) < impact.BOX / 2
    granules = granules[near]
    for axis, side in zip("xy", sides):
        granules[axis] -= side / 2 - impact.BOX / 2
    return granules


def crater(before, after, sides, within=np.inf):
    """Volume (m^3) that the surface around the middle, as far as `within` (m), has lost and gained."""
    near = (struck.bed_of(window(granules, sides), impact.STRIKER) for granules in (before, after))
    return measures.crater(*near, (impact.BOX, impact.BOX), struck.CELL, within)


def figures_of(scene, kind, text, made_bed, final, loads):
    """What is compared, and what a culled run says of itself."""
    main = max((t for t in logs.parse_log(text) if t.loop_time is not None), key=lambda t: len(t.rows))
    columns = {c: np.array([row[k] for row in main.rows]) for k, c in enumerate(main.columns)}
    floor = columns["floor"][1:]  # the row before the first step counts the mesh's load twice
    figures = {"loop_time": main.loop_time, "steps": int(columns["Step"][-1] - columns["Step"][0])}
    if final:
        granules, before = read_final(final), np.load(made_bed["granules"])
        moved = granules[granules["id"] <= len(before)]
        figures.update(granules=len(granules), mass=float(granules["mass"].sum()),
                       ids=hashlib.sha1(granules["id"].astype(np.int64).tobytes()).hexdigest())
    else:
        figures["granules"] = int(columns["Atoms"][-1] + columns["cull[3]"][-1])
    if scene == "impact":
        figures["metrics"] = {
            "depth, end (m)": columns["depth"][-1], "depth, largest (m)": columns["depth"].max(),
            "force on ball, largest (N)": columns["force"].max(), "floor load, largest rise (N)": floor.max() - floor[0],
            "floor load, end (N)": floor[-1], "kinetic energy, largest (J)": columns["bedke"].max()}
        if final:
            lost, gained = crater(before, granules, made_bed["sides"])
            figures["metrics"].update({"crater volume (m3)": lost, "heap volume (m3)": gained})
            figures["crater_near"] = crater(before, granules, made_bed["sides"], NEAR)[0]
        if loads.exists():
            figures["element_loads"] = [round(float(x), 7) for x in element_normal_loads(loads)]
    else:
        drift = np.sqrt(sum((moved[c] - before[c])**2 for c in "xyz"))
        figures["metrics"] = {"kinetic energy, largest (J)": columns["bedke"].max(), "floor load, end (N)": floor[-1],
                              "largest displacement (m)": drift.max()}
    figures["metrics"] = {name: float(value) for name, value in figures["metrics"].items()}
    if kind in CULLED:
        figures.update({name: float(columns[f"cull[{k}]"].mean()) for k, name in enumerate(("exterior", "interface", "interior", "bodies"), 1)})
        figures["exterior_rows"] = [columns["Step"].astype(int).tolist(), columns["cull[1]"].astype(int).tolist()]
        figures["said"] = re.findall(r"^fix cull solid/cull: (.*)$", text, re.M)[-2:]
        parts = re.search(r"in the fix since it was made: (.*)$", figures["said"][-1]) if figures["said"] else None
        figures["parts"] = {name: float(value) for name, value in (w.rsplit(" ", 1) for w in parts[1].split(", "))} if parts else {}
        figures["seconds"] = sum(figures["parts"].values())
        # what LIGGGHTS holds and what the store holds, and the fix's own counts: smallest and largest over the rows
        wholes = columns["Atoms"] + columns["cull[3]"], columns["cull[1]"] + columns["cull[2]"] + columns["cull[3]"]
        figures["wholes"] = [[float(w.min()), float(w.max())] for w in wholes]
    return figures


def what_is_broken(run, text, granules):
    """What a run of a few steps shows to be broken in its deck, as words; none if nothing is."""
    broken = [name for name, value in run["metrics"].items() if not math.isfinite(value)]
    if not logs.reached_the_end(text):
        return "did not reach the end of its deck"
    if run["granules"] != granules:
        return f"ended with {run['granules']} granules, not {granules}"
    return f"has no number for {', '.join(broken)}" if broken else None


def check_few(run, text, granules, steps):
    """Raises RunError, one line, where a run of a few steps shows that its deck is broken."""
    wrong = what_is_broken(run, text, granules)
    if not wrong and run["steps"] != steps:
        wrong = f"made {run['steps']} steps, not {steps}"
    elif not wrong and run["kind"] in CULLED and run["wholes"] != [[granules, granules]] * 2:
        wrong = f"held {run['wholes']} granules on the way, not {granules}"
    elif not wrong and run["kind"] in CULLED and run["variables"]["culling"] == SLEEP and not run["interior"] > 0:
        wrong = "locked no granule"  # with a cover of its own the tiny bed may well lock none
    if wrong:
        raise errors.RunError(f"few steps: {run['name']} {wrong}")


def recipe_of(lines, files, variables, made_bed, kind):
    """What the figures of a run depend on, as a hash: its deck, the files that this includes, and what it is given."""
    return hashlib.sha1(json.dumps([decks.without_comments(lines), text_of(*files), variables, made_bed["hash"],
                                    engine.hash_of_fix(engine.find_launcher()) if kind in CULLED else ""]).encode()).hexdigest()


def kept_run(file, recipe, table):
    """The figures that a run has left, if they are of this recipe, or `table` wants what is there; else none."""
    old = json.loads(file.read_text()) if file.exists() else None
    return {**old, "stale": old["recipe"] != recipe} if old and (table or old["recipe"] == recipe and not few_steps) else None


def keep(file, run):
    """Leaves a run's figures in the file, whole or not at all."""
    file.with_suffix(".part").write_text(json.dumps(run) + "\n")
    file.with_suffix(".part").rename(file)
    return {**run, "stale": False}


def one_run(scene, size, kind, k, settings, of=""):
    """The figures of a run: kept ones, when they are of the same decks, bed and launcher; else it runs. of: goes into its name."""
    made_bed = asleep_bed(size) if kind == "asleep" else bed(size)
    place = OUT / "runs"
    place.mkdir(exist_ok=True)
    name = "-".join([scene, size, kind, *([of] if of else []), str(k + 1)])
    kept, deck, final = place / f"{name}.json", place / f"{name}.in", place / f"{name}.final"
    elements = place / f"{name}-floor-*.vtk"
    copies = (BEDS.get(size) or LAID[size])[0]
    variables = {"granules": GRANULES * copies[0] * copies[1], "L": made_bed["sides"][0], "W": made_bed["sides"][1],
                 **({"steps": settings.steps} if settings.steps else {})}
    if scene == "impact":
        steps = settings.steps or 8000
        drop = {key: made_bed[key] for key in ("z", "top")} if kind == "asleep" else drop_of(made_bed)
        variables.update(dx=SHIFTS[k], **drop, every=steps // 2)
    if kind == "control":
        variables["reach"] = settings.reach
    if kind in CULLED:
        variables["culling"] = settings.culling
    lines = deck_of(scene, kind)
    if size in LAID:  # a bed of this size is not to be atoms at the end
        lines = [line for line in lines if "${final}" not in line and not line.startswith("unfix cull")]
    recipe = recipe_of(lines, ("scene.in", "ball.in", "material.in", "bed.in"), variables, made_bed, kind)
    if old := kept_run(kept, recipe, settings.table):
        return old
    if settings.table:
        return None
    deck.write_text("\n".join(lines).replace("${final}", str(final)) + "\n")  # no variable is put into quotes
    for file in [final, *place.glob(elements.name)]:
        file.unlink(missing_ok=True)
    restart = made_bed["restart"]
    if kind == "asleep" and k:
        restart = place / f"{name}.restart"
        culled_files.with_ball_moved(made_bed["restart"], restart, SHIFTS[k])
    text, watched = run_engine(deck, place / f"{name}.log", {
        **variables, "restart": restart, "floormesh": made_bed["floor"], "final": final, "elements": elements})
    steps = sorted(place.glob(elements.name), key=lambda f: int(f.stem.rsplit("-", 1)[1]))
    run = {"name": name, "scene": scene, "size": size, "kind": kind, "date": time.strftime("%Y-%m-%d %H:%M"), "recipe": recipe,
           "variables": variables, **watched, **figures_of(scene, kind, text, made_bed, None if size in LAID else final, steps[-1] if steps else place / "none")}
    if few_steps:
        check_few(run, text, variables["granules"] + (scene == "impact"), settings.steps)
    final.unlink(missing_ok=True)
    if restart != made_bed["restart"]:
        restart.unlink()
    run = keep(kept, run)
    print(f"  {name}: {run['loop_time']:.1f} s, with what is before {run['wall']:.1f} s, peak {run['peak_mb']:.0f} MB", flush=True)
    return run


# --- the comparison -------------------------------------------------------------------------------------------------

def steady_mb(run):
    """Memory (MB) in the second half of a run."""
    rows = [m for t, m, _ in run["memory"] if t > run["wall"] / 2] or [run["peak_mb"]]
    return statistics.median(rows)


def own_time(run):
    """Seconds of the loop in which the run had a core: what others on the machine took is not in it."""
    return run["loop_time"] * min(1.0, run["cpu"] / run["wall"])


def summary(runs):
    first = runs[0]
    result = {"runs": [r["name"] for r in runs], "stale": [r["name"] for r in runs if r["stale"]], "loop_times": [r["loop_time"] for r in runs], "own_times": list(map(own_time, runs)),
              "loop_time": statistics.median(r["loop_time"] for r in runs), "own_time": statistics.median(map(own_time, runs)),
              "others_busy": [r["others_busy"] for r in runs], "steps": first["steps"], "granules": first["granules"], "wall": statistics.median(r["wall"] for r in runs),
              "cpu": statistics.median(r["cpu"] for r in runs),
              "peak_mb": max(r["peak_mb"] for r in runs), "steady_mb": statistics.median(map(steady_mb, runs))}
    result["granule_steps_per_s"] = first["granules"] * first["steps"] / result["loop_time"]
    if "exterior" in first:
        for name in ("exterior", "interface", "interior", "seconds"):
            result[name] = statistics.fmean(r[name] for r in runs)
        result["parts"] = {name: statistics.fmean(r["parts"].get(name, 0.0) for r in runs) for name in first["parts"]}
        result["said"] = first["said"]
    return result


def compared(runs, kind):
    """Speed-up and errors of one kind against the unculled runs."""
    unculled, own = runs["unculled"], runs[kind]
    result = {"speed_up": statistics.median(map(own_time, unculled)) / max(1e-9, statistics.median(map(own_time, own)))}
    if kind in CULLED:
        result["over_exterior"] = unculled[0]["granules"] / statistics.fmean(r["exterior"] for r in own)
        result["efficiency"] = result["speed_up"] / result["over_exterior"]
    result["lost"] = max((unculled[0]["granules"] - r["granules"] for r in own), key=abs)
    result["ids_good"] = all(r["ids"] == unculled[0]["ids"] for r in own)
    result["metrics"] = {}
    for name in unculled[0]["metrics"]:
        result["metrics"][name] = comparisons.judged([r["metrics"][name] for r in unculled], [r["metrics"][name] for r in own])
    if all("crater_near" in r for r in unculled + own):  # runs that were kept may be older
        result["crater_near"] = [statistics.fmean(r["crater_near"] for r in rs) for rs in (unculled, own)]
    if all("element_loads" in r for r in unculled + own):
        a, b = (np.mean([r["element_loads"] for r in rs], axis=0) for rs in (unculled, own))
        result["element_loads"] = {"largest difference (N)": float(abs(a - b).max()), "mean load (N)": float(a.mean()),
                                   "largest load (N)": float(a.max())}
    return result


def table(report):
    lines = [f"{'size':>6} {'kind':>9} {'runs':>4} {'loop (s)':>10} {'on a core':>10} {'speed-up':>8} {'N / exterior':>12} {'efficiency':>10} "
             f"{'M granule-steps/s':>17} {'peak (kB/granule)':>17} {'steady':>7}"]
    for size, of_size in report.items():
        for kind, s in of_size["kinds"].items():
            c = of_size["against"].get(kind, {})

            def cell(key, width, form):
                return f"{format(c[key], form) if key in c else '-':>{width}}"
            lines.append(f"{size:>6} {kind:>9} {len(s['runs']):>4} {s['loop_time']:>10.1f} {s['own_time']:>10.1f} {cell('speed_up', 8, '.2f')} "
                         f"{cell('over_exterior', 12, '.1f')} {cell('efficiency', 10, '.2f')} {s['granule_steps_per_s'] / 1e6:>17.2f} "
                         f"{1024 * s['peak_mb'] / s['granules']:>17.2f} {1024 * s['steady_mb'] / s['granules']:>7.2f}")
    for size, of_size in report.items():
        for kind, c in of_size["against"].items():
            lines += ["", f"{size} {kind}: granules lost {c['lost']}, ids {'as unculled' if c['ids_good'] else 'NOT AS UNCULLED'}"]
            lines += [f"  {row}" for row in tables.metric_rows(c["metrics"])]
            if "crater_near" in c:
                lines.append(f"  crater within {1000 * NEAR:g} mm (m3): {c['crater_near'][0]:.6g} unculled, {c['crater_near'][1]:.6g} {kind}")
            if "element_loads" in c:
                lines.append("  load on an element of the floor: " + ", ".join(f"{k} {v:.4g}" for k, v in c["element_loads"].items()))
        for kind in CULLED:
            if s := of_size["kinds"].get(kind):
                lines += [f"  {kind}: whole run {s['wall']:.1f} s, {s['cpu']:.1f} s of a core, peak {s['peak_mb'] / 1024:.2f} GiB"]
                lines += [f"  {kind}: {line}" for line in s["said"]]
        for kind in of_size["kinds"]:
            lines += [f"  {note}" for note in of_size["notes"][kind]]
    return "\n".join(lines)


def note(run):
    others = "alone" if run["others_busy"] < 0.1 else f"beside others that kept {run['others_busy']:.1f} cores busy"
    if run["cpu"] < 0.97 * run["wall"]:
        others += f"; it had a core for only {100 * run['cpu'] / run['wall']:.0f} % of the time"
    return f"{run['name']}: {run['date']}, {run['loop_time']:.1f} s, {others}{'; OF OTHER DECKS OR ANOTHER LAUNCHER' if run['stale'] else ''}"


def plot(report, file):
    fig, ax = plots.plt.subplots(figsize=(6, 4.5))
    for kind, style in (("unculled", "o-"), ("culled", "s-"), ("asleep", "d-"), ("control", "^--")):
        points = [(s["granules"], s["loop_time"]) for r in report.values() for k, s in r["kinds"].items() if k == kind]
        if points:
            ax.loglog(*zip(*points), style, label="frozen by hand" if kind == "control" else kind)
    ax.set(xlabel="granules", ylabel="loop time (s)")
    ax.legend()
    ax.grid(alpha=0.3, which="both")
    plots.save(fig, file)


def main(argv=None):
    global few_steps
    p = argparse.ArgumentParser(prog="scale.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--sizes", help="default: 20k,160k,1.28M; also: 10.24M, asleep alone")
    p.add_argument("--only", default="", help="unculled, culled, asleep or control, or several; default all but asleep (--idle: no control)")
    p.add_argument("--runs", type=int, default=1, help=f"of each kind, 1 to {len(SHIFTS)}; three unculled give the noise floor")
    p.add_argument("--culling", default=SLEEP, help="the keywords of the fix")
    p.add_argument("--reach", type=float, default=0.04, help="m: what the control lets move around the impact")
    p.add_argument("--steps", type=int, help="default: 8000, --idle 10000")
    p.add_argument("--idle", action="store_true")
    p.add_argument("--beds", action="store_true", help="makes the beds, runs nothing")
    p.add_argument("--table", action="store_true")
    p.add_argument("--publish", action="store_true", help="keeps the figures with the sources: results.json, RESULTS.md, README.md")
    p.add_argument("--few-steps", action="store_true")
    settings = p.parse_args(argv)
    if settings.publish and (settings.idle or settings.few_steps or settings.steps or settings.culling != SLEEP):
        p.error("--publish takes the strike as it is, and none of --idle, --few-steps, --steps, --culling")
    few_steps = settings.few_steps
    if few_steps:
        globals().update(FEW)
        settings.steps = settings.steps or 120  # the ball touches after some 50
    sizes = settings.sizes.split(",") if settings.sizes else [b for b in BEDS if not b.endswith(HELPERS)] + (list(LAID) if few_steps else [])
    asked = settings.only or ",".join(KINDS if few_steps else [k for k in KINDS if k != "asleep"])
    kinds = [k for k in KINDS if k in asked.split(",") and not (settings.idle and k in ("asleep", "control"))]
    if unknown := [s for s in sizes if s not in BEDS and s not in LAID] or [k for k in settings.only.split(",") if k and k not in KINDS]:
        p.error(f"unknown: {', '.join(unknown)}; sizes are {', '.join([*BEDS, *LAID])}, kinds {', '.join(KINDS)}")
    if settings.idle:
        sizes = [s for s in sizes if s not in LAID]
    if not 1 <= settings.runs <= len(SHIFTS):
        p.error(f"--runs is 1 to {len(SHIFTS)}")
    OUT.mkdir(parents=True, exist_ok=True)
    scene = "idle" if settings.idle else "impact"
    report = {}
    for size in sizes:
        own_kinds = ["asleep"] if size in LAID else kinds
        if settings.table and not (OUT / f"{'asleep' if size in LAID else 'bed'}-{size}.restart").exists():
            continue
        asleep_bed(size) if "asleep" in own_kinds else bed(size)
        if settings.beds:
            continue
        print(f"=== {size}, {scene}", flush=True)
        # unculled runs that are there are compared with, whatever this call runs
        runs = {kind: [] for kind in KINDS}
        for k in range(settings.runs):
            for kind in own_kinds:
                run = one_run(scene, size, kind, k, settings)
                runs[kind] += [run] if run else []
        for kind in set(KINDS) - set(own_kinds) if size not in LAID else ():
            keep = argparse.Namespace(**{**vars(settings), "table": True})
            runs[kind] = [r for k in range(len(SHIFTS)) if not (scene == "idle" and kind in ("asleep", "control")) if (r := one_run(scene, size, kind, k, keep))]
        there = [kind for kind in KINDS if runs[kind]]
        report[size] = {"kinds": {kind: summary(runs[kind]) for kind in there},
                        "against": {kind: compared(runs, kind) for kind in there if kind != "unculled" and runs["unculled"]},
                        "notes": {kind: [note(r) for r in runs[kind]] for kind in there}}
    if settings.beds:
        return 0
    name = "idle" if settings.idle else "scale"
    (OUT / f"{name}.json").write_text(json.dumps(report, indent=1) + "\n")
    text = table(report)
    (OUT / f"{name}.txt").write_text(text + "\n")
    plot(report, OUT / f"{name}.png")
    print("\n" + text)
    lost = any(c["lost"] or not c["ids_good"] for r in report.values() for c in r["against"].values()) or \
        any(r["kinds"]["asleep"]["granules"] != LAID[size][0][0] * LAID[size][0][1] * GRANULES + 1 for size, r in report.items() if size in LAID)
    if settings.publish:
        published.refuse(lost, [name for r in report.values() for s in r["kinds"].values() for name in s["stale"]])
        published.publish([*published.strike_records(report), *published.asleep_records(report)])
    return 1 if lost else 0


if __name__ == "__main__":
    errors.command("scale", main)
