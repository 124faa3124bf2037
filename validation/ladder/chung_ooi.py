"""The blows of Chung & Ooi (2011). Parameters of tests 1 to 5, 7 and 8 are those of published Yade and PySPH decks; 6 has the materials of 7."""
import dataclasses
import math

import contact_law
from contact_law import Material, Pair

COLUMN = 5      # granules of a target's body
RIGID = 1000    # a wall's modulus, of the sphere's
TOLERANCES = {"culled": 3, "keen": 1e-6, "held": 1e12}  # in weights: the default; wakes at once; does not wake by its load
WAIT = 30       # steps that who wakes may wait for others; not if its load is 10 tolerances off
UNPRESSED = 0.15 * 9.81  # N/kg, of each weight of the tolerance: what counts for a granule that nothing presses on, without gravity

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
        depth = min(blow.speed * time, pair.undamped_depth)
        push = force(depth)
        hold = 8 * pair.shear_modulus * math.sqrt(pair.radius * depth) * abs(self.slip(blow)) * time
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


def made(title, radius, *others, blows, materials, **more):
    return Test(title, tuple(blow for m in materials for blow in blows(m)), radius, *others, **more)


def spins(material, speed, of_target=True, of_other=False):
    return [Blow(material, 0.5, 0.4, speed, 0, w if of_target else 0, w if of_other else 0) for w in (0.2, 1, 3, 5, 9, 22)]


def dense(material):
    return dataclasses.replace(material, density=1000 * material.density)


TESTS = {
    "1": made("two equal spheres, elastic", 0.01, 0.01, materials=(GLASS, LIMESTONE), blows=lambda m: [Blow(m, 1, 0.35, 20)], watched=(0, 1)),
    "2": made("a sphere and a wall, elastic", 0.1, materials=(ALLOY_2, MAGNESIUM), blows=lambda m: [Blow(m, 1, 0, 0.2)], watched=(0, 1)),
    "3": made("a sphere and a wall, restitution", 0.0025, materials=(OXIDE, IRON),
              blows=lambda m: [Blow(m, e, 0, 3.9) for e in (0.2, 0.4, 0.6, 0.8, 1)], watched=(1, 4)),
    "4": made("a sphere and a wall, angle", 0.0025, materials=(OXIDE, ALLOY),
              blows=lambda m: [oblique(m, 0.98, 0.092, 3.9, a) for a in (5, 15, 30, 45, 60, 85)]),
    "5": made("a sphere and a wall, speed across", 1e-5, materials=(STEEL, POLYETHYLENE),
              blows=lambda m: [Blow(m, 1, 0.3, 5, v) for v in (0.5, 2, 5, 10, 30, 70)]),
    "6": made("a sphere and a wall, spin", 0.1, materials=(ALLOY, COPPER), blows=lambda m: spins(m, 0.2)),
    "7": made("two equal spheres, spin of both", 0.1, 0.1, materials=(ALLOY, COPPER), blows=lambda m: spins(m, 0.4, of_other=True)),
    "8": made("a small sphere that spins and a large one", 0.5, 0.1, materials=(dense(ALLOY), dense(COPPER)),
              blows=lambda m: spins(m, 0.2, of_target=False, of_other=True), lighter=1000),
    "no slip": made("a sphere and a wall, friction without a limit", 0.1, materials=(ALLOY, COPPER),
                    blows=lambda m: [Blow(m, 1, 1e6, 0.2, v) for v in (0.02, 0.2)]),  # not the paper's
}
