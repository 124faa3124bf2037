"""The validation report's code: cases and their faults, statistics, fields, and a report of a small stored result.

data/validation_result.json is the result of `validation/run.sh --quick slow_impact`, with every eighth point of its curves.
"""
import collections
import contextlib
import importlib.util
import json
import math
import os
import re
import shutil
import stat
import statistics
import subprocess
import sys
import tempfile
import types
import unittest
import unittest.mock
from pathlib import Path

import numpy as np
from scipy import stats

ROOT = Path(__file__).resolve().parents[1]
sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT))
from solidcull_runs import logs  # noqa: E402
from solidcull_runs.validation.earlier import Earlier, EarlierRun  # noqa: E402
from solidcull_runs.validation import (case_results, case_runs, cases, command, deciding, fields, first_page, forecasts, kept_figures, pages,  # noqa: E402
                                       points, report, sequential, short_cases, verdicts)
from solidcull_runs.errors import RunError  # noqa: E402

STORED = ROOT / "tests" / "data" / "validation_result.json"
README = """# A case

**Claim.** It is
[the same](a.in).

**Reference.** Itself.

| metric | unit | margin | why |
| --- | --- | --- | --- |
| depth | m | 2 % | said so |
| angle | deg | 0.5 | a protractor's |
"""
CASE = """
deck, aside = "a.in", "aside"
quick = full = {"granules": 3}
curves = {"depth": "v_depth"}
def measure(run, v):
    return {"depth": run, "angle": 1}
"""


class Folder(unittest.TestCase):
    def setUp(self):
        self.folder = Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, self.folder)

    def refused(self, text, function, *args):
        with self.assertRaises(RunError) as caught:
            function(*args)
        self.assertIn(text, str(caught.exception))
        self.assertNotIn("\n", str(caught.exception))


class Cases(Folder):
    def case(self, readme=README, code=CASE, deck="fix cull all solid/cull\n"):
        folder = self.folder / "cases" / "mine"
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in (("README.md", readme), ("case.py", code), ("a.in", deck)):
            (folder / name).unlink(missing_ok=True)
            if text is not None:
                (folder / name).write_text(text)
        return cases.Case(folder, "quick")

    def test_what_a_folder_says(self):
        case = self.case()
        self.assertEqual((case.title, case.claim, case.reference), ("A case", "It is the same.", "Itself."))
        self.assertEqual([(m.name, m.unit, m.margin, m.relative) for m in case.metrics], [("depth", "m", 0.02, True), ("angle", "deg", 0.5, False)])
        self.assertEqual([m.allowed(-10) for m in case.metrics], [0.2, 0.5])
        self.assertEqual(case.measured(7, ""), {"depth": 7.0, "angle": 1.0})

    def test_what_a_folder_lacks(self):
        self.refused("case mine has no README.md", self.case, None)
        self.refused("case mine has no case.py", self.case, README, None)
        self.refused("there is no deck a.in", self.case, README, CASE, None)
        self.refused("has no paragraph '**Claim.**", self.case, README.replace("Claim", "Say"))
        self.refused("has no table '| metric | unit | margin | why |'", self.case, README.replace("| metric", "| figure"))
        self.refused("needs a metric, a unit, a margin (2 % or a number) and why", self.case, README.replace("0.5", "some"))
        self.refused("needs a metric, a unit, a margin (2 % or a number) and why", self.case, README.replace("said so", ""))
        self.refused("case.py has no 'measure'", self.case, README, CASE.replace("measure", "measures"))
        self.refused("case mine: case.py has none of quick, full, production", self.case, README, CASE.replace("quick = full = ", "size = "))
        self.case(README, CASE.replace("quick = ", ""))
        self.assertEqual([cases.load([], size, self.folder / "cases") == [] for size in cases.SIZES], [True, False, True])
        self.refused("case mine has no size quick; these have: none", cases.load, ["mine"], "quick", self.folder / "cases")
        self.refused("case.py cannot be read: NameError", self.case, README, CASE + "nothing\n")
        self.refused("curves of depths, which the README's table does not name", self.case, README, CASE.replace('{"depth": "v', '{"depths": "v'))
        self.refused("no case 'other'; there is: mine", cases.load, ["other"], "quick", self.folder / "cases")

    def test_wrong_metrics(self):
        for returned, said in (('{"depth": 1}', "gives no value for angle"), ('{"depth": run / 0, "angle": 1}', "ZeroDivisionError"),
                               ('{"depth": float("nan"), "angle": 1}', "has no number for depth")):
            with self.subTest(returned):
                case = self.case(code=CASE.replace('{"depth": run, "angle": 1}', returned))
                self.refused(said, case.measured, type("Run", (float,), {"name": "x"})(1), "")

    def test_every_case_of_the_project_can_be_read(self):
        there = cases.names()
        self.assertGreaterEqual(len(there), 1)
        for size in cases.SIZES:
            for case in cases.load([], size):
                with self.subTest(f"{case.name} {size}"):
                    self.assertGreater(case.granules(case.main_scene), 0)
                    self.assertTrue(case.get("aside"))
                    bed = case.bed(case.main_scene)
                    self.assertTrue(bed is None or bed[0].is_file(), bed)


class Points(Folder):
    def test_the_sweep(self):
        found = points.points()
        self.assertEqual(len({p.name for p in found}), len(found))
        self.assertEqual(points.runs_of(found[0]), 5)
        self.assertEqual({p.family for p in points.points(["depth 1"])}, set(points.FAMILIES))
        self.assertEqual([p.name for p in found if p.default], ["unculled", "sleep 3 0", "live 3 0"])

    def test_production_is_one_scene_at_the_defaults(self):
        case = cases.Case(cases.CASES / "slow_impact", cases.PRODUCTION)
        self.assertEqual((list(case.scenes), case.granules(case.main_scene)), (["4000 kg/m3 from 0.1 m"], 160001))
        jobs = case_runs.jobs_of(case, self.folder, {(case.name, case.main_scene): None}, "launcher", "fix")
        self.assertEqual({(job.point.family, job.k) for job in jobs}, {(family, k) for family in ("unculled", "sleep", "live") for k in range(5)})

    def test_on_more_ranks_the_defaults_alone_are_run(self):
        case = cases.load(["drum"], "quick")[0]
        beds = {(case.name, scene): None for scene in case.scenes}
        of_one, of_four = (case_runs.jobs_of(case, self.folder, beds, "launcher", "fix", [], ranks) for ranks in (1, 4))
        self.assertEqual({job.ranks for job in of_one}, {1})
        self.assertEqual({job.ranks for job in of_four}, {4})
        self.assertEqual({job.point.name for job in of_four}, {"unculled", "sleep 3 0", "live 3 0"})
        self.assertGreater(len(of_one), len(of_four))

    def test_frozen_by_hand(self):
        text = "read_restart a\nfix integrate all nve/sphere\nrun 5\n"
        made = case_runs.frozen_by_hand(text, "sphere 0 0 0 $R", "deck")
        self.assertEqual(made.splitlines()[1:-1], ["region by_hand sphere 0 0 0 $R units box", "group by_hand region by_hand",
                                                   "group frozen subtract all by_hand", "neigh_modify exclude group frozen frozen",
                                                   "velocity frozen set 0 0 0", "fix integrate by_hand nve/sphere"])
        with self.assertRaises(RunError):
            case_runs.frozen_by_hand("run 5\n", "sphere", "deck")

    def test_cut_short(self):
        self.assertEqual(short_cases.cut_short("run 500\nrun ${steps} upto\nrun 0\nrun_time 5\n", 40), "run 40\nrun 40\nrun 0\nrun_time 5\n")


Job = collections.namedtuple("Job", "scene point k")


class Ledger(unittest.TestCase):
    """Granules that a culled run misses."""

    def lost(self, *given, refilled=False):
        """Each: family, inserted, ids at the end. Ten granules are there at the start."""
        of_scene = {}
        for family, inserted, ids in ((points.UNCULLED, 5, range(15)), (points.UNCULLED, 3, range(13)), *given):
            run = types.SimpleNamespace(start=range(10), inserted=inserted, final=np.array([(i,) for i in ids], [("id", int)]))
            of_scene.setdefault(family, {"family": family, "runs": []})["runs"].append(case_results.granules_of(run))
        return case_results.lost({"scenes": {"": {"points": of_scene}}}, refilled)

    def test_what_was_put_in_counts(self):
        self.assertEqual(self.lost((points.SLEEP, 1, range(11))), 0, "fewer found room; none is lost")
        self.assertEqual(self.lost((points.SLEEP, 5, range(14))), 1)
        self.assertEqual(self.lost((points.SLEEP, 3, [*range(13), 12])), -1, "one is there twice")

    def test_what_leaves_unculled_runs_may_leave(self):
        self.assertEqual(self.lost((points.UNCULLED, 0, range(8)), (points.LIVE, 0, range(8))), 0)
        self.assertEqual(self.lost((points.UNCULLED, 0, range(8)), (points.LIVE, 0, range(7))), 1)
        self.assertEqual(self.lost((points.BY_HAND, 0, range(8)), (points.LIVE, 0, range(8))), 2, "what was frozen is no measure")

    def test_the_papers_scheme_is_told_apart(self):
        given = (points.SLEEP, 0, range(10)), (points.PAPER, 0, range(6))
        self.assertEqual((self.lost(*given), self.lost(*given, refilled=True)), (0, 4))

    def test_the_log_says_what_was_forecast_and_what_came(self):
        forecast = "fix cull solid/cull: if it goes on like this, the run will be about {} work than without it: 21 % of the granules are exterior"
        told = "  time          = 12.7 s, of it 4.31 s in the fix: about {} work than without it"
        loop = "Loop time of {} on 1 procs for 400 steps with 100 atoms, finish time"
        lines = [forecast.format("9 times less"), loop.format(7), logs.FROM_HERE, "  time          = 0.2 s, of it 0.1 s in the fix", loop.format(0.2),
                 forecast.format("2.6 times less"), told.format("2.4 times less"), loop.format(12.7),
                 "fix cull solid/cull: if it goes on like this, the run will be about as much work as without it: 90 % of", told.format("1.2 times more"),
                 loop.format("3e+02"), logs.TO_HERE, forecast.format("7 times less"), loop.format(5)]
        first, second, third = logs.loops("\n".join(lines) + "\n")
        self.assertEqual(first, {"seconds": 0.2, "forecast": None, "told": None})
        self.assertEqual(second, {"seconds": 12.7, "forecast": 2.6, "told": 2.4})
        self.assertEqual((third["seconds"], third["forecast"]), (300, 1))
        self.assertAlmostEqual(third["told"], 1 / 1.2)
        self.assertEqual(logs.loops("no line\n"), [])

    def test_the_log_says_what_was_put_in(self):
        line = "INFO: Particle insertion {}: inserted 2 particle templates (mass 1) at step 9\n - a total of {} particle templates (mass 2) inserted so far.\n"
        text = line.format("fill", 100) + f"{logs.FROM_HERE}\n" + line.format("fill", 103) + line.format("feed", 7) + line.format("feed", 9)
        self.assertEqual(logs.inserted(text), 3 + 9)
        self.assertEqual(logs.inserted("no line\n"), 0)


class Statistics(unittest.TestCase):
    def test_two_one_sided_tests(self):
        a, b = dict(enumerate([1.0, 1.1, 0.9, 1.05, 0.95])), dict(enumerate([1.02, 1.08, 0.99]))
        v = verdicts.two_one_sided_tests(a, b, 0.2)
        pairs = [0.02, -0.02, 0.09]
        self.assertAlmostEqual(v.difference, 0.03, 12)
        self.assertAlmostEqual(v.high - v.difference, 2.920 * statistics.stdev(pairs) / math.sqrt(3), 4)  # Student's t: 95 %, 2 degrees
        self.assertEqual(v.word, verdicts.SAME)
        self.assertEqual(verdicts.two_one_sided_tests(a, b, 0.05).word, verdicts.OPEN)
        self.assertEqual(verdicts.two_one_sided_tests(a, {k: x + 1 for k, x in b.items()}, 0.2).word, verdicts.OTHER)
        self.assertAlmostEqual(v.in_margins, 0.15, 12)

    def test_what_the_start_does_is_in_neither_run_of_a_pair(self):
        a = {0: 1.0, 1: 2.0, 2: 3.0}
        self.assertEqual(verdicts.two_one_sided_tests(a, {0: 1.01, 1: 2.02, 2: 3.01}, 0.1).word, verdicts.SAME)
        self.assertEqual(verdicts.two_one_sided_tests(a, {0: 2.01, 1: 3.02, 2: 1.01}, 0.1).word, verdicts.OPEN)

    def test_scatter_is_no_equivalence(self):
        """Runs that differ by nothing on average, but scatter by more than the margin, show nothing."""
        self.assertEqual(verdicts.two_one_sided_tests(dict(enumerate([0, 10, -10, 5, -5])), dict(enumerate([10, 0, -10])), 1).word, verdicts.OPEN)
        self.assertEqual(verdicts.two_one_sided_tests(dict(enumerate([0, 10, -10, 5, -5])), {0: 0}, 1).word, verdicts.OPEN)
        self.assertEqual(verdicts.two_one_sided_tests({0: 1, 1: 1}, {0: 1, 1: 1}, 0.1).word, verdicts.SAME)
        for a, b in (({0: 1}, {0: 1}), ({0: 1, 1: 2}, {5: 1})):
            with self.assertRaises(ValueError):
                verdicts.two_one_sided_tests(a, b, 1)

    def test_order(self):
        tolerances = [1, 3, 10, 30]
        self.assertAlmostEqual(verdicts.order(tolerances, [0.1 * t**0.7 for t in tolerances], 0.0), 0.7, 12)
        self.assertIsNone(verdicts.order(tolerances, [0.1, 0.1, 0.1, 0.5], 0.2))
        self.assertAlmostEqual(verdicts.order(tolerances, [0.1, 0.1, 1, 3], 0.2), 1, 12)


class Sequential(unittest.TestCase):
    """Pairs that are added until a metric is decided. The margin is 1."""

    RUNS = 4000
    PAIRS = sequential.LOOKS[-1]

    def pairs(self, data):
        """Differences of pairs, of mean 0 and standard deviation 1."""
        random = np.random.default_rng(11)
        size = (self.RUNS, self.PAIRS)
        return {"normal": lambda: random.standard_normal(size),
                "of runs as skewed as an exponential": lambda: (random.exponential(1, size) - random.exponential(1, size)) / math.sqrt(2),
                "of runs as skewed as a lognormal": lambda: (random.lognormal(0, 1, size) - random.lognormal(0, 1, size)) / math.sqrt(2 * (math.e - 1) * math.e),
                "skewed": lambda: (random.gamma(4, 1, size) - 4) / 2,
                "skewed the other way": lambda: (4 - random.gamma(4, 1, size)) / 2,
                "as skewed as an exponential": lambda: random.exponential(1, size) - 1}[data]()

    def words(self, differences, quantile=sequential.quantile):
        """Shares of SAME and OTHER, and the mean number of pairs, of many cases at once: as verdicts.in_looks() judges each."""
        looks = np.array(sequential.LOOKS)
        mean = differences.cumsum(1)[:, looks - 1] / looks
        square = (differences**2).cumsum(1)[:, looks - 1] / looks
        half = np.array([quantile(n) for n in sequential.LOOKS]) * np.sqrt(np.maximum(square - mean**2, 0) / (looks - 1))
        same, other = (np.abs(mean) + half < 1), (np.abs(mean) - half > 1)
        ended = same | other
        at = np.where(ended.any(1), ended.argmax(1), len(looks) - 1)
        each = np.arange(len(at))
        return same[each, at].mean(), other[each, at].mean(), looks[at].mean()

    def test_many_at_once_are_judged_as_one(self):
        differences = 0.4 + 0.8 * self.pairs("skewed")[:150]
        words = [verdicts.in_looks(dict.fromkeys(range(30), 0.0), dict(enumerate(d)), lambda mean: 1.0) for d in differences]
        same, other, pairs = self.words(differences)
        self.assertAlmostEqual(statistics.fmean(v.word == verdicts.SAME for v in words), same, 12)
        self.assertAlmostEqual(statistics.fmean(v.word == verdicts.OTHER for v in words), other, 12)
        self.assertAlmostEqual(statistics.fmean(v.pairs for v in words), pairs, 12)
        self.assertEqual({v.word for v in words}, {verdicts.SAME, verdicts.OPEN})

    def test_at_the_margins_edge_neither_word_is_said_by_chance(self):
        """A difference of just the margin is neither smaller nor larger."""
        for data in ("normal", "of runs as skewed as an exponential", "of runs as skewed as a lognormal", "skewed", "skewed the other way"):
            for scatter in (0.1, 0.5, 1, 3):
                same, other, _ = self.words(1 + scatter * self.pairs(data))
                with self.subTest(data=data, scatter=scatter):
                    self.assertLessEqual(same, verdicts.LEVEL)
                    self.assertLessEqual(other, verdicts.LEVEL)

    def test_where_it_ends(self):
        """Differences of pairs as skewed as an exponential are more than it can bear; such as of no metric so far."""
        same, _, _ = self.words(1 + 0.5 * self.pairs("as skewed as an exponential"))
        self.assertTrue(verdicts.LEVEL < same < 2 * verdicts.LEVEL, same)

    def test_one_look_after_the_other_without_this_errs_more(self):
        def of_one_look(n):
            return float(stats.t.isf(verdicts.LEVEL, n - 1))
        self.assertGreater(self.words(1 + 0.5 * self.pairs("normal"), of_one_look)[0], 2 * verdicts.LEVEL)

    def test_the_intervals_of_all_looks_together(self):
        """They miss the mean, on one side, as often as is spent: of normal data, but for what Student's t adds."""
        looks = np.array(sequential.LOOKS)
        differences = self.pairs("normal")
        mean, square = (x.cumsum(1)[:, looks - 1] / looks for x in (differences, differences**2))
        half = np.array([sequential.quantile(n) for n in sequential.LOOKS]) * np.sqrt((square - mean**2) / (looks - 1))
        missed = (mean - half > 0).any(1).mean()
        self.assertAlmostEqual(missed, sequential.SPENT, delta=0.006)  # 3.4 standard deviations of 4,000 trials
        self.assertEqual(sorted(sequential.levels()), list(sequential.levels()))
        self.assertEqual([sequential.next_look(n) for n in (0, 4, 5, 6, 29, 30, 31)], [5, 5, 8, 8, 30, None, None])

    def test_how_many_pairs_it_takes(self):
        for difference, scatter, most, decided in ((0, 0.05, 5.1, 1), (0, 0.2, 7.6, 1), (0, 0.5, 11.5, 1), (0, 1, 20, 0.98), (0.5, 0.5, 16.5, 0.99), (2, 0.5, 11.5, 1), (3, 1, 11.5, 1)):
            same, other, pairs = self.words(difference + scatter * self.pairs("normal"))
            with self.subTest(difference=difference, scatter=scatter):
                self.assertLess(pairs, most)
                self.assertGreaterEqual(same + other, decided)

    def test_a_verdict_stays_that_of_the_look_that_decided(self):
        unculled = dict.fromkeys(range(30), 100.0)
        culled = {k: 100.01 + 0.001 * (k % 2) if k < 5 else 150.0 for k in range(30)}
        v = verdicts.in_looks(unculled, culled, lambda mean: 0.02 * mean)
        self.assertEqual((v.word, v.pairs, v.margin), (verdicts.SAME, 5, 2.0))
        v = verdicts.in_looks(unculled, {k: culled[k] for k in range(4)}, lambda mean: 2.0)
        self.assertEqual((v.word, v.pairs), (verdicts.OPEN, 4))
        missing = {k: x for k, x in culled.items() if k != 1}
        self.assertEqual(verdicts.in_looks(unculled, {k: missing[k] for k in sorted(missing)[:4]}, lambda mean: 2.0).pairs, 4, "a run that failed")
        self.assertRaises(ValueError, verdicts.in_looks, {0: 1.0, 1: 2.0}, {1: 1.0}, abs)


class OverScenes(unittest.TestCase):
    """What no scene of a case has decided alone."""

    METRIC = {"name": "lift", "unit": "N", "margin": 0.1, "relative": True}

    def result(self, *differences):
        """A scene for each list of what `sleep` is off by, of unculled 10 N in the first one, 20 N in the second."""
        def entry(family, values):
            runs = [{"k": k, "values": {"lift": x}, "seconds": 1.0, "counts": {}} for k, x in enumerate(values)]
            return {"family": family, "absolute": 3.0, "share": 0.0, "default": True, "runs": runs}
        scenes = {f"{k}": {"points": {"unculled": entry("unculled", [10.0 * (k + 1)] * len(off)),
                                      "sleep 3 0": entry("sleep", [10.0 * (k + 1) + x for x in off])}} for k, off in enumerate(differences)}
        return {"case": "blade", "decided": True, "metrics": [self.METRIC], "scenes": scenes}

    def test_the_mean_of_all_in_their_own_margins(self):
        one, other = [3.0, -2.4] * 15, [2.0, -4.4] * 15
        result = self.result(one, other)
        words = [verdicts.default_of(verdicts.judge(result, scene), "sleep").verdicts["lift"].word for scene in result["scenes"].values()]
        self.assertEqual(words, [verdicts.OPEN, verdicts.OPEN])
        v = verdicts.over_scenes(result, self.METRIC, "sleep")
        self.assertAlmostEqual(v.difference, (0.3 - 0.6) / 2, 12)
        half = sequential.quantile(30) * math.sqrt((statistics.variance(one) + statistics.variance(other) / 4) / 30) / 2
        self.assertAlmostEqual(v.high - v.low, 2 * half, 12)
        self.assertEqual(v.word, verdicts.SAME)
        self.assertEqual(report.over_scenes(result), [["lift", "`sleep`", f"{v.low:+.2f} to {v.high:+.2f}", "equivalent"]])

    def test_not_where_one_is_outside_or_all_are_decided(self):
        scattered, off, near = [3.0, -2.4] * 15, [5.0, 5.1] * 15, [0.1, -0.1] * 15
        self.assertEqual(report.over_scenes(self.result(scattered, off)), [])
        self.assertEqual(report.over_scenes(self.result(near, near)), [])
        self.assertEqual(report.over_scenes(self.result(scattered)), [])

    def test_not_before_the_last_look(self):
        self.assertEqual(report.over_scenes(self.result([3.0, -2.4] * 14, [3.0, -2.4] * 15)), [])

    def test_of_few_pairs_there_is_none(self):
        self.assertIsNone(verdicts.over_scenes(self.result([3.0, -2.4] * 15, [1.0, -1.0] * 2), self.METRIC, "sleep"))
        self.assertIsNone(verdicts.over_scenes(self.result([3.0, -2.4] * 15), self.METRIC, "live"))


class KeptPage:
    """What is kept of the script validation/NAME/NAME.py: values, and a page that is made of them."""

    @classmethod
    def setUpClass(cls):
        cls.folder = ROOT / "validation" / cls.NAME
        spec = importlib.util.spec_from_file_location(f"validation_{cls.NAME}", cls.folder / f"{cls.NAME}.py")
        cls.script = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(cls.script)
        cls.records = json.loads((cls.folder / "results.json").read_text())

    def test_the_page_is_made_of_the_values(self):
        text = (self.folder / "RESULTS.md").read_text()
        self.assertEqual(pages.between_marks(self.folder / "RESULTS.md", self.script.BEGIN, self.script.text_of(self.records)), text)


class Audit(KeptPage, unittest.TestCase):
    """As it claims; and the truth, of granules that are put in by hand."""

    NAME = "audit"

    def test_what_is_missed_is_held(self):
        """In at least four scenes that it was not made for."""
        found = self.script.compared(self.records, self.script.HELD_OUT)
        self.assertGreaterEqual(len({c.record["scene"] for c in found}), 4)
        self.assertGreaterEqual(len(found), 12)
        self.assertGreaterEqual(sum(c.held for c in found), self.script.LEAST_HELD * len(found))
        self.assertLess(statistics.median(c.width for c in found), self.script.WIDEST)

    def test_what_is_missed_is_not_always_held(self):
        """The comparison can fail."""
        record = {"scene": "impact", "figure": "load", "patches": 9, "steps": 96, "missed": [0.05, 0.051, 0.049], "low": 0.001, "high": 0.01}
        c = self.script.Compared(record)
        self.assertTrue(c.resolved)
        self.assertFalse(c.held)
        self.assertTrue(self.script.Compared(record | {"high": 0.06}).held)
        self.assertTrue(self.script.Compared(record | {"missed": [0.05, -0.05, 0.01]}).held, "nothing is known to be missed")

    def granules(self, asleep, places):
        kinds = [(c, float) for c in ("id", "mass", "radius", "x", "y", "z", "vx", "vy", "vz", "f_cull")]
        return np.array([(n + 1, 2.0, 0.5, x, 0, 0, 0, 0, 0, float(asleep[n])) for n, x in enumerate(places)], kinds)

    def test_the_truth_is_what_a_woken_bed_does_more(self):
        """A row of six that touch, the last one awake; what is near it counts more."""
        asleep, places = [1, 1, 1, 1, 1, 0], np.arange(6) * 0.99
        then = self.granules(asleep, places)
        left, woken = then.copy(), then.copy()
        woken["x"][4] += 0.006
        woken["vx"][4] = 0.1
        told = self.script.missing(then, left, woken)
        within = 4  # of five sleepers, those nearer than 3.5 diameters to the only one beside what is awake
        self.assertAlmostEqual(told["displacement"], 0.006 / within)
        self.assertAlmostEqual(told["kinetic energy"], 0.5 * 2.0 * 0.1**2 / within)
        force = 0.5 * 0.01**1.5  # but for the modulus
        # the contact with the one before it opens from an overlap of 0.01 to 0.004; 2, 3 and 4 are deep, and pressed from both sides
        self.assertAlmostEqual(told["load"], (force - 0.5 * 0.004**1.5) / (3 * 2 * force))
        left["x"][4] += 0.006
        left["vx"][4] = 0.1
        for figure, missed in self.script.missing(then, left, woken).items():
            self.assertAlmostEqual(missed, 0, msg=figure)
        self.assertIsNone(self.script.missing(self.granules([0] * 6, places), left, woken), "nothing sleeps")


class Halving(KeptPage, unittest.TestCase):
    """As it claims."""

    NAME = "halving"

    def test_true_errors_are_held(self):
        """In at least four scenes that it was not made for."""
        found = self.script.compared(self.records, self.script.HELD_OUT)
        self.assertGreaterEqual(len({c.scene for c in found}), 4)
        self.assertGreaterEqual(len(found), 12)
        held, _, _ = self.script.as_claimed(found)
        self.assertGreaterEqual(held, self.script.LEAST_HELD * len(found))
        self.assertLess(statistics.median(c.width for c in found), self.script.WIDEST)

    def test_an_error_that_half_the_limits_leave_is_not_held(self):
        """The comparison can fail."""
        record = {"scene": "impact", "metric": "m", "unculled": [0.0, 0.1, -0.1], "varied": [9.0, 9.1, 8.9], "halved": [9.0, 9.1, 8.9]}
        c = self.script.Compared(record)
        self.assertFalse(c.held)
        self.assertEqual(self.script.as_claimed([c] * 4), (0, 4, False))
        wide = self.script.Compared({**record, "varied": [1.0, 1.1, 0.9], "halved": [-9.0, -9.1, -8.9]})
        self.assertTrue(wide.held and wide.width > self.script.WIDEST)
        self.assertFalse(self.script.as_claimed([wide])[2])


class Deciding(unittest.TestCase):
    """Which runs a case still lacks."""

    DEFAULTS = {p.family: p for p in points.points() if p.default}

    def further(self, values, failed=()):
        """`values`: by family, of the one metric in each run."""
        Job = collections.namedtuple("Job", "scene point k")
        done = {Job("a", self.DEFAULTS[family], k): "killed" if (family, k) in failed else types.SimpleNamespace(metrics={"depth": x})
                for family, of_family in values.items() for k, x in enumerate(of_family)}
        case = types.SimpleNamespace(scenes={"a": {}}, metrics=[cases.Metric("depth", "m", 0.02, True, "")])
        return {scene: [(p.family, k) for p, k in wanted] for scene, wanted in deciding.further(case, done).items()}

    def test_pairs_are_added_where_one_is_not_decided(self):
        near, far = [1.0, 1.0001, 0.9999, 1.0, 1.0001], [1.0, 1.03, 0.96, 1.04, 1.01]
        self.assertEqual(self.further({"unculled": near, "sleep": near, "live": near}), {})
        self.assertEqual(self.further({"unculled": near, "sleep": near, "live": far}),
                         {"a": [(family, k) for k in (5, 6, 7) for family in ("unculled", "live")]})
        self.assertEqual(self.further({"unculled": near, "sleep": far, "live": far})["a"],
                         [(family, k) for k in (5, 6, 7) for family in ("unculled", "sleep", "live")])

    def test_up_to_the_first_look_where_there_are_fewer(self):
        self.assertEqual(self.further({"unculled": [1.0, 1.0, 1.0], "sleep": [1.0, 1.0, 1.0]})["a"], [(family, k) for k in (3, 4) for family in ("unculled", "sleep")])

    def test_thirty_at_most(self):
        far = [1.0, 1.05] * 15
        self.assertEqual(self.further({"unculled": far, "sleep": far[::-1]}), {})

    def test_what_was_not_run_is_not_asked_for(self):
        self.assertEqual(self.further({"unculled": [1.0] * 5}), {})

    def test_runs_that_failed_are_not_made_again(self):
        far = [1.0, 1.03, 0.96, 1.04, 1.01]
        self.assertEqual(self.further({"unculled": [1.0] * 5, "sleep": far}, {("sleep", 4)})["a"], [(family, k) for k in (5, 6, 7) for family in ("unculled", "sleep")])

    def test_thirty_starts(self):
        self.assertEqual(len(set(case_runs.ASIDE)), sequential.LOOKS[-1])
        self.assertLess(max(map(abs, case_runs.ASIDE)), 1.6e-4)

    def test_it_is_a_part_of_full(self):
        for words, decide in (([], False), (["--full"], True), (["--decide"], True), (["--full", "--no-decide"], False)):
            self.assertEqual(command.options(words).decide, decide, words)


class Fields(unittest.TestCase):
    def bed(self, shift=0.0, n=400):
        rng = np.random.default_rng(3)
        g = np.zeros(n, [(c, float) for c in case_runs.COLUMNS])
        for c in "xyz":
            g[c] = rng.uniform(0, 0.03, n)
        g["x"] += shift
        g["radius"], g["vx"] = 1e-3, 0.2
        g["mass"] = 2500 * 4 / 3 * np.pi * 1e-9
        g["c_twin_stress[3]"] = -2e-6
        return g

    def test_sums_are_kept(self):
        g, width = self.bed(), 3e-3
        solid, velocity, stress = fields.fields(g, np.full(3, -0.02), np.full(3, 0.05), width)
        cell = width**3
        self.assertAlmostEqual(solid.sum() * cell / (400 * 4 / 3 * np.pi * 1e-9), 1, 6)
        self.assertAlmostEqual(velocity[0].sum() / solid.sum(), 0.2, 9)
        self.assertAlmostEqual(stress[2].sum() * cell / (400 * 2e-6), 1, 6)

    def test_distance(self):
        same = fields.distances([self.bed()], [self.bed(), self.bed()])
        self.assertEqual([d["error"] for d in same.values()], [0, 0, 0])
        apart = fields.distances([self.bed(0.01)], [self.bed(), self.bed()])
        self.assertGreater(apart["solid fraction"]["error"], 0.3)
        self.assertEqual(apart["solid fraction"]["noise"], 0)


class Report(Folder):
    def stored(self):
        return case_results.read_result(STORED)

    def test_of_a_stored_result(self):
        result = self.stored()
        folder = self.folder / "report"
        report.write([result], folder, None, "From a test.")
        text, page = (folder / "README.md").read_text(), (folder / "report.html").read_text()
        judged = verdicts.judge(result)
        sleep = judged["sleep 3 0"]
        self.assertIn(f"| {sleep.speed_up:.2f} | {sleep.error:.2f} ({sleep.worst}) | {sleep.word} |", text)
        for part in ("Slow impact craters", "frozen by hand", "depth ~ density^p", "solid fraction", "error ~ tolerance^p"):
            self.assertIn(part, text)
        for picture in ("all.png", "slow_impact-curves.png", "slow_impact-error.png"):
            self.assertIn(f"]({picture})", text)
            self.assertGreater((folder / picture).stat().st_size, 5000, picture)
        self.assertEqual(page.count("data:image/png;base64,"), 3)
        self.assertNotIn("src=\"slow", page)
        self.assertIn('<a href="#slow-impact-craters">slow_impact</a>', page)
        self.assertIn('id="slow-impact-craters"', page)
        self.assertFalse((self.folder / "report.part").exists())

    def test_judged_as_by_hand(self):
        result = self.stored()
        scene = verdicts.main_scene(result)
        u = {r["k"]: r["values"]["depth"] for r in scene["points"]["unculled"]["runs"]}
        c = {r["k"]: r["values"]["depth"] for r in scene["points"]["sleep 3 0"]["runs"]}
        j = verdicts.judge(result)["sleep 3 0"]
        self.assertAlmostEqual(j.verdicts["depth"].in_margins, abs(statistics.fmean(c[k] - u[k] for k in c)) / (0.02 * statistics.fmean(u.values())), 9)
        times = {name: {r["k"]: r["seconds"] for r in scene["points"][name]["runs"]} for name in ("unculled", "sleep 3 0")}
        self.assertAlmostEqual(j.of_unculled, statistics.median(times["sleep 3 0"][k] / times["unculled"][k] for k in times["sleep 3 0"]), 12)

    def test_runs_of_a_slower_machine_leave_the_speed_up_alone(self):
        """A pair's two runs follow each other; pairs of one case may come from several machines."""
        result = self.stored()
        before = verdicts.judge(result)["sleep 3 0"].of_unculled
        for name in ("unculled", "sleep 3 0"):
            for run in verdicts.main_scene(result)["points"][name]["runs"][1:]:
                run["seconds"] *= 3
        self.assertAlmostEqual(verdicts.judge(result)["sleep 3 0"].of_unculled, before, 12)

    def test_too_few_runs_are_not_judged(self):
        result = self.stored()
        for entry in verdicts.main_scene(result)["points"].values():
            entry["runs"] = entry["runs"][:1]
        self.assertEqual(verdicts.judge(result), {})
        report.write([result], self.folder / "report")
        self.assertIn("There are too few runs to judge.", (self.folder / "report" / "README.md").read_text())

    def test_forecasts_beside_what_came(self):
        """Of the longest loop that has one; a run without is left out."""
        result = self.stored()
        scene = verdicts.main_scene(result)

        def loops(name, *of_runs):
            for run, seconds in zip(scene["points"][name]["runs"], of_runs):
                run["loops"] = [{"seconds": s, "forecast": f, "told": None} for s, f in seconds]
        loops("unculled", [(1, None), (40, None), (90, None)], [(1, None), (44, None), (90, None)])
        loops("sleep 3 0", [(1, 9.0), (20, 2.5), (30, None)], [(1, 9.0), (22, 2.9), (30, None)], [(1, None), (21, None), (30, None)])
        loops("live 3 0", [(1, 1.5), (42, None), (90, None)])
        made = forecasts.forecasts_of(result)
        self.assertEqual([(f.mode, f.said, f.came, f.is_near) for f in made], [("sleep", 2.7, 2.0, False), ("live", 1.5, 1.0, False)])
        report.write([result], self.folder / "report")
        page = (self.folder / "report" / "README.md").read_text()
        self.assertIn("Of 2 forecasts 0 are within 30 %", page)
        self.assertIn("| `sleep` | 2.70 | 2.00 | **1.35** |", page)
        for run in scene["points"]["sleep 3 0"]["runs"][:2]:
            run["loops"][1]["seconds"] = 18
        self.assertTrue(forecasts.forecasts_of(result)[0].is_near)
        self.assertEqual(forecasts.forecasts_of(self.stored()), [], "results of runs that were not asked")

    def test_wrong_files(self):
        file = self.folder / "results.json"
        self.refused("run the case first", case_results.read_result, file)
        file.write_text("{")
        self.refused("is no JSON", case_results.read_result, file)
        file.write_text("[1]")
        self.refused("is not the result of a case", case_results.read_result, file)
        result = json.loads(STORED.read_text())
        del verdicts.main_scene(result)["points"]["live 3 0"]["runs"][0]["values"]["depth"]
        file.write_text(json.dumps(result))
        self.refused("live 3 0 has values of", case_results.read_result, file)
        self.refused("no case has results to report", report.write, [], self.folder / "report")


class Publish(Folder):
    """What of a report is kept with the sources."""

    def root(self, marks=True):
        root = self.folder / "root"
        for name, begin in (("README.md", first_page.BEGIN), ("examples/impact/RESULTS.md", report.BEGIN)):
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_text(f"before\n\n{begin}\nold\n{pages.END if marks else ''}\n\nafter\n")
        (root / first_page.SCALE).parent.mkdir(parents=True)
        shutil.copy(ROOT / first_page.SCALE, root / first_page.SCALE)
        return root

    def results(self, **of_a_case):
        """The stored result, told of as each case that has a row in README.md, and as the impact."""
        names = [case for case, _ in first_page.ROWS if case] + ["impact"]
        return [{**case_results.read_result(STORED), "case": name, **of_a_case} for name in names]

    def published(self, results, root, *size):
        page = report.write(results, self.folder / "report", None, "From a test.")
        report.publish(results, page, self.folder / "report", root, *size)

    def test_production_has_a_page_of_its_own(self):
        root = self.root()
        readme = (root / "README.md").read_text()
        self.published(self.results(), root, cases.PRODUCTION)
        self.assertEqual({f.name for f in (root / "validation" / "production").iterdir()}, {"RESULTS.md", "results.json", "all.png"})
        self.assertEqual((root / "README.md").read_text(), readme)
        self.assertFalse((root / first_page.CASES).exists())

    def test_results_file_and_pages(self):
        results, root = self.results(), self.root()
        self.published(results, root)
        sleep = verdicts.judge(results[0])["sleep 3 0"]
        readme = (root / "README.md").read_text()
        self.assertNotIn("old", readme)
        self.assertTrue(readme.startswith(f"before\n\n{first_page.BEGIN}\n| scene |") and readme.endswith(f"|\n{pages.END}\n\nafter\n"), readme)
        self.assertIn("| [heap, fed on its top](validation/cases/fed_heap/README.md), 4000 kg/m3 from 0.1 m | 6,001 | 5.", readme)
        self.assertIn(f" s | {sleep.speed_up:.1f} | ", readme)
        self.assertEqual(readme.count("| 6,001 |"), 4, "the four cases; the strike is of another file")
        self.assertIn("| 1,280,000 |", readme)
        self.assertIn("| depth (m) |", (root / "examples/impact/RESULTS.md").read_text())
        text = (root / "validation" / "RESULTS.md").read_text()
        self.assertEqual(re.findall(r"!\[.*?\]\((.*?)\)", text), ["all.png"])
        self.assertGreater((root / "validation" / "all.png").stat().st_size, 5000)
        records = kept_figures.read(root / first_page.CASES)
        self.assertEqual(records, [record for r in results for record in kept_figures.records_of(r)])
        self.assertEqual(first_page.readme(root, records, kept_figures.read(root / first_page.SCALE)), readme, "made of the files alone")
        self.published(results, root)
        self.assertEqual((root / "README.md").read_text(), readme, "a second time changes nothing")

    def test_records_say_what_was_judged(self):
        result = case_results.read_result(STORED)
        record, live = kept_figures.records_of(result)[:2]
        judged = verdicts.judge(result)["sleep 3 0"]
        unculled = verdicts.unculled_of(verdicts.main_scene(result))
        depths = list(verdicts.values_of(unculled, "depth").values())
        mean = statistics.fmean(depths)
        self.assertEqual((record["case"], record["main"], record["mode"], live["mode"]), ("slow_impact", True, "sleep", "live"))
        self.assertEqual((record["faster"], record["verdict"]), (round(judged.speed_up, 2), judged.word))
        self.assertEqual(record["off"][0]["figure"], judged.worst)
        depth, = (f for f in record["off"] if f["figure"] == "depth")
        self.assertEqual(depth, {"figure": "depth", "percent": round(100 * abs(judged.verdicts["depth"].difference) / mean, 2),
                                 "margins": round(judged.verdicts["depth"].in_margins, 2),
                                 "scatter": round(100 * (max(depths) - min(depths)) / mean, 2), "verdict": judged.verdicts["depth"].word})

    def test_what_was_decided_is_told_in_per_cent(self):
        """Within what the runs are equal, or by how much they differ; and a reader is told where thirty pairs do not tell."""
        result = {**case_results.read_result(STORED), "decided": True}
        scene = verdicts.main_scene(result)
        names = [m["name"] for m in result["metrics"]]
        by_metric = dict(zip(names, ((100, 0.1, 100.4), (100, 0.1, 130), (100, 40, 100), (100, 0.1, 100), (100, 0.1, 100))))
        for point, shift in (("unculled", False), ("sleep 3 0", True), ("live 3 0", False)):
            scene["points"][point]["runs"] = [{**scene["points"][point]["runs"][0], "k": k, "values": {
                name: (culled if shift else mean) + scatter * (-1)**k * shift for name, (mean, scatter, culled) in by_metric.items()}} for k in range(30)]
        record = kept_figures.records_of(result)[0]
        told = {f["figure"]: kept_figures.told(f) for f in record["off"]}
        self.assertEqual({f["figure"]: f["pairs"] for f in record["off"]}, dict(zip(names, (5, 5, 30, 5, 5))))
        self.assertRegex(told[names[0]], r"^equal within 1\.\d+ %$")
        self.assertEqual(told[names[1]], "differs by 30 %")
        self.assertRegex(told[names[2]], r"^not decided after 30 pairs: -\d+ to \+\d+ %$")
        self.assertEqual(record["verdict"], verdicts.OTHER)
        self.assertEqual(report.overview_row([record], "A")[-1], f"differs by 30 % ({names[1]}); 30 pairs")
        report.write([result], self.folder / "report")
        text = (self.folder / "report" / "README.md").read_text()
        for part in (told[names[0]], told[names[1]], told[names[2]], "until each metric was decided, 30 at most"):
            self.assertIn(part, text)
        in_metres = kept_figures.figure_off({**result["metrics"][0], "relative": False}, verdicts.judge(result)["sleep 3 0"].verdicts[names[0]],
                                            verdicts.unculled_of(scene))
        self.assertRegex(kept_figures.told(in_metres), r"^equal within 1(\.\d+)? m$")
        record["case"] = "fed_heap"
        row = first_page.case_row([record], "fed_heap", "heap")
        self.assertRegex(row[4], rf"^\*\*{names[1]} differs by 30 %; {names[2]} -\d+ to \+\d+ %\*\*$")

    def test_what_is_outside_in_another_scene_is_told(self):
        """In the first page's table, among what is outside in per cent, and in README.md's row."""
        results = self.results()
        name, scene = list(results[0]["scenes"].items())[1]
        for run in scene["points"]["sleep 3 0"]["runs"]:
            run["values"]["depth"] *= 2
        records = [record for r in results for record in kept_figures.records_of(r)]
        titles = {r["case"]: r["title"] for r in results}
        page = report.overview_rows(records, titles)
        self.assertEqual([r[0].partition(", ")[2] for r in page[:2]], list(results[0]["scenes"]))
        self.assertRegex(page[1][5], r"^\d+\.\d+ \(depth\)$")
        self.assertEqual(page[1][6], "outside", name)
        told, = (r for r in report.outside_rows(records, titles) if r[2] == "depth")
        percent = float(told[3].removesuffix(" %"))
        self.assertTrue(90 < percent < 110, told)
        self.assertRegex(first_page.rows(records, kept_figures.read(ROOT / first_page.SCALE))[0][4], rf"^\*\*.*{re.escape(name)}: depth 1?\d\d %")

    def test_a_mode_that_was_not_run(self):
        result = case_results.read_result(STORED)
        for scene in result["scenes"].values():
            del scene["points"]["live 3 0"]
        records = kept_figures.records_of(result)
        self.assertEqual([(r["faster"], r["off"]) for r in records if r["mode"] == "live"], [(None, [])] * 2)
        self.assertEqual(report.overview_rows(records, {"slow_impact": "A"})[0][-3:], ["-", "-", "not run"])
        for r in records:
            r.update(case="fed_heap", faster=None, off=[])
        self.refused("fed_heap was not run with `exterior sleep`", first_page.rows, records, [])

    def test_nothing_is_written_where_a_mark_is_missing(self):
        root = self.root(marks=False)
        self.refused("has no lines '<!-- made of", self.published, self.results(), root)
        self.assertFalse((root / "validation" / "RESULTS.md").exists() or (root / first_page.CASES).exists())

    def test_nothing_is_written_of_too_few_runs(self):
        results, root = self.results(), self.root()
        for entry in verdicts.main_scene(results[1])["points"].values():
            entry["runs"] = entry["runs"][:1]
        self.refused("penetration has too few runs to publish", self.published, results, root)
        self.assertFalse((root / first_page.CASES).exists())

    def test_only_full_runs_of_all_cases_are_published(self):
        for words in (["--publish"], ["--publish", "--full", "silo"], ["--publish", "--full", "--also", "calm 3"],
                      ["--publish", "--full", "--ranks", "2"], ["--publish", "--production", "silo"], ["--few-steps", "--ranks", "2"], ["--ranks", "0"]):
            with self.assertRaises(SystemExit), open(os.devnull, "w") as nowhere, contextlib.redirect_stderr(nowhere):
                command.options(words)
        for size in ("--full", "--production"):
            self.assertTrue(command.options(["--publish", size]).publish)


class Command(Folder):
    """The command itself with a launcher that is no LIGGGHTS."""

    def validate(self, script, *words):
        launcher = self.folder / "launcher"
        launcher.write_text(f"#!/bin/sh\n{script}\n")
        launcher.chmod(launcher.stat().st_mode | stat.S_IXUSR)
        out = self.folder / "out"
        done = subprocess.run(["/usr/bin/python3", "-m", "solidcull_runs.validation.command", "--out", str(out), "--report", str(self.folder / "report"), *words],
                              cwd=ROOT, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, timeout=120,
                              env={**os.environ, "SOLIDCULL_LAUNCHER": str(launcher)})
        return done.returncode, done.stderr.splitlines()

    def test_a_killed_run(self):
        status, said = self.validate("kill -9 $$", "slow_impact")
        self.assertEqual((status, len(said)), (2, 1), said)
        self.assertRegex(said[0], r"^validate: .*was killed by signal 9 \(SIGKILL\)")

    def test_no_results(self):
        status, said = self.validate("true", "--report-only", "slow_impact")
        self.assertEqual((status, said), (2, ["validate: no case has results to report"]))

    def test_results_that_were_kept_are_reported(self):
        kept = self.folder / "kept"
        (kept / "full").mkdir(parents=True)
        shutil.copy(STORED, kept / "full" / "slow_impact.json")
        status, said = self.validate("true", "--full", "--report-only", "--kept", str(kept))
        self.assertEqual((status, said), (0, []))
        self.assertIn("[slow_impact](", (self.folder / "report" / "README.md").read_text())
        (kept / "full" / "slow_impact.json").write_text("{}")
        status, said = self.validate("true", "--full", "--report-only", "--kept", str(kept))
        self.assertEqual((status, len(said)), (2, 1))
        self.assertIn("is not the result of a case", said[0])

    def test_results_are_kept_beside_the_runs(self):
        case = types.SimpleNamespace(name="c", title="", claim="", reference="", size="quick", metrics=[], scenes={}, main_scene=None, get=lambda *_: None)
        files = [self.folder / "out" / "c" / "results.json", self.folder / "kept" / "c.json"]
        course = case_runs.Course([], 1, lambda line: None)
        self.assertEqual(command.run_case(case, [], course, files, self.folder / "out"), [])
        self.assertEqual(files[0].read_text(), files[1].read_text())
        self.assertEqual(json.loads(files[1].read_text())["case"], "c")

    def earlier(self, out, fix, case=None):
        """The jobs of a case, and runs of them as they stand in a result."""
        case = case or cases.load(["slow_impact"], "quick")[0]
        beds = {(case.name, scene): None for scene in case.scenes}
        return case, case_runs.jobs_of(case, out / "quick", beds, "launcher", fix)

    def result_with(self, case, jobs):
        """As if all of these were run: alike, but for a little."""
        done = {job: EarlierRun({"k": job.k, "mark": job.mark, "seconds": 1.0, "steps": 1, "counts": {}, "granules": 8, "twice": 0, "missing": 0,
                                 "values": {m.name: 1 + 1e-6 * (job.k + len(job.point.family)) for m in case.metrics}}) for job in jobs}
        return {**case_results.result_of(case, done), "fields": {"sleep 3 0": "of finals"}, "bound": {"moving": 3}, "lost": 0}

    def test_runs_of_a_result_that_was_kept_are_not_made_again(self):
        case, jobs = self.earlier(self.folder / "there", "fix")
        result = self.result_with(case, jobs[:-1])
        _, here = self.earlier(self.folder / "here", "fix", case)
        found = Earlier(result, here)
        self.assertEqual([bool(found.run_of(job)) for job in here], [True] * (len(jobs) - 1) + [False])
        self.assertEqual(found.run_of(here[0]).metrics, {m.name: 1 + 1e-6 * len("unculled") for m in case.metrics})

        done = {job: found.run_of(job) for job in here[:-1]}
        again = case_results.result_of(case, done, False, found)
        self.assertEqual(again, result)
        self.assertEqual(case_results.result_of(case, done)["fields"], {})

    def test_runs_of_another_fix_or_deck_are_made_again_all_of_them(self):
        case, jobs = self.earlier(self.folder / "there", "fix")
        result = self.result_with(case, jobs)
        for fix, granules in (("another fix", None), ("fix", 5000)):
            other = cases.load(["slow_impact"], "quick")[0]
            if granules:
                other.scenes[other.main_scene]["bed_granules"] = granules
            _, here = self.earlier(self.folder / "here", fix, other)
            found = Earlier(result, here)
            self.assertEqual([job for job in here if found.run_of(job)], [])
            fresh = {"fields": {}, "bound": None}
            found.add_to(fresh)
            self.assertEqual(fresh, {"fields": {}, "bound": None})

    def test_a_case_goes_on_from_what_was_kept_elsewhere(self):
        case, jobs = self.earlier(self.folder / "there", "fix")
        kept, said = self.folder / "kept" / "slow_impact.json", []
        kept.parent.mkdir()
        kept.write_text(json.dumps(self.result_with(case, jobs[:-1])))
        _, here = self.earlier(self.folder / "here", "fix", case)
        files = [self.folder / "here" / "results.json", kept]
        with unittest.mock.patch.object(case_runs.CaseJob, "start", side_effect=RunError("no engine here")) as start:
            failed = command.run_case(case, here, case_runs.Course(here, 1, said.append), files, self.folder / "here")
        self.assertEqual((start.call_count, failed), (1, ["slow_impact: no engine here"]))
        result = json.loads(kept.read_text())
        self.assertEqual(files[0].read_text(), kept.read_text())
        self.assertEqual(sum(len(e["runs"]) for s in result["scenes"].values() for e in s["points"].values()), len(jobs) - 1)
        self.assertEqual(result["bound"], {"moving": 3})

    def test_results_are_kept_on_the_way(self):
        case, jobs = self.earlier(self.folder / "there", "fix")
        given, kept = self.result_with(case, jobs), self.folder / "kept.json"
        found = Earlier(given, jobs)
        job = jobs[1]

        def run_all(jobs, course, earlier, after):
            after({job: found.run_of(job)})
            left = json.loads(kept.read_text()) if kept.exists() else {"scenes": {}}
            self.left = [run for s in left["scenes"].values() for e in s["points"].values() for run in e["runs"]]
            return {job: found.run_of(job)}
        for every, number in ((1e9, 0), (0, 1)):
            with unittest.mock.patch.object(case_runs, "run_all", run_all), unittest.mock.patch.object(command, "LEFT_EVERY", every):
                kept.unlink(missing_ok=True)
                command.run_case(case, jobs, case_runs.Course(jobs, 1, print), [kept], self.folder)
            self.assertEqual(len(self.left), number)

        kept.write_text(json.dumps(given))
        with unittest.mock.patch.object(case_runs, "run_all", run_all), unittest.mock.patch.object(command, "LEFT_EVERY", 0):
            command.run_case(case, jobs, case_runs.Course(jobs, 1, print), [kept], self.folder)
        self.assertEqual(len(self.left), len(jobs), "fewer runs did not take the place of what was kept")

    def test_results_are_kept_where_the_user_stops(self):
        case, jobs = self.earlier(self.folder / "there", "fix")
        found, kept = Earlier(self.result_with(case, jobs), jobs), self.folder / "kept.json"

        def run_all(jobs, course, earlier, after):
            after({job: found.run_of(job) for job in jobs[:3]})
            raise KeyboardInterrupt
        with unittest.mock.patch.object(case_runs, "run_all", run_all), self.assertRaises(KeyboardInterrupt):
            command.run_case(case, jobs, case_runs.Course(jobs, 1, print), [kept], self.folder)
        result = json.loads(kept.read_text())
        self.assertEqual(sum(len(e["runs"]) for s in result["scenes"].values() for e in s["points"].values()), 3)

    def test_an_unknown_case(self):
        status, said = self.validate("true", "crater")
        self.assertEqual(status, 2)
        self.assertRegex(said[0], r"^validate: no case 'crater'; there is: .*slow_impact")


class Decks(unittest.TestCase):
    @unittest.skipUnless(shutil.which("liggghts") and (ROOT / "build" / "liggghts-solidcull").exists(), "no engine")
    def test_every_deck_for_a_few_steps(self):
        with tempfile.TemporaryDirectory() as folder:
            done = subprocess.run(["/usr/bin/python3", "-m", "solidcull_runs.validation.command", "--few-steps", "--out", folder], cwd=ROOT,
                                  stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, timeout=500)
        self.assertEqual(done.returncode, 0, done.stderr)
        for name in cases.names():
            self.assertIn(f"{name}: ", done.stdout)


if __name__ == "__main__":
    unittest.main()
