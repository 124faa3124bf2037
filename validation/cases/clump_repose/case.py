"""Columns of clumps, and of spheres of the same volume, collapse and come to rest as a slope."""
import numpy as np

from solidcull_runs import measures, meshes

deck, bed = "spread.in", "pour.in"
bed_uses = ("bed_granules", "L", "W", "room", "dt", "high", "spheres", "rolling")
grains = {"dt": 1e-4, "skin": 0.002, "rolling": 0}
quick = {**grains, "granules": 4500, "bed_granules": 1500, "L": 0.18, "W": 0.08, "room": 0.5, "high": 0.6}  # granules: spheres
full = {**grains, "granules": 21000, "bed_granules": 7000, "L": 0.3, "W": 0.15, "room": 0.8, "high": 0.8}
scenes = {"quick": {"clumps": {"spheres": 3}, "spheres": {"spheres": 1, "granules": 1500}},
          "full": {"clumps": {"spheres": 3}, "spheres": {"spheres": 1, "granules": 7000}}}
aside = "aside"
paper = False  # it keeps no clumps
curves = {"duration": "c_ke"}
picture = ("y", 0.5, 1)
D = 0.0117    # m: a granule
CELL = 0.002  # m, of the height map


def files(folder, v):
    meshes.write_stl(folder / "floor.stl", meshes.grid((-0.001, -0.001, 0), (v["L"] + v["room"], 0, 0), (0, v["W"] + 0.002, 0), 24, 2))


def measure(run, v):
    """The slope is fitted to the mean profile over the width, from 0.2 to 0.8 of its length."""
    length = v["L"] + v["room"]
    height = measures.height_map(run.final, (0, 0), (length, v["W"]), CELL).mean(axis=1)
    x = (np.arange(len(height)) + 0.5) * CELL
    front = x[np.argmax(np.convolve(height, np.full(5, 0.2), "same") < D / 2)]
    flank = (x > 0.2 * front) & (x < 0.8 * front)
    t, energy = (run.series(c)[1] for c in ("time", "c_ke"))
    lively = t[energy > 0.05 * energy.max()]
    moved = np.linalg.norm([run.final[c] - run.start[c] for c in "xyz"], axis=0)
    return {"angle of repose": np.degrees(np.arctan(-np.polyfit(x[flank], height[flank], 1)[0])), "run-out": front / v["L"] - 1,
            "final height": height[:round(2 * D / CELL)].mean(), "undisturbed core": (moved < D).mean(),
            "duration": lively[-1] - lively[0]}


def laws(values):
    clumps, spheres = (values[s]["angle of repose"] for s in ("clumps", "spheres"))
    return [("angle of clumps over that of spheres", clumps / spheres, "above 1, Wensrich and Katterfeld 2012")]
