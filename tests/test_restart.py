"""Restart files written while granules are culled, read by decks of every order: right, or refused in one line.

SOLIDCULL_ALL_RANKS=1: each order with each number of ranks that writes and that reads, from 1 to 4.
"""
import itertools
import os
import re
import shutil
import subprocess
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
        cls.files, cls.interior, cls.whole = {}, {}, {}

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

    def straight(self, between=""):
        """Without the stop; between: lines where it is otherwise."""
        if between not in self.whole:
            self.whole[between] = self.end_of(BLOCK + BALL + f"{CULL_BLOCK}\nrun {BEFORE}\n{between}run {AFTER}\n" + END, 1)
        return self.whole[between]

    def goes_on(self, deck_of, cases, more=0, straight=""):
        """All granules are where they are without the stop, and `more` that lines make at it."""
        for written, read in itertools.product(RANKS, RANKS) if ALL else cases:
            with self.subTest(written_on=written, read_on=read):
                end, without = self.end_of(deck_of(self.file(written)), read), self.straight(straight)
                self.assertEqual(len(end), GRANULES + more)
                self.assertEqual(set(without), set(end))
                for tag in range(1, GRANULES + 1):  # where an insertion puts a granule depends on the ranks
                    row = without[tag]
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

    def test_an_insertion_before_the_fix_line(self):
        insertion = "fix t1 all particletemplate/sphere 15485863 atom_type 1 density constant 2500 radius constant 0.0015\n" \
                    "fix dist all particledistribution/discrete 32452843 1 t1 1\n" \
                    "region above block 0.002 0.006 0.002 0.006 0.05 0.058 units box\n" \
                    "fix ins all insert/pack seed 32452867 distributiontemplate dist maxattempt 50 insert_every once " \
                    "overlapcheck yes all_in yes vel constant 0 0 0 region above particles_in_region 1\n"
        self.goes_on(lambda file: resumed(file, insertion, f"{CULL_BLOCK}\nrun {AFTER}\n", END), SOME, 1, insertion)

    def test_atoms_made_after_the_first_run(self):  # LIGGGHTS allows none before, after read_restart
        made = "create_atoms 1 single 0.003 0.003 0.055 units box\ngroup made id > 344\nset group made diameter 0.003 density 2500\n"
        self.goes_on(lambda file: resumed(file, f"{CULL_BLOCK}\nrun 0\n", made, f"run {AFTER}\n", END), SOME, 1, made)

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

    def copy(self, name, data):
        file = self.place / name
        file.write_bytes(data)
        return file

    def section(self, data):
        """Where what is culled begins in a restart file: its length stands in its end."""
        end, length = data[-72:], int.from_bytes(data[-56:-48], "little")
        self.assertEqual((end[:8], data[-length:][:8]), (b"SDCULLE1", b"SDCULLB1"))
        return len(data) - length

    def refused_file(self, name, data, line, ranks=1):
        file = self.copy(name, data)
        self.refused_by_fix(resumed(file, f"{CULL_BLOCK}\nrun 10\n"), line.format(file=file), ranks=ranks)

    DAMAGED = "the restart file {file} is damaged among the granules of this fix: use another one"
    DAMAGED_END = "the restart file {file} is damaged at its end: use another one"
    CUT = "the restart file {file} ends before the granules of this fix do: it was cut when it was written or copied; use a whole one"

    def test_damaged_files(self):
        whole = self.file(1).read_bytes()
        at = whole.index(b"solid/cull\0") + len(b"solid/cull\0") + 4  # the state begins after its size
        for place in (0, 6, 8 * 20, 8 * 25):
            with self.subTest(head=place):
                broken = bytearray(whole)
                broken[at + place] ^= 0x55
                self.refused_file("broken-head.restart", broken,
                                  "the restart file is damaged where it holds this fix's granules: use another one")
        section = self.section(whole)
        length = len(whole) - section
        lists, table = length - 72 - 32 - 16, length - 72 - 16  # one rank wrote
        for place, line, ranks in ((20, self.DAMAGED, 1), (length // 3, self.DAMAGED, 2), (length // 2, self.DAMAGED, 1),
                                   (lists, self.DAMAGED, 3), (table, self.DAMAGED_END, 2), (length - 20, self.DAMAGED_END, 3)):
            with self.subTest(section=place, ranks=ranks):
                broken = bytearray(whole)
                broken[section + place] ^= 0x55
                self.refused_file("broken.restart", broken, line, ranks)

    def test_damage_that_one_rank_of_many_finds(self):
        for written, read in ((4, 4), (4, 3), (2, 4)):
            whole = self.file(written).read_bytes()
            section = self.section(whole)
            for part in (0.2, 0.5, 0.8):
                with self.subTest(written_on=written, read_on=read, damaged_at=part):
                    broken = bytearray(whole)
                    broken[section + int(part * (len(whole) - section))] ^= 0x55
                    self.refused_file("broken.restart", broken, self.DAMAGED, read)

    def test_files_that_were_cut(self):
        whole = self.file(1).read_bytes()
        section = self.section(whole)
        for size, ranks in ((len(whole) - 1, 1), (len(whole) - 5000, 2), (section + 16, 1), (section, 2)):
            with self.subTest(left=size - section, ranks=ranks):
                self.refused_file("cut.restart", whole[:size], self.CUT, ranks)

    def test_the_head_of_one_file_and_the_end_of_another(self):
        one, other = (self.file(ranks).read_bytes() for ranks in (1, 2))
        mixed = one[:self.section(one)] + other[self.section(other):]
        self.refused_file("mixed.restart", mixed,
                          "the restart file {file} holds the granules of another restart file: use a file as it was written")

    def test_a_file_that_goes_before_the_first_run(self):
        file = self.copy("gone.restart", self.file(1).read_bytes())
        self.refused_by_fix(resumed(file, f"{CULL_BLOCK}\nshell rm {file}\nrun 10\n"),
                            f"the restart file {file} cannot be opened again (No such file or directory): it holds the granules of this fix")

    def test_a_file_that_has_another_name_now(self):
        self.goes_on(lambda file: resumed(self.copy("renamed", file.read_bytes()), f"{CULL_BLOCK}\nrun {AFTER}\n", END), ((2, 1),))

    def test_numbered_files_and_a_file_for_each_rank(self):
        for written, read in SOME:
            for pattern, named in (("many-*.restart", "many-*.restart"), ("each-%.restart", "each-%.restart"),
                                   ("both-*-%.restart", "both-*-%.restart")):
                with self.subTest(written_on=written, read_on=read, file=pattern), tempfile.TemporaryDirectory(dir=self.place) as folder:
                    folder = Path(folder)
                    out = folder / pattern
                    self.accepted(BLOCK + f"write_restart {out}\n" + BALL + f"{CULL_BLOCK}\nrun {BEFORE}\nwrite_restart {out}\n", ranks=written)
                    files = sorted(f.name for f in folder.iterdir())
                    self.assertFalse([f for f in files if f.startswith(".part")], files)
                    self.assertEqual(len(files), (1 + written if "%" in pattern else 1) * (2 if "*" in pattern else 1), files)
                    end, straight = self.end_of(resumed(folder / named, f"{CULL_BLOCK}\nrun {AFTER}\n", END), read), self.straight()
                    self.assertEqual(sorted(end), sorted(straight))
                    for tag, row in straight.items():
                        for x, y in zip(row[2:5], end[tag][2:5]):
                            self.assertLess(abs(x - y), 1e-6 * DIAMETER, f"granule {tag}")

    def test_files_of_a_run_replace_one_another_whole(self):
        one, two = self.place / "turn-a.restart", self.place / "turn-b.restart"
        self.accepted(BLOCK + BALL + f"{CULL_BLOCK}\nrestart 50 {one} {two}\nrun {BEFORE}\n")
        for file in (one, two):
            self.section(file.read_bytes())
        self.assertFalse(list(self.place.glob(".part*")))
        self.accepted(resumed(one, f"{CULL_BLOCK}\nrun 10\n", END.replace("custom end", f"custom {self.place / 'end'}")))

    def test_a_file_that_cannot_be_written(self):
        """On a device that is full, nothing is left that looks like a restart file."""
        if not Path("/dev/full").exists():
            self.skipTest("no /dev/full")
        part = self.place / ".part.full.restart"
        part.symlink_to("/dev/full")
        try:
            self.refused_by_fix(BLOCK + BALL + f"{CULL_BLOCK}\nrun {BEFORE}\nwrite_restart {self.place / 'full.restart'}\n",
                                "the restart file could not be written (No space left on device): make room, or write it elsewhere")
            self.assertFalse((self.place / "full.restart").exists())
        finally:
            part.unlink(missing_ok=True)

    def test_a_run_that_was_killed_while_it_wrote(self):
        """What it left is no file that a pattern finds: the newest whole one is read."""
        with tempfile.TemporaryDirectory(dir=self.place) as folder:
            folder = Path(folder)
            self.copy(folder / "k.50.restart", self.file(1).read_bytes())
            (folder / ".part.k.150.restart").write_bytes(self.file(1).read_bytes()[:1000])
            self.accepted(resumed(folder / "k.*.restart", f"{CULL_BLOCK}\nrun 10\n", END.replace("custom end", f"custom {folder / 'end'}")))

    def test_what_reads_the_file_without_the_fix_sees_its_atoms(self):
        """As any LIGGGHTS does: it does not look behind the atoms."""
        file, text = self.file(1), resumed(self.file(1), "")
        self.assertGreater(len(file.read_bytes()), self.section(file.read_bytes()))
        stock = shutil.which("liggghts")
        if not stock:
            self.skipTest("no LIGGGHTS without the plug-in")
        with tempfile.TemporaryDirectory(dir=self.place) as folder:
            deck = Path(folder) / "in"
            deck.write_text(text + 'run 0\nvariable n equal atoms\nprint "there are $n"\n')
            told = subprocess.run([stock, "-in", str(deck)], cwd=folder, capture_output=True, text=True, timeout=300).stdout
            self.assertIn(f"there are {GRANULES - self.interior[1]}", told)


if __name__ == "__main__":
    unittest.main()
