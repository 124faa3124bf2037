#!/usr/bin/python3
"""Whether `audit N K` tells what culling misses: what it says of validation cases beside what the whole bed does when it wakes.

    validation/audit/audit.py [scene ...] [--publish] [--few-steps]

Each scene is run with audits. Then it is run again up to each step in which an audit began, once with all that sleeps awake from
there, once as it is. What granules do more that are awake is what culling misses: the truth. Prints truth and interval, and what audits
cost. `--publish` keeps the values in results.json, and RESULTS.md is made of them.
Exit: 0 as claimed (README.md), 1 not so, 2 a run failed.
"""
import argparse
import math
import re
import statistics
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import stats
from scipy.spatial import cKDTree

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))
from solidcull_runs import dumps, engine, errors, hertz, logs  # noqa: E402
from solidcull_runs.errors import RunError  # noqa: E402
from solidcull_runs.validation import case_runs, cases, kept_figures, pages, short_cases  # noqa: E402
from solidcull_runs.validation.points import SLEEP, Point  # noqa: E402

OUT = HERE / "out"
TUNED = ("impact", "blade_drag", "lowered_block", "rolling_wheel")
HELD_OUT = ("slow_impact", "trapdoor", "silo", "retaining_wall", "penetration", "plate_discharge")
EVERY = {"silo": 600, "trapdoor": 600, "retaining_wall": 200, "plate_discharge": 200}  # steps; of the others:
USUALLY, PATCHES = 500, 6
FEW_EVERY, FEW_PATCHES, FEW_STEPS, FEW = 40, 12, 160, "exterior sleep every 5 calm 1 speed 10"
FIGURES = ("displacement", "load", "kinetic energy")
REACH = 3.5        # d, of a patch
TOUCHES = 1.02     # radii: what is awake beside a sleeper
LEAST_HELD, WIDEST = 0.85, 10
SAID = re.compile(r"audit         = (?P<patches>\d+) patches, \d+ granules, \d+ of which woke anyway; awake, one would go (?P<way>\S+) to (?P<ways>\S+) m "
                  r"in (?P<steps>\d+) steps \(\S+ to \S+ d\)(?:, shift its loads by \S+ to \S+ N \((?P<load>\S+) to (?P<loads>\S+) %\))?, "
                  r"and have (?P<energy>\S+) to (?P<energies>\S+) J")
RUNS = re.compile(r"(?m)^Loop time of ([\d.e+-]+) .* for (\d+) steps")
BEGIN = "<!-- made of results.json -->"
HEAD = ["scene", "figure of a granule", "missed", "known to", "by the audits", "held", "width over error"]


@dataclass
class Said:
    """What a run with audits says of a granule that sleeps near what is awake; and how long the runs were."""
    patches: int
    steps: int        # of an audit
    intervals: dict   # by figure: m, share of the load, J
    lengths: list     # steps of each run behind the fix line


class PartOfCase(case_runs.CaseJob):
    """A case up to a step of one of its runs. `parts`: (number of the run, steps, commands behind them), in order; none: all of it.
    `longest`: no run has more steps."""

    def __init__(self, case, scene, keywords, name, parts, longest, *more):
        super().__init__(case, scene, Point(name, SLEEP, keywords), 0, *more)
        self.parts, self.longest = parts, longest

    def text(self):
        text = super().text()
        if self.longest:
            text = short_cases.cut_short(text, self.longest)
        if not self.parts:
            return text
        before, here, behind = text.partition(f'print "{logs.FROM_HERE}"')
        number, lines = -1, []
        for line in behind.splitlines():
            runs = re.match(r"\s*run\s", line) is not None
            number += runs
            of_run = [part for part in self.parts if runs and part[0] == number]
            lines += [command for _, steps, then in of_run for command in (f"run {steps}", *then)] or [line]
            if of_run and of_run[-1] is self.parts[-1]:
                return before + here + "\n".join(lines) + "\n"
        raise RunError(f"{self.name}: the deck has {number + 1} runs behind its fix line, not {self.parts[-1][0] + 1}")

    def ran(self):
        """Its log."""
        return self.start().wait()


class Scene:
    """A validation case that is run with audits, and again to see the truth."""

    def __init__(self, name, launcher, few_steps=False):
        self.case = cases.load([name], "quick")[0]
        self.scene, self.launcher, self.out = self.case.main_scene, launcher, OUT / ("few" if few_steps else "") / name
        self.out.mkdir(parents=True, exist_ok=True)
        files = case_runs.files_of(self.case, self.scene, self.out.parent)
        if few_steps:
            self.every, self.patches, self.longest, self.keywords = FEW_EVERY, FEW_PATCHES, FEW_STEPS, FEW
            bed = short_cases.short_bed(self.case, self.scene, self.out, files)
        else:
            self.every, self.patches, self.longest, self.keywords = EVERY.get(name, USUALLY), PATCHES, None, "exterior sleep"
            bed = case_runs.make_beds([self.case], self.out.parent, 1, say)[name, self.scene]
        self.given = {**self.case.variables(self.scene), **files, **({"restart": bed} if bed else {}), self.case.need("aside"): 0}

    def run(self, name, keywords="", parts=()):
        """Log of a run."""
        job = PartOfCase(self.case, self.scene, f"{self.keywords} {keywords}".strip(), name, list(parts), self.longest, self.out, self.given, 0,
                         self.launcher, "")
        say(f"{self.case.name}: {name}")
        return job.ran()

    def audited(self):
        log = self.run("audited", f"audit {self.every} {self.patches}")
        behind = log.partition(f"\n{logs.FROM_HERE}\n")[2].partition(f"\n{logs.TO_HERE}\n")[0]
        found = list(SAID.finditer(behind))
        if not found:
            raise RunError(f"{self.case.name}: its log says nothing of audits, or too little; let them come more often (all of it: {self.out})")
        told = {name: None if value is None else float(value) for name, value in found[-1].groupdict().items()}
        share = None if told["load"] is None else [told["load"] / 100, told["loads"] / 100]
        return Said(int(told["patches"]), int(told["steps"]), dict(zip(FIGURES, ([told["way"], told["ways"]], share, [told["energy"], told["energies"]]))),
                    [int(n) for _, n in RUNS.findall(behind)])

    def truth(self, said):
        """What is missed, by figure; of each place where an audit began."""
        begins = [(run, at) for run, length in enumerate(said.lengths) for at in range(self.every, length - said.steps + 1, self.every)]
        parts, done = [], (-1, 0)
        for run, at in begins:
            since = done[1] if done[0] == run else 0
            if at < since:
                raise RunError(f"audits every {self.every} steps reach into each other: each takes {said.steps}")
            parts += [(run, at - since, [self.dump("then", run, at, "f_cull")]), (run, said.steps, [self.dump("left", run, at)])]
            done = run, at + said.steps
        self.run("left", parts=parts)
        found = []
        for k, (run, at) in enumerate(begins):
            awake = ["thermo_style one", "unfix twin_counts", "unfix cull", f"run {said.steps}", self.dump("awake", run, at)]
            same = parts[:2 * k + 1]  # the way to there is the same to the last bit
            self.run(f"awake-{run}-{at}", parts=[*same[:-1], (run, same[-1][1], awake)])
            then, left, woken = (self.read(kind, run, at) for kind in ("then", "left", "awake"))
            missed = missing(then, left, woken)
            if missed:
                found.append(missed)
        return {figure: [f[figure] for f in found if f[figure] is not None] for figure in FIGURES}

    def dump(self, kind, run, at, more=""):
        return (f'write_dump all custom "{self.out}/{kind}-{run}-{at}.dump" id mass radius x y z vx vy vz {more} '
                f'modify format "%d{" %.15g" * (8 + bool(more))}"')

    def read(self, kind, run, at):
        return dumps.read_final(self.out / f"{kind}-{run}-{at}.dump")


def say(line):
    print(line, file=sys.stderr, flush=True)


def places(granules):
    return np.column_stack([granules[c] for c in "xyz"])


def loads(granules):
    """What presses on each, but for the modulus: normal forces of its contacts, summed."""
    pairs, force = hertz.contacts(granules)
    return sum(np.bincount(end, force, len(granules)) for end in pairs.T)


def missing(then, left, woken):
    """What a granule that slept near what was awake does more if it is woken: by figure. As audits draw it: each as often as it lies within
    reach of a sleeper beside something awake. None where nothing sleeps there."""
    ids = np.intersect1d(np.intersect1d(then["id"], left["id"]), woken["id"])
    then, left, woken = (g[np.isin(g["id"], ids)] for g in (then, left, woken))
    x, r, asleep = places(then), then["radius"], then["f_cull"] != 0
    if asleep.all() or not asleep.any():
        return None
    near = np.zeros(len(x), bool)
    pairs = cKDTree(x).query_pairs(2 * TOUCHES * r.max(), output_type="ndarray")
    touch = pairs[np.linalg.norm(x[pairs[:, 0]] - x[pairs[:, 1]], axis=1) < TOUCHES * r[pairs].sum(axis=1)]
    for one, other in (touch.T, touch.T[::-1]):
        near[one[asleep[one] & ~asleep[other]]] = True
    if not near.any():
        return None
    centres = cKDTree(x[near])
    weight = np.array([len(c) for c in centres.query_ball_point(x, REACH * 2 * r.mean())]) * asleep
    deep = weight * ~near
    load = loads(then)

    def moved(end):
        return np.linalg.norm(places(end) - x, axis=1)

    def energy(end):
        return 0.5 * end["mass"] * (end["vx"]**2 + end["vy"]**2 + end["vz"]**2)

    def shift(end):
        return np.abs(loads(end) - load)
    return {"displacement": float((weight * (moved(woken) - moved(left))).sum() / weight.sum()),
            "load": float((deep * (shift(woken) - shift(left))).sum() / (deep * load).sum()) if (deep * load).any() else None,
            "kinetic energy": float((weight * (energy(woken) - energy(left))).sum() / weight.sum())}


def records_of(name, launcher, few_steps=False):
    scene = Scene(name, launcher, few_steps)
    said = scene.audited()
    truth = scene.truth(said)
    return [{"scene": name, "figure": figure, "patches": said.patches, "steps": said.steps, "missed": [float(f"{x:.6g}") for x in truth[figure]],
             "low": said.intervals[figure][0], "high": said.intervals[figure][1]} for figure in FIGURES if said.intervals[figure]]


class Compared:
    def __init__(self, record):
        self.record, places = record, record["missed"]
        self.missed = statistics.fmean(places)
        self.known_to = float(stats.t.ppf(0.95, len(places) - 1)) * statistics.stdev(places) / len(places)**0.5 if len(places) > 1 else math.inf
        self.resolved = abs(self.missed) > self.known_to

    @property
    def held(self):
        """What is not known to be there is held where what may be there is."""
        low, high = (self.missed, self.missed) if self.resolved else (self.missed - self.known_to, self.missed + self.known_to)
        return self.record["low"] <= high and self.record["high"] >= low

    @property
    def width(self):
        """Of the interval, over what is missed; where that is smaller than what the places can tell, over this."""
        return (self.record["high"] - self.record["low"]) / max(abs(self.missed), self.known_to)

    def row(self):
        r = self.record
        unit, scale = {"displacement": ("µm", 1e6), "load": ("%", 100), "kinetic energy": ("nJ", 1e9)}[r["figure"]]
        return [r["scene"], r["figure"], f"{scale * self.missed:.2g} {unit}", f"{scale * self.known_to:.2g} {unit}",
                f"{scale * r['low']:.2g} to {scale * r['high']:.2g} {unit}", "yes" if self.held else "**no**",
                f"{self.width:.1f}" if self.resolved else f"({self.width:.1f})"]


def compared(records, scenes):
    return [Compared(r) for r in records if r["scene"] in scenes]


def as_claimed(found):
    held, narrow = sum(c.held for c in found), sum(c.width <= WIDEST for c in found)
    return held, narrow, held >= LEAST_HELD * len(found) and narrow == len(found)


def text_of(records):
    """The tables of RESULTS.md."""
    page = pages.Page()
    for title, scenes in (("Held out", HELD_OUT), ("Looked at while it was made", TUNED)):
        found = compared(records, scenes)
        if found:
            held, narrow, _ = as_claimed(found)
            page.heading(2, title)
            page.text(f"Of {len(found)} figures {held} are held. Of the {sum(c.resolved for c in found)} that the places can tell from none, "
                      f"{sum(c.held for c in found if c.resolved)} are. {narrow} intervals are at most {WIDEST} times as wide as what is missed, or as what "
                      "the places can tell.")
            page.table(HEAD, [c.row() for c in found])
    return page.markdown()


def main(argv=None):
    p = argparse.ArgumentParser(prog="audit.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("scene", nargs="*", choices=[*TUNED, *HELD_OUT, []], help="default: all")
    p.add_argument("--publish", action="store_true", help="keep the values, beside those of scenes that were not run, and make RESULTS.md of them")
    p.add_argument("--few-steps", action="store_true", help="of one scene, the truth of one place")
    a = p.parse_args(argv)
    if a.publish and a.few_steps:
        p.error("--publish does not go with --few-steps")
    launcher, records = engine.find_launcher(), []
    for name in a.scene or (["blade_drag"] if a.few_steps else TUNED + HELD_OUT):
        records += records_of(name, launcher, a.few_steps)
    if a.few_steps:
        return 0
    if a.publish and (HERE / "results.json").exists():
        ran = {r["scene"] for r in records}
        records += [r for r in kept_figures.read(HERE / "results.json") if r["scene"] not in ran]
        records.sort(key=lambda r: (TUNED + HELD_OUT).index(r["scene"]))
    text = text_of(records)
    print(text)
    if a.publish:
        kept_figures.keep(HERE, BEGIN, text, records)
    held_out = compared(records, HELD_OUT)
    return 0 if not held_out or as_claimed(held_out)[2] else 1


if __name__ == "__main__":
    errors.command("audit", main)
