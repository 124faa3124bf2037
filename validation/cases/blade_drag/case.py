"""A blade is plunged into a bed and dragged; at three depths for the law."""
import numpy as np

from solidcull_runs import measures, meshes

deck, bed = "blade.in", "../../shared/pour.in"
bed_uses = ("bed_granules", "L", "W", "small", "large", "dt", "low", "high", "pour", "damp", "free")
grains = {"small": 0.0048, "large": 0.0056, "dt": 1e-4, "skin": 0.002, "low": -0.01, "high": 0.8, "pour": 0.3, "damp": 0.4, "free": 0.2}
quick = {**grains, "granules": 3200, "bed_granules": 3200, "L": 0.28, "W": 0.12, "wide": 0.05, "start": 0.07,
         "path": 0.06, "speed": 0.2, "plunge": 0.2}
full = {**grains, "granules": 20000, "bed_granules": 20000, "L": 0.5, "W": 0.3, "wide": 0.08, "start": 0.13,
        "path": 0.08, "speed": 0.2, "plunge": 0.2}
production = {**full, "granules": 160000, "bed_granules": 160000, "L": 1.41, "W": 0.85, "start": 0.65}
scenes = {"35 mm": {}, "25 mm": {"depth": 0.025}, "50 mm": {"depth": 0.05}}
aside = "aside"
by_hand = "block $(v_start-0.05) $(v_start+v_path+0.1) INF INF $(v_surface-v_depth-0.025) INF"
curves = {"drag": "f_mean[1]", "lift": "f_mean[2]"}
picture = ("y", 0.5, 1)
THICK = 0.005  # m


def files(folder, v):
    meshes.write_stl(folder / "floor.stl", meshes.grid((-0.001, -0.001, 0), (v["L"] + 0.002, 0, 0), (0, v["W"] + 0.002, 0), 12, 6))
    y = (v["W"] - v["wide"]) / 2
    meshes.write_stl(folder / "blade.stl", meshes.block((v["start"], y, 0), (v["start"] + THICK, y + v["wide"], 0.12)))


def measure(run, v):
    drag, lift, x, z = (run.series(c)[1] for c in ("f_mean[1]", "f_mean[2]", "f_blade[7]", "f_blade[9]"))
    far = x > x[0] + 0.4 * (x[-1] - x[0])
    cell, size = 0.002, (v["L"], v["W"])
    change = measures.height_map(run.final, (0, 0), size, cell) - measures.height_map(run.start, (0, 0), size, cell)
    return {"drag": drag[far].mean(), "lift": lift[far].mean(), "plunge work": -(lift[1:] * np.diff(z)).sum(),
            "heap": change[change > 0].sum() * cell**2}


def laws(values):
    depths = np.log([35, 25, 50])
    return [("drag ~ depth^p", np.polyfit(depths, np.log([values[s]["drag"] for s in scenes]), 1)[0], "p = 2, Albert et al. 1999, a rod")]
