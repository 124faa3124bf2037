"""A wheel rolls over a bed at a given sinkage and slip; with less slip for the law."""
import numpy as np

from solidcull_runs import measures, meshes

deck, bed = "wheel.in", "../../shared/pour.in"
bed_uses = ("bed_granules", "L", "W", "small", "large", "dt", "low", "high", "pour", "damp", "free")
grains = {"small": 0.0048, "large": 0.0056, "dt": 1e-4, "skin": 0.002, "low": -0.01, "high": 0.8, "pour": 0.3, "damp": 0.4, "free": 0.2}
quick = {**grains, "granules": 3600, "bed_granules": 3600, "L": 0.32, "W": 0.13, "R": 0.06, "wide": 0.05, "start": 0.1,
         "path": 0.08, "speed": 0.25, "lower": 0.2}
full = {**grains, "granules": 20000, "bed_granules": 20000, "L": 0.7, "W": 0.24, "R": 0.1, "wide": 0.08, "start": 0.15,
        "path": 0.13, "speed": 0.25, "lower": 0.2, "sink": 0.02}
scenes = {"slip 0.3": {}, "slip 0.1": {"slip": 0.1}}
aside = "aside"
by_hand = "block $(v_start-0.09) $(v_start+v_path+0.1) INF INF $(v_surface-v_sink-0.04) INF"
curves = {"load": "f_mean[2]", "torque": "f_mean[3]"}
picture = ("y", 0.5, 1)


def files(folder, v):
    meshes.write_stl(folder / "floor.stl", meshes.grid((-0.001, -0.001, 0), (v["L"] + 0.002, 0, 0), (0, v["W"] + 0.002, 0), 12, 6))
    corners = np.array(meshes.drum(v["R"], v["wide"], 36))
    meshes.write_stl(folder / "wheel.stl", corners + [0, (v["W"] - v["wide"]) / 2, 0])


def measure(run, v):
    pull, load, torque, x = (run.series(c)[1] for c in ("f_mean[1]", "f_mean[2]", "f_mean[3]", "f_wheel[7]"))
    path = x[-1] - x[0]
    far = x > x[0] + 0.4 * path
    cell, y = 0.002, (v["W"] - v["wide"]) / 2
    low, size = (v["start"] + 0.2 * path, y), (0.5 * path, v["wide"])
    before, after = (measures.height_map(g, low, size, cell) for g in (run.start, run.final))
    return {"pull over load": pull[far].mean() / load[far].mean(), "load": load[far].mean(), "torque": torque[far].mean(),
            "rut": (before - after).mean()}


def laws(values):
    high, low = (values[s]["pull over load"] for s in scenes)
    return [("pull over load, gained from slip 0.1 to 0.3", high - low, "above 0, Wong 2008")]
