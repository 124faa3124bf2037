#!/usr/bin/python3
"""The analytic ladder: from two spheres to a silo, each rung with and without the line, and beside a closed form.

    validation/ladder/ladder.py [RUNG ...] [--few-steps] [--publish]

Rungs: impacts rolling column silo; all, unless some are named. Exit status: 0 all is as it must be, 1 it is not, 2 a run failed.
"""
import argparse
import json
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1]), str(HERE)]
import column  # noqa: E402
import impact_rung  # noqa: E402
import rolling  # noqa: E402
import silo  # noqa: E402
from solidcull_runs import errors  # noqa: E402
from solidcull_runs.validation import pages  # noqa: E402

RUNGS = {"impacts": impact_rung, "rolling": rolling, "column": column, "silo": silo}
HEAD = "[The page](README.md) says what each rung is. Made by `validation/ladder/ladder.py --publish`."
OUT, PAGE = HERE / "out", HERE / "RESULTS.md"


def main(argv=None):
    p = argparse.ArgumentParser(prog="ladder.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("rungs", nargs="*", metavar="RUNG", help=", ".join(RUNGS))
    p.add_argument("--few-steps", action="store_true", help="fewer blows, a short column and a small silo")
    p.add_argument("--publish", action="store_true", help="leave the tables in RESULTS.md; not with --few-steps, nor some rungs alone")
    settings = p.parse_args(argv)
    if settings.publish and (settings.few_steps or settings.rungs):
        p.error("--publish is of all rungs in full")
    for name in settings.rungs:
        if name not in RUNGS:
            raise errors.RunError(f"no rung {name}; there is: {' '.join(RUNGS)}")
    place = OUT / "few" if settings.few_steps else OUT
    place.mkdir(parents=True, exist_ok=True)
    page, wrong = pages.Page(), []
    page.heading(1, "ladder: as measured")
    page.text(HEAD)
    for name in settings.rungs or RUNGS:
        report = RUNGS[name].climb(place, settings.few_steps)
        (place / f"{name}.json").write_text(json.dumps(report, indent=1) + "\n")
        RUNGS[name].page(report, page)
        wrong += report["wrong"]
    print(page.markdown())
    if settings.publish:
        PAGE.write_text(page.markdown())
    for line in wrong:
        print(f"NOT AS IT MUST BE: {line}")
    return 1 if wrong else 0


if __name__ == "__main__":
    errors.command("ladder", main)
