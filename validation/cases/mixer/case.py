"""A mixer whose four blades leave nothing at rest."""
import numpy as np

from solidcull_runs import measures, meshes

deck, bed = "mixer.in", "bed.in"
bed_uses = ("bed_granules", "radius", "blade", "blade_high", "high", "small", "large", "dt", "skin", "period", "fill")
of_both = {"small": 0.0024, "large": 0.0028, "dt": 5e-5, "skin": 0.001, "relax": 200, "period": 0.25, "fill": 9000}
quick = {**of_both, "granules": 6000, "bed_granules": 6000, "radius": 0.075, "blade": 0.07, "blade_high": 0.035, "high": 0.25, "steps": 2400}
full = {**of_both, "granules": 20000, "bed_granules": 20000, "radius": 0.112, "blade": 0.105, "blade_high": 0.05, "high": 0.35, "steps": 4000}
aside = "aside"
curves = {"torque": "v_torque"}


def files(folder, v):
    meshes.write_stl(folder / "blades.stl", [t for a in np.radians([0, 90, 180, 270]) for t in meshes.grid(
        (0, 0, 0.004), (v["blade"] * np.cos(a), v["blade"] * np.sin(a), 0), (0, 0, v["blade_high"]), 3, 2)])


def measure(run, v):
    far = np.hypot(run.final["x"], run.final["y"])
    return {"torque": abs(measures.series(run, "v_torque").mean()), "kinetic energy": measures.kinetic_energy(run).mean(),
            "height of the centre": np.average(run.final["z"], weights=run.final["mass"]), "distance from the axis": np.average(far, weights=run.final["mass"])}
