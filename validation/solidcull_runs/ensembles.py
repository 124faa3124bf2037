"""The runs of a validation case: its beds, its jobs at every point, and what they gave, as plain data."""
import concurrent.futures
import re
import statistics
import time
from pathlib import Path

import numpy as np

from . import decks, dumps, fields, logs
from .beds import settled
from .cases import short_hash
from .engine import POLL, stop_all
from .errors import RunError
from .logs import FROM_HERE
from .points import ALSO, BY_HAND, PAPER, UNCULLED, points, runs_of
from .twins import KeptJob

ASIDE = [k * 1e-5 for k in (0, 1, -1, 2, -2, 3, -3, 4, -4, 5)]  # m: the place of a tool, ball or wall in each run
FRAMES = 200                                                    # steps between two snapshots, if the case says nothing
MOVED = 1e-2                                                    # mean diameters between two snapshots: what moves
DRAWN = 120                                                     # values kept of a curve
STRESS = [f"c_twin_stress[{k}]" for k in range(1, 7)]
COLUMNS = ["id", "mass", "radius", "x", "y", "z", "vx", "vy", "vz", *STRESS]
INTEGRATOR = re.compile(r"^fix\s+(\S+)\s+all\s+nve/sphere\s*$", re.M)


def frozen_by_hand(text, region, where):
    """A deck in which what is outside the region is neither integrated nor in neighbour lists with its like."""
    lines = (f"region by_hand {region} units box\ngroup by_hand region by_hand\ngroup frozen subtract all by_hand\n"
             "neigh_modify exclude group frozen frozen\nvelocity frozen set 0 0 0\n")
    made, n = INTEGRATOR.subn(lambda found: f"{lines}fix {found[1]} by_hand nve/sphere", text)
    if n != 1:
        raise RunError(f"{where} has {n} lines 'fix ID all nve/sphere'; to freeze by hand it must have one")
    return made


class CaseJob(KeptJob):
    """One run of a case at a point. Its final dump has velocities and stresses too; with `frames`, snapshots on the way."""

    def __init__(self, case, scene, point, k, out, variables, frames, launcher, made_with):
        self.case, self.scene, self.point, self.k, self.frames = case, scene, point, k, frames
        kind = "unculled" if point.family in (UNCULLED, BY_HAND) else "culled"
        name = re.sub(r"[^\w.]+", "-", f"{scene} {point.name} {k + 1}".strip())
        super().__init__(case.deck, out, kind, 0, variables, shifted=False, extra=self.measured, launcher=launcher,
                         keywords=point.keywords or None, name=name, made_with=made_with)

    def measured(self, run):
        run.start = dumps.read_final(self.file(".start"))
        run.inserted = logs.inserted(self.file(".log").read_text(errors="replace"))
        return self.case.measured(run, self.scene)

    def text(self):
        text = super().text()
        start = f'write_dump all custom "{self.base}.start" id mass radius x y z modify format "%d %.15g %.15g %.15g %.15g %.15g"'
        text = text.replace(f'print "{FROM_HERE}"', f'{start}\nprint "{FROM_HERE}"', 1)
        if self.frames:
            state = " f_" + decks.cull_fix(decks.read_deck(self.deck)) if self.kind == "culled" else ""
            lines = (f'dump twin_frames all custom {self.frames} "{self.base}.frames" id x y z radius{state}\n'
                     'dump_modify twin_frames format "%d %.6g %.6g %.6g %.4g' + (" %g" if state else "") + '"')
            text = re.sub(r"^(fix twin_counts .*|# fix\s+\S+\s+\S+\s+solid/cull.*)$", lambda m: f"{m[0]}\n{lines}", text, count=1, flags=re.M)
            text = text.replace("unfix twin_counts", "unfix twin_counts\nundump twin_frames")
        if self.point.family == BY_HAND:
            text = frozen_by_hand(text, self.case.get("by_hand"), f"case {self.case.name}: {self.deck.name}")
        before, final = text.rstrip("\n").rsplit("\n", 1)
        file = re.match(r'write_dump all custom ("[^"]+")', final)[1]
        form = " ".join(["%d"] + ["%.15g"] * (len(COLUMNS) - 1))
        return (f"{before}\ncompute twin_stress all stress/atom\nrun 0\n"
                f'write_dump all custom {file} {" ".join(COLUMNS)} modify format "{form}"\n')


class Course:
    """Says how far all runs are, and about how long the rest takes: as long as others of the scene did, else by granules."""

    def __init__(self, jobs, at_once, say):
        self.left, self.at_once, self.say, self.all = list(jobs), at_once, say, len(jobs)
        self.spent = {}  # by scene: seconds, and the parts of an unculled run that took them

    def skip(self, job):
        """It was made before."""
        self.left.remove(job)

    def end(self, job, seconds, what):
        self.left.remove(job)
        of_scene = self.spent.setdefault((job.case.name, job.scene), [0.0, 0.0])
        of_scene[0] += seconds
        of_scene[1] += self.part(job)
        left = self.seconds_left() / self.at_once
        shown = f"{left / 60:.0f} min" if left > 100 else f"{left:.0f} s"
        self.say(f"{job.case.name}: {job.name}: {what}; {self.all - len(self.left)} of {self.all} runs, about {shown} left")

    @staticmethod
    def part(job):
        return 1 if job.kind == "unculled" else 0.7

    def seconds_left(self):
        scenes = {(job.case.name, job.scene): job.case.granules(job.scene) for job in self.left}
        done = {key: seconds / parts for key, (seconds, parts) in self.spent.items()}
        mean = statistics.fmean(done.values())
        size = statistics.fmean(scenes.values()) if scenes else 1
        each = {key: done.get(key, mean * granules / size) for key, granules in scenes.items()}
        return sum(each[job.case.name, job.scene] * self.part(job) for job in self.left)


def files_of(case, scene, out):
    """Makes the case's own files for a scene; the variables that name their folder, `folder` in decks of examples."""
    v = case.variables(scene)
    folder = out / case.name / "files" / short_hash(v)
    folder.mkdir(parents=True, exist_ok=True)
    if case.get("files"):
        case.get("files")(folder, v)
    return {"files": folder, "folder": folder}


def make_beds(cases, out, at_once, say):
    """The bed of each scene of each case: {(case's name, scene): restart file, or None}. Those of the same recipe are made once."""
    wanted, files = {}, {}
    for case in cases:
        for scene in case.scenes:
            bed = case.bed(scene)
            file = bed and out / "beds" / f"{bed[0].parent.name}-{bed[0].stem}-{short_hash(bed[1])}.restart"
            files[case.name, scene] = file
            if bed:
                # a bed of shared/ may serve several cases: were it given one's files, it would be made anew for each
                wanted[file] = bed[0], {**bed[1], **({} if bed[0].parent.name == "shared" else files_of(case, scene, out))}

    def make(file, deck, variables):
        sources = sorted({*deck.parent.glob("*.in"), *(deck.parent.parent.parent / "shared").glob("*.in")} - {deck})
        return settled(file, deck, sources, variables, say=lambda line: say(line.strip()))
    with concurrent.futures.ThreadPoolExecutor(at_once) as pool:
        try:
            for made in [pool.submit(make, file, *bed) for file, bed in wanted.items()]:
                made.result()
        except BaseException:  # one failed, or the user stops: the others are not waited for
            pool.shutdown(wait=False, cancel_futures=True)
            stop_all()
            raise
    return files


def jobs_of(case, out, beds, launcher, fix, also=()):
    """All runs of a case, unculled and culled ones in turns. `also`: see points()."""
    jobs = []
    for scene in case.scenes:
        v = case.variables(scene)
        bed = beds[case.name, scene]
        given = {**v, **files_of(case, scene, out), **({"restart": bed} if bed else {})}
        texts = [f.read_text() for f in sorted({*case.folder.glob("*.in"), *(case.folder.parent.parent / "shared").glob("*.in")} - {case.deck})]
        texts.append(bed.with_suffix(".recipe").read_text() if bed else "")
        main = scene == case.main_scene
        wanted = [p for p in points(also) if (p.everywhere or main) and (p.family != BY_HAND or case.get("by_hand"))]
        for k in range(max(runs_of(p, main) for p in wanted)):
            for p in wanted:
                if k >= runs_of(p, main):
                    continue
                frames = v.get("frames", FRAMES) if k == 0 and p.default and main else 0
                aside = {case.need("aside"): ASIDE[k]}
                made_with = "\n".join([*texts, fix if p.family not in (UNCULLED, BY_HAND) else ""])
                jobs.append(CaseJob(case, scene, p, k, out / case.name / "runs", {**given, **aside}, frames, launcher, made_with))
    return jobs


def run_all(jobs, course):
    """Runs them in their order, as many at once as the course says: {job: run, or the line that says why there is none}. One that
    fails stops none."""
    at_once, waiting, running, done, ended = course.at_once, list(jobs), [], {}, []
    try:
        while waiting or running or ended:
            while waiting and len(running) < at_once:
                job = waiting.pop(0)
                try:
                    run = job.kept()
                    if run:
                        done[job] = run
                        course.skip(job)
                    else:
                        running.append((job, job.start()))
                except RunError as e:
                    done[job] = str(e)
                    course.end(job, 0, f"FAILED: {e}")
            for job, process in ended:  # read while the next ones run
                try:
                    done[job] = job.finish(process)
                    course.end(job, process.wall, f"{done[job].own_time:.1f} s")
                except RunError as e:
                    done[job] = str(e)
                    course.end(job, process.wall, f"FAILED: {e}")
            ended = [pair for pair in running if pair[1].ended()]
            running = [pair for pair in running if pair not in ended]
            if not ended:
                time.sleep(POLL)
    finally:
        for _, process in running:
            process.stop()
    return done


# --------------------------------------------------------------------------------------------------------------- results

def curve(run, column):
    """Times (s) and values of a thermo column, thinned."""
    (_, t), (_, x) = run.series("time"), run.series(column)
    n = min(len(t), len(x))
    at = np.unique(np.linspace(0, n - 1, min(n, DRAWN)).astype(int))
    return [[float(f"{v:.5g}") for v in t[at]], [float(f"{v:.5g}") for v in x[at]]]


def moved(file, diameter):
    """Steps of the snapshots of an unculled run, and how many granules had moved since the one before."""
    before, steps, counts = None, [], []
    for step, columns, rows in dumps.snapshots(file):
        rows = rows[np.argsort(rows[:, 0])]
        places = rows[:, 1:4]
        if before is not None and len(before) == len(places):
            steps.append(step)
            counts.append(int((np.linalg.norm(places - before, axis=1) > MOVED * diameter).sum()))
        before = places
    return steps, counts


def run_data(job, run):
    """A run as plain data."""
    counts = {}
    if run.counts:
        counts = {name: float(run.counts[name].mean()) for name in ("exterior", "interface", "interior")}
        counts |= {name: float(run.counts[name][-1]) for name in ("culled", "restored", "carves", "seconds", "restore_energy")}
    data = {"k": job.k, "seconds": round(run.own_time, 3), "steps": run.steps(), "counts": counts, "values": run.metrics,
            "granules": None if run.final is None else len(run.final)}
    if job.point.default and job.scene == job.case.main_scene:
        data["curves"] = {metric: curve(run, column) for metric, column in job.case.get("curves", {}).items()}
    return data


def result_of(case, done):
    """What the runs of a case gave. `done`: as from run_all(), of this case's jobs."""
    result = {"case": case.name, "title": case.title, "claim": case.claim, "reference": case.reference, "size": case.size,
              "metrics": [{"name": m.name, "unit": m.unit, "margin": m.margin, "relative": m.relative, "why": m.why} for m in case.metrics],
              "scenes": {}, "failed": [], "bound": None, "fields": {}, "laws": [], "lost": 0, "lost_refilled": 0}
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
    result["lost"], result["lost_refilled"] = lost(done, case), lost(done, case, refilled=True)
    main = {job: run for job, run in done.items() if job.scene == case.main_scene and not isinstance(run, str)}
    finals = {}
    for job, run in main.items():
        if run.final is not None:
            finals.setdefault(job.point, []).append(run.final)
    unculled = next((p for p in finals if p.family == UNCULLED), None)
    if unculled:
        for p, of_point in finals.items():
            if p is not unculled and (p.default or p.family in (PAPER, ALSO)):
                result["fields"][p.name] = fields.distances(of_point, finals[unculled])
        diameter = 2 * float(np.median(finals[unculled][0]["radius"]))
        framed = next((job for job in main if job.point is unculled and job.frames), None)
        if framed and framed.file(".frames").exists():
            steps, counts = moved(framed.file(".frames"), diameter)
            mean = statistics.fmean(counts) if counts else 0
            result["bound"] = {"every": framed.frames, "moving": mean, "N/N_moving": case.granules(case.main_scene) / mean if mean else None}
    laws = case.get("laws")
    if laws:
        result["laws"] = laws_of(case, result, laws)
    return result


def lost(done, case, refilled=False):
    """Granules that culled runs miss at the end, of those that were there and those that were put in, but for as many as leave
    unculled runs of the same scene; the most of any run. Below 0: there twice. Of the paper's scheme (`refilled`) or of all others."""
    worst = 0
    for scene in case.scenes:
        leave, missing = [], []
        for job, run in done.items():
            family = job.point.family
            if job.scene != scene or family == BY_HAND or isinstance(run, str) or run.final is None:
                continue
            there = len(np.unique(run.final["id"]))
            if family == UNCULLED:
                leave.append(len(run.start) + run.inserted - there)
            elif (family == PAPER) == refilled:
                missing.append(len(run.start) + run.inserted - there)
                worst = max(worst, there - len(run.final), key=abs)
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
