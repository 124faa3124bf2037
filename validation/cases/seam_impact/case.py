"""The ball of slow_impact falls at the seam of a box that is periodic in x and y."""
import numpy as np

from solidcull_runs import measures, meshes

deck, bed, bed_uses = "../slow_impact/impact.in", "../../shared/pour.in", ("bed_granules", "L", "W", "sides", "planes", "around")
periodic = {"sides": "p", "planes": 0, "around": 0, "middle": 0.004}  # of L: the ball reaches over the seam
quick = {"granules": 6001, "bed_granules": 6000, "L": 0.05, "W": 0.05, "steps": 2800, **periodic}
full = {"granules": 20001, "bed_granules": 20000, "L": 0.075, "W": 0.075, "steps": 6000, **periodic}
aside = "aside"
curves = {"depth": "v_depth", "peak force on the ball": "v_force", "peak rise of the floor's load": "v_floor"}
picture = ("y", 0.5, 0.004)
CELL = 5e-4  # m, of the height map


def files(folder, v):
    meshes.write_stl(folder / "floor.stl", meshes.grid((0, 0, 0), (v["L"], 0, 0), (0, v["W"], 0), 8, 8))


def measure(run, v):
    size = v["L"], v["W"]
    depth, force, floor = (run.series(c)[1] for c in ("v_depth", "v_force", "v_floor"))
    start, end = (g[g["radius"] < 0.004] for g in (run.start, run.final))
    change = (height_map(end, size) - height_map(start, size)) * CELL**2
    apart = [end[c] - start[c] for c in "xyz"]
    for d in (0, 1):
        apart[d] -= size[d] * np.round(apart[d] / size[d])  # the nearest image
    return {"depth": depth.max(), "peak force on the ball": force.max(), "peak rise of the floor's load": floor.max() - floor[0],
            "sum of displacements": np.sqrt(sum(d**2 for d in apart)).sum(), "crater": -change[change < 0].sum(),
            "heap": change[change > 0].sum()}


def height_map(granules, size):
    """With the ball's place in the middle, where its crater is whole."""
    moved = granules.copy()
    moved["x"] = (moved["x"] + size[0] / 2) % size[0]
    return measures.height_map(moved, (0, 0), size, CELL)
