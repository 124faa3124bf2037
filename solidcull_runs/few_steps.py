"""What can be checked of runs after a few steps, when no figure means anything yet: that the deck does what it is for."""
import math

import numpy as np

from .errors import RunError


def finite(values):
    return all(math.isfinite(v) for v in values)


def check(runs, granules, steps, locks=True, poured=0, where=""):
    """Raises RunError, one line, at the first of these that does not hold in a run:
    - it reached the last line of its deck, `steps` steps after the fix line;
    - every granule is there at its end, once, at a place: `granules`, known from the deck and not from a run;
    - unculled and culled runs end with the same ids and the same mass;
    - each metric is a finite number;
    - at each row of a culled run what LIGGGHTS and the store hold are all granules, and so are the fix's own counts
      (`poured`: how many of them the deck adds on the way);
    - with `locks`, a culled run locked granules."""
    for kind, of_kind in runs.items():
        for run in of_kind:
            wrong = (fault_of_end(run, granules, steps) or fault_of_metrics(run) or fault_of_ids(run, runs["unculled"][0])
                     or (kind == "culled" and fault_of_counts(run, range(granules - poured, granules + 1) if poured else (granules,), locks)))
            if wrong:
                raise RunError(f"{where}few steps: {run.name} {wrong}")


def fault_of_end(run, granules, steps):
    if not run.reached_the_end or run.final is None:
        return "did not reach the end of its deck"
    if run.steps() != steps:
        return f"made {run.steps()} steps after the fix line, not {steps}"
    if len(run.final) != granules or len(np.unique(run.final["id"])) != granules:
        return f"ended with {len(run.final)} granules of {len(np.unique(run.final['id']))} ids, not {granules}"
    if not all(np.isfinite(run.final[c]).all() for c in ("mass", "x", "y", "z")):
        return "ended with granules whose place or mass is no number"
    return None


def fault_of_metrics(run):
    broken = [name for name, value in run.metrics.items() if not math.isfinite(value)]
    return f"has no number for {', '.join(broken)}" if broken else None


def fault_of_ids(run, unculled):
    if not np.array_equal(run.final["id"], unculled.final["id"]):
        return f"ended with other ids than {unculled.name}"
    mass, due = run.final["mass"].sum(), unculled.final["mass"].sum()
    if abs(mass - due) > 1e-12 * due:
        return f"ended with {mass:.15g} kg, {unculled.name} with {due:.15g} kg"
    return None


def fault_of_counts(run, allowed, locks):
    """`allowed`: the numbers of granules that there may be on the way."""
    if run.counts is None:
        return "left no counts of the fix"
    wholes = run.counts["exterior"] + run.counts["interface"] + run.counts["interior"]
    if not set(wholes.tolist()) <= set(allowed):
        return f"counted {min(wholes):.0f} to {max(wholes):.0f} exterior, interface and interior granules, not {allowed[-1]}"
    rows = 0
    for table in run.tables:
        atoms, stored = table.column("atoms"), table.column("f_cull[3]")
        if table.counted and atoms is not None and stored is not None:
            for row in table.rows:
                rows += 1
                if row[atoms] + row[stored] not in allowed:
                    return f"held {row[atoms]:.0f} atoms and {row[stored]:.0f} stored granules, not {allowed[-1]} together"
    if not rows:
        return "printed no row with `atoms` and `f_cull[3]`"
    if locks and not (run.counts["interface"] + run.counts["interior"]).max() > 0:
        return "locked no granule"
    return None
