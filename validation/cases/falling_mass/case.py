"""The oval of the example, smaller, drops on a floor."""
import numpy as np

from solidcull_runs import meshes

deck, bed, bed_uses = "fall.in", "../../../examples/falling_mass/make.in", ("granules",)
quick = {"granules": 6000, "seen": 14}
full = {"granules": 15600, "seen": 16}
aside = "aside"
curves = {"peak load on the floor": "v_load"}
picture = ("y", 0.5, 1)


def files(folder, v):
    meshes.write_stl(folder / "floor.stl", meshes.grid((-2, -2, 0), (4, 0, 0), (0, 4, 0), 1, 1))


def measure(run, v):
    t, load = (run.series(c)[1] for c in ("time", "v_load"))
    of_frame = np.convolve(load, np.full(20, 1 / 20), "valid")
    distance = np.hypot(run.final["x"], run.final["y"])
    order = np.argsort(distance)
    mass = np.cumsum(run.final["mass"][order])
    return {"time of the hit": t[np.argmax(load > 0)] - t[0], "peak load on the floor": of_frame.max(),
            "radius of the heap": distance[order][np.searchsorted(mass, 0.9 * mass[-1])],
            "height of its centre of mass": np.average(run.final["z"], weights=run.final["mass"])}
