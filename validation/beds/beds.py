#!/usr/bin/python3
"""Beds that solidcull-bed lays, beside beds that LIGGGHTS pours whole in the same box.

    validation/beds/beds.py [--beds N] [--sizes nine,twenty] [--time 1M,10M] [--table] [--few-steps]

Five laid beds of 3 x 3 and of 5 x 4 tiles, and five poured ones in the box of 3 x 3, each of a seed of its own. Figures and margins: figures.py. Each laid bed is
then run for 1,000 steps by the deck that the program wrote. `--time` makes large beds and keeps their seconds. Every bed's figures are
kept in out/, so that an interrupted series goes on. Writes results.json and RESULTS.md, not with `--few-steps`.
Exit: 0 all beds there, 1 a granule lost, too many awake or the floor's load off, 2 a run failed.
"""
import argparse
import json
import math
import os
import shutil
import statistics
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))
import figures  # noqa: E402
from solidcull_runs import engine, errors, logs  # noqa: E402
from solidcull_runs.beds_on_demand import handed_over, material, plan, wanted  # noqa: E402
from solidcull_runs.beds_on_demand.pieces import Pieces  # noqa: E402
from solidcull_runs.dumps import read_final  # noqa: E402
from solidcull_runs.few_steps import finite  # noqa: E402
from solidcull_runs.validation import verdicts  # noqa: E402

OUT, KEPT, PAGE = HERE / "out", HERE / "results.json", HERE / "RESULTS.md"
SIZES = "0.0012:0.6135,0.0014:0.3865"            # half of the mass is of either
DENSITY, GRAVITY = 2500.0, 9.81
EDGE, GRANULES = 0.0300267, 1760                 # m, and granules, of a tile
COPIES = {"nine": (3, 3), "twenty": (5, 4)}
TILE, DEPTH, STEPS = 10, 0.03, 1000              # least edge of a tile in largest diameters; m, about
LARGE = {"1M": (16, 16), "10M": (51, 50)}            # tiles of the largest beds, of the same pieces
LARGE_TILE, LARGE_EDGE, LARGE_DEPTH = 16, 0.0452, 0.03
LAID_SEED, OTHER_SEED = 20, 1000                 # before the first of the laid beds, and of the poured ones
AWAKE, FLOOR_OFF = 0.001, 0.001                  # allowed after 1,000 steps
FEW = {"TILE": 8, "EDGE": 0.0225, "DEPTH": 0.0115, "GRANULES": 400, "COPIES": {"nine": (3, 3)}, "OUT": OUT / "few"}


def plan_of(name, copies, seed, depth=None, tile=None, edge=None):
    r = 0.0014
    sides = [round(n * (edge or EDGE) + 2 * plan.MARGIN * 2 * r, 6) for n in copies]
    granules = None if depth else GRANULES * copies[0] * copies[1]
    w = wanted.Wanted(OUT / f"{name}.restart", *sides, depth, granules, wanted.read_sizes(SIZES), DENSITY,
                      material.read_material(HERE / "material.in"), tile or TILE, None, seed)
    wanted.refuse(w)
    return plan.Plan(w)


def quiet(line):
    pass


def kept(name, make):
    file = OUT / f"{name}.json"
    if not file.exists():
        print(f"  {name}", flush=True)
        found = make()
        file.write_text(json.dumps(found) + "\n")
    return json.loads(file.read_text())


def facts_of(folder):
    """Seconds on a core of each piece."""
    return {f.stem: json.loads(f.read_text())["on a core"] for f in folder.glob("*.json")}


def run_deck(name, text):
    deck = OUT / f"{name}.run.in"
    deck.write_text(text)
    return engine.run_liggghts(deck, OUT, OUT / f"{name}.run.log")


def last_table(text, column):
    table = [t for t in logs.parse_log(text) if column in t.columns and t.rows][-1]
    return {c: [row[k] for row in table.rows] for k, c in enumerate(table.columns)}


def laid(size, k):
    """Figures of a laid bed, and what its deck says of it for STEPS steps."""
    name = f"laid-{size}-{k}"

    def make():
        p = plan_of(name, COPIES[size], k + LAID_SEED)
        if p.copies != COPIES[size]:
            raise errors.RunError(f"{name} has {p.copies[0]} x {p.copies[1]} tiles, not {COPIES[size]}")
        told = handed_over.make(p, OUT / f"pieces-{k}", engine.find_launcher(), quiet)
        seconds = sum(facts_of(OUT / f"pieces-{k}").values()) + told["laying, on a core (s)"]
        text = (OUT / f"{name}.in").read_text()
        later = last_table(run_deck(name, text.replace("steps index 1000", f"steps index {STEPS}")), "onfloor")
        dump = OUT / f"{name}.dump"
        run_deck(name, text.replace("run ${steps}", f"run 0\nthermo_style custom step atoms\nunfix cull\nrun 0\nwrite_dump all custom {dump} id mass radius x y z modify format "
                                    '"%d %.15g %.15g %.15g %.15g %.15g"'))
        bed = read_final(dump)
        dump.unlink()
        (OUT / f"{name}.restart").unlink()
        sides = (p.wanted.length, p.wanted.width)
        return {"granules": len(bed), "due": told["granules"], "seconds": seconds, "sides": sides,
                "figures": figures.figures(bed, sides, DEPTH, GRAVITY, p.margin), "floor": figures.floor_load(bed), "weight": float(bed["mass"].sum() * GRAVITY),
                "floor later": later["onfloor"][-1], "awake": later["cull[1]"][-1] / len(bed),
                "floor said": told["load on the floor (N)"]}
    return kept(name, make)


def poured(k):
    """Figures of a box of nine tiles that is poured whole, of as many granules as the laid one has."""
    name = f"poured-nine-{k}"

    def make():
        p = plan_of(name, COPIES["nine"], k + OTHER_SEED)
        sides = (p.wanted.length, p.wanted.width)
        pieces = Pieces(OUT / f"pieces-{name}", p, engine.find_launcher(), quiet)
        _, facts = pieces.poured("box", p.wanted.granules, sides, walls=True)
        bed = read_final(pieces.folder / "box.dump")
        shutil.rmtree(pieces.folder)
        return {"granules": len(bed), "seconds": facts["on a core"], "figures": figures.figures(bed, sides, DEPTH, GRAVITY, p.margin)}
    return kept(name, make)


def large(name):
    """Seconds of a large bed from nothing: of its pieces, which large beds share, and of laying it. Its files are removed."""
    def make():
        p = plan_of(name, LARGE[name], 1, LARGE_DEPTH, LARGE_TILE, LARGE_EDGE)
        folder, began = OUT / "pieces-large", time.monotonic()
        told = handed_over.make(p, folder, engine.find_launcher(), lambda line: print(f"  {line} at {time.monotonic() - began:.0f} s", flush=True))
        pieces = facts_of(folder)
        tile = json.loads((folder / "tile.json").read_text())
        variables = p.pour(1, (1, 1), True)
        found = {"granules": told["granules"], "pieces": pieces, "tile": tile["granules"], "laying": told["laying, on a core (s)"], "bytes": (OUT / f"{name}.restart").stat().st_size,
                 "recipe steps": sum(variables[s] for s in ("poursteps", "dampsteps", "freesteps")), "date": time.strftime("%Y-%m-%d"),
                 "whole s": time.monotonic() - began, "load": round(os.getloadavg()[0], 1)}
        found["seconds"] = sum(pieces.values()) + found["laying"]
        began = time.monotonic()
        rows = last_table(run_deck(name, (OUT / f"{name}.in").read_text()), "onfloor")
        found["run"] = {"seconds": time.monotonic() - began, "awake": rows["cull[1]"][-1] / told["granules"],
                        "floor later": rows["onfloor"][-1], "floor said": told["load on the floor (N)"],
                        "weight": told["weight (N)"]}
        (OUT / f"{name}.restart").unlink()
        return found
    return kept(name, make)


# --- what it says -----------------------------------------------------------------------------------------------------

def judged(one, other):
    """By figure: poured mean, laid mean, difference in %, margin in %, verdict."""
    found = {}
    for name in one[0]["figures"]:
        before, after = ({k: bed["figures"][name] for k, bed in enumerate(beds)} for beds in (one, other))
        mean = statistics.fmean(before.values())
        margin = figures.margin_of(name)
        v = verdicts.two_one_sided_tests(before, after, margin * abs(mean))
        found[name] = {"poured": mean, "scatter": 100 * statistics.stdev(before.values()) / mean, "laid": statistics.fmean(after.values()),
                       "off": 100 * v.difference / mean, "low": 100 * v.low / mean, "high": 100 * v.high / mean, "margin": 100 * margin, "verdict": v.word}
    return found


def page(report):
    lines = ["# beds: as measured", "", "Made by `beds.py` of results.json. [The page](README.md) says what is compared and which margins were stated before.", ""]
    for size, r in report.get("sizes", {}).items():
        copies = COPIES[size]
        lines += [f"## {copies[0]} x {copies[1]} tiles", "", f"{r['beds']} poured beds in the box of 3 x 3 tiles, and {r['beds']} laid ones of {r['granules']:,} granules on average.", "",
                  "| figure | poured | scatter | laid | off by | 90 % interval | margin | verdict |", "| --- | --- | --- | --- | --- | --- | --- | --- |"]
        for name, f in r["figures"].items():
            word = f["verdict"] if f["verdict"] == verdicts.SAME else f"**{f['verdict']}**"
            lines.append(f"| {name} | {f['poured']:.4g} | {f['scatter']:.2g} % | {f['laid']:.4g} | {f['off']:+.2f} % | {f['low']:+.2f} to "
                         f"{f['high']:+.2f} % | {f['margin']:g} % | {word} |")
        lines += ["", "| after 1,000 steps of the deck | largest of the laid beds | allowed |", "| --- | --- | --- |",
                  f"| share awake | {100 * r['awake']:.3g} % | {100 * AWAKE:g} % |",
                  f"| floor's load, off from what the note says | {100 * r['floor off']:.2g} % | {100 * FLOOR_OFF:g} % |",
                  f"| the same where the bed is woken | {100 * r['woken off']:.2g} % | |", "",
                  f"A laid bed took {r['laid s']:.0f} seconds on a core from nothing, median.", ""]
    if large_beds := report.get("large"):
        b = next(iter(large_beds.values()))
        speed = b["tile"] * b["recipe steps"] / b["pieces"]["tile"]
        lines += ["## Time", "", f"Seconds on a core. The tile of {b['tile']:,} granules was poured at {speed / 1e6:.2f} million granule-steps a second. "
                  "Pouring times are computed with that, and not measured.", "Larger beds are out of the cache and slower, so they are the least that pouring takes.", "",
                  "| granules | tile | nine at rest | asleep | laying | whole, from nothing | pouring, computed | sooner | file | awake after 1,000 steps | floor's load off |",
                  "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |"]
        for b in large_beds.values():
            pour = b["granules"] * b["recipe steps"] / speed
            run = b["run"]
            lines.append(f"| {b['granules']:,} | {b['pieces'].get('pilot', 0) + b['pieces']['tile']:.0f} s | {b['pieces']['base']:.0f} s | "
                         f"{b['pieces']['asleep']:.0f} s | {b['laying']:.0f} s | {b['seconds']:.0f} s | {pour:,.0f} s | {pour / b['seconds']:.0f} times | "
                         f"{b['bytes'] / 1e9:.2f} GB | "
                         + (f"{100 * run['awake']:.2g} % | {100 * abs(run['floor later'] / run['floor said'] - 1):.2g} % |" if run else "- | - |"))
        slowest = max(large_beds.values(), key=lambda b: b["whole s"])
        lines += ["", f"On the clock, {slowest['granules']:,} granules took {slowest['whole s']:.0f} s from nothing, beside other work: a load of "
                  f"{slowest['load']} on two cores.", "The other bed was laid of the same pieces.", ""]
    return "\n".join(lines)


def report_of(names, beds, times):
    report = {"sizes": {}, "large": {}}
    for size in names:
        one, other = [], []
        for k in range(1, beds + 1):
            one.append(poured(k))
            other.append(laid(size, k))
        report["sizes"][size] = {
            "beds": beds, "granules": round(statistics.fmean(b["granules"] for b in other)), "figures": judged(one, other) if beds > 1 else {},
            "awake": max(b["awake"] for b in other), "floor off": max(abs(b["floor later"] / b["floor said"] - 1) for b in other),
            "woken off": max(abs(b["floor"] / b["floor later"] - 1) for b in other), "lost": sum(b["due"] - b["granules"] for b in other),
            "laid s": statistics.median(b["seconds"] for b in other)}
    for name in times:
        report["large"][name] = large(name)
    return report


def main(argv=None):
    p = argparse.ArgumentParser(prog="beds.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--beds", type=int, default=5, help="of each kind")
    p.add_argument("--sizes", help="default: nine,twenty; with --time, none")
    p.add_argument("--time", default="", help="large beds: 1M, 10M or both")
    p.add_argument("--table", action="store_true", help="prints what results.json holds")
    p.add_argument("--few-steps", action="store_true")
    settings = p.parse_args(argv)
    if settings.table:
        print(page(json.loads(KEPT.read_text())))
        return 0
    if settings.few_steps:
        globals().update(FEW)
        settings.beds, settings.time = 2, ""
    sizes, times = [[w for w in words.split(",") if w] for words in (settings.sizes or ("" if settings.time else ",".join(COPIES)), settings.time)]
    if unknown := [s for s in sizes if s not in COPIES] + [t for t in times if t not in LARGE]:
        p.error(f"unknown: {', '.join(unknown)}; sizes are {', '.join(COPIES)}, large beds {', '.join(LARGE)}")
    if settings.beds < 2:
        p.error("--beds is 2 or more")
    shutil.rmtree(OUT, ignore_errors=True) if settings.few_steps else None
    OUT.mkdir(parents=True, exist_ok=True)
    report = report_of(sizes, settings.beds, times)
    if settings.few_steps:
        for r in report["sizes"].values():
            if not finite([f[c] for f in r["figures"].values() for c in ("poured", "laid", "off", "low", "high")]):
                raise errors.RunError("few steps: a figure is no number")
        (OUT / "beds.json").write_text(json.dumps(report, indent=1) + "\n")
    else:
        before = json.loads(KEPT.read_text()) if KEPT.exists() else {}
        report = {**before, **report, "sizes": {**before.get("sizes", {}), **report["sizes"]}, "large": {**before.get("large", {}), **report["large"]}}
        KEPT.write_text(json.dumps(report, indent=1) + "\n")
        PAGE.write_text(page(report))
    print(page(report))
    bad = any(r["lost"] or r["awake"] > AWAKE or r["floor off"] > FLOOR_OFF for r in report["sizes"].values())
    return 1 if bad else 0


if __name__ == "__main__":
    errors.command("beds", main)
