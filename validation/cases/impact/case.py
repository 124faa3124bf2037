"""The strike of examples/impact."""
import numpy as np

from solidcull_runs import measures

deck, bed = "../../../examples/impact/impact.in", "../../../examples/impact/settle.in"
bed_uses = ("bed_granules", "L")
quick = {"granules": 6001, "bed_granules": 6000, "L": 0.05, "steps": 2500}
full = {"granules": 20001, "bed_granules": 20000, "L": 0.075, "steps": 8000}
aside = "dx"
by_hand = "cylinder z $x $y $(0.4*v_L) $(v_top-0.4*v_L) INF"
curves = {"largest depth": "v_depth", "mean kinetic energy": "c_bedke", "peak load on the floor": "v_floor"}
picture = ("y", 0.5, 0.005)
CELL = 5e-4  # m, of the height map


def measure(run, v):
    depth, force, energy, floor = (run.series(c)[1] for c in ("v_depth", "v_force", "c_bedke", "v_floor"))
    after, before = (measures.height_map(g[g["radius"] < 0.005], (0, 0), (v["L"], v["L"]), CELL) for g in (run.final, run.start))
    change = (after - before) * CELL**2
    way = np.sqrt(sum((run.final[c] - run.start[c])**2 for c in "xyz"))[run.final["radius"] < 0.005]
    return {"largest depth": depth.max(), "depth at the end": depth[-1], "peak force on the ball": force.max(),
            "mean kinetic energy": energy.mean(), "peak kinetic energy": energy.max(), "peak load on the floor": floor.max(),
            "load on the floor at the end": floor[-1], "sum of displacements": way.sum(), "crater": -change[change < 0].sum(),
            "heap": change[change > 0].sum()}
