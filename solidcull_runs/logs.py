"""What a run printed: its thermo tables, and a column of them as one series."""
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from .errors import RunError

FROM_HERE = "twin: counted from here"
TO_HERE = "twin: end of the deck"
REDUCERS = {"end": lambda v: v[-1], "max": np.max, "min": np.min, "mean": np.mean}
THERMO_WORDS = {"step": "Step", "atoms": "Atoms", "ke": "KinEng", "erotate": "RotEng", "vol": "Volume", "time": "Time",
                "cpu": "CPU", "cu": "Cu", "density": "Density", "fmax": "Fmax", "fnorm": "Fnorm"}


@dataclass
class Table:
    columns: list
    rows: list = field(default_factory=list)
    counted: bool = False  # printed between the fix line and the end of the deck
    loop_time: float = None

    def column(self, name):
        """Where the column is that a deck calls so, or None."""
        bare = re.sub(r"^[cfv]_", "", name)
        found = next((c for c in (name, bare, THERMO_WORDS.get(name)) if c in self.columns), None)
        return None if found is None else self.columns.index(found)


def numbers(line):
    try:
        return [float(word) for word in line.split()]
    except ValueError:
        return None


def parse_log(text):
    """The thermo tables of a log."""
    tables, table, counted = [], None, False
    lines = text.splitlines()
    for line, following in zip(lines, lines[1:] + [""]):
        if line.strip() in (FROM_HERE, TO_HERE):
            counted = line.strip() == FROM_HERE
        elif line.startswith("Loop time of"):
            if tables and tables[-1].loop_time is None:
                tables[-1].loop_time = float(line.split()[3])
            table = None
        elif line.split()[:1] == ["Step"] or table is None and is_header(line, following):
            table = Table(line.split(), counted=counted)
            tables.append(table)
        elif table and (row := numbers(line)) and len(row) == len(table.columns):
            table.rows.append(row)
    return tables


def is_header(line, following):
    words, row = line.split(), numbers(following)
    return bool(row) and len(row) == len(words) and all(numbers(word) is None for word in words)


def reached_the_end(text):
    """Whether a deck of `decks.make_deck` came to its last line."""
    return any(line.strip() == TO_HERE for line in text.splitlines())


def loop_time(tables):
    """Of all that is counted (s)."""
    return sum(t.loop_time or 0 for t in tables if t.counted)


FORECAST = re.compile(r"if it goes on like this, the run will be about (?:([\d.e+]+) times (less|more)|as much) work")
TOLD = re.compile(r"time          = .*: about (?:([\d.e+]+) times (less|more)|as much) work")


def times_less(found):
    """How many times less work, of a match of FORECAST or TOLD; 1 where it is as much."""
    return None if not found else 1.0 if not found[1] else float(found[1]) if found[2] == "less" else 1 / float(found[1])


def loops(text):
    """The runs of a deck behind its solid/cull line: seconds of the loop, and how many times less work the fix forecast of it and told at
    its end, None where it did not."""
    found, begun = [], 0
    behind = text.partition(f"\n{FROM_HERE}\n")[2].partition(f"\n{TO_HERE}\n")[0]
    for loop in re.finditer(r"(?m)^Loop time of ([\d.e+-]+) .*$", behind):
        of_loop = behind[begun:loop.end()]
        begun = loop.end()
        found.append({"seconds": float(loop[1]), "forecast": times_less(FORECAST.search(of_loop)), "told": times_less(TOLD.search(of_loop))})
    return found


def inserted(text):
    """How many granules the insertion fixes of a deck put in behind its solid/cull line."""
    before, _, behind = text.partition(f"\n{FROM_HERE}\n")

    def totals(part):
        return {m[1]: int(m[2]) for m in re.finditer(r"Particle insertion (\S+): inserted .*\n - a total of (\d+) particle templates", part)}
    then = totals(before)
    return sum(total - then.get(fix, 0) for fix, total in totals(behind).items())


def series(tables, name):
    """Steps and values of a thermo column, from the counted tables. The row that a run prints before its first step is
    left out where the run before it has printed that step: LIGGGHTS counts mesh loads twice there."""
    steps, values, known, last = [], [], [], None
    for t in tables:
        column, step = t.column(name), t.column("step")
        for k, row in enumerate(t.rows):
            repeated = k == 0 and last is not None and step is not None and row[step] == last[0] and t.columns == last[1]
            if t.counted and column is not None and not repeated:
                values.append(row[column])
                steps.append(row[step] if step is not None else len(steps))
        if t.rows and step is not None:
            last = (t.rows[-1][step], t.columns)
        known += [c for c in t.columns if t.counted and c not in known]
    if not values:
        raise RunError(f"{name} is not among the thermo columns printed after the solid/cull line: {', '.join(known) or 'none'}")
    return np.array(steps), np.array(values)


def reducer_of(metric):
    how = metric.partition(":")[2] or "end"
    if how not in REDUCERS:
        raise RunError(f"metric {metric}: `{how}` is not one of {', '.join(REDUCERS)}")
    return REDUCERS[how]


def metric_of(tables, metric):
    """The figure of a thermo column and a reducer: `c_ke:max`."""
    return float(reducer_of(metric)(series(tables, metric.split(":")[0])[1]))


def steps_made(file):
    """Steps from the fix line to the last row of a log that is still written; 0 if there is none yet."""
    try:
        text = Path(file).read_text(errors="replace")
    except OSError:
        return 0
    rows = re.findall(r"(?m)^ +(\d+) +[-+.\deE ]+$", text.partition(f"\n{FROM_HERE}\n")[2])
    return int(rows[-1]) - int(rows[0]) if rows else 0
