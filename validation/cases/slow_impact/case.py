"""A ball falls into a bed; heavier and from higher for the law."""
import math

import numpy as np

from solidcull_runs import measures, meshes

deck, bed, bed_uses = "impact.in", "../../shared/pour.in", ("bed_granules", "L", "W", "high", "pour", "damp")
quick = {"granules": 6001, "bed_granules": 6000, "L": 0.05, "W": 0.05, "steps": 2800}
full = {"granules": 20001, "bed_granules": 20000, "L": 0.075, "W": 0.075, "steps": 6000}
production = {"granules": 160001, "bed_granules": 160000, "L": 0.15, "W": 0.15, "high": 0.4, "pour": 0.25, "damp": 0.3, "steps": 6000, "frames": 400}
scenes = {"4000 kg/m3 from 0.1 m": {}, "15000 kg/m3": {"rho": 15000}, "from 0.2 m": {"drop": 0.2}}
aside = "aside"
by_hand = "sphere $(v_L/2) $(v_W/2) ${top} $(0.4*v_L)"
curves = {"depth": "v_depth", "peak force on the ball": "v_force", "peak rise of the floor's load": "v_floor"}
picture = ("y", 0.5, 0.004)


def files(folder, v):
    meshes.write_stl(folder / "floor.stl", meshes.grid((-0.001, -0.001, 0), (v["L"] + 0.002, 0, 0), (0, v["W"] + 0.002, 0), 8, 8))


def measure(run, v):
    t, depth, force, floor = (run.series(c)[1] for c in ("time", "v_depth", "v_force", "v_floor"))
    stopped = np.argmax(depth >= 0.95 * depth.max())
    bed, start = (g[g["radius"] < 0.004] for g in (run.final, run.start))
    lost, _ = measures.crater(start, bed, (v["L"], v["W"]), 5e-4)
    return {"depth": depth.max(), "stopping time": t[stopped] - t[0], "peak force on the ball": force.max(),
            "peak rise of the floor's load": floor.max() - floor[0], "crater": lost}


def laws(values):
    base, heavy, high = (values[s]["depth"] for s in scenes)
    return [("depth ~ density^p", math.log(heavy / base) / math.log(15000 / 4000), "p = 1/2, Uehara et al. 2003"),
            ("depth ~ drop^p", math.log(high / base) / math.log((0.2 + high) / (0.1 + base)), "p = 1/3, Uehara et al. 2003")]
