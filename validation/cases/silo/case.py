"""A silo with a flat floor at rest, then emptying through a slit; a wider slit for the law."""
import math

import numpy as np

from solidcull_runs import measures, meshes

deck, bed = "discharge.in", "../../shared/pour.in"
bed_uses = ("bed_granules", "L", "W", "small", "large", "dt", "low", "high", "pour")
of_both = {"small": 0.0024, "large": 0.0028, "dt": 5e-5, "skin": 0.001, "low": -0.15, "relax": 200, "rest": 500, "slit": 0.03}
quick = {**of_both, "granules": 6000, "bed_granules": 6000, "L": 0.18, "W": 0.03, "high": 0.35, "pour": 0.3, "steps": 2200}
full = {**of_both, "granules": 20000, "bed_granules": 20000, "L": 0.27, "W": 0.045, "high": 0.5, "pour": 0.35, "steps": 6000, "frames": 400}
scenes = {"slit of 30 mm": {}, "slit of 45 mm": {"slit": 0.045}}
aside = "aside"
curves = {"mass flow": "v_out", "floor's load, emptying": "v_floor", "right wall's load, emptying": "v_right"}
D, K = 0.0052, 1.4  # mean diameter (m); the slit is narrower by K of them


def files(folder, v):
    left, right = (v["L"] - v["slit"]) / 2, (v["L"] + v["slit"]) / 2
    def strip(begin, end, z=0.0): return meshes.grid((begin, -0.0009, z), (end - begin, 0, 0), (0, v["W"] + 0.0018, 0), 1, 1)
    meshes.write_stl(folder / "floor.stl", strip(-0.0009, left) + strip(right, v["L"] + 0.0009))
    meshes.write_stl(folder / "plug.stl", strip(left, right))
    meshes.write_stl(folder / "below.stl", strip(0, v["L"], -0.02))
    meshes.write_stl(folder / "right.stl", meshes.grid((v["L"], -0.0009, -0.145), (0, v["W"] + 0.0018, 0), (0, 0, v["high"] + 0.14), 1, 1))


def measure(run, v):
    t = measures.time(run)
    out, floor, right, whole = measures.series(run, "v_out", "v_floor", "v_right", "v_whole")
    resting = t < (v["rest"] + 0.5) * v["dt"]
    late = t >= t[resting][-1] + (t[-1] - t[resting][-1]) / 3
    way = np.sqrt(sum((run.final[c] - run.start[c])**2 for c in "xyz"))
    weight = 9.81 * run.start["mass"].sum()
    return {"floor's load at rest": whole[resting].mean() / weight, "right wall's load at rest": right[resting].mean(),
            "mass flow": np.polyfit(t[late], out[late], 1)[0], "floor's load, emptying": floor[late].mean(),
            "right wall's load, emptying": right[late].mean(), "what stays": run.final["mass"][way < D / 2].sum() / run.final["mass"].sum()}


def laws(values):
    narrow, wide = (values[s]["mass flow"] for s in scenes)
    return [("mass flow ~ (slit - 1.4 d)^p", math.log(wide / narrow) / math.log((0.045 - K * D) / (0.03 - K * D)), "p = 3/2, Beverloo et al. 1961"),
            ("floor's load at rest over the weight", values["slit of 30 mm"]["floor's load at rest"],
             "below 1, Janssen 1895: walls carry the rest")]
