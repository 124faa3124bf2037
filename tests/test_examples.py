"""Every example's decks run, in small and for a few steps, so that what is published cannot rot."""
import os
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LAUNCHER = os.environ.get("SOLIDCULL_LAUNCHER", str(ROOT / "build" / "liggghts-solidcull"))


class Impact(unittest.TestCase):
    def test_settles_and_strikes(self):
        with tempfile.TemporaryDirectory() as folder:
            for file in (ROOT / "examples" / "impact").iterdir():
                if file.suffix in (".in", ".stl"):
                    shutil.copy(file, folder)
            (Path(folder) / "out").mkdir()
            self.run_deck(folder, "settle.in", granules=500, dampsteps=300, freesteps=50)
            text = self.run_deck(folder, "impact.in", granules=500, steps=200)
            self.assertIn("fix cull solid/cull:", text)
            self.assertNotIn("Lost atoms", text)

    def run_deck(self, folder, deck, **variables):
        command = [LAUNCHER, "-in", deck, "-log", "none"]
        for name, value in variables.items():
            command += ["-var", name, str(value)]
        done = subprocess.run(command, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                              timeout=200, errors="replace", env={**os.environ, "SOLIDCULL_CHECK": "1"})
        self.assertEqual(done.returncode, 0, done.stdout[-2000:])
        return done.stdout


if __name__ == "__main__":
    unittest.main()
