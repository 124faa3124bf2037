#!/usr/bin/python3
"""One deck, with and without its `fix ... solid/cull` line, and the difference beside the deck's own scatter.

    validation/twin.py in.pile --metrics c_height,ke:max,f_wall[3]:mean

Runs the deck unculled (three times, 1e-5 granule diameters apart: their scatter is the noise floor) and culled, and
prints a table: granules, loop times, and each metric's error beside the noise floor. A metric is a thermo column, with
`:end` (default), `:max`, `:min` or `:mean` over the rows printed after the fix line. A culled metric is good when it lies
within the margin, the larger of 2 % and the noise floor, of the unculled mean.

Every run works in the deck's own folder, so relative paths hold, and what the deck itself writes is written again by
each run (the last is a culled one). A deck that wants them apart uses the variable `twin`: every run is given its own
name in it (unculled-1, culled-1, ...). Exit: 0 all good, 1 a metric outside its margin or a granule lost, 2 no result.
"""
import argparse
import json
import os
import re
import shutil
import statistics
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

FROM_HERE = "twin: counted from here"
TO_HERE = "twin: end of the deck"
COUNTS = ("exterior", "interface", "interior", "bodies", "stored_mass", "culled", "restored", "carves",
          "largest_excess", "seconds", "mass_error", "restore_energy")  # f_ID[1..12]
SAMPLE_EVERY = 10  # steps between two rows of COUNTS
SHIFT = 1e-5       # granule diameters, between two unculled runs
SEEDS = (15485863, 15485867, 32452843, 32452867, 49979687, 49979693, 67867967, 67867979, 86028121, 86028157)
REDUCERS = {"end": lambda v: v[-1], "max": np.max, "min": np.min, "mean": np.mean}
THERMO_WORDS = {"step": "Step", "atoms": "Atoms", "ke": "KinEng", "erotate": "RotEng", "vol": "Volume", "time": "Time",
                "cpu": "CPU", "cu": "Cu", "density": "Density", "fmax": "Fmax", "fnorm": "Fnorm"}


class TwinError(Exception):
    """What the user has to mend, in one line."""


# --- the deck -------------------------------------------------------------------------------------------------------

def read_deck(path):
    """Logical lines of a deck (`&` joined); a file that it includes is put in place when it holds the fix line or thermo columns."""
    try:
        text = Path(path).read_text()
    except OSError as e:
        raise TwinError(f"cannot read the deck {path}: {e.strerror}") from None
    lines = []
    for line in re.sub(r"&[ \t]*\n", " ", text).splitlines():
        included = re.match(r"\s*include\s+(\S+)", line)
        file = Path(path).parent / included[1] if included else None
        if file and file.is_file() and re.search("solid/cull|thermo_style", file.read_text()):
            lines += read_deck(file)
        else:
            lines.append(line)
    return lines


def words_of(line):
    """The words of a line, without its comment."""
    return re.sub(r"(^|\s)#.*", "", line).split()


def cull_fix(lines, deck="the deck"):
    """The ID of the solid/cull fix."""
    ids = [w[1] for w in map(words_of, lines) if w[:1] == ["fix"] and w[3:4] == ["solid/cull"]]
    if not ids:
        raise TwinError(f"{deck} has no `fix ID group solid/cull` line; add one, it is what twin takes out and puts back")
    if len(ids) > 1:
        raise TwinError(f"{deck} has {len(ids)} solid/cull lines; twin compares one")
    return ids[0]


class Dependents:
    """What in a deck hangs on the solid/cull fix: followed line by line, through variables, computes, fixes and regions."""

    MAKERS = {"variable": ("v_", "variable {} delete"), "compute": ("c_", "uncompute {}"), "fix": ("f_", "unfix {}"),
              "dump": ("", "undump {}"), "region": ("", "region {} delete"), "group": ("", None)}
    ENDERS = {"unfix": "fix", "fix_modify": "fix", "uncompute": "compute", "undump": "dump", "dump_modify": "dump"}

    def __init__(self, fix_id):
        self.made = [("fix", fix_id)]

    def names(self, word):
        """Whether this word refers to something that hangs on the fix."""
        for kind, name in self.made:
            prefix = self.MAKERS[kind][0]
            n = re.escape(name)
            if prefix and re.search(rf"(?<!\w){prefix}{n}(?!\w)", word):
                return True
            if kind == "variable" and (f"${{{name}}}" in word or len(name) == 1 and f"${name}" in word):
                return True
            if kind in ("region", "group") and word == name:
                return True
        return False

    def touches(self, w):
        """Whether a command (its words) hangs on the fix; what it makes then does too."""
        kind = self.ENDERS.get(w[0])
        if kind:
            return (kind, w[1]) in self.made
        hangs = any(map(self.names, w[1:])) or w[0] == "region" and w[2:3] == ["interface/mesh"]
        if hangs and w[0] in self.MAKERS and (w[0], w[1]) not in self.made:
            self.made.append((w[0], w[1]))
        return hangs

    def undo(self, ended):
        """Commands that take away, last first, all but the fix itself and what the deck has ended itself."""
        return [self.MAKERS[kind][1].format(name) for kind, name in reversed(self.made[1:])
                if self.MAKERS[kind][1] and (kind, name) not in ended]


def end_of_deck(final):
    """Lines behind the deck's last: every granule's mass and place, for the ledger."""
    return [f'write_dump all custom "{final}" id mass radius x y z modify format "%d %.15g %.15g %.15g %.15g %.15g"']


def make_deck(lines, fix_id, culled, shift_seed, base):
    """The deck of one run, as lines. `base`: path without suffix for what this run writes."""
    hangs = Dependents(fix_id)
    ended, counting, shifted, out = set(), False, False, []
    for number, line in enumerate(lines, 1):
        w = words_of(line)
        if w[:1] == ["fix"] and w[3:4] == ["solid/cull"]:
            out += [f'print "{FROM_HERE}"'] + ([line, counts_line(fix_id, base)] if culled else [f"# {line}"])
            counting = True
            continue
        if w[:1] == ["run"] and counting and not shifted:
            out += shift_lines(shift_seed)
            shifted = True
        if not w or not hangs.touches(w):
            out.append(line)
            continue
        if w[0] in ("unfix", "uncompute", "undump"):
            ended.add((hangs.ENDERS[w[0]], w[1]))
        if culled:
            out += ["unfix twin_counts"] * (w[:2] == ["unfix", fix_id]) + [line]
        elif w[0] == "thermo_style" or w[0] == "dump" and w[3:4] == ["custom"]:
            out.append(" ".join(x for x in w if not hangs.names(x)))
        elif w[0] in hangs.MAKERS or w[0] in hangs.ENDERS or w[0] == "print":
            out.append(f"# {line}")
        else:
            raise TwinError(f"line {number} hangs on the solid/cull fix and cannot be left out: {' '.join(w)}")
    out.append(f'print "{TO_HERE}"')
    if ("fix", fix_id) not in ended:
        out.append("thermo_style one")
        if culled:
            out += ["unfix twin_counts"] + hangs.undo(ended) + [f"unfix {fix_id}"]
        out.append("run 0")
    return out + end_of_deck(f"{base}.final")


def check_metrics(metrics, lines):
    """Refuses, before hours of running, a metric that the unculled deck (its lines) will not print."""
    for metric in metrics:
        reducer_of(metric)
    styles = [words_of(line)[1:] for line in lines if words_of(line)[:1] == ["thermo_style"]]
    hidden = any(words_of(line)[:1] == ["include"] and "$" in line for line in lines)
    if hidden or any(s[:1] != ["custom"] for s in styles[:-1]) or len(styles) < 2:  # the last one may be end_of_deck's
        return
    columns = list(dict.fromkeys(c for s in styles if s[:1] == ["custom"] for c in s[1:]))
    bare = [re.sub(r"^[cfv]_", "", c) for c in columns] + [THERMO_WORDS.get(c) for c in columns]
    for name in (m.split(":")[0] for m in metrics):
        if name not in columns and name not in bare:
            raise TwinError(f"{name} is not among the thermo columns of the deck without the fix: {', '.join(columns)}")


def counts_line(fix_id, base):
    columns = " ".join(f"f_{fix_id}[{k}]" for k in range(1, len(COUNTS) + 1))
    return f'fix twin_counts all ave/time {SAMPLE_EVERY} 1 {SAMPLE_EVERY} {columns} file "{base}.counts"'


def shift_lines(seed):
    """Moves every granule by up to SHIFT of its diameter; nothing without a seed."""
    if not seed:
        return []
    lines = []
    for k, axis in enumerate("xyz"):
        lines += [f"variable twin_{axis} atom {axis}+{2 * SHIFT:g}*r*random(-1,1,{seed + k})",
                  f"set group all {axis} v_twin_{axis}"]
    return lines


# --- a run ----------------------------------------------------------------------------------------------------------

@dataclass
class Table:
    columns: list
    rows: list = field(default_factory=list)
    counted: bool = False  # printed between the fix line and the end of the deck
    loop_time: float = None


@dataclass
class Run:
    name: str
    tables: list
    loop_time: float
    counts: dict = None         # COUNTS by name, and "step": arrays; culled runs only
    final: np.ndarray = None    # id mass radius x y z of every granule at the end of the deck, by id; None if not reached
    metrics: dict = field(default_factory=dict)

    def series(self, metric):
        """Steps and values of a metric's column."""
        return series(self.tables, metric.split(":")[0])


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
    return bool(row) and len(row) == len(words) and numbers(line) is None and all(map(numbers_not, words))


def numbers_not(word):
    return numbers(word) is None


def series(tables, name):
    """Steps and values of a thermo column, from the counted tables. The row that a run prints before its first step is
    left out where the run before it has printed that step: LIGGGHTS counts mesh loads twice there."""
    bare = re.sub(r"^[cfv]_", "", name)
    steps, values, known, last = [], [], [], None
    for t in tables:
        column = next((c for c in (name, bare, THERMO_WORDS.get(name)) if c in t.columns), None)
        step = t.columns.index("Step") if "Step" in t.columns else None
        for k, row in enumerate(t.rows):
            repeated = k == 0 and last is not None and step is not None and row[step] == last[0] and t.columns == last[1]
            if t.counted and column and not repeated:
                values.append(row[t.columns.index(column)])
                steps.append(row[step] if step is not None else len(steps))
        if t.rows and step is not None:
            last = (t.rows[-1][step], t.columns)
        known += [c for c in t.columns if t.counted and c not in known]
    if not values:
        raise TwinError(f"{name} is not among the thermo columns printed after the solid/cull line: {', '.join(known) or 'none'}")
    return np.array(steps), np.array(values)


def reducer_of(metric):
    how = metric.partition(":")[2] or "end"
    if how not in REDUCERS:
        raise TwinError(f"metric {metric}: `{how}` is not one of {', '.join(REDUCERS)}")
    return REDUCERS[how]


def metric_of(tables, metric):
    return float(reducer_of(metric)(series(tables, metric.split(":")[0])[1]))


def environment():
    """Open MPI as root, and in a container or bare root, says nothing and does its work."""
    env = dict(os.environ)
    for name, value in {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMP_NUM_THREADS": "1",
                        "OMPI_MCA_btl_vader_single_copy_mechanism": "none",
                        "OMPI_MCA_plm_rsh_agent": ""}.items():
        env.setdefault(name, value)
    return env


def find_launcher(named=None):
    if named and shutil.which(named):
        return str(Path(shutil.which(named)).absolute())
    built = Path(__file__).resolve().parents[1] / "build" / "liggghts-solidcull"
    found = None if named else (str(built) if os.access(built, os.X_OK) else shutil.which("liggghts-solidcull"))
    if not found:
        raise TwinError(f"no launcher at {named or built}: build it (cmake -S . -B build && cmake --build build) "
                        "or name it with --launcher")
    return found


def error_in(log):
    """The line of a log that says why LIGGGHTS stopped."""
    lines = [line.strip() for line in log.splitlines() if line.strip()]
    errors = [line for line in lines if line.startswith("ERROR")]
    return (errors or lines or ["it printed nothing"])[-1]


def run_liggghts(launcher, deck, folder, log, variables, ranks=1):
    """Runs a deck in a folder, everything that it prints in the file `log`; returns that text."""
    command = [launcher, "-in", str(deck), "-log", "none", "-echo", "screen"]
    for name, value in variables.items():
        command += ["-var", name, str(value)]
    if ranks > 1:
        command = ["mpirun", "--oversubscribe", "-np", str(ranks)] + command
    with open(log, "w") as f:
        status = subprocess.run(command, cwd=folder, env=environment(), stdin=subprocess.DEVNULL, stdout=f,
                                stderr=subprocess.STDOUT).returncode
    text = Path(log).read_text(errors="replace")
    if status:
        raise TwinError(f"{Path(log).stem}: LIGGGHTS stopped with status {status}: {error_in(text)} (all of it: {log})")
    return text


def read_counts(file):
    rows = np.loadtxt(file, ndmin=2)
    if not rows.size:
        return None
    return dict(zip(("step",) + COUNTS, rows.T))


def read_final(file):
    """The last snapshot of a dump `id mass radius x y z` as a structured array sorted by id."""
    with open(file) as f:
        for line in f:
            if line.startswith("ITEM: ATOMS"):
                break
        columns = line.split()[2:]
        rows = np.loadtxt(f, dtype=[(c, int if c == "id" else float) for c in columns], ndmin=1)
    return np.sort(rows, order="id")


# --- the comparison -------------------------------------------------------------------------------------------------

def compare(deck, metrics=(), launcher=None, out=None, unculled=3, culled=1, vary=None, variables=None, ranks=1,
            margin=0.02, extra=None, say=lambda line: None):
    """Runs the deck unculled and culled in turns; returns (result, runs). `vary`: (variable, values), one value a run,
    in place of moving all granules. `extra(run)`: more metrics, a dict by name. `result` is plain data (see twin.json)."""
    deck = Path(deck).resolve()
    lines = read_deck(deck)
    fix_id = cull_fix(lines, deck.name)
    check_metrics(metrics, make_deck(lines, fix_id, False, None, "-"))
    launcher = find_launcher(launcher)
    out = Path(out).resolve() if out else deck.with_name(deck.name + ".twin")
    out.mkdir(parents=True, exist_ok=True)
    if vary and len(vary[1]) < max(unculled, culled):
        raise TwinError(f"--vary {vary[0]} has {len(vary[1])} values for {max(unculled, culled)} runs")

    def one(kind, k):
        base = out / f"{kind}-{k + 1}"
        for suffix in (".counts", ".final"):
            base.with_name(base.name + suffix).unlink(missing_ok=True)
        seed = SEEDS[k - 1] if k and not vary else None
        made = out / f"{base.name}.in"
        made.write_text("\n".join(make_deck(lines, fix_id, kind == "culled", seed, base)) + "\n")
        given = {**(variables or {}), "twin": base.name, **({vary[0]: vary[1][k]} if vary else {})}
        tables = parse_log(run_liggghts(launcher, made, deck.parent, out / f"{base.name}.log", given, ranks))
        run = Run(base.name, tables, sum(t.loop_time or 0 for t in tables if t.counted))
        if (counts := out / f"{base.name}.counts").exists():
            run.counts = read_counts(counts)
        if (final := out / f"{base.name}.final").exists():
            run.final = read_final(final)
        run.metrics = {m: metric_of(tables, m) for m in metrics} | (extra(run) if extra else {})
        say(f"{base.name}: {run.loop_time:.1f} s")
        return run

    runs = {"unculled": [], "culled": []}
    for k in range(max(unculled, culled)):
        for kind, n in (("unculled", unculled), ("culled", culled)):
            if k < n:
                runs[kind].append(one(kind, k))
    return judge(runs["unculled"], runs["culled"], margin), runs


def judge(unculled, culled, margin):
    """The figures of the table, as plain data."""
    result = {"unculled": summary(unculled), "culled": summary(culled), "metrics": {}}
    result["speed_up"] = result["unculled"]["loop_time"] / max(result["culled"]["loop_time"], 1e-9)
    for name in unculled[0].metrics:
        a, b = [r.metrics[name] for r in unculled], [r.metrics[name] for r in culled]
        mean, spread = statistics.fmean(a), max(a) - min(a)
        error, allowed = abs(statistics.fmean(b) - mean), max(margin * abs(mean), spread)
        result["metrics"][name] = {
            "unculled": a, "culled": b, "mean": mean, "spread": spread, "culled_mean": statistics.fmean(b), "error": error,
            "worst": max(abs(x - mean) for x in b), "of_spread": error / spread if spread else None, "margin": allowed,
            "good": error <= allowed}
    result["ledger"] = ledger(unculled[0].final, [r.final for r in culled])
    lost = result["ledger"] and (result["ledger"]["lost"] or result["ledger"]["ids_missing"])
    result["good"] = not lost and all(m["good"] for m in result["metrics"].values())
    result["no_scatter"] = len(unculled) > 1 and all(m["spread"] == 0 for m in result["metrics"].values())
    return result


def summary(runs):
    times = [r.loop_time for r in runs]
    result = {"loop_times": times, "loop_time": statistics.median(times)}
    counted = [r.counts for r in runs if r.counts]
    if counted:
        for name in ("exterior", "interface", "interior"):
            result[name] = statistics.fmean(float(c[name].mean()) for c in counted)
        for name in ("culled", "restored", "carves", "seconds", "mass_error", "restore_energy"):
            result[name] = statistics.median(float(c[name][-1]) for c in counted)
    return result


def ledger(unculled, culled):
    """Granules, ids and mass that the culled runs miss at the end (the worst of them); None if a deck did not get there."""
    if unculled is None or any(c is None for c in culled):
        return None
    mass = float(unculled["mass"].sum())
    return {"granules": len(unculled),
            "lost": max((len(unculled) - len(c) for c in culled), key=abs),
            "ids_missing": max(len(np.setdiff1d(unculled["id"], c["id"])) for c in culled),
            "mass": mass,
            "mass_lost": max((mass - float(c["mass"].sum()) for c in culled), key=abs)}


def percent(part, whole):
    return f"{100 * part / abs(whole):.2f} %" if whole else f"{part:.3g}"


def table(result):
    """The result as text."""
    u, c, book = result["unculled"], result["culled"], result["ledger"]

    def times(s):
        span = f" ({min(s['loop_times']):.1f}-{max(s['loop_times']):.1f})" if len(s["loop_times"]) > 1 else ""
        return f"{s['loop_time']:.1f} s{span}"

    lines = []
    if book:
        lines.append(f"granules            {book['granules']:,}; lost {book['lost']:,}, ids missing {book['ids_missing']:,}, "
                     f"mass lost {book['mass_lost']:.3g} of {book['mass']:.4g} kg")
    else:
        lines.append("granules            not checked: a run did not reach the last line of the deck")
    if "exterior" in c:
        lines.append(f"mean while culled   exterior {c['exterior']:,.0f}, interface {c['interface']:,.0f}, "
                     f"interior {c['interior']:,.0f}")
    lines.append(f"loop time           unculled {times(u)}, culled {times(c)}: speed-up {result['speed_up']:.2f}")
    if "seconds" in c:
        share = percent(c["seconds"], c["loop_time"])
        lines.append(f"in the fix          {c['seconds']:.1f} s ({share} of the culled loop time); "
                     f"{c['carves']:,.0f} carves, {c['restored']:,.0f} restored")
    if result["metrics"]:
        width = max(12, *map(len, result["metrics"]))
        lines += ["", f"{'metric':{width}} {'unculled':>12} {'culled':>12} {'error':>10} {'worst run':>10} {'noise floor':>11} "
                      f"{'error/floor':>11} {'margin':>9}"]
        for name, m in result["metrics"].items():
            ratio = f"{m['of_spread']:.2f}" if m["of_spread"] is not None else "-"
            lines.append(f"{name:{width}} {m['mean']:12.6g} {m['culled_mean']:12.6g} {percent(m['error'], m['mean']):>10} "
                         f"{percent(m['worst'], m['mean']):>10} {percent(m['spread'], m['mean']):>11} {ratio:>11} "
                         f"{percent(m['margin'], m['mean']):>9} {'good' if m['good'] else 'OUTSIDE'}")
    if result["no_scatter"]:
        lines.append("the unculled runs are all alike: no granules were there to be moved apart; name a variable with --vary")
    return "\n".join(lines)


def plot(runs, metrics, file):
    """Each metric's column against the step, and the exterior granules of the culled runs."""
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    columns = list(dict.fromkeys(m.split(":")[0] for m in metrics))
    fig, axes = plt.subplots(len(columns) + 1, 1, sharex=True, squeeze=False, figsize=(8, 2.4 * (len(columns) + 1)))
    for ax, name in zip(axes[:, 0], columns):
        for kind, colour in (("unculled", "0.6"), ("culled", "tab:blue")):
            for k, run in enumerate(runs[kind]):
                ax.plot(*run.series(name), color=colour, lw=1, label=None if k else kind)
        ax.set_ylabel(name)
    axes[0, 0].legend()
    for run in runs["culled"]:
        if run.counts:
            axes[-1, 0].plot(run.counts["step"], run.counts["exterior"], color="tab:orange", lw=1)
    axes[-1, 0].set(ylabel="exterior granules", xlabel="step")
    fig.tight_layout()
    fig.savefig(file, dpi=120)
    plt.close(fig)


# --- the command ----------------------------------------------------------------------------------------------------

def assignment(text):
    name, equals, value = text.partition("=")
    if not (name and equals and value):
        raise argparse.ArgumentTypeError(f"`{text}` is not NAME=VALUE")
    return name, value


def main(argv=None):
    p = argparse.ArgumentParser(prog="twin.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("deck")
    p.add_argument("--metrics", default="", help="thermo columns, comma-separated: c_height,ke:max,f_wall[3]:mean")
    p.add_argument("--launcher", help="default: build/liggghts-solidcull, else liggghts-solidcull on the PATH")
    p.add_argument("--out", help="folder for logs and results (default: DECK.twin)")
    p.add_argument("--unculled", type=int, default=3, metavar="N", help="unculled runs (default 3)")
    p.add_argument("--culled", type=int, default=1, metavar="N", help="culled runs (default 1)")
    p.add_argument("--vary", type=assignment, metavar="VAR=V1,V2,V3",
                   help="a variable of the deck and its value in each run, in place of moving all granules by 1e-5 d")
    p.add_argument("--var", type=assignment, action="append", default=[], metavar="VAR=VALUE", help="for every run")
    p.add_argument("--ranks", type=int, default=1, metavar="N", help="MPI ranks of each run (default 1)")
    p.add_argument("--margin", type=float, default=0.02, help="relative margin of each metric (default 0.02)")
    p.add_argument("--plot", action="store_true", help="also draw the columns against the step")
    a = p.parse_args(argv)
    metrics = [m.strip() for m in a.metrics.split(",") if m.strip()]
    if a.unculled < 1 or a.unculled > len(SEEDS) or a.culled < 1 or a.culled > len(SEEDS):
        p.error(f"--unculled and --culled take 1 to {len(SEEDS)}")
    try:
        out = Path(a.out or a.deck + ".twin").resolve()
        result, runs = compare(a.deck, metrics, a.launcher, out, a.unculled, a.culled,
                               a.vary and (a.vary[0], a.vary[1].split(",")), dict(a.var), a.ranks, a.margin,
                               say=lambda line: print(line, file=sys.stderr))
        (out / "twin.json").write_text(json.dumps(result, indent=1) + "\n")
        if a.plot:
            plot(runs, metrics, out / "twin.png")
    except TwinError as e:
        print(f"twin: {e}", file=sys.stderr)
        return 2
    print(table(result))
    return 0 if result["good"] else 1


if __name__ == "__main__":
    sys.exit(main())
