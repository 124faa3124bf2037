"""How error is judged: the culled runs beside the unculled ones.

The noise floor of a figure is the largest value of the unculled runs minus the smallest. The error is the distance between the mean
of the culled and the mean of the unculled runs. It is good when it is not above the margin: the larger of a share of the unculled
mean (2 %, if nothing else is said) and the noise floor.
"""
import functools
import itertools
import statistics

import numpy as np

MARGIN = 0.02


def judged(unculled, culled, margin=MARGIN, least=0.0):
    """The verdict on one figure, of its value in each run. `least`: of the margin, where a share of the mean says nothing."""
    mean, spread = statistics.fmean(unculled), max(unculled) - min(unculled)
    error, allowed = abs(statistics.fmean(culled) - mean), max(margin * abs(mean), spread, least)
    return {"unculled": unculled, "culled": culled, "mean": mean, "spread": spread, "culled_mean": statistics.fmean(culled), "error": error,
            "worst": max(abs(x - mean) for x in culled), "of_spread": error / spread if spread else None, "margin": allowed,
            "good": error <= allowed}


def judge(unculled, culled, margin=MARGIN, least_margins=None, granules=None):
    """The figures of the table, as plain data. `least_margins`: by metric; `granules`: how many the deck is known to hold."""
    result = {"unculled": summary(unculled), "culled": summary(culled), "metrics": {}}
    result["speed_up"] = result["unculled"]["own_time"] / max(result["culled"]["own_time"], 1e-9)
    for name in unculled[0].metrics:
        result["metrics"][name] = judged([r.metrics[name] for r in unculled], [r.metrics[name] for r in culled], margin,
                                         (least_margins or {}).get(name, 0.0))
    result["ledger"] = ledger([r.final for r in unculled], [r.final for r in culled], granules)
    result["good"] = not is_lost(result["ledger"], unknown=False) and all(m["good"] for m in result["metrics"].values())
    result["no_scatter"] = len(unculled) > 1 and all(m["spread"] == 0 for m in result["metrics"].values())
    return result


def outside(result):
    """Names of the figures that are outside their margin."""
    return [name for name, m in result["metrics"].items() if not m["good"]]


def summary(runs):
    """Times and counts of the runs of one kind."""
    result = {"loop_times": [r.loop_time for r in runs], "loop_time": statistics.median(r.loop_time for r in runs),
              "own_times": [r.own_time for r in runs], "own_time": statistics.median(r.own_time for r in runs)}
    counted = [r.counts for r in runs if r.counts]
    if counted:
        for name in ("exterior", "interface", "interior"):
            result[name] = statistics.fmean(float(c[name].mean()) for c in counted)
        for name in ("culled", "restored", "carves", "seconds", "mass_error", "restore_energy"):
            result[name] = statistics.median(float(c[name][-1]) for c in counted)
    return result


def outside_of(value, values):
    """How far a value lies below the least of them (above 0), or above the largest (below 0)."""
    return max(min(values) - value, 0) + min(max(values) - value, 0)


def ledger(unculled, culled, granules=None):
    """Granules, ids and mass that the culled runs miss at the end (the worst of them); None if a deck did not get there. Granules are
    counted against the number that the deck is known to hold, if it is; else against the unculled runs, which may differ where
    granules are inserted or leave: what all of them have is due."""
    if any(run is None for run in (*unculled, *culled)):
        return None
    masses = [float(u["mass"].sum()) for u in unculled]
    counts = [len(u) for u in unculled] if granules is None else [granules]
    ids = functools.reduce(np.intersect1d, [u["id"] for u in unculled])
    return {"granules": counts[0], "granules_of_runs": [min(counts), max(counts)],
            "lost": max((outside_of(len(run), counts) for run in (*unculled, *culled)), key=abs),
            "ids_missing": max(len(np.setdiff1d(ids, c["id"])) for c in culled),
            "mass": masses[0],
            "mass_lost": max((outside_of(float(c["mass"].sum()), masses) for c in culled), key=abs)}


def is_lost(book, unknown=True):
    """Whether a granule is missing; `unknown`: the answer when a deck did not reach its end."""
    return unknown if book is None else bool(book["lost"] or book["ids_missing"])


def check(what, value, bar, good=None):
    """A figure with a bar of its own; good when not above it, unless said. NaN is not good."""
    return {"what": what, "value": float(value), "bar": float(bar), "good": bool(value <= bar if good is None else good)}


def apart(unculled, culled, distance):
    """Mean distance of a culled from an unculled run, over all pairs; and the largest between two unculled ones."""
    error = statistics.fmean(distance(u, c) for u in unculled for c in culled)
    return error, max((distance(a, b) for a, b in itertools.combinations(unculled, 2)), default=0.0)
