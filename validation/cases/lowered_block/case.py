"""A block is lowered into a bed, held, withdrawn."""
import numpy as np

from solidcull_runs import measures, meshes

deck, bed = "block.in", "../../shared/pour.in"
bed_uses = ("bed_granules", "L", "W", "small", "large", "dt", "low", "high", "pour", "damp", "free")
grains = {"small": 0.0048, "large": 0.0056, "dt": 1e-4, "skin": 0.002, "low": -0.01, "high": 0.8, "pour": 0.3, "damp": 0.4, "free": 0.2}
quick = {**grains, "granules": 3000, "bed_granules": 3000, "L": 0.24, "W": 0.16, "side": 0.05, "speed": 0.15, "hold": 800}
full = {**grains, "granules": 20000, "bed_granules": 20000, "L": 0.4, "W": 0.35, "side": 0.1, "depth": 0.04, "speed": 0.15, "hold": 1200, "after": 600}
aside = "aside"
by_hand = "sphere $(v_L/2) $(v_W/2) ${surface} $(1.7*v_side)"
curves = {"largest force": "f_mean"}
picture = ("y", 0.5, 1)


def files(folder, v):
    meshes.write_stl(folder / "floor.stl", meshes.grid((-0.001, -0.001, 0), (v["L"] + 0.002, 0, 0), (0, v["W"] + 0.002, 0), 12, 8))
    x, y, half = v["L"] / 2, v["W"] / 2, v["side"] / 2
    meshes.write_stl(folder / "block.stl", meshes.block((x - half, y - half, 0), (x + half, y + half, 0.06)))


def measure(run, v):
    force, z = (run.series(c)[1] for c in ("f_mean", "f_block[9]"))
    down, low = np.diff(z) < 0, np.flatnonzero(z < z.min() + 1e-9)
    cell, size = 0.002, (v["L"], v["W"])
    change = measures.height_map(run.final, (0, 0), size, cell) - measures.height_map(run.start, (0, 0), size, cell)
    return {"largest force": force[1:][down].max(), "work": -(force[1:] * np.diff(z))[down].sum(),
            "force on hold": force[low[len(low) // 2:]].mean(), "hollow": -change[change < 0].sum() * cell**2}
