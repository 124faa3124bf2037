"""solidcull-bed: the bed that it makes, wrong values, and what is left where it is stopped."""
import contextlib
import io
import os
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT))
from solidcull_runs import engine, errors, logs  # noqa: E402
from solidcull_runs.beds_on_demand import command, plan  # noqa: E402
from solidcull_runs.dumps import read_final  # noqa: E402
from solidcull_runs.laid import culled_files  # noqa: E402

PROGRAM = ROOT / "fix_solid_cull" / "solidcull-bed"
MATERIAL = ROOT / "validation" / "beds" / "material.in"
# tiles of 4 x 3, of some 300 granules each
BOX = [0.0912, 0.0700]
GIVEN = {"--box": [str(b) for b in BOX], "--depth": ["0.0112"], "--sizes": ["0.0012:0.5,0.0014:0.5"], "--density": ["2500"],
         "--material": [str(MATERIAL)], "--tile": ["8"]}


def words(out, **changed):
    given = {**GIVEN, **{f"--{name}": value for name, value in changed.items()}}
    return [str(out), *(word for name, values in given.items() if values is not None for word in [name, *values])]


class Made(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.place = Path(cls.enterClassContext(tempfile.TemporaryDirectory(prefix="solidcull-bed-")))
        cls.out = cls.place / "bed.restart"
        # killed as soon as the tile is there, then called again
        child = subprocess.Popen([PROGRAM, *words(cls.out)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        until = time.monotonic() + 60
        while not (cls.place / "bed.pieces" / "tile.recipe").exists() and child.poll() is None and time.monotonic() < until:
            time.sleep(0.05)
        child.send_signal(signal.SIGKILL)
        child.wait()
        cls.left = sorted(p.name for p in cls.place.iterdir())
        cls.tile_made = (cls.place / "bed.pieces" / "tile.restart").stat().st_mtime_ns
        done = subprocess.run([PROGRAM, *words(cls.out)], text=True, capture_output=True, timeout=120, check=False)
        cls.said, cls.status, cls.complaint = done.stdout, done.returncode, done.stderr
        cls.ran = engine.run_liggghts(cls.place / "bed.in", cls.place, cls.place / "run.log")
        ends = "run 20\nthermo_style custom step atoms\nunfix cull\nrun 0\nwrite_dump all custom end.dump id mass radius x y z modify format " \
            '"%d %.15g %.15g %.15g %.15g %.15g"\n'
        (cls.place / "end.in").write_text((cls.place / "bed.in").read_text().replace("run ${steps}\n", ends))
        engine.run_liggghts(cls.place / "end.in", cls.place, cls.place / "end.log")
        cls.bed = read_final(cls.place / "end.dump")

    def facts(self):
        return dict(line.split("  ", 1) for line in (self.place / "bed.txt").read_text().splitlines())

    def test_a_killed_call_leaves_pieces_alone_and_the_next_goes_on(self):
        self.assertEqual(self.left, ["bed.pieces"])
        self.assertEqual(self.status, 0, self.complaint)
        self.assertEqual((self.place / "bed.pieces" / "tile.restart").stat().st_mtime_ns, self.tile_made)
        self.assertNotIn("making tile", self.said)
        self.assertIn("laying 4 x 3 tiles", self.said)
        self.assertTrue({"bed.restart", "bed.in", "bed.floor.stl", "bed.txt"} <= {p.name for p in self.place.iterdir()})
        self.assertEqual(list(self.place.glob("*.part")) + list((self.place / "bed.pieces").glob("*.part")), [])

    def test_ids_are_unique_and_complete(self):
        count = int(self.facts()["granules"])
        self.assertEqual(count % 12, 0)
        np.testing.assert_array_equal(self.bed["id"], np.arange(1, count + 1))
        self.assertEqual(set(np.round(self.bed["radius"], 6)), {0.0012, 0.0014})

    def test_the_box_is_exactly_what_was_asked(self):
        text = (self.place / "bed.in").read_text()
        for axis, side in zip("xy", BOX):
            self.assertIn(f"{axis}plane {side:.12g}\n", text)
            r = self.bed["radius"]
            pressed = [(r - self.bed[axis]).max(), (r - (side - self.bed[axis])).max()]
            for overlap in pressed:  # it stands against both, and in none
                self.assertGreater(overlap, 0)
                self.assertLess(overlap, 0.02 * 0.0014)
        tops = float(self.facts()["mean height of the surface (m)"])
        self.assertAlmostEqual(tops, 0.0112, delta=0.05 * 0.0112)

    def test_its_deck_runs_and_the_bed_stays_asleep(self):
        table = [t for t in logs.parse_log(self.ran) if "onfloor" in t.columns][-1]
        rows = [dict(zip(table.columns, row)) for row in table.rows]
        self.assertEqual(rows[-1]["Step"] - rows[0]["Step"], 1000)
        count = int(self.facts()["granules"])
        for row in rows:
            self.assertLessEqual(row["cull[1]"], 0.001 * count)
            self.assertEqual(row["cull[1]"] + row["cull[2]"] + row["cull[3]"], count)
        weight = float(self.facts()["weight (N)"])
        self.assertAlmostEqual(weight, self.bed["mass"].sum() * 9.81, delta=1e-4 * weight)
        self.assertAlmostEqual(rows[-1]["onfloor"], rows[1]["onfloor"], delta=0.001 * weight)
        self.assertAlmostEqual(rows[-1]["onfloor"], weight, delta=0.05 * weight)

    def test_the_file_is_culled(self):
        section = culled_files.Section(self.out)
        self.assertEqual(section.interior + section.interface, len(self.bed))

    def test_the_same_call_makes_no_piece_again(self):
        before = self.out.stat().st_ino
        done = subprocess.run([PROGRAM, *words(self.out)], text=True, capture_output=True, timeout=60, check=True)
        self.assertNotIn("making", done.stdout)
        self.assertNotEqual(self.out.stat().st_ino, before)

    def test_a_small_box_is_poured_whole(self):
        out = self.place / "small.restart"
        done = subprocess.run([PROGRAM, *words(out, box=["0.024", "0.024"], depth=None, granules=["500"])], text=True, capture_output=True, timeout=60,
                              check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("the box is smaller than 3 tiles a side", done.stdout)
        self.assertRegex((self.place / "small.txt").read_text(), r"granules +500\n")
        table = [t for t in logs.parse_log(engine.run_liggghts(self.place / "small.in", self.place, self.place / "small.log")) if "onfloor" in t.columns][-1]
        self.assertEqual(table.rows[-1][table.columns.index("cull[1]")], 0)


class Refused(unittest.TestCase):
    def setUp(self):
        self.place = Path(self.enterContext(tempfile.TemporaryDirectory(prefix="solidcull-bed-")))

    def said(self, **changed):
        out = self.place / changed.pop("out", "bed.restart")
        err = io.StringIO()
        with contextlib.redirect_stderr(err), contextlib.redirect_stdout(io.StringIO()):
            status = errors.status_of(command.NAME, lambda: command.main(words(out, **changed)))
        self.assertEqual(status, 2)
        self.assertEqual(err.getvalue().count("\n"), 1, err.getvalue())
        self.assertEqual([p for p in self.place.iterdir() if p.name != "material.in"], [])
        return err.getvalue()

    def test_values(self):
        for changed, line in (
                ({"box": ["0.01", "0.6"]}, "--box 0.01 0.6: 0.01 m is narrower than 8 of the largest diameters"),
                ({"box": ["silo.stl", "1"]}, "--box silo.stl 1: give two lengths in m. Containers of other shapes, such as STL files, are not made: pour"),
                ({"box": ["-1", "1"]}, "--box -1: it must be more than 0 m"),
                ({"box": None}, "--box is missing"),
                ({"depth": ["0.001"]}, "--depth 0.001: the bed would be 0.001 m deep"),
                ({"depth": None}, "one of the arguments --depth --granules is required"),
                ({"depth": ["nan"]}, "--depth nan: it must be more than 0 m"),
                ({"granules": ["900"]}, "not allowed with argument"),
                ({"sizes": ["0.0012;0.5"]}, "--sizes 0.0012;0.5: write radius:share"),
                ({"sizes": ["0.0012:0.5,0.0012:0.5"]}, "a radius stands there twice"),
                ({"sizes": ["0.0012:0"]}, "radii and shares must be more than 0"),
                ({"sizes": ["0.0001:0.5,0.0014:0.5"]}, "more than 4 times the smallest one"),
                ({"density": ["0"]}, "--density 0: it must be more than 0 kg/m3"),
                ({"seed": ["0"]}, "--seed 0: it must be 1 to 1000000"),
                ({"tile": ["3"]}, "--tile 3: a tile of fewer than 8 diameters"),
                ({"top": ["0.01"]}, "--top 0.01: it must be above the bed"),
                ({"launcher": ["/nowhere"]}, "no launcher at /nowhere"),
                ({"out": "bed"}, "the file's name must end with .restart"),
                ({"out": "no/bed.restart"}, "make it first"),
                ({"out": "my bed.restart"}, "leave out blanks"),
                ({"material": [str(self.place / "gone.in")]}, "cannot be read (No such file or directory)")):
            with self.subTest(line):
                self.assertIn(line, self.said(**changed))

    def test_material_files(self):
        file, good = self.place / "material.in", MATERIAL.read_text()
        for old, new, line in (("timestep 3e-5", "", "has no line `timestep SECONDS`"),
                               ("timestep 3e-5", "timestep 0", "timestep 0; it must be more than 0"),
                               ("pair_style gran", "pair_style none", "has no line `pair_style gran ...`"),
                               ("vector 0 0 -1", "vector 0 1 -1", "beds are made under gravity along 0 0 -1"),
                               ("gravity 9.81", "gravity ${g}", "is not four numbers"),
                               ("variable contact", "variable model", "has no line `variable contact string"),
                               ("peratomtype 5.e6", "peratomtype x", "youngsModulus peratomtype")):
            with self.subTest(line):
                file.write_text(good.replace(old, new))
                self.assertIn(line, self.said(material=[str(file)]))

    def test_seeds_are_primes(self):
        self.assertEqual([plan.prime_above(n) for n in (13, 14, 100000)], [17, 17, 100003])


if __name__ == "__main__":
    os.environ.setdefault("SOLIDCULL_LAUNCHER", engine.find_launcher())
    unittest.main()
