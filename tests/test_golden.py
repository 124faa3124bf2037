#!/usr/bin/python3
"""The golden tool: one launcher against itself is identical; whatever differs, lacks or fails is said, with its status."""
import contextlib
import io
import json
import os
import re
import stat
import sys
import tempfile
import unittest
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "golden"))
import golden  # noqa: E402

LAUNCHER = os.environ.get("SOLIDCULL_LAUNCHER", str(HERE.parent / "build" / "liggghts-solidcull"))
KEYWORDS = golden.SCENES["split"][2]
SHORT = {"steps": 550, "files": 550, "more": KEYWORDS}
REACHED = {"interior": 1000, "carves": 1, "restored": 100}
TINY = [golden.Case("tiny-1", [("split.in", SHORT)], 1, None, REACHED),
        golden.Case("tiny-2", [("split.in", {**SHORT, "exterior": "sleep", "store": "compact"})], 2, None, REACHED)]
FAILING = [golden.Case("wrong-1", [("split.in", {**SHORT, "more": "depth -1"})], 1),
           golden.Case("calm-1", [("split.in", {**SHORT, "steps": 100})], 1, None, {"carves": 1})]
VDB = b" BDV" + bytes(17) + b"76db30ec-021e-4433-9999-d6afdc68b263" + b"grids"


class Golden(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        holder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(holder.cleanup)
        cls.folder = Path(holder.name)
        cls.addClassCleanup(setattr, golden, "CASES", golden.CASES)
        golden.CASES = golden.CASES + TINY + FAILING
        for name in ("a", "b"):
            status, out, err = cls.call("record", "--launcher", LAUNCHER, "--cases", "tiny-*", "--cache", cls.folder / "cache",
                                        *["--keep"] * (name == "a"), "--", cls.folder / name)
            assert status == 0 and not err, err

    @staticmethod
    def call(*words):
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            status = golden.main([str(w) for w in words])
        return status, out.getvalue(), err.getvalue()

    def refused(self, text, *words):
        """Exit 2, and one line that holds the text."""
        status, _, err = self.call(*words)
        self.assertEqual(status, 2, err)
        self.assertIn(text, err)
        self.assertTrue(err.startswith("golden: "), err)
        self.assertEqual(err.count("\n"), 1, err)

    def record_of(self, name, case="tiny-1"):
        return [json.loads(line) for line in (self.folder / name / f"{case}.jsonl").read_text().splitlines()]

    def doctored(self, change):
        """A folder with tiny-1 as it was recorded, but for what `change` does to its lines."""
        lines = self.record_of("a")
        change(lines)
        holder = tempfile.TemporaryDirectory()
        self.addCleanup(holder.cleanup)
        (Path(holder.name) / "tiny-1.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
        return Path(holder.name)

    def compared_with(self, change):
        """The line of tiny-1 when its record is compared with a doctored one, which must end with 1."""
        status, out, err = self.call("compare", "--cases", "tiny-1", "--", self.folder / "a", self.doctored(change))
        self.assertEqual((status, err), (1, ""))
        self.assertIn("0 identical, 1 different, 0 missing", out)
        return out.splitlines()[0]

    @staticmethod
    def line_with(lines, kind, step):
        return next(line for line in lines if kind in line and line["step"] == step)

    def test_one_launcher_twice_is_identical(self):
        status, out, err = self.call("compare", self.folder / "a", self.folder / "b")
        self.assertEqual((status, err), (0, ""))
        self.assertEqual(out, "tiny-1: identical\ntiny-2: identical\n2 identical, 0 different, 0 missing\n")

    def test_what_a_record_holds(self):
        lines = self.record_of("a")
        steps = list(range(0, 551, 50))
        self.assertEqual([line["step"] for line in lines if "granules" in line], steps)
        self.assertEqual([line["step"] for line in lines if "values" in line], steps)
        for line in lines[1:-2]:
            self.assertEqual(line.keys() & {"granules", "values"}, {"granules"} if "granules" in line else {"values"})
        values = self.line_with(lines, "values", 550)["values"]
        self.assertEqual({k for k in values if k.startswith("cull")}, {"cull"} | {f"cull[{k}]" for k in range(1, 23) if k != 10})
        self.assertGreater(float(values["cull[5]"]), 0)
        self.assertEqual(f"{float(values['cull[5]']):.17g}", values["cull[5]"], "full precision")
        self.assertEqual(list(self.line_with(lines, "granules", 50)["granules"]), ["granules", "bodies", "x", "v", "omega", "f"])
        self.assertEqual(list(lines[-2]["files"]), ["end.restart", "bed.000000000.vtp", "bed.000000550.vtp", "mesh.000000000.vtp", "mesh.000000550.vtp"])
        self.assertRegex(lines[-2]["said"][-1], "the restart file holds .* interior granules besides the atoms")
        hashes = [line["granules"]["x"] for line in lines if "granules" in line]
        self.assertEqual(len(set(hashes)), len(hashes), "something moves all the time")

    def test_a_doctored_record_is_different(self):
        def another_place(lines):
            for step in (100, 200):
                self.line_with(lines, "granules", step)["granules"]["x"] = "0" * 64

        def another_value(lines):
            self.line_with(lines, "values", 150)["values"]["cull[3]"] = "1"

        def another_file(lines):
            lines[-2]["files"]["bed.000000550.vtp"] = "0" * 64

        def another_end(lines):
            lines[-2]["end"]["omega"] = "0" * 64

        def another_message(lines):
            lines[-2]["said"].insert(0, "fix cull solid/cull: hello")

        def a_row_less(lines):
            lines.remove(self.line_with(lines, "granules", 300))

        self.assertEqual(self.compared_with(another_place), "tiny-1: differs from step 100: x")
        self.assertRegex(self.compared_with(another_value), r"^tiny-1: differs from step 150: cull\[3\] \d+ against 1$")
        self.assertEqual(self.compared_with(another_file), "tiny-1: differs at the end: bed.000000550.vtp")
        self.assertEqual(self.compared_with(another_end), "tiny-1: differs at the end: omega")
        self.assertRegex(self.compared_with(another_message),
                         "^tiny-1: differs at the end: said: `fix cull .*` against `fix cull solid/cull: hello`$")
        self.assertIn("tiny-1: one has ", self.compared_with(a_row_less))

    def test_what_cannot_be_compared(self):
        a = self.folder / "a"
        self.refused("tiny-2 is missing in", "compare", a, self.doctored(lambda lines: None))
        self.refused("tiny-1.jsonl is not a whole record", "compare", "--cases", "tiny-1", "--", a,
                     self.doctored(lambda lines: lines.pop()))
        self.refused("tiny-1 was recorded with another deck", "compare", "--cases", "tiny-1", "--", a,
                     self.doctored(lambda lines: lines[0].update(inputs="0")))
        self.refused("is not a folder of records", "compare", a, self.folder / "none")
        self.refused("hold no records", "compare", self.folder / "cache", self.folder / "cache")

    def test_misuse(self):
        self.refused("no case matches nothing-*", "record", "--launcher", LAUNCHER, self.folder / "c", "--cases", "nothing-*")
        self.refused("no launcher at /nowhere/liggghts", "record", "--launcher", "/nowhere/liggghts", self.folder / "c")
        self.refused("invalid choice: 'prove'", "prove")
        lone = self.folder / "lone"
        lone.write_text("")
        lone.chmod(0o755)
        self.refused("libsolidcull.so is not there", "record", "--launcher", lone, self.folder / "c")

    def test_a_run_that_fails_or_proves_nothing(self):
        stale = self.folder / "c" / "wrong-1.jsonl"
        stale.parent.mkdir()
        stale.write_text("an older record")
        where = ("record", "--launcher", LAUNCHER, "--cache", self.folder / "cache", self.folder / "c", "--cases")
        self.refused("wrong-1: LIGGGHTS stopped in split.in with status", *where, "wrong-1")
        self.assertFalse(stale.exists(), "what failed leaves no record")
        self.refused("calm-1 proves nothing: carves 0, at least 1 expected", *where, "calm-1")
        self.assertEqual(list((self.folder / "c").glob("*.jsonl")), [])

    def test_two_launchers_one_of_which_gives_other_results(self):
        # the other one moves the ball by 1e-13 m
        other = self.folder / "other"
        other.mkdir()
        launcher = other / "liggghts-solidcull"
        launcher.write_text('#!/bin/sh\nsed -i "s/single 0.001 0.002/single 0.0010000000001 0.002/" split.in\n'
                            f'exec "{LAUNCHER}" "$@"\n')
        launcher.chmod(launcher.stat().st_mode | stat.S_IXUSR)
        (other / "libsolidcull.so").write_bytes(b"another")
        words = ("run", "--cache", self.folder / "cache", "--cases", "tiny-1", "--before", LAUNCHER, "--after")
        status, out, err = self.call(*words, LAUNCHER)
        self.assertEqual((status, err), (0, ""))
        self.assertEqual(out.count("tiny-1: interior"), 1, "what is in the cache is not run again")
        status, out, err = self.call(*words, launcher, "--keep")
        self.assertEqual((status, err), (1, ""))
        self.assertIn("once more, what differs", out)
        found = re.search(r"^tiny-1: differs from step 0: x \(max \|difference\| ([0-9.e-]+), ([0-9.e-]+) of the largest, "
                          r"1 granules, most at (\d+)\)$", out, flags=re.M)
        self.assertTrue(found, out)
        self.assertAlmostEqual(float(found[1]), 1e-13, delta=1e-15)
        self.assertEqual(int(found[3]), 1814)


class Parts(unittest.TestCase):
    def test_every_case_has_its_deck_and_says_what_it_must_reach(self):
        names = [c.name for c in golden.CASES]
        self.assertEqual(len(set(names)), len(names))
        for case in golden.CASES:
            self.assertGreater(case.demands["interior"], 0, case.name)
            for deck, _ in case.parts:
                text = golden.text_of_deck(deck)
                self.assertEqual(len(re.findall("^fix cull all solid/cull ", text, flags=re.M)), 1, deck)
                self.assertIn("write_restart end.restart", text)
        for scene in golden.SCENES:
            for exterior, store, ranks in golden.itertools.product(("live", "sleep"), ("exact", "compact"), (1, 2, 4)):
                self.assertIn(f"{scene}-{exterior}-{store}-{ranks}", names)
        self.assertTrue(set(golden.QUICK) <= set(names))

    def test_why_liggghts_stopped(self):
        rule = "-" * 74
        for screen, reason in (("ERROR: one\nERROR: two (a.cpp:3)\nmpirun noise\n", "ERROR: two (a.cpp:3)"),
                               (f"terminate called\n  what():  map::at\n[vm] Aborted\n{rule}\n", "what():  map::at"),
                               (f"Segmentation fault\n{rule}\n\n", "Segmentation fault"), ("", "it printed nothing")):
            self.assertEqual(golden.reason_in(screen), reason)

    def test_the_key_of_a_case_hangs_on_all_that_it_reads(self):
        text = golden.text_of_deck("impact.in")
        for part in ("create_atoms", "property/global", "fix cull all", "write_dump", "facet normal"):
            self.assertIn(part, text)

    def test_only_the_uuid_of_a_vdb_file_is_left_out(self):
        with tempfile.TemporaryDirectory() as folder:
            def hashed(content, name="mesh.1.vdb"):
                (Path(folder) / name).write_bytes(content)
                return golden.hash_of_file(Path(folder) / name)

            other = VDB.replace(b"76db30ec", b"00000000")
            self.assertEqual(hashed(VDB), hashed(other))
            self.assertNotEqual(hashed(VDB), hashed(VDB[:-1] + b"z"))
            self.assertNotEqual(hashed(VDB, "mesh.1.stl"), hashed(other, "mesh.1.stl"))
            with self.assertRaisesRegex(golden.GoldenError, "no UUID"):
                hashed(b" BDV" + bytes(80))

    def test_what_seconds_have_gone_into_and_the_end_of_a_run_are_no_result(self):
        screen = ("fix cull solid/cull: version 0.1.0\n"
                  "fix cull solid/cull: the deck has no fix gravity\n"
                  "fix cull solid/cull: 400 steps, 343 granules\n  exterior      = 20 (5.8 %) on average\n"
                  "fix cull solid/cull: 1 exterior, 2 interface, 3 interior granules in 1 bodies; culled 5, restored 0\n"
                  "fix cull solid/cull: if it goes on like this, the run will be about as much work as without it\n"
                  "fix cull solid/cull: 0.2 s in the fix since it was made: load 0\n"
                  "Loop time of 3 on 1 procs\n")
        self.assertEqual(golden.said(screen), ["fix cull solid/cull: the deck has no fix gravity"])

    def test_rows_are_sorted_by_tag_and_hashed_to_the_last_digit(self):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "dump"

            def first(rows):
                file.write_text("ITEM: TIMESTEP\n50\nITEM: NUMBER OF ATOMS\n2\nITEM: BOX BOUNDS ff ff ff\n0 1\n0 1\n0 1\n"
                                "ITEM: ATOMS id x\n" + rows)
                step, columns, rows, box = next(golden.snapshots(file))
                self.assertEqual((step, box), (50, [[0, 1]] * 3))
                return golden.hashes(columns, rows, {"x": ("x",)})["x"]

            self.assertEqual(first("10 0.5\n9 0.25\n"), first("9 0.25\n10 0.5\n"))
            self.assertNotEqual(first("9 0.25\n10 0.5\n"), first("9 0.25\n10 0.50000000000000011\n"))
            self.assertNotEqual(first("9 0\n10 0.5\n"), first("9 -0\n10 0.5\n"))

    def test_what_was_reached(self):
        columns, box = ["id", "f_cull", "x", "y"], [(0, 1), (0, 1), (0, 1)]
        reached = golden.Reached(4)
        for rows in (["1 5 .4 .4", "2 5 .4 .4", "3 6 .4 .4", "4 0 .4 .4"],    # bodies 5 and 6
                     ["1 5 .6 .4", "2 5 .4 .4", "3 5 .4 .4", "4 0 .6 .6"],    # 6 joins 5, 1 goes to another rank
                     ["1 5 .6 .4", "2 7 .4 .4", "3 5 .4 .4", "4 0 .6 .6"]):   # 7 comes off
            reached.granules(columns, [r.split() for r in rows], box)
        self.assertEqual([reached.counts[n] for n in ("merges", "splits", "handed")], [1, 1, 1])

    def test_how_far_apart(self):
        self.assertEqual(golden.how_far({1: [1.0], 2: [4.0]}, {1: [1.0], 2: [4.5]}),
                         "max |difference| 0.5, 0.125 of the largest, 1 granules, most at 2")
        self.assertEqual(golden.how_far({1: [0.0]}, {1: [-0.0]}), "max |difference| 0, 1 granules, most at 1")
        self.assertEqual(golden.how_far({1: [1.0]}, {2: [1.0]}), "2 granules in one alone")


if __name__ == "__main__":
    unittest.main()
