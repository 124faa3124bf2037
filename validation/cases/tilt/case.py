"""A leaning bed leans further and avalanches."""
import numpy as np

from solidcull_runs import measures

deck, bed = "tilt.in", "../../shared/pour.in"
bed_uses = ("bed_granules", "L", "W", "small", "large", "dt", "pour", "lean")
of_both = {"small": 0.0024, "large": 0.0028, "dt": 5e-5, "skin": 0.001, "relax": 200, "lean": 31, "pour": 0.2}
quick = {**of_both, "granules": 6000, "bed_granules": 6000, "L": 0.3, "W": 0.04, "rate": 25, "steps": 4000}
full = {**of_both, "granules": 20000, "bed_granules": 20000, "L": 0.5, "W": 0.06, "rate": 16, "steps": 7500, "frames": 300}
aside = "aside"
D = 0.0052  # m: mean diameter


def measure(run, v):
    angle, x, energy = measures.series(run, "v_angle"), measures.centre(run, "x"), measures.kinetic_energy(run)
    gone = x - x[0] > 0.05 * D
    return {"angle": angle[np.argmax(gone)] if gone.any() else angle[-1], "way of the centre": x[-1] - x[0], "peak kinetic energy": energy.max(),
            "height of the centre": np.average(run.final["z"], weights=run.final["mass"])}
