#!/usr/bin/python3
"""Random small decks, each run by stock LIGGGHTS and with solid/cull.

    tests/fuzz/fuzz.py --seed S --count N [--ranks 1,2,4,8] [--between none|harmless|all] [--library some|all|none] [--clumps] [--keep DIR] [--shrink]

Deck k has the seed S + k. A deck that comes out wrong is printed in one line with its seed, and kept in DIR with its logs
(default: build/fuzz). `--shrink` looks for the smallest deck that fails the same way, and prints it. `--print` prints decks and runs
nothing. Exit: 0 none failed, 1 some did.
"""
import argparse
import collections
import os
import re
import shutil
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(HERE))
import grammar  # noqa: E402
import judge  # noqa: E402
from shrink import shrink  # noqa: E402

LAUNCHER = Path(os.environ.get("SOLIDCULL_LAUNCHER", ROOT / "build/liggghts-solidcull")).resolve()
STOCK = shutil.which("liggghts")


STOPS = ("crash", "hang", "refusal", "error", "message")  # what our run alone shows


def verdict_of(deck, place, looked_for=None):
    """Both runs of a deck, in two folders of `place`, and what is wrong with ours. Stock is not run where ours does not show the kind
    that is looked for."""
    mine = judge.run(deck, True, LAUNCHER, place / "culled")
    if looked_for in STOPS and not mine.status and not mine.late:
        return judge.Verdict("good", "ends well", mine.culled)
    stock = judge.run(deck, False, STOCK, place / "stock")
    verdict = judge.judge(deck, stock, mine)
    while verdict.kind == "check" and judge.says_so_restored(deck, verdict.text.split()[0], LAUNCHER, place / "restored"):
        del stock.checks[verdict.text.split()[0]]  # another bed than stock's, which the deck reads right
        verdict = judge.judge(deck, stock, mine)
    verdict.culled = mine.culled
    if verdict.kind in ("height", "weight", "count", "check") and chancy(deck, stock, verdict, place):
        return judge.Verdict("good", "within the scatter of stock", mine.culled)
    return verdict


def stock_again(deck, place):
    """What is wrong with stock, judged by stock."""
    return judge.judge(deck, judge.run(deck, False, STOCK, place / "stock"), judge.run(deck, False, STOCK, place / "again"))


def chancy(deck, stock, verdict, place):
    """Whether stock itself, on another number of ranks, differs from stock in the same way."""
    if verdict.kind == "check" and "exact" in verdict.text:
        return False
    again = judge.run(deck, False, STOCK, place / "again", ranks=1 + deck.ranks[0] % 2)
    return again.status == 0 and judge.judge(deck, stock, again).kind == verdict.kind


def signature(verdict):
    """What of a failure stays the same in a smaller deck."""
    return verdict.kind, re.sub(r"[-+]?\d[\d.e+-]*", "#", verdict.text)[:100] if verdict.kind in STOPS else ""


def shrunk(deck, verdict, place):
    wanted = signature(verdict)
    return shrink(deck, lambda smaller: signature(verdict_of(smaller, place, verdict.kind)) == wanted)


def show(deck):
    for f in range(len(deck.files)):
        print(f"# --- file {f}, {deck.ranks[f]} ranks, with solid/cull")
        print(deck.text(f, True), end="", flush=True)


def main(argv=None):
    p = argparse.ArgumentParser(prog="fuzz.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--seed", type=int, default=1)
    p.add_argument("--count", type=int, default=20)
    p.add_argument("--ranks", metavar="LIST", help="numbers of ranks to choose from (default 1 to 8, mostly 1 to 4)")
    p.add_argument("--between", choices=grammar.BETWEEN, default="all", help="commands between runs")
    p.add_argument("--plain", action="store_true", help="without streams, sums over contacts, other contact models and loops of short runs")
    p.add_argument("--library", choices=("some", "all", "none"), default="some", help="decks that go by the C library (default: one of five)")
    p.add_argument("--clumps", action="store_true", help="granules of several spheres in each deck")
    p.add_argument("--stock", action="store_true", help="stock in place of the culled run: what fails then is the fuzzer's own fault")
    p.add_argument("--keep", type=Path, default=ROOT / "build" / "fuzz", metavar="DIR", help="where decks that fail are left")
    p.add_argument("--keep-all", action="store_true", help="those that are right too")
    p.add_argument("--shrink", action="store_true")
    p.add_argument("--print", action="store_true", dest="show")
    options = p.parse_args(argv)
    ranks = [int(n) for n in options.ranks.split(",")] if options.ranks else None
    kinds, slept, began = collections.Counter(), 0, time.monotonic()
    for seed in range(options.seed, options.seed + options.count):
        deck = grammar.make(seed, options.between, ranks, not options.plain, {"some": None, "all": True, "none": False}[options.library],
                            options.clumps)
        if options.show:
            show(deck)
            continue
        place = options.keep / str(seed)
        verdict = stock_again(deck, place) if options.stock else verdict_of(deck, place)
        kinds[verdict.kind] += 1
        slept += verdict.culled > 0
        if verdict.kind == "unjudged":
            print(f"seed {seed}: unjudged: {verdict.text}", flush=True)
        if not verdict.fails() and not options.keep_all:
            shutil.rmtree(place, ignore_errors=True)
        if not verdict.fails():
            continue
        print(f"seed {seed}: {verdict.kind}: {verdict.text} (ranks {deck.ranks}, {', '.join(sorted(deck.traits)) or 'no traits'})", flush=True)
        if options.shrink:
            smallest = shrunk(deck, verdict, options.keep / f"{seed}-shrinking")
            again = verdict_of(smallest, options.keep / f"{seed}-smallest")
            shutil.rmtree(options.keep / f"{seed}-shrinking", ignore_errors=True)
            print(f"seed {seed}, the smallest deck: {again.kind}: {again.text}")
            show(smallest)
    print(f"{options.count} decks from seed {options.seed}: {', '.join(f'{n} {k}' for k, n in kinds.most_common())}; "
          f"{slept} culled something; {time.monotonic() - began:.0f} s")
    return 1 if any(judge.Verdict(k).fails() for k in kinds) else 0


if __name__ == "__main__":
    sys.exit(main())
