"""A bed on a floor that shakes it, below and above 1 g."""
import numpy as np

from solidcull_runs import measures, meshes

deck, bed = "shake.in", "../../shared/pour.in"
bed_uses = ("bed_granules", "L", "W", "small", "large", "dt", "pour")
of_both = {"small": 0.0024, "large": 0.0028, "dt": 5e-5, "skin": 0.001, "relax": 200, "rest": 300, "pour": 0.2, "frequency": 20, "peak": 0.5}
quick = {**of_both, "granules": 6000, "bed_granules": 6000, "L": 0.125, "W": 0.125, "cycles": 2, "after": 800}
full = {**of_both, "granules": 20000, "bed_granules": 20000, "L": 0.2, "W": 0.2, "cycles": 3, "after": 1200}
scenes = {"0.5 g": {}, "2 g": {"peak": 2}}
aside = "aside"
curves = {"floor's mean load": "v_floor"}


def files(folder, v):
    meshes.write_stl(folder / "floor.stl", meshes.grid((-0.0009, -0.0009, 0), (v["L"] + 0.0018, 0, 0), (0, v["W"] + 0.0018, 0), 4, 4))


def measure(run, v):
    t, floor = measures.time(run), measures.series(run, "v_floor")
    energy = measures.kinetic_energy(run)
    shaken = (t >= v["rest"] * v["dt"]) & (t <= t[-1] - v["after"] * v["dt"])
    late = t >= t[-1] - v["after"] * v["dt"] / 2
    return {"peak kinetic energy": energy.max(), "mean kinetic energy": energy[shaken].mean(), "floor's peak load": floor.max(),
            "floor's mean load": floor[shaken].mean(), "floor's load after it": floor[late].mean(),
            "height of the centre": np.average(run.final["z"], weights=run.final["mass"])}
