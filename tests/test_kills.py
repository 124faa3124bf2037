"""Runs that are killed go on from the newest restart file: three kills. tests/kills.py makes more."""
import sys
import tempfile
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
import kills as killing  # noqa: E402
from solidcull_runs import kills  # noqa: E402
from test_messages import LAUNCHER  # noqa: E402


@unittest.skipUnless(LAUNCHER.exists(), f"no {LAUNCHER}: build it, or name it in SOLIDCULL_LAUNCHER")
class Kills(unittest.TestCase):
    def test_three_kills(self):
        with tempfile.TemporaryDirectory(prefix="solidcull-kills-") as folder:
            try:
                left = killing.run(folder, 3)
            except killing.Fault as fault:
                self.fail(f"{fault}; again with tests/kills.py --count 3")
        self.assertEqual({kind for kind, *_ in left}, set(killing.KINDS))
        self.assertTrue(any(culled for *_, culled in left), "no file held culled granules: nothing was tried")


class Newest(unittest.TestCase):
    def test_by_step_and_none_in_part(self):
        with tempfile.TemporaryDirectory() as folder:
            folder = Path(folder)
            for name in ("k.100.restart", "k.20.restart", ".part.k.300.restart", "k.400.restart.part", "kk.500.restart", "k.x.restart"):
                (folder / name).touch()
            self.assertEqual(sorted(kills.steps_of(folder / "k.*.restart")), [20, 100])
            self.assertEqual(kills.newest(folder / "k.*.restart"), folder / "k.100.restart")
            self.assertIsNone(kills.newest(folder / "none.*.restart"))
            self.assertIsNone(kills.newest(folder / "nowhere" / "k.*.restart"))


if __name__ == "__main__":
    unittest.main()
