#!/usr/bin/python3
"""Tells a change of results from a change of rounding: three short runs of some scenes against an ensemble of runs.

    gate.py [--launcher PATH]                    same results, or which figures differ
    gate.py make --because "what changed"        the ensemble anew, after results were changed on purpose
    gate.py alarms                               how often the gate would be wrong, by counting

Exit: 0 same results, 1 they differ, 2 no verdict (one line says why). See README.md beside this file.
"""
import argparse
import datetime
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[1])]
import numpy as np  # noqa: E402

import ensemble  # noqa: E402
import figures  # noqa: E402
import records  # noqa: E402
import scenes  # noqa: E402
from solidcull_runs.engine import ROOT, find_launcher  # noqa: E402
from solidcull_runs.errors import RunError, command  # noqa: E402

KEPT = HERE / "ensemble.txt"
MEMBERS = 200
FIRST_JUDGED = 1001     # members that no ensemble has
JUDGED = 3
SHOWN = 8               # figures that are named where results differ


def say(line):
    print(line, flush=True)


def read_kept(file=KEPT):
    if not file.exists():
        raise RunError(f"{file} is not there: take it from the repository, or make it: gate.py make --because \"first one\"")
    kept = ensemble.of_text(file.read_text(), file)
    if kept.about["recipe"] != scenes.recipe():
        raise RunError(f"{file.name} was made of other decks or beds than those in {HERE.name}/: make it anew, "
                       "gate.py make --because \"which decks changed\"")
    return kept


def what_differs(kept, told, rows):
    """The figures that differ most, no more than two of a scene: lines."""
    far = kept.far(rows)
    middle = np.median(rows, axis=0)
    count, lines = {}, []
    for j in np.argsort(-np.abs(far)):
        scene, when, what, unit = told[j]
        count[scene] = count.get(scene, 0) + 1
        if count[scene] > 2 or len(lines) == SHOWN or abs(far[j]) < 1:
            continue
        unit = f" {unit}" if unit else ""
        lines.append(f"{scene}, {when}: {what} by {abs(far[j]):.2g} of its scatter "
                     f"({kept.mean[j]:.7g}{unit} was, {middle[j]:.7g}{unit} is)")
    return lines


def observe(launcher, members=range(FIRST_JUDGED, FIRST_JUDGED + JUDGED)):
    """What the gate sees of a build, as plain data: figures (but for their values), the values of each run, why a run stopped."""
    seen = {"recipe": scenes.recipe(), "figures": [], "rows": [], "stopped": None}
    for member in members:
        try:
            found = records.figures_of(launcher, member)
        except scenes.SceneStopped as e:
            return {**seen, "stopped": [e.scene, e.why]}
        seen["figures"] = [[f.scene, f.when, f.what, f.unit] for f in found]
        seen["rows"].append([f.value for f in found])
    return seen


def verdict(kept, seen):
    """Whether results are the same, and the lines that say so."""
    if seen["stopped"]:
        scene, why = seen["stopped"]
        return False, [f"differs: {scene} ran through when the ensemble was made, now {why}"]
    names = [" | ".join(f[:3]) for f in seen["figures"]]
    if names != kept.names:
        other = next((name for name in names if name not in set(kept.names)), None) or "some of the ensemble's are missing"
        return False, [f"differs: runs tell other figures than the ensemble: {other}"]
    rows = np.array(seen["rows"])
    out = kept.outside(rows)
    most = 3 * out.sum(0) >= 2 * len(out)
    count, components = np.count_nonzero(most), np.count_nonzero(most[:len(kept.low)])
    if not kept.differ(rows):
        return True, [f"same results: {len(names)} figures of {len(rows)} runs are within what {kept.about['runs']} runs "
                      f"that differ by rounding span ({count} outside, {ensemble.SEVERAL} would differ)"]
    return False, ([f"differs: {components} of {len(kept.low)} components and {count - components} of {len(names)} figures "
                    "are outside of what runs span that differ by rounding; most:"]
                   + [f"  {line}" for line in what_differs(kept, seen["figures"], rows)]
                   + ["If results were meant to change, validation judges them; then: gate.py make --because \"which law changed\""])


def granule(found):
    return np.array([figures.UNIT[f.unit] for f in found])


def recorded(args):
    if args.members < 4 * ensemble.SEVERAL:
        raise RunError(f"--members {args.members}: an ensemble needs {4 * ensemble.SEVERAL} runs at least, and 200 to be of use")
    return records.of_members(find_launcher(args.launcher), range(1, args.members + 1), args.records, say)


def alarms(args):
    found, rows = recorded(args)
    names, units = [f.name for f in found], [f.unit for f in found]
    say(f"{len(rows)} runs, each left out in turn: {100 * ensemble.left_out_one_by_one(names, units, granule(found), rows):.2g} % "
        "of runs alone are outside")
    alone, threes = ensemble.false_alarms(names, units, granule(found), rows)
    say(f"left out by eighths: {100 * alone:.2g} % of runs alone are outside, {100 * threes:.2g} % of three runs each are said to differ")
    return 0


def make(args):
    if not args.because:
        raise RunError("make needs --because \"which law, deck or figure changed\": the file says so to who reads it later")
    found, rows = recorded(args)
    names, units = [f.name for f in found], [f.unit for f in found]
    _, threes = ensemble.false_alarms(names, units, granule(found), rows)
    about = {"because": args.because, "made": datetime.date.today().isoformat(), "runs": len(rows), "recipe": scenes.recipe(),
             "false alarms of three runs": round(threes, 5)}
    made = ensemble.made_of(names, units, granule(found), rows, about)
    part = args.kept.with_suffix(".part")
    part.write_text(ensemble.text_of(made))
    part.rename(args.kept)
    say(f"{args.kept}: {len(names)} figures, {len(made.low)} components, {args.kept.stat().st_size // 1000} kB; "
        f"{100 * threes:.2g} % of three runs each would be said to differ")
    return 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="?", choices=("judge", "make", "alarms"), default="judge")
    parser.add_argument("--launcher", help="liggghts-solidcull; else that of SOLIDCULL_LAUNCHER, of build/, or on the PATH")
    parser.add_argument("--because", help="with make: which law, deck or figure changed; the file keeps it")
    parser.add_argument("--members", type=int, default=MEMBERS, help="runs of the ensemble")
    parser.add_argument("--records", type=Path, default=ROOT / "build" / "gate-records", help="where runs are kept, so that make goes on")
    parser.add_argument("--kept", type=Path, default=KEPT, help="the ensemble's file")
    args = parser.parse_args()
    if args.what != "judge":
        return {"make": make, "alarms": alarms}[args.what](args)
    kept = read_kept(args.kept)
    same, lines = verdict(kept, observe(find_launcher(args.launcher)))
    for line in lines:
        say(line)
    return 0 if same else 1


if __name__ == "__main__":
    command("gate", main)
