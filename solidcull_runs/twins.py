"""Runs of one deck with and without its solid/cull line: one after the other or several at once, and their comparison."""
import json
import os
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from . import comparisons, decks, dumps, logs, shifts
from .beds import holds_culled
from .engine import POLL, Process, find_launcher
from .errors import RunError

KINDS = ("unculled", "culled")
HEARTBEAT = 20  # s between two lines of progress
ENOUGH = 0.1    # of a run, to tell how long all of it takes


@dataclass
class Run:
    name: str
    tables: list
    loop_time: float
    counts: dict = None         # dumps.COUNTS by name, and "step": arrays; culled runs only
    final: np.ndarray = None    # id mass radius x y z of every granule at the end of the deck, by id; None if not reached
    metrics: dict = field(default_factory=dict)
    wall: float = None          # s, of the whole process
    cpu: float = None           # s of processors in that time
    ranks: int = 1
    reached_the_end: bool = False

    @property
    def own_time(self):
        """Seconds of the loop in which the run had its cores: what others on the machine took is not in it."""
        return self.loop_time * min(1.0, self.cpu / (self.wall * self.ranks)) if self.cpu and self.wall else self.loop_time

    def series(self, metric):
        """Steps and values of a metric's column."""
        return logs.series(self.tables, metric.split(":")[0])

    def steps(self):
        """Steps from the fix line to the end of the deck."""
        steps = [row[t.column("step")] for t in self.tables if t.counted and t.column("step") is not None for row in t.rows]
        return int(max(steps) - min(steps)) if steps else 0


def read_run(base, text, wanted=(), extra=None, wall=None, cpu=None, ranks=1):
    """The run whose files begin with `base` and whose log is `text`."""
    tables = logs.parse_log(text)
    run = Run(base.name, tables, logs.loop_time(tables), wall=wall, cpu=cpu, ranks=ranks, reached_the_end=logs.reached_the_end(text))
    counts, final = base.with_name(base.name + ".counts"), base.with_name(base.name + ".final")
    run.counts = dumps.read_counts(counts) if counts.exists() else None
    run.final = dumps.read_final(final) if final.exists() else None
    if run.final is None and extra:
        raise RunError(f"{run.name} ended without writing its granules; see {base.with_name(base.name + '.log')}")
    run.metrics = {m: logs.metric_of(tables, m) for m in wanted} | (extra(run) if extra else {})
    return run


class Job:
    """A run of a deck that is to be made. `extra(run)`: more metrics, a dict by name; `keywords`: more of them on the fix line, of a
    culled run."""

    def __init__(self, deck, out, kind, k, variables=None, ranks=1, shifted=True, wanted=(), extra=None, launcher=None, keywords=None,
                 name=None):
        self.kind, self.name, self.keywords = kind, name or f"{kind}-{k + 1}", keywords
        self.deck, self.base = Path(deck).resolve(), Path(out).resolve() / self.name
        self.variables, self.ranks = {**(variables or {}), "twin": self.name}, ranks
        self.seed, self.shifted = decks.SEEDS[k - 1] if k and shifted else None, shifted
        self.wanted, self.extra, self.launcher = wanted, extra, launcher

    def file(self, suffix):
        return self.base.with_name(self.name + suffix)

    def text(self):
        """The deck of this run."""
        lines = decks.read_deck(self.deck)
        fix = decks.cull_fix(lines, self.deck.name)
        restart = decks.restart_of(lines, fix, self.variables)
        restored = restart is not None and holds_culled(self.deck.parent / restart)
        shift = shifts.Shift(self.seed, lines) if self.shifted else None
        made = "\n".join(decks.make_deck(lines, fix, self.kind != "unculled", shift, self.base, restored)) + "\n"
        return decks.with_keywords(made, self.keywords) if self.keywords and self.kind != "unculled" else made

    def kept(self):
        """The run, if it need not be made."""
        return None

    def start(self):
        self.base.parent.mkdir(parents=True, exist_ok=True)
        for suffix in (".counts", ".final"):
            self.file(suffix).unlink(missing_ok=True)
        self.file(".in").write_text(self.text())
        return Process(find_launcher(self.launcher), self.file(".in"), self.deck.parent, self.file(".log"), self.variables, self.ranks)

    def finish(self, process):
        return read_run(self.base, process.text(), self.wanted, self.extra, process.wall, process.cpu, self.ranks)


class KeptJob(Job):
    """A run that is not made again as long as its deck, variables and `made_with` (a text) are the same."""

    def __init__(self, *args, made_with="", **how):
        super().__init__(*args, **how)
        self.made_with = made_with

    def recipe(self):
        return json.dumps([{name: str(value) for name, value in self.variables.items()}, self.text(), self.made_with])

    def kept(self):
        note = json.loads(self.file(".kept").read_text()) if self.file(".kept").exists() else {}
        if note.get("recipe") != self.recipe() or not (self.file(".log").exists() and self.file(".final").exists()):
            return None
        return read_run(self.base, self.file(".log").read_text(errors="replace"), self.wanted, self.extra, note["wall"], note["cpu"], self.ranks)

    def start(self):
        self.file(".kept").unlink(missing_ok=True)
        return super().start()

    def finish(self, process):
        run = super().finish(process)
        self.file(".kept").write_text(json.dumps({"recipe": self.recipe(), "wall": run.wall, "cpu": run.cpu}))
        return run


class Progress:
    """Says, after each run and every HEARTBEAT, how far the runs are and about how long the rest takes. `steps` of one run, if known."""

    def __init__(self, jobs, at_once, say, steps=None):
        self.kinds = [job.kind for job in jobs]
        self.at_once, self.say, self.steps = at_once, say, steps
        self.walls = {kind: [] for kind in self.kinds}  # s, of the finished runs
        self.spoken = time.monotonic()

    def ended(self, run, kind, running):
        self.walls[kind].append(run.wall)
        self.speak(f"{run.name}: {run.loop_time:.1f} s", running)

    def skipped(self, run, kind):
        self.kinds.remove(kind)
        self.say(f"{run.name}: {run.loop_time:.1f} s, made before")

    def tick(self, running):
        if time.monotonic() - self.spoken > HEARTBEAT:
            self.speak(", ".join(f"{job.name} at step {logs.steps_made(process.log):,}" for job, process in running), running)

    def speak(self, what, running):
        done = sum(map(len, self.walls.values()))
        left = self.seconds_left(running)
        time_left = "" if not left else f", about {left:.0f} s left" if left < 100 else f", about {left / 60:.0f} min left"
        self.say(f"{what}; {done} of {len(self.kinds)} runs done{time_left if done < len(self.kinds) else ''}")
        self.spoken = time.monotonic()

    def seconds_left(self, running):
        """Of how far the running ones are, and what finished ones of their kind took; None while a kind is unknown."""
        now, going = time.monotonic(), []
        each = {kind: sum(walls) / len(walls) for kind, walls in self.walls.items() if walls}
        for job, process in running:
            step = logs.steps_made(process.log) if self.steps else 0
            if self.steps and step >= ENOUGH * self.steps:
                going.append((now - process.began) * max(0.0, self.steps / step - 1))
                each.setdefault(job.kind, now - process.began + going[-1])
            elif job.kind in each:
                going.append(max(0.0, each[job.kind] - (now - process.began)))
        if not set(self.kinds) <= set(each) | {"files"}:
            return None
        each.setdefault("files", each.get("culled", 0.0))
        begun = {kind: len(walls) + sum(job.kind == kind for job, _ in running) for kind, walls in self.walls.items()}
        waiting = sum(each[kind] * (self.kinds.count(kind) - n) for kind, n in begun.items() if kind in each)  # else all were made before
        return max([*going, (sum(going) + waiting) / self.at_once])


def run_jobs(jobs, at_once=1, say=lambda line: None, steps=None):
    """The runs of the jobs, in their order, so many at once; if one fails, the others are stopped."""
    waiting, running, done = list(jobs), [], {}
    progress = Progress(jobs, at_once, say, steps)
    try:
        while waiting or running:
            while waiting and len(running) < at_once:
                job = waiting.pop(0)
                if (run := job.kept()):
                    done[job.name] = run
                    progress.skipped(run, job.kind)
                else:
                    running.append((job, job.start()))
            for job, process in [pair for pair in running if pair[1].ended()]:
                running.remove((job, process))
                done[job.name] = job.finish(process)
                progress.ended(done[job.name], job.kind, running)
            progress.tick(running)
            time.sleep(POLL)
    finally:
        for _, process in running:
            process.stop()
    return [done[job.name] for job in jobs]


def in_turns(unculled, culled):
    """Kind and number of each run: unculled and culled ones in turns."""
    return [(kind, k) for k in range(max(unculled, culled)) for kind, n in zip(KINDS, (unculled, culled)) if k < n]


def cores():
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0))


def compare(deck, wanted=(), launcher=None, out=None, unculled=3, culled=1, vary=None, variables=None, ranks=1, margin=comparisons.MARGIN,
            extra=None, at_once=1, steps=None, least_margins=None, granules=None, keywords=None, also=(),
            say=lambda line: None):
    """Runs the deck unculled and culled in turns; returns (result, runs by kind). `wanted`: thermo metrics. `vary`: (variable, values),
    one value a pair of runs, in place of moving all granules. `extra(run)`: more metrics, a dict by name. `steps`, `granules`: of the
    deck, if known. `keywords`: more of them on the fix line. `also`: jobs
    that are run behind these. `result` is plain data (see twin.json)."""
    deck = Path(deck).resolve()
    lines = decks.read_deck(deck)
    unculled_deck = decks.make_deck(lines, decks.cull_fix(lines, deck.name), False, None, "-")
    decks.check_metrics(wanted, unculled_deck)
    launcher = find_launcher(launcher)
    out = Path(out) if out else deck.with_name(deck.name + ".twin")
    if vary:
        decks.check_vary(*vary, max(unculled, culled), lines)
    if (last := decks.ends_before(unculled_deck)):
        say(f"compared up to line {last}, which has no meaning without the solid/cull fix")
    jobs = [Job(deck, out, kind, k, {**(variables or {}), **({vary[0]: vary[1][k]} if vary else {})}, ranks, not vary, wanted, extra, launcher,
                keywords)
            for kind, k in in_turns(unculled, culled)]
    done = run_jobs([*jobs, *also], at_once, say, steps)
    runs = {kind: [run for job, run in zip(jobs, done) if job.kind == kind] for kind in KINDS}
    return comparisons.judge(runs["unculled"], runs["culled"], margin, least_margins, granules), runs
