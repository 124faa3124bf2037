#!/usr/bin/python3
"""The weight of a bed of any size on each element of its floor, free and asleep; then the floor moves, or is unfixed.

    validation/scale/weight.py [--size 1.28M] [--culling KEYWORDS] [--after N] [--few-steps]

A run in which nothing is ever culled goes beside. Prints the largest change of an element's load since the bed was put to sleep, over
the mean load of the elements, and that of the total load; the same of the free bed (a large one still trembles); the difference of
the two at the same step; and how the bed wakes: the interior granules left, and the mean fall over that of a free fall.
Exit: 0 nothing lost, 1 a granule lost, 2 a run failed.
"""
import argparse
import json
from pathlib import Path

import numpy as np

import scale
from solidcull_runs import errors, logs  # scale.py has made them known
from solidcull_runs.dumps import element_forces, read_final
from solidcull_runs.few_steps import finite

HERE = Path(__file__).resolve().parent
GRAVITY, DT = 9.81, 3e-5


NEVER = "every 1000000000"  # no look, so nothing is culled


def one_part(size, part, settings):
    made_bed = scale.bed(size)
    length, width = made_bed["sides"]
    place = scale.OUT / "weight"
    place.mkdir(exist_ok=True)
    files = place / f"{size}-{part}"
    variables = {"restart": made_bed["restart"], "floormesh": made_bed["floor"], "L": length, "W": width, "files": files,
                 "drop": int(part == "drop"), "culling": NEVER if part == "free" else settings.culling, "rows": 60,
                 "after": 1 if part == "free" else 40 if settings.few_steps else settings.after}
    text, _ = scale.run_engine(HERE / "weight.in", Path(f"{files}.log"), variables)
    if part == "free":
        return None
    rows, (asleep, woken) = variables["rows"], [t for t in logs.parse_log(text) if "cull[3]" in "".join(t.columns) and len(t.rows) > 1][-2:]
    before, free, late = (element_forces(Path(f"{place / size}-{of}.floor.{step}.vtk"))
                          for of, step in ((part, rows), ("free", 4 * rows), (part, 4 * rows)))
    size_of = float(np.linalg.norm(before, axis=1).mean()) or 1.0

    def apart(a, b):
        return [float(np.linalg.norm(a - b, axis=1).max()) / size_of, float(np.linalg.norm((a - b).sum(axis=0))) / size_of / len(a)]
    result = {"granules": len(np.load(made_bed["granules"])), "elements": len(free), "mean load (N)": size_of,
              "largest change of an element, and of all": {"asleep, since before": apart(late, before),
                                                           "free, in that time": apart(free, before),
                                                           "asleep from free": apart(late, free)}}
    column = {name: k for k, name in enumerate(woken.columns)}
    result["interior"] = {"asleep": int(asleep.rows[-1][column["cull[3]"]]),
                          "rows": [[int(r[column["Step"]] - woken.rows[0][column["Step"]]), int(r[column["cull[1]"]]), int(r[column["cull[3]"]])]
                                   for r in woken.rows]}
    before, after = np.load(made_bed["granules"]), read_final(Path(f"{files}.final"))
    result["lost"] = result["granules"] - len(after)
    fall = GRAVITY * (variables["after"] * DT)**2 / 2
    result["mean fall over free fall"] = float((before["z"] - after["z"]).mean() / fall)
    if settings.few_steps:
        check_few(part, text, result, woken)
    return result


def check_few(part, text, result, woken):
    """Raises RunError, one line, where a run of a few steps shows that its deck is broken."""
    whole, column = result["granules"], {name: k for k, name in enumerate(woken.columns)}
    sums = {row[column["Atoms"]] + row[column["cull[3]"]] for row in woken.rows}
    shares = [x for pair in result["largest change of an element, and of all"].values() for x in pair]
    if "Loop time" not in text.rpartition("unfix cull")[2]:
        wrong = "did not reach the end of its deck"
    elif sums != {whole}:
        wrong = f"held {min(sums):.0f} to {max(sums):.0f} granules on the way, not {whole}"
    elif not finite([result["mean load (N)"], result["mean fall over free fall"], *shares]):
        wrong = "has no number for a load or the fall"
    elif not result["interior"]["asleep"] > 0:
        wrong = "locked no granule"
    else:
        return
    raise errors.RunError(f"few steps: {part} {wrong}")


def main(argv=None):
    p = argparse.ArgumentParser(prog="weight.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--size")
    p.add_argument("--culling", default="exterior sleep")
    p.add_argument("--after", type=int, default=240, metavar="N", help="steps after the floor has begun to move (default 240)")
    p.add_argument("--few-steps", action="store_true")
    settings = p.parse_args(argv)
    scale.few_steps = settings.few_steps
    if settings.few_steps:
        vars(scale).update(scale.FEW)
    size = settings.size or ("small" if settings.few_steps else "1.28M")
    if size not in scale.BEDS:
        p.error(f"sizes are {', '.join(scale.BEDS)}")
    scale.OUT.mkdir(parents=True, exist_ok=True)
    one_part(size, "free", settings)
    report = {part: one_part(size, part, settings) for part in ("drop", "unfix")}
    (scale.OUT / "weight.json").write_text(json.dumps(report, indent=1) + "\n")
    for part, r in report.items():
        for name, (one, total) in r["largest change of an element, and of all"].items():
            print(f"{size}, {part}, floor of {r['elements']} elements, {name}: largest {one:.2g}, total {total:.2g}")
        steps = ", ".join(f"{interior} after {step}" for step, _, interior in r["interior"]["rows"])
        print(f"{size}, {part}: interior granules {r['interior']['asleep']} asleep; then {steps} steps; fell "
              f"{r['mean fall over free fall']:.4f} of a free fall; lost {r['lost']} of {r['granules']}")
    return 1 if any(r["lost"] for r in report.values()) else 0


if __name__ == "__main__":
    errors.command("weight", main)
