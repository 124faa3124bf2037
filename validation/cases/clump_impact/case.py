"""The strike of examples/clumps, in two beds of clumps."""
from solidcull_runs import meshes, struck

deck, bed = "../../../examples/clumps/strike.in", "../../../examples/clumps/settle.in"
bed_uses = ("clumps", "L", "wide")
quick = {"granules": 6001, "clumps": 2000, "L": 0.04, "wide": 0.0425, "steps": 4000}  # granules: spheres, and the ball
full = {"granules": 21001, "clumps": 7000, "L": 0.06, "wide": 0.0625}
production = {"granules": 160003, "clumps": 53334, "L": 0.139, "wide": 0.1415, "frames": 400}
scenes = {"quick": {"2,000 clumps": {}},
          "full": {"7,000 clumps": {}, "20,000 clumps": {"granules": 60001, "clumps": 20000, "L": 0.085, "wide": 0.0875}},
          "production": {"53,334 clumps": {}}}
aside = "dx"
paper = False  # it keeps no clumps
curves = {"largest depth": "v_depth", "mean kinetic energy": "v_bedke", "peak load on the floor": "v_floor"}
picture = ("y", 0.5, 0.004)


def files(folder, v):
    meshes.write_stl(folder / "floor.stl", meshes.grid((-0.0024, -0.0024, 0), (v["wide"] + 0.0023, 0, 0), (0, v["wide"] + 0.0023, 0), 1, 1))


def measure(run, v):
    return struck.metrics_of(run, v["L"], 0.004, "v_bedke")
