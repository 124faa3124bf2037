"""The rung of Janssen's silo: a narrow silo is filled, and its floor bears less and less of what comes."""
import math
import re

import numpy as np
from scipy import optimize

import ladder_runs
from figures import Bars
from solidcull_runs import logs, meshes
from solidcull_runs.errors import RunError

SMALL, LARGE, DENSITY, GRAVITY = 0.0023, 0.0027, 2500, 9.81
ACROSS = 0.04            # m: the diameter, eight granules
BATCH, STAGES, STEPS, DT = 150, 14, 6000, 5e-5
FEW_BATCH, FEW_STAGES = 40, 2
SEEDS, FEW_SEEDS = (86028121, 86028157, 49979687), (86028121,)
LOOSE = 0.55             # solid fraction of what has come to rest, at least: a batch begins above it
ROOM = 0.05              # m: height of the space in which a batch is made
FACETS, RINGS = 32, 8
KINDS = ("without the line", "with it")
LAST = 10                # rows of a stage that count: it is at rest
BALANCE = 0.02           # of the weight: what floor and wall bear together, at rest
CURVE = 0.15             # of the load that the floor bears in the end
SATURATION = 0.1         # of the mass at which the floor has all but its full load: with the line against without


def tube(radius, height):
    """Triangles of a wall around z."""
    rim = [(radius * math.cos(a), radius * math.sin(a), 0.0) for a in 2 * np.pi * np.arange(FACETS) / FACETS]
    return [t for a, b in zip(rim, rim[1:] + rim[:1]) for t in meshes.grid(a, np.subtract(b, a), (0, 0, height), 1, RINGS)]


def run(kind, seed, batch, stages, place):
    """After each batch: granules, mass, height of their centre, loads of floor and wall in the end, share of granules that were exterior."""
    base = f"silo-{KINDS.index(kind)}-{seed}"
    floor, wall = (place / name for name in ("silo-floor.stl", f"silo-wall-{stages}.stl"))
    area = math.pi * ACROSS**2 / 4
    level = batch * (SMALL**3 + LARGE**3) * 2 / 3 * math.pi / (LOOSE * area)
    height = stages * level + ROOM + 2 * LARGE
    meshes.write_stl(floor, meshes.grid((-ACROSS, -ACROSS, 0), (2 * ACROSS, 0, 0), (0, 2 * ACROSS, 0), 1, 1))
    meshes.write_stl(wall, tube(ACROSS / 2, height))
    text = ladder_runs.run("silo.in", kind == KINDS[1], base, place, {
        "stages": stages, "batch": batch, "steps": STEPS, "dt": DT, "seed": seed, "floor": floor, "wall": wall, "small": SMALL, "large": LARGE,
        "density": DENSITY, "around": ACROSS / 2 + 0.002, "height": height + 0.001, "inside": ACROSS / 2, "level": level, "room": ROOM,
        "culling": "exterior sleep"})
    filled = [[float(word) for word in found.split()] for found in re.findall(r"^filled ([\d. e+-]+)$", text, re.M)]
    if len(filled) != stages:
        raise RunError(f"{base}: {len(filled)} of {stages} batches came to rest")
    found = []
    for (count, mass, middle), table in zip(filled, [t for t in logs.parse_log(text) if t.counted and len(t.rows) > LAST]):
        rows = np.array(table.rows)
        loads = [float(rows[-LAST:, table.column(name)].mean()) for name in ("v_onfloor", "v_onwall")]
        awake = table.column("f_cull[1]")
        found.append({"granules": int(count), "mass": mass, "middle": middle, "floor": loads[0], "wall": loads[1],
                      "exterior": None if awake is None else float(rows[:, awake].mean() / count)})
    return found


def janssen(mass, saturated):
    """The floor's load, as a mass."""
    return saturated * (1 - np.exp(-mass / saturated))


def fit(stages):
    """The mass at which the floor would bear no more (kg), how far the loads are from the curve (rms, as a share of it), and K mu."""
    mass, load = (np.array([s[name] for s in stages]) for name in ("mass", "floor"))
    (saturated,), _ = optimize.curve_fit(janssen, mass, load / GRAVITY, p0=[mass[-1] / 3])
    off = float(np.sqrt(np.mean((load / GRAVITY - janssen(mass, saturated))**2)) / saturated)
    bulk = mass[-1] / (2 * stages[-1]["middle"] * math.pi * ACROSS**2 / 4)  # a uniform column's middle is half its height
    return {"saturated": float(saturated), "off": off, "K mu": float(bulk * math.pi * ACROSS**3 / (16 * saturated))}


def climb(place, few):
    batch, stages, seeds = (FEW_BATCH, FEW_STAGES, FEW_SEEDS) if few else (BATCH, STAGES, SEEDS)
    report = {"runs": {kind: [run(kind, seed, batch, stages, place) for seed in seeds] for kind in KINDS}}
    report["fits"] = {kind: [fit(of) for of in report["runs"][kind]] for kind in KINDS}
    return {**report, "wrong": faults(report, few)}


def faults(report, few):
    bars = Bars("silo")
    for kind, runs in report["runs"].items():
        off = max(abs((s["floor"] + s["wall"]) / (s["mass"] * GRAVITY) - 1) for of in runs for s in of)
        bars.hold(off, BALANCE, f"{kind}, floor and wall together bear the weight but for")
    if not few:  # a silo of two batches is no Janssen's yet
        for kind, fits in report["fits"].items():
            bars.hold(max(f["off"] for f in fits), CURVE, f"{kind}, the floor's load is off Janssen's curve by")
        without, with_it = ([f["saturated"] for f in report["fits"][kind]] for kind in KINDS)
        scatter = np.ptp(without) / np.mean(without)
        bars.hold(abs(np.mean(with_it) / np.mean(without) - 1), max(SATURATION, scatter), "with the line, what the floor bears in the end is off by")
    return bars.missed


def page(report, page):
    page.heading(2, "Janssen's silo")
    page.text(f"Loads as masses (g): the mean of {len(report['runs'][KINDS[0]])} fillings, the least and the largest. *Exterior* is the mean share "
              "with the line, while a batch comes to rest.")

    def span(values):
        return f"{1e3 * np.mean(values):.1f} ({1e3 * min(values):.1f} to {1e3 * max(values):.1f})"
    first, seeds = report["runs"][KINDS[0]][0], range(len(report["runs"][KINDS[0]]))
    saturated = np.mean([f["saturated"] for f in report["fits"][KINDS[0]]])
    page.table(["granules", "filled", *(f"floor, {kind}" for kind in KINDS), "Janssen", "exterior"], [
        [stage["granules"], f"{1e3 * stage['mass']:.1f}", *(span([report["runs"][kind][n][k]["floor"] / GRAVITY for n in seeds]) for kind in KINDS),
         f"{1e3 * janssen(stage['mass'], saturated):.1f}", f"{100 * np.mean([of[k]['exterior'] for of in report['runs'][KINDS[1]]]):.0f} %"]
        for k, stage in enumerate(first)])
    page.table(["run", "floor bears in the end (g)", "off the curve", "K mu"], [
        [kind, span([f["saturated"] for f in fits]), f"{100 * max(f['off'] for f in fits):.1f} %", f"{np.mean([f['K mu'] for f in fits]):.3f}"]
        for kind, fits in report["fits"].items()])
