"""The closed forms of validation/ladder against the equations that they solve, and its bars: what they must catch."""
import copy
import math
import os
import subprocess
import sys
import unittest
from pathlib import Path

import numpy as np
from scipy import integrate

ROOT = Path(__file__).resolve().parents[1]
LADDER = ROOT / "validation" / "ladder"
sys.dont_write_bytecode = True
sys.path[:0] = [str(ROOT), str(LADDER)]
import chung_ooi  # noqa: E402
import column  # noqa: E402
import contact_law  # noqa: E402
import impact_rung  # noqa: E402
import rolling  # noqa: E402
import silo  # noqa: E402

RADIUS, SPEED = 0.1, 0.2
ALLOY = chung_ooi.ALLOY


def at_wall(restitution=1.0, friction=0.1, speed=SPEED):
    rigid = contact_law.Material(1000 * ALLOY.young, ALLOY.poisson, ALLOY.density)
    mass = ALLOY.density * 4 / 3 * math.pi * RADIUS**3
    return contact_law.Pair(contact_law.modulus(ALLOY, rigid), contact_law.shear_modulus(ALLOY, rigid), (RADIUS, math.inf), (mass, math.inf),
                            (contact_law.inertia(mass, RADIUS), math.inf), mass, restitution, friction, speed)


def solved(pair):
    """Depth, duration and rebound of a normal blow, by SciPy from the equation of motion."""
    log = math.log(pair.restitution)
    damping = 5**0.5 * -log / math.hypot(log, math.pi) * math.sqrt(pair.stiffness * pair.damping_mass)

    def motion(_, y):
        depth = max(y[0], 0)
        return y[1], -(pair.stiffness * depth**1.5 + damping * depth**0.25 * y[1]) / pair.mass

    def out(_, y):
        return y[0]
    out.terminal, out.direction = True, -1

    def deepest(_, y):
        return y[1]
    first = 1e-9 * pair.duration
    found = integrate.solve_ivp(motion, (first, 2 * pair.duration), (pair.speed * first, pair.speed), "DOP853", events=(out, deepest), rtol=1e-11, atol=1e-18,
                                max_step=pair.duration / 200)
    return found.y_events[1][0][0], found.t[-1], -found.y[1, -1] / pair.speed


class ClosedForms(unittest.TestCase):
    def near(self, value, due, share):
        self.assertLess(abs(value / due - 1), share, f"{value}, {due} is due")

    def test_a_normal_blow_is_the_solution_of_its_equation(self):
        for restitution in (1, 0.9, 0.5, 0.2):
            with self.subTest(restitution=restitution):
                pair = at_wall(restitution)
                depth, duration, rebound = solved(pair)
                self.near(pair.largest_depth, depth, 1e-6)
                self.near(pair.duration, duration, 1e-5)
                self.near(pair.rebound, rebound, 1e-6)

    def test_hertz(self):
        pair = at_wall()
        self.near(0.4 * pair.stiffness * pair.largest_depth**2.5, pair.mass * SPEED**2 / 2, 1e-14)  # energy
        self.near(pair.duration, 2.9432 * pair.largest_depth / SPEED, 1e-4)                       # Hertz's number
        self.near(pair.rebound, 1, 1e-15)
        self.near(pair.largest_force, pair.stiffness * pair.largest_depth**1.5, 1e-14)

    def test_a_restitution_is_that_of_the_deck_where_it_damps_by_the_mass_that_moves(self):
        self.near(at_wall(0.4).rebound, 0.4, 1e-12)

    def test_sliding_throughout(self):
        pair = at_wall()
        impulse, nearer = pair.sliding()
        self.near(impulse, 0.1 * 2 * pair.mass * SPEED, 1e-12)
        (gained, _), = contact_law.integrated([pair], [10.0], [(0.0, 0.0)])
        self.near(gained[1], -impulse / pair.mass, 1e-9)
        self.near(gained[2], (impulse * RADIUS - nearer) / pair.inertias[0], 1e-9)
        self.assertGreater(nearer, 1e-4 * impulse * RADIUS)

    def test_no_slip(self):
        pair = at_wall(friction=1e9, speed=1e-5)
        (gained, _), = contact_law.integrated([pair], [1e-5], [(0.0, 0.0)])
        self.near((1e-5 + gained[1] - RADIUS * gained[2]) / 1e-5, pair.no_slip, 1e-5)
        self.near(gained[1] * 2.5, -gained[2] * RADIUS, 1e-6)

    def test_two_spheres_keep_momentum_and_angular_momentum(self):
        test = chung_ooi.TESTS["7"]
        blow = test.blows[2]
        pair = test.pair(blow)
        (first, second), = contact_law.integrated([pair], [0.0], [(blow.spin, blow.other_spin)])
        mass, inertia = pair.masses[0], pair.inertias[0]
        self.assertLess(np.abs(first[:2] + second[:2]).max(), 1e-12 * blow.speed)
        self.assertLess(abs(first[2] - second[2]), 1e-9 * blow.spin)  # both are slowed alike
        turned, carried = 2 * inertia * first[2], 2 * mass * test.radius * first[1]  # of both spheres; about their contact
        self.assertLess(abs(turned + carried), 1e-3 * abs(turned))  # the depth is 5e-4 of the radius

    def test_slip_of_both_spins(self):
        test = chung_ooi.TESTS["7"]
        self.assertAlmostEqual(test.slip(test.blows[3]), -0.1 * (5 + 5), 12)

    def test_a_ball_that_rolls(self):
        ball = rolling.Ball(0.1)
        self.near(ball.rolls_at, 0.1 * 5 / 7, 1e-3)
        self.near(ball.rolls_after, 2 * 0.1 / (7 * rolling.FRICTION * rolling.GRAVITY), 1e-3)
        self.near(ball.way, 12 * 0.1**2 / (49 * rolling.FRICTION * rolling.GRAVITY), 1e-3)
        start = ball.mass * ball.arm * ball.radius * ball.speed  # about the floor, it is kept
        end = ball.mass * ball.arm * ball.radius * ball.rolls_at + 0.4 * ball.mass * ball.radius**2 * ball.spin
        self.near(end, start, 1e-14)

    def test_a_column_s_places_give_its_loads_back(self):
        of = column.Column(20)
        self.assertLess(np.abs(of.loads(of.places(20)) / of.due(20) - 1).max(), 1e-10)
        self.assertAlmostEqual(of.due(20)[0] / of.weight, 20, 12)

    def test_janssen(self):
        mass = np.linspace(0.02, 0.5, 20)
        stages = [{"mass": m, "floor": silo.GRAVITY * silo.janssen(m, 0.1), "middle": 0.1} for m in mass]
        found = silo.fit(stages)
        self.near(found["saturated"], 0.1, 1e-6)
        self.assertLess(found["off"], 1e-6)
        # a bulk density of 0.5 kg in 0.2 m of the silo; lambda = D/(4 K mu) holds 0.1 kg
        area = math.pi * silo.ACROSS**2 / 4
        self.near(silo.ACROSS / (4 * found["K mu"]) * area * 0.5 / (0.2 * area), 0.1, 1e-6)


class Bars(unittest.TestCase):
    """Figures as they are, then one of them spoiled."""

    TEST = {"free": 0.0, "keen share": 0.4, "culled share": 0.4, "law": [1e-3, 3e-4], "held law": 1e-3, "held heavy": 0.0, "momentum": 1e-15,
            "closed": [{}, {"depth": 1e-6, "force": 1e-15, "damped rebound": 0.004, "no slip": 0.005, "sliding": 1e-9}]}

    def missed(self, *keys, value):
        figures = copy.deepcopy(self.TEST)
        of = figures
        for key in keys[:-1]:
            of = of[key]
        of[keys[-1]] = value
        return impact_rung.faults("1", figures)

    def test_each_bar_of_an_impact(self):
        self.assertEqual(impact_rung.faults("1", self.TEST), [])
        for keys, value in ((("free",), 1.1e-12), (("keen share",), 1.01), (("culled share",), 1.01), (("law", 0), 0.021), (("law", 1), 0.006), (("law", 1), 0.0007), (("held law",), 0.021),
                            (("held heavy",), 2e-11), (("momentum",), 2e-11), (("closed", 1, "depth"), 2e-4), (("closed", 1, "force"), 2e-8),
                            (("closed", 1, "damped rebound"), 0.011), (("closed", 1, "no slip"), 0.011), (("closed", 1, "sliding"), 2e-6)):
            with self.subTest(keys=keys):
                self.assertEqual(len(self.missed(*keys, value=value)), 2 if value == 0.006 else 1)  # nor does it shrink then
                self.assertGreaterEqual(len(self.missed(*keys, value=math.nan)), 1)

    def test_each_bar_of_a_column(self):
        good = {"asleep": {"contacts": 1e-11, "floor, at any step": 1e-9, "floor": 1e-9, "granules": 10, "interior": 8},
                "laden": {"contacts in weights": 1.0, "floor": 1e-9, "granules": 11, "interior": 9}, "settled": {"contacts": 1e-11, "floor": 1e-9}}
        self.assertEqual(column.faults("asleep", good), [])
        for phase, name, value in (("asleep", "contacts", 1e-8), ("asleep", "floor, at any step", 1e-6), ("asleep", "interior", 7), ("laden", "floor", 1e-6),
                                   ("laden", "contacts in weights", 3.1), ("laden", "interior", 8), ("settled", "contacts", 1e-8), ("settled", "floor", 1e-6)):
            with self.subTest(phase=phase, name=name):
                spoiled = copy.deepcopy(good)
                spoiled[phase][name] = value
                self.assertEqual(len(column.faults("asleep", spoiled)), 1)
        rounded = copy.deepcopy(good)
        rounded["asleep"]["contacts"] = 5e-5
        self.assertEqual(column.faults("store compact", rounded), [])

    def test_each_bar_of_rolling_balls(self):
        good = {"balls": 4, "stored": [3, 3], "same": [1e-14, 1e-14], "closed": [
            {"speed": 1e-12, "spin": 1e-12, "time": 0.008, "way": 0.009}, {"speed": 1e-12, "spin": 1e-12, "time": 0.002, "way": 0.0024}]}
        self.assertEqual(rolling.faults(good), [])
        for change in ({"stored": [3, 2]}, {"same": [1e-14, 1e-11]}):
            self.assertEqual(len(rolling.faults({**good, **change})), 1)
        for name, value in (("speed", 1e-5), ("spin", 1e-5), ("time", 0.011), ("way", 0.011)):
            spoiled = copy.deepcopy(good)
            spoiled["closed"][1][name] = value
            self.assertEqual(len(rolling.faults(spoiled)), 1, name)

    def test_each_bar_of_a_silo(self):
        stages = [{"mass": m, "floor": 0.6 * m * silo.GRAVITY, "wall": 0.4 * m * silo.GRAVITY} for m in (0.1, 0.2)]
        good = {"runs": {kind: [copy.deepcopy(stages)] for kind in silo.KINDS}, "fits": {kind: [{"saturated": 0.1, "off": 0.05}] for kind in silo.KINDS}}
        self.assertEqual(silo.faults(good, False), [])
        for kind in silo.KINDS:
            lost = copy.deepcopy(good)
            lost["runs"][kind][0][1]["wall"] *= 0.9
            self.assertEqual(len(silo.faults(lost, True)), 1)
            off = copy.deepcopy(good)
            off["fits"][kind][0]["off"] = 0.5
            self.assertEqual(len(silo.faults(off, False)), 1)
        off = copy.deepcopy(good)
        off["fits"][silo.KINDS[1]][0]["saturated"] = 0.12
        self.assertEqual(len(silo.faults(off, False)), 1)


class Refusals(unittest.TestCase):
    def said(self, *words):
        done = subprocess.run(["/usr/bin/python3", str(LADDER / "ladder.py"), *words], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                              env={**os.environ, "SOLIDCULL_LAUNCHER": "/nowhere"}, timeout=60)
        self.assertEqual(done.returncode, 2)
        self.assertEqual(done.stdout, "")
        return done.stderr.strip().splitlines()[-1]

    def test_in_one_line(self):
        self.assertEqual(self.said("nowhere"), "ladder: no rung nowhere; there is: impacts rolling column silo")
        self.assertIn("argument --publish: not allowed with argument --few-steps", self.said("--few-steps", "--publish"))
        self.assertIn("no launcher at /nowhere", self.said("--few-steps", "rolling"))


if __name__ == "__main__":
    unittest.main()
