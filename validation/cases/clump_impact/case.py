"""The strike of examples/clumps, in two beds of clumps."""
import numpy as np

from solidcull_runs import measures, meshes

deck, bed = "../../../examples/clumps/strike.in", "../../../examples/clumps/settle.in"
bed_uses = ("clumps", "L", "wide")
quick = {"granules": 6001, "clumps": 2000, "L": 0.04, "wide": 0.0425, "steps": 4000}  # granules: spheres, and the ball
full = {"granules": 21001, "clumps": 7000, "L": 0.06, "wide": 0.0625}
scenes = {"quick": {"2,000 clumps": {}},
          "full": {"7,000 clumps": {}, "20,000 clumps": {"granules": 60001, "clumps": 20000, "L": 0.085, "wide": 0.0875}}}
aside = "dx"
paper = False  # it keeps no clumps
curves = {"largest depth": "v_depth", "mean kinetic energy": "v_bedke", "peak load on the floor": "v_floor"}
picture = ("y", 0.5, 0.004)
CELL = 5e-4  # m, of the height map


def files(folder, v):
    meshes.write_stl(folder / "floor.stl", meshes.grid((-0.0024, -0.0024, 0), (v["wide"] + 0.0023, 0, 0), (0, v["wide"] + 0.0023, 0), 1, 1))


def measure(run, v):
    depth, force, energy, floor = (run.series(c)[1] for c in ("v_depth", "v_force", "v_bedke", "v_floor"))
    after, before = (measures.height_map(g[g["radius"] < 0.004], (0, 0), (v["L"], v["L"]), CELL) for g in (run.final, run.start))
    change = (after - before) * CELL**2
    way = np.sqrt(sum((run.final[c] - run.start[c])**2 for c in "xyz"))[run.final["radius"] < 0.004]
    return {"largest depth": depth.max(), "depth at the end": depth[-1], "peak force on the ball": force.max(),
            "mean kinetic energy": energy.mean(), "peak kinetic energy": energy.max(), "peak load on the floor": floor.max(),
            "load on the floor at the end": floor[-1], "sum of displacements": way.sum(), "crater": -change[change < 0].sum(),
            "heap": change[change > 0].sum()}
