"""The runs of a validation case: its beds, and its jobs at every point."""
import concurrent.futures
import functools
import re
import statistics
import time

from .. import decks, dumps, logs
from ..beds import settled
from ..engine import POLL, stop_all
from ..errors import RunError
from ..logs import FROM_HERE
from ..twins import KeptJob
from .cases import PRODUCTION, short_hash
from .points import BY_HAND, PAPER, UNCULLED, points, runs_of

ASIDE = [k * 1e-5 for k in (0, *(side * n for n in range(1, 16) for side in (1, -1)))][:30]  # m: the place of a tool, ball or wall in each run
FRAMES = 200                                                    # steps between two snapshots, if the case says nothing
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

    def __init__(self, case, scene, point, k, out, variables, frames, launcher, made_with, ranks=1):
        self.case, self.scene, self.point, self.k, self.frames = case, scene, point, k, frames
        kind = "unculled" if point.family in (UNCULLED, BY_HAND) else "culled"
        name = re.sub(r"[^\w.]+", "-", f"{scene} {point.name} {k + 1}".strip())
        super().__init__(case.deck, out, kind, 0, variables, ranks, shifted=False, extra=self.measured, launcher=launcher,
                         keywords=point.keywords or None, name=name, made_with=made_with)

    @functools.cached_property
    def mark(self):
        """Of all that makes this run what it is, the same on all machines: the folder of all output (OUT/full/CASE/runs/NAME) is no part
        of it."""
        return short_hash([self.recipe().replace(str(self.base.parents[3]), ""), (self.case.folder / "case.py").read_text()])

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

    def add(self, jobs):
        self.left += jobs
        self.all += len(jobs)

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


class Maker:
    """Makes the jobs of a case."""

    def __init__(self, case, out, beds, launcher, fix, ranks=1):
        self.case, self.out, self.beds, self.launcher, self.fix, self.ranks = case, out, beds, launcher, fix, ranks

    def jobs(self, scene, wanted):
        """Of a scene. `wanted`: (point, number of the run), in their order."""
        case, bed = self.case, self.beds[self.case.name, scene]
        v = case.variables(scene)
        given = {**v, **files_of(case, scene, self.out), **({"restart": bed} if bed else {})}
        texts = [f.read_text() for f in sorted({*case.folder.glob("*.in"), *(case.folder.parent.parent / "shared").glob("*.in")} - {case.deck})]
        texts.append(bed.with_suffix(".recipe").read_text() if bed else "")
        made = []
        for p, k in wanted:
            frames = v.get("frames", FRAMES) if k == 0 and p.default and scene == case.main_scene else 0
            made_with = "\n".join([*texts, self.fix if p.family not in (UNCULLED, BY_HAND) else ""])
            made.append(CaseJob(case, scene, p, k, self.out / case.name / "runs", {**given, case.need("aside"): ASIDE[k]}, frames, self.launcher,
                                made_with, self.ranks))
        return made


def jobs_of(case, out, beds, launcher, fix, also=(), ranks=1):
    """All runs of a case, unculled and culled ones in turns. `also`: see points(). On more ranks than one, those at the defaults."""
    jobs, maker = [], Maker(case, out, beds, launcher, fix, ranks)
    for scene in case.scenes:
        main = scene == case.main_scene
        left_out = {family for family, there in ((BY_HAND, case.get("by_hand")), (PAPER, case.get("paper", True))) if not there}
        wanted = [p for p in points(also) if (p.everywhere or (main and case.size != PRODUCTION)) and p.family not in left_out and (ranks == 1 or p.everywhere)]
        jobs += maker.jobs(scene, [(p, k) for k in range(max(runs_of(p, main) for p in wanted)) for p in wanted if k < runs_of(p, main)])
    return jobs


def run_all(jobs, course, earlier=None, after=lambda done: None):
    """Runs them in their order, as many at once as the course says: {job: run, or the line that says why there is none}. One that
    fails stops none. Those of `earlier` (an Earlier) are taken from there. `after`: is called after each run that is made."""
    at_once, waiting, running, done, ended = course.at_once, list(jobs), [], {}, []
    try:
        while waiting or running or ended:
            while waiting and len(running) < at_once:
                job = waiting.pop(0)
                try:
                    run = job.kept() or (earlier and earlier.run_of(job))
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
                after(done)
            ended = [pair for pair in running if pair[1].ended()]
            running = [pair for pair in running if pair not in ended]
            if not ended:
                time.sleep(POLL)
    finally:
        for _, process in running:
            process.stop()
    return done
