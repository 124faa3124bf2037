"""Columns of three aspect ratios collapse in a channel."""
import numpy as np

from solidcull_runs import measures, meshes

deck, bed = "collapse.in", "../../shared/pour.in"
bed_uses = ("bed_granules", "L", "W", "room", "small", "large", "dt", "low", "high", "pour", "damp", "free")
grains = {"small": 0.0048, "large": 0.0056, "dt": 1e-4, "skin": 0.002, "low": -0.01, "high": 1.6, "pour": 0.4, "damp": 0.4, "free": 0.2}
quick = {**grains, "granules": 3000, "bed_granules": 3000, "W": 0.08, "room": 0.8, "steps": 6000}
full = {**grains, "granules": 20000, "bed_granules": 20000, "W": 0.15, "room": 1.5, "steps": 7500, "pour": 0.6}
production = {**full, "granules": 160000, "bed_granules": 160000, "W": 0.3, "room": 3.0, "steps": 10600, "high": 3.2, "pour": 0.85, "damp": 0.5, "frames": 400}
# its length L goes with the aspect ratio
scenes = {"quick": {"a = 1": {"L": 0.192}, "a = 0.5": {"L": 0.272}, "a = 2": {"L": 0.136}},
          "full": {"a = 1": {"L": 0.362}, "a = 0.5": {"L": 0.512}, "a = 2": {"L": 0.256}},
          "production": {"a = 1": {"L": 0.724}}}
aside = "aside"
# above a plane of 30 degrees, about the final slope, through the gate's foot
by_hand = "plane $L 0 0 0.5 0 0.866"
curves = {"duration": "c_ke"}
picture = ("y", 0.5, 1)
D = 0.0104   # m: a granule
CELL = 0.002  # m, of the height map


def files(folder, v):
    meshes.write_stl(folder / "floor.stl", meshes.grid((-0.001, -0.001, 0), (v["L"] + v["room"], 0, 0), (0, v["W"] + 0.002, 0), 24, 2))


def profile(granules, v):
    """Mean height over the width, at x in steps of CELL."""
    return measures.height_map(granules, (0, 0), (v["L"] + v["room"], v["W"]), CELL).mean(axis=1)


def measure(run, v):
    before, after = profile(run.start, v), profile(run.final, v)
    front = CELL * np.argmax(np.convolve(after, np.full(5, 0.2), "same") < D / 2)
    t, energy = (run.series(c)[1] for c in ("time", "c_ke"))
    lively = t[energy > 0.05 * energy.max()]
    moved = np.linalg.norm([run.final[c] - run.start[c] for c in "xyz"], axis=0)
    wall = round(2 * D / CELL)
    return {"run-out": front / v["L"] - 1, "final height": after[:wall].mean(), "undisturbed core": (moved < D).mean(),
            "duration": lively[-1] - lively[0], "aspect ratio": before[:round(v["L"] / CELL)].mean() / v["L"]}


def laws(values):
    found = []
    for name, v in values.items():
        a = v["aspect ratio"]
        found.append((f"run-out over a, {name}", v["run-out"] / a, "1.2, Lube et al. 2005"))
    return found
