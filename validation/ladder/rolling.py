"""The rung of balls that slide on a floor till they roll: when, how far, and how fast they are then."""
import math

import numpy as np

import ladder_runs
from column import DENSITY, DIAMETER, GRAVITY, POISSON, YOUNG
from contact_law import Material, modulus
from figures import Bars, number
from solidcull_runs import dumps, logs, meshes

SPEEDS, FEW_SPEEDS = (0.05, 0.1, 0.2, 0.4), (0.1, 0.2)  # m/s
FRICTION, RESTITUTION = 0.3, 0.9
SWINGS = 0.08           # s, after which the spring of the contact that rolls has come to rest
DT, FINE = 2e-5, 5e-6
REST = 1000            # time steps of DT at rest: all sleep
KINDS = ("without the line", "restored")
SAME = 1e-12           # of the speed
ROLLS = 1e-6           # of the speed, and of the speed of the surface
SLIDES = 0.01          # of time and way: LIGGGHTS's damping of the slip has no Coulomb limit, until the spring has reached it
EVERY = 5              # steps between two looks at a ball


class Ball:
    """One that slides with a speed: it is slowed by mu g and turned by the friction, at an arm shorter than its radius by half the depth."""

    def __init__(self, speed):
        self.speed, self.radius = speed, DIAMETER / 2
        self.mass = DENSITY * math.pi * DIAMETER**3 / 6
        steel = Material(YOUNG, POISSON, DENSITY)
        self.depth = (self.mass * GRAVITY / (4 / 3 * modulus(steel, steel) * math.sqrt(self.radius)))**(2 / 3)
        self.arm = 1 - self.depth / DIAMETER  # of the radius
        self.rolls_at = speed / (1 + 0.4 / self.arm**2)                                  # m/s: 5/7
        self.rolls_after = speed / (FRICTION * GRAVITY * (1 + 2.5 * self.arm**2))        # s: 2 v/(7 mu g)
        self.way = (speed + self.rolls_at) / 2 * self.rolls_after                        # m: 12 v^2/(49 mu g)

    @property
    def spin(self):
        return self.rolls_at / (self.arm * self.radius)


def run(kind, balls, dt, place):
    """What each ball has gained: speed and spin in the end, and the time and the way until it rolled."""
    base = f"rolling-{KINDS.index(kind)}-{dt:g}"
    data, floor, moves, way, rolls = (place / f"{base}.{end}" for end in ("data", "stl", "moves", "way", "rolls"))
    side = 4 * DIAMETER * len(balls)
    data.write_text(f"balls\n\n{len(balls)} atoms\n1 atom types\n\n-0.01 0.1 xlo xhi\n-0.01 {side:g} ylo yhi\n-0.001 0.01 zlo zhi\n\n"
                    "Atoms\n\n" + "".join(
                        f"{k + 1} 1 {DIAMETER:.17g} {DENSITY} 0 {4 * DIAMETER * k:.17g} {b.radius - b.depth:.17g}\n" for k, b in enumerate(balls)))
    meshes.write_stl(floor, meshes.grid((-0.011, -0.011, 0), (0.112, 0, 0), (0, side + 0.012, 0), 1, 1))
    moves.write_text("".join(f"set atom {k + 1} vx {b.speed!r}\n" for k, b in enumerate(balls)))
    steps = math.ceil((max(b.rolls_after for b in balls) + SWINGS) / dt)
    text = ladder_runs.run("rolling.in", kind == KINDS[1], base, place, {
        "data": data, "floor": floor, "moves": moves, "way": way, "rolls": rolls, "young": YOUNG, "poisson": POISSON, "friction": FRICTION, "restitution": RESTITUTION,
        "gravity": GRAVITY, "skin": DIAMETER / 10, "dt": dt, "rest": round(REST * DT / dt), "steps": steps, "every": EVERY,
        "culling": "exterior sleep"})
    first = [t for t in logs.parse_log(text) if t.counted][0]
    stored = first.column("f_cull[3]")
    _, _, rows = next(dumps.snapshots(rolls))
    ends = rows[np.argsort(rows[:, 0])]
    seen = [(step, rows[np.argsort(rows[:, 0])]) for step, _, rows in dumps.snapshots(way)]
    steps_seen = (np.array([step for step, _ in seen]) - seen[0][0]) * dt
    places, speeds, spins = (np.array([rows[:, k] for _, rows in seen]) for k in (1, 2, 3))
    found = []
    for k, b in enumerate(balls):
        slip = speeds[:, k] - b.arm * b.radius * spins[:, k]
        n = int(np.argmax(slip <= 0.5 * b.speed))  # the slip falls in a line; from two points of it
        m = n // 2
        zero = steps_seen[m] + slip[m] * (steps_seen[n] - steps_seen[m]) / (slip[m] - slip[n])
        found.append({"speed": ends[k, 2], "spin": ends[k, 3], "time": float(zero), "way": float(np.interp(zero, steps_seen, places[:, k]))})
    return found, 0 if stored is None else int(first.rows[-1][stored])


def climb(place, few):
    balls = [Ball(speed) for speed in (FEW_SPEEDS if few else SPEEDS)]
    of_ball = {"speed": "rolls_at", "spin": "spin", "time": "rolls_after", "way": "way"}
    due = {name: [getattr(b, of) for b in balls] for name, of in of_ball.items()}
    report = {"balls": len(balls), "closed": [], "same": [], "stored": []}
    for dt in (DT, FINE):
        without, with_it = (run(kind, balls, dt, place) for kind in KINDS)
        alone, twin = ({name: np.array([of[name] for of in found]) for name in due} for found, _ in (without, with_it))
        report["closed"].append({name: float(np.abs(alone[name] / due[name] - 1).max()) for name in due})
        report["same"].append(max(float(np.abs(twin[name] / alone[name] - 1).max()) for name in due))
        report["stored"].append(with_it[1])
    return {**report, "wrong": faults(report)}


def faults(report):
    bars = Bars("rolling")
    bars.hold(report["balls"] - min(report["stored"]), 1, "balls that were not stored:")  # the highest number stays an atom
    bars.hold(max(report["same"]), SAME, "restored, a ball differs from the run without the line by")
    for name, bar in (("speed", ROLLS), ("spin", ROLLS), ("time", SLIDES), ("way", SLIDES)):
        bars.hold(report["closed"][1][name], bar, f"{name} differs from its closed form by")
    return bars.missed


def page(report, page):
    page.heading(2, "Balls that slide till they roll")
    page.text(f"{report['balls']} speeds. Largest relative differences.")
    page.table(["time step", "speed", "spin", "time until it rolls", "way", "restored from the store, from without the line"], [
        [f"{1e6 * dt:g} µs", *(number(of[name]) for name in ("speed", "spin", "time", "way")), number(same)]
        for dt, of, same in zip((DT, FINE), report["closed"], report["same"])])
