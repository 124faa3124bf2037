"""Beds that are laid of a smaller one as culled restart files: the same granules, contacts and forces as laid as atoms."""
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "validation" / "scale")]
import scale  # noqa: E402
from solidcull_runs import engine  # noqa: E402
from solidcull_runs.laid import beds, culled_files, tiles  # noqa: E402
from solidcull_runs.laid.floors import Floor  # noqa: E402
from solidcull_runs.laid.sources import Source  # noqa: E402

WIDE = (6, 4)
HEAD = """atom_style granular
atom_modify map array
boundary f f f
newton off
communicate single vel yes
units si
read_restart ${restart}
neighbor 0.0004 bin
neigh_modify delay 0
include material.in
include bed.in
fix integrate all nve/sphere
compute pairs all pair/gran/local id force
thermo_modify lost error norm no
"""
CULL = "fix cull all solid/cull exterior sleep\nrun 0\n"
AWAKE = "unfix cull\ndelete_atoms group ball compress no\n"
STATE = """run 0
dump pairs all local 1 ${pairs} c_pairs[1] c_pairs[2] c_pairs[4] c_pairs[5] c_pairs[6]
dump_modify pairs format "%.17g %.17g %.17g %.17g %.17g"
run 0
write_dump all custom ${end} id x y z radius mass vx vy vz fx fy fz modify format "%d %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g"
"""


def rows_of(file):
    lines = Path(file).read_text().splitlines()
    start = max(k for k, line in enumerate(lines) if line.startswith("ITEM: ATOMS") or line.startswith("ITEM: ENTRIES")) + 1
    return np.array([line.split() for line in lines[start:]], dtype=float)


class LayCulled(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory(prefix="solidcull-lay-")
        cls.place = Path(cls.folder.name)
        cls.before = {name: getattr(scale, name) for name in (*scale.FEW, "few_steps")}
        vars(scale).update(scale.FEW, OUT=cls.place, few_steps=True)
        cls.small = scale.asleep_bed("few-rested")
        cls.size = scale.GRANULES

    @classmethod
    def tearDownClass(cls):
        vars(scale).update(cls.before)
        cls.folder.cleanup()

    def sides(self, copies):
        return dict(zip("LW", scale.sides_of(copies)))

    def floor(self, copies):
        file = self.place / f"floor-{copies[0]}-{copies[1]}.stl"
        scale.write_floor(file, scale.sides_of(copies))
        return file

    def laid(self, copies):
        file = self.place / f"laid-{copies[0]}-{copies[1]}.restart"
        source = Source(self.small["restart"], (3, 3), scale.PERIOD, scale.MARGIN, Floor(self.small["floor"]))
        count = beds.lay(source, file, copies, Floor(self.floor(copies)), scale.TOP)
        self.assertEqual(count, self.size * copies[0] * copies[1])
        return file

    def run_deck(self, name, text, **variables):
        # the decks that it includes are there
        deck = ROOT / "validation" / "scale" / f".{name}.in"
        deck.write_text(text)
        try:
            return engine.run_liggghts(deck, deck.parent, self.place / f"{name}.log", variables)
        finally:
            deck.unlink()

    def state(self, name, text, restart, copies):
        """Granules by their tags, and contacts by those of both."""
        end, pairs = self.place / f"{name}.end", self.place / f"{name}.pairs"
        self.run_deck(name, HEAD + text + STATE, restart=restart, floormesh=self.floor(copies), end=end, pairs=pairs, **self.sides(copies))
        granules = rows_of(end)
        granules = granules[granules[:, 0].argsort()]
        contacts = {}
        for a, b, *force in rows_of(pairs):
            contacts[min(a, b), max(a, b)] = np.array(force) * (1 if a < b else -1)
        return granules, contacts

    def compare(self, one, other, but=()):
        """To rounding; granules and contacts of `but` (tags) need not have the same forces."""
        (granules, contacts), (granules_too, contacts_too) = one, other
        self.assertTrue((granules[:, 0] == granules_too[:, 0]).all())
        self.assertLess(abs(granules[:, 1:4] - granules_too[:, 1:4]).max(), 1e-12)
        self.assertTrue((granules[:, 4:6] == granules_too[:, 4:6]).all())
        self.assertEqual(set(contacts), set(contacts_too))
        size = np.mean([np.linalg.norm(f) for f in contacts.values()])
        compared = 0
        for pair, force in contacts.items():
            if not but.intersection(pair) if but else True:
                self.assertLess(np.linalg.norm(force - contacts_too[pair]) / size, 1e-6, pair)
                compared += 1
        apart = np.linalg.norm(granules[:, 9:12] - granules_too[:, 9:12], axis=1) / size
        free = ~np.isin(granules[:, 0], list(but))
        self.assertLess(apart[free].max(), 1e-6)
        return compared

    def test_the_bed_itself(self):
        """Laid of as many tiles it is the bed that was put to sleep: walls, floor and all."""
        section = culled_files.Section(self.small["restart"])
        self.assertGreater(section.interior, 0.8 * 9 * self.size)
        again = culled_files.Section(self.laid((3, 3)))
        self.assertEqual((again.interior, again.interface, again.contacts), (section.interior, section.interface, section.contacts))
        ways = [self.state(name, CULL + AWAKE, file, (3, 3)) for name, file in (("slept", self.small["restart"]), ("laid", again.name))]
        self.assertGreater(self.compare(*ways), 5 * self.size)

    def test_a_larger_bed_is_the_same_as_one_laid_as_atoms(self):
        awake = self.place / "awake.restart"
        self.run_deck("awake", HEAD + CULL + AWAKE + "write_restart ${awake}\n", restart=self.small["restart"], awake=awake,
                      floormesh=self.small["floor"], **self.sides((3, 3)))
        atoms = self.place / "atoms.restart"
        tiles.lay(tiles.Bed(awake, (3, 3), scale.PERIOD, scale.MARGIN, False), atoms, WIDE, scale.PERIOD, scale.MARGIN, scale.TOP)
        one = self.state("culled", CULL + AWAKE, self.laid(WIDE), WIDE)
        other = self.state("atoms", "", atoms, WIDE)
        granules = one[0]
        # laid as atoms, a contact with the floor is with an element of the small bed, and where tiles meet that did not meet there each
        # of two granules has the history of its own tile
        tile = (granules[:, 0].astype(int) - 1) // self.size
        tile_of = dict(zip(granules[:, 0], tile))
        across = {t for pair in one[1] for t in pair if tile_of[pair[0]] != tile_of[pair[1]]}
        on_floor = set(granules[granules[:, 3] < 1.02 * granules[:, 4], 0])
        self.assertGreater(self.compare(one, other, across | on_floor), 5 * self.size)

    def test_it_is_read_by_any_number_of_ranks(self):
        file = self.laid(WIDE)
        for ranks in (1, 2, 3):
            with self.subTest(ranks=ranks):
                deck = ROOT / "validation" / "scale" / ".ranks.in"
                deck.write_text(HEAD + CULL + "run 20\nvariable n equal atoms\nprint \"there are $n granules\"\n")
                try:
                    words = ["mpirun", "--allow-run-as-root", "--oversubscribe", "-np", str(ranks)] if ranks > 1 else []
                    for name, value in {"restart": file, "floormesh": self.floor(WIDE), **self.sides(WIDE)}.items():
                        words += [] if name != "restart" else [str(engine.find_launcher()), "-in", deck.name, "-log", str(self.place / "ranks.log")]
                        words += ["-var", name, str(value)]
                    done = subprocess.run(words, cwd=deck.parent, capture_output=True, text=True, timeout=600)
                finally:
                    deck.unlink()
                self.assertIn(f"there are {self.size * WIDE[0] * WIDE[1] + 1} granules", done.stdout, done.stdout[-2000:] + done.stderr)

    def test_what_cannot_be_laid_is_refused(self):
        floor = Floor(self.small["floor"])
        with self.assertRaisesRegex(culled_files.CulledFileError, "contacts reach over more than one tile"):
            Source(self.small["restart"], (1, 9), scale.PERIOD, scale.MARGIN, floor)
        with self.assertRaisesRegex(culled_files.CulledFileError, "no bed of 4 x 4 equal tiles"):
            Source(self.small["restart"], (4, 4), scale.PERIOD, scale.MARGIN, floor)
        with self.assertRaisesRegex(culled_files.CulledFileError, "holds no culled granules"):
            Source(scale.bed("few-rested")["restart"], (3, 3), scale.PERIOD, scale.MARGIN, floor)
        two = Source(self.small["restart"], (3, 3), scale.PERIOD, scale.MARGIN, floor)
        two.copies = (2, 3)
        self.assertEqual(two.like(1, 2, (2, 3)), 5)
        with self.assertRaisesRegex(culled_files.CulledFileError, "of 2 tiles in a row 5 cannot be laid"):
            two.like(1, 2, (5, 3))
        two = Source(self.small["restart"], (3, 3), scale.PERIOD, scale.MARGIN, floor)
        two.copies = (2, 3)
        self.assertEqual(two.like(1, 2, (2, 3)), 5)
        with self.assertRaisesRegex(culled_files.CulledFileError, "of 2 tiles in a row 5 cannot be laid"):
            two.like(1, 2, (5, 3))
        broken = bytearray(self.small["restart"].read_bytes())
        broken[len(broken) * 2 // 3] ^= 1
        file = self.place / "broken.restart"
        file.write_bytes(broken)
        with self.assertRaisesRegex(culled_files.CulledFileError, "is damaged among its granules"):
            Source(file, (3, 3), scale.PERIOD, scale.MARGIN, floor)


if __name__ == "__main__":
    unittest.main()
