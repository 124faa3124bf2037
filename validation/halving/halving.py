#!/usr/bin/python3
"""Whether `twin.py --halve` tells the error: what it says of validation cases beside their error against runs without the line.

    validation/halving/halving.py [scene ...] [--publish] [--few-steps]

Runs each scene without the line, with it, and with half the limits, granules moved apart as twin.py moves them. Prints for each metric
its error, what --halve says of it, and whether the stated interval holds it. Runs that were made with the same deck and the same fix
are not made again. `--publish` keeps the values in results.json, and RESULTS.md is made of them.
Exit: 0 as claimed (README.md), 1 not so, 2 a run failed.
"""
import argparse
import math
import statistics
import sys
from pathlib import Path

from scipy import stats

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))
from solidcull_runs import decks, engine, errors, halving  # noqa: E402
from solidcull_runs.validation import case_runs, cases, kept_figures, pages, short_cases  # noqa: E402
from solidcull_runs.validation.points import SLEEP, UNCULLED, Point  # noqa: E402

OUT = HERE / "out"
TUNED = ("slow_impact", "trapdoor", "impact")
HELD_OUT = ("retaining_wall", "silo", "gravity_switch", "point_load")
SIZES = {"impact": {"granules": 2001, "bed_granules": 2000, "L": 0.03, "steps": 2000},  # where they are not those of --quick
         "silo": {"granules": 2000, "bed_granules": 2000, "L": 0.1, "high": 0.25},
         "gravity_switch": {"granules": 2000, "bed_granules": 2000, "L": 0.072, "W": 0.072},
         "point_load": {"granules": 2000, "bed_granules": 2000, "L": 0.072, "W": 0.072}}
LINE = ["fix cull all solid/cull"]  # of each case's deck: without keywords
SHARES = {UNCULLED: None, "varied": 1, "halved": 0.5}  # of the limits; varied: from run to run, as --halve does
RUNS = {UNCULLED: 5, "varied": halving.EACH, "halved": halving.EACH}
FEW = {kind: 1 for kind in RUNS}
LEAST_HELD, WIDEST = 0.85, 10
BEGIN = "<!-- made of results.json -->"
HEAD = ["scene", "metric", "scatter", "error", "known to", "by half the limits", "lies between", "held", "width over error"]


class MovedJob(case_runs.CaseJob):
    """A run of a case whose granules are moved apart as twin.py moves them."""

    def __init__(self, case, scene, point, k, *more):
        super().__init__(case, scene, point, k, *more)
        self.seed, self.shifted = decks.SEEDS[k - 1] if k else None, True


class ShortJob(MovedJob, short_cases.ShortJob):
    """It for a few steps."""


def jobs_of(case, launcher, few_steps=False):
    scene, fix, out = case.main_scene, engine.hash_of_fix(launcher), OUT / "few" if few_steps else OUT
    (out / case.name).mkdir(parents=True, exist_ok=True)
    files = case_runs.files_of(case, scene, out)
    bed = short_cases.short_bed(case, scene, out / case.name, files) if few_steps else case_runs.make_beds([case], out, 1, say)[case.name, scene]
    given = {**case.variables(scene), **files, **({"restart": bed} if bed else {}), case.need("aside"): 0}
    kind_of_job, runs = (ShortJob, FEW) if few_steps else (MovedJob, RUNS)
    return [kind_of_job(case, scene, point_of(kind, k), k, out / case.name / "runs", given, 0, launcher, fix if kind != UNCULLED else "")
            for k in range(max(runs.values())) for kind, n in runs.items() if k < n]


def point_of(kind, k):
    share = SHARES[kind]
    return Point(kind, UNCULLED if kind == UNCULLED else SLEEP, halving.keywords(LINE, share * halving.VARIED[k]) if share else "")


def say(line):
    print(line, file=sys.stderr, flush=True)


def records_of(case, launcher, few_steps=False):
    """Runs a case; the values of its metrics by kind of run."""
    jobs = jobs_of(case, launcher, few_steps)
    done = case_runs.run_all(jobs, case_runs.Course(jobs, 1, say))
    for job, run in done.items():
        wrong = run if isinstance(run, str) else short_cases.fault(run, run.start)
        if wrong:
            raise errors.RunError(f"{case.name}: {job.name}: {wrong}")
    if few_steps:
        return []
    return [{"scene": case.name, "metric": m.name,
             **{kind: [float(f"{run.metrics[m.name]:.8g}") for job, run in done.items() if job.point.name == kind] for kind in RUNS}}
            for m in case.metrics]


class Compared:
    """A metric of a scene: its error, and what half the limits say of it."""

    def __init__(self, record):
        unculled, culled, halved = (record[kind] for kind in RUNS)
        self.scene, self.metric = record["scene"], record["metric"]
        self.mean = statistics.fmean(unculled)
        self.error = statistics.fmean(culled) - self.mean
        self.scatter = math.sqrt((statistics.variance(unculled) + statistics.variance(culled)) / 2)
        runs = len(unculled), len(culled)
        self.known_to = float(stats.t.ppf(0.95, sum(runs) - 2)) * self.scatter * math.sqrt(sum(1 / n for n in runs))  # in 90 of 100 cases
        self.told = halving.extrapolate(culled, halved)

    @property
    def moves(self):
        """Whether the line changes it at all."""
        return bool(self.scatter or self.error)

    @property
    def held(self):
        return self.told.low <= self.error <= self.told.high

    @property
    def resolved(self):
        return abs(self.error) > self.known_to

    @property
    def width(self):
        """Of the interval, over the error; where that is smaller than what the runs can tell, over this. Then the true ratio is larger."""
        return (self.told.high - self.told.low) / max(abs(self.error), self.known_to)

    def row(self):
        def share(value, sign=""):
            return f"{100 * value / abs(self.mean):{sign}.2g} %" if self.mean else f"{value:{sign}.2g}"
        told = self.told
        return [self.scene, self.metric, share(self.scatter), share(self.error, "+"), share(self.known_to), share(told.error, "+"),
                f"{share(told.low, '+')} and {share(told.high, '+')}", "yes" if self.held else "**no**", f"{self.width:.1f}" if self.resolved else f"({self.width:.1f})"]


def compared(records, scenes):
    return [c for c in map(Compared, records) if c.scene in scenes and c.moves]


def as_claimed(found):
    """How many are held, how many are no wider than WIDEST, and whether that is as README.md claims."""
    held, narrow = sum(c.held for c in found), sum(c.width <= WIDEST for c in found)
    return held, narrow, held >= LEAST_HELD * len(found) and narrow == len(found)


def text_of(records):
    """The tables of RESULTS.md."""
    page = pages.Page()
    for title, scenes in (("Held out", HELD_OUT), ("Looked at while it was made", TUNED)):
        found = compared(records, scenes)
        if found:
            resolved, rest = ([c for c in found if c.resolved == wanted] for wanted in (True, False))
            held, narrow = (sum(c.held for c in found), sum(c.width <= WIDEST for c in rest))
            page.heading(2, title)
            page.text(f"Of {len(found)} errors {held} are held. Of the {len(resolved)} that the runs can tell from none, {sum(c.held for c in resolved)} are, and "
                      f"{sum(c.width <= WIDEST for c in resolved)} intervals are at most {WIDEST} times as wide as the error. "
                      f"Of the other {len(rest)} intervals, {narrow} are at most {WIDEST} times as wide as what the runs can tell.")
            page.table(HEAD, [c.row() for c in found])
    return page.markdown()


def main(argv=None):
    p = argparse.ArgumentParser(prog="halving.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("scene", nargs="*", choices=[*TUNED, *HELD_OUT, []], help="default: all")
    p.add_argument("--publish", action="store_true", help="keep the values, and make RESULTS.md of them")
    p.add_argument("--few-steps", action="store_true", help="each deck for a few steps, of one scene")
    a = p.parse_args(argv)
    if a.publish and (a.scene or a.few_steps):
        p.error("--publish takes all scenes, and not --few-steps")
    launcher, records = engine.find_launcher(), []
    for name in a.scene or (TUNED[:1] if a.few_steps else TUNED + HELD_OUT):
        case = cases.load([name], "quick")[0]
        case.sized |= SIZES.get(name, {})
        case.scenes = {case.main_scene: case.scenes[case.main_scene]}
        records += records_of(case, launcher, a.few_steps)
    if a.few_steps:
        return 0
    text = text_of(records)
    print(text)
    if a.publish:
        kept_figures.keep(HERE, BEGIN, text, records)
    held_out = compared(records, HELD_OUT)
    return 0 if not held_out or as_claimed(held_out)[2] else 1


if __name__ == "__main__":
    errors.command("halving", main)
