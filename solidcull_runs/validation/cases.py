"""A validation case is a folder of `validation/cases/`: README.md (claim, reference, metrics and their margins), a deck, and case.py.

case.py holds, as plain names:

| name | what |
| --- | --- |
| `deck` | file of the deck, with one `fix ID group solid/cull` line without keywords |
| `quick`, `full`, `production` | variables of the deck (and of the bed), by size, of which a case has one or more; `granules` is how many there are at the end |
| `bed` | optional: the deck that settles the bed and writes ${restart}; another folder's may be named |
| `bed_uses` | optional: the variables of the bed, all of the size if not said |
| `scenes` | optional: name -> more variables. The first is swept over all points, the others are run at the defaults only, and not in production. Or: size -> such scenes |
| `files(folder, v)` | optional: writes meshes and the like for the variables v; the deck finds the folder as ${files} |
| `aside` | the variable that moves the tool, ball or wall by 10 um from run to run |
| `by_hand` | optional: a region (style and arguments; the deck's variables) in which granules stay free when the rest is frozen by hand |
| `paper` | optional: False where the paper's scheme cannot be run |
| `curves` | metric -> thermo column, drawn against the column `time` |
| `measure(run, v)` | the value of each metric of a run; `run.start`, `run.final`: granules at the fix line and at the end |
| `laws(values)` | optional: of {scene: {metric: value}}, a list of (what, value, what is known) |
| `picture` | optional: (axis that is cut, share of the box, hidden radius) |

The metrics stand in README.md, in a table `| metric | unit | margin | why |`; a margin is a share ("2 %", of the unculled mean) or
a number in the metric's unit. They are fixed before the case is run.
"""
import hashlib
import importlib.util
import itertools
import json
import re
from dataclasses import dataclass
from pathlib import Path

from ..engine import ROOT
from ..errors import RunError

CASES = ROOT / "validation" / "cases"
QUICK, FULL, PRODUCTION = SIZES = ("quick", "full", "production")


@dataclass(frozen=True)
class Metric:
    name: str
    unit: str
    margin: float
    relative: bool  # the margin is a share of the unculled mean
    why: str

    def allowed(self, mean):
        """The margin in the metric's unit."""
        return self.margin * abs(mean) if self.relative else self.margin


def metrics_of(readme, where):
    """The metrics' table of a README."""
    lines = iter(readme.splitlines())
    for line in lines:
        if re.fullmatch(r"\|\s*metric\s*\|\s*unit\s*\|\s*margin\s*\|\s*why\s*\|", line.strip()):
            break
    else:
        raise RunError(f"{where} has no table '| metric | unit | margin | why |'")
    next(lines, None)
    found = []
    for line in lines:
        if not line.startswith("|"):
            break
        cells = [c.strip() for c in line.strip().strip("|").split("|")]
        number = re.fullmatch(r"([-+.\deE]+)\s*(%?).*", cells[2]) if len(cells) == 4 else None
        if not number or not cells[3]:
            raise RunError(f"{where}: the row '{line.strip()}' needs a metric, a unit, a margin (2 % or a number) and why")
        share = number[2] == "%"
        found.append(Metric(cells[0], cells[1], float(number[1]) / (100 if share else 1), share, cells[3]))
    if not found:
        raise RunError(f"{where} names no metric")
    return found


def paragraph(readme, name, where):
    """What stands behind **name.** up to the next empty line; of links the text, for they lead from the case's folder."""
    found = re.search(rf"\*\*{name}\.\*\*\s+(.+?)(?:\n\s*\n|\Z)", readme, re.S)
    if not found:
        raise RunError(f"{where} has no paragraph '**{name}.** ...'")
    return re.sub(r"\[([^]]+)\]\([^)]+\)", r"\1", " ".join(found[1].split()))


class Case:
    """A case and one of its sizes."""

    def __init__(self, folder, size):
        self.folder, self.name, self.size = Path(folder), Path(folder).name, size
        for file in ("README.md", "case.py"):
            if not (self.folder / file).is_file():
                raise RunError(f"case {self.name} has no {file}")
        readme = (self.folder / "README.md").read_text()
        self.title = readme.partition("\n")[0].lstrip("# ").strip()
        self.claim = paragraph(readme, "Claim", self.folder / "README.md")
        self.reference = paragraph(readme, "Reference", self.folder / "README.md")
        self.metrics = metrics_of(readme, self.folder / "README.md")
        self.given = self.read()
        scenes = self.get("scenes", {"": {}})
        scenes = scenes.get(size, scenes)
        self.scenes = dict(itertools.islice(scenes.items(), 1)) if size == PRODUCTION else scenes
        self.deck = self.folder / self.need("deck")
        if not any(hasattr(self.given, name) for name in SIZES):
            raise RunError(f"case {self.name}: case.py has none of {', '.join(SIZES)}")
        self.sized = dict(self.get(size, {}))
        self.need("measure")
        if not self.deck.is_file():
            raise RunError(f"case {self.name}: there is no deck {self.deck.name}")
        strange = set(self.get("curves", {})) - {m.name for m in self.metrics}
        if strange:
            raise RunError(f"case {self.name}: curves of {', '.join(sorted(strange))}, which the README's table does not name")

    def read(self):
        spec = importlib.util.spec_from_file_location(f"case_{self.name}", self.folder / "case.py")
        module = importlib.util.module_from_spec(spec)
        try:
            spec.loader.exec_module(module)
        except Exception as e:
            raise RunError(f"case {self.name}: case.py cannot be read: {type(e).__name__}: {e}") from None
        return module

    def get(self, name, otherwise=None):
        return getattr(self.given, name, otherwise)

    def need(self, name):
        if not hasattr(self.given, name):
            raise RunError(f"case {self.name}: case.py has no '{name}'")
        return getattr(self.given, name)

    @property
    def is_there(self):
        """Whether it has this size."""
        return hasattr(self.given, self.size)

    @property
    def main_scene(self):
        return next(iter(self.scenes))

    def variables(self, scene):
        return {**self.sized, **self.scenes[scene]}

    def granules(self, scene):
        return int(self.variables(scene)["granules"])

    def bed(self, scene):
        """The deck of its bed and its variables; None where the deck makes its own granules."""
        named = self.get("bed")
        if not named:
            return None
        v = self.variables(scene)
        uses = self.get("bed_uses", tuple(self.sized))
        return (self.folder / named).resolve(), {name: v[name] for name in uses if name in v}

    def measured(self, run, scene):
        """The value of each metric; RunError where one is missing or is no number."""
        try:
            values = self.given.measure(run, self.variables(scene))
        except RunError:
            raise
        except Exception as e:
            raise RunError(f"case {self.name}: measure() of {run.name} fails: {type(e).__name__}: {e}") from None
        missing = [m.name for m in self.metrics if m.name not in values]
        if missing:
            raise RunError(f"case {self.name}: measure() gives no value for {', '.join(missing)}")
        wrong = [name for name, value in values.items() if not abs(float(value)) < float("inf")]
        if wrong:
            raise RunError(f"case {self.name}: {run.name} has no number for {', '.join(wrong)}")
        return {m.name: float(values[m.name]) for m in self.metrics}


def short_hash(what):
    return hashlib.sha1(json.dumps(what, sort_keys=True, default=str).encode()).hexdigest()[:8]


def names(root=CASES):
    return sorted(f.name for f in Path(root).iterdir() if f.is_dir() and (f / "case.py").exists()) if Path(root).is_dir() else []


def load(wanted, size, root=CASES):
    """The cases that are wanted by name, all of this size if none is."""
    there = names(root)
    unknown = [name for name in wanted if name not in there]
    if unknown:
        raise RunError(f"no case '{unknown[0]}'; there is: {', '.join(there)}")
    found = [Case(Path(root) / name, size) for name in (wanted or there)]
    for case in found if wanted else ():
        if not case.is_there:
            raise RunError(f"case {case.name} has no size {size}; these have: {', '.join(c.name for c in load([], size, root)) or 'none'}")
    return [case for case in found if case.is_there]
