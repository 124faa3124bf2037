"""What the runs of a validation case gave, as plain data, and the file that holds it."""
import json
import re
import statistics
from pathlib import Path

import numpy as np

from ..dumps import snapshots
from ..errors import RunError
from ..logs import loops
from . import fields
from .cases import PRODUCTION
from .earlier import Earlier, EarlierRun
from .points import ALSO, BY_HAND, PAPER, UNCULLED

MOVED = 1e-2  # mean diameters between two snapshots: what moves
DRAWN = 120  # values kept of a curve
DRAWN_OF = 5  # runs of each point: their fields and curves
WANTED = {"case", "title", "claim", "reference", "size", "metrics", "scenes", "failed", "bound", "fields", "laws", "lost", "lost_refilled"}


def curve(run, column):
    """Times (s) and values of a thermo column, thinned."""
    (_, t), (_, x) = run.series("time"), run.series(column)
    n = min(len(t), len(x))
    at = np.unique(np.linspace(0, n - 1, min(n, DRAWN)).astype(int))
    return [[float(f"{v:.5g}") for v in t[at]], [float(f"{v:.5g}") for v in x[at]]]


def moved(file, diameter):
    """Steps of the snapshots of an unculled run, and how many granules had moved since the one before."""
    before, steps, counts = None, [], []
    for step, columns, rows in snapshots(file):
        rows = rows[np.argsort(rows[:, 0])]
        places = rows[:, 1:4]
        if before is not None and len(before) == len(places):
            steps.append(step)
            counts.append(int((np.linalg.norm(places - before, axis=1) > MOVED * diameter).sum()))
        before = places
    return steps, counts


def run_data(job, run):
    """A run as plain data."""
    if isinstance(run, EarlierRun):
        return run.data
    counts = {}
    if run.counts:
        counts = {name: float(run.counts[name].mean()) for name in ("exterior", "interface", "interior")}
        counts |= {name: float(run.counts[name][-1]) for name in ("culled", "restored", "carves", "seconds", "restore_energy")}
    data = {"k": job.k, "mark": job.mark, "seconds": round(run.own_time, 3), "steps": run.steps(), "counts": counts, "values": run.metrics,
            **granules_of(run)}
    if job.point.default:
        data["loops"] = loops(job.file(".log").read_text(errors="replace"))
    if job.point.default and job.scene == job.case.main_scene and job.k < DRAWN_OF:
        data["curves"] = {metric: curve(run, column) for metric, column in job.case.get("curves", {}).items()}
    return data


def result_of(case, done, decided=False, earlier=None):
    """What the runs of a case gave. `done`: as from run_all(), of this case's jobs. `decided`: pairs are added until each metric is,
    or there are as many as there may be. `earlier`: an Earlier of which some runs are."""
    result = {"case": case.name, "title": case.title, "claim": case.claim, "reference": case.reference, "size": case.size,
              "metrics": [{"name": m.name, "unit": m.unit, "margin": m.margin, "relative": m.relative, "why": m.why} for m in case.metrics],
              "scenes": {}, "failed": [], "bound": None, "fields": {}, "laws": [], "lost": 0, "lost_refilled": 0, "decided": decided}
    for scene in case.scenes:
        of_scene = {}
        for job, run in done.items():
            if job.scene != scene:
                continue
            if isinstance(run, str):
                why = re.sub(r" \(all of it: .*\)$", "", run)  # a log of this machine is no part of a result
                result["failed"].append({"run": job.name, "point": job.point.name, "why": why})
                continue
            p = job.point
            entry = of_scene.setdefault(p.name, {"family": p.family, "absolute": p.absolute, "share": p.share, "default": p.default, "runs": []})
            entry["runs"].append(run_data(job, run))
        result["scenes"][scene] = {"granules": case.granules(scene), "points": of_scene}
        unculled = next((e for e in of_scene.values() if e["family"] == UNCULLED), {"runs": []})
        values = [tuple(r["values"].values()) for r in unculled["runs"]]
        if len(set(values)) < len(values):
            result["failed"].append({"run": "unculled", "point": UNCULLED, "why": f"unculled runs are alike: '{case.need('aside')}' moves "
                                     "nothing, as with '-${aside}', or a mesh whose fix ID is in the restart file"})
    result["lost"], result["lost_refilled"] = lost(result), lost(result, refilled=True)
    main = {job: run for job, run in done.items() if job.scene == case.main_scene and not isinstance(run, (str, EarlierRun))}
    finals = {}
    for job, run in main.items():
        if run.final is not None and job.k < DRAWN_OF:
            finals.setdefault(job.point, []).append(run.final)
    unculled = next((p for p in finals if p.family == UNCULLED), None)
    if unculled:
        for p, of_point in finals.items():
            if p is not unculled and len(finals[unculled]) > 1 and (p.default or p.family in (PAPER, ALSO)):
                result["fields"][p.name] = fields.distances(of_point, finals[unculled])
        diameter = 2 * float(np.median(finals[unculled][0]["radius"]))
        framed = next((job for job in main if job.point is unculled and job.frames), None)
        if framed and framed.file(".frames").exists():
            steps, counts = moved(framed.file(".frames"), diameter)
            mean = statistics.fmean(counts) if counts else 0
            result["bound"] = {"every": framed.frames, "moving": mean, "N/N_moving": case.granules(case.main_scene) / mean if mean else None}
    (earlier or Earlier()).add_to(result)
    laws = case.get("laws")
    if laws and case.size != PRODUCTION:
        result["laws"] = laws_of(case, result, laws)
    return result


def granules_of(run):
    """How many granules were there at the end, how many that had been there or were put in were `missing`, how many were there `twice`."""
    if run.final is None:
        return {"granules": None}
    there = len(np.unique(run.final["id"]))
    return {"granules": len(run.final), "missing": len(run.start) + run.inserted - there, "twice": len(run.final) - there}


def lost(result, refilled=False):
    """Granules that culled runs miss at the end, of those that were there and those that were put in, but for as many as leave
    unculled runs of the same scene; the most of any run. Below 0: there twice. Of the paper's scheme (`refilled`) or of all others."""
    worst = 0
    for of_scene in result["scenes"].values():
        leave, missing = [], []
        for entry in of_scene["points"].values():
            ended = [run for run in entry["runs"] if run["granules"] is not None]
            if entry["family"] == UNCULLED:
                leave += [run["missing"] for run in ended]
            elif entry["family"] != BY_HAND and (entry["family"] == PAPER) == refilled:
                missing += [run["missing"] for run in ended]
                worst = max([worst, *(-run["twice"] for run in ended)], key=abs)
        for n in missing if leave else ():
            worst = max(worst, n - max(min(leave), min(max(leave), n)), key=abs)
    return int(worst)


def laws_of(case, result, laws):
    """The laws by the means of the default points."""
    rows = {}
    families = {name: entry["family"] for scene in result["scenes"].values() for name, entry in scene["points"].items() if entry["default"]}
    for point, family in families.items():
        values = {}
        for scene, of_scene in result["scenes"].items():
            runs = of_scene["points"].get(point, {}).get("runs", [])
            if runs:
                values[scene] = {m.name: statistics.fmean(r["values"][m.name] for r in runs) for m in case.metrics}
        if len(values) == len(result["scenes"]):
            for what, value, known in laws(values):
                rows.setdefault(what, {"known": known, "values": {}})["values"][family] = float(value)
    return [{"what": what, **row} for what, row in rows.items()]


def results_file(out, case):
    return Path(out) / case.name / "results.json"


def kept_file(kept, case):
    """With the sources."""
    return Path(kept) / f"{case.name}.json"


def read_result(file):
    """The results of a case; RunError where the file is no such thing."""
    try:
        result = json.loads(Path(file).read_text())
    except OSError as e:
        raise RunError(f"cannot read {file}: {e.strerror}; run the case first") from None
    except ValueError as e:
        raise RunError(f"{file} is no JSON ({e}); delete it and run the case again") from None
    if not isinstance(result, dict) or WANTED - set(result):
        raise RunError(f"{file} is not the result of a case; delete it and run the case again")
    names = {m["name"] for m in result["metrics"]}
    for scene in result["scenes"].values():
        for point, entry in scene["points"].items():
            for run in entry["runs"]:
                if set(run["values"]) != names:
                    raise RunError(f"{file}: {point} has values of {', '.join(sorted(run['values']))}, the case measures "
                                   f"{', '.join(sorted(names))}; run the case again")
    return result
