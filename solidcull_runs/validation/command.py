"""validation/run.sh [--quick|--full|--production] [--decide|--no-decide] [--report-only|--few-steps] [--keep] [--publish] [--also KEYWORDS] [--ranks N] [--at-once N] [CASE ...]

Runs cases, unculled and culled, and writes the report. `--decide`, a part of `--full`: pairs of runs are added until each metric is
equivalent or outside, 30 at most. What was run before, with the same deck and the same fix, is not run again:
after a kill the same command goes on. `--keep` keeps results of cases with the sources: so a report may take several sittings, on
machines that know nothing of each other, and so may the pairs of a case. `--few-steps`: each deck once unculled and once culled, cut short; no report.
Exit: 0 the report is written and nothing is lost, 1 a granule is lost, 2 a case or run failed (one line each).
"""
import argparse
import json
import sys
import time
from pathlib import Path

from .. import engine, errors
from ..dumps import read_final
from ..errors import RunError
from ..twins import cores
from . import case_results, case_runs, cases, deciding, report, sequential, short_cases, slices
from .earlier import Earlier, EarlierRun
from .points import SLEEP, UNCULLED

HERE = engine.ROOT / "validation"
LEFT_EVERY = 300  # s between two results of a case that are left


def options(argv):
    p = argparse.ArgumentParser(prog="validation/run.sh", description="run time against error of all cases")
    p.add_argument("case", nargs="*", help=f"default: all ({', '.join(cases.names())})")
    size = p.add_mutually_exclusive_group()
    size.add_argument("--quick", action="store_const", dest="size", const="quick", help="about 6,000 granules a case (default)")
    size.add_argument("--full", action="store_const", dest="size", const="full", help="20,000 granules a case and more: hours")
    size.add_argument("--production", action="store_const", dest="size", const="production",
                      help="160,000 granules and more, of the cases that have this size, at the defaults: a day")
    how = p.add_mutually_exclusive_group()
    how.add_argument("--report-only", action="store_true", help="run nothing; write the report of the results that there are")
    how.add_argument("--few-steps", action="store_true", help="each deck for a few steps: that all of it still runs")
    p.add_argument("--decide", action=argparse.BooleanOptionalAction, default=None,
                   help=f"add pairs of runs, up to {sequential.LOOKS[-1]}, until each metric is equivalent or outside (default: with --full)")
    p.add_argument("--also", action="append", default=[], metavar="KEYWORDS", help="a point more: these keywords of the fix; may be repeated")
    p.add_argument("--ranks", type=int, default=1, metavar="N", help="of each run; on more than one, the defaults alone beside unculled runs")
    p.add_argument("--at-once", type=int, default=None, metavar="N", help="runs at the same time (default: one rank a core)")
    p.add_argument("--out", type=Path, default=HERE / "out", metavar="FOLDER", help="beds, logs and results")
    p.add_argument("--report", type=Path, default=None, metavar="FOLDER", help="default: validation/report/SIZE")
    p.add_argument("--keep", action="store_true", help="keep the results of each case with the sources, for reports of cases that were run elsewhere")
    p.add_argument("--kept", type=Path, default=HERE / "kept", metavar="FOLDER", help="where they are kept (default: validation/kept)")
    p.add_argument("--publish", action="store_true", help="keep the report with the sources: RESULTS.md and results.json in validation/, and the README's rows; of --production in validation/production/")
    p.set_defaults(size="quick")
    a = p.parse_args(argv)
    if a.publish and (a.few_steps or a.case or a.also or a.ranks != 1 or a.size not in report.PUBLISHED):
        p.error("--publish takes all cases, --full or --production, and neither --few-steps nor --also nor --ranks")
    if a.ranks < 1 or (a.few_steps and a.ranks != 1):
        p.error("--ranks takes 1 or more, and not with --few-steps")
    a.out = a.out.resolve()
    if a.decide is None:
        a.decide = a.size == "full"
    if a.at_once is None:
        a.at_once = max(1, cores() // a.ranks)
    if a.at_once < 1:
        p.error("--at-once takes 1 or more")
    return a


def say(line):
    print(line, flush=True)


def run_case(case, jobs, course, files, out, maker=None):
    """Runs it and leaves its results in these files; the lines of what failed. Runs of the last file's result are not made again.
    `maker`: of more runs, until its metrics are decided. Results are left on the way, too."""
    earlier = Earlier(case_results.read_result(files[-1]) if files[-1].exists() else None, jobs)
    done, of_step, left = {}, {}, time.monotonic()

    def leave():
        nonlocal left
        left = time.monotonic()
        result = case_results.result_of(case, done | of_step, bool(maker), earlier)
        for file in files:
            file.parent.mkdir(parents=True, exist_ok=True)
            part = file.with_suffix(".part")
            part.write_text(json.dumps(result) + "\n")
            part.rename(file)
        return result

    def leave_so_far():
        if len(done | of_step) >= len(earlier.runs):  # runs that were kept of pairs to come are not yet among those
            leave()

    def after(made):
        nonlocal of_step
        of_step = made
        if time.monotonic() - left > LEFT_EVERY:
            leave_so_far()

    try:
        while jobs:
            done |= case_runs.run_all(jobs, course, earlier, after)
            wanted = deciding.further(case, done) if maker else {}
            jobs = [job for scene, of_scene in wanted.items() for job in maker.jobs(scene, of_scene)]
            course.add(jobs)
    except KeyboardInterrupt:
        leave_so_far()
        raise
    result = leave()
    draw(case, done, out / case.name / "what_moves.png")
    return [f"{case.name}: {f['why']}" for f in result["failed"]]


def draw(case, done, file):
    """The picture of what moves, of the first unculled and the first culled run."""
    framed = {job.point.family: job for job, run in done.items() if job.frames and not isinstance(run, (str, EarlierRun))}
    if UNCULLED not in framed or SLEEP not in framed:
        return
    final = read_final(framed[UNCULLED].file(".final"))
    diameter = 2 * float(sorted(final["radius"])[len(final) // 2])
    axis, share, largest = case.get("picture", ("y", 0.5, float("inf")))
    slices.what_moves(framed[UNCULLED].file(".frames"), framed[SLEEP].file(".frames"), file, diameter, ("xyz".index(axis), share), largest)


def run(a):
    size = a.size + (f"-{a.ranks}-ranks" if a.ranks > 1 else "")
    out, kept = a.out / size, a.kept / size
    wanted = cases.load(a.case, a.size)
    failed = []
    if a.few_steps:
        for case in wanted:
            failed += short_cases.faults_of(case, a.out / "few", engine.find_launcher(), say)
        return told(failed)
    if not a.report_only:
        launcher = engine.find_launcher()
        fix = engine.hash_of_fix(launcher)
        beds = case_runs.make_beds(wanted, a.out / a.size, a.at_once * a.ranks, say)
        jobs = {}
        for case in wanted:
            try:
                jobs[case] = case_runs.jobs_of(case, out, beds, launcher, fix, a.also, a.ranks)
            except RunError as e:
                failed.append(str(e))
        course = case_runs.Course([job for of_case in jobs.values() for job in of_case], a.at_once, say)
        for case, of_case in jobs.items():
            try:
                maker = case_runs.Maker(case, out, beds, launcher, fix, a.ranks) if a.decide else None
                files = [case_results.results_file(out, case)] + [case_results.kept_file(kept, case)] * a.keep
                failed += run_case(case, of_case, course, files, out, maker)
            except RunError as e:
                failed.append(str(e))
                say(f"{case.name}: {e}")
    results = []
    for case in wanted if a.case else cases.load([], a.size):
        file = next((f for f in (case_results.results_file(out, case), case_results.kept_file(kept, case)) if f.exists()), None)
        if file:
            results.append(case_results.read_result(file))
        elif a.report_only:
            say(f"{case.name} has no results; run it first")
    folder = a.report or HERE / "report" / size
    folder.parent.mkdir(parents=True, exist_ok=True)
    page = report.write(results, folder, out, f"Made by `validation/run.sh --{a.size}{said(a)}{f' --ranks {a.ranks}' if a.ranks > 1 else ''}`.")
    say(f"report: {folder / 'README.md'} and {folder / 'report.html'}")
    if a.publish:
        report.publish(results, page, folder, HERE.parent, a.size)
    return told(failed) or int(any(r["lost"] for r in results))


def said(a):
    """The option of deciding, where it is not what the size says."""
    return "" if a.decide == (a.size == "full") else " --decide" if a.decide else " --no-decide"


def told(failed):
    """The exit status, after a line for each failure."""
    for line in failed:
        print(f"validate: {line}", file=sys.stderr)
    return 2 if failed else 0


def main(argv=None):
    return errors.status_of("validate", lambda: run(options(argv)), "stopped; the same command goes on from here")


if __name__ == "__main__":
    sys.exit(main())
