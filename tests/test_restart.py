"""Restart files written while granules are culled, read by decks of every order: right, or refused in one line.

SOLIDCULL_ALL_RANKS=1: each order with each number of ranks that writes and that reads, from 1 to 4.
"""
import itertools
import os
import re
import tempfile
import unittest
from pathlib import Path

from test_messages import BLOCK, CULL_BLOCK, MATERIAL, Case

RANKS = (1, 2, 3, 4)
ALL = bool(os.environ.get("SOLIDCULL_ALL_RANKS"))
SOME = ((1, 1), (2, 2), (1, 3), (4, 1))
DIAMETER = 0.003

WALLS = "".join(f"fix {d}{k} all wall/gran model hertz tangential history primitive type 1 {d}plane {x}\n"
                for d in "xy" for k, x in enumerate((0, 0.021)))
PAIR = "pair_style gran model hertz tangential history\npair_coeff * *\ntimestep 2e-5\n"
MOTION = "fix grav all gravity 9.81 vector 0 0 -1\nfix integrate all nve/sphere\nthermo_modify lost error norm no\n" \
         "fix floor all wall/gran model hertz tangential history primitive type 1 zplane 0\n"
# number 344 strikes the block some 40 steps after the file was written
BALL = "create_atoms 1 single 0.0105 0.0105 0.028 units box\ngroup ball id > 343\nset group ball diameter 0.003 density 2500\n" \
       "velocity ball set 0 0 -1.5\n"
BEFORE, AFTER = 150, 300
GRANULES = 344
END = 'unfix cull\nrun 0\nwrite_dump all custom end id type radius x y z vx vy vz modify format "%d %d %.17g %.17g %.17g %.17g %.17g %.17g %.17g"\n'


def head(file):
    return BLOCK[:BLOCK.index("region box")] + f"read_restart {file}\nneighbor 0.0004 bin\nneigh_modify delay 0\n"


def resumed(file, *lines):
    """A deck that reads the file and goes on; `lines`: from the physics on."""
    return head(file) + MATERIAL + PAIR + MOTION + WALLS + "".join(lines)


def state(text):
    rows = [line.split() for line in text.splitlines()]
    start = next(k for k, row in enumerate(rows) if row[:2] == ["ITEM:", "ATOMS"]) + 1
    return {int(row[0]): [float(x) for x in row[1:]] for row in rows[start:]}


class Restart(Case):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory(prefix="solidcull-restart-")
        cls.place = Path(cls.folder.name)
        cls.files, cls.interior = {}, {}

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def file(self, ranks):
        """Written while culled, by so many ranks."""
        if ranks not in self.files:
            file = self.place / f"stop-{ranks}.restart"
            run = self.accepted(BLOCK + BALL + f"{CULL_BLOCK}\nrun {BEFORE}\nwrite_restart {file}\n", ranks=ranks)
            told = re.findall(r"the restart file holds (\d+) interior granules besides the atoms: .* same ID", run.screen)
            self.assertEqual(len(told), 1, run.screen[-1000:])
            self.assertGreater(int(told[0]), 50)
            self.files[ranks], self.interior[ranks] = file, int(told[0])
        return self.files[ranks]

    def end_of(self, text, ranks):
        with tempfile.TemporaryDirectory(dir=self.place) as folder:
            end = Path(folder) / "end"
            self.accepted(text.replace("custom end", f"custom {end}"), ranks=ranks)
            return state(end.read_text())

    def straight(self):
        if not hasattr(Restart, "whole"):
            Restart.whole = self.end_of(BLOCK + BALL + f"{CULL_BLOCK}\nrun {BEFORE}\nrun {AFTER}\n" + END, 1)
        return self.whole

    def goes_on(self, deck_of, cases, more=0):
        """All granules are where they are without the stop."""
        for written, read in itertools.product(RANKS, RANKS) if ALL else cases:
            with self.subTest(written_on=written, read_on=read):
                end, straight = self.end_of(deck_of(self.file(written)), read), self.straight()
                self.assertEqual(len(end), GRANULES + more)
                self.assertLessEqual(set(straight), set(end))
                for tag, row in straight.items():
                    self.assertEqual(row[:2], end[tag][:2])
                    for x, y in zip(row[2:5], end[tag][2:5]):
                        self.assertLess(abs(x - y), 1e-6 * DIAMETER, f"granule {tag}")

    def refuses(self, deck_of, line, cases):
        for written, read in itertools.product(RANKS, RANKS) if ALL else cases:
            with self.subTest(written_on=written, read_on=read):
                file = self.file(written)
                self.refused_by_fix(deck_of(file), line.format(interior=self.interior[written]), ranks=read)

    UNCLAIMED = "the restart file holds {interior} granules of this fix besides the atoms, and they would be lost now: put " \
                "'fix cull GROUP solid/cull ...' right after read_restart and the pair_style"

    def test_the_ball_strikes_after_the_stop(self):
        self.assertEqual(len(self.straight()), GRANULES)
        self.assertGreater(self.straight()[max(self.straight())][7], -1.4)

    def test_the_fix_follows_read_restart(self):
        self.goes_on(lambda file: resumed(file, f"{CULL_BLOCK}\nrun {AFTER}\n", END), itertools.product(RANKS, RANKS))

    def test_a_file_of_a_store_that_knows_no_places(self):
        none = CULL_BLOCK + " store none restore refill"
        for written, read in SOME:
            with self.subTest(written_on=written, read_on=read):
                file = self.place / f"none-{written}.restart"
                self.accepted(BLOCK + BALL + f"{none}\nrun {BEFORE}\nwrite_restart {file}\n", ranks=written)
                end = self.end_of(resumed(file, f"{none}\nrun {AFTER}\n", END), read)
                self.assertEqual(sorted(end), sorted(self.straight()))
                self.refused_by_fix(resumed(file, f"{CULL_BLOCK}\nrun 0\n"),
                                    "the restart file was written with 'store none': read it with that store", ranks=read)
        self.refused_by_fix(resumed(self.file(1), f"{none}\nrun 0\n"),
                            "the restart file was written with 'store exact' or 'compact': read it with that store")

    def test_a_file_of_fixed_bodies_read_as_rigid_ones(self):
        for ranks in (1, 2):
            with self.subTest(ranks=ranks):
                file = self.place / f"fixed-{ranks}.restart"
                self.accepted(BLOCK + f"{CULL_BLOCK} motion fixed\nrun {BEFORE}\nwrite_restart {file}\n", ranks=ranks)
                end = self.end_of(resumed(file, f"{CULL_BLOCK}\nrun {AFTER}\n", END), ranks)
                self.assertEqual(sorted(end), list(range(1, GRANULES)))
                for tag, row in end.items():
                    self.assertTrue(0 < row[4] < 0.0211, f"granule {tag} is at height {row[4]}")

    def test_an_insertion_before_the_fix_line(self):
        insertion = "fix t1 all particletemplate/sphere 15485863 atom_type 1 density constant 2500 radius constant 0.0015\n" \
                    "fix dist all particledistribution/discrete 32452843 1 t1 1\n" \
                    "region above block 0.002 0.006 0.002 0.006 0.05 0.058 units box\n" \
                    "fix ins all insert/pack seed 32452867 distributiontemplate dist maxattempt 50 insert_every once " \
                    "overlapcheck yes all_in yes vel constant 0 0 0 region above particles_in_region 1\n"
        self.goes_on(lambda file: resumed(file, insertion, f"{CULL_BLOCK}\nrun {AFTER}\n", END), SOME, more=1)

    def test_atoms_made_after_the_first_run(self):  # LIGGGHTS allows none before, after read_restart
        made = "create_atoms 1 single 0.003 0.003 0.055 units box\ngroup made id > 344\nset group made diameter 0.003 density 2500\n"
        self.goes_on(lambda file: resumed(file, f"{CULL_BLOCK}\nrun 0\n", made, f"run {AFTER}\n", END), SOME, more=1)

    def test_another_file_before_the_first_run(self):
        def by_way_of(file):
            again = file.with_name("again-" + file.name)
            self.accepted(resumed(file, f"{CULL_BLOCK}\nwrite_restart {again}\n"), ranks=2)
            return resumed(again, f"{CULL_BLOCK}\nrun {AFTER}\n", END)

        self.goes_on(by_way_of, SOME)

    def test_a_run_before_the_fix_line(self):
        self.refuses(lambda file: resumed(file, f"run 0\n{CULL_BLOCK}\nrun 10\n"), self.UNCLAIMED, SOME)

    def test_no_fix_line(self):
        self.refuses(lambda file: resumed(file, "run 10\n"), self.UNCLAIMED, SOME)

    def test_a_fix_of_another_name(self):
        self.refuses(lambda file: resumed(file, f"{CULL_BLOCK.replace('fix cull', 'fix other')}\nrun 10\n"), self.UNCLAIMED, SOME)

    def test_a_fix_that_goes_before_a_run(self):
        self.refuses(lambda file: resumed(file, f"{CULL_BLOCK}\nunfix cull\nrun 10\n"),
                     "the granules that the restart file holds besides the atoms would be lost: put a run, or 'run 0', before "
                     "'unfix cull'", SOME)

    def test_commands_that_would_see_a_part_of_the_bed(self):
        late = "the granules that the restart file holds besides the atoms come with the first run: put 'run 0' before {}"
        for command, named in (("group left region L\n", "'group'"), ("velocity all set 0 0 0\n", "'velocity'"),
                               ("set group all density 2500\n", "'set'"), ("delete_atoms region L\n", "'delete_atoms'"),
                               ("variable n equal count(all)+1\nprint \"$n\"\n", "the variable 'count(all)+1'")):
            region = "region L block INF 0.01 INF INF INF INF units box\n"
            self.refuses(lambda file, c=command: resumed(file, f"{region}{CULL_BLOCK}\n{c}run 10\n"), late.format(named), ((2, 1),))
            self.refuses(lambda file, c=command: resumed(file, f"{region}{c}{CULL_BLOCK}\nrun 10\n"),
                         self.UNCLAIMED + f", and 'run 0' before {named}", ((1, 2),))

    def test_commands_after_the_first_run_see_the_whole_bed(self):
        seen = f"{CULL_BLOCK}\nrun 0\nvariable n equal count(all)\nif \"$n != {GRANULES}\" then \"print 'wrong'\" \"quit\"\n"
        self.goes_on(lambda file: resumed(file, seen, f"group low id < 100\nset group low density 2500\nrun {AFTER}\n", END),
                     ((1, 1), (2, 3)))

    def test_a_file_without_culled_granules_needs_no_fix(self):
        file = self.place / "whole.restart"
        self.accepted(BLOCK + f"{CULL_BLOCK}\nrun 0\nwrite_restart {file}\n")
        self.accepted(resumed(file, "run 10\n"))

    def test_damaged_files(self):
        whole = self.file(1).read_bytes()
        at = whole.index(b"solid/cull\0") + len(b"solid/cull\0") + 4  # the state begins after its size
        for k, place in enumerate([at, at + 6, at + 8 * 20, at + 8 * 1000, at + 8 * 5000]):
            with self.subTest(byte=place - at):
                broken = bytearray(whole)
                broken[place] ^= 0x55
                file = self.place / f"broken-{k}.restart"
                file.write_bytes(broken)
                self.refused_by_fix(resumed(file, f"{CULL_BLOCK}\nrun 10\n"),
                                    "the restart file is damaged where it holds this fix's granules: use another one")


if __name__ == "__main__":
    unittest.main()
