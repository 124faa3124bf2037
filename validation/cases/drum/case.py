"""A drum that turns so fast that nothing in it rests."""
from solidcull_runs import measures, meshes

deck, bed = "drum.in", "bed.in"
bed_uses = ("bed_granules", "radius", "length", "small", "large", "dt", "skin", "period", "fill")
of_both = {"small": 0.0024, "large": 0.0028, "dt": 5e-5, "skin": 0.001, "relax": 200, "period": 1, "fill": 14000}
quick = {**of_both, "granules": 6000, "bed_granules": 6000, "radius": 0.1, "length": 0.07, "steps": 2200}
full = {**of_both, "granules": 20000, "bed_granules": 20000, "radius": 0.15, "length": 0.104, "steps": 4000}
aside = "aside"
curves = {"torque": "v_torque"}


def files(folder, v):
    meshes.write_stl(folder / "drum.stl", meshes.drum(v["radius"], v["length"], 72))


def measure(run, v):
    return {"torque": abs(measures.series(run, "v_torque").mean()), "kinetic energy": measures.kinetic_energy(run).mean(),
            "centre, sideways": measures.centre(run, "x").mean(), "centre, height": measures.centre(run, "z").mean()}
