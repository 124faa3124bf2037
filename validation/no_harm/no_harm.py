#!/usr/bin/python3
"""What the line costs where little or nothing rests: the validation cases in which culling cannot pay, with and without it.

    validation/no_harm/no_harm.py [scene ...] [--granules N ...] [--exterior sleep|live ...] [--pairs N] [--strict] [--few-steps]

Runs each scene N times without the line and N times with it, from the same bed, the two of a pair side by side on one core. Prints user
time and instructions of the runs without it over those with it, and leaves all figures in out/SCENE-GRANULES-MODE.json. Exit: 0 all were run, 2 a run failed;
with --strict 1 when a scene is below the bar.
"""
import argparse
import json
import os
import re
import statistics
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))
from solidcull_runs import decks, errors, logs  # noqa: E402
from solidcull_runs.validation import case_runs  # noqa: E402
from solidcull_runs.validation.cases import Case, CASES  # noqa: E402
from solidcull_runs.engine import Process, find_launcher  # noqa: E402

OUT = HERE / "out"
BAR = 0.99  # user time without the line over that with it: no less
PAIRS, MOST_PAIRS = 7, 25
SIZES = (2000, 6000, 20000)
MODES = ("sleep", "live")
FEW = 300  # granules, with --few-steps

# scene: its case, the case's scene, and by number of granules what its size is (`quick` or `full` of the case) and differs from that
SCENES = {
    "drum": ("drum", "", {FEW: {"radius": 0.037, "length": 0.026, "fill": 300, "steps": 100}, 2000: {"radius": 0.07, "length": 0.048}}),
    "mixer": ("mixer", "", {FEW: {"radius": 0.03, "blade": 0.027, "blade_high": 0.015, "high": 0.12, "fill": 300, "steps": 100},
                            2000: {"radius": 0.052, "blade": 0.048, "blade_high": 0.025, "high": 0.2}}),
    "gas": ("gas", "", {FEW: {"L": 0.074, "steps": 200}, 2000: {"L": 0.139}}),
    "silo": ("silo", "slit of 30 mm", {FEW: {"L": 0.05, "W": 0.02, "high": 0.2, "pour": 0.1, "rest": 100, "steps": 100},
                                       2000: {"L": 0.1, "high": 0.25}}),
    "shake": ("shake", "2 g", {FEW: {"L": 0.03, "W": 0.03, "pour": 0.1, "rest": 100, "cycles": 0.1, "after": 100}, 2000: {"L": 0.072, "W": 0.072}}),
    "column": ("column_collapse", "a = 1", {FEW: {"L": 0.08, "W": 0.04, "high": 0.6, "pour": 0.1, "damp": 0.1, "free": 0.02, "steps": 200},
                                            2000: {"L": 0.157}, 6000: {"L": 0.272}}),
    "switch": ("gravity_switch", "", {FEW: {"L": 0.03, "W": 0.03, "pour": 0.1, "rest": 100, "without": 100, "after": 100},
                                      2000: {"L": 0.072, "W": 0.072}}),
    "tilt": ("tilt", "", {FEW: {"L": 0.05, "W": 0.02, "pour": 0.1, "relax": 50, "steps": 100}, 2000: {"L": 0.16, "W": 0.025}}),
}


def case_of(scene, granules):
    """The scene as a case with this many granules."""
    name, of_case, by_size = SCENES[scene]
    case = Case(CASES / name, "full" if granules == 20000 else "quick")
    case.sized |= {"granules": granules, **({"bed_granules": granules} if "bed_granules" in case.sized else {}), **by_size.get(granules, {})}
    own = by_size.get(granules, {})
    case.scenes = {of_case: {k: v for k, v in case.scenes[of_case].items() if k not in own}}
    return case


def deck_of(case, culled, keywords):
    """The case's deck, culled or not, as text; at its end it prints how many granules there are, and how many came and went."""
    lines = decks.read_deck(case.deck)
    fix = decks.cull_fix(lines, case.deck.name)
    made = decks.make_deck(lines, fix, culled, None, "-")
    made = made[:made.index(f'print "{logs.TO_HERE}"')]
    made = [line for line in made if "twin_counts" not in line]
    made.append('print "no harm, atoms: $(atoms)"')
    if culled:
        made.append(f'print "no harm, culled, restored: $(f_{fix}[6]) $(f_{fix}[7])"')
    text = "\n".join(made) + "\n"
    return decks.with_keywords(text, keywords) if culled and keywords else text


class Runs:
    """A scene's runs, with and without the line."""

    def __init__(self, scene, granules, mode, keywords, out):
        self.name = f"{scene}-{granules}-{mode}"
        self.case, self.out = case_of(scene, granules), out
        (key,) = self.case.scenes
        bed = case_runs.make_beds([self.case], out, 1, lambda line: print(f"  {line}", flush=True))[self.case.name, key]
        self.variables = {**self.case.variables(key), **case_runs.files_of(self.case, key, out), **({"restart": bed} if bed else {})}
        self.keywords = f"exterior {mode} {keywords or ''}".strip()

    def start(self, culled, core):
        base = self.out / f"{self.name}.{'culled' if culled else 'unculled'}"
        deck, log, counted = (base.with_suffix(f"{base.suffix}.{kind}") for kind in ("in", "log", "perf"))
        deck.write_text(deck_of(self.case, culled, self.keywords))
        counted.unlink(missing_ok=True)
        return Process(find_launcher(), deck, self.case.deck.parent, log, self.variables, count=counted, core=core)

    def pair(self, core):
        """Figures of a run without and one with the line, side by side on one core: what else the machine does meets both alike."""
        processes = [self.start(culled, core) for culled in (False, True)]
        texts = [process.wait() for process in processes]
        figures = [{"user": p.user, **p.counted()} for p in processes]
        due, atoms = (float(re.search(r"^no harm, atoms: (\S+)$", text, re.M)[1]) for text in texts)
        culled, restored = map(float, re.search(r"^no harm, culled, restored: (\S+) (\S+)$", texts[1], re.M).groups())
        if atoms != due:  # between runs a deck sees stored granules as atoms
            raise errors.RunError(f"{self.name}: ended with {atoms:.0f} granules, without the line with {due:.0f}")
        figures[1] |= {"culled": culled, "restored": restored}
        return figures


def ratio(pairs, what):
    """Median over the pairs of the figure without the line over that with it."""
    return statistics.median(without[what] / max(with_it[what], 1e-9) for without, with_it in pairs)


def judge(runs, pairs):
    core = max(os.sched_getaffinity(0))
    made = [runs.pair(core) for _ in range(pairs)]
    granules = int(runs.variables["granules"])
    result = {"name": runs.name, "granules": granules, "fix": runs.keywords, "pairs": made,
              "user": ratio(made, "user"), "least": min(a["user"] / b["user"] for a, b in made), "most": max(a["user"] / b["user"] for a, b in made)}
    for what in ("instructions", "cycles"):
        if what in made[0][0]:
            result[what] = ratio(made, what)
    result["culled"], result["restored"] = (statistics.median(b[what] for _, b in made) / granules for what in ("culled", "restored"))
    return result


def row(result):
    counted = " ".join(f"{result[what]:8.4f}" if what in result else f"{'-':>8}" for what in ("instructions", "cycles"))
    return (f"{result['name']:22} {result['user']:7.3f} {result['least']:7.3f} {result['most']:7.3f} {counted} {result['culled']:8.2f} {result['restored']:8.2f}"
            f" {'' if result['user'] >= BAR else 'BELOW'}").rstrip()


HEADER = (f"{'':22} {'user time without the line':>23} {'counts, likewise':>17} {'of each granule':>17}\n"
          f"{'scene':22} {'over with':>7} {'least':>5} {'most':>7} {'instr.':>8} {'cycles':>8} {'culled':>8} {'restored':>8}")


def main(argv=None):
    p = argparse.ArgumentParser(prog="no_harm.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("scene", nargs="*", choices=[*SCENES, []], help="default: all")
    p.add_argument("--granules", type=int, nargs="+", choices=SIZES, default=SIZES, metavar="N", help="2000, 6000, 20000 (default: all)")
    p.add_argument("--exterior", nargs="+", choices=MODES, default=MODES, help="the fix's modes (default: both)")
    p.add_argument("--pairs", type=int, default=PAIRS, metavar="N", help=f"runs without and with the line (default {PAIRS})")
    p.add_argument("--fix", metavar="KEYWORDS", help="more keywords of the line, in one word")
    p.add_argument("--strict", action="store_true", help="a scene below the bar counts")
    p.add_argument("--few-steps", action="store_true", help="every deck for a few steps, with few granules")
    a = p.parse_args(argv)
    if not 1 <= a.pairs <= MOST_PAIRS:
        p.error(f"--pairs takes 1 to {MOST_PAIRS}")
    sizes, pairs, out = ((FEW,), 1, OUT / "few") if a.few_steps else (a.granules, a.pairs, OUT)
    out.mkdir(parents=True, exist_ok=True)
    print(HEADER, flush=True)
    below = False
    for scene in a.scene or SCENES:
        for granules in sizes:
            for mode in a.exterior:
                result = judge(Runs(scene, granules, mode, a.fix, out), pairs)
                (out / f"{result['name']}.json").write_text(json.dumps(result, indent=1) + "\n")
                print(row(result), flush=True)
                below = below or result["user"] < BAR
    return 1 if a.strict and below else 0


if __name__ == "__main__":
    errors.command("no_harm", main)
