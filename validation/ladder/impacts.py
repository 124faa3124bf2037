"""Blows on targets that the fix holds in different ways: many stations in one run, their files, and what spheres gain."""
import dataclasses
import math

import numpy as np

import ladder_runs
from chung_ooi import COLUMN, RIGID, TOLERANCES, Blow
from solidcull_runs import dumps, meshes
from solidcull_runs.errors import RunError

APART = 1.001          # diameters from one granule of a row to the next: they do not press on each other
LOOK_GAP, SKIN, FAR_GAP = 0.0125, 0.015, 0.04  # sums of radii: no contact to the fix, but no store; the skin; more than 2.5 skins
STATION = 40           # radii from one station to the next: no ball that is carved reaches so far
OUT_OF_PLANE = 1e-9    # of the blow's speed: more means that something else was struck
FREE, LOCKED = ("exterior", "restored"), ("interface", "fetched")  # states of the target when it is struck
STATES = FREE + LOCKED
MODEL, SETTINGS = "model hertz tangential history", "tangential_damping off"

@dataclasses.dataclass(frozen=True)
class Station:
    blow: Blow
    state: str
    number: int
    target: int       # ids
    row: tuple        # of the other granules in the row
    other: int        # None: a wall
    watched: bool


class Scene:
    """The stations of a test in one run, at `steps` time steps in the shortest contact."""

    def __init__(self, test, states, steps, heavier=1):
        self.test, self.heavier = test, heavier
        self.dt = min(test.pair(b).duration for b in test.blows) / steps
        self.before = steps // 5
        self.stations, ids = [], 0
        for k, (state, (n, blow)) in enumerate((s, b) for s in states for b in enumerate(test.blows)):
            row = tuple(range(ids + 2, ids + 1 + COLUMN)) if state != "exterior" else ()
            target, ids = ids + 1, ids + 1 + len(row) + (0 if test.wall else 1)
            watched = n in test.watched and state in FREE
            self.stations.append(Station(blow, state, k, target, row, None if test.wall else ids, watched))
        # the slowest is past its contact
        self.steps = max(math.ceil((self.gap(s) / s.blow.speed + 1.3 * self.longest(s.blow)) / self.dt) for s in self.stations)

    def longest(self, blow):
        return self.test.pair(blow, COLUMN).duration

    def gap(self, station):
        return self.test.reach * (LOOK_GAP if station.state in ("exterior", "interface") else FAR_GAP)

    def moves_at_once(self, station):
        return station.state != "restored"

    def meets(self, station):
        """The step at which the contact begins, about."""
        return self.gap(station) / station.blow.speed / self.dt + (0 if self.moves_at_once(station) else self.before)

    def motions(self, station):
        """Velocity along x and y and spin of the target and of the other, before they meet."""
        b = station.blow
        if self.test.wall:
            return (-b.speed, b.across, b.spin), None
        if station.state == "restored":  # it is told to move, or it would not wake
            return (-b.speed / 2, 0, b.spin), (b.speed / 2, 0, b.other_spin)
        return (0, 0, b.spin), (b.speed, 0, b.other_spin)

    @property
    def wide(self):
        """The larger radius, or about that."""
        return max(self.test.radius, self.test.reach / 2)

    def kind(self, blow):
        return blow.material, blow.restitution, blow.friction

    def write(self, place, base):
        """The files of a run; the deck's variables."""
        self.files = {name: place / f"{base}.{name}" for name in ("data", "scene", "moves", "states", "watch", "gained")}
        self.kinds = list(dict.fromkeys(self.kind(s.blow) for s in self.stations))
        self.metals = list(dict.fromkeys(s.blow.material for s in self.stations))
        self.files["data"].write_text(self.data())
        groups = {"targets": [s.target for s in self.stations],
                  "watched": [i for s in self.stations if s.watched for i in (s.target, s.other) if i] or [self.stations[0].target]}
        self.files["scene"].write_text(self.materials() + self.walls(place, base) + "".join(
            f"group {name} id {' '.join(map(str, ids))}\n" for name, ids in groups.items()))
        self.files["moves"].write_text("# what moves from here on\n" + "".join(
            "set atom {} vx {:.17g} vy {:.17g} omegaz {:.17g}\n".format(granule, *motion)
            for s in self.stations if not self.moves_at_once(s) for granule, motion in zip((s.target, s.other), self.motions(s)) if granule))
        return {**self.files, "skin": repr(SKIN * self.test.reach), "bin": repr(STATION / 4 * self.test.reach), "dt": repr(self.dt),
                "before": self.before, "steps": self.steps, "every": max(1, self.before // 4)}

    def granules_of(self, station):
        """Number, radius, density, place and motion of each granule, as the run begins."""
        s, test = station, self.test
        density = s.blow.material.density
        of_target, of_other = self.motions(s) if self.moves_at_once(s) else ((0.0, 0.0, 0.0),) * 2
        x, y = test.radius + self.gap(s) if test.wall else 0.0, -s.blow.across * self.gap(s) / s.blow.speed
        yield s.target, test.radius, self.heavier * density, (x, y, self.height(s)), of_target
        ways = [k for k in range(-(COLUMN // 2), COLUMN // 2 + 1) if k]
        for granule, k in zip(s.row, ways):
            yield granule, test.radius, density, (x, y, self.height(s) + APART * 2 * test.radius * k), of_target
        if s.other:
            yield s.other, test.other_radius, density / test.lighter, (-(test.reach + self.gap(s)), 0.0, self.height(s)), of_other

    def height(self, station):
        return STATION * self.wide * station.number

    def data(self):
        atoms, velocities = [], []
        for s in self.stations:
            for granule, radius, density, place, motion in self.granules_of(s):
                atoms.append((granule, self.kinds.index(self.kind(s.blow)) + 1, 2 * radius, density, *place))
                velocities.append((granule, *motion))
        side, top = 60 * self.wide, self.height(self.stations[-1]) + STATION * self.wide
        types = len(self.kinds) + (len(self.metals) if self.test.wall else 0)
        return (f"impacts\n\n{len(atoms)} atoms\n{types} atom types\n\n" + f"{-side:g} {side:g} xlo xhi\n{-side:g} {side:g} ylo yhi\n"
                + f"{-STATION * self.wide:g} {top:g} zlo zhi\n\nAtoms\n\n"
                + "".join("{} {} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g}\n".format(*a) for a in atoms) + "\nVelocities\n\n"
                + "".join("{} {:.17g} {:.17g} 0 0 0 {:.17g}\n".format(*v) for v in velocities))

    def materials(self):
        def of(values):
            return " ".join(f"{v:.17g}" for v in values)
        walls = [dataclasses.replace(m, young=RIGID * m.young) for m in self.metals] if self.test.wall else []
        each = [material for material, _, _ in self.kinds] + walls
        lines = [f"fix young all property/global youngsModulus peratomtype {of(m.young for m in each)}",
                 f"fix poisson all property/global poissonsRatio peratomtype {of(m.poisson for m in each)}"]
        numbers = range(len(each))
        for name, at in (("coefficientRestitution", 1), ("coefficientFriction", 2)):  # a wall takes those of the sphere
            values = [self.kinds[min(i, j)][at] if min(i, j) < len(self.kinds) else 1 for i in numbers for j in numbers]
            lines.append(f"fix {name} all property/global {name} peratomtypepair {len(each)} {of(values)}")
        return "\n".join(lines) + f'\nvariable contact string "{MODEL} {SETTINGS}"\n'

    def walls(self, place, base):
        """Of each material a mesh: a triangle for each target, which none else of its row can touch, and the contact amid it."""
        if not self.test.wall:
            return ""
        lines, names, r = [], [f"patch{k}" for k in range(len(self.metals))], self.test.radius
        for k, (name, metal) in enumerate(zip(names, self.metals)):
            heights = [self.height(s) for s in self.stations if s.blow.material == metal]
            stl = place / f"{base}-{k}.stl"
            meshes.write_stl(stl, [((0, -8 * r, z - 0.8 * r), (0, 8 * r, z - 0.8 * r), (0, 0, z + 0.8 * r)) for z in heights])
            lines.append(f"fix {name} all mesh/surface file {stl} type {len(self.kinds) + k + 1}")
        lines.append(f"fix patches all wall/gran {MODEL} mesh n_meshes {len(names)} meshes {' '.join(names)} {SETTINGS}")
        return "\n".join(lines) + "\n"

    def gained(self):
        """What the target and the other have gained: along, across, spin, as an array (stations, 2, 3); and what all of a station have
        gained in momentum along and across, as an array (stations, 2)."""
        _, columns, rows = next(dumps.snapshots(self.files["gained"]))
        rows = rows[np.argsort(rows[:, 0])]
        motion = rows[:, [columns.index(c) for c in ("vx", "vy", "omegaz")]]
        aside = rows[:, [columns.index(c) for c in ("vz", "omegax", "omegay")]]
        found, momenta = [], []
        for s in self.stations:
            of_target, of_other = self.motions(s)
            if np.abs(aside[s.target - 1]).max() > OUT_OF_PLANE * self.test.scale(s.blow) / min(1, self.test.radius):
                raise RunError(f"{self.files['gained'].name}: the target of station {s.number} has left the plane of the blow")
            before = (0.0, 0.0, 0.0) if s.state == "restored" else of_target
            rest = [motion[granule - 1] - before for granule in s.row]
            target, other = motion[s.target - 1] - of_target, np.zeros(3) if of_other is None else motion[s.other - 1] - of_other
            found.append((target, other))
            mass, other_mass = self.test.mass(s.blow), self.test.pair(s.blow).masses[1] if s.other else 0
            momenta.append(mass * (self.heavier * target[:2] + sum((r[:2] for r in rest), np.zeros(2))) + other_mass * other[:2])
        return np.array(found), np.array(momenta)

    def check_states(self):
        """RunError unless each target was in its state at the end of the first run and just before the contact."""
        due = {"exterior": (0, 0), "restored": (None, 0), "interface": (1, 1), "fetched": (None, 1)}
        seen = {step: dict(zip(rows[:, 0].astype(int), rows[:, 1])) for step, _, rows in dumps.snapshots(self.files["states"])}
        for s in self.stations:
            last = max(step for step in seen if step < self.meets(s) - 1)
            for step, wanted in zip((self.before, last), due[s.state]):
                found = seen[step].get(s.target)
                if (None if found is None else int(found > 0)) != wanted:
                    raise RunError(f"{self.files['states'].name}: at step {step} the target of station {s.number} is {found}, "
                                   f"not as '{s.state}' says")

    def followed(self):
        """Of each watched station: depths and forces, step by step (step, depth, force), in contact."""
        steps = {}
        for step, _, rows in dumps.snapshots(self.files["watch"]):
            steps[step] = {int(row[0]): row[1:] for row in rows}
        found = {}
        for s in self.stations:
            if not s.watched:
                continue
            both = [(step, at.get(s.target), at.get(s.other)) for step, at in steps.items()]
            if self.test.wall:
                rows = [(step, self.test.radius - a[0], a[1]) for step, a, _ in both if a is not None]
            else:
                rows = [(step, self.test.radius + self.test.other_radius - (a[0] - b[0]), -b[1]) for step, a, b in both if a is not None]
            found[s] = np.array(rows)
        return found


def run(test, kind, states, steps, place, name):
    """A scene that has been run: without the line, with it, or with it and targets that do not wake."""
    scene = Scene(test, states, steps, COLUMN if kind == "heavy" else 1)
    base = f"{name.replace(' ', '-')}-{kind}-{steps}"
    variables = scene.write(place, base)
    ladder_runs.run("impact.in", kind in TOLERANCES, base, place, {**variables, "culling": f"tolerance {TOLERANCES.get(kind, 0):g} 0"})
    if kind in TOLERANCES:
        scene.check_states()
    return scene
