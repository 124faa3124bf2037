"""Restart files written while clumps are culled, read on other numbers of ranks: each clump is there once, whole, and moves on."""
import itertools
import tempfile
import unittest
from pathlib import Path

from test_messages import Case
from test_restart import state

CONTACT = "model hertz tangential history"
HEAD = "atom_style granular\natom_modify map array\nboundary f f f\nnewton off\ncommunicate single vel yes\nunits si\nprocessors * * 1\n"
PHYSICS = f"""neighbor 0.0005 bin
neigh_modify delay 0
fix m1 all property/global youngsModulus peratomtype 5e6
fix m2 all property/global poissonsRatio peratomtype 0.3
fix m3 all property/global coefficientRestitution peratomtypepair 1 0.3
fix m4 all property/global coefficientFriction peratomtypepair 1 0.5
pair_style gran {CONTACT}
pair_coeff * *
timestep 2e-5
fix grav all gravity 9.81 vector 0 0 -1
fix floor all wall/gran {CONTACT} primitive type 1 zplane 0
""" + "".join(f"fix {d}{k} all wall/gran {CONTACT} primitive type 1 {d}plane {x}\n" for d in "xy" for k, x in enumerate((0, 0.024)))
MOVE = "fix spheres all nve/sphere\nfix clumps all multisphere allow_group_and_set yes\nthermo 100000\nthermo_modify norm no lost ignore\n"
CLUMPS, SPHERES = 300, 900
POUR = f"""fix shape all particletemplate/multisphere 15485863 atom_type 1 density constant 2500 nspheres 3 ntry 50000 spheres &
  0 0 0 0.0012 0.0013 0 0 0.0010 0.0005 0.0011 0 0.0009 type 1
fix shapes all particledistribution/discrete 32452867 1 shape 1.0
region pour block 0.002 0.022 0.002 0.022 0.003 0.14 units box
fix pour all insert/pack seed 32452843 distributiontemplate shapes maxattempt 300 insert_every once overlapcheck yes all_in yes &
  orientation random vel constant 0 0 -1 region pour ntry_mc 10000 particles_in_region {CLUMPS}
"""
CULL = "fix cull all solid/cull every 50 exterior sleep depth 0\n"
# number 901 strikes the bed some 45 steps after the file was written. Not much later contacts open and close again: LIGGGHTS keeps
# their history until it builds its lists anew, and when that is hangs on the number of ranks.
BALL = f"create_atoms 1 single 0.012 0.012 0.036 units box\ngroup ball id > {SPHERES}\nset group ball diameter 0.006\n" \
       "set group ball density 2500\nvelocity ball set 0 0 -1.5\n"
BEFORE, AFTER = 600, 85
DIAMETER = 0.002  # m, of the smallest spheres, or nearly


class ClumpRestart(Case):
    @classmethod
    def setUpClass(cls):
        cls.place = tempfile.TemporaryDirectory(prefix="solidcull-restart-clumps-")
        cls.folder = Path(cls.place.name)
        cls.files = {}

    @classmethod
    def tearDownClass(cls):
        cls.place.cleanup()

    def bed(self):
        """Poured once, at rest."""
        bed = self.folder / "bed.restart"
        if not bed.exists():
            self.accepted(f"{HEAD}region box block -0.001 0.025 -0.001 0.025 -0.001 0.15 units box\ncreate_box 1 box\n{PHYSICS}{POUR}{MOVE}"
                          f"run 9000\nunfix pour\nfix slow all viscous 0.005\nrun 6000\nunfix slow\nrun 2000\nwrite_restart {bed}\n")
        return bed

    def struck(self):
        return f"{HEAD}read_restart {self.bed()}\n{PHYSICS}{MOVE}run 0\n{BALL}{CULL}run {BEFORE}\n"

    def file(self, ranks):
        """Written while culled, by so many ranks."""
        if ranks not in self.files:
            file = self.folder / f"stop-{ranks}.restart"
            run = self.accepted(f"{self.struck()}write_restart {file}\n", ranks=ranks)
            self.assertRegex(run.screen, r"the restart file holds [1-9]\d\d interior granules besides the atoms")
            self.files[ranks] = file
        return self.files[ranks]

    def end_of(self, text, ranks):
        with tempfile.TemporaryDirectory(dir=self.folder) as folder:
            end = Path(folder) / "end"
            self.accepted(f"{text}run {AFTER}\nunfix cull\nrun 0\nwrite_dump all custom {end} id mol radius x y z vx vy vz "
                          'modify format "%d %d %.17g %.17g %.17g %.17g %.17g %.17g %.17g"\n', ranks=ranks)
            return state(end.read_text())

    def test_clumps_go_on_on_other_ranks(self):
        straight = self.end_of(self.struck(), 1)
        self.assertEqual(len(straight), SPHERES + 1)
        self.assertGreater(straight[SPHERES + 1][7], -1.4, "the ball has struck")
        for written, read in itertools.permutations((1, 2, 4), 2):
            with self.subTest(written_on=written, read_on=read):
                end = self.end_of(f"{HEAD}read_restart {self.file(written)}\n{PHYSICS}{MOVE}{CULL}", read)
                self.assertEqual(set(end), set(straight))
                clumps = [row[0] for row in end.values() if row[0] > 0]
                self.assertEqual((len(clumps), len(set(clumps))), (SPHERES, CLUMPS))
                for tag, row in straight.items():
                    self.assertEqual(row[:2], end[tag][:2], f"clump and radius of sphere {tag}")
                    for x, y in zip(row[2:5], end[tag][2:5]):
                        self.assertLess(abs(x - y), 1e-9 * DIAMETER, f"place of sphere {tag}")


if __name__ == "__main__":
    unittest.main()
