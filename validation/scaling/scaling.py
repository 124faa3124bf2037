#!/usr/bin/python3
"""Counts messages, bytes and work of a culled run on 1 to 16 ranks, times it on one rank and two, and draws from that what a cluster
would take.

    validation/scaling/scaling.py [--ranks 1,2,4,8,16] [--only counts,times,balance] [--runs N] [--table] [--callers] [--publish] [--few-steps]
"""
import argparse
import hashlib
import json
import math
import re
import statistics
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))
sys.path.insert(0, str(HERE))
import counts  # noqa: E402
import published  # noqa: E402
from lattice import Lattice  # noqa: E402
from solidcull_runs import engine, errors  # noqa: E402

GRIDS = {1: (1, 1), 2: (2, 1), 4: (2, 2), 8: (4, 2), 16: (4, 4)}  # ranks along x and y
EVERY, ROWS, TIME_STEP = 25, 50, 3e-5  # steps between looks, between two dumps; s. As bed.in has them
BALL_SPEED = 1.5                       # m/s
SCENES = {"impact": 1, "blade": 2, "corner": 1}  # the tool, as bed.in calls it
TIMED = ("impact", "x"), ("blade", "x"), ("blade", "y")  # and along what more ranks lie
MOVE_EVERY, MOVE_ABOVE, NEVER = 20, 1.1, 1000.0  # steps between moves of cuts; the threshold of `balance`, and one that is never met
MOVED = re.compile(r"cuts between ranks moved (\d+) times; (?:so far|after the first time) the most loaded rank had (\S+) times the mean work on average, (\S+) at most")


@dataclass
class Effort:
    strong: tuple = (28, 28, 26)   # granules along x, y, z of the one bed; even numbers, so that no cut goes through a granule
    tile: tuple = (20, 20, 12)     # of each rank's part, where the bed grows with the ranks
    before: int = 150
    steps: int = 300
    timed: int = 600
    timed_bed: tuple = (56, 56, 52)
    struck: int = 450              # steps of a blow in a corner
    beds: tuple = ((28, 28, 26), (56, 56, 52))  # for it
    out: Path = HERE / "out"


FEW = Effort((8, 8, 6), (7, 7, 5), 100, 50, 50, (8, 8, 6), 50, ((8, 8, 6),), HERE / "out" / "few")


@dataclass
class Case:
    """A bed and what strikes it, on so many ranks. `way`: one bed for all of them, or as much for each."""
    scene: str
    way: str
    ranks: int
    effort: Effort
    along: str = "x"               # more ranks lie along it

    @property
    def grid(self):
        return GRIDS[self.ranks] if self.along == "x" else GRIDS[self.ranks][::-1]

    @property
    def name(self):
        return f"{self.scene}-{self.way}-{self.ranks}" + ("" if self.along == "x" else f"-{self.along}")

    def bed(self):
        many = self.way == "weak"
        cells = tuple(n * k for n, k in zip(self.effort.tile, (*self.grid, 1))) if many else self.effort.strong
        balls = (0, 0) if self.scene == "blade" else self.grid if many else (1, 1)
        return Lattice(cells, balls, BALL_SPEED * self.effort.before * TIME_STEP, self.scene == "corner")

    def variables(self, steps):
        return {"tool": SCENES[self.scene], "grid": f"{self.grid[0]} {self.grid[1]} 1", "before": self.effort.before, "steps": steps}


def place_of(case, effort):
    """A folder with the bed, and the variables that go with it."""
    folder = effort.out / case.name
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("ranks.*.dump"):
        old.unlink()
    (folder / "bed.in").write_text((HERE / "bed.in").read_text())
    return folder, case.bed().write(folder)


def atoms_by_rank(folder, ranks, after):
    """Exterior and interface granules of each rank: a mean over the rows, of the rank with most and of all; the most uneven ones first."""
    rows = {}
    for file in folder.glob("ranks.*.dump"):
        _, step, rank, _ = file.name.split(".")
        with open(file) as f:
            head = [next(f) for _ in range(4)]
        rows.setdefault(int(step), {})[int(rank)] = int(head[3])
    whole = [list(of.values()) for step, of in sorted(rows.items()) if step > after and len(of) == ranks]
    if not whole:
        raise errors.RunError(f"{folder} holds no row of granules by rank")
    return {"most": statistics.mean(map(max, whole)), "mean": statistics.mean(sum(row) / ranks for row in whole)}


def fix_counts(log):
    """Exterior, interface and interior granules, means over the rows of the last table of a log, without the first."""
    rows = []
    for line in log.splitlines():
        words = line.split()
        if words[:1] == ["Step"]:
            rows = []
        elif len(words) == 6 and re.fullmatch(r"\d+", words[0]):
            rows.append([float(w) for w in words[3:]])
    if len(rows) < 2:
        raise errors.RunError("a run printed no counts of the fix")
    return [statistics.mean(column) for column in zip(*rows[1:])]


# --- runs that are kept ---------------------------------------------------------------------------------------------

def kept(effort, name, recipe, make):
    """A record, made unless it was made before of the same."""
    file = effort.out / "runs" / f"{name}.json"
    mark = hashlib.sha1(json.dumps(recipe, default=str).encode()).hexdigest()
    if file.exists() and (note := json.loads(file.read_text()))["made_of"] == mark:
        return note["record"]
    began = time.monotonic()
    record = make()
    print(f"  {name}: {time.monotonic() - began:.0f} s", flush=True)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps({"made_of": mark, "record": record}) + "\n")
    return record


def recipe_of(case, *more):
    sources = [(HERE / name).read_text() for name in ("bed.in", "lattice.py", "count_messages.cpp", "counts.py")]
    return [case.name, vars(case.effort), sources, engine.hash_of_fix(engine.find_launcher()), *more]


def count_record(case):
    effort = case.effort

    def make():
        folder, variables = place_of(case, effort)
        counted = counts.counted("bed.in", folder, case.ranks, {**variables, **case.variables(effort.steps)}, counts.build(effort.out))
        (folder / "callers.txt").write_text("".join(f"{calls:8d} {held:14.0f} {largest:12.0f}  {call:14s} {where}\n" for call, where, calls, held, largest
                                                    in counted.by_caller(counts.library_of(engine.find_launcher()))))
        exterior, interface, interior = fix_counts((folder / "log").read_text(errors="replace"))
        return {"what": "counts", "scene": case.scene, "way": case.way, "granules": case.bed().granules,
                **counted.summary(EVERY, effort.before), "atoms": atoms_by_rank(folder, case.ranks, effort.before),
                "exterior": exterior, "interface": interface, "interior": interior}
    return kept(effort, case.name, recipe_of(case), make)


KINDS = ("unculled", 1), ("unculled", 2), ("culled", 1), ("culled", 2), ("balanced", 2)  # and ranks


def timed_run(case, kind, k):
    """Seconds of LIGGGHTS's loop, and means of the counts."""
    effort = case.effort
    folder, variables = place_of(Case(case.scene, f"{case.way}-timed", case.ranks, effort, case.along), effort)
    variables = {**variables, **case.variables(effort.timed), **{
        "culled": {}, "balanced": {"cull": f"fix cull all solid/cull every {EVERY} balance {MOVE_EVERY} {MOVE_ABOVE}"},
        "unculled": {"cull": "", "counts": "atoms atoms atoms"}}[kind]}
    text = engine.Process(engine.find_launcher(), "bed.in", folder, folder / "log", variables, case.ranks).wait()
    return {"seconds": [float(t) for t in re.findall(r"^Loop time of (\S+)", text, re.M)][-1], "counts": fix_counts(text), "run": k}


def time_record(case, runs):
    def make():
        found = {kind: [] for kind in KINDS}
        for k in range(runs):
            for kind, ranks in KINDS:
                found[kind, ranks].append(timed_run(Case(case.scene, case.way, ranks, case.effort, case.along), kind, k))
        exterior, interface, interior = found["culled", 1][0]["counts"]
        return {"what": "times", "scene": case.scene, "granules": case.bed().granules, "steps": case.effort.timed, "runs": runs,
                "exterior": exterior, "interface": interface, "interior": interior,
                "seconds": {f"{kind} {ranks}": [round(run["seconds"], 4) for run in of] for (kind, ranks), of in found.items()}}
    name = f"times-{case.scene}" + ("" if case.along == "x" else f"-{case.along}")
    return {**kept(case.effort, name, recipe_of(case, runs), make), "cut": case.along}


def share_record(cells, ranks, effort):
    """How evenly the work lies where a ball strikes a corner of the bed, and where cuts follow it."""
    case = Case("corner", "strong", ranks, replace(effort, strong=cells))

    def run(threshold):
        folder, variables = place_of(case, effort)
        cull = f"fix cull all solid/cull every {EVERY} balance {MOVE_EVERY} {threshold:g} report full"
        text = engine.Process(engine.find_launcher(), "bed.in", folder, folder / "log",
                              {**variables, **case.variables(effort.struck), "cull": cull}, ranks).wait()
        found = MOVED.findall(text)
        if len(found) != 2:
            raise errors.RunError(f"corner on {ranks} ranks: the run does not say how its cuts moved")
        (_, quiet, _), (moves, mean, most) = [(int(n), float(a), float(b)) for n, a, b in found]
        if not moves:  # so far: the steps before the blow are in it
            mean = (mean * (effort.before + effort.struck) - quiet * effort.before) / effort.struck
        return {"moves": moves, "mean": mean, "most": most, "counts": fix_counts(text)}

    def make():
        still, moved = run(NEVER), run(MOVE_ABOVE)
        exterior, interface, interior = moved["counts"]
        return {"what": "balance", "scene": "corner", "granules": case.bed().granules, "ranks": ranks, "steps": effort.struck,
                "exterior": exterior, "interface": interface, "interior": interior,
                **{name: {k: of[k] for k in ("moves", "mean", "most")} for name, of in (("still", still), ("moved", moved))}}
    return kept(effort, f"corner-{math.prod(cells)}-{ranks}", recipe_of(case), make)


# --- the command ----------------------------------------------------------------------------------------------------

def options(argv=None):
    p = argparse.ArgumentParser(prog="scaling", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--ranks", default=",".join(map(str, GRIDS)), metavar="LIST", help=f"of these: {', '.join(map(str, GRIDS))}")
    p.add_argument("--only", default="counts,times,balance", metavar="LIST", help="counts, times, balance")
    p.add_argument("--runs", type=int, default=3, metavar="N", help="of each kind, for the times (default 3)")
    p.add_argument("--table", action="store_true", help="prints what was measured before; runs nothing")
    p.add_argument("--callers", action="store_true", help="prints which functions of the fix call MPI, and how often")
    p.add_argument("--publish", action="store_true", help="keeps the figures with the sources")
    p.add_argument("--few-steps", action="store_true", help="tiny beds on one rank and two: that all of it still runs")
    a = p.parse_args(argv)
    try:
        a.ranks = sorted({int(n) for n in a.ranks.split(",")})
    except ValueError:
        p.error("--ranks takes numbers with commas between")
    a.only = a.only.split(",")
    if not set(a.ranks) <= set(GRIDS) or not set(a.only) <= {"counts", "times", "balance"} or a.runs < 1:
        p.error(f"--ranks takes {', '.join(map(str, GRIDS))}; --only takes counts, times, balance; --runs 1 or more")
    return a


def check(records, effort):
    """What holds in any of these runs; RunError, one line, where it does not."""
    for r in records:
        what = f"{r['what']} {r['scene']}"
        if r["what"] == "counts":
            of = r["plug-in"]["collectives"]
            if r["steps"] != effort.steps or r["looks"] != effort.steps // EVERY:
                raise errors.RunError(f"{what}: {r['steps']} steps and {r['looks']} looks were counted, not {effort.steps} and {effort.steps // EVERY}")
            if r["ranks"] > 1 and not (of["step"] > 0 and of["all"] > of["step"]):
                raise errors.RunError(f"{what} on {r['ranks']} ranks: no collective of the fix was counted: is it in libsolidcull.so?")
        balls = 0 if r["scene"] == "blade" else 1
        due = r["granules"] + (balls * (r["ranks"] if r.get("way") == "weak" else 1))
        there = r["exterior"] + r["interface"] + r["interior"]
        if abs(there - due) > 1e-6 * due:
            raise errors.RunError(f"{what}: {there:.0f} granules, not {due}")
        if r["what"] == "counts" and not r["interior"] > 0 and effort is not FEW:
            raise errors.RunError(f"{what}: nothing was culled")


def main():
    a = options()
    effort, ranks, runs = (FEW, [1, 2], 1) if a.few_steps else (Effort(), a.ranks, a.runs)
    effort.out.mkdir(parents=True, exist_ok=True)
    file, records = effort.out / "scaling.json", []
    if a.table:
        records = json.loads(file.read_text()) if file.exists() else []
        if not records:
            raise errors.RunError(f"no {file}: run it without --table first")
    else:
        if "counts" in a.only:
            cases = [Case(scene, way, n, effort) for scene, way in (("impact", "strong"), ("blade", "strong"), ("impact", "weak")) for n in ranks]
            cases = cases[1::2] if a.few_steps else cases
            records += [count_record(case) for case in cases]
        if "times" in a.only:
            records += [time_record(Case(scene, "strong", 1, replace(effort, strong=effort.timed_bed), along), runs)
                        for scene, along in (TIMED[:1] if a.few_steps else TIMED)]
        if "balance" in a.only:
            records += [share_record(cells, n, effort) for cells in effort.beds for n in ranks if n > 1]
        check(records, effort)
        file.write_text(json.dumps(records, indent=1) + "\n")
    text = published.text_of(records)
    (effort.out / "scaling.txt").write_text(text)
    print(f"\n{text}")
    published.draw(records, effort.out / "model.png")
    if a.callers:
        for listed in sorted(effort.out.glob("*/callers.txt")):
            print(f"{listed.parent.name}: calls, bytes, largest\n{listed.read_text()}")
    if a.publish and not a.few_steps:
        published.write(records)
    return 0


if __name__ == "__main__":
    errors.command("scaling", main)
