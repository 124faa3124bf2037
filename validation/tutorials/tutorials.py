#!/usr/bin/python3
"""LIGGGHTS's own tutorials with the line put in before their last run: they end as without it, or are refused for the true reason.

    validation/tutorials/tutorials.py [tutorial ...] [--steps N] [--ranks 1,2] [--exterior live,sleep] [--examples FOLDER] [--check]

Takes the decks of Debian's package liggghts-doc. Each that runs in stock LIGGGHTS is run without the line and with
`fix cull all solid/cull exterior live`, then `sleep`, on 1 and 2 ranks. Prints a table and leaves it in out/tutorials.json, logs
beside it. `--steps N`: no run of a deck is longer than N steps. `--check`: the fix checks its invariants at each reneighbouring.
Exit: 0 all right, 1 a tutorial came out wrong, 2 nothing could be run.
"""
import argparse
import json
import os
import re
import shutil
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))
from solidcull_runs import engine, errors  # noqa: E402
from solidcull_runs.decks import read_deck, words_of  # noqa: E402

OUT = HERE / "out"
EXAMPLES = Path("/usr/share/doc/liggghts/examples/LIGGGHTS/Tutorials_public")
DECKS = ("in.*", "*.liggghts", "sphPoiseuille_STL_Gapmodel*")  # the last has decks without a suffix
NO_DECKS = {"in.pascal"}                                       # of another program
TIME_LIMIT = 3600                                              # s for one run
HERE_BEGINS = "TUTORIAL: here the line goes in"
INSERTED = re.compile(r"a total of (\d+) particle templates")
ENDED = re.compile(r"^TUTORIAL: (\d+) granules", re.M)
REFUSAL = re.compile(r"^ERROR: (fix cull solid/cull: .*)$", re.M)

# what each tutorial holds that a culled granule would miss, as the command page lists it
REASONS = {
    "heatTransfer_1/": "heat conduction", "heatTransfer_2/": "heat conduction",
    "hydrogel_multicontact/in.hydrogel_multicontact": "multicontact",
    "superquadric/": "only spheres",
    "sph_1/": "SPH|sph", "sph_2/": "SPH|sph", "sphPoiseuille": "SPH|sph",
}


def tutorials(examples):
    found = {d for pattern in DECKS for d in examples.glob(f"**/{pattern}") if d.is_file() and d.name not in NO_DECKS}
    return {str(d.relative_to(examples)): d for d in sorted(found) if re.search(r"^\s*run\s", d.read_text(errors="replace"), re.M)}


def reason_of(name):
    return next((reason for part, reason in REASONS.items() if name.startswith(part)), None)


def number(word, lines):
    """The steps of a run, which a deck may give by a variable's name; None where that takes LIGGGHTS itself."""
    name = re.fullmatch(r"\$\{(\w+)\}|\$(\w)", word)
    if not name:
        return int(word)
    values = [w[3] for w in map(words_of, lines) if w[:2] == ["variable", name[1] or name[2]] and len(w) == 4]
    return int(values[-1]) if values and values[-1].isdigit() else None


def shortened(lines, most):
    """The deck with no run longer than `most` steps; `upto` counts from where the shortened deck is."""
    made = []
    for line in lines:
        w = words_of(line)
        steps = number(w[1], lines) if w[:1] == ["run"] else None
        made.append(f"run {min(steps, most)} # {line.strip()}" if steps is not None and steps > most else line)
    return made


def with_line(lines, exterior):
    """The deck with the fix line before its last run, or with none; at its end it says how many granules there are."""
    last = max(k for k, line in enumerate(lines) if words_of(line)[:1] == ["run"])
    cull = [f"fix cull all solid/cull exterior {exterior} report full"] if exterior else []
    count = ["unfix cull"] if exterior else []
    count += ["run 0", "variable tutorial_end equal atoms", 'print "TUTORIAL: ${tutorial_end} granules"',
              'write_dump all custom tutorial.end id modify format "%d"']
    return lines[:last] + cull + [f'print "{HERE_BEGINS}"'] + lines[last:] + count


class Outcome:
    """A run of a tutorial: how it ended, with how many granules."""

    def __init__(self, lines, source, log, launcher, ranks):
        folder = log.with_suffix("")
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(source.parent, folder)
        for place in ("post", "post/restart"):
            (folder / place).mkdir(exist_ok=True)
        (folder / "tutorial.in").write_text("\n".join(lines) + "\n")
        process = engine.Process(launcher, "tutorial.in", folder, log, ranks=ranks, screen=log.with_suffix(".screen"))
        self.late = False

        def watch(p):
            if time.monotonic() - p.began > TIME_LIMIT:
                self.late = True
                p.stop()

        try:
            process.wait(watch)
            self.failed = None
        except errors.RunError as e:
            self.failed = str(e)
        self.text = log.read_text(errors="replace") if log.exists() else ""
        screen = log.with_suffix(".screen")
        self.screen = screen.read_text(errors="replace") if screen.exists() else ""
        self.seconds, self.status = process.wall, process.child.returncode
        ended = ENDED.search(self.text)
        self.granules = int(ended[1]) if ended else None
        totals = INSERTED.findall(self.text)
        self.inserted = int(totals[-1]) if totals else None
        end = folder / "tutorial.end"
        self.tags = sorted(map(int, end.read_text().split("ITEM: ATOMS id")[1].split())) if end.exists() else []
        self.refusals = REFUSAL.findall(self.text)
        stored = re.findall(r"fix cull solid/cull: (\d+) exterior, (\d+) interface, (\d+) interior granules.*?culled (\d+)", self.text)
        self.culled = int(stored[-1][3]) if stored else 0
        shutil.rmtree(folder, ignore_errors=True)

    def well(self):
        return self.failed is None and not self.late and self.granules is not None

    def why(self):
        told = re.findall(r"^ERROR[^:]*: (.*?)(?: \(\S+:\d+\))?$", self.text + self.screen, re.M)
        return told[0] if told else f"stops without a word, with status {self.status}" if self.failed else "it did not end"

    def figure(self):
        if self.late:
            return "did not end"
        if self.refusals:
            return "refused"
        return str(self.granules) if self.well() else "failed"


def fault(name, stock, alone, run):
    """What is wrong with a run that had the line, or None. stock: runs without it; alone: that on the same ranks."""
    if run.late:
        return "did not end"
    reason = reason_of(name)
    if run.refusals:
        if len(run.refusals) > 1 or not run.failed:
            return "is refused, but not in one line"
        said = re.sub(r" \(\S+:\d+\)$", "", run.refusals[0])
        return None if reason and re.search(reason, said) else f"is refused for another reason: {said}"
    if not run.well() and not alone.well() and run.why() == alone.why():
        return None  # so does stock
    if not run.well():
        return f"ended badly: {run.failed or 'before its last line'}"
    if reason:
        return f"is not refused, but holds what would miss the culled granules: {reason}"
    if len(set(run.tags)) != run.granules:
        return "has granules of the same tag"
    allowed = [s.granules for s in stock]
    if not min(allowed) <= run.granules <= max(allowed):
        return f"ends with {run.granules} granules, stock with {' and '.join(map(str, allowed))}"
    return None


def judge(name, source, ranks, exteriors, steps, launcher, stock):
    lines = shortened(read_deck(source), steps) if steps else read_deck(source)
    slug = name.replace("/", "-")
    runs, row = {}, {"tutorial": name, "faults": []}
    for n in ranks:
        runs[n] = Outcome(with_line(lines, None), source, OUT / f"{slug}.stock.{n}.log", stock, n)
        if n == ranks[0] and not runs[n].well():
            return {**row, "stock": None, "why": runs[n].why()}
    whole = [r for r in runs.values() if r.well()]
    row["stock"] = {n: r.figure() for n, r in runs.items()}
    row["seconds"] = {"stock": {n: round(r.seconds, 1) for n, r in runs.items()}}
    for exterior in exteriors:
        row[exterior], row["seconds"][exterior] = {}, {}
        for n in ranks:
            run = Outcome(with_line(lines, exterior), source, OUT / f"{slug}.{exterior}.{n}.log", launcher, n)
            row[exterior][n], row["seconds"][exterior][n] = f"{run.figure()} ({run.culled} culled)" if run.well() else run.figure(), round(run.seconds, 1)
            wrong = fault(name, whole, runs[n], run)
            if wrong:
                row["faults"].append(f"{exterior} on {n} rank{'s' * (n > 1)} {wrong}")
            if run.refusals:
                row["reason"] = re.sub(r" \(\S+:\d+\)$", "", run.refusals[0]).replace("fix cull solid/cull: ", "")
    return row


def print_row(row, ranks, exteriors):
    if row["stock"] is None:
        print(f"{row['tutorial']}: does not run in stock LIGGGHTS: {row['why']}", flush=True)
        return
    print(f"{row['tutorial']}: stock {', '.join(row['stock'][n] for n in ranks)}; " +
          "; ".join(f"{e} {', '.join(row[e][n] for n in ranks)}" for e in exteriors) +
          (f"; {row['reason']}" if "reason" in row else "") + f"; {'WRONG' if row['faults'] else 'right'}", flush=True)
    for line in row["faults"]:
        print(f"  {line}", flush=True)


def main(argv=None):
    p = argparse.ArgumentParser(prog="tutorials.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("tutorial", nargs="*", help="parts of their names (default: all)")
    p.add_argument("--steps", type=int, metavar="N", help="the longest that a run of a deck may be")
    p.add_argument("--ranks", default="1,2", metavar="LIST")
    p.add_argument("--exterior", default="live,sleep", metavar="LIST")
    p.add_argument("--examples", type=Path, default=EXAMPLES, metavar="FOLDER")
    p.add_argument("--check", action="store_true", help="the fix checks its invariants at each reneighbouring")
    options = p.parse_args(argv)
    ranks, exteriors = [int(n) for n in options.ranks.split(",")], options.exterior.split(",")
    launcher, stock = engine.find_launcher(), shutil.which("liggghts")
    if not stock:
        raise errors.RunError("no liggghts on the PATH: install Debian's package liggghts")
    found = {n: d for n, d in tutorials(options.examples).items() if not options.tutorial or any(t in n for t in options.tutorial)}
    if not found:
        raise errors.RunError(f"no tutorials in {options.examples}: install Debian's package liggghts-doc")
    if options.check:
        os.environ["SOLIDCULL_CHECK"] = "1"
    OUT.mkdir(exist_ok=True)
    rows = []
    for name, source in found.items():
        rows.append(judge(name, source, ranks, exteriors, options.steps, launcher, stock))
        print_row(rows[-1], ranks, exteriors)
        (OUT / "tutorials.json").write_text(json.dumps(rows, indent=1) + "\n")
    wrong = [r for r in rows if r["faults"]]
    print(f"{len(rows)} tutorials: {sum(r['stock'] is None for r in rows)} do not run in stock, {sum('reason' in r for r in rows)} refused, "
          f"{len(wrong)} wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    errors.command("tutorials", main)
