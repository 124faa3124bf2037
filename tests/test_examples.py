"""Every example and validation script runs, in small and for a few steps, so that what is published cannot rot.

The scripts themselves check what holds for any deck (solidcull_runs/few_steps.py) and end with 2 where it does not. Here stands what
is known of a scene without any run: numbers of granules, formulas, and what culling cannot change.
"""
import importlib.util
import json
import os
import shutil
import stat
import subprocess
import sys
import tempfile
import types
import unittest
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT))
from solidcull_runs import dumps, examples  # noqa: E402

LAUNCHER = os.environ.get("SOLIDCULL_LAUNCHER", str(ROOT / "build" / "liggghts-solidcull"))
GRAVITY = 9.81


class Scripts(unittest.TestCase):
    def nothing_lost(self, result, granules):
        book = result["ledger"]
        self.assertIsNotNone(book, "a run did not reach its end")
        self.assertEqual((book["granules"], book["lost"], book["ids_missing"]), (granules, 0, 0))
        self.assertLess(abs(book["mass_lost"]), 1e-12 * book["mass"])

    def close(self, result, share, *names):
        """Culled and unculled agree to a share of the figure, which is not zero."""
        for name in names:
            m = result["metrics"][name]
            self.assertGreater(abs(m["mean"]), 0, name)
            self.assertLess(m["error"], share * abs(m["mean"]), f"{name}: {m}")

    def run_script(self, script, result=None, *words, launcher=LAUNCHER, status=0):
        """Runs a script with --few-steps; what it leaves in `result`, or what it said when another status is due."""
        if result:
            result.unlink(missing_ok=True)
        done = subprocess.run(["/usr/bin/python3", str(script), "--few-steps", *words], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE, timeout=400, text=True,
                              env={**os.environ, "SOLIDCULL_LAUNCHER": launcher, "SOLIDCULL_CHECK": "1"})
        self.assertEqual(done.returncode, status, done.stdout[-2000:] + done.stderr)
        return json.loads(result.read_text()) if result else done.stderr

    def example(self, name):
        """Its comparison, and the ends of its two runs."""
        folder = ROOT / "examples" / name
        few = folder / "out" / "few"
        for old in few.glob("*.png"):
            old.unlink()
        result = self.run_script(folder / "example.py", few / "twin.json")
        for file in ("table.txt", "plot.png", "side.png" if name == "plate_discharge" else "cut-away.png"):
            self.assertTrue((few / file).stat().st_size > 0, file)
        return result, [dumps.read_final(few / f"{kind}-1.final") for kind in ("unculled", "culled")]


class Examples(Scripts):
    def test_impact(self):
        result, ends = self.example("impact")
        self.nothing_lost(result, 901)
        self.close(result, 0.02, "v_depth", "v_depth:max", "v_force:max", "v_floor")
        balls = [end[end["radius"] > examples.load("impact").STRIKER] for end in ends]
        self.assertEqual([len(ball) for ball in balls], [1, 1])
        self.assertGreater(result["metrics"]["v_force:max"]["mean"], balls[0]["mass"][0] * GRAVITY, "the ball has not struck the bed")

    def test_falling_mass(self):
        result, (unculled, culled) = self.example("falling_mass")
        self.nothing_lost(result, 500)
        self.assertGreater(result["culled"]["interior"], 0)
        # none has hit the floor, so the granules' own forces move neither centre of mass
        before = self.centre_before()
        time = 400 / 24 / 200  # s: steps of 1/24/200 s
        for end in (unculled, culled):
            fallen = before - np.average(end["z"], weights=end["mass"])
            self.assertAlmostEqual(fallen / (GRAVITY * time**2 / 2), 1, delta=1e-6)
        self.close(result, 1e-3, "heap radius", "heap height", "heap volume")

    def centre_before(self):
        """Height of the centre of mass of the oval that hangs in the air (m); and what moving.py counts of its fall."""
        folder = ROOT / "examples" / "falling_mass"
        with tempfile.TemporaryDirectory() as scratch:
            for file in folder.iterdir():
                if file.suffix in (".in", ".stl"):
                    shutil.copy(file, scratch)
            bed = folder / "out" / "few" / "bed.restart"
            code = "import moving; print(moving.deck('moving.txt'))"
            deck = subprocess.run(["/usr/bin/python3", "-c", code], cwd=folder, stdout=subprocess.PIPE, check=True, text=True).stdout
            deck = deck.replace("fix gravity", 'write_dump all custom start.dump id mass radius x y z modify format "%d %.15g %.15g %.15g %.15g %.15g"\nfix gravity')
            (Path(scratch) / "moving.in").write_text(deck)
            self.run_deck(scratch, "moving.in", restart=bed, frames=2, perframe=200)
            last = (Path(scratch) / "moving.txt").read_text().split()[-3:]
            self.assertEqual([int(float(n)) for n in last], [500, 500, 0], "all fall, none has hit the floor")
            start = dumps.read_final(Path(scratch) / "start.dump")
        return np.average(start["z"], weights=start["mass"])

    def run_deck(self, folder, deck, **variables):
        command = [LAUNCHER, "-in", deck, "-log", "none"]
        for name, value in variables.items():
            command += ["-var", name, str(value)]
        done = subprocess.run(command, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                              timeout=200, errors="replace")
        self.assertEqual(done.returncode, 0, done.stdout[-2000:])

    def test_drum(self):
        result, ends = self.example("drum")
        self.nothing_lost(result, 500)
        self.close(result, 0.005, "centre of mass x", "centre of mass z")
        drum = examples.load("drum")
        for end in ends:
            self.assertLess(np.hypot(end["x"], end["z"]).max(), drum.RADIUS, "a granule has left the drum")
            self.assertTrue((end["y"] > 0).all() and (end["y"] < drum.LENGTH).all(), "a granule has left the drum")

    def test_plate_discharge(self):
        result, ends = self.example("plate_discharge")
        self.nothing_lost(result, 500)
        plate = examples.load("plate_discharge").PLATE
        left, = result["metrics"]["left on the plate"]["culled"]
        self.assertEqual(left, (ends[1]["y"] > plate).sum())
        self.assertTrue(400 < left < 500, f"{left} granules left on the plate of 500: none ran off it, or all")
        self.assertTrue(result["metrics"]["left on the plate"]["good"], result["metrics"]["left on the plate"])
        self.assertEqual(result["metrics"]["granules outside"]["culled"], [0])

    def test_clumps(self):
        result, ends = self.example("clumps")
        self.nothing_lost(result, 901)
        self.close(result, 0.02, "v_depth", "v_depth:max", "v_force:max", "v_bedke:mean")
        balls = [end[end["radius"] > examples.load("clumps").STRIKER] for end in ends]
        self.assertEqual([len(ball) for ball in balls], [1, 1])
        self.assertGreater(result["metrics"]["v_force:max"]["mean"], balls[0]["mass"][0] * GRAVITY, "the ball has not struck the bed")

    def test_cluster(self):
        """Its job is killed and goes on: example.py itself ends with 1 if a granule, an id or a mass is not there then."""
        result, ends = self.example("cluster")
        self.nothing_lost(result, 1801)
        self.close(result, 0.02, "c_ballz", "c_ballz:min", "v_force:max")
        balls = [end[end["radius"] > examples.load("cluster").STRIKER] for end in ends]
        self.assertEqual([len(ball) for ball in balls], [1, 1])
        self.assertGreater(result["metrics"]["v_force:max"]["mean"], balls[0]["mass"][0] * GRAVITY, "the ball has not struck the bed")
        told = (ROOT / "examples" / "cluster" / "out" / "few" / "job" / "job.txt").read_text()
        self.assertRegex(told, r"(?s)job.sh: begins with out/bed.restart.*job.sh: goes on with out/strike.\d+.restart")

    def test_an_unknown_example(self):
        done = subprocess.run([str(ROOT / "examples" / "run.sh"), "nowhere"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        self.assertIn("no example 'nowhere'; there is: clumps cluster drum falling_mass impact plate_discharge", done.stderr)


class Validation(Scripts):
    def test_motion(self):
        out = ROOT / "validation" / "motion" / "out" / "few"
        self.run_script(ROOT / "validation" / "motion" / "motion.py", out / "drop.json")
        parts = json.loads((out / "drop.json").read_text())["parts"]
        self.assertEqual(len(parts), 2)
        for name, part in parts.items():
            with self.subTest(part=name):
                self.nothing_lost(part, 256)
                for kind in ("unculled", "culled"):  # in the air: after 400 steps of 3 us it falls as anything does
                    self.assertAlmostEqual(part["metrics"]["rebound (m/s)"][kind][0], -GRAVITY * 400 * 3e-6, delta=1e-8)
                self.close(part, 1e-9, "radius of gyration, end (m)")

    def test_stress(self):
        out = ROOT / "validation" / "stress" / "out" / "few"
        self.run_script(ROOT / "validation" / "stress" / "stress.py", out / "rest.json")
        parts = {case: json.loads((out / f"{case}.json").read_text())["parts"] for case in (
            "rest", "timestep", "stiffness", "cohesion", "ratio", "tap", "cycle", "sway", "shot", "reverse", "heavy")}
        for case, of_case in parts.items():
            for name, part in of_case.items():
                for kind in ("unculled", "live", "sleep"):
                    with self.subTest(part=name, kind=kind):
                        self.assertEqual((part[kind]["failure"], part[kind]["finite"], part[kind]["lost"]), (None, True, 0))
                        if kind != "unculled" and case not in ("stiffness", "shot"):  # stiff beds, their steps short, still fall
                            self.assertGreater(part[kind]["most_culled"], 0)
                if case in ("stiffness", "shot"):  # nothing is culled, so nothing differs
                    self.assertEqual(part["live"]["peak"], part["unculled"]["peak"])
        self.assertEqual({name: part["live"]["most_culled"] for name, part in parts["heavy"].items()}, {"heavy-300ns": 225})
        for of_case in (parts["sway"], parts["tap"]):  # they are for restores
            for part in of_case.values():
                self.assertGreater(part["live"]["restored"], 100)

    def test_stress_refuses_in_one_line(self):
        script = ROOT / "validation" / "stress" / "stress.py"
        self.assertIn("stress: no case nowhere; there is: rest timestep", self.run_script(script, None, "nowhere", status=2))
        self.assertIn("stress: unrecognized arguments: --quik", self.run_script(script, None, "--quik", status=2))
        self.assertIn("stress: argument --full: not allowed with argument --few-steps", self.run_script(script, None, "--full", status=2))

    def test_scale(self):
        folder = ROOT / "validation" / "scale"
        report = self.run_script(folder / "scale.py", folder / "out" / "few" / "scale.json")
        self.assertEqual({size: of["kinds"]["asleep"]["granules"] for size, of in report.items()},
                         {"tiny": 700 + 1, "small": 8 * 700 + 1, "laid": 24 * 700 + 1})
        for size, of_size in report.items():
            with self.subTest(size=size):
                self.assertEqual(set(of_size["kinds"]), {"asleep"} if size == "laid" else {"unculled", "culled", "asleep", "control"})
                for kind in {"culled", "asleep"}.intersection(of_size["kinds"]):
                    culled = of_size["kinds"][kind]
                    self.assertGreater(culled["interior"], 0)
                    self.assertEqual(round(culled["exterior"] + culled["interface"] + culled["interior"]), culled["granules"])
                for kind, against in of_size["against"].items():
                    self.assertEqual((against["lost"], against["ids_good"]), (0, True), kind)
                    if kind == "asleep":  # its bed has rested for longer
                        continue
                    self.close(against, 0.01, "depth, end (m)", "force on ball, largest (N)", "floor load, end (N)")
                    loads = against["element_loads"]
                    self.assertLess(loads["largest difference (N)"], 0.01 * loads["mean load (N)"])

    def test_scale_weight(self):
        folder = ROOT / "validation" / "scale"
        for part, r in self.run_script(folder / "weight.py", folder / "out" / "few" / "weight.json").items():
            self.assertEqual((r["granules"], r["lost"], r["elements"]), (8 * 700, 0, 4), part)
            largest, total = r["largest change of an element, and of all"]["asleep from free"]
            self.assertLess(largest, 0.005, part)
            self.assertLess(total, 0.005, part)

    def test_scale_choices(self):
        folder = ROOT / "validation" / "scale"
        choices = self.run_script(folder / "choices.py", folder / "out" / "few" / "choices.json")
        self.assertEqual({c["lost"] for c in choices.values()}, {0})
        self.assertGreater(choices["sleep"]["over_exterior"], choices["live"]["over_exterior"])

    def test_beds(self):
        folder = ROOT / "validation" / "beds"
        nine = self.run_script(folder / "beds.py", folder / "out" / "few" / "beds.json")["sizes"]["nine"]
        self.assertEqual((nine["beds"], nine["granules"], nine["lost"]), (2, 9 * 400, 0))
        self.assertLess(nine["awake"], 0.001)
        self.assertLess(nine["floor off"], 0.001)
        self.assertLess(abs(nine["figures"]["coordination number"]["off"]), 5)  # %
        self.assertIn("unknown: ten; sizes are nine", self.run_script(folder / "beds.py", None, "--sizes", "ten", status=2))

    def test_scale_tools(self):
        folder = ROOT / "validation" / "scale"
        tools = self.run_script(folder / "tools.py", folder / "out" / "few" / "tools.json")
        self.assertEqual(list(tools), ["tiny blade", "tiny block", "tiny wheel", "tiny pour"])
        for tool, c in tools.items():
            with self.subTest(tool=tool):
                self.assertEqual((c["lost"], c["ids_good"]), (0, True))
                self.assertGreater(c["interface"], 0)
                self.assertLess(c["exterior"], 700)
                self.close(c, 0.02, "floor load, largest (N)")
        self.assertEqual(tools["tiny pour"]["movers"], 20, "those that are poured move, and no other")

    def test_scaling(self):
        few = ROOT / "validation" / "scaling" / "out" / "few"
        shutil.rmtree(few / "runs", ignore_errors=True)  # figures of this launcher
        records = self.run_script(few.parents[1] / "scaling.py", few / "scaling.json")
        self.assertEqual([(r["what"], r["scene"]) for r in records], [("counts", "impact"), ("counts", "blade"), ("counts", "impact"), ("times", "impact"), ("balance", "corner")])
        for r in records[:3]:
            with self.subTest(scene=r["scene"], way=r["way"]):
                self.assertEqual((r["ranks"], r["steps"], r["looks"]), (2, 50, 2))
                self.assertGreater(r["builds"], 0)
                for who in ("plug-in", "liggghts"):
                    self.assertEqual(r[who]["partners"]["most"], 1, "two ranks have one partner each")
                    self.assertGreater(r[who]["received"]["mean"], 0)
                self.assertGreaterEqual(r["atoms"]["most"], r["atoms"]["mean"])
                self.assertEqual(r["plug-in"]["file reads"], 0)
        corner = records[-1]
        self.assertEqual((corner["ranks"], corner["still"]["moves"]), (2, 0), "nothing is above a threshold of a thousand")
        for of in (corner["still"], corner["moved"]):
            self.assertGreaterEqual(of["most"], of["mean"])
            self.assertGreaterEqual(of["mean"], 1)
        for file in ("scaling.txt", "model.png"):
            self.assertGreater((few / file).stat().st_size, 0)

    def test_no_harm(self):
        few = ROOT / "validation" / "no_harm" / "out" / "few"
        for old in few.glob("*.json"):
            old.unlink()
        self.run_script(few.parents[1] / "no_harm.py")
        for scene in ("drum", "mixer", "gas", "silo", "shake", "column", "switch", "tilt"):
            for mode in ("sleep", "live"):
                with self.subTest(scene=scene, mode=mode):
                    result = json.loads((few / f"{scene}-300-{mode}.json").read_text())
                    self.assertEqual((result["granules"], result["fix"], len(result["pairs"])), (300, f"exterior {mode}", 1))
                    without, with_it = result["pairs"][0]
                    self.assertGreater(min(without["user"], with_it["user"], result["user"]), 0)
                    self.assertGreaterEqual(with_it["culled"], with_it["restored"])

    def test_halving(self):
        """Its kinds of runs in one scene: each goes to its end, with its limits."""
        runs = ROOT / "validation" / "halving" / "out" / "few" / "slow_impact" / "runs"
        shutil.rmtree(runs, ignore_errors=True)
        self.run_script(ROOT / "validation" / "halving" / "halving.py")
        keywords = {}
        for deck in runs.glob("*.in"):
            line, = (line for line in deck.read_text().splitlines() if "solid/cull" in line)
            keywords[deck.stem.rpartition("-m-")[2]] = line
            self.assertIn("twin: end of the deck\n", deck.with_suffix(".log").read_text())
        self.assertEqual(keywords, {"unculled-1": "# fix cull all solid/cull", "varied-1": "fix cull all solid/cull tolerance 3 0 speed 0.01",
                                    "halved-1": "fix cull all solid/cull tolerance 1.5 0 speed 0.005"})

    def test_audit(self):
        """Each place of an audit is come to in the same way, with and without all that sleeps awake."""
        few = ROOT / "validation" / "audit" / "out" / "few" / "blade_drag"
        shutil.rmtree(few, ignore_errors=True)
        self.run_script(ROOT / "validation" / "audit" / "audit.py")
        places = sorted(f.stem[5:] for f in few.glob("then-*.dump"))
        self.assertEqual(places, [f"{run}-{at}" for run in range(3) for at in (120, 40, 80)])
        for place in places:
            then, left, awake = (dumps.read_final(few / f"{kind}-{place}.dump") for kind in ("then", "left", "awake"))
            for granules in (left, awake):
                self.assertEqual(then["id"].tolist(), granules["id"].tolist())
        log, = few.glob("*audited*.log")
        self.assertIn("audit         = ", log.read_text())

    def test_chain(self):
        few = ROOT / "validation" / "chain" / "out" / "few"
        (few / "chain.json").unlink(missing_ok=True)
        self.run_script(few.parents[1] / "chain.py")
        report = json.loads((few / "chain.json").read_text())
        weak, strong = report["runs"]
        for run in (weak, strong):
            for kind in ("unculled", "culled"):
                self.assertLess(abs(run[kind]["rest"] / report["granules"] - 1), 1e-5)
        self.assertLess(abs(weak["unculled"]["arrival"] / report["way_down"] - 1), 0.05)
        self.assertGreater(weak["culled"]["back"], 2 * weak["unculled"]["back"], "what sleeps throws a weak strike back")
        for what in ("rise", "arrival", "back"):
            self.assertLess(abs(strong["culled"][what] / strong["unculled"][what] - 1), 0.05, what)

    def test_ladder(self):
        """The script itself ends with 1 where a bar is missed; what it must not have left out, and what no run with the line may change."""
        few = ROOT / "validation" / "ladder" / "out" / "few"
        shutil.rmtree(few, ignore_errors=True)
        self.run_script(few.parents[1] / "ladder.py")
        impacts, rolling, column, silo = (json.loads((few / f"{name}.json").read_text()) for name in ("impacts", "rolling", "column", "silo"))
        self.assertEqual(list(impacts["tests"]), ["1", "2", "3", "4", "5", "6", "7", "8", "no slip"])
        for name, test in impacts["tests"].items():
            with self.subTest(test=name):
                self.assertEqual(test["free"], 0)
                self.assertGreater(test["culled"], 0, "nothing was locked when it was struck")
                self.assertLess(test["culled"], 0.01)
                self.assertEqual(len(test["law"]), 2 if name in ("1", "3", "5", "no slip") else 1)
        self.assertEqual([name for name, test in impacts["tests"].items() if "keen" in test], ["1", "4", "7"])
        self.assertLess(impacts["tests"]["1"]["closed"][1]["duration"], 1e-5)
        self.assertEqual(rolling["stored"], [1, 1])
        self.assertEqual([phase["interior"] for phase in column["kinds"]["asleep"].values()], [8, 10, 0])
        for runs in silo["runs"].values():
            self.assertEqual([stage["granules"] for of in runs for stage in of], [40, 80])

    def test_activity(self):
        few = ROOT / "validation" / "activity" / "out" / "few"
        # asleep, so that the small beds, a few granules high, are culled at all
        self.run_script(few.parents[1] / "activity.py", few / "silo.json", "--check", "--fix", "exterior sleep")
        granules = {"pour": 1100, "weight": 1000, "silo": 150}
        for scene, count in granules.items():
            with self.subTest(scene=scene):
                report = json.loads((few / f"{scene}.json").read_text())
                self.assertEqual((report["few_steps"], report["fix"]), (True, "exterior sleep"))
                self.assertNotEqual(report["verdict"], "lost")
                for part in report["parts"].values():
                    self.nothing_lost(part, count)
                    if scene in ("pour", "weight"):
                        self.assertGreater(part["culled"]["interior"], 0)
                        self.assertGreater(part["culled"]["restored"], 0)
                        self.assertEqual(part["metrics"]["granules outside"]["culled"], [0])
                        self.close(part, 0.005, "centre of mass (m)", "mean height of the surface (m)")
                    elif part["culled"]["culled"] == 0:  # then nothing differs
                        m = part["metrics"]["kinetic energy, mean (J)"]
                        self.assertEqual(m["culled"], m["unculled"])


class StressBars(unittest.TestCase):
    """The bars of validation/stress, with figures made up."""

    def setUp(self):
        spec = importlib.util.spec_from_file_location("stress", ROOT / "validation" / "stress" / "stress.py")
        self.stress = importlib.util.module_from_spec(spec)
        sys.modules["stress"] = self.stress  # dataclasses look there
        spec.loader.exec_module(self.stress)
        self.part = self.stress.Part("made-up", "rest.in", {}, 3, 10, calm=1e-4)
        self.end = np.array([(1, 0.5), (2, 0.5), (3, 0.5)], [("id", int), ("mass", float)])

    def figures(self, **others):
        return types.SimpleNamespace(**{"failure": None, "finite": True, "lost": 0, "peak": 2.0, "late": 0.5, "fastest": 1.0, "added": 0.0, "restored": 10, **others})

    def missed(self, part=None, end=None, **culled):
        def run(final):
            return types.SimpleNamespace(final=final)
        checks = self.stress.of_stable("", part or self.part, self.figures(**culled), run(self.end if end is None else end), [self.figures()], run(self.end), 3.0)
        return [c["what"] for c in checks if not c["good"]]

    def test_each_bar(self):
        self.assertEqual(self.missed(), [])
        for culled, bar in (({"finite": False}, "stopped, or not finite"), ({"peak": 2.3}, "kinetic energy, largest (M g d)"),
                            ({"late": 1.1}, "kinetic energy, last tenth (M g d)"), ({"fastest": 1.6}, "largest speed (m/s)"),
                            ({"added": 1.1e-5}, "energy added, of m g d per granule restored"), ({"late": float("nan")}, "kinetic energy, last tenth (M g d)")):
            self.assertEqual(self.missed(**culled), [bar])
        self.assertEqual(self.missed(added=0.9e-5), [])

    def test_nothing_may_be_lost(self):
        self.assertEqual(self.missed(lost=1, end=self.end[:2]), ["granules lost"])
        lighter = self.end.copy()
        lighter["mass"][0] = 0.4999
        self.assertEqual(self.missed(end=lighter), ["granules lost"])
        self.part.lossy = True
        self.assertEqual(self.missed(end=lighter), [])

    def test_where_unculled_is_unstable_a_line_is_enough_and_a_crash_is_not(self):
        for failure, good in ((None, True), ("live: LIGGGHTS stopped with status 1: ERROR: Lost atoms", True),
                              ("live: LIGGGHTS was killed by signal 11 (SIGSEGV): ERROR: x", False), ("live: LIGGGHTS stopped with status 1: it printed nothing", False)):
            check, = self.stress.of_unstable("", self.part, self.figures(failure=failure), None, None, None, 1.0)
            self.assertEqual(check["good"], good, failure)

    def test_many_unculled_runs_where_the_late_energy_scatters(self):
        self.assertEqual(self.part.unculled_runs(), 3)
        self.stress.settled = lambda name, **how: name + ".restart"
        for kind, runs in (("quick", 3), ("full", 8), ("few", 1)):
            self.stress.effort.kind = kind
            parts = self.stress.ratio()
            self.assertEqual({part.unculled_runs() for part in parts}, {runs}, kind)
            self.assertEqual(parts[0].work(), parts[0].granules * parts[0].steps * (runs + 2))
        self.part.once = True
        self.assertEqual(self.part.unculled_runs(), 1)

    def test_mechanical_energy(self):
        columns = "mass radius x y z vx vy vz omegax omegay omegaz".split()
        r, m, depth = 0.01, 2.0, 1e-4
        apart = dict(zip(columns, np.array([[m, r, 0.05, 0.05, r - depth, 3, 0, 4, 0, 5, 0], [m, r, 0.05, 0.05, 0.5, 0, 0, 0, 0, 0, 0]]).T))
        modulus = 5e6 / (2 * (1 - 0.3**2))
        due = m * 25 / 2 + 0.2 * m * r**2 * 25 + m * GRAVITY * (r - depth + 0.5) + 8 / 15 * modulus * r**0.5 * depth**2.5
        self.assertAlmostEqual(self.stress.mechanical_energy(apart, 5e6, (0.1, 0.1)) / due, 1, delta=1e-12)
        apart["z"] = np.array([0.5 - 2 * r + depth, 0.5])
        due += m * GRAVITY * (0.5 - 2 * r + depth - r + depth) + 8 / 15 * modulus * ((r / 2)**0.5 - r**0.5) * depth**2.5
        self.assertAlmostEqual(self.stress.mechanical_energy(apart, 5e6, (0.1, 0.1)) / due, 1, delta=1e-12)


# stands before the launcher and spoils the run
SPOILER = """\
#!/usr/bin/python3
import os, re, subprocess, sys
at = sys.argv.index("-in") + 1
deck = open(sys.argv[at]).read()
if re.search("(?m)^fix cull", deck):
    {change}
    open(sys.argv[at], "w").write(deck)
status = subprocess.run([{launcher!r}, *sys.argv[1:]]).returncode
final = re.search(r'(?m)^write_dump all custom "(.*?)"', deck)
if {lose} and final and re.search("(?m)^fix cull", deck):
    lines = open(final[1]).read().splitlines()
    open(final[1], "w").write("\\n".join(lines[:-1]) + "\\n")
sys.exit(status)
"""


class Spoiled(Scripts):
    """What a few steps must not let pass, in a real run: one line, status 2."""

    def spoiled(self, change="pass", lose=False, suite="motion", scene="drop"):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        launcher = Path(folder.name) / "launcher"
        launcher.write_text(SPOILER.format(change=change, lose=lose, launcher=LAUNCHER))
        launcher.chmod(launcher.stat().st_mode | stat.S_IXUSR)
        said = self.run_script(ROOT / "validation" / suite / f"{suite}.py", None, scene, launcher=str(launcher), status=2)
        self.assertEqual(said.count("\n"), 1, said)
        return said

    def test_a_fix_that_locks_nothing(self):
        self.assertIn("motion: drop-flat, few steps: culled-1 locked no granule",
                      self.spoiled(r"""deck = re.sub("(?m)^(fix cull .*)$", r"\1 every 1000000", deck)"""))

    def test_a_deck_that_ends_early(self):
        self.assertIn("motion: drop-flat, few steps: culled-1 made 0 steps after the fix line, not 800",
                      self.spoiled(r"""deck = re.sub(r"(?m)^run \$\{twin_end\} upto$", "run 0", deck)"""))

    def test_a_granule_that_is_lost(self):
        self.assertIn("motion: drop-flat, few steps: culled-1 ended with 255 granules of 255 ids, not 256", self.spoiled(lose=True))

    def test_a_target_that_is_not_locked(self):
        self.assertIn("ladder: 1-culled-100.states: at step 20 the target of station 2 is 0.0, not as 'restored' says",
                      self.spoiled(r"""deck = re.sub("(?m)^(fix cull .*)$", r"\1 every 1000000", deck)""", suite="ladder", scene="impacts"))

    def test_stress_tells_a_lost_granule(self):
        self.assertIn("stress: sway, few steps: live ended with 149 granules of 149 ids, not 150", self.spoiled(lose=True, suite="stress", scene="sway"))

    def test_stress_tells_a_deck_that_ends_early(self):
        self.assertIn("stress: sway, few steps: live made 0 steps after the fix line, not 500",
                      self.spoiled(r"""deck = re.sub(r"(?m)^run \$\{twin_end\} upto$", "run 0", deck)""", suite="stress", scene="sway"))


if __name__ == "__main__":
    unittest.main()
