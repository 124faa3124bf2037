#!/usr/bin/python3
"""The gate: the build has the results of the ensemble, a changed law has not; the gate's own parts; its faults still fit the sources."""
import os
import re
import stat
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE / "gate"), str(HERE.parent)]
import ensemble  # noqa: E402
import faults  # noqa: E402
import figures  # noqa: E402
import gate  # noqa: E402
import scenes  # noqa: E402
from solidcull_runs.engine import find_launcher  # noqa: E402
from solidcull_runs.errors import RunError  # noqa: E402

TOOL = HERE / "gate" / "gate.py"


def call(*words, **variables):
    done = subprocess.run([sys.executable, str(TOOL), *map(str, words)], env={**os.environ, **variables}, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, text=True)
    return done.returncode, done.stdout, done.stderr


class Folder(unittest.TestCase):
    def setUp(self):
        place = tempfile.TemporaryDirectory()
        self.addCleanup(place.cleanup)
        self.folder = Path(place.name)

    def launcher(self, script):
        file = self.folder / "launcher"
        file.write_text("#!/bin/sh\n" + script)
        file.chmod(file.stat().st_mode | stat.S_IXUSR)
        return file


class Gate(Folder):
    def test_this_build_has_the_results_of_the_ensemble(self):
        status, out, err = call("--launcher", find_launcher())
        self.assertEqual((status, err), (0, ""), out)
        self.assertRegex(out, r"^same results: \d+ figures of 3 runs ")

    def test_a_law_that_is_a_little_other_is_told_with_the_figures_that_show_it(self):
        other = self.launcher('sed -i "s/^fix cull all solid.cull/& tolerance 3.15 0/" cull.in\n' + f'exec "{find_launcher()}" "$@"\n')
        status, out, err = call("--launcher", other)
        self.assertEqual((status, err), (1, ""), out)
        lines = out.splitlines()
        self.assertRegex(lines[0], r"^differs: \d+ of \d+ components and \d+ of \d+ figures are outside ")
        self.assertRegex(lines[1], r"^  \w+, \S+.*: .+ by \S+ of its scatter \(.+ was, .+ is\)$")
        self.assertIn("gate.py make --because", lines[-1])

    def test_a_scene_that_stops_is_a_difference(self):
        other = self.launcher('sed -i "s/^variable ballx.*/nonsense/" seam.in\n' + f'exec "{find_launcher()}" "$@"\n')
        status, out, err = call("--launcher", other)
        self.assertEqual((status, err), (1, ""))
        self.assertRegex(out, r"^differs: seam ran through when the ensemble was made, now LIGGGHTS stopped with status 1: ERROR: Unknown command: nonsense")

    def refused(self, reason, *words):
        status, out, err = call(*words)
        self.assertEqual(status, 2, out)
        self.assertRegex(err, f"^gate: .*{re.escape(reason)}")
        self.assertEqual(len(err.splitlines()), 1)

    def test_what_is_refused(self):
        self.refused("no launcher at /nowhere", "--launcher", "/nowhere")
        self.refused("gate.py make --because", "--kept", self.folder / "none")
        self.refused("make needs --because", "make")
        self.refused("--members 5: an ensemble needs 12 runs", "make", "--because", "x", "--members", "5")
        damaged = self.folder / "ensemble.txt"
        for text in ("", "{}", gate.KEPT.read_text().replace(" | N | ", " | N | x", 1)):
            damaged.write_text(text)
            self.refused("is no ensemble of the gate", "--kept", damaged)
        damaged.write_text(gate.KEPT.read_text().replace(scenes.recipe(), "0", 1))
        self.refused("ensemble.txt was made of other decks or beds", "--kept", damaged)


def runs(count, seed, shift=0.0, figure=0):
    """Of forty figures: ten scatter together, ten alone, twenty by rounding that does not count."""
    random = np.random.default_rng(seed)
    rows = np.tile(np.linspace(1, 2, 40), (count, 1))
    rows[:, :10] += 1e-6 * random.normal(size=(count, 1))
    rows[:, 10:20] += 1e-7 * random.normal(size=(count, 10))
    rows[:, 20:] += 1e-14 * random.normal(size=(count, 20))
    rows[:, figure:figure + 4] += shift
    return rows


NAMES, UNITS, GRANULE = [f"scene | step 1 | figure {k}" for k in range(40)], ["N"] * 40, np.full(40, 1e-3)


class Statistics(Folder):
    def setUp(self):
        super().setUp()
        self.made = ensemble.made_of(NAMES, UNITS, GRANULE, runs(200, 1), {"runs": 200})

    def test_runs_of_the_same_kind_are_the_same(self):
        self.assertFalse(any(self.made.differ(runs(3, 100 + seed)) for seed in range(200)))

    def test_runs_that_are_shifted_differ(self):
        for figure, shift in ((0, 1e-4), (10, 1e-5), (20, 1e-7), (36, -1e-7)):
            self.assertTrue(self.made.differ(runs(3, 7, shift, figure)), figure)
            self.assertIn(np.argmax(np.abs(self.made.far(runs(3, 7, shift, figure)))), range(figure, figure + 4))

    def test_one_run_of_three_that_is_shifted_is_chance(self):
        rows = runs(3, 8)
        rows[1] = runs(1, 9, 1e-3, 10)
        self.assertFalse(self.made.differ(rows))

    def test_what_is_below_rounding_is_no_result(self):
        self.assertFalse(self.made.differ(runs(3, 10, 1e-10, 24)))

    def test_false_alarms_are_counted(self):
        self.assertEqual(ensemble.left_out_one_by_one(NAMES, UNITS, GRANULE, runs(60, 2)), 0)
        self.assertEqual(ensemble.false_alarms(NAMES, UNITS, GRANULE, runs(60, 2)), (0, 0))
        mixed = runs(60, 3)
        mixed[::8] = runs(8, 4, 1e-3, 10)  # the part that is left out first is of another kind
        alone, threes = ensemble.false_alarms(NAMES, UNITS, GRANULE, mixed)
        self.assertAlmostEqual(alone, 8 / 60)
        self.assertGreater(threes, 0.05)

    def test_the_file_says_the_same(self):
        again = ensemble.of_text(ensemble.text_of(self.made))
        self.assertEqual((again.names, again.units, again.about), (NAMES, UNITS, {"runs": 200}))
        for shift in (0, 1e-9, 1e-7, 1e-5):
            rows = runs(3, 11, shift, 20)
            np.testing.assert_array_equal(again.outside(rows), self.made.outside(rows))


class Kept(unittest.TestCase):
    def test_the_ensemble_that_is_kept(self):
        kept = gate.read_kept()
        self.assertGreaterEqual(kept.about["runs"], 200)
        self.assertLessEqual(kept.about["false alarms of three runs"], 0.01)
        self.assertTrue(kept.about["because"])
        self.assertLessEqual(gate.KEPT.stat().st_size, 200_000)
        self.assertEqual({name.split(" | ")[0] for name in kept.names}, set(scenes.SCENES))
        self.assertTrue(set(kept.units) <= set(figures.UNIT))

    def test_faults_fit_the_sources_and_stand_in_the_table(self):
        known, page = faults.faults(), (HERE / "gate" / "README.md").read_text()
        self.assertGreaterEqual(len(known), 20)
        for name, fault in known.items():
            text = (HERE.parent / fault.path).read_text()
            self.assertNotEqual(fault.planted_in(text), text, name)
            self.assertIn(f"| {name} | {fault.what.rstrip('.')} |", page)

    def test_a_fault_that_fits_no_more_and_a_build_that_does_not_say_how_are_refused(self):
        fault = faults.faults()["history-lost"]
        with self.assertRaisesRegex(RunError, "fault history-lost does not fit .*contact_freezing.cpp any more: mend "):
            fault.planted_in("")
        with tempfile.TemporaryDirectory() as folder, self.assertRaisesRegex(RunError, "compile_commands.json does not say how files are compiled"):
            faults.Compiler(Path(folder) / "liggghts-solidcull")

    def test_members_differ_by_rounding_alone(self):
        def places(member):
            return np.loadtxt(scenes.data_text("bed.data", member).split("Atoms\n\n")[1].splitlines())[:, 4:]
        far = np.abs(places(1) - places(0))
        self.assertGreater(far.max(), 0)
        self.assertLess(far.max(), 1e-15)
        self.assertGreater(np.abs(places(1) - places(2)).max(), 0)


if __name__ == "__main__":
    unittest.main()
