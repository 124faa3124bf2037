"""The impacts of Chung & Ooi (2011) on targets that the fix holds in different ways: stations, runs, and what spheres gain."""
import dataclasses
import math

import numpy as np

import contact_law
import ladder_runs
from contact_law import Material, Pair
from solidcull_runs import dumps, meshes
from solidcull_runs.errors import RunError

COLUMN = 5             # granules in a row across the blow, the target in their middle: its axis is that of all spins
APART = 1.001          # diameters from one of them to the next: they do not press on each other
LOOK_GAP, SKIN, FAR_GAP = 0.0125, 0.015, 0.04  # sums of radii: no contact to the fix, but no store; the skin; more than 2.5 skins
STATION = 40           # radii from one station to the next: no ball that is carved reaches so far
RIGID = 1000           # a wall's modulus, of the sphere's
OUT_OF_PLANE = 1e-9    # of the blow's speed: more means that something else was struck
FREE, LOCKED = ("exterior", "restored"), ("interface", "fetched")  # states of the target when it is struck
STATES = FREE + LOCKED
TOLERANCES = {"culled": 3, "keen": 1e-6, "held": 1e12}  # in weights: the default; wakes at once; does not wake by its load
WAIT = 30              # steps that who wakes may wait for others; not if its load is 10 tolerances off
UNPRESSED = 0.15 * 9.81  # N/kg, of each weight of the tolerance: what counts for a granule that nothing presses on, without gravity
MODEL, SETTINGS = "model hertz tangential history", "tangential_damping off"

GLASS, LIMESTONE = Material(4.8e10, 0.20, 2800), Material(2.0e10, 0.25, 2500)
ALLOY_2, MAGNESIUM = Material(7.0e10, 0.30, 2699), Material(4.0e10, 0.35, 1800)
OXIDE, IRON = Material(3.8e11, 0.23, 4000), Material(1.0e11, 0.25, 7000)
ALLOY, COPPER = Material(7.0e10, 0.33, 2700), Material(1.2e11, 0.35, 8900)
STEEL, POLYETHYLENE = Material(2.08e11, 0.30, 7850), Material(1.0e9, 0.40, 1400)


@dataclasses.dataclass(frozen=True)
class Blow:
    """The target comes towards the other with `speed`, and goes across with `across`; both may spin."""
    material: Material
    restitution: float
    friction: float
    speed: float
    across: float = 0.0
    spin: float = 0.0
    other_spin: float = 0.0


@dataclasses.dataclass(frozen=True)
class Test:
    title: str
    blows: tuple
    radius: float
    other_radius: float = math.inf  # a wall
    lighter: float = 1              # times as light as the target's is the other's material
    watched: tuple = ()             # blows whose force is followed step by step

    @property
    def wall(self):
        return math.isinf(self.other_radius)

    @property
    def reach(self):
        """Sum of the radii; of a sphere and its mirror image at a wall."""
        return self.radius + (self.radius if self.wall else self.other_radius)

    def mass(self, blow):
        return blow.material.density * 4 / 3 * math.pi * self.radius**3

    def pair(self, blow, granules=1):
        """What meets; the target as a body of so many granules in a row."""
        mass = self.mass(blow)
        if self.wall:
            rigid = dataclasses.replace(blow.material, young=RIGID * blow.material.young)
            other_mass, other_inertia, damping = math.inf, math.inf, mass
        else:
            rigid = blow.material
            other_mass = mass / self.lighter * (self.other_radius / self.radius)**3
            other_inertia, damping = contact_law.inertia(other_mass, self.other_radius), 1 / (1 / mass + 1 / other_mass)
        return Pair(contact_law.modulus(blow.material, rigid), contact_law.shear_modulus(blow.material, rigid), (self.radius, self.other_radius),
                    (granules * mass, other_mass), (granules * contact_law.inertia(mass, self.radius), other_inertia), damping,
                    blow.restitution, blow.friction, blow.speed)

    def lost(self, blow, dt, kind):
        """The most that a locked target can lack after the blow, as a share of its scale: what its body takes until it wakes."""
        pair, mass = self.pair(blow), self.mass(blow)

        def force(depth):
            damping = 2 * pair.damping_ratio * math.sqrt(1.25 * pair.stiffness * pair.mass)
            return pair.stiffness * depth**1.5 + damping * depth**0.25 * blow.speed

        def when(load):
            """The time by which undamped spheres press so hard."""
            depth = (load / pair.stiffness)**(2 / 3)
            return 1.25 * depth / blow.speed if depth < 0.6 * pair.undamped_depth else math.inf
        tolerance = TOLERANCES[kind] * UNPRESSED * mass
        time = dt + min(when(10 * tolerance), when(tolerance) + WAIT * dt)
        push = force(min(blow.speed * time, pair.undamped_depth))
        hold = 8 * pair.shear_modulus * math.sqrt(pair.radius * min(blow.speed * time, pair.undamped_depth)) * abs(self.slip(blow)) * time
        both = max(push, 2.5 * min(blow.friction * push, hold))  # friction turns a sphere 2.5 times as fast as it drags it
        return 2 * (1 - 1 / COLUMN) * both * min(time, pair.duration) / mass / self.scale(blow)

    def slip(self, blow):
        """Of the target's surface on the other's."""
        return blow.across - self.radius * blow.spin - (0 if self.wall else self.other_radius * blow.other_spin)

    def scale(self, blow):
        """Speed by which what is gained is measured."""
        return math.hypot(blow.speed, self.slip(blow))


def oblique(material, restitution, friction, speed, degrees):
    a = math.radians(degrees)
    return Blow(material, restitution, friction, speed * math.cos(a), speed * math.sin(a))


# parameters of the paper, as the authors of Yade and PySPH published them with their decks
TESTS = {
    "1": Test("two equal spheres, elastic", tuple(Blow(m, 1, 0.35, 20) for m in (GLASS, LIMESTONE)), 0.01, 0.01, watched=(0, 1)),
    "2": Test("a sphere and a wall, elastic", tuple(Blow(m, 1, 0, 0.2) for m in (ALLOY_2, MAGNESIUM)), 0.1, watched=(0, 1)),
    "3": Test("a sphere and a wall, restitution", tuple(Blow(m, e, 0, 3.9) for m in (OXIDE, IRON) for e in (0.2, 0.4, 0.6, 0.8, 1)), 0.0025,
              watched=(1, 3)),
    "4": Test("a sphere and a wall, angle", tuple(oblique(m, 0.98, 0.092, 3.9, a) for m in (OXIDE, ALLOY) for a in (5, 15, 30, 45, 60, 85)),
              0.0025),
    "5": Test("a sphere and a wall, speed across", tuple(Blow(m, 1, 0.3, 5, v) for m in (STEEL, POLYETHYLENE) for v in (0.5, 2, 5, 10, 30, 70)), 1e-5),
    "6": Test("a sphere and a wall, spin", tuple(Blow(m, 0.5, 0.4, 0.2, 0, w) for m in (ALLOY, COPPER) for w in (0.2, 1, 3, 5, 9, 22)), 0.1),
    "7": Test("two equal spheres, spin of both", tuple(Blow(m, 0.5, 0.4, 0.4, 0, w, w) for m in (ALLOY, COPPER) for w in (0.2, 1, 3, 5, 9, 22)),
              0.1, 0.1),
    "8": Test("a small sphere that spins and a large one", tuple(Blow(m, 0.5, 0.4, 0.2, 0, 0, w) for m in (
        dataclasses.replace(ALLOY, density=1000 * ALLOY.density), dataclasses.replace(COPPER, density=1000 * COPPER.density)) for w in (0.2, 1, 3, 5, 9, 22)),
              0.5, 0.1, lighter=1000),
    "no slip": Test("a sphere and a wall, friction without a limit", tuple(Blow(m, 1, 1e6, 0.2, v) for m in (ALLOY, COPPER) for v in (0.02, 0.2)), 0.1),
}


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
            self.stations.append(Station(blow, state, k, target, row, None if test.wall else ids, n in test.watched and state in FREE))
        self.granules = ids
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

    def write(self, place, base):
        """The files of a run; the deck's variables."""
        test, r = self.test, self.test.radius
        files = {name: place / f"{base}.{name}" for name in ("data", "scene", "moves", "states", "watch", "gained")}
        kinds = list(dict.fromkeys((s.blow.material, s.blow.restitution, s.blow.friction) for s in self.stations))
        metals = list(dict.fromkeys(s.blow.material for s in self.stations))
        atoms, velocities, moves, triangles = [], [], [], {m: [] for m in metals}
        for s in self.stations:
            z, kind = STATION * max(r, test.reach / 2) * s.number, kinds.index((s.blow.material, s.blow.restitution, s.blow.friction)) + 1
            of_target, of_other = self.motions(s)
            x = r + self.gap(s) if test.wall else 0.0
            y = -s.blow.across * self.gap(s) / s.blow.speed
            density = s.blow.material.density
            atoms.append((s.target, kind, 2 * r, self.heavier * density, x, y, z))
            middle = COLUMN // 2
            ways = [k for k in range(-middle, middle + 1) if k]
            atoms += [(granule, kind, 2 * r, density, x, y, z + APART * 2 * r * k) for granule, k in zip(s.row, ways)]
            if s.other:
                atoms.append((s.other, kind, 2 * test.other_radius, density / test.lighter, -(r + test.other_radius + self.gap(s)), 0.0, z))
            else:  # seen by the target alone; the contact is amid it
                triangles[s.blow.material].append(((0, -8 * r, z - 0.8 * r), (0, 8 * r, z - 0.8 * r), (0, 0, z + 0.8 * r)))
            now = {granule: of_target for granule in (s.target, *s.row)} | ({s.other: of_other} if s.other else {})
            if not self.moves_at_once(s):
                now = dict.fromkeys(now, (0.0, 0.0, 0.0))
                moves += [f"set atom {granule} vx {v[0]:.17g} vy {v[1]:.17g} omegaz {v[2]:.17g}" for granule, v in ((s.target, of_target), (s.other, of_other)) if granule]
            velocities += [(granule, v) for granule, v in now.items()]
        types = len(kinds) + (len(metals) if test.wall else 0)
        width, height = 60 * max(r, test.reach / 2), STATION * max(r, test.reach / 2) * len(self.stations)
        files["data"].write_text(
            f"impacts\n\n{len(atoms)} atoms\n{types} atom types\n\n{-width:g} {width:g} xlo xhi\n{-width:g} {width:g} ylo yhi\n{-height / len(self.stations):g} {height:g} zlo zhi\n\nAtoms\n\n"
            + "".join("{} {} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g}\n".format(*a) for a in atoms) + "\nVelocities\n\n"
            + "".join("{} {:.17g} {:.17g} 0 0 0 {:.17g}\n".format(granule, *v) for granule, v in velocities))
        files["scene"].write_text(self.materials(kinds, metals) + self.walls(metals, triangles, len(kinds), place, base) + "".join(
            f"group {name} id {' '.join(map(str, ids))}\n" for name, ids in (("targets", [s.target for s in self.stations]), ("watched", self.watched()))))
        files["moves"].write_text("# what moves from here on\n" + "".join(line + "\n" for line in moves))
        self.files = files
        return {**files, "skin": repr(SKIN * test.reach), "bin": repr(STATION / 4 * test.reach), "dt": repr(self.dt), "before": self.before, "steps": self.steps, "every": max(1, self.before // 4)}

    def watched(self):
        return [i for s in self.stations if s.watched for i in (s.target, s.other) if i] or [self.stations[0].target]

    def materials(self, kinds, metals):
        def of(values):
            return " ".join(f"{v:.17g}" for v in values)
        walls = metals if self.test.wall else []
        each = [k[0] for k in kinds] + [dataclasses.replace(m, young=RIGID * m.young) for m in walls]
        pairs = {"coefficientRestitution": 1, "coefficientFriction": 2}
        lines = [f"fix young all property/global youngsModulus peratomtype {of(m.young for m in each)}",
                 f"fix poisson all property/global poissonsRatio peratomtype {of(m.poisson for m in each)}"]
        for name, at in pairs.items():
            values = [kinds[min(i, j)][at] if min(i, j) < len(kinds) else 1 for i in range(len(each)) for j in range(len(each))]
            lines.append(f"fix {name} all property/global {name} peratomtypepair {len(each)} {of(values)}")
        return "\n".join(lines) + f'\nvariable contact string "{MODEL} {SETTINGS}"\n'

    def walls(self, metals, triangles, kinds, place, base):
        if not self.test.wall:
            return ""
        lines = []
        for k, metal in enumerate(metals):
            stl = place / f"{base}-{k}.stl"
            meshes.write_stl(stl, triangles[metal])
            lines += [f"fix patch{k} all mesh/surface file {stl} type {kinds + k + 1}"]
        return "\n".join(lines) + f"\nfix patches all wall/gran {MODEL} mesh n_meshes {len(metals)} meshes {' '.join(f'patch{k}' for k in range(len(metals)))} {SETTINGS}\n"

    def gained(self):
        """What the target and the other have gained: along, across, spin, as an array (stations, 2, 3); and what all of a station have
        gained in momentum along and across, as an array (stations, 2)."""
        _, columns, rows = next(dumps.snapshots(self.files["gained"]))
        rows = rows[np.argsort(rows[:, 0])]
        motion = rows[:, [columns.index(c) for c in ("vx", "vy", "omegaz")]]
        out_of_plane = rows[:, [columns.index(c) for c in ("vz", "omegax", "omegay")]]
        found, momenta = [], []
        for s in self.stations:
            of_target, of_other = self.motions(s)
            if np.abs(out_of_plane[s.target - 1]).max() > OUT_OF_PLANE * self.test.scale(s.blow) / min(1, self.test.radius):
                raise RunError(f"{self.files['gained'].name}: the target of station {s.number} has left the plane of the blow")
            before = (0.0, 0.0, 0.0) if s.state == "restored" else of_target
            rest = [motion[granule - 1] - before for granule in s.row]
            found.append((motion[s.target - 1] - of_target, np.zeros(3) if of_other is None else motion[s.other - 1] - of_other))
            mass, other = self.test.mass(s.blow), 0 if s.other is None else self.test.pair(s.blow).masses[1]
            momenta.append(mass * (self.heavier * found[-1][0][:2] + sum((r[:2] for r in rest), np.zeros(2))) + other * found[-1][1][:2])
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
                    raise RunError(f"{self.files['states'].name}: at step {step} the target of station {s.number} is {found}, not as '{s.state}' says")

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
