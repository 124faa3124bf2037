"""Twenty random decks with solid/cull against stock LIGGGHTS; and that the fuzzer sees what it is for."""
import copy
import os
import sys
import tempfile
import unittest
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "fuzz"))
import fuzz  # noqa: E402
import grammar  # noqa: E402
import judge  # noqa: E402
from decks import CullLine, Deck, Part  # noqa: E402
from shrink import shrink  # noqa: E402

SEEDS = (6, 10, 11, 12, 16, 21, 23, 25, 28, 29, 31, 32, 34, 37, 42, 43, 44, 46, 47, 49)  # of 50, those that cull
RANKS = (1, 1, 1, 1, 2)
WENT_WRONG = (5009, 5060, 40007, 70066, 80191)  # once, on one to four ranks


@unittest.skipUnless(fuzz.LAUNCHER.exists() and fuzz.STOCK, f"no {fuzz.LAUNCHER} or no stock liggghts")
class RandomDecks(unittest.TestCase):
    def test_twenty_decks(self):
        culled = 0
        with tempfile.TemporaryDirectory(prefix="solidcull-fuzz-") as folder:
            for seed in SEEDS:
                with self.subTest(seed=seed):
                    verdict = fuzz.verdict_of(grammar.make(seed, ranks=RANKS), Path(folder) / str(seed))
                    culled += verdict.culled > 0
                    self.assertFalse(verdict.fails(), f"{verdict.kind}: {verdict.text}\n"
                                     f"tests/fuzz/fuzz.py --seed {seed} --count 1 --ranks {','.join(map(str, RANKS))} --shrink")
        self.assertGreaterEqual(culled, 15, "most decks cull nothing: they test nothing")


    def test_decks_that_went_wrong(self):
        with tempfile.TemporaryDirectory(prefix="solidcull-fuzz-") as folder:
            for seed in WENT_WRONG:
                with self.subTest(seed=seed):
                    verdict = fuzz.verdict_of(grammar.make(seed), Path(folder) / str(seed))
                    self.assertFalse(verdict.fails(), f"{verdict.kind}: {verdict.text}\ntests/fuzz/fuzz.py --seed {seed} --count 1")


class Grammar(unittest.TestCase):
    def test_a_seed_gives_one_deck(self):
        for culled in (False, True):
            self.assertEqual(grammar.make(7).text(0, culled), grammar.make(7).text(0, culled))
        self.assertNotEqual(grammar.make(7).text(0, True), grammar.make(8).text(0, True))

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


class Shrink(unittest.TestCase):
    def test_only_what_the_failure_needs_is_left(self):
        parts = [Part([f"line {k}"]) for k in range(20)]
        deck = Deck(1, [4], [[Part(["head"], needed=True), *parts, CullLine([], needed=True, keywords=["every 10", "calm 1"]), Part(["run 800"])]])

        def fails(d):
            text = d.text(0, True)
            return "line 3\n" in text and "line 17\n" in text and "calm 1" in text and "run" in text and d.ranks[0] > 1

        smallest = shrink(deck, fails)
        self.assertEqual(smallest.text(0, True), "head\nline 3\nline 17\nfix cull all solid/cull calm 1\nrun 0\n")
        self.assertEqual(smallest.ranks, [2])


if __name__ == "__main__":
    unittest.main()
