#!/usr/bin/python3
"""Numerical stability: decks that a solver of granules fails at, culled with `exterior live` and with `exterior sleep`, and unculled.

    validation/stress/stress.py [--quick|--full] [--few-steps] [CASE ...]

Settles the beds once (out/*.restart), runs each part of each case (unculled, live, sleep), prints what holds and leaves
all figures in out/KIND/CASE.json. README.md says what is held against what. Runs are kept as long as deck, variables and the fix are
the same. `--quick` (the default) takes minutes, `--full` about an hour; `--few-steps` is for CI: every deck for a few steps, without
bars. Exit: 0 all good, 1 a bar missed, 2 no result.
"""
import argparse
import hashlib
import json
import math
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
MOTION = HERE.parent / "motion"
SHARED = [MOTION / f for f in ("engine.in", "material.in", "sides.in", "box.in")]  # of motion's decks
sys.path.insert(0, str(HERE.parents[1]))
from solidcull_runs import beds, engine, errors, few_steps, logs, tables, twins  # noqa: E402
from solidcull_runs.dumps import read_final, snapshots  # noqa: E402
from solidcull_runs.comparisons import check  # noqa: E402

GRAVITY, DENSITY, POISSON = 9.81, 2500, 0.3
KINDS = {"live": "exterior live", "sleep": "exterior sleep"}  # of culled runs, and their keywords
INJECTED = 1e-6        # m g d per restored granule: energy that the fix may add
STILL = 1e-9           # M g d: kinetic energy of a bed that was at rest from the start
CALMED = 1e-4          # M g d: of one that has come to rest again; a bed that ends with more, its time step at the limit, is unstable
PEAK, FASTEST, LATE = 1.1, 1.5, 2.0  # culled over unculled: largest kinetic energy, largest speed, kinetic energy at the end
SCATTERED = 8          # unculled runs where one ball that rolls to and fro has all the energy at the end: README.md says why so many
SURE = 0.25            # of the Rayleigh time: a run with such steps or smaller ones has to be stable
SETTLED = 0.2          # of the Rayleigh time: the time step until a bed is culled
FEW_KEYWORDS = "depth 0.25 voxel 0.125 every 20 calm 1 speed 0.1"  # so that a small bed locks granules within few steps


@dataclass
class Effort:
    """How much is run: `quick`, `full` or `few`."""
    kind: str = "quick"

    @property
    def out(self):
        return HERE / "out" / self.kind

    def of(self, quick, full, few):
        return {"quick": quick, "full": full, "few": few}[self.kind]


effort = Effort()


@dataclass
class Part:
    """One deck with its variables, to be run unculled, live and asleep."""
    name: str
    deck: str
    variables: dict
    granules: int
    steps: int                      # after the fix line
    calm: float = CALMED            # M g d: kinetic energy that is allowed at the end in any case
    at_limit: bool = False          # unculled may be unstable
    lossy: bool = False             # unculled may lose granules
    alone: dict = field(default_factory=dict)  # variables of the unculled run alone
    keywords: str = ""              # more of them on the fix line
    asleep: str = ""                # and of the run with `exterior sleep`
    once: bool = False              # one unculled run is enough, or all that there can be; else `beside`, 1e-5 d apart
    beside: int = 3
    more: object = None             # more(part, runs): more checks
    diameter: float = 0.005         # m: the d of m g d
    young: float = 5e6              # Pa

    def out(self):
        return effort.out / self.name

    def work(self):
        return self.granules * self.steps * (self.unculled_runs() + len(KINDS))

    def unculled_runs(self):
        return 1 if self.once or effort.kind == "few" else self.beside


# --- beds -----------------------------------------------------------------------------------------------------------

def settled(bed, few=None, **variables):
    """The restart file of a bed at rest, relative to this folder."""
    if effort.kind == "few":
        variables.update({"granules": 150, "pour": 0.15, "damp": 0.15, "free": 0.02, "stills": 1, "top": 0.1, **(few or {})})
    file = effort.out / f"{bed}.restart"
    return beds.settled(file, MOTION / "settle.in", SHARED, {"name": "box", **variables}).relative_to(HERE)


def count(granules):
    return 150 if effort.kind == "few" else granules


def rayleigh_time(radius, young):
    """Rayleigh time of a granule (s)."""
    shear = young / (2 * (1 + POISSON))
    return math.pi * radius * math.sqrt(DENSITY / shear) / (0.1631 * POISSON + 0.8766)


BOX = (0.04, 0.035)   # m: L and W of the beds of 5 mm
SMALLEST = 0.0023     # m: the smaller radius in them


def soft_bed(**more):
    """Granules of 5 mm, E = 5e6."""
    n = effort.of(300, 500, 150)
    name = "soft" + "".join(f"-{k}{v:g}" for k, v in more.items())
    return settled(name, granules=n, L=BOX[0], W=BOX[1], stills=3, **more), n


# --- runs -----------------------------------------------------------------------------------------------------------

class StressJob(twins.KeptJob):
    """A run that may stop: then the run has a `failure`, the line that says why."""

    def note(self):
        return json.loads(self.file(".kept").read_text()) if self.file(".kept").exists() else {}

    def kept(self):
        note = self.note()
        if note.get("failure") and note["recipe"] == self.recipe() and self.file(".log").exists():
            return self.stopped(note["failure"], note["wall"], note["cpu"])
        run = super().kept()
        if run:
            run.failure = None
        return run

    def stopped(self, failure, wall, cpu):
        tables_ = logs.parse_log(self.file(".log").read_text(errors="replace"))
        run = twins.Run(self.name, tables_, logs.loop_time(tables_), counts={} if self.kind == "culled" else None, wall=wall, cpu=cpu)
        run.failure = failure
        return run

    def finish(self, process):
        if not process.child.returncode:
            run = super().finish(process)
            run.failure = None
            return run
        try:
            process.text()
        except errors.RunError as e:
            failure = str(e)
        run = self.stopped(failure, process.wall, process.cpu)
        self.file(".kept").write_text(json.dumps({"recipe": self.recipe(), "wall": run.wall, "cpu": run.cpu, "failure": failure}))
        return run


def run_part(part, say):
    """The runs of a part, by kind: a list of them."""
    launcher = engine.find_launcher()
    sources = "".join(f.read_text() for f in [*SHARED, *(HERE / f"{name}.in" for name in ("start", "defaults", "computes", "dry", "sticky"))])
    bed = beds.recipe_of(HERE / part.variables["restart"]) if "restart" in part.variables else ""
    jobs = []
    for k, (name, keywords) in enumerate([(f"unculled-{k + 1}", None) for k in range(part.unculled_runs())] + list(KINDS.items())):
        kind = "culled" if keywords else "unculled"
        variables = {"start_dump": (part.out() / "start.dump").relative_to(HERE), "folder": part.out().relative_to(HERE), **part.variables,
                     **(part.alone if not keywords else {})}
        if keywords:
            few_keywords = FEW_KEYWORDS if effort.kind == "few" and part.deck != "heavy.in" else ""
            keywords = " ".join(filter(None, (keywords, part.keywords, part.asleep if name == "sleep" else "", few_keywords)))
        made_with = hashlib.sha1((sources + bed + (engine.hash_of_fix(launcher) if keywords else "")).encode()).hexdigest()
        jobs.append(StressJob(HERE / part.deck, part.out(), kind, 0 if keywords else k, variables, launcher=launcher, keywords=keywords, name=name,
                              made_with=made_with))
    runs = twins.run_jobs(jobs, say=say, steps=part.steps)
    return {"unculled": [run for job, run in zip(jobs, runs) if job.kind == "unculled"], **{run.name: [run] for run in runs if run.name in KINDS}}


# --- what is held against what --------------------------------------------------------------------------------------

class Figures:
    """What is asked of a run. Energies in M g d: mass of all granules times gravity times the mean diameter."""

    def __init__(self, part, run, unit, granules):
        self.failure, self.at_limit = run.failure, part.at_limit and effort.kind != "few"
        self.finite, self.peak, self.late, self.fastest, self.lost = True, math.nan, math.nan, math.nan, None
        values = [row for t in run.tables if t.counted for row in t.rows]
        self.finite = all(math.isfinite(v) for row in values for v in row)
        if len(values) > 1:
            energy = sum_of(run, ("f_cull[27]", "c_ke"), ("f_cull[28]", "c_rot"))[1:] / unit
            tenth = max(1, len(energy) // 10)
            self.peak, self.late = float(energy.max()), float(energy[-tenth:].max())
            self.fastest = float(run.series("v_fastest")[1][1:].max())
        self.finite = self.finite and all(np.isfinite(column).all() for column in (run.counts or {}).values())
        if run.final is not None:
            self.finite = self.finite and all(np.isfinite(run.final[c]).all() for c in ("mass", "x", "y", "z"))
            self.lost = granules - len(np.unique(run.final["id"]))
        culled = run.counts is not None and len(values) > 0
        self.restored = float(run.series("f_cull[7]")[1].max()) if culled else 0.0
        if culled and part.deck == "cycle.in":
            self.restored = sum(culled_at_each_unfix(run))
        self.carves = float(run.series("f_cull[8]")[1].max()) if culled else 0.0
        self.most_culled = float((run.series("f_cull[2]")[1] + run.series("f_cull[3]")[1]).max()) if culled else 0.0
        self.added = float(run.series("f_cull[12]")[1].max()) if culled else 0.0  # J

    def stable(self):
        return not self.failure and self.finite and not (self.at_limit and self.late > CALMED)


def culled_at_each_unfix(run):
    """Granules that were culled at the last row before each `unfix` of `cycle.in`."""
    return [t.rows[-1][t.column("f_cull[2]")] + t.rows[-1][t.column("f_cull[3]")] for t in run.tables
            if t.counted and t.rows and t.column("f_cull[2]") is not None]


def sum_of(run, *columns):
    return sum(run.series(whole if run.counts is not None else of_atoms)[1] for whole, of_atoms in columns)


def unit_of(part, granules):
    """M g d (J); `granules`: of a run's end, None if none got there."""
    mass = part.granules * DENSITY * math.pi / 6 * part.diameter**3 if granules is None else float(granules["mass"].sum())
    return mass * GRAVITY * part.diameter


def judge(part, runs):
    """Checks and figures of a part."""
    finals = [run.final for of_kind in runs.values() for run in of_kind if run.final is not None]
    unit = unit_of(part, finals[0] if finals else None)
    figures = {kind: [Figures(part, run, unit, part.granules) for run in of_kind] for kind, of_kind in runs.items()}
    unculled = figures["unculled"]
    for f in unculled:
        if (f.failure or not f.finite) and not (part.at_limit and effort.kind != "few"):
            raise errors.RunError(f"{part.name}: {f.failure or 'the unculled run has figures that are no numbers'}")
    stable = all(f.stable() for f in unculled)
    checks = []
    for kind in KINDS:
        of_run = of_stable if stable else of_unstable
        checks += of_run(f"{part.name}, {kind}: ", part, figures[kind][0], runs[kind][0], unculled, runs["unculled"][0], unit)
    if stable and part.more and not any(figures[kind][0].failure for kind in KINDS):
        checks += part.more(part, runs, unit / part.granules)
    if effort.kind == "few":
        few_steps.check({"unculled": runs["unculled"], "culled": runs["live"] + runs["sleep"]}, part.granules, part.steps,
                        part.young == 5e6 and part.name != "cycle-creep",  # these beds still fall
                        where=f"{part.name}, ")
    return checks, {kind: vars(worst(of_kind)) | {"stable": all(f.stable() for f in of_kind)} for kind, of_kind in figures.items()}


def worst(figures):
    """The run with the most kinetic energy at its end, or one that stopped."""
    return max(figures, key=lambda f: (f.failure is not None, f.late))


def of_unstable(what, part, c, run, unculled, _, unit):
    """Nothing of ours may crash: a run ends, or LIGGGHTS or the fix says in one line why not."""
    crashed = c.failure is not None and ("was killed" in c.failure or "ERROR" not in c.failure)
    return [check(what + "unculled is unstable; no crash", crashed, 0)]


def of_stable(what, part, c, run, unculled, beside, unit):
    checks = [check(what + "stopped, or not finite", bool(c.failure) or not c.finite, 0)]
    if c.failure:
        print(f"  {c.failure}", flush=True)
        return checks
    lost, mass = max(u.lost for u in unculled) if part.lossy else 0, beside.final["mass"].sum()
    whole = part.lossy or np.array_equal(run.final["id"], beside.final["id"]) and abs(run.final["mass"].sum() - mass) <= 1e-12 * mass
    slow = math.sqrt(2 * part.calm * part.granules * GRAVITY * part.diameter)  # m/s: all of that energy in one granule

    def largest(name):
        return max(getattr(u, name) for u in unculled)
    return checks + [
        check(what + "granules lost", c.lost, lost, c.lost <= lost and whole),
        check(what + "kinetic energy, largest (M g d)", c.peak, max(PEAK * largest("peak"), part.calm)),
        check(what + "kinetic energy, last tenth (M g d)", c.late, max(LATE * largest("late"), part.calm)),
        check(what + "largest speed (m/s)", c.fastest, max(FASTEST * largest("fastest"), slow)),
        check(what + "energy added, of m g d per granule restored", c.added * part.granules / unit / max(c.restored, 1), INJECTED)]


# --- energy of a bed ------------------------------------------------------------------------------------------------

def mechanical_energy(g, young, size):
    """Energy (J) of a bed in its box from places, velocities and spins: kinetic, of height, and elastic of the
    normal contacts after Hertz, with granules, floor and sides. Tangential springs are left out: they are in no dump."""
    m, r, x = g["mass"], g["radius"], np.stack([g[c] for c in "xyz"], 1)
    kinetic = 0.5 * (m * sum(g[c]**2 for c in ("vx", "vy", "vz"))).sum()
    kinetic += 0.2 * (m * r**2 * sum(g[c]**2 for c in ("omegax", "omegay", "omegaz"))).sum()
    i, j = np.triu_indices(len(r), 1)
    near = np.abs(x[i, 2] - x[j, 2]) < 2 * r.max()
    i, j = i[near], j[near]
    overlap = np.maximum(r[i] + r[j] - np.sqrt(((x[i] - x[j])**2).sum(1)), 0)
    springs = (np.sqrt(r[i] * r[j] / (r[i] + r[j])) * overlap**2.5).sum()
    for gap in (x[:, 0], size[0] - x[:, 0], x[:, 1], size[1] - x[:, 1], x[:, 2]):
        springs += (np.sqrt(r) * np.maximum(r - gap, 0)**2.5).sum()
    return kinetic + GRAVITY * (m * x[:, 2]).sum() + 8 / 15 * young / (2 * (1 - POISSON**2)) * springs


def read_whole(file):
    (_, columns, rows), = snapshots(file)
    return dict(zip(columns, rows[np.argsort(rows[:, columns.index("id")])].T))


def cycles_energy(part, runs, grain):
    """What the bed's energy rises by from each cull to the restore, over all cycles. It may fall: that is friction, or what culls take."""
    def rises(name):
        total = 0.0
        for k in range(1, part.variables["cycles"] + 1):
            a, b = (mechanical_energy(read_whole(part.out() / f"{name}.{k}.{when}"), part.young, BOX) for when in ("culled", "restored"))
            total += max(0.0, b - a)
        return total

    checks = []
    for kind in KINDS:
        last = culled_at_each_unfix(runs[kind][0])
        checks.append(check(f"{part.name}, {kind}: rise of mechanical energy while culled, of m g d per granule restored",
                            rises(kind) / grain / max(1, sum(last)), INJECTED))
        checks.append(check(f"{part.name}, {kind}: cycles in which nothing was culled", sum(n == 0 for n in last), part.variables["cycles"] // 10))
    return checks


# --- cases ----------------------------------------------------------------------------------------------------------

def drift(run, start):
    """Largest displacement of a granule since the start dump, in mean diameters."""
    a, b = read_final(start), run.final
    moved = np.sqrt(sum((a[c] - b[c])**2 for c in "xyz"))
    return float(moved.max() / (2 * a["radius"].mean()))


def stays(part, runs, grain):
    start = part.out() / "start.dump"
    bar = max(1e-6, drift(runs["unculled"][0], start))
    return [check(f"{part.name}, {kind}: drift (d)", drift(runs[kind][0], start), bar) for kind in KINDS]


def rest():
    """A bed at rest for 10^6 steps; and one whose steps pass number 2^31."""
    n = effort.of(200, 500, 150)
    # rolling friction (epsd2) is a spring without damping: a loose granule swings for seconds
    bed = settled("column", L=0.03, W=0.03, granules=n, top=0.5, **effort.of({"free": 1, "stills": 8}, {"free": 3, "stills": 8}, {}))
    base = {"restart": bed, "L": 0.03, "W": 0.03, "before": effort.of(1000, 1000, 50)}
    steps, passing = effort.of(100_000, 1_000_000, 500), effort.of(8000, 50_000, 400)
    return [Part("rest", "rest.in", {**base, "steps": steps, "rows": effort.of(100, 1000, 50)}, n, steps, STILL, once=True, more=stays),
            Part("rest-step-2^31", "rest.in", {**base, "steps": passing, "rows": effort.of(50, 100, 50), "first": 2**31 - passing // 2}, n, passing,
                 STILL, once=True, more=stays)]


def struck(name, bed, n, young, share, at_limit=False, blow=0.5, times=None, **more):
    """A part with `blow.in`, of the same times (s, before the blow and after it) whatever the time step."""
    whole = rayleigh_time(SMALLEST, young)
    dt = share * whole
    steps = effort.of(2000, 5000, 200)
    wait, after = (100, 200) if effort.kind == "few" else (round(t / dt) for t in times or effort.of((0.1, 0.4), (0.3, 0.8), None))
    return Part(name, "blow.in", {"restart": bed, "L": BOX[0], "W": BOX[1], "E": young, "first_dt": SETTLED * whole, "dt": dt, "steps": steps,
                                  "wait": wait, "after": after, "blow": blow, "before": effort.of(500, 1000, 50), "rows": 20, **more},
                n, steps + wait + after, at_limit=at_limit, young=young)


def timestep():
    """Ever larger time steps, in percent of the Rayleigh time, until the unculled run is unstable and beyond."""
    bed, n = soft_bed()
    shares = effort.of((10, 20, 30, 35, 40, 45, 50, 70), (5, 10, 15, 20, 25, 28, 30, 32, 34, 36, 38, 40, 45, 50, 60, 80), (10, 30))
    return [struck(f"timestep-{s}", bed, n, 5e6, s / 100, s / 100 > SURE) for s in shares]


def stiffness():
    """Young's modulus up to 1e9, two time steps; and a mix of 1 and 5 mm."""
    parts = []
    n = effort.of(200, 500, 150)
    for young in effort.of((1e8, 1e9), (5e7, 1e8, 1e9), (1e9,)):
        whole = rayleigh_time(SMALLEST, young)
        bed = settled(f"stiff-{young:g}", L=BOX[0], W=BOX[1], granules=n, E=young, dt=0.22 * whole, top=0.08, pour=0.15, damp=0.2, free=0.03,
                      stills=4, few={"pour": 0.01, "damp": 0.002, "free": 0.0005})
        for share in effort.of((25, 60), (15, 25, 40, 60, 80), (25,)):
            parts.append(struck(f"stiffness-{young:g}-{share}", bed, n, young, share / 100, share / 100 > SURE, blow=0.2,
                                times=effort.of((0.02, 0.3), (0.1, 0.6), None)))
    if effort.kind != "few":
        for young in effort.of((5e6,), (5e6, 1e9), ()):
            whole = rayleigh_time(0.0005, young)
            bed = settled(f"mix-{young:g}", L=0.012, W=0.012, granules=450, small=0.0005, large=0.0025, share=0.25, E=young, top=0.06, dt=0.22 * whole,
                          pour=0.15, damp=0.15, free=0.05, stills=6)
            for share in effort.of((25,), (5, 15, 25), ()):
                dt = share / 100 * whole
                steps = effort.of(8000, 20000, 300)
                parts.append(Part(f"stiffness-mix-{young:g}-{share}", "rest.in", {"restart": bed, "L": 0.012, "W": 0.012, "E": young, "dt": dt,
                                  "skin": 0.00015, "before": 100, "rows": 20, "steps": steps}, 450, steps, STILL, once=True, diameter=0.001, young=young))
    return parts


def cohesion():
    """Granules that stick, SJKR, ever more, until the unculled run does not come to rest."""
    bed, n = soft_bed()
    return [struck(f"cohesion-{c:g}", bed, n, 5e6, 0.15, c > 3e4, glue="sticky", cohesion=c) for c in effort.of((1e4, 3e4, 1e5), (1e4, 3e4, 5e4, 1e5, 2e5), (1e5,))]


def ratio():
    """One granule of 10 and 20 times the diameter falls on small ones, and is pushed aside."""
    parts = []
    for times, side, quick, full in effort.of(((10, 0.03, 800, 0), (20, 0.045, 1500, 0)), ((10, 0.04, 0, 2000), (20, 0.05, 0, 3000)), ((20, 0.045, 0, 0),)):
        n = effort.of(quick, full, 150)
        dt = 0.2 * rayleigh_time(0.00095, 5e6)
        bed = settled(f"fine-{times}", L=side, W=side, granules=n, small=0.00095, large=0.00105, top=0.05, dt=dt, pour=0.12, damp=0.15, free=0.05,
                      stills=2, few={"pour": 0.05, "damp": 0.05, "free": 0.01})
        steps, after = effort.of((4000, 8000), (20_000, 40_000), (200, 200))
        parts.append(Part(f"ratio-{times}", "ratio.in", {"restart": bed, "L": side, "W": side, "dt": dt, "skin": 0.0003, "diameter": times * 0.002,
                          "r": 0.00105, "steps": steps, "after": after, "rows": 20}, n + 1, steps + after, diameter=0.002,
                          beside=effort.of(3, SCATTERED, 1)))
    return parts


def tap():
    """A granule is pressed down at one place, again and again."""
    bed, n = soft_bed()
    steps = effort.of(60_000, 200_000, 500)
    return [Part("tap", "tap.in", {"restart": bed, "L": BOX[0], "W": BOX[1], "steps": steps, "rows": effort.of(20, 20, 50),  # at every phase of a press
                                   "before": effort.of(2000, 2000, 50)}, n + 1, steps, more=carves_thousands)]


def carves_thousands(part, runs, grain):
    due = effort.of(300, 3000, 0)
    return [check(f"{part.name}, {kind}: carves, {due} at least", runs[kind][0].series("f_cull[8]")[1].max(), due,
                  runs[kind][0].series("f_cull[8]")[1].max() >= due) for kind in KINDS]


def cycle():
    """Cull and restore, again and again: of a bed at rest, from either store, and of one that creeps."""
    cycles = effort.of(100, 500, 4)
    parts = []
    for name in ("rest", "creep", "compact"):
        bed, n = soft_bed(damp=effort.of(0.25, 0.1, 0.25), free=0.005) if name == "creep" else soft_bed()
        parts.append(Part(f"cycle-{name}", "cycle.in", {"restart": bed, "L": BOX[0], "W": BOX[1], "cycles": cycles, "rows": 10,
                                                        "before": 1 if name == "creep" else effort.of(1000, 1000, 50)}, n, 60 * cycles, once=True,
                          keywords="store compact" if name == "compact" else "",
                          more=cycles_energy if effort.kind != "few" else None))
    return parts


def sway():
    """Gravity leans to and fro: less than wakes a body, near the bed's own frequency; so that all wakes each time; and far."""
    bed, n = soft_bed()
    steps = effort.of(20_000, 50_000, 500)
    return [Part("sway" if swing == 4 else f"sway-{swing:g}", "sway.in", {"restart": bed, "L": BOX[0], "W": BOX[1], "steps": steps, "swing": swing, "period": period,
                                                                       "before": effort.of(1000, 1000, 50)}, n, steps)
            for swing, period in ((0.5, 100), (4, 400), (20, 400))[effort.of(0, 0, 1):effort.of(3, 3, 2)]]


def shot():
    """A ball at 100 m/s."""
    n = effort.of(200, 500, 150)
    young = 1e9
    bed = settled("stiff-1e+09", L=BOX[0], W=BOX[1], granules=n, E=young, dt=0.22 * rayleigh_time(SMALLEST, young), top=0.08, pour=0.15, damp=0.2,
                  free=0.03, stills=4, few={"pour": 0.01, "damp": 0.002, "free": 0.0005})
    steps, after = effort.of((3000, 200_000), (3000, 300_000), (200, 200))
    return [Part("shot", "shot.in", {"restart": bed, "L": BOX[0], "W": BOX[1], "E": young, "dt": 1e-6, "lid": effort.of(0.075, 0.075, 0.106), "steps": steps, "after": after, "rows": 100,
                                     "lost": "ignore", "speed": effort.of(100, 100, 5)}, n + 1, steps + after, lossy=True, young=young)]


def reverse():
    """Gravity turns round: up to the lid and back."""
    bed, n = soft_bed()
    turns = effort.of(4, 6, 2)
    steps, after = effort.of((2000, 6000), (2000, 10_000), (200, 150))
    return [Part("reverse", "reverse.in", {"restart": bed, "L": BOX[0], "W": BOX[1], "steps": steps, "after": after, "turns": turns}, n, steps + turns * after)]


BLOCK, SUPPORTS = 9 * 5 * 5, 10


def heavy():
    """A body of 10^6 granules' mass on ten, two time steps; `fix rigid` is the run beside it."""
    parts = []
    for dt in effort.of((3e-7, 1e-6), (3e-7, 6e-7, 1e-6), (3e-7,)):
        steps = effort.of(round(0.015 / dt), round(0.15 / dt), 500)
        parts.append(Part(f"heavy-{1e9 * dt:g}ns", "heavy.in", {"E": 1e11, "dt": dt, "steps": steps, "rows": 100}, BLOCK + SUPPORTS, steps,
                          alone={"rigid": 1}, once=True, asleep="depth 0", more=does_not_sink if effort.kind != "few" else None))
    return parts


def does_not_sink(part, runs, grain):
    checks = []
    for kind in KINDS:
        energy = sum_of(runs[kind][0], ("f_cull[27]", ""), ("f_cull[28]", ""))[1:]
        z = runs[kind][0].series("f_cull[26]")[1]
        half = len(energy) // 2
        what = f"{part.name}, {kind}: "
        checks += [check(what + "kinetic energy in the second half, of the first's", energy[half:].max() / energy[:half].max(), 1.02),
                   check(what + "the block sinks or rises (d)", (z.max() - z.min()) / part.diameter, 0.02),
                   check(what + "exterior granules, most once locked", runs[kind][0].series("f_cull[1]")[1][2:].max(), SUPPORTS)]
    return checks


CASES = {f.__name__: f for f in (rest, timestep, stiffness, cohesion, ratio, tap, cycle, sway, shot, reverse, heavy)}


# --- report ---------------------------------------------------------------------------------------------------------

def row(part, figures):
    """The figures of a part in one line for each run."""
    lines = []
    for kind, f in figures.items():
        state = "stopped" if f["failure"] else "unstable" if not f["stable"] else "stable"
        lines.append(f"{part.name:22} {kind:9} {state:9} peak {f['peak']:9.3g}  end {f['late']:9.3g} M g d  fastest {f['fastest']:8.3g} m/s"
                     + (f"  culled {f['most_culled']:5.0f}  restored {f['restored']:8.0f}  carves {f['carves']:7.0f}" if kind != "unculled" else ""))
    return "\n".join(lines)


class OneLine(argparse.ArgumentParser):
    def error(self, message):
        raise errors.RunError(message)


def main(argv=None):
    p = OneLine(prog="stress.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    how = p.add_mutually_exclusive_group()
    how.add_argument("--quick", action="store_const", dest="kind", const="quick", help="minutes (the default)")
    how.add_argument("--full", action="store_const", dest="kind", const="full", help="an hour")
    how.add_argument("--few-steps", action="store_const", dest="kind", const="few", help="no bars: does every deck run?")
    p.add_argument("case", nargs="*", metavar="CASE", help="default: all; " + ", ".join(CASES))
    a = p.parse_args(argv)
    unknown = [c for c in a.case if c not in CASES]
    if unknown:
        raise errors.RunError(f"no case {unknown[0]}; there is: {' '.join(CASES)}")
    effort.kind = a.kind or "quick"
    effort.out.mkdir(parents=True, exist_ok=True)
    cases = {name: CASES[name]() for name in a.case or CASES}
    whole = sum(part.work() for parts in cases.values() for part in parts)
    done, made, spent, good, began = 0, 0, 0.0, True, time.monotonic()
    for name, parts in cases.items():
        print(f"\n=== {name}: {CASES[name].__doc__}", flush=True)
        checks, report = [], {}
        for part in parts:
            started = time.monotonic()
            runs = run_part(part, lambda line: print(f"  {part.name}: {line}", flush=True))
            of_part, figures = judge(part, runs)
            checks += of_part
            report[part.name] = figures
            spent += sum(run.cpu for of_kind in runs.values() for run in of_kind)
            done += part.work()
            now = time.monotonic()
            made += part.work() if now - started > 0.5 else 0
            left = (whole - done) * (now - began) / made if made else 0
            print(row(part, figures) + (f"\n  about {left / 60:.1f} min left" if left else ""), flush=True)
        good = all(c["good"] for c in checks) and good
        print("\n".join(["", *tables.check_rows(checks)]), flush=True)
        (effort.out / f"{name}.json").write_text(json.dumps({"good": all(c["good"] for c in checks), "parts": report, "checks": checks}, indent=1) + "\n")
    print(f"\nin all {spent:.0f} s of one core, beds not counted")
    return 0 if good or effort.kind == "few" else 1


if __name__ == "__main__":
    errors.command("stress", main)
