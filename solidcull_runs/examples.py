"""The course that an example takes: its bed, its deck unculled and culled, table, plot and pictures."""
import argparse
import importlib.util
import json
from dataclasses import dataclass, field
from pathlib import Path

from . import cutaways, few_steps, tables, vtp
from .beds import settled
from .comparisons import is_lost
from .engine import ROOT
from .twins import Job, compare, cores


@dataclass
class Example:
    """What is an example's own. `out` in its functions: the folder that the run at hand writes to."""
    here: Path
    deck: str                # with the solid/cull line; its variables: restart, folder, those in `few`
    bed: str                 # the deck that makes the bed; its variables: restart, folder, those in `few_bed`
    bed_takes: str           # what it makes, and how long it takes
    sources: tuple           # files that both decks read
    granules: int
    steps: int               # of the deck
    wanted: tuple            # thermo metrics
    figures: object          # figures(run, out): more metrics, by name
    plot: object             # plot(runs, file)
    moments: object          # moments(out, steps, runs): (title, granules image, mesh image) of each moment; `steps`: of the bed files
    files_every: int         # steps between two files of the run that writes them
    few: dict                # with few steps: variables of the deck,
    few_bed: dict            # of the bed's deck,
    few_granules: int        # and what these make of it
    few_steps: int
    few_files_every: int
    few_keywords: str = None  # more of them on the fix line, so that it locks granules at once
    vdb_every: int = None
    vary: tuple = None       # a variable and its value in each pair of runs, in place of moving all granules
    runs: int = 3            # of each kind
    at_once: int = 1
    ranks: int = 1           # of each run
    prepare: object = None   # prepare(out): before anything is run
    after: object = None     # after(example, variables, runs, few) -> (text, whether all is well): what it shows besides
    text: object = field(default=lambda result, runs: tables.explained(result))  # what is printed

    @property
    def name(self):
        return self.here.name

    def folder(self, few):
        return self.here / "out" / "few" if few else self.here / "out"

    def bed_file(self, few):
        """The bed at rest; made the first time."""
        out = self.folder(few)
        return settled(out / "bed.restart", self.here / self.bed, [self.here / f for f in self.sources],
                       {"folder": out.relative_to(self.here), **(self.few_bed if few else {})}, ranks=self.ranks,
                       say=lambda line: print(line if few else f"{self.bed_takes}, only the first time", flush=True))

    def files_job(self, variables, few):
        """One more culled run, not compared, that writes what ParaView opens and the pictures are drawn from."""
        out, every = self.folder(few), self.few_files_every if few else self.files_every
        at = out.relative_to(self.here)
        keywords = f"{few and self.few_keywords or ''} bed {every} {at}/bed.*.vtp mesh {every} {at}/mesh.*.vtp"
        if self.vdb_every:
            keywords += f" mesh {every if few else self.vdb_every} {at}/mesh.*.vdb"
        return Job(self.here / self.deck, out, "files", 0, variables, self.ranks, shifted=False, keywords=keywords, name="files")


def load(name):
    """The module of another example, for what it measures."""
    spec = importlib.util.spec_from_file_location(f"example_{name}", ROOT / "examples" / name / "example.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def draw(example, out, runs):
    """Cut-away pictures; False when the fix has left no files to draw."""
    steps = vtp.steps_of(out / "bed.*.vtp")
    moments = list(example.moments(out, steps, runs)) if steps else []
    if not moments or any(moment[1] is None for moment in moments):
        return False
    cutaways.film_strip(moments, out / "cut-away.png")
    return True


def options(example):
    p = argparse.ArgumentParser(prog=f"{example.name}/example.py")
    p.add_argument("--unculled", type=int, default=example.runs, metavar="N", help=f"unculled runs (default {example.runs})")
    p.add_argument("--culled", type=int, default=example.runs, metavar="N", help=f"culled runs (default {example.runs})")
    p.add_argument("--at-once", type=int, default=min(example.at_once, cores()), metavar="N",
                   help=f"runs at the same time (default {example.at_once}, at most one a core)")
    p.add_argument("--few-steps", action="store_true", help="few granules, few steps, one run of each kind: that all of it still runs")
    a = p.parse_args()
    most = len(example.vary[1]) if example.vary else 10
    if not (1 <= a.unculled <= most and 1 <= a.culled <= most and a.at_once >= 1):
        p.error(f"--unculled and --culled take 1 to {most}, --at-once 1 or more")
    return a


def main(example):
    """Exit status: 0 it ran and no granule is lost, whatever figures are outside their margins (the table names them); 1 a granule is
    lost, or the fix wrote nothing to draw."""
    a = options(example)
    out = example.folder(a.few_steps)
    out.mkdir(parents=True, exist_ok=True)
    if example.prepare:
        example.prepare(out)
    bed = example.bed_file(a.few_steps)
    for old in [f for kind in ("bed.*.vtp", "mesh.*.vtp", "mesh.*.vdb", "*.series") for f in out.glob(kind)]:
        old.unlink()
    variables = {"restart": bed.relative_to(example.here), "folder": out.relative_to(example.here), **(example.few if a.few_steps else {})}
    granules, steps = (example.few_granules, example.few_steps) if a.few_steps else (example.granules, example.steps)
    n = (1, 1) if a.few_steps else (a.unculled, a.culled)
    print(f"{n[0]} unculled and {n[1]} culled runs of {steps:,} steps in turns, {a.at_once} at once", flush=True)
    result, runs = compare(example.here / example.deck, example.wanted, out=out, unculled=n[0], culled=n[1], vary=example.vary,
                           variables=variables, ranks=example.ranks, extra=lambda run: example.figures(run, out), at_once=a.at_once, steps=steps,
                           granules=granules, keywords=example.few_keywords if a.few_steps else None, also=[example.files_job(variables, a.few_steps)],
                           say=lambda line: print("  " + line, flush=True))
    if a.few_steps:
        few_steps.check(runs, granules, steps)
    text, well = example.text(result, runs), True
    if example.after:
        more, well = example.after(example, variables, runs, a.few_steps)
        text += "\n\n" + more
    (out / "twin.json").write_text(json.dumps(result, indent=1) + "\n")
    (out / "table.txt").write_text(text + "\n")
    print(f"\n{text}\n", flush=True)
    example.plot(runs, out / "plot.png")
    drawn = draw(example, out, runs)
    print(f"plot: {out / 'plot.png'}\n" + (f"pictures: {out / 'cut-away.png'}" if drawn else f"no pictures: the fix wrote no {out / 'bed.*.vtp'}"))
    return 1 if not (drawn and well) or is_lost(result["ledger"]) else 0
