"""A heap is fed on its top."""
import numpy as np

from solidcull_runs import measures, meshes

deck, bed = "feed.in", "build.in"
bed_uses = ("bed_granules", "L", "dt", "foot", "tall", "high", "sink")
grains = {"dt": 1e-4, "skin": 0.002}
quick = {**grains, "granules": 4000, "bed_granules": 3600, "fed": 400, "rate": 1150, "spout": 0.04,
         "L": 0.7, "W": 0.7, "foot": 0.15, "tall": 0.31, "high": 0.4, "sink": 7000, "feed": 3500, "rest": 1000}
full = {**grains, "granules": 100000, "bed_granules": 97600, "fed": 2400, "rate": 12000, "spout": 0.08,
        "L": 2.0, "W": 2.0, "foot": 0.45, "tall": 0.93, "high": 1.0, "sink": 12000, "feed": 2000, "rest": 500}
production = {**full, "granules": 320000, "bed_granules": 317600, "L": 2.9, "W": 2.9, "foot": 0.665, "tall": 1.38, "high": 1.45, "sink": 15000}
aside = "aside"
picture = ("y", 0.5, 1)
D, CELL = 0.0104, 0.004  # m: a granule; of the height map


def files(folder, v):
    meshes.write_stl(folder / "floor.stl", meshes.grid((-0.001, -0.001, 0), (v["L"] + 0.002, 0, 0), (0, v["L"] + 0.002, 0), 16, 16))


def measure(run, v):
    """The profile is the mean height over rings a granule wide."""
    end, middle = run.final, v["L"] / 2
    height = measures.height_map(end, (0, 0), (v["L"], v["L"]), CELL)
    at = (np.arange(len(height)) + 0.5) * CELL - middle
    ring = (np.hypot(*np.meshgrid(at, at, indexing="ij")) / D).astype(int)
    h = np.bincount(ring.ravel(), height.ravel()) / np.bincount(ring.ravel())
    r = (np.arange(len(h)) + 0.5) * D
    base = np.interp(-D / 2, -h[:np.argmax(h < D / 4) + 1], r[:np.argmax(h < D / 4) + 1])
    flank = (r > 0.2 * base) & (r < 0.8 * base)
    fed = end[end["id"] > run.start["id"].max()]
    return {"angle of repose": np.degrees(np.arctan(-np.polyfit(r[flank], h[flank], 1)[0])), "height at the centre": h[:2].mean(),
            "radius of the base": base, "reach of what was fed": np.median(np.hypot(fed["x"] - middle, fed["y"] - middle))}
