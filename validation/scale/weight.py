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
import sys
from pathlib import Path

import numpy as np

import scale
import tiles
import twin

HERE = Path(__file__).resolve().parent
activity = scale.load("activity", HERE.parent / "activity" / "activity.py")  # its meshes and how it reads their loads

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
    rows, (asleep, woken) = variables["rows"], [t for t in twin.parse_log(text) if "cull[3]" in "".join(t.columns) and len(t.rows) > 1][-2:]
    before, free, late = (activity.element_loads(Path(f"{place / size}-{of}.floor.{step}.vtk"))
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
    before, after = np.load(made_bed["granules"]), twin.read_final(Path(f"{files}.final"))
    result["lost"] = result["granules"] - len(after)
    fall = GRAVITY * (variables["after"] * DT)**2 / 2
    result["mean fall over free fall"] = float((before["z"] - after["z"]).mean() / fall)
    return result


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
    try:
        sys.exit(main())
    except (twin.TwinError, tiles.RestartError) as e:
        print(f"weight: {e}", file=sys.stderr)
        sys.exit(2)
