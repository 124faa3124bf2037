"""The strike of examples/impact at the seam of a box that is periodic in x and y."""
import numpy as np

from solidcull_runs import measures, meshes

deck, bed = "seam_impact.in", "settle.in"
bed_uses = ("bed_granules", "L")
quick = {"granules": 6001, "bed_granules": 6000, "L": 0.05, "steps": 2500}
full = {"granules": 20001, "bed_granules": 20000, "L": 0.075, "steps": 8000}
aside = "dx"
curves = {"largest depth": "v_depth", "mean kinetic energy": "c_bedke", "peak load on the floor": "v_floor"}
picture = ("y", 0.5, 0.005)
CELL = 5e-4  # m, of the height map


def files(folder, v):
    meshes.write_stl(folder / "floor.stl", meshes.grid((0, 0, 0), (v["L"], 0, 0), (0, v["L"], 0), 4, 4))


def measure(run, v):
    side = v["L"]
    depth, force, energy, floor = (run.series(c)[1] for c in ("v_depth", "v_force", "c_bedke", "v_floor"))
    after, before = (height_map(g[g["radius"] < 0.005], side) for g in (run.final, run.start))
    change = (after - before) * CELL**2
    apart = [run.final[c] - run.start[c] for c in "xyz"]
    apart[:2] = [d - side * np.round(d / side) for d in apart[:2]]  # the nearest image
    way = np.sqrt(sum(d**2 for d in apart))[run.final["radius"] < 0.005]
    return {"largest depth": depth.max(), "depth at the end": depth[-1], "peak force on the ball": force.max(),
            "mean kinetic energy": energy.mean(), "peak kinetic energy": energy.max(), "peak load on the floor": floor.max(),
            "load on the floor at the end": floor[-1], "sum of displacements": way.sum(), "crater": -change[change < 0].sum(),
            "heap": change[change > 0].sum()}


def height_map(granules, side):
    """With the ball's place in the middle, where its crater is whole."""
    moved = granules.copy()
    moved["x"] = (moved["x"] + side / 2) % side
    return measures.height_map(moved, (0, 0), (side, side), CELL)
