"""A side wall moves out of a bed at rest."""
from solidcull_runs import measures, meshes

deck, bed, bed_uses = "wall.in", "../../shared/pour.in", ("bed_granules", "L", "W", "around")
quick = {"granules": 6000, "bed_granules": 6000, "L": 0.06, "W": 0.03, "around": 0.02, "steps": 2200, "speed": 0.055}
full = {"granules": 20000, "bed_granules": 20000, "L": 0.12, "W": 0.045, "around": 0.02, "steps": 4500, "speed": 0.045}
aside, by_hand, curves = "aside", "block $(v_L/3) INF INF INF INF INF", {"active push": "v_push"}


def files(folder, v):
    meshes.write_stl(folder / "floor.stl", meshes.grid((-0.001, -0.001, 0), (v["L"] + 0.01, 0, 0), (0, v["W"] + 0.002, 0), 8, 8))
    meshes.write_stl(folder / "wall.stl", meshes.grid((v["L"], -0.001, -0.001), (0, v["W"] + 0.002, 0), (0, 0, 0.15), 4, 20))


def measure(run, v):
    push = run.series("v_push")[1]
    surface = [measures.height_map(g, (0, 0), (v["L"], v["W"]), 5e-4) for g in (run.start, run.final)]
    return {"push at rest": push[5:20].mean(), "active push": push[-len(push) // 4:].mean(),
            "sunken volume": (surface[0] - surface[1]).clip(0).sum() * 25e-8}
