"""Twenty random decks with solid/cull against stock LIGGGHTS; and that the fuzzer sees what it is for."""
import copy
import math
import sys
import tempfile
import unittest
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "fuzz"))
import driver  # noqa: E402
import fuzz  # noqa: E402
import grammar  # noqa: E402
import judge  # noqa: E402
import more  # noqa: E402
from decks import CullLine, Deck, Part  # noqa: E402
from shrink import shrink  # noqa: E402

SEEDS = (6, 10, 11, 12, 16, 21, 23, 25, 28, 29, 31, 32, 34, 37, 42, 43, 44, 46, 47, 49)  # of 50, those that cull
RANKS = (1, 1, 1, 1, 2)
MORE_SEEDS = (2008, 2026, 2031, 2034)           # went wrong before what they try was taken
LIBRARY_SEEDS = (2012, 2013, 2027, 2036, 2037)  # likewise
# and the ranks of each: a bed in flight; cuts that move, twice; subdomains just as far apart as they look
SEVERAL_RANKS_SEEDS = {1086: 2, 1112: 4, 3015: 8, 1222: 5}
HEAD = """\
atom_style granular
atom_modify map array
boundary f f f
newton off
communicate single vel yes
units si
processors 2 1 1
region box block 0 0.012 0 0.012 -0.0001 0.06 units box
create_box 2 box
neighbor 0.0004 bin
neigh_modify delay 0
fix m1 all property/global youngsModulus peratomtype 5e6 5e6
fix m2 all property/global poissonsRatio peratomtype 0.3 0.3
fix m3 all property/global coefficientRestitution peratomtypepair 2 .3 .3 .3 .3
fix m4 all property/global coefficientFriction peratomtypepair 2 .5 .5 .5 .5
pair_style gran model hertz tangential history
pair_coeff * *
timestep 2e-5
fix grav all gravity 9.81 vector 0 0 -1
fix floor all mesh/surface/stress file floor.stl type 1
fix meshes all wall/gran model hertz tangential history mesh n_meshes 1 meshes floor
lattice sc 0.003 origin 0.5 0.5 0.5
region fill block 0 0.012 0 0.012 0 0.006 units box
create_atoms 1 region fill
set group all diameter 0.003 density 2500
fix integrate all nve/sphere
compute ke all ke
compute lib_mass all property/atom mass
run 100""".splitlines()
CLUMP_SEEDS = (142, 113, 131, 144, 149)  # with clumps; the first lost some when a restart file was written between two builds
WENT_WRONG = (5009, 5060, 40007, 70066, 80191)  # once, on one to four ranks


@unittest.skipUnless(fuzz.LAUNCHER.exists() and fuzz.STOCK, f"no {fuzz.LAUNCHER} or no stock liggghts")
class RandomDecks(unittest.TestCase):
    def test_twenty_decks(self):
        culled = 0
        with tempfile.TemporaryDirectory(prefix="solidcull-fuzz-") as folder:
            for seed in SEEDS:
                with self.subTest(seed=seed):
                    verdict = fuzz.verdict_of(grammar.make(seed, ranks=RANKS, more=False), Path(folder) / str(seed))
                    culled += verdict.culled > 0
                    self.assertFalse(verdict.fails(), f"{verdict.kind}: {verdict.text}\n"
                                     f"tests/fuzz/fuzz.py --plain --seed {seed} --count 1 --ranks {','.join(map(str, RANKS))} --shrink")
        self.assertGreaterEqual(culled, 15, "most decks cull nothing: they test nothing")

    def test_decks_that_went_wrong(self):
        with tempfile.TemporaryDirectory(prefix="solidcull-fuzz-") as folder:
            for seed in WENT_WRONG:
                with self.subTest(seed=seed):
                    verdict = fuzz.verdict_of(grammar.make(seed, ranks=grammar.FEW_RANKS, more=False), Path(folder) / str(seed))
                    self.assertFalse(verdict.fails(), f"{verdict.kind}: {verdict.text}\ntests/fuzz/fuzz.py --plain --seed {seed} --count 1 --ranks "
                                     f"{','.join(map(str, grammar.FEW_RANKS))}")

    def test_sums_that_are_right_of_their_own_bed(self):
        """A number that the fix changes when it restores is held against it, one that stays is not."""
        head = [line.replace("processors 2 1 1", "processors * * *") for line in HEAD]
        cull = CullLine([], keywords=["every", "10", "calm", "1", "speed", "0.5", "tolerance", "300", "0"])
        sums = ["compute touches all contact/atom", "compute sum all reduce sum c_touches", "variable right equal c_sum", "variable wrong equal random(1,9,15485863)",
                "thermo_style custom step atoms ke c_ke c_sum", "run 50", 'print "CHECK right contacts ${right}"', 'print "CHECK wrong contacts ${wrong}"']
        deck = Deck(1, [1], [[Part(head, needed=True), cull, Part(["run 100"]), Part(sums), Part(["run 50"])]], set(), grammar.meshes(0.012, 0.012, 0.03, 5))
        with tempfile.TemporaryDirectory(prefix="solidcull-fuzz-") as folder:
            self.assertGreater(judge.run(deck, True, fuzz.LAUNCHER, Path(folder) / "whole").culled, 0)
            for name, right in (("right", True), ("wrong", False), ("missing", False)):
                self.assertEqual(judge.says_so_restored(deck, name, fuzz.LAUNCHER, Path(folder) / name), right, name)

    def test_decks_with_more_and_by_way_of_the_library(self):
        """And that stock is right about itself: what the judge would hold against the fix is then no fault of the fuzzer."""
        with tempfile.TemporaryDirectory(prefix="solidcull-fuzz-") as folder:
            for library, seeds in ((False, MORE_SEEDS), (True, LIBRARY_SEEDS)):
                for seed in seeds:
                    deck = grammar.make(seed, ranks=RANKS, library=library)
                    for what, verdict in (("stock", fuzz.stock_again(deck, Path(folder))), ("culled", fuzz.verdict_of(deck, Path(folder)))):
                        with self.subTest(seed=seed, run=what, library=library):
                            self.assertEqual(verdict.kind, "good", f"{verdict.text}\ntests/fuzz/fuzz.py --seed {seed} --count 1 --ranks "
                                             f"{','.join(map(str, RANKS))} --library {'all' if library else 'none'} --shrink")


    def test_decks_with_clumps(self):
        with tempfile.TemporaryDirectory(prefix="solidcull-fuzz-") as folder:
            for seed in CLUMP_SEEDS:
                with self.subTest(seed=seed):
                    verdict = fuzz.verdict_of(grammar.make(seed, ranks=[1, 2], library=False, clumps=True), Path(folder) / str(seed))
                    self.assertEqual(verdict.kind, "good", f"{verdict.text}\ntests/fuzz/fuzz.py --clumps --library none --ranks 1,2 "
                                     f"--seed {seed} --count 1 --shrink")

    def test_decks_on_several_ranks(self):
        with tempfile.TemporaryDirectory(prefix="solidcull-fuzz-") as folder:
            for seed, ranks in SEVERAL_RANKS_SEEDS.items():
                with self.subTest(seed=seed):
                    deck = grammar.make(seed)
                    self.assertEqual(deck.ranks[0], ranks)
                    verdict = fuzz.verdict_of(deck, Path(folder) / str(seed))
                    self.assertEqual(verdict.kind, "good", f"{verdict.text}\ntests/fuzz/fuzz.py --seed {seed} --count 1 --shrink")


class Grammar(unittest.TestCase):
    def test_a_seed_gives_one_deck(self):
        for culled in (False, True):
            self.assertEqual(grammar.make(7).text(0, culled), grammar.make(7).text(0, culled))
        self.assertNotEqual(grammar.make(7).text(0, True), grammar.make(8).text(0, True))

    def test_grids(self):
        """Each grid is of so many ranks; most decks are on few of them."""
        for n in range(1, 9):
            grids = grammar.grids_of(n)
            self.assertEqual({math.prod(map(int, g.split())) for g in grids if "*" not in g} or {1}, {n})
            self.assertEqual(len(set(grids)), len(grids))
        self.assertEqual([len(grammar.grids_of(n)) for n in (5, 6, 7, 8)], [4, 10, 4, 11])
        ranks = [grammar.make(seed).ranks[0] for seed in range(200)]
        self.assertEqual(set(ranks), set(range(1, 9)))
        self.assertGreater(sum(n <= 4 for n in ranks), 150)

    def test_half_of_the_decks_move_cuts_between_ranks(self):
        with_it = sum(" balance " in grammar.make(seed).text(0, True) for seed in range(100))
        self.assertTrue(30 < with_it < 70, with_it)

    def test_decks_have_all_that_more_has(self):
        text = "".join(grammar.make(seed, library=seed % 2 == 0).text(0, True) for seed in range(200))
        for words in ("insert/stream", "contact/atom", "stress/atom virial", "pair/gran/local", "wall/gran/local", " post no", " pre no post no", "pair_style gran model hooke", "file high.stl", "file low.stl",
                      *(f"#library {what} " for what in (*more.ASKS, "fix")), "#library by file", "#library by commands"):
            self.assertIn(words, text)
        plain = "".join(grammar.make(seed, more=False).text(0, True) for seed in range(200))
        self.assertFalse([word for word in ("#library", "insert/stream", "contact/atom") if word in plain])

    def test_stock_sees_nothing_of_the_fix(self):
        for seed in range(100):
            deck = grammar.make(seed)
            for f in range(len(deck.files)):
                self.assertNotIn("cull", deck.text(f, False))
            self.assertIn("solid/cull", deck.text(0, True))


class Judge(unittest.TestCase):
    """Each fault that is planted is found."""

    def setUp(self):
        rows = {tag: [(1, 3e-5, 0.0015, 0.01, 0.01, 0.003 * tag, 0.0, 0.0, 0.0)] for tag in range(1, 5)}
        self.stock = judge.End(granules=rows, created=4)
        self.mine = copy.deepcopy(self.stock)
        self.deck = Deck(1, [1], [[]])

    def kind(self):
        return judge.judge(self.deck, self.stock, self.mine).kind

    def test_nothing_wrong(self):
        self.assertEqual(self.kind(), "good")

    def test_a_lost_granule(self):
        del self.mine.granules[2]
        self.assertEqual(self.kind(), "lost")
        self.deck.traits.add("loose")
        self.assertEqual(self.kind(), "lost")

    def test_a_granule_of_another_tag(self):
        self.mine.granules[9] = self.mine.granules.pop(2)
        self.assertEqual(self.kind(), "tags")

    def test_a_granule_twice(self):
        self.mine.granules[2] *= 2
        self.assertEqual(self.kind(), "tags")

    def test_another_mass(self):
        self.mine.granules[2] = [(1, 4e-5, *self.mine.granules[2][0][2:])]
        self.assertEqual(self.kind(), "values")

    def test_a_bed_that_sank(self):
        for rows in self.mine.granules.values():
            rows[0] = (*rows[0][:5], rows[0][5] - 0.002, *rows[0][6:])
        self.assertEqual(self.kind(), "height")

    def test_a_lighter_floor(self):
        self.stock.weight, self.mine.weight = -9.81 * 1.2e-4, -9.81 * 0.9e-4
        self.assertEqual(self.kind(), "weight")

    def test_another_number_between_runs(self):
        self.stock.checks, self.mine.checks = {"c1": ("exact", 4.0)}, {"c1": ("exact", 3.0)}
        self.assertEqual(self.kind(), "check")

    def test_sums_over_contacts_may_differ_a_little(self):
        for kind, value, good, bad in (("contacts", 1000, 800, 700), ("load", -0.5, -0.2, -0.1), ("load", 2.0, 1.5, 0.0)):
            for got, expected in ((good, "good"), (bad, "check")):
                self.stock.checks, self.mine.checks = {"c1": (kind, value)}, {"c1": (kind, got)}
                self.assertEqual(self.kind(), expected, (kind, value, got))

    def test_stops(self):
        for text, errors, status, kind in (("Segmentation fault", [], 139, "crash"), ("terminate called after", [], 134, "crash"), ("", [], -11, "crash"),
                                           ("", ["ERROR: fix cull solid/cull: no such thing"], 1, "refusal"),
                                           ("", ["ERROR: Lost atoms"], 1, "error"), ("", [], 1, "error"),
                                           ("", ["ERROR: solid/cull broke"], 1, "message")):
            self.mine = judge.End(status=status, text=text, errors=errors)
            self.assertEqual(self.kind(), kind, text or errors)
        self.mine = judge.End(late=True)
        self.assertEqual(self.kind(), "hang")

    def test_stock_that_fails_too(self):
        self.stock = judge.End(status=1, errors=["ERROR: Lost atoms"])
        self.assertEqual(self.kind(), "unjudged")
        self.mine = judge.End(status=139)
        self.assertEqual(self.kind(), "crash")


class Driver(unittest.TestCase):
    def test_a_deck_goes_by_turns_and_a_loop_in_one_piece(self):
        lines = ["a", "b", "#library by commands", "c", "label here", "run 1", "next n", "jump SELF here", "d", "#library natoms l1 exact", "", "#library by file", "e"]
        self.assertEqual(list(driver.pieces(lines)), [("file", ["a", "b"]), ("command", ["c"]), ("file", lines[4:8]), ("command", ["d"]),
                                                      ("ask", ["natoms l1 exact"]), ("file", ["e"])])

    def test_what_ranks_got_is_summed_where_it_is_to_be(self):
        with tempfile.TemporaryDirectory() as folder:
            for rank in (0, 1):
                (Path(folder) / f"library.{rank}").write_text(f"l1 exact 7 once\nl2 loose {rank + 2}.5 sum\n")
            end = judge.End()
            judge.read_library(end, Path(folder))
            self.assertEqual(end.checks, {"l1": ("exact", 7.0), "l2": ("loose", 6.0)})

    @unittest.skipUnless(fuzz.STOCK, "no stock liggghts")
    def test_stock_answers_each_question_as_a_dump_does(self):
        asks = ["natoms n exact", "world w exact", "masses m exact", "compute c exact", "each e exact", "formula f exact count(all)", "fix t exact floor 3",
                *(f"gathered g{what} exact {what}" for what in driver.DUMPED), "scattered s exact x 2 3 9 0.001", "scattered k exact v 0 1 99 0.5"]
        deck = grammar.Grammar(1, ranks=[2], library=True)
        deck.say(*HEAD, *(f"#library {ask}" for ask in asks), "run 5", "#library natoms last exact", needed=True)
        made = Deck(1, [2], [deck.parts], {"library"}, grammar.meshes(0.012, 0.012, 0.03, 5))
        with tempfile.TemporaryDirectory(prefix="solidcull-fuzz-") as folder:
            end = judge.run(made, False, fuzz.STOCK, folder)
        self.assertEqual((end.status, end.errors), (0, []), end.text[-2000:])
        checks = {name: value for name, (_, value) in end.checks.items()}
        for name in ("n", "where", "mtags", "f", "last", "gxn"):
            self.assertEqual(checks[name], 32, name)
        for name in ("cke", "t", "gx", "gv", "gradius", "gtype", "s", "sdump", "k", "kdump"):
            self.assertEqual(checks[name], 0, name)
        for name in ("m", "c", "e"):
            self.assertAlmostEqual(checks[name] / (32 * 2500 * 3.141592653589793 / 6 * 0.003**3), 1, msg=name)


class Shrink(unittest.TestCase):
    def test_only_what_the_failure_needs_is_left(self):
        parts = [Part([f"line {k}"]) for k in range(20)]
        deck = Deck(1, [4], [[Part(["head"], needed=True), *parts, CullLine([], needed=True, keywords=["every 10", "calm 1"]), Part(["run 800"])]])

        def fails(d):
            text = d.text(0, True)
            return "line 3\n" in text and "line 17\n" in text and "calm 1" in text and "run" in text and d.ranks[0] > 1

        smallest = shrink(deck, fails)
        self.assertEqual(smallest.text(0, True), "head\nline 3\nline 17\nfix cull all solid/cull report full calm 1\nrun 0\n")
        self.assertEqual(smallest.ranks, [2])


if __name__ == "__main__":
    unittest.main()
