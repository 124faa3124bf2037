"""The files of `bed` and `mesh`, as a viewer finds them: times, names, what can be seen, closed meshes; on one, two and four ranks."""
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import types
import unittest
import unittest.mock
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT))
from solidcull_runs import cutaways, engine, errors, orientations, vtp  # noqa: E402

POINTS_AS_TEXT = ROOT / "build/tests/unit/points_as_text"
LAUNCHER = Path(os.environ.get("SOLIDCULL_LAUNCHER", ROOT / "build/liggghts-solidcull")).resolve()
D, STEP = 0.003, 2e-5  # m (mean), s
SIDE, TOP = 0.03, 0.12  # m
POURED = 1200
GRANULES = POURED + 1
MATERIAL = """\
fix m1 all property/global youngsModulus peratomtype 5.e6
fix m2 all property/global poissonsRatio peratomtype 0.3
fix m3 all property/global coefficientRestitution peratomtypepair 1 0.3
fix m4 all property/global coefficientFriction peratomtypepair 1 0.5
pair_style gran model hertz tangential history
pair_coeff * *
timestep 2e-5
fix grav all gravity 9.81 vector 0 0 -1
fix floor all wall/gran model hertz tangential history primitive type 1 zplane 0
"""
SIDES = "".join(f"fix {d}{k} all wall/gran model hertz tangential history primitive type 1 {d}plane {x}\n" for d in "xy" for k, x in enumerate((0, SIDE)))
HEAD = "atom_style granular\natom_modify map array\nboundary f f f\nnewton off\ncommunicate single vel yes\nunits si\nprocessors * * 1\n"
TAIL = "fix integrate all nve/sphere\nthermo_modify lost error norm no\nneigh_modify delay 0\n"
POUR = HEAD + f"region box block 0 {SIDE} 0 {SIDE} -0.001 {TOP} units box\ncreate_box 1 box\nneighbor 0.0004 bin\n" + MATERIAL + SIDES + f"""\
fix t1 all particletemplate/sphere 15485863 atom_type 1 density constant 2500 radius constant 0.0014
fix t2 all particletemplate/sphere 15485867 atom_type 1 density constant 2500 radius constant 0.0016
fix dist all particledistribution/discrete 32452843 2 t1 0.5 t2 0.5
region pour block 0 {SIDE} 0 {SIDE} 0.001 {TOP - 0.01} units box
fix ins all insert/pack seed 32452867 distributiontemplate dist maxattempt 200 insert_every once overlapcheck yes all_in yes &
  vel constant 0 0 -0.5 region pour particles_in_region {POURED}
""" + TAIL + """\
run 1
unfix ins
run 8000
fix drag all viscous 0.002
run 4000
unfix drag
reset_timestep 0
write_restart bed.restart
"""
# a bed at rest, and a granule that falls towards it; all but that one is soon asleep
MADE = HEAD + "read_restart bed.restart\nneighbor 0.0004 bin\n" + MATERIAL + SIDES + f"""\
run 0
create_atoms 1 single {SIDE / 2} {SIDE / 2} 0.1 units box
group new id {GRANULES}
set group new diameter {D} density 2500
set group new vx 0 vy 0 vz 0
""" + TAIL
SLEEP = "fix cull all solid/cull every 10 calm 1 speed 0.5 tolerance 30 0"
LIVE = SLEEP + " exterior live depth 1"


@unittest.skipUnless(LAUNCHER.exists(), f"no {LAUNCHER}: build it, or name it in SOLIDCULL_LAUNCHER")
class Pictures(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory(prefix="solidcull-")
        cls.addClassCleanup(folder.cleanup)
        cls.bed = Path(folder.name) / "bed.restart"
        cls.folder = Path(folder.name)
        cls.run_deck(cls(), POUR)

    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="solidcull-")
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        (self.folder / "bed.restart").symlink_to(self.bed)

    def run_deck(self, text, ranks=1):
        (self.folder / "deck.in").write_text(text)
        words = [str(LAUNCHER), "-in", "deck.in", "-log", "log", "-screen", "screen"]  # `none`: the insertion fixes of LIGGGHTS write to it all the same
        done = subprocess.run((["mpirun", "-np", str(ranks)] if ranks > 1 else []) + words, cwd=self.folder, env=engine.environment(ranks), timeout=200,
                              text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
        self.assertEqual(done.returncode, 0, done.stdout[-2000:] + (self.folder / "log").read_text(errors="replace")[-2000:])

    def read(self, name):
        return vtp.read(self.folder / name)

    def listed(self, name):
        return [(time, file.name) for time, file in vtp.frames(self.folder / name)]


class Files(Pictures):
    def test_times_and_names_and_ids(self):
        self.run_deck(MADE + SLEEP + " bed 100 bed.*.vtp spin mesh 200 mesh.*.vtp\nrun 200\n")
        names = [f"bed.{step:09d}.vtp" for step in (0, 100, 200)]
        self.assertEqual(sorted(f.name for f in self.folder.glob("bed.*.vtp")), names)
        for (time, name), step in zip(self.listed("bed.vtp.series"), (0, 100, 200)):
            bed = self.read(name)
            self.assertAlmostEqual(time, step * STEP, delta=1e-15)
            self.assertEqual(bed["time"], time)
            self.assertEqual(bed["id"].tolist(), list(range(1, GRANULES + 1)))
            self.assertEqual(bed["pscale"].tolist(), bed["radius"].tolist())
            self.assertTrue(np.isclose(bed["radius"][:, None], (0.0014, D / 2, 0.0016)).any(axis=1).all())
            self.assertEqual(bed["w"].shape, (GRANULES, 3))
        self.assertGreater((bed["state"] == 2).sum(), GRANULES / 2)
        asleep = (bed["state"] == 1) | (bed["state"] == 2)
        self.assertEqual((bed["awake"][asleep].max(), bed["woke"][asleep].max()), (0, 0))
        self.assertGreaterEqual(bed["awake"][bed["state"] == 0].min(), 1)
        self.assertGreater(bed["body"][bed["state"] == 2].min(), 0)
        self.assertEqual((bed["state"][-1], bed["body"][-1]), (0, 0))
        self.assertAlmostEqual(bed["v"][-1][2] / (-9.81 * bed["time"]), 1, delta=1e-3)
        self.assertEqual([name for _, name in self.listed("mesh.vtp.series")], ["mesh.000000000.vtp", "mesh.000000200.vtp"])
        self.assertEqual(list(self.folder.glob("*.part")), [])
        size = (self.folder / names[-1]).stat().st_size
        self.assertLess(size, 0.5 * 64 * GRANULES, "bytes: it is not compressed")

    def test_a_run_that_goes_on_keeps_the_times(self):
        files = " bed 50 bed.*.vtp seen\n"
        self.run_deck(MADE + SLEEP + files + "run 100\nwrite_restart at.restart\nrun 100\n")
        head = HEAD + "read_restart at.restart\nneighbor 0.0004 bin\n" + MATERIAL + SIDES + TAIL
        self.run_deck(head + SLEEP + files + "run 50\n")
        steps = (0, 50, 100, 150)
        self.assertEqual([name for _, name in self.listed("bed.vtp.series")], [f"bed.{s:09d}.vtp" for s in steps])
        for (time, name), step in zip(self.listed("bed.vtp.series"), steps):
            self.assertAlmostEqual(time, step * STEP, delta=1e-15)
            self.assertEqual(time, self.read(name)["time"])

    def test_points_of_vdb_are_those_of_vtp(self):
        for ranks, words in ((1, ""), (2, " seen")):
            with self.subTest(ranks):
                self.run_deck(MADE + SLEEP + f" bed 200 bed.*.vtp{words} bed 200 bed.*.vdb{words}\nrun 200\n", ranks)
                bed = self.read("bed.000000200.vtp")
                time, names, *rows = subprocess.run([POINTS_AS_TEXT, self.folder / "bed.000000200.vdb"], text=True, check=True, stdout=subprocess.PIPE).stdout.splitlines()
                self.assertEqual(float(time), bed["time"])
                self.assertEqual(names, "P awake body id pscale state type v woke")
                found = np.array([row.split() for row in rows], dtype=float)
                found = found[found[:, 0].argsort()]
                places = found[:, 1:4]
                self.assertLess(abs(places - bed["points"]).max(), 1e-6 * D)
                columns = [bed[name] for name in ("id", "pscale", "v", "type", "state", "awake", "woke", "body")]
                self.assertEqual(np.delete(found, (1, 2, 3), axis=1).astype(np.float32).tolist(), np.column_stack(columns).astype(np.float32).tolist())
                self.assertEqual([name for _, name in self.listed("bed.vdb.series")], ["bed.000000000.vdb", "bed.000000200.vdb"])
                self.assertEqual(list(self.folder.glob("*.part")), [])

    def test_the_list_is_json(self):
        self.run_deck(MADE + SLEEP + " mesh 50 mesh_*.stl\nrun 50\n")
        listed = json.loads((self.folder / "mesh.stl.series").read_text())
        self.assertEqual(listed, {"file-series-version": "1.0", "files": [{"name": "mesh_000000000.stl", "time": 0},
                                                                          {"name": "mesh_000000050.stl", "time": 50 * STEP}]})


def seen_in(bed, turn, tilt, pixels=260):
    """How many pixels of a picture show each granule."""
    low, high = bed["points"].min(axis=0) - D, bed["points"].max(axis=0) + D
    picture = cutaways.Picture(low, high, pixels, turn, tilt)
    picture.image[:] = -1
    numbers = np.repeat(np.arange(len(bed["id"]), dtype=float)[:, None], 3, axis=1)
    picture.put = lambda box, mask, depth, shade, colour: number(picture, box, mask, depth, colour)
    picture.spheres(bed["points"], bed["radius"].astype(float), numbers)
    shown = picture.image[:, :, 0].ravel().astype(int)
    return np.bincount(shown[shown >= 0], minlength=len(numbers))


def number(picture, box, mask, depth, colour):
    near = mask & (depth < picture.depth[box])
    picture.depth[box][near] = np.broadcast_to(depth, near.shape)[near]
    picture.image[box][near] = colour


class Seen(Pictures):
    FILES = " bed 200 whole.*.vtp bed 200 seen.*.vtp seen spin\nrun 200\n"
    LAST = "000000200.vtp"

    def both(self, deck, ranks=1):
        self.run_deck(deck + self.FILES, ranks)
        whole, seen = self.read("whole." + self.LAST), self.read("seen." + self.LAST)
        at = np.searchsorted(whole["id"], seen["id"])
        for name in ("id", "points", "v", "radius", "state", "type"):
            self.assertTrue((whole[name][at] == seen[name]).all(), name)
        left_out = np.delete(np.arange(len(whole["id"])), at)
        self.assertEqual(set(whole["state"][left_out]), {2}, "only stored granules are left out")
        return whole, seen, left_out

    def hidden(self, whole, left_out, views):
        """Of what pictures show, less than 1 % is left out, and of no granule a third: that is at the bottom of gaps."""
        self.assertGreater(len(left_out), 0.1 * GRANULES)
        pixels = np.array([seen_in(whole, *view) for view in views])
        self.assertLess(pixels[:, left_out].sum(), 0.01 * pixels.sum())
        self.assertLess((pixels[:, left_out].max(axis=1) / pixels.max(axis=1)).max(), 1 / 3)

    def test_what_is_left_out_cannot_be_seen(self):
        whole, _, left_out = self.both(MADE + SLEEP)
        self.hidden(whole, left_out, [(turn, tilt) for turn in (0, 30, 100, 200) for tilt in (0, 30, 90, -60)])

    def test_below_a_live_surface(self):
        whole, _, left_out = self.both(MADE + LIVE)
        self.hidden(whole, left_out, [(30, 30), (0, 90)])

    def test_on_any_number_of_ranks(self):
        one = self.both(MADE + SLEEP)
        for ranks in (2, 4):
            with self.subTest(ranks):
                whole, seen, _ = self.both(MADE + SLEEP, ranks)
                self.assertEqual(whole["id"].tolist(), one[0]["id"].tolist())
                stored = [set(bed["id"][bed["state"] == 2]) for bed in (one[0], whole)]
                both = stored[0] & stored[1]
                self.assertGreater(len(both), 0.4 * GRANULES)
                self.assertEqual(set(seen["id"]) & both, set(one[1]["id"]) & both)

    def test_through_periodic_sides(self):
        """LIGGGHTS takes the boundaries of a restart file, so this bed is poured anew."""
        self.run_deck(POUR.replace("boundary f f f", "boundary p p f").replace(SIDES, "").replace("bed.restart", "periodic.restart"))
        deck = MADE.replace("boundary f f f", "boundary p p f").replace(SIDES, "").replace("bed.restart", "periodic.restart")
        whole, seen, left_out = self.both(deck + SLEEP)
        inner = whole["points"][left_out]
        for d in (0, 1):
            self.assertTrue((inner[:, d] < D).any() and (inner[:, d] > SIDE - D).any(), "a side that goes on is no surface")
        self.assertGreater(inner[:, 2].min(), D)


def is_closed(mesh):
    """Each edge stands in one triangle, and the other way round in one other."""
    t = mesh["polys"].astype(np.int64)
    edges = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    there, back = (np.sort(e[:, 0] * len(mesh["points"]) + e[:, 1]) for e in (edges, edges[:, ::-1]))
    return bool((there == back).all() and (np.diff(there) > 0).all())


def volume(mesh):
    a, b, c = np.moveaxis(mesh["points"][mesh["polys"]], 1, 0)
    return np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6


class Meshes(Pictures):
    LAST = "000000200"

    def surface(self, name):
        mesh = self.read(f"{name}.{self.LAST}.vtp")
        self.assertTrue(is_closed(mesh), f"{name}: an edge has no triangle on its other side")
        self.assertGreater(volume(mesh), 0, f"{name}: it is turned inside out")
        self.assertNotIn("body", mesh)
        return mesh

    def test_one_surface_and_a_skin(self):
        for ranks in (1, 2):
            with self.subTest(ranks):
                self.run_deck(MADE + SLEEP + " mesh 200 s.*.vtp surface mesh 200 k.*.vtp skin mesh 200 g.*.vdb surface mesh 200 b.*.vdb "
                              "mesh 200 few.*.vtp surface least 2000\nrun 200\n", ranks)
                surface, skin = self.surface("s"), self.surface("k")
                ball = np.pi / 6 * D**3
                self.assertTrue(0.9 < volume(surface) / (POURED * ball / 0.6) < 1.1, volume(surface) / (POURED * ball / 0.6))
                self.assertTrue(1 < volume(skin) / volume(surface) < 1.02, volume(skin) / volume(surface))
                self.assertGreater(skin["points"][:, 2].max(), surface["points"][:, 2].max() + D)
                self.assertIn(b"surface", (self.folder / f"g.{self.LAST}.vdb").read_bytes())
                self.assertNotIn(b"body_", (self.folder / f"g.{self.LAST}.vdb").read_bytes())
                self.assertIn(b"body_", (self.folder / f"b.{self.LAST}.vdb").read_bytes())
                self.assertNotIn("polys", self.read(f"few.{self.LAST}.vtp"), "no body has so many granules")


class InBlender(Pictures):
    """What examples/blender asks of files and times; Blender itself is not asked."""

    def opened(self, **how):
        module = types.ModuleType("bpy")
        module.context = types.SimpleNamespace(scene=types.SimpleNamespace(render=types.SimpleNamespace(fps=1000, fps_base=1)))
        with unittest.mock.patch.dict(sys.modules, {"bpy": module}):
            spec = importlib.util.spec_from_file_location("granules", ROOT / "examples" / "blender" / "granules.py")
            granules = importlib.util.module_from_spec(spec)
            spec.loader.exec_module(granules)
        return granules.Bed(self.folder / "bed.vtp.series", **how)

    def test_between_two_files(self):
        self.run_deck(MADE + SLEEP + " bed 100 bed.*.vtp seen\nrun 200\n")
        bed = self.opened()
        self.assertEqual(bed.last_frame(), 5)
        self.assertEqual(self.opened(speed=0.5).last_frame(), 9)
        self.assertEqual(bed.time_of(3), 200 * 1e-5)
        for k, file in enumerate(sorted(self.folder.glob("bed.*.vtp"))):
            self.assertEqual(bed.at(k * 100 * STEP)["points"].tolist(), vtp.read(file)["points"].tolist())
        start, = bed.at(0)["points"][bed.at(0)["id"] == GRANULES]
        for time in (0.0007, 0.0015, 0.0033):
            at = bed.at(time)
            place, = at["points"][at["id"] == GRANULES]
            self.assertAlmostEqual(place[2] - start[2], -9.81 * time**2 / 2, delta=1e-8)

    def test_what_spins_is_turned(self):
        """A granule in the air spins evenly: at any time it is turned by its spin times that time."""
        spin = np.array((60.0, -20.0, 35.0))
        w = " ".join(f"omega{d} {s}" for d, s in zip("xyz", spin))
        self.run_deck(MADE.replace("set group new vx", f"set group new {w} vx") + SLEEP + " bed 100 bed.*.vtp spin\nrun 200\n")
        bed = self.opened()
        for time in (0.0033, 0.001, 0.004, 0.0):  # also backwards
            turned, = bed.orientations_at(time)[bed.at(time)["id"] == GRANULES]
            self.assertLess(abs(turned - orientations.by_vectors(time * spin[None])[0]).max(), 1e-6, time)

    def test_without_spins_it_is_said_how_to_have_them(self):
        self.run_deck(MADE + SLEEP + " bed 100 bed.*.vtp\nrun 100\n")
        with self.assertRaisesRegex(errors.RunError, "write them with the word 'spin'"):
            self.opened().orientations_at(0)


class Turned(unittest.TestCase):
    def matrix(self, quaternion):
        rotated = [orientations.times(orientations.times(quaternion[None], np.array([[0, *axis]])), quaternion[None] * (1, -1, -1, -1))[0, 1:] for axis in np.eye(3)]
        return np.array(rotated).T

    def test_angles_are_those_of_the_quaternion(self):
        rng = np.random.default_rng(3)
        for turn in rng.normal(size=(50, 3)):
            quaternion = orientations.by_vectors(turn[None])
            x, y, z = orientations.angles(quaternion)[0]
            about = [orientations.by_vectors(np.array([v])) for v in ((x, 0, 0), (0, y, 0), (0, 0, z))]
            whole = orientations.times(about[2], orientations.times(about[1], about[0]))[0]
            np.testing.assert_allclose(self.matrix(whole), self.matrix(quaternion[0]), atol=1e-12)

    def test_a_turn_turns_its_axis_not(self):
        turn = np.array([0.3, -1.1, 0.7])
        matrix = self.matrix(orientations.by_vectors(turn[None])[0])
        np.testing.assert_allclose(matrix @ turn, turn, atol=1e-12)
        self.assertAlmostEqual(np.trace(matrix), 1 + 2 * np.cos(np.linalg.norm(turn)), places=12)
        across = np.cross(turn, (1, 0, 0))  # and turns to the left about it
        self.assertGreater(np.cross(across, matrix @ across) @ turn, 0)

    def test_a_wheel_that_rolls_is_turned_by_its_way_and_one_that_was_not_seen_goes_on(self):
        wheel = orientations.Orientations()
        for time, spin, ids in ((0, 0, (5, 7)), (0.1, 2, (5,)), (0.3, 4, (5, 7))):  # rad/s; number 7 is not seen at 0.1 s
            turned = wheel.follow({"id": np.array(ids), "time": time, "w": np.tile((0.0, spin, 0.0), (len(ids), 1))})
        for row, angle in zip(turned, (0.1 * 1 + 0.2 * 3, 0.3 * 2)):
            np.testing.assert_allclose(row, (np.cos(angle / 2), 0, np.sin(angle / 2), 0), atol=1e-12)


if __name__ == "__main__":
    unittest.main()
