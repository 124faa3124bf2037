"""A door in the floor sinks a little, then opens."""
import numpy as np

from solidcull_runs import measures, meshes

deck, bed = "door.in", "../../shared/pour.in"
bed_uses = ("bed_granules", "L", "W", "small", "large", "dt", "low", "high", "pour")
of_both = {"small": 0.0024, "large": 0.0028, "dt": 5e-5, "skin": 0.001, "low": -0.15, "sink": 0.0026, "relax": 200, "rest": 300}
quick = {**of_both, "granules": 6000, "bed_granules": 6000, "L": 0.36, "W": 0.03, "high": 0.2, "pour": 0.2, "wide": 0.06, "sinking": 700,
         "hold": 300, "steps": 2400}
full = {**of_both, "granules": 20000, "bed_granules": 20000, "L": 0.54, "W": 0.045, "high": 0.3, "pour": 0.25, "wide": 0.09,
        "sinking": 1200, "hold": 500, "steps": 4500, "frames": 400}
aside = "aside"
by_hand = "block $(v_L/2-2*v_wide) $(v_L/2+2*v_wide) INF INF INF INF"
curves = {"discharged": "v_out", "door's load, sunk": "v_door"}
D = 0.0052  # m: mean diameter


def files(folder, v):
    left, right = (v["L"] - v["wide"]) / 2, (v["L"] + v["wide"]) / 2
    def strip(begin, end, z=0.0): return meshes.grid((begin, -0.0009, z), (end - begin, 0, 0), (0, v["W"] + 0.0018, 0), 1, 1)
    meshes.write_stl(folder / "floor.stl", strip(-0.0009, left) + strip(right, v["L"] + 0.0009))
    meshes.write_stl(folder / "door.stl", strip(left + 1e-4, right - 1e-4))
    meshes.write_stl(folder / "below.stl", strip(0, v["L"], -0.02))


def slope(granules, v, side):
    """Angle of the surface (deg) between the door's edge and twice the door's width from there."""
    cell = D / 2
    height = measures.height_map(granules[granules["z"] > 0], (0, 0), (v["L"], v["W"]), cell).max(axis=1)
    x = (np.arange(len(height)) + 0.5) * cell
    away = side * (x - v["L"] / 2) - v["wide"] / 2
    there = (away > D) & (away < v["wide"])
    return np.degrees(np.arctan(np.polyfit(away[there], height[there], 1)[0]))


def measure(run, v):
    t = measures.time(run)
    door, out = measures.series(run, "v_door", "v_out")
    end_of_rest, end_of_hold = (v["rest"] + 0.5) * v["dt"], (v["rest"] + v["sinking"] + v["hold"] + 0.5) * v["dt"]
    held = (t <= end_of_hold) & (t >= end_of_hold - v["hold"] / 2 * v["dt"])
    return {"door's load at rest": door[t <= end_of_rest].mean(), "door's least load": door[t <= end_of_hold].min(), "door's load, sunk": door[held].mean() if held.any() else np.nan,
            "discharged": out[-1], "angle left": slope(run.final, v, -1), "angle right": slope(run.final, v, 1)}


def laws(values):
    of = values[""]
    return [("door's load sunk, of that at rest", of["door's load, sunk"] / of["door's load at rest"], "well below 1, Terzaghi 1936: the bed arches")]
