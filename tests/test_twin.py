"""validation/twin.py: decks with and without the fix line, logs, figures, and each refusal by its text."""
import base64
import contextlib
import io
import os
import stat
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.dont_write_bytecode = True
sys.path[:0] = [str(ROOT / "validation"), str(ROOT / "examples")]
import pictures  # noqa: E402
import twin      # noqa: E402

DECK = """\
variable dx index 0
read_restart bed.restart
compute top all reduce max z
fix cull all solid/cull &
    every 50   # a comment
variable share equal f_cull/100
variable size index 1
compute mine all reduce sum f_cull
region solid interface/mesh cull
group inner region solid
dump d all custom 100 d.* id x f_cull
thermo_style custom step ke c_top f_cull[1] v_share c_mine
print "share ${share}"
run 1000
unfix cull
thermo_style custom step ke
run 0
"""

LOG = f"""\
LIGGGHTS (Version LIGGGHTS-PUBLIC 3.8.0)
thermo_style custom step ke c_top f_wall[3]
run 0
Memory usage per processor = 9.97283 Mbytes
    Step         KinEng            top        wall[3]
       0              1            0.5             77
Loop time of 7e-07 on 1 procs for 0 steps with 20 atoms, finish time Sat Nov 21 04:56:08 2026

Nlocal:    20 ave 20 max 20 min
print "{twin.FROM_HERE}"
{twin.FROM_HERE}
Memory usage per processor = 9.97283 Mbytes
    Step         KinEng            top        wall[3]
       0              1            0.5              8
insertion: proc 0 at 50 %
     100              4            0.7              4
     200              3            0.6              5
Loop time of 2.5 on 1 procs for 200 steps with 20 atoms, finish time Sat Nov 21 04:56:08 2026
Memory usage per processor = 9.97283 Mbytes
    Step         KinEng            top        wall[3]
     200              3            0.6             10
     300              2            0.4              5
Loop time of 1.5 on 1 procs for 100 steps with 20 atoms, finish time Sat Nov 21 04:56:08 2026
{twin.TO_HERE}
    Step    Atoms         KinEng
     300       20             99
Loop time of 9 on 1 procs for 0 steps with 20 atoms, finish time Sat Nov 21 04:56:08 2026
"""

# stands in for LIGGGHTS: prints a log that depends on the deck's name and writes what twin asks for
FAKE = """\
#!/usr/bin/python3
import re, sys
deck = open(sys.argv[sys.argv.index("-in") + 1]).read()
if "read_restart missing" in deck:
    print("ERROR: Cannot open restart file missing (./src/read_restart.cpp:533)")
    sys.exit(1)
culled = re.search(r"(?m)^fix cull", deck) is not None
shift = 0.01 * ("set group all x" in deck)
print("twin: counted from here\\n    Step    depth")
print(f"  0  0.5\\n  10  {1 + shift + 0.001 * culled}")
print(f"Loop time of {4 if culled else 10} on 1 procs\\ntwin: end of the deck")
if culled:
    file = re.search(r'ave/time.* file "(.*)"', deck)[1]
    open(file, "w").write("# Time-averaged data\\n# TimeStep\\n" + "".join(f"{s} 5 3 12 1 .1 20 8 2 .5 .4 0 0\\n" for s in (10, 20)))
final = re.search(r'write_dump all custom "(.*?)"', deck)[1]
rows = "".join(f"{i} 0.5 0.1 0 0 0\\n" for i in (3, 1, 2)[:2 if culled and "lossy" in deck else 3])
open(final, "w").write("ITEM: TIMESTEP\\n20\\nITEM: ATOMS id mass radius x y z \\n" + rows)
"""


class Folder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def write(self, name, text):
        (self.folder / name).write_text(text)
        return self.folder / name

    def refused(self, text, call, *args, **keywords):
        with self.assertRaises(twin.TwinError) as e:
            call(*args, **keywords)
        self.assertIn(text, str(e.exception))
        self.assertNotIn("\n", str(e.exception))


class Decks(Folder):
    def setUp(self):
        super().setUp()
        self.lines = twin.read_deck(self.write("in.deck", DECK))

    def made(self, culled, seed=None, lines=None):
        return twin.make_deck(lines or self.lines, "cull", culled, seed, "out/run-1")

    def test_the_fix_is_found_over_continued_lines(self):
        self.assertEqual(twin.cull_fix(self.lines), "cull")

    def test_the_fix_is_found_in_an_included_file(self):
        self.write("rest.in", "fix c2 all solid/cull\nrun 10\n")
        self.assertEqual(twin.cull_fix(twin.read_deck(self.write("in.outer", "units si\ninclude rest.in\n"))), "c2")

    def test_unculled_keeps_nothing_that_hangs_on_the_fix(self):
        live = [line for line in self.made(False) if not line.lstrip().startswith("#")]
        for gone in ("f_cull", "share", "mine", "region", "group", "unfix", "twin_counts"):
            self.assertFalse([line for line in live if gone in line], gone)
        self.assertIn("thermo_style custom step ke c_top", live)
        self.assertIn("dump d all custom 100 d.* id x", live)
        self.assertIn("variable size index 1", live)
        self.assertEqual(sum(line.startswith("run") for line in live), 2)

    def test_culled_is_the_deck_and_the_counts(self):
        made = self.made(True)
        self.assertTrue(set(self.lines) <= set(made))
        self.assertEqual(made.index("unfix twin_counts") + 1, made.index("unfix cull"))
        self.assertTrue(made[-1].startswith('write_dump all custom "out/run-1.final"'))

    def test_culled_takes_its_dependents_away_where_the_deck_does_not(self):
        tail = self.made(True, lines=self.lines[:-3])
        tail = tail[tail.index(f'print "{twin.TO_HERE}"'):]
        self.assertEqual(tail[1:-1], ["thermo_style one", "unfix twin_counts", "undump d", "region solid delete",
                                      "uncompute mine", "variable share delete", "unfix cull", "run 0"])

    def test_the_shift_stands_before_the_first_run_behind_the_fix(self):
        made = self.made(False, seed=twin.SEEDS[0])
        self.assertTrue(made[made.index("run 1000") - 1].startswith("set group all z"))
        self.assertEqual(sum("set group" in line for line in made), 3)

    def test_what_cannot_be_left_out_is_refused(self):
        lines = self.lines[:6] + ['if "${share} > 3" then "run 10"']
        self.refused("hangs on the solid/cull fix and cannot be left out: if", self.made, False, lines=lines)

    def test_refusals(self):
        self.refused("has no `fix ID group solid/cull` line", twin.cull_fix, ["run 10"], "in.deck")
        self.refused("has 2 solid/cull lines", twin.cull_fix, ["fix a all solid/cull", "fix b all solid/cull"])
        self.refused("cannot read the deck", twin.read_deck, self.folder / "none.in")
        made = self.made(False)
        twin.check_metrics(["c_top", "top:max", "ke", "KinEng:mean"], made)
        self.refused("height is not among the thermo columns of the deck without the fix: step, ke, c_top",
                     twin.check_metrics, ["height"], made)
        self.refused("f_cull[1] is not among", twin.check_metrics, ["f_cull[1]"], made)
        self.refused("`median` is not one of end, max, min, mean", twin.check_metrics, ["ke:median"], made)


class Logs(Folder):
    tables = twin.parse_log(LOG)

    def test_tables(self):
        self.assertEqual([len(t.rows) for t in self.tables], [1, 3, 2, 1])
        self.assertEqual([t.counted for t in self.tables], [False, True, True, False])
        self.assertEqual(sum(t.loop_time for t in self.tables if t.counted), 4.0)

    def test_reducers(self):
        for metric, value in {"ke": 2, "KinEng:max": 4, "c_top:min": 0.4, "top:mean": 1.7 / 3}.items():
            self.assertAlmostEqual(twin.metric_of(self.tables, metric), value, msg=metric)

    def test_a_row_that_a_run_repeats_does_not_count(self):
        self.assertEqual(twin.metric_of(self.tables, "f_wall[3]:max"), 5)

    def test_a_log_that_breaks_off(self):
        self.assertEqual(len(twin.parse_log(LOG[:LOG.index("     200")])), 2)

    def test_refusals(self):
        self.refused("c_height is not among the thermo columns printed after the solid/cull line: Step, KinEng, top, wall[3]",
                     twin.metric_of, self.tables, "c_height")
        self.refused("line: none", twin.metric_of, [], "ke")
        self.assertEqual(twin.error_in("WARNING: x\nERROR: first\nERROR: last (a.cpp:3)\nmpirun noise\n"), "ERROR: last (a.cpp:3)")
        self.assertEqual(twin.error_in("Segmentation fault\n\n"), "Segmentation fault")


class Figures(unittest.TestCase):
    def judged(self, unculled, culled, **more):
        runs = [[twin.Run("r", [], 1.0, metrics={"m": v}) for v in values] for values in (unculled, culled)]
        return twin.judge(*runs, margin=0.02, **more)["metrics"]["m"]

    def test_margin_is_the_larger_of_two_percent_and_the_floor(self):
        self.assertTrue(self.judged([1.0, 1.0, 1.0], [1.019])["good"])
        self.assertFalse(self.judged([1.0, 1.0, 1.0], [1.021])["good"])
        m = self.judged([0.9, 1.0, 1.1], [1.1])
        self.assertTrue(m["good"])
        self.assertAlmostEqual(m["of_spread"], 0.5)

    def test_several_culled_runs_are_judged_by_their_mean(self):
        m = self.judged([1.0, 1.0], [0.97, 1.03])
        self.assertTrue(m["good"])
        self.assertAlmostEqual(m["worst"], 0.03)

    def test_ledger(self):
        kind = [("id", int), ("mass", float)]
        a = np.array([(1, 0.5), (2, 0.5), (3, 0.25)], kind)
        self.assertEqual(twin.ledger(a, [a[[0, 2]]]),
                         {"granules": 3, "lost": 1, "ids_missing": 1, "mass": 1.25, "mass_lost": 0.5})
        self.assertIsNone(twin.ledger(a, [a, None]))


class Command(Folder):
    def setUp(self):
        super().setUp()
        self.launcher = self.write("launcher", FAKE)
        self.launcher.chmod(self.launcher.stat().st_mode | stat.S_IXUSR)

    def run_twin(self, deck, *options):
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            status = twin.main([str(self.write("in.deck", deck)), "--launcher", str(self.launcher), *options])
        return status, out.getvalue(), err.getvalue()

    DECK = "fix cull all solid/cull\nthermo_style custom step v_depth\nrun 20\n"

    def test_table_and_files(self):
        status, out, _ = self.run_twin(self.DECK, "--metrics", "v_depth", "--plot")
        self.assertEqual(status, 0, out)
        self.assertIn("speed-up 2.50", out)
        self.assertIn("exterior 5, interface 3, interior 12", out)
        self.assertIn("lost 0, ids missing 0", out)
        self.assertRegex(out, r"v_depth +1\.00667 +1\.001 .* good")
        for file in ("twin.json", "twin.png", "culled-1.in", "unculled-3.log"):
            self.assertTrue((self.folder / "in.deck.twin" / file).exists(), file)

    def test_a_lost_granule_is_no_success(self):
        status, out, _ = self.run_twin(self.DECK + "# lossy\n", "--metrics", "v_depth")
        self.assertEqual(status, 1)
        self.assertIn("lost 1, ids missing 1, mass lost 0.5 of 1.5 kg", out)

    def test_errors_are_one_line(self):
        for deck, options, text in (
                ("run 10\n", (), "twin: in.deck has no `fix ID group solid/cull` line"),
                ("read_restart missing\n" + self.DECK, (), "unculled-1: LIGGGHTS stopped with status 1: ERROR: Cannot open restart"),
                (self.DECK, ("--metrics", "c_nope"), "c_nope is not among the thermo columns"),
                (self.DECK, ("--launcher", "/nowhere/liggghts-solidcull"), "no launcher at /nowhere/liggghts-solidcull"),
                (self.DECK, ("--vary", "dx=0,1"), "--vary dx has 2 values for 3 runs")):
            status, out, err = self.run_twin(deck, *options)
            self.assertEqual((status, out), (2, ""), text)
            self.assertIn(text, err)
            self.assertEqual(err.count("\n"), 1, err)

    def test_runs_that_are_all_alike_are_named(self):
        _, out, _ = self.run_twin(self.DECK, "--metrics", "v_depth", "--vary", "dx=0,1,2")
        self.assertIn("the unculled runs are all alike", out)


class Pictures(Folder):
    def vtp(self, split):
        def block(values):
            data = np.asarray(values).tobytes()
            head = np.uint64(len(data)).tobytes()
            encode = base64.b64encode
            return (encode(head) + encode(data) if split else encode(head + data)).decode()

        def array(name, kind, values, width=1):
            return f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{width}" format="binary">{block(values)}</DataArray>'

        return self.write("bed.100.vtp", f"""<?xml version="1.0"?>
<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64"><PolyData>
<Piece NumberOfPoints="3" NumberOfPolys="1">
<PointData>{array("radius", "Float32", np.float32([1, 2, 3]))}{array("state", "Int32", np.int32([0, 1, 2]))}</PointData>
<Points>{array("Points", "Float32", np.float32([0, 0, 0, 5, 0, 0, 0, 5, 0]), 3)}</Points>
<Polys>{array("connectivity", "Int64", np.int64([0, 1, 2]))}{array("offsets", "Int64", np.int64([3]))}</Polys>
</Piece></PolyData></VTKFile>""")

    def test_vtp_is_read_in_both_layouts(self):
        for split in (False, True):
            bed = pictures.read_vtp(self.vtp(split))
            self.assertEqual(bed["points"].tolist(), [[0, 0, 0], [5, 0, 0], [0, 5, 0]])
            self.assertEqual(bed["radius"].tolist(), [1, 2, 3])
            self.assertEqual(bed["polys"].tolist(), [[0, 1, 2]])

    def test_steps_of_files(self):
        self.vtp(False)
        self.assertEqual(pictures.steps_of(self.folder / "bed.*.vtp"), [100])

    def test_nearer_granules_hide_others(self):
        bed = {"points": np.array([[5.0, 2, 5], [5, 8, 5]]), "radius": np.array([1.0, 1]), "state": np.array([1, 2])}
        picture = pictures.Picture((0, 0, 0), (10, 10, 10), pixels=40, turn=0, tilt=0)
        picture.spheres(bed["points"], bed["radius"], [pictures.STATES[s][1] for s in bed["state"]])
        red, green, blue = picture.image[20, 20]
        self.assertGreater(blue, green)


if __name__ == "__main__":
    unittest.main()
