"""LIGGGHTS's C library, driven from Python: every function finds the whole bed while granules are culled (invariant I9)."""
import json
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT))
from solidcull_runs import engine  # noqa: E402

DRIVER = ROOT / "tests" / "drive_library.py"
CULL = "fix cull all solid/cull every 50 calm 2 speed 0.05 tolerance 12 0"
FORCE = 3e-2  # N, at the bottom of the bed
GRANULES = 800


def library():
    launcher = Path(os.environ.get("SOLIDCULL_LAUNCHER", ROOT / "build" / "liggghts-solidcull"))
    return launcher.parent / "libsolidcull.so"


def drive(folder, line, ranks, first="natoms"):
    env = dict(engine.environment(ranks), ORDER=first)
    start = ["mpirun", "-np", str(ranks), "--oversubscribe"] if ranks > 1 else []
    if line != "stock":
        start += ["env", f"LD_PRELOAD={library()}"]
    run = subprocess.run(start + ["/usr/bin/python3", str(DRIVER), line], cwd=folder, env=env, text=True, timeout=300,
                         stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
    if run.returncode != 0:
        raise AssertionError(f"{line} on {ranks} ranks: {run.stdout[-3000:]}")
    return [json.loads((Path(folder) / f"found.{r}").read_text()) for r in range(ranks)]


def all_ranks(found, name):
    """What each rank has of its own granules, together."""
    return {tag: value for rank in found for tag, value in rank[name].items()}


class Library(unittest.TestCase):
    def check(self, folder, ranks, first):
        stock, asleep = self.stock[ranks], drive(folder, CULL, ranks, first)
        self.assertGreater(asleep[0]["stored"], 100, "the bed does not sleep")
        for rank in range(ranks):
            here, there = asleep[rank], stock[rank]
            for name in ("natoms", "global", "variable", "lifted"):
                self.assertEqual(here[name], there[name], name)
            self.assertAlmostEqual(here["compute"][0], there["compute"][0], delta=1e-15)
            self.assertAlmostEqual(here["compute"][1], there["compute"][1], delta=1e-12 * abs(there["compute"][1]))
            self.assertEqual(here["gather"][:2], there["gather"][:2])
            for a, b in zip(here["gather"][2], there["gather"][2]):
                self.assertAlmostEqual(a, b, delta=1e-12 * FORCE)
            for a, b in zip(here["fallen"], there["fallen"]):
                self.assertAlmostEqual(a, b, delta=1e-11)
        for name in ("compute_each", "fix", "variable_each"):
            self.assertEqual(len(all_ranks(stock, name)), GRANULES)
            self.assertEqual(all_ranks(asleep, name), all_ranks(stock, name), name)
        wanted, seen = all_ranks(stock, "atom"), all_ranks(asleep, "atom")
        self.assertEqual(seen.keys(), wanted.keys())
        for tag, numbers in wanted.items():
            self.assertEqual(seen[tag][:3], numbers[:3])
            for a, b in zip(seen[tag][3:], numbers[3:]):
                self.assertAlmostEqual(a, b, delta=1e-12 * FORCE)

    def test_every_function_finds_the_whole_bed(self):
        with tempfile.TemporaryDirectory() as folder:
            self.stock = {ranks: drive(folder, "stock", ranks) for ranks in (1,)}
            for first in ("natoms", "global", "atom", "compute", "compute_each", "fix", "variable", "variable_each", "gather"):
                with self.subTest(first=first):
                    self.check(folder, 1, first)

    def test_and_on_two_ranks(self):
        with tempfile.TemporaryDirectory() as folder:
            self.stock = {2: drive(folder, "stock", 2)}
            for first in ("natoms", "atom", "gather"):
                with self.subTest(first=first):
                    self.check(folder, 2, first)


if __name__ == "__main__":
    unittest.main()
