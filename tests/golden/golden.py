#!/usr/bin/python3
"""Proves that two builds of solidcull give the same results to the last bit.

    golden.py run --before OLD/liggghts-solidcull --after NEW/liggghts-solidcull [--quick] [--keep]
    golden.py record --launcher PATH DIR       one file of JSON lines per case in DIR
    golden.py compare A B                      two such folders, case by case
    golden.py list                             the cases

--cases PATTERN ... takes some (shell patterns of names), --quick a small set that reaches everything once or more.
Exit: 0 all cases identical, 1 a case differs, 2 no verdict (misuse, a missing case, a run that failed); each one line.
See README.md beside this file.
"""
import argparse
import concurrent.futures
import fnmatch
import gzip
import hashlib
import itertools
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))
from solidcull_runs import meshes  # noqa: E402
from solidcull_runs.engine import environment  # noqa: E402

DECKS = HERE / "decks"
RANKS = (1, 2, 4)
GRID = {1: (1, 1), 2: (2, 1), 4: (2, 2)}  # ranks along x and y
LONGEST = 1800                           # s, of one run of LIGGGHTS: seconds on a free machine, minutes on a busy one
FORMAT = 1                               # of the records
QUANTITIES = {"granules": ("id", "type"), "bodies": ("f_cull",), "x": ("x", "y", "z"), "v": ("vx", "vy", "vz"),
              "omega": ("omegax", "omegay", "omegaz"), "f": ("fx", "fy", "fz")}
WHOLE = {"granules": ("id", "type"), "size": ("radius", "mass"), **{q: QUANTITIES[q] for q in ("x", "v", "omega", "f")}}


class GoldenError(Exception):
    """Why there is no verdict, in one line."""


# --- the cases --------------------------------------------------------------------------------------------------------

@dataclass
class Case:
    name: str
    parts: list     # of (deck, variables): LIGGGHTS runs one after the other; `bed` of the second is what the first left
    ranks: int
    bed: str = None                           # the deck that makes the bed, None where the scene makes its granules itself
    demands: dict = field(default_factory=dict)  # what the case must have reached, else it proves nothing


# scene: deck, what makes its bed, further keywords, least counts of what it must reach (see Reached)
BED = {"interior": 500, "carves": 50, "restored": 500, "merges": 1, "splits": 1}
SCENES = {
    "impact": ("impact.in", "bed.in", "restore exact", BED),
    "rain": ("rain.in", "bed.in", "restore exact", {**BED, "inserted": 100}),
    "shake": ("shake.in", "bed.in", "restore exact", {"interior": 500, "restored": 500}),
    "drum": ("drum.in", "fill.in", "tolerance 10 0", {"interior": 150, "carves": 10, "restored": 200, "merges": 1, "splits": 1}),
    "fall": ("fall.in", "mass.in", "tolerance 30 0", {"interior": 300, "carves": 10, "restored": 200, "splits": 1}),
    "split": ("split.in", None, "depth 0.5 voxel 0.25 tolerance 300 0 carve 4 1",
              {"interior": 1000, "restored": 200, "bodies": 2}),
}
GROUNDED = {"interior": 3600}  # of 4,000: granules at walls are stored too, as they are when the bed is grounded


def make_cases():
    cases = []

    def add(name, ranks, parts, bed, demands):
        cases.append(Case(f"{name}-{ranks}", parts, ranks, bed, dict(demands)))

    for scene, (deck, bed, keywords, demands) in SCENES.items():
        for exterior, store, ranks in itertools.product(("live", "sleep"), ("exact", "compact"), RANKS):
            variables = {"exterior": exterior, "store": store, "more": keywords}
            more = GROUNDED if exterior == "sleep" and bed == "bed.in" else {}
            if (scene, exterior) == ("fall", "live") and ranks > 1:
                more = {"handed": 5}
            add(f"{scene}-{exterior}-{store}", ranks, [(deck, variables)], bed, {**demands, **more})
    for ranks in RANKS:
        # a restart file is written while much is culled, and granules and bodies move
        for exterior, store in (("sleep", "exact"), ("live", "compact")):
            way = {"exterior": exterior, "store": store}
            stopped = {**way, "steps": 300, "files": 300}
            add(f"resume-{exterior}-{store}", ranks, [("impact.in", stopped), ("resume.in", way)], "bed.in",
                {"interior": 500, "carried": 100, "restored": 500})
            way = {**way, "more": SCENES["fall"][2]}
            stopped = {**way, "steps": 300}
            add(f"resume-fall-{exterior}-{store}", ranks, [("fall.in", stopped), ("resume_fall.in", way)], "mass.in",
                {"interior": 300, "carried": 300, "restored": 200})
        add("none-live", ranks, [("impact.in", {"store": "none", "more": "restore refill"})], "bed.in", {"interior": 500, "carves": 50})
        for scene in ("impact", "fall", "split"):
            deck, bed, keywords, demands = SCENES[scene]
            files = {"exterior": "sleep", "files": 100, "more": f"{keywords} mesh 300 mesh.*.stl mesh 300 mesh.*.vdb"}
            add(f"files-{scene}-sleep-exact", ranks, [(deck, files)], bed, demands)
    return cases


CASES = make_cases()
QUICK = ("impact-sleep-exact-1", "impact-live-compact-2", "rain-sleep-exact-2", "shake-live-exact-1", "drum-sleep-compact-2",
         "fall-live-exact-2", "split-live-compact-1", "resume-sleep-exact-2", "files-split-sleep-exact-1")


def chosen(patterns, quick):
    """The cases that were asked for; all without a pattern."""
    if quick:
        patterns = list(patterns or []) + list(QUICK)
    for p in patterns or []:
        if not any(fnmatch.fnmatchcase(c.name, p) for c in CASES):
            raise GoldenError(f"no case matches {p}; `golden.py list` has their names")
    return [c for c in CASES if not patterns or any(fnmatch.fnmatchcase(c.name, p) for p in patterns)]


# --- what goes in -----------------------------------------------------------------------------------------------------

def floor_stl(x0, x1, y0, y1):
    return meshes.stl_text("floor", meshes.grid((x0, y0, 0), (x1 - x0, 0, 0), (0, y1 - y0, 0), 1, 1))


MESHES = {"floor.stl": floor_stl(-0.0024, 0.0474, -0.0024, 0.0474), "wide.stl": floor_stl(-0.79, 0.79, -0.49, 0.49),
          "drum.stl": meshes.stl_text("drum", meshes.drum(0.08, 0.04, 40))}


def sha(*contents):
    total = hashlib.sha256()
    for c in contents:
        total.update(c if isinstance(c, bytes) else c.encode())
    return total.hexdigest()


def text_of_deck(name):
    """A deck with all that it includes and the meshes that it names: what a record hangs on."""
    text = (DECKS / name).read_text()
    for included in re.findall(r"^include (\S+)", text, flags=re.M):
        text += text_of_deck(included)
    return text + "".join(MESHES[m] for m in re.findall(r"\bfile (\S+\.stl)", text))


def key_of_case(case):
    return sha(json.dumps([FORMAT, case.name, case.ranks, case.parts]), *(text_of_deck(deck) for deck, _ in case.parts))


def key_of_launcher(launcher):
    library = launcher.parent / "libsolidcull.so"
    if not library.exists():
        raise GoldenError(f"{library} is not there: a launcher uses the library beside it")
    return sha(launcher.read_bytes(), library.read_bytes())


def find_launcher(path):
    path = Path(path).absolute()
    if not os.access(path, os.X_OK) or path.is_dir():
        raise GoldenError(f"no launcher at {path}")
    return path


# --- running ----------------------------------------------------------------------------------------------------------

def reason_in(screen):
    """The line that says why LIGGGHTS stopped: its own, an exception's, or the last that is not a rule of mpirun's."""
    lines = [line.strip() for line in screen.splitlines() if line.strip("- ")]
    said = [line for line in lines if line.startswith("ERROR")] or [line for line in lines if line.startswith("what():")]
    return (said or lines or ["it printed nothing"])[-1]


def run_liggghts(name, launcher, deck, folder, variables, ranks=1):
    """Runs a deck in a folder that has the decks and meshes; what it prints is left in `screen.txt` and returned."""
    for file in DECKS.iterdir():
        shutil.copy(file, folder)
    for file, text in MESHES.items():
        (folder / file).write_text(text)
    px, py = GRID[ranks]
    command = ["mpirun", "--oversubscribe", "--bind-to", "none", "-np", str(ranks)] if ranks > 1 else []
    command += [str(launcher), "-in", deck, "-log", "none"]
    for variable, value in {"px": px, "py": py, **variables}.items():
        command += ["-var", variable, str(value)]
    with open(folder / "screen.txt", "w") as out:
        try:
            status = subprocess.run(command, cwd=folder, env={**environment(ranks), "OMPI_MCA_mpi_yield_when_idle": "1"}, stdin=subprocess.DEVNULL, stdout=out,
                                    stderr=subprocess.STDOUT, timeout=LONGEST).returncode
        except subprocess.TimeoutExpired:
            raise GoldenError(f"{name}: {deck} ran for more than {LONGEST} s") from None
    screen = (folder / "screen.txt").read_text(errors="replace")
    if status:
        raise GoldenError(f"{name}: LIGGGHTS stopped in {deck} with status {status}: {reason_in(screen)}")
    return screen


def bed_of(deck, launcher, cache):
    """The bed that a deck makes, in the cache; made by LIGGGHTS alone, on one rank."""
    bed = cache / "beds" / f"{Path(deck).stem}-{sha(text_of_deck(deck))[:12]}.restart"
    if not bed.exists():
        print(f"making {bed.name}: up to a minute, only the first time", flush=True)
        bed.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=cache) as folder:
            made = Path(folder) / "made.restart"
            run_liggghts(deck, launcher, deck, Path(folder), {"bed": made})
            made.replace(bed)
    return bed


# --- what comes out ---------------------------------------------------------------------------------------------------

def snapshots(file):
    """Each snapshot of a dump: (step, columns, rows of words sorted by tag, bounds of the box)."""
    with open(file) as f:
        for line in f:
            if line.startswith("ITEM: TIMESTEP"):
                step = int(next(f))
            elif line.startswith("ITEM: BOX"):
                box = [[float(bound) for bound in next(f).split()] for _ in range(3)]
            elif line.startswith("ITEM: NUMBER"):
                count = int(next(f))
            elif line.startswith("ITEM: ATOMS"):
                columns = line.split()[2:]
                rows = [next(f).split() for _ in range(count)]
                at = columns.index("id")
                yield step, columns, sorted(rows, key=lambda r: int(r[at])), box


def hashes(columns, rows, quantities):
    found = {}
    for name, parts in quantities.items():
        at = [columns.index(p) for p in parts]
        found[name] = sha("\n".join([" ".join([r[k] for k in at]) for r in rows]))
    return found


def thermo_rows(screen):
    """The rows printed while the fix was there: (step, {column: text})."""
    columns = None
    for line in screen.splitlines():
        words = line.split()
        if words[:1] == ["Step"]:
            columns = words if "cull" in words else None
        elif line.startswith("Loop time"):
            columns = None
        elif columns and len(words) == len(columns) and words[0].isdigit():
            yield int(words[0]), dict(zip(columns[1:], words[1:]))


def said(screen):
    """Lines of the fix itself, but for its version, those at a run's end and the forecast: the rows have their counts, and what
    seconds have gone into is no result."""
    lines = [line.strip() for line in screen.splitlines() if re.match(r"fix \S+ solid/cull: ", line)]
    no_result = r": \d+ steps, \d+ granules$| s in the fix since|granules in \d+ bodies; culled |solid/cull: version |: if it goes on like this"
    return [line for line in lines if not re.search(no_result, line)]


def hash_of_file(file):
    """Of all its bytes, but for the 36 of the random UUID that OpenVDB gives each file, from byte 21 on."""
    content = file.read_bytes()
    if file.suffix == ".vdb":
        if not content.startswith(b" BDV") or not re.fullmatch(rb"[0-9a-f-]{36}", content[21:57]):
            raise GoldenError(f"{file.name} has no UUID where OpenVDB writes it")
        content = content[:21] + content[57:]
    return sha(content)


class Reached:
    """Counts of what a case went through; a case that does not reach what it is for proves nothing."""

    def __init__(self, ranks):
        self.grid = GRID[ranks]
        names = ("interior", "carves", "restored", "bodies", "merges", "splits", "handed", "inserted", "carried")
        self.counts = dict.fromkeys(names, 0)
        self.before = {}
        self.first = None
        self.interior = 0  # now

    def restart(self):
        """A restart file has been written and is gone on from."""
        self.counts["carried"] = self.interior

    def values(self, row):
        number = {c: float(v) for c, v in row.items()}
        for name, column in (("interior", "cull"), ("carves", "cull[8]"), ("restored", "cull[7]"), ("bodies", "cull[4]")):
            self.counts[name] = max(self.counts[name], int(number[column]))
        self.interior = int(number["cull"])
        granules = int(number["Atoms"] + number["cull"])
        self.first = self.first or granules
        self.counts["inserted"] = max(self.counts["inserted"], granules - self.first)

    def granules(self, columns, rows, box):
        """Compares bodies with the snapshot before: those that became one, or several, and locked granules that changed rank."""
        tag, body, x, y = (columns.index(c) for c in ("id", "f_cull", "x", "y"))

        def rank(row):
            return [int((float(row[k]) - low) / (high - low) * n) for k, (low, high), n in zip((x, y), box, self.grid)]

        now = {r[tag]: (r[body], rank(r)) for r in rows if r[body] != "0"}
        into, outof = {}, {}
        for t, (b, p) in now.items():
            if t in self.before:
                into.setdefault(b, set()).add(self.before[t][0])
                outof.setdefault(self.before[t][0], set()).add(b)
                self.counts["handed"] += p != self.before[t][1]
        self.counts["merges"] += sum(len(s) - 1 for s in into.values())
        self.counts["splits"] += sum(len(s) - 1 for s in outof.values())
        self.before = now


def outcome(folder, screen, part, reached):
    """The lines of a record for one run of LIGGGHTS."""
    lines = []
    for step, row in thermo_rows(screen):
        reached.values(row)
        lines.append({"part": part, "step": step, "values": row})
    for step, columns, rows, box in snapshots(folder / "granules.dump"):
        reached.granules(columns, rows, box)
        lines.append({"part": part, "step": step, "granules": hashes(columns, rows, QUANTITIES)})
    lines.sort(key=lambda line: line["step"])  # stable: rows of one step stay in their order
    _, columns, rows, _ = next(snapshots(folder / "whole.dump"))
    written = [folder / "end.restart", *sorted(f for f in folder.iterdir() if re.match(r"(bed|mesh)\.\d+\.", f.name))]
    lines.append({"part": part, "step": None, "end": hashes(columns, rows, WHOLE),
                  "files": {f.name: hash_of_file(f) for f in written}, "said": said(screen)})
    return lines


def record_case(case, launcher, key, cache, directory, keep):
    """Runs a case and writes its record, whole or not at all; returns what it reached."""
    target = directory / f"{case.name}.jsonl"
    target.unlink(missing_ok=True)
    shutil.rmtree(directory / "raw" / case.name, ignore_errors=True)
    directory.mkdir(parents=True, exist_ok=True)
    bed = bed_of(case.bed, launcher, cache) if case.bed else None
    reached = Reached(case.ranks)
    lines = [{"case": case.name, "inputs": key_of_case(case), "bed": sha(bed.read_bytes()) if bed else None, "launcher": key}]
    cache.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=cache, prefix=f"{case.name}.") as work:
        for part, (deck, variables) in enumerate(case.parts, 1):
            folder = Path(work) / str(part)
            folder.mkdir()
            screen = run_liggghts(case.name, launcher, deck, folder, {"bed": bed, **variables} if bed else variables, case.ranks)
            lines += outcome(folder, screen, part, reached)
            bed = folder / "end.restart"
            if part < len(case.parts):
                reached.restart()
            if keep:
                raw = directory / "raw" / case.name / str(part)
                raw.mkdir(parents=True, exist_ok=True)
                for name in ("granules.dump", "whole.dump"):
                    with open(folder / name, "rb") as source, gzip.open(raw / f"{name}.gz", "wb", 1) as packed:
                        shutil.copyfileobj(source, packed)
                for file in lines[-1]["files"]:
                    shutil.copy(folder / file, raw)
    for name, least in case.demands.items():
        if reached.counts[name] < least:
            raise GoldenError(f"{case.name} proves nothing: {name} {reached.counts[name]}, at least {least} expected")
    lines.append({"reached": reached.counts})
    unfinished = target.with_suffix(".part")
    unfinished.write_text("".join(json.dumps(line) + "\n" for line in lines))
    unfinished.replace(target)
    return reached.counts


def complain(line):
    print(f"golden: {line}", file=sys.stderr, flush=True)


def record(cases, launcher, cache, directory, jobs, keep=False, known=False):
    """Records cases, on one rank several at a time; `known`: not those that are there already. Says which could not be recorded,
    and returns how many."""
    key = key_of_launcher(launcher)
    failures = 0
    if known:
        cases = [c for c in cases if not is_current(directory / f"{c.name}.jsonl", c, key)]
    broken = set()
    for deck in dict.fromkeys(c.bed for c in cases if c.bed):
        try:
            bed_of(deck, launcher, cache)
        except GoldenError as e:
            complain(f"no bed: {e}")
            broken.add(deck)
            failures += sum(c.bed == deck for c in cases)
    cases = [c for c in cases if c.bed not in broken]
    for several in (False, True):
        group = [c for c in cases if (c.ranks > 1) == several]
        with concurrent.futures.ThreadPoolExecutor(max(1, jobs // 2 if several else jobs)) as pool:
            running = {pool.submit(record_case, c, launcher, key, cache, directory, keep): c for c in group}
            for done in concurrent.futures.as_completed(running):
                try:
                    counts = done.result()
                    print(f"  {running[done].name}: " + ", ".join(f"{n} {k}" for n, k in counts.items() if k), flush=True)
                except GoldenError as e:
                    failures += 1
                    complain(e)
    return failures


def is_current(file, case, key):
    """Whether a record is of this launcher, these decks and this bed."""
    try:
        with open(file) as f:
            head = json.loads(f.readline())
    except (OSError, ValueError):
        return False
    return head.get("inputs") == key_of_case(case) and head.get("launcher") == key


# --- comparing --------------------------------------------------------------------------------------------------------

def read_record(file):
    try:
        lines = [json.loads(line) for line in file.read_text().splitlines()]
        if "case" not in lines[0] or "reached" not in lines[-1]:
            raise ValueError
        return lines
    except (OSError, ValueError, IndexError):
        raise GoldenError(f"{file} is not a whole record; record that case again") from None


def raw_rows(directory, case, part, step, quantity):
    """The numbers of a quantity by tag, from raw data that was kept; None without."""
    name = "granules.dump" if step is not None else "whole.dump"
    file = directory / "raw" / case / str(part) / f"{name}.gz"
    if not file.exists():
        return None
    with tempfile.NamedTemporaryFile("wb", suffix=".dump") as plain:
        with gzip.open(file) as packed:
            shutil.copyfileobj(packed, plain)
        plain.flush()
        for at, columns, rows, _ in snapshots(plain.name):
            if step is None or at == step:
                parts = [columns.index(c) for c in {**WHOLE, **QUANTITIES}[quantity]]
                return {int(r[columns.index("id")]): [float(r[k]) for k in parts] for r in rows}
    return None


def how_far(one, other):
    """In words, how far two sets of numbers by tag are apart."""
    lacking = len(one.keys() ^ other.keys())
    if lacking:
        return f"{lacking} granules in one alone"
    largest = max((abs(x) for row in one.values() for x in row), default=0)
    apart = {t: max(abs(x - y) for x, y in zip(one[t], other[t])) for t in one if repr(one[t]) != repr(other[t])}
    if not apart:
        return "the same numbers"
    worst = max(apart, key=apart.get)
    relative = f", {apart[worst] / largest:.3g} of the largest" if largest else ""
    return f"max |difference| {apart[worst]:.3g}{relative}, {len(apart)} granules, most at {worst}"


def difference(one, other, folders, case):
    """What differs between two lines of records, in words; empty if nothing does."""
    found = []
    for kind in ("values", "files"):
        a, b = one.get(kind, {}), other.get(kind, {})
        for name in [*a, *(n for n in b if n not in a)]:
            if a.get(name) != b.get(name):
                if name not in a or name not in b:
                    found.append(f"{name} in one alone")
                elif kind == "values":
                    found.append(f"{name} {a[name]} against {b[name]}")
                else:
                    found.append(name)
    for kind in ("granules", "end"):
        a, b = one.get(kind, {}), other.get(kind, {})
        for name in a:
            if a[name] != b.get(name):
                rows = [raw_rows(f, case, one["part"], one["step"], name) for f in folders]
                found.append(name + (f" ({how_far(*rows)})" if None not in rows else ""))
    if one.get("said") != other.get("said"):
        pairs = itertools.zip_longest(one.get("said", []), other.get("said", []), fillvalue="nothing")
        found.append("said: " + next(f"`{a}` against `{b}`" for a, b in pairs if a != b))
    return found


def compare_case(name, folders):
    """('identical' or where and how the case differs, whether it is identical)."""
    one, other = (read_record(f / f"{name}.jsonl") for f in folders)
    for what in ("inputs", "bed"):
        if one[0][what] != other[0][what]:
            other = "bed" if what == "bed" else "deck"
            raise GoldenError(f"{name} was recorded with another {other} in {folders[0]} than in {folders[1]}")
    for a, b in itertools.zip_longest(one[1:-1], other[1:-1]):
        if a is None or b is None or [a["part"], a["step"], a.keys()] != [b["part"], b["step"], b.keys()]:
            rows = ["nothing more" if line is None else f"step {line['step']}" for line in (a, b)]
            return f"one has {rows[0]} where the other has {rows[1]}", False
        found = difference(a, b, folders, name)
        if found:
            at = "at the end" if a["step"] is None else f"from step {a['step']}"
            again = f" after restart {a['part'] - 1}" if a["part"] > 1 else ""
            return f"differs {at}{again}: " + "; ".join(found), False
    return "identical", True


def compare(folders, patterns=None, quick=False):
    """Prints a line per case; returns the exit status."""
    for f in folders:
        if not f.is_dir():
            raise GoldenError(f"{f} is not a folder of records")
    names = [{p.stem for p in f.glob("*.jsonl")} for f in folders]
    if patterns or quick:
        wanted = [c.name for c in chosen(patterns, quick)]
    else:
        known = {c.name: k for k, c in enumerate(CASES)}
        wanted = sorted(names[0] | names[1], key=lambda n: (known.get(n, len(known)), n))
    if not wanted:
        raise GoldenError(f"{folders[0]} and {folders[1]} hold no records")
    counts = {"identical": 0, "different": 0, "missing": 0}
    for name in wanted:
        lacking = [str(f) for f, has in zip(folders, names) if name not in has]
        try:
            if lacking:
                raise GoldenError(f"{name} is missing in {' and '.join(lacking)}")
            text, same = compare_case(name, folders)
        except GoldenError as e:
            complain(e)
            counts["missing"] += 1
            continue
        print(f"{name}: {text}", flush=True)
        counts["identical" if same else "different"] += 1
    print(", ".join(f"{n} {k}" for k, n in counts.items()))
    return 2 if counts["missing"] else 1 if counts["different"] else 0


def run(cases, before, after, cache, jobs, keep):
    """Records both launchers (what is in the cache already is not run again) and compares. `keep`: cases that differ are run once
    more by both, to say by how much."""
    folders, failures = [], 0
    for name, launcher in (("before", before), ("after", after)):
        folder = cache / "records" / key_of_launcher(launcher)[:16]
        print(f"{name}: {launcher}", flush=True)
        failures += record(cases, launcher, cache, folder, jobs, known=True)
        folders.append(folder)
    whole = [c for c in cases if all((f / f"{c.name}.jsonl").exists() for f in folders)]
    different = [c for c in whole if not compare_case(c.name, folders)[1]]
    if keep and different:
        print("once more, what differs", flush=True)
        for folder, launcher in zip(folders, (before, after)):
            failures += record(different, launcher, cache, folder, jobs, keep=True)
    status = compare(folders, [c.name for c in whole]) if whole else 2
    return 2 if failures else status


# --- the command ------------------------------------------------------------------------------------------------------

class Parser(argparse.ArgumentParser):
    def error(self, message):
        raise GoldenError(f"{message}; see golden.py --help")


def arguments(words):
    parser = Parser(prog="golden.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    which = Parser(add_help=False)
    which.add_argument("--cases", nargs="+", metavar="PATTERN", help="only cases whose name matches")
    which.add_argument("--quick", action="store_true", help="only the small set")
    running = Parser(add_help=False, parents=[which])
    running.add_argument("--cache", type=Path, default=HERE / "out", help="beds and, for `run`, records; default %(default)s")
    running.add_argument("--keep", action="store_true", help="keep raw data, so that differences are given in figures")
    running.add_argument("-j", "--jobs", type=int, default=2, help="cores; default %(default)s")
    c = commands.add_parser("run", parents=[running])
    c.add_argument("--before", required=True)
    c.add_argument("--after", required=True)
    c = commands.add_parser("record", parents=[running])
    c.add_argument("--launcher", required=True)
    c.add_argument("directory", type=Path)
    c = commands.add_parser("compare", parents=[which])
    c.add_argument("folders", type=Path, nargs=2)
    commands.add_parser("list", parents=[which])
    return parser.parse_args(words)


def main(words=None):
    try:
        a = arguments(words)
        if a.command == "compare":
            return compare(a.folders, a.cases, a.quick)
        cases = chosen(a.cases, a.quick)
        if a.command == "list":
            print("\n".join(c.name for c in cases))
            return 0
        if a.command == "run":
            return run(cases, find_launcher(a.before), find_launcher(a.after), a.cache.absolute(), a.jobs, a.keep)
        failures = record(cases, find_launcher(a.launcher), a.cache.absolute(), a.directory.absolute(), a.jobs, a.keep)
        return 2 if failures else 0
    except GoldenError as e:
        complain(e)
        return 2


if __name__ == "__main__":
    sys.exit(main())
