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


def page_of(reports):
    page = pages.Page()
    page.heading(1, "ladder: as measured")
    page.text(HEAD)
    for name, report in reports.items():
        RUNGS[name].page(report, page)
    return page.markdown()


def publish():
    """The tables of all rungs, as they were climbed last."""
    files = {name: OUT / f"{name}.json" for name in RUNGS}
    missing = [name for name, file in files.items() if not file.exists()]
    if missing:
        raise errors.RunError(f"nothing is published before all rungs were climbed in full; still to do: {' '.join(missing)}")
    made = PAGE.with_suffix(".part")
    made.write_text(page_of({name: json.loads(file.read_text()) for name, file in files.items()}))
    made.replace(PAGE)


def main(argv=None):
    p = argparse.ArgumentParser(prog="ladder.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("rungs", nargs="*", metavar="RUNG", help=", ".join(RUNGS))
    how = p.add_mutually_exclusive_group()
    how.add_argument("--few-steps", action="store_true", help="fewer blows, a short column and a small silo")
    how.add_argument("--publish", action="store_true", help="leave the tables of all rungs, as they were climbed last, in RESULTS.md")
    settings = p.parse_args(argv)
    for name in settings.rungs:
        if name not in RUNGS:
            raise errors.RunError(f"no rung {name}; there is: {' '.join(RUNGS)}")
    place = OUT / "few" if settings.few_steps else OUT
    place.mkdir(parents=True, exist_ok=True)
    reports = {}
    for name in settings.rungs or RUNGS:
        report = reports[name] = json.loads(json.dumps(RUNGS[name].climb(place, settings.few_steps)))
        (place / f"{name}.json").write_text(json.dumps(report, indent=1) + "\n")
        print(page_of({name: report}).partition(HEAD)[2].strip(), end="\n\n", flush=True)
    if settings.publish:
        publish()
    wrong = [line for report in reports.values() for line in report["wrong"]]
    for line in wrong:
        print(f"NOT AS IT MUST BE: {line}")
    return 1 if wrong else 0


if __name__ == "__main__":
    errors.command("ladder", main)
