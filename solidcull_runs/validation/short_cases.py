"""Each case's deck for a few steps, unculled and culled: what can be checked then, so that no deck rots."""
import re

import numpy as np

from ..engine import run_liggghts
from ..errors import RunError
from .case_runs import CaseJob, Course, files_of, run_all
from .cases import short_hash
from .points import UNCULLED, Point

STEPS, BED_STEPS = 40, 200
POINTS = (Point(UNCULLED, UNCULLED), Point("sleep", "sleep", "exterior sleep every 10 calm 1 speed 10"))
RUN = re.compile(r"^(\s*run\s+)(?!0\b)\S+.*$", re.M)


def cut_short(text, steps):
    """A deck with no run but `run 0` longer than the steps."""
    return RUN.sub(rf"\g<1>{steps}", text)


class ShortJob(CaseJob):
    def text(self):
        return cut_short(super().text(), STEPS)

    def measured(self, run):
        """What is too short for a figure has none; a column that is not there is a fault."""
        try:
            return super().measured(run)
        except RunError as e:
            if not re.search(r"measure\(\) of .* fails: (Value|Index|ZeroDivision)Error|has no number for", str(e)):
                raise
            return {}


def short_bed(case, scene, out, files):
    bed = case.bed(scene)
    if not bed:
        return None
    deck, variables = bed
    short = deck.with_name(f"{deck.stem}.few-{case.name}.in")
    try:
        short.write_text(cut_short(deck.read_text(), BED_STEPS))
        file = out / f"{short_hash([case.name, scene])}.restart"
        run_liggghts(short, deck.parent, file.with_suffix(".log"), {**variables, **files, "restart": file})
    finally:
        short.unlink(missing_ok=True)
    return file


def fault(run, start):
    """What is wrong with a run that ended, or None."""
    if not run.reached_the_end:
        return "did not reach the end of its deck"
    if run.final is None or not len(run.final):
        return "wrote no granules at its end"
    if len(np.unique(run.final["id"])) != len(run.final):
        return "ended with ids that are there twice"
    missing = np.setdiff1d(start["id"], run.final["id"])
    if len(missing):
        return f"lost granule {missing[0]:.0f} and {len(missing) - 1} more"
    if not all(np.isfinite(run.final[c]).all() for c in ("mass", "x", "y", "z", "vx", "vy", "vz")):
        return "ended with a place or speed that is no number"
    return None


def faults_of(case, out, launcher, say):
    """Runs a case for a few steps: a line for each fault."""
    out = out / case.name
    out.mkdir(parents=True, exist_ok=True)
    found = []
    for scene in case.scenes:
        files = files_of(case, scene, out)
        bed = short_bed(case, scene, out, files)
        given = {**case.variables(scene), **files, case.need("aside"): 0, **({"restart": bed} if bed else {})}
        jobs = [ShortJob(case, scene, p, 0, out, given, 0, launcher, "") for p in POINTS]
        for job in jobs:
            job.file(".kept").unlink(missing_ok=True)
        for job, run in run_all(jobs, Course(jobs, 1, say)).items():
            wrong = run if isinstance(run, str) else fault(run, run.start)
            if wrong:
                found.append(f"{case.name}, a few steps: {job.name}: {wrong}")
            elif job.kind == "culled" and run.counts is None:
                found.append(f"{case.name}, a few steps: {job.name} left no counts of the fix")
    return found
