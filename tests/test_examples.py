"""Every example's decks run, in small and for a few steps, so that what is published cannot rot."""
import json
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
            deck = subprocess.run(["/usr/bin/python3", "-c", "import moving; print(moving.deck())"], cwd=ROOT / "examples" / "falling_mass",
                                  stdout=subprocess.PIPE, check=True, text=True).stdout
            (Path(folder) / "moving.in").write_text(deck)
            self.run_deck(folder, "moving.in", frames=2, perframe=200)
            last = (Path(folder) / "out" / "moving.txt").read_text().split()[-3:]
            self.assertEqual([int(float(n)) for n in last], [500, 500, 0], "all fall, none has hit the floor")

    def test_drum(self):
        with tempfile.TemporaryDirectory() as folder:
            self.copied("drum", folder)
            stl = subprocess.run(["/usr/bin/python3", "-c", "import example; print(example.drum_stl())"], cwd=ROOT / "examples" / "drum",
                                 stdout=subprocess.PIPE, check=True, text=True).stdout
            (Path(folder) / "out" / "drum.stl").write_text(stl)
            self.run_deck(folder, "fill.in", granules=500, poursteps=3000, turnsteps=300)
            self.good(self.run_deck(folder, "turn.in", granules=500, steps=500))

    def test_plate_discharge(self):
        folder = ROOT / "examples" / "plate_discharge"
        result = self.run_script(folder / "example.py", folder / "out" / "twin-few.json")
        self.nothing_lost(result, 500)
        left, = result["metrics"]["left on the plate"]["culled"]
        self.assertTrue(400 < left < 500, f"{left} granules left on the plate of 500: none ran off it, or all")
        self.assertTrue(result["metrics"]["left on the plate"]["good"], result["metrics"]["left on the plate"])
        self.assertEqual(result["metrics"]["granules outside"]["culled"], [0])
        self.assertGreater(result["culled"]["seconds"], 0)

    def test_validation_motion(self):
        self.run_script(ROOT / "validation" / "motion" / "motion.py")

    def test_validation_scale(self):
        folder = ROOT / "validation" / "scale"
        report = self.run_script(folder / "scale.py", folder / "out" / "few" / "scale.json")
        self.assertEqual(set(report), {"tiny", "small"})
        for size, of_size in report.items():
            with self.subTest(size=size):
                self.assertEqual(set(of_size["kinds"]), {"unculled", "culled", "control"})
                culled = of_size["kinds"]["culled"]
                self.assertGreater(culled["interior"], 0)
                self.assertEqual(round(culled["exterior"] + culled["interface"] + culled["interior"]), culled["granules"])
                for kind, against in of_size["against"].items():
                    self.assertEqual((against["lost"], against["ids_good"]), (0, True), kind)
                    for name in ("depth, end (m)", "force on ball, largest (N)", "floor load, end (N)"):
                        self.assertGreater(against["metrics"][name]["mean"], 0, name)
                        self.assertTrue(against["metrics"][name]["good"], f"{kind}, {name}: {against['metrics'][name]}")
                    loads = against["element_loads"]
                    self.assertLess(loads["largest difference (N)"], 0.1 * loads["mean load (N)"])
        self.assertEqual([r["lost"] for r in self.run_script(folder / "weight.py", folder / "out" / "few" / "weight.json").values()], [0, 0])
        choices = self.run_script(folder / "choices.py", folder / "out" / "few" / "choices.json")
        self.assertEqual({c["lost"] for c in choices.values()}, {0})
        self.assertGreater(choices["sleep"]["over_exterior"], choices["live"]["over_exterior"])

    def test_validation_activity(self):
        few = ROOT / "validation" / "activity" / "out" / "few"
        # asleep, so that the small beds, a few granules high, are culled at all
        self.run_script(few.parents[1] / "activity.py", few / "silo.json", "--check", "--fix", "exterior sleep")
        granules = {"blade": 1000, "pour": 1100, "lower": 1000, "weight": 1000, "drum": 300, "mixer": 150, "gas": 200, "silo": 150}
        for scene, count in granules.items():
            with self.subTest(scene=scene):
                report = json.loads((few / f"{scene}.json").read_text())
                self.assertEqual((report["few_steps"], report["fix"]), (True, "exterior sleep"))
                self.assertNotEqual(report["verdict"], "lost")
                for part in report["parts"].values():
                    self.nothing_lost(part, count)
                    if scene in ("blade", "pour", "lower", "weight"):
                        self.assertGreater(part["culled"]["interior"], 0)
                        self.assertGreater(part["culled"]["restored"], 0)
                        self.assertEqual(part["metrics"]["granules outside"]["culled"], [0])
                        height = part["metrics"]["centre of mass (m)"]
                        self.assertLess(height["error"], 0.05 * height["mean"], height)

    def nothing_lost(self, result, granules):
        book = result["ledger"]
        self.assertIsNotNone(book, "a run did not reach its end")
        self.assertEqual((book["granules"], book["lost"], book["ids_missing"]), (granules, 0, 0))
        self.assertLess(abs(book["mass_lost"]), 1e-12 * book["mass"])

    def run_script(self, script, result=None, *words):
        """Runs a script with --few-steps; what it leaves in `result`."""
        if result:
            result.unlink(missing_ok=True)
        done = subprocess.run(["/usr/bin/python3", str(script), "--few-steps", *words], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, timeout=400, text=True, env={**os.environ, "SOLIDCULL_LAUNCHER": LAUNCHER})
        self.assertEqual(done.returncode, 0, done.stdout[-2000:])
        return json.loads(result.read_text()) if result else None

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
