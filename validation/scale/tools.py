#!/usr/bin/python3
"""Tools in the beds of scale.py: what a blade, a block, a wheel and a second pour cost, culled and unculled, in two sizes of bed.

    validation/scale/tools.py [--sizes 20k,160k] [--only blade,block,wheel,pour] [--runs n] [--culling KEYWORDS] [--table] [--publish] [--few-steps]

Runs each tool's deck (tool_NAME.in) unculled and culled, in turns, each on one core, and prints speed, counts and errors. Who moves is
counted in the unculled runs: by more than a hundredth of a diameter between two looks, 200 steps apart. Runs are kept in out/tools/ and
used again while decks, bed and (culled) launcher are the same. All figures: out/tools.json, table out/tools.txt.
`--publish`: keeps the figures with the sources, see published.py. `--few-steps`: tiny beds, a few steps, always run anew; what can be checked then is.
Exit: 0 all runs there and no granule lost, 1 else, 2 a run failed.
"""
import argparse
import hashlib
import json
import re
import statistics

import numpy as np

import published
import scale
from solidcull_runs import decks, errors, logs, meshes, metrics, tables  # scale.py has made them known
from solidcull_runs.dumps import read_final, snapshots
from solidcull_runs.surfaces import height_map

DIAMETER = 0.0026              # m: mean
MOVED = 0.01 * DIAMETER        # m, between two looks: who does more moves
CELL = 0.001                   # m, of the map of the surface
AROUND = 0.07                  # m: the square of that map, around the bed's middle

# what a deck is given, and with --few-steps
TOOLS = {
    "blade": ({"begin": -0.017, "depth": 0.010, "plunge": 0.15, "path": 0.024, "speed": 0.15, "wide": 0.018, "high": 0.04},
              {"begin": 0, "depth": 0.0015, "plunge": 1.5, "path": 0.003, "speed": 1.5, "wide": 0.006, "high": 0.02}),
    "block": ({"begin": 0, "depth": 0.006, "speed": 0.12, "hold": 1500, "after": 500, "wide": 0.018, "high": 0.03},
              {"begin": 0, "depth": 0.001, "speed": 1.5, "hold": 20, "after": 20, "wide": 0.006, "high": 0.02}),
    "wheel": ({"begin": -0.018, "depth": 0.004, "plunge": 0.15, "path": 0.024, "speed": 0.15, "slip": 0.3, "wide": 0.018, "R": 0.012},
              {"begin": -0.001, "depth": 0.001, "plunge": 1.5, "path": 0.002, "speed": 1.5, "slip": 0.3, "wide": 0.006, "R": 0.004}),
    "pour": ({"begin": 0, "poured": 600, "spout": 0.012, "depth": 0, "over": 0.115, "steps": 9000},
             {"begin": 0, "poured": 20, "spout": 0.005, "depth": 0, "over": 0.118, "steps": 80})}
THICK = 0.003                  # m, of the blade


def write_mesh(name, file, v):
    """The tool, its lowest point in the origin; the wheel its axle."""
    half = v["wide"] / 2
    if name == "wheel":
        meshes.write_stl(file, np.array(meshes.drum(v["R"], v["wide"], 36)) - [0, half, 0])
    else:
        deep = THICK / 2 if name == "blade" else half
        meshes.write_stl(file, meshes.block((-deep, -half, 0), (deep, half, v["high"])))


def surface_change(before, after, sides):
    """How much higher the surface around the middle has become, on a grid of cells (m)."""
    size = [min(AROUND, s) for s in sides]
    low = [(s - a) / 2 for s, a in zip(sides, size)]
    return height_map(after, low, size, CELL) - height_map(before, low, size, CELL)


def figures_of(name, columns, before, after, sides):
    """What is compared of one run."""
    change = surface_change(before, after, sides)
    up, down = change[change > 0].sum() * CELL**2, -change[change < 0].sum() * CELL**2
    floor = columns["mean" if name == "pour" else "mean[3]"][1:]
    figures = {"floor load, largest (N)": floor.max(), "floor load, end (N)": floor[-1]}
    if name == "pour":
        return {**figures, "heap volume (m3)": up, "height gained at the top (m)": change.max()}
    side, lift, x, z = (columns[c] for c in ("mean[1]", "mean[2]", "tool[7]", "tool[9]"))
    work = -(lift[1:] * np.diff(z))[np.diff(z) < 0].sum()
    far = x > x[0] + 0.4 * (x[-1] - x[0])
    if name == "block":
        held = np.flatnonzero(z < z.min() + 1e-9)
        return {**figures, "largest force (N)": lift[1:].max(), "work on the way down (J)": work,
                "force on hold (N)": lift[held[len(held) // 2:]].mean(), "hollow (m3)": down}
    if name == "wheel":
        return {**figures, "load (N)": lift[far].mean(), "pull (N)": side[far].mean(), "torque (N m)": columns["mean[4]"][far].mean(),
                "work on the way down (J)": work, "rut (m3)": down}
    return {**figures, "drag (N)": -side[far].mean(), "work on the way down (J)": work, "heap volume (m3)": up, "furrow (m3)": down}


def movers(file):
    """Granules that move between two looks at the places of all, mean over the looks."""
    counts, last = [], None
    for _, columns, rows in snapshots(file):
        rows = rows[np.argsort(rows[:, 0])]
        if last is not None:
            n = len(last)  # what was poured since is not in the first look
            both = rows[:n] if len(rows) == n else rows[np.isin(rows[:, 0], last[:, 0])]
            counts.append(int((np.sqrt(((both[:, 1:] - last[:, 1:])**2).sum(axis=1)) > MOVED).sum()) + len(rows) - len(both))
        last = rows
    return statistics.fmean(counts) if counts else 0.0


def joined(text):
    """Columns of all the thermo tables between the fix line and the end of the deck, as one series; their loop time (s)."""
    found = [t for t in logs.parse_log(text) if t.counted and t.loop_time is not None]
    names = found[0].columns
    rows = np.array([row for n, t in enumerate(found) for row in t.rows[n > 0:]])
    return dict(zip(names, rows.T)), sum(t.loop_time for t in found)


def output_time(text):
    """Seconds of writing in all loops of a log."""
    return sum(float(s) for s in re.findall(r"^Outpt time \(%\) = (\S+)", text, re.M))


def one_run(name, size, kind, k, settings):
    """The figures of a run: kept ones, when they are of the same deck, bed and launcher; else it runs."""
    made_bed = scale.bed(size)
    place = scale.OUT / "tools"
    place.mkdir(exist_ok=True)
    base = f"{name}-{size}-{kind}-{k + 1}"
    kept, deck, final, places = (place / f"{base}.{suffix}" for suffix in ("json", "in", "final", "places"))
    given = TOOLS[name][bool(settings.few_steps)]
    copies = scale.BEDS[size][0]
    before = np.load(made_bed["granules"])
    variables = {**given, "granules": scale.GRANULES * copies[0] * copies[1], "L": made_bed["sides"][0], "W": made_bed["sides"][1],
                 "top": f"{(before['z'] + before['radius']).max():.12g}", "aside": scale.SHIFTS[k], "culling": settings.culling,
                 **({"every": 20} if settings.few_steps else {})}
    lines = decks.make_deck(decks.read_deck(scale.HERE / f"tool_{name}.in"), "cull", kind == "culled", None, "${base}")
    drop = ("twin_counts", *(() if kind == "unculled" and k == 0 else ("dump places", "undump places")))
    lines = [line.replace("${base}.final", "${final}") for line in lines if not any(word in line for word in drop)]
    recipe = scale.recipe_of(lines, ("tool.in", "scene.in", "material.in", "bed.in"), variables, made_bed, kind)
    if old := scale.kept_run(kept, recipe, settings.table):
        return old
    if settings.table:
        return None
    deck.write_text("\n".join(lines).replace("${final}", str(final)) + "\n")
    files = {"restart": made_bed["restart"], "floormesh": made_bed["floor"], "places": places}
    if name != "pour":
        files["mesh"] = place / f"{name}{'-few' if settings.few_steps else ''}.stl"
        write_mesh(name, files["mesh"], given)
    text, watched = scale.run_engine(deck, place / f"{base}.log", {**variables, **files})
    columns, loop_time = joined(text)
    after = read_final(final)
    run = {"name": base, "recipe": recipe, "variables": {k: str(x) for k, x in variables.items()}, **watched,
           "loop_time": loop_time - output_time(text), "steps": int(columns["Step"][-1] - columns["Step"][0]),
           "granules": len(after), "ids": hashlib.sha1(after["id"].astype(np.int64).tobytes()).hexdigest(),
           "metrics": {n: float(x) for n, x in figures_of(name, columns, before, after, made_bed["sides"]).items()}}
    if places.exists():
        run["movers"] = movers(places)
        places.unlink()
    if kind == "culled":
        run.update({n: float(columns[f"cull[{c}]"].mean()) for c, n in ((1, "exterior"), (2, "interface"), (3, "interior"))})
        run.update(culled=float(columns["cull[6]"][-1]), restored=float(columns["cull[7]"][-1]), carves=float(columns["cull[8]"][-1]))
        run["said"] = re.findall(r"^fix cull solid/cull: (.*)$", text, re.M)[-2:]
    final.unlink()
    if settings.few_steps:
        wrong = scale.what_is_broken(run, text, variables["granules"] + given.get("poured", 0))
        if wrong or run.get("movers") == 0:
            raise errors.RunError(f"few steps: {base} {wrong or 'moved no granule'}")
    run = scale.keep(kept, run)
    print(f"  {base}: {run['loop_time']:.1f} s", flush=True)
    return run


def compared(unculled, culled):
    """Speed, counts and errors of one tool in one bed."""
    def mean(what):
        return statistics.fmean(r[what] for r in culled)
    own_time = [statistics.median(map(scale.own_time, runs)) for runs in (unculled, culled)]
    n, steps, moving = unculled[0]["granules"], unculled[0]["steps"], unculled[0]["movers"]
    return {"runs": [len(unculled), len(culled)], "stale": [r["name"] for r in (*unculled, *culled) if r["stale"]], "times": own_time, "speed_up": own_time[0] / own_time[1], "movers": moving,
            "exterior": mean("exterior"), "interface": mean("interface"), "over_movers": (mean("exterior") + mean("interface")) / max(1, moving),
            "restored": mean("restored") / n * 1e4 / steps, "steps": steps,
            "lost": max((n - r["granules"] for r in culled), key=abs), "ids_good": all(r["ids"] == unculled[0]["ids"] for r in culled),
            "metrics": {m: metrics.judged([r["metrics"][m] for r in unculled], [r["metrics"][m] for r in culled]) for m in unculled[0]["metrics"]}}


def table(report):
    lines = [f"{'size':>6} {'tool':>6} {'runs':>5} {'steps':>6} {'unculled (s)':>12} {'culled (s)':>10} {'faster':>6} {'who move':>8} {'exterior':>8} "
             f"{'interface':>9} {'atoms / movers':>14} {'restored per granule in 10,000 steps':>36}"]
    for (size, name), c in report.items():
        lines.append(f"{size:>6} {name:>6} {c['runs'][0]:>2} {c['runs'][1]:>2} {c['steps']:>6} {c['times'][0]:>12.1f} {c['times'][1]:>10.1f} {c['speed_up']:>6.2f} "
                     f"{c['movers']:>8.0f} {c['exterior']:>8.0f} {c['interface']:>9.0f} {c['over_movers']:>14.2f} {c['restored']:>36.2f}")
    for (size, name), c in report.items():
        lines += ["", f"{size} {name}: granules lost {c['lost']}, ids {'as unculled' if c['ids_good'] else 'NOT AS UNCULLED'}"]
        lines += [f"  {row}" for row in tables.metric_rows(c["metrics"])]
    return "\n".join(lines)


def main(argv=None):
    p = argparse.ArgumentParser(prog="tools.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--sizes", help="beds of scale.py; default 20k,160k")
    p.add_argument("--only", default=",".join(TOOLS), help="tools; default all")
    p.add_argument("--runs", type=int, default=1, help=f"of each kind, 1 to {len(scale.SHIFTS)}; three and more give the noise floor")
    p.add_argument("--culling", default=scale.SLEEP, help="the keywords of the fix")
    p.add_argument("--table", action="store_true", help="runs nothing, prints what is there")
    p.add_argument("--publish", action="store_true", help="keeps the figures with the sources: results.json, RESULTS.md, README.md")
    p.add_argument("--few-steps", action="store_true")
    settings = p.parse_args(argv)
    if settings.publish and (settings.few_steps or settings.culling != scale.SLEEP):
        p.error("--publish takes the tools as they are, and neither --few-steps nor --culling")
    scale.few_steps = settings.few_steps
    if settings.few_steps:
        vars(scale).update(scale.FEW)
    sizes = (settings.sizes or ("tiny" if settings.few_steps else "20k,160k")).split(",")
    names = settings.only.split(",")
    if unknown := [s for s in sizes if s not in scale.BEDS] + [n for n in names if n not in TOOLS]:
        p.error(f"unknown: {', '.join(unknown)}; beds are {', '.join(scale.BEDS)}, tools {', '.join(TOOLS)}")
    if not 1 <= settings.runs <= len(scale.SHIFTS):
        p.error(f"--runs is 1 to {len(scale.SHIFTS)}")
    scale.OUT.mkdir(parents=True, exist_ok=True)
    report = {}
    for size in sizes:
        for name in names:
            runs = {kind: [] for kind in ("unculled", "culled")}
            for k in range(settings.runs):
                for kind in runs:
                    runs[kind] += [r for r in [one_run(name, size, kind, k, settings)] if r]
            if all(runs.values()):
                copies = scale.BEDS[size][0]
                report[size, name] = {"bed": scale.GRANULES * copies[0] * copies[1], **compared(*runs.values())}
    text = table(report)
    (scale.OUT / "tools.json").write_text(json.dumps({f"{s} {n}": c for (s, n), c in report.items()}, indent=1) + "\n")
    (scale.OUT / "tools.txt").write_text(text + "\n")
    print("\n" + text)
    lost = any(c["lost"] or not c["ids_good"] for c in report.values())
    if settings.publish:
        published.refuse(lost, [name for c in report.values() for name in c["stale"]])
        published.publish(published.tool_records(report))
    return 1 if lost else 0


if __name__ == "__main__":
    errors.command("tools", main)
