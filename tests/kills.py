#!/usr/bin/python3
"""Kills runs with culled granules, and lets each go on from the newest restart file that it left.

    tests/kills.py [--count 20] [--seed 1] [--ranks 2] [--balance] [--keep DIR]

A ball is pushed into a bed and out of it again, on so many ranks. Again and again one rank is killed without warning (SIGKILL):

    run        at any moment
    restart    while a restart file is being written
    mesh       while a file of interface meshes is being written
    balance    at any moment of a run that moves the cuts between ranks (with --balance: the fix must know the keyword)

Each time the newest file is read by its name and by a pattern, on other numbers of ranks. It must be the same file, whole, and hold each
granule once, with its mass; no pattern may take a part of a file. Then the run goes on from it, and is killed again.
Exit: 0 nothing was lost, 1 something was.
"""
import argparse
import collections
import os
import random
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.dont_write_bytecode = True
sys.path[:0] = [str(HERE.parent), str(HERE)]
from solidcull_runs import engine, kills  # noqa: E402
from solidcull_runs.beds import holds_culled  # noqa: E402
from solidcull_runs.dumps import read_final  # noqa: E402
from test_messages import deck  # noqa: E402

D, SIDE, LAYERS = 0.003, 12, 7      # m: diameter; granules along an edge, layers
GRANULES = SIDE * SIDE * LAYERS + 1  # the ball
EVERY = 20                          # steps between two restart files, and two files of meshes
PATIENCE = 60                       # s, for anything
KINDS = ("run", "restart", "mesh")
CULL = f"fix cull all solid/cull every 10 calm 1 speed 0.5 tolerance 30 0 mesh {EVERY} mesh.*.stl"
WALL = "wall/gran model hertz tangential history primitive type 1"
WALLS = [f"fix {d}{k} all {WALL} {d}plane {x:g}" for d in "xy" for k, x in enumerate((0, SIDE * D))]
DRIVE = ["variable push equal 1e-3*sin(0.02*step)", "fix push ball addforce 0 0 v_push"]
PRINTS = ["variable all equal f_cull[1]+f_cull[2]+f_cull[3]", "thermo_style custom step atoms v_all f_cull[3]", "thermo 10", "thermo_modify lost error norm no"]

GOES_ON = ["run 0", *DRIVE, f"restart {EVERY} k.*.restart", "run 1000000"]  # what a file has culled comes with the first run


def first_deck():
    middle = SIDE * D / 2
    return deck(*WALLS, "delete_atoms group all", f"lattice sc {D} origin 0.5 0.5 0.5",
                f"region fill block 0 {SIDE * D:g} 0 {SIDE * D:g} 0 {LAYERS * D:g}", "create_atoms 1 region fill",
                f"create_atoms 1 single {middle:g} {middle:g} {(LAYERS + 0.6) * D:g} units box", f"set group all diameter {D} density 2500",
                f"group ball id {GRANULES}", "velocity ball set 0 0 -0.5", "{cull}", *PRINTS, *GOES_ON,
                box=f"block 0 {SIDE * D:g} 0 {SIDE * D:g} -0.001 0.04").replace("region box", "processors * * 1\nregion box")


def next_deck(*end):
    """Goes on from a file; its name stands for {file}."""
    whole = first_deck()
    head, rest = whole.split("processors * * 1")[0], whole[whole.index("neighbor"):]
    made = ("create_atoms", "lattice", "region", "delete_atoms", "set group", "group ball", "velocity", "restart", "run", *DRIVE)
    kept = [line for line in rest.splitlines() if not line.startswith(made)]
    return "\n".join([head + "processors * * 1", "read_restart {file}", *kept, *end]) + "\n"


LOOKS = ("run 0", "variable there equal count(all)", 'print "THERE ${there}"',
         'write_dump all custom seen.dump id mass radius x y z modify format "%d %.15g %.15g %.15g %.15g %.15g"')


class Fault(Exception):
    """What went wrong, in one line."""


class Job:
    """A run on several ranks in a folder."""

    def __init__(self, folder, text, ranks, name="job"):
        (folder / f"{name}.in").write_text(text)
        self.screen, self.program = folder / f"{name}.screen", Path(engine.find_launcher()).name
        command = ["mpirun", "--oversubscribe", "-np", str(ranks), engine.find_launcher(), "-in", f"{name}.in", "-log", f"{name}.log", "-screen", self.screen.name]
        env = {**engine.environment(max(2, ranks)), "SOLIDCULL_CHECK": "1"}
        self.folder, self.ranks = folder, ranks
        self.process = subprocess.Popen(command, cwd=folder, env=env, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                                        start_new_session=True)

    def text(self):
        return self.screen.read_text(errors="replace") if self.screen.exists() else ""

    def wait(self):
        try:
            return self.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            raise Fault("a run did not end") from None
        finally:
            self.stop()

    def stop(self):
        """Ends it if it runs, with all its ranks."""
        for pid in [*kills.below(self.process.pid), self.process.pid] if self.process.poll() is None else []:
            kills.kill(pid)
        self.process.wait()


def parts(folder, suffix=""):
    """What is being written: restart files, and files of meshes."""
    return {name for name in os.listdir(folder) if (name.startswith(".part.") and name.endswith(".restart")) or name.endswith(".stl.part")}


def wait_until_it_writes(job, kind):
    """Whether such a file was seen while it was written: looked for without a pause, as that is soon over."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end and job.process.poll() is None:
        if any(name.startswith(".part.") == (kind == "restart") for name in parts(job.folder)):
            return True
    return False


class Series:
    def __init__(self, folder, seed, ranks, balance=False):
        self.folder, self.rng, self.ranks, self.balance = folder, random.Random(seed), ranks, balance
        self.left, self.files = collections.Counter(), folder / "k.*.restart"
        self.known = None  # ids and masses at the first look

    def culling(self, kind):
        return CULL + " balance 10 1.05" * (kind == "balance")

    def kill_one(self, kind):
        """Starts the run anew, or lets it go on, and kills it; what it left."""
        before = kills.newest(self.files)
        by = self.rng.choice((before and before.name, self.files.name))
        text = next_deck(*GOES_ON).replace("{file}", by) if before else first_deck()
        job = Job(self.folder, text.replace("{cull}", self.culling(kind)), self.ranks)
        try:
            if not kills.wait_for(lambda: kills.newest(self.files) != before or job.process.poll() is not None, PATIENCE):
                raise Fault("no restart file was written")
            ranks = kills.ranks_of(job.process.pid, job.program)
            time.sleep(self.rng.uniform(0, 0.3))
            if kind in ("restart", "mesh") and not wait_until_it_writes(job, kind):
                raise Fault(f"no {kind} file was seen while it was written")
            if len(ranks) != self.ranks or not kills.kill(self.rng.choice(ranks)):
                raise Fault(f"it ended by itself: {engine.error_in(job.text())}")
            if job.wait() == 0:
                raise Fault("it was killed, and ended with 0")
        finally:
            job.stop()
        wrong = [line for line in job.text().splitlines() if line.startswith("ERROR")]
        sums = re.findall(r"^ +\d+ +\d+ +(\d+) +\d+ *$", job.text(), re.M)
        if wrong or set(sums) - {str(GRANULES)}:
            raise Fault(f"before it was killed: {wrong or sorted(set(sums))}")
        return parts(self.folder)

    def look(self, file, ranks, named):
        """What a deck finds that reads the file: the step, and its granules."""
        job = Job(self.folder, next_deck(*LOOKS).replace("{file}", named).replace("{cull}", self.culling("look")), ranks, "look")
        if job.wait():
            raise Fault(f"{named} on {ranks} ranks: {engine.error_in(job.text())}")
        text = job.text()
        step, total = re.findall(r"^ +(\d+) +\d+ +(\d+) +\d+ *$", text, re.M)[0]
        there, seen = int(re.search(r"^THERE (\d+)", text, re.M)[1]), read_final(self.folder / "seen.dump")
        if (total, there, len(seen)) != (str(GRANULES), GRANULES, GRANULES):
            raise Fault(f"{named} on {ranks} ranks: {total} in the ledger, {there} counted, {len(seen)} written, not {GRANULES}")
        state = [(int(g["id"]), float(g["mass"])) for g in seen]
        self.known = self.known or state
        if state != self.known:
            raise Fault(f"{named} on {ranks} ranks: other ids or masses than before")
        if int(step) != int(re.search(r"\d+", file.name)[0]):
            raise Fault(f"{named} on {ranks} ranks: step {step} was read, the newest file is {file.name}")

    def one(self, kind):
        """Kills the run once, and looks at what it left."""
        left = self.kill_one(kind)
        file = kills.newest(self.files)
        self.left[kind, bool([name for name in left if name.startswith(".part.")]), holds_culled(file)] += 1
        self.look(file, self.ranks, file.name)
        self.look(file, self.rng.choice((1, self.ranks, self.ranks + 1)), self.files.name)
        for name in left:
            (self.folder / name).unlink()
        for step, old in sorted(kills.steps_of(self.files).items())[:-2]:
            old.unlink()
        for mesh in self.folder.glob("mesh.*.stl"):
            mesh.unlink()
        return left, file


def run(folder, count, seed=1, ranks=2, balance=False, say=lambda line: None):
    """So many kills; what of each kind was left. Raises Fault at the first thing that is wrong."""
    series, kinds = Series(Path(folder), seed, ranks, balance), KINDS + ("balance",) * balance
    for k in range(count):
        kind = kinds[k % len(kinds)]
        began = time.monotonic()
        left, file = series.one(kind)
        say(f"{k + 1}: killed ({kind}), goes on from {file.name}{', culled granules in it' if holds_culled(file) else ''}; left in part: "
            f"{', '.join(sorted(left)) or 'nothing'} ({time.monotonic() - began:.1f} s)")
    return series.left


def main(argv=None):
    p = argparse.ArgumentParser(prog="kills.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--count", type=int, default=20, metavar="N")
    p.add_argument("--seed", type=int, default=1)
    p.add_argument("--ranks", type=int, default=2)
    p.add_argument("--balance", action="store_true")
    p.add_argument("--keep", type=Path, metavar="DIR", help="where it is run, and left")
    a = p.parse_args(argv)
    with tempfile.TemporaryDirectory(prefix="solidcull-kills-") as folder:
        place = a.keep or Path(folder)
        place.mkdir(parents=True, exist_ok=True)
        try:
            left = run(place, a.count, a.seed, a.ranks, a.balance, lambda line: print(line, flush=True))
        except Fault as fault:
            print(f"kills: {fault}; again with --seed {a.seed} --ranks {a.ranks} --keep DIR", file=sys.stderr)
            return 1
    for (kind, part, culled), n in sorted(left.items()):
        print(f"{n} in {kind}: {'a part of a restart file was left' if part else 'no restart file in part'}, the newest file holds {'culled granules' if culled else 'none culled'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
