#!/usr/bin/python3
"""The weight of a bed of any size on each element of its floor, free and asleep; then the floor moves, or is unfixed.

    validation/scale/weight.py [--size 1.28M] [--culling KEYWORDS] [--after N] [--few-steps]

A run in which nothing is ever culled goes beside. Prints, at the same step, the largest difference of an element's load, asleep from
free, over the mean load of the elements, that of the total load, and how the bed wakes: the interior granules left, and the mean fall over that of a free fall.
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
    free, late = (activity.element_loads(Path(f"{place / size}-{of}.floor.{4 * rows}.vtk")) for of in ("free", part))
    size_of = float(np.linalg.norm(free, axis=1).mean()) or 1.0
    total = float(np.linalg.norm(late.sum(axis=0) - free.sum(axis=0)) / max(1e-30, np.linalg.norm(free, axis=1).sum()))
    result = {"granules": len(np.load(made_bed["granules"])),
              "floor": {"elements": len(free), "mean load (N)": size_of, "total, difference": total,
                        "largest difference": float(np.linalg.norm(late - free, axis=1).max()) / size_of,
                        "rms difference": float(np.sqrt(((late - free)**2).sum(axis=1).mean())) / size_of}}
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
        print(f"{size}, {part}, floor: " + ", ".join(f"{name} {value:.3g}" for name, value in r["floor"].items()))
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
