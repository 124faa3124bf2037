"""A gas of granules: nothing touches anything for long."""
import numpy as np

from solidcull_runs import measures

deck = "gas.in"
of_both = {"small": 0.0024, "large": 0.0028, "dt": 5e-5, "skin": 0.002, "relax": 200}
quick = {**of_both, "granules": 6000, "L": 0.2, "steps": 12000}
full = {**of_both, "granules": 20000, "L": 0.3, "steps": 20000, "frames": 1000}
aside = "aside"


def measure(run, v):
    energy = measures.kinetic_energy(run)
    return {"kinetic energy": energy.mean(), "energy left at half time": energy[len(energy) // 2] / energy[0], "energy left": energy[-1] / energy[0],
            "centre, sideways": np.average(run.final["x"], weights=run.final["mass"])}


def laws(values):
    half, end = (values[""][name] for name in ("energy left at half time", "energy left"))
    return [("slowing, whole over half time", (end**-0.5 - 1) / (half**-0.5 - 1), "2, Haff 1983: energy falls as (1 + t/t0)^-2")]
