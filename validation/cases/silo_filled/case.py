"""A silo with a flat floor is filled from empty, rests, and empties through a slit."""
import numpy as np

from solidcull_runs import measures, meshes

deck = "fill.in"
quick = {"small": 0.0024, "large": 0.0028, "dt": 5e-5, "skin": 0.001, "granules": 4000, "L": 0.18, "W": 0.03, "slit": 0.03, "low": -0.15,
         "under": 0.25, "high": 0.33, "rate": 10000, "fill": 10000, "rest": 2000, "steps": 3000}
production = {"small": 0.0048, "large": 0.0056, "dt": 1e-4, "skin": 0.002, "granules": 160000, "L": 0.9, "W": 0.27, "slit": 0.09, "low": -0.3,
              "under": 0.76, "high": 1.0, "rate": 133000, "fill": 14000, "rest": 3000, "steps": 8000, "frames": 400}
aside = "aside"
curves = {"mass flow": "v_out", "floor's load, emptying": "v_floor", "right wall's load, emptying": "v_right"}
picture = ("y", 0.5, 1)
CELL = 0.002  # m: of the height map


def files(folder, v):
    left, right, edge = (v["L"] - v["slit"]) / 2, (v["L"] + v["slit"]) / 2, 0.0009
    def strip(begin, end, z=0.0): return meshes.grid((begin, -edge, z), (end - begin, 0, 0), (0, v["W"] + 2 * edge, 0), 1, 1)
    meshes.write_stl(folder / "floor.stl", strip(-edge, left) + strip(right, v["L"] + edge))
    meshes.write_stl(folder / "plug.stl", strip(left, right))
    meshes.write_stl(folder / "below.stl", strip(0, v["L"], -4 * v["large"]))
    meshes.write_stl(folder / "right.stl", meshes.grid((v["L"], -edge, v["low"] + 0.005), (0, v["W"] + 2 * edge, 0), (0, 0, v["high"] - v["low"] - 0.01), 1, 1))


def measure(run, v):
    t = measures.time(run)
    out, floor, right, whole = measures.series(run, "v_out", "v_floor", "v_right", "v_whole")
    opened = (v["fill"] + v["rest"] + 0.5) * v["dt"]
    resting = (t < opened) & (t > opened - v["rest"] * v["dt"] / 2)
    late = t >= t[resting][-1] + (t[-1] - t[resting][-1]) / 3
    inside = run.final[run.final["z"] > 0]
    surface = measures.height_map(inside, (0, 0), (v["L"], v["W"]), CELL).mean(axis=1)
    middle = round(v["L"] / 2 / CELL)
    return {"floor's load at rest": whole[resting].mean(), "right wall's load at rest": right[resting].mean(),
            "mass flow": np.polyfit(t[late], out[late], 1)[0], "floor's load, emptying": floor[late].mean(),
            "right wall's load, emptying": right[late].mean(), "height over the slit": surface[middle - 10:middle + 10].mean(),
            "height at the left": surface[:20].mean()}
