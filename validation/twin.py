#!/usr/bin/python3
"""One deck, with and without its `fix ... solid/cull` line, and the difference beside the deck's own scatter.

    validation/twin.py in.pile --metrics c_height,ke:max,f_wall[3]:mean

Runs the deck unculled (three times, all granules 1e-5 diameters apart: their scatter is the noise floor) and culled, and
prints a table: granules, loop times, and each metric's error beside the noise floor. A metric is a thermo column, with
`:end` (default), `:max`, `:min` or `:mean` over the rows printed after the fix line. A culled metric is good when it lies
within the margin, the larger of 2 % and the noise floor, of the unculled mean.

Every run works in the deck's own folder, so relative paths hold, and what the deck itself writes is written again by
each run (the last is a culled one). A deck that wants them apart uses the variable `twin`: every run is given its own
name in it (unculled-1, culled-1, ...).

Granules are moved apart as soon as there are any. Where none are there before a run behind the fix line, all runs go in parts until
some are. A deck with a seed or a start of its own may vary that instead: `--vary NAME=a,b,c` gives `variable NAME index ...` another
value in each unculled run; the first culled run has the first value. A line that has no meaning without the fix, as `delete_atoms
region` with the interface mesh, ends the comparison. Exit: 0 all good, 1 a metric outside its margin or a granule lost, 2 no result.

    validation/twin.py in.pile --halve --metrics c_height,ke:max

tells the error where a run without the line takes too long. It runs the deck culled, four times, and four times with half the limits
(`tolerance`, `speed`). Granules are moved apart as above, and limits vary by a fifth at most from run to run. The difference gives each
metric's error, and an interval for it. Exit: 0 it is told, 1 a granule lost, 2 no result.
"""
import argparse
import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from solidcull_runs import comparisons, decks, errors, halving, plots, tables, twins  # noqa: E402


def assignment(text):
    name, equals, value = text.partition("=")
    if not (name and equals and value):
        raise argparse.ArgumentTypeError(f"`{text}` is not NAME=VALUE")
    return name, value


def say(line):
    print(line, file=sys.stderr, flush=True)


def main(argv=None):
    p = argparse.ArgumentParser(prog="twin.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("deck")
    p.add_argument("--metrics", default="", help="thermo columns, comma-separated: c_height,ke:max,f_wall[3]:mean")
    p.add_argument("--launcher", help="default: build/liggghts-solidcull, else liggghts-solidcull on the PATH")
    p.add_argument("--out", help="folder for logs and results (default: DECK.twin)")
    p.add_argument("--halve", action="store_true", help="no unculled runs: culled ones beside those with half the limits")
    p.add_argument("--unculled", type=int, metavar="N", help="unculled runs (default 3)")
    p.add_argument("--culled", type=int, metavar="N", help=f"culled runs (default 1); with --halve also those with half the limits (default {halving.EACH})")
    p.add_argument("--vary", type=assignment, metavar="VAR=V1,V2,V3",
                   help="a variable of the deck and its value in each run, in place of moving all granules by 1e-5 d")
    p.add_argument("--var", type=assignment, action="append", default=[], metavar="VAR=VALUE", help="for every run")
    p.add_argument("--ranks", type=int, default=1, metavar="N", help="MPI ranks of each run (default 1)")
    p.add_argument("--at-once", type=int, default=1, metavar="N", help="runs at the same time (default 1)")
    p.add_argument("--margin", type=float, help=f"relative margin of each metric (default {comparisons.MARGIN})")
    p.add_argument("--plot", action="store_true", help="also draw the columns against the step")
    a = p.parse_args(argv)
    wanted = [m.strip() for m in a.metrics.split(",") if m.strip()]
    most, least = len(decks.SEEDS), 2 if a.halve else 1
    if a.halve and (a.unculled is not None or a.margin is not None):
        p.error("--halve runs nothing unculled and has no margin: leave --unculled and --margin out")
    unculled, culled = a.unculled if a.unculled is not None else 3, a.culled if a.culled is not None else halving.EACH if a.halve else 1
    if not (1 <= unculled <= most and least <= culled <= most and a.at_once >= 1):
        p.error(f"--unculled takes 1 to {most}, --culled {least} to {most}, --at-once 1 or more")
    out = Path(a.out or a.deck + ".twin").resolve()
    vary = a.vary and (a.vary[0], a.vary[1].split(","))
    if a.halve:
        result, runs = halving.compare(a.deck, wanted, a.launcher, out, culled, vary, dict(a.var), a.ranks, a.at_once, say=say)
        status, text = int(comparisons.is_lost(result["ledger"], unknown=False)), halving.table(result)
    else:
        result, runs = twins.compare(a.deck, wanted, a.launcher, out, unculled, culled, vary, dict(a.var), a.ranks,
                                     comparisons.MARGIN if a.margin is None else a.margin, at_once=a.at_once, say=say)
        status, text = int(not result["good"]), tables.explained(result)
    (out / "twin.json").write_text(json.dumps(result, indent=1) + "\n")
    if a.plot:
        plots.columns(runs, [m.split(":")[0] for m in wanted], out / "twin.png")
    print(text)
    return status


if __name__ == "__main__":
    errors.command("twin", main)
