"""Gravity goes for a while and comes back: a bed springs up and falls back."""
import numpy as np

from solidcull_runs import measures, meshes

deck, bed = "switch.in", "../../shared/pour.in"
bed_uses = ("bed_granules", "L", "W", "small", "large", "dt", "pour")
of_both = {"small": 0.0024, "large": 0.0028, "dt": 5e-5, "skin": 0.001, "relax": 200, "rest": 300, "pour": 0.2, "without": 1000}
quick = {**of_both, "granules": 6000, "bed_granules": 6000, "L": 0.125, "W": 0.125, "after": 2200}
full = {**of_both, "granules": 20000, "bed_granules": 20000, "L": 0.2, "W": 0.2, "after": 3500}
aside = "aside"
curves = {"floor's peak load": "v_floor"}


def files(folder, v):
    meshes.write_stl(folder / "floor.stl", meshes.grid((-0.0009, -0.0009, 0), (v["L"] + 0.0018, 0, 0), (0, v["W"] + 0.0018, 0), 4, 4))


def measure(run, v):
    floor, z = measures.series(run, "v_floor"), measures.centre(run, "z")
    return {"peak kinetic energy": measures.kinetic_energy(run).max(), "rise of the centre": z.max() - z[0], "floor's peak load": floor.max(),
            "floor's load at the end": floor[-len(floor) // 10:].mean(), "height of the centre": np.average(run.final["z"], weights=run.final["mass"])}
