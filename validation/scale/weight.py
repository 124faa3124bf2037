#!/usr/bin/python3
"""The weight of a bed of any size on each element of its floor and sides, free and asleep; then the floor moves, or is unfixed.

    validation/scale/weight.py [--size 1.28M] [--culling KEYWORDS] [--few-steps]

Prints the largest change of an element's load from free to asleep over the mean load of the mesh's elements, that of
the mesh's total load, and how the bed wakes: the interior granules left, and the mean fall over that of a free fall.
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


def sides(length, width):
    """Four walls of the bed's box, of triangles as wide as the floor's; the file."""
    n = [max(1, round(s / scale.ELEMENT)) for s in (length, width, scale.TOP)]
    triangles = []
    for x in (0, length):
        triangles += activity.grid((x, 0, 0), (0, width, 0), (0, 0, scale.TOP), n[1], n[2])
    for y in (0, width):
        triangles += activity.grid((0, y, 0), (length, 0, 0), (0, 0, scale.TOP), n[0], n[2])
    activity.OUT = scale.OUT / "weight"
    activity.stl("sides", triangles)
    return activity.OUT / "sides.stl"


def one_part(size, drop, settings):
    made_bed = scale.bed(size)
    length, width = made_bed["sides"]
    place = scale.OUT / "weight"
    place.mkdir(exist_ok=True)
    files = place / f"{size}-{'drop' if drop else 'unfix'}"
    variables = {"restart": made_bed["restart"], "floormesh": made_bed["floor"], "sidesmesh": sides(length, width), "files": files,
                 "drop": int(drop), "culling": settings.culling, "rows": 60, "after": 40 if settings.few_steps else 120}
    text, _ = scale.run_engine(HERE / "weight.in", Path(f"{files}.log"), variables)
    rows, (asleep, woken) = variables["rows"], [t for t in twin.parse_log(text) if "cull[3]" in "".join(t.columns) and len(t.rows) > 1][-2:]
    result = {"granules": len(np.load(made_bed["granules"])), "meshes": {}}
    for mesh in ("floor", "sides"):
        free, late = (activity.element_loads(Path(f"{files}.{mesh}.{k * rows}.vtk")) for k in (1, 4))
        size_of = float(np.linalg.norm(free, axis=1).mean()) or 1.0
        total = float(np.linalg.norm(late.sum(axis=0) - free.sum(axis=0)) / max(1e-30, np.linalg.norm(free, axis=1).sum()))
        result["meshes"][mesh] = {"elements": len(free), "mean load (N)": size_of, "total, change": total,
                                  "largest change, asleep": float(np.linalg.norm(late - free, axis=1).max()) / size_of,
                                  "rms change, asleep": float(np.sqrt(((late - free)**2).sum(axis=1).mean())) / size_of}
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
    p.add_argument("--few-steps", action="store_true")
    settings = p.parse_args(argv)
    scale.few_steps = settings.few_steps
    if settings.few_steps:
        vars(scale).update(scale.FEW)
    size = settings.size or ("small" if settings.few_steps else "1.28M")
    if size not in scale.BEDS:
        p.error(f"sizes are {', '.join(scale.BEDS)}")
    scale.OUT.mkdir(parents=True, exist_ok=True)
    report = {part: one_part(size, part == "drop", settings) for part in ("drop", "unfix")}
    (scale.OUT / "weight.json").write_text(json.dumps(report, indent=1) + "\n")
    for part, r in report.items():
        for mesh, m in r["meshes"].items():
            print(f"{size}, {part}, {mesh}: " + ", ".join(f"{name} {value:.3g}" for name, value in m.items()))
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
