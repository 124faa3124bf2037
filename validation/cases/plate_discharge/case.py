"""A plate with its end walls gone discharges over both ends."""
import numpy as np

from solidcull_runs import meshes

deck, bed = "discharge.in", "fill.in"
bed_uses = ("granules", "L", "W")
quick = {"granules": 2400, "L": 0.36, "W": 0.06, "steps": 9000}
full = {"granules": 20000, "L": 0.72, "W": 0.1, "steps": 11000}
aside = "aside"
by_hand = "block $(-v_L/3) $(v_L/3) INF INF 0.15 INF side out"
curves = {"load of the plate": "v_load"}
picture = ("y", 0.5, 1)
PLATE = 0.15  # m, its height


def files(folder, v):
    meshes.write_stl(folder / "plate.stl", meshes.grid((-v["L"] / 2, 0, PLATE), (v["L"], 0, 0), (0, v["W"], 0), 1, 1))


def measure(run, v):
    t, load = (run.series(c)[1] for c in ("time", "v_load"))
    on = run.final[run.final["z"] > PLATE]
    edges = np.arange(-v["L"] / 2, v["L"] / 2 + 0.005, 0.01)
    band = np.digitize(on["x"], edges)
    x, top = np.array([(edges[k - 1] + 0.005, on["z"][band == k].max()) for k in range(1, len(edges)) if (band == k).any()]).T
    slope = np.polyfit(np.abs(x[np.abs(x) > 0.1 * v["L"]]), top[np.abs(x) > 0.1 * v["L"]], 1)[0]
    half = 0.5 * (load[1] + load[-10:].mean())  # the first row has no load yet
    return {"left on the plate": len(on), "half of it has left at": t[1 + np.argmax(load[1:] < half)] - t[0],
            "angle of the heap": np.degrees(np.arctan(-slope)), "load of the plate": load[-10:].mean()}
