"""A large ball strikes a bed, after the penetration benchmark of Dosta et al. 2024; the deck is that of slow_impact."""
import numpy as np

from solidcull_runs import meshes

deck, bed = "../slow_impact/impact.in", "../../shared/pour.in"
bed_uses = ("bed_granules", "L", "W", "small", "large", "E", "mu", "restitution", "dt", "pour", "damp", "free")
of_both = {"small": 0.001, "large": 0.001, "skin": 0.0004, "E": 2e7, "mu": 0.3, "restitution": 0.5, "dt": 1e-5, "rho": 2500,
           "drop": 2**2 / (2 * 9.81), "damp": 0.12, "free": 0.06}
quick = {**of_both, "granules": 6001, "bed_granules": 6000, "L": 0.04, "W": 0.04, "ball": 0.01, "pour": 0.12, "steps": 3200}
full = {**of_both, "granules": 50001, "bed_granules": 50000, "L": 0.08, "W": 0.08, "ball": 0.02, "pour": 0.16, "steps": 4200}
aside = "aside"
by_hand = "sphere $(v_L/2) $(v_W/2) ${top} $(0.4*v_L)"
curves = {"depth": "v_depth", "peak force on the ball": "v_force", "peak rise of the floor's load": "v_floor"}
picture = ("y", 0.5, 0.002)


def files(folder, v):
    meshes.write_stl(folder / "floor.stl", meshes.grid((-0.001, -0.001, 0), (v["L"] + 0.002, 0, 0), (0, v["W"] + 0.002, 0), 8, 8))


def measure(run, v):
    t, depth, fall, force, floor = (run.series(c)[1] for c in ("time", "v_depth", "c_fall", "v_force", "v_floor"))
    slower = np.argmax(fall > fall[0] / 2) + 1
    return {"depth": depth.max(), "time to half the speed": np.interp(fall[0] / 2, fall[:slower], t[:slower]) - t[0], "depth at the end": depth[-1],
            "peak force on the ball": force.max(), "peak rise of the floor's load": floor.max() - floor[0]}
