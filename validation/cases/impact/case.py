"""The strike of examples/impact."""
from solidcull_runs import struck

deck, bed = "../../../examples/impact/impact.in", "../../../examples/impact/settle.in"
bed_uses = ("bed_granules", "L")
quick = {"granules": 6001, "bed_granules": 6000, "L": 0.05, "steps": 2500}
full = {"granules": 20001, "bed_granules": 20000, "L": 0.075, "steps": 8000}
aside = "dx"
by_hand = "cylinder z $x $y $(0.4*v_L) $(v_top-0.4*v_L) INF"
curves = {"largest depth": "v_depth", "mean kinetic energy": "c_bedke", "peak load on the floor": "v_floor"}
picture = ("y", 0.5, 0.005)


def measure(run, v):
    return struck.metrics_of(run, v["L"], 0.005, "c_bedke")
