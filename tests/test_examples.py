"""Every example's decks run, in small and for a few steps, so that what is published cannot rot."""
import os
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LAUNCHER = os.environ.get("SOLIDCULL_LAUNCHER", str(ROOT / "build" / "liggghts-solidcull"))


class Decks(unittest.TestCase):
    def copied(self, name, folder):
        for file in (ROOT / "examples" / name).iterdir():
            if file.suffix in (".in", ".stl"):
                shutil.copy(file, folder)
        (Path(folder) / "out").mkdir()

    def good(self, text):
        self.assertIn("fix cull solid/cull:", text)
        self.assertNotIn("Lost atoms", text)

    def test_impact(self):
        with tempfile.TemporaryDirectory() as folder:
            self.copied("impact", folder)
            self.run_deck(folder, "settle.in", granules=500, dampsteps=300, freesteps=50)
            self.good(self.run_deck(folder, "impact.in", granules=500, steps=200))

    def test_falling_mass(self):
        with tempfile.TemporaryDirectory() as folder:
            self.copied("falling_mass", folder)
            self.run_deck(folder, "make.in", granules=500, pullsteps=2000, dampsteps=300, fadesteps=300, reststeps=100)
            self.good(self.run_deck(folder, "fall.in", frames=2, perframe=200))

    def test_drum(self):
        with tempfile.TemporaryDirectory() as folder:
            self.copied("drum", folder)
            stl = subprocess.run(["/usr/bin/python3", "-c", "import example; print(example.drum_stl())"], cwd=ROOT / "examples" / "drum",
                                 stdout=subprocess.PIPE, check=True, text=True).stdout
            (Path(folder) / "out" / "drum.stl").write_text(stl)
            self.run_deck(folder, "fill.in", granules=500, poursteps=3000, turnsteps=300)
            self.good(self.run_deck(folder, "turn.in", granules=500, steps=500))

    def test_validation_motion(self):
        done = subprocess.run(["/usr/bin/python3", str(ROOT / "validation" / "motion" / "motion.py"), "--few-steps"], stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, timeout=400, text=True, env={**os.environ, "SOLIDCULL_LAUNCHER": LAUNCHER})
        self.assertEqual(done.returncode, 0, done.stdout[-2000:])

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
