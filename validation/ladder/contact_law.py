"""Two spheres, or a sphere and a wall, in the contact law `model hertz tangential history tangential_damping off`: closed forms, and the law
itself integrated to 1e-6 where there are none.

The normal force is F = K a^(3/2) + 5^(1/2) b (K m_d)^(1/2) a^(1/4) a', at the depth a. K = 4/3 E* R*^(1/2), b = -ln e/(ln^2 e + pi^2)^(1/2), and
m_d is the mass by which LIGGGHTS damps: the reduced mass of two spheres, the mass of a sphere at a wall. With u = a^(5/4) and a time
that runs by a^(1/4), it is a linear damped spring (Antypov & Elliott 2011, doi:10.1209/0295-5075/94/50004). The tangential force is
k_t s, at most mu |F|, with k_t = 8 G* (R* a)^(1/2) and the way s that the surfaces have slid on each other.
"""
import dataclasses
import math

import numpy as np
from scipy import integrate, special

STEPS = 1000  # of the law, in a contact


@dataclasses.dataclass(frozen=True)
class Material:
    young: float    # Pa
    poisson: float
    density: float  # kg/m^3


def modulus(a, b):
    """E* of two materials (Pa)."""
    return 1 / ((1 - a.poisson**2) / a.young + (1 - b.poisson**2) / b.young)


def shear_modulus(a, b):
    """G* of two materials (Pa)."""
    return 1 / (2 * (2 - a.poisson) * (1 + a.poisson) / a.young + 2 * (2 - b.poisson) * (1 + b.poisson) / b.young)


@dataclasses.dataclass(frozen=True)
class Pair:
    """What strikes what. Masses and moments of inertia are infinite for a wall, and those of the body for a granule that is locked."""
    modulus: float       # E*, Pa
    shear_modulus: float  # G*, Pa
    radii: tuple         # m; infinite for a wall
    masses: tuple        # kg
    inertias: tuple      # kg m^2
    damping_mass: float  # kg
    restitution: float
    friction: float
    speed: float         # m/s, of one towards the other

    @property
    def radius(self):
        return 1 / sum(1 / r for r in self.radii)

    @property
    def mass(self):
        return 1 / sum(1 / m for m in self.masses)

    @property
    def stiffness(self):
        return 4 / 3 * self.modulus * math.sqrt(self.radius)

    @property
    def damping_ratio(self):
        """Of the linear spring that the contact is in u."""
        log = math.log(self.restitution)
        return -log / math.hypot(log, math.pi) * math.sqrt(self.damping_mass / self.mass)

    @property
    def undamped_depth(self):
        return (5 * self.mass * self.speed**2 / (4 * self.stiffness))**0.4

    @property
    def largest_depth(self):
        z = self.damping_ratio
        return self.undamped_depth * math.exp(-0.8 * z * math.acos(z) / math.sqrt(1 - z**2))

    @property
    def largest_force(self):
        """Without damping (Hertz)."""
        return self.stiffness * self.undamped_depth**1.5

    @property
    def duration(self):
        """Until the depth is zero again; without damping 2.9432 depth/speed (Hertz)."""
        z = self.damping_ratio
        if z == 0:
            return self.undamped_depth / self.speed * 0.8 * math.sqrt(math.pi) * special.gamma(0.4) / special.gamma(0.9)
        whole, _ = integrate.quad(lambda phase: self.in_u(phase)[0]**-0.2, 0, math.pi, epsabs=0, epsrel=1e-10)
        return whole / self.frequency_in_u

    @property
    def rebound(self):
        """Speed after over speed before."""
        z = self.damping_ratio
        return math.exp(-math.pi * z / math.sqrt(1 - z**2))

    @property
    def frequency_in_u(self):
        """Of the damped spring."""
        return math.sqrt(5 * self.stiffness / (4 * self.mass) * (1 - self.damping_ratio**2))

    def in_u(self, phase):
        """u and, in its own time, du/dt, at a phase from 0 to pi."""
        z = self.damping_ratio
        tan = z / math.sqrt(1 - z**2)
        fall, start = np.exp(-tan * phase), 1.25 * self.speed
        return start / self.frequency_in_u * fall * np.sin(phase), start * fall * (np.cos(phase) - tan * np.sin(phase))

    def sliding(self):
        """What friction gives where the surfaces slide throughout: its impulse (N s), and the part of it that acts by the depth's half
        nearer, which LIGGGHTS takes off each radius (N m s)."""
        z = self.damping_ratio
        turn = 2 * math.acos(z)  # the force is zero here, and pulls from here on

        def by_depth(phase):
            u, rate = self.in_u(phase)
            slope = -2 * z / math.sqrt(1 - z**2) * rate - u * self.frequency_in_u / (1 - z**2)
            return 0.8 * self.mass * abs(slope) * u**0.8 / 2
        speeds = [0.8 * self.in_u(phase)[1] for phase in (0, turn, math.pi)]
        impulse = self.mass * sum(abs(b - a) for a, b in zip(speeds, speeds[1:]))
        arm = sum(integrate.quad(by_depth, a, b, epsabs=0, epsrel=1e-9)[0] for a, b in ((0, turn), (turn, math.pi)) if b > a)
        return self.friction * impulse, self.friction * arm

    @property
    def no_slip(self):
        """Slip after over slip before where friction never yields, without damping, and where the depth is nothing beside the radii. In
        time, the slip has the stiffness of a^(1/2): a hypergeometric equation in (a/depth)^(5/2), which is the same backwards."""
        q = 26.25 * self.shear_modulus / self.modulus / 6.25
        root = math.sqrt(0.0025 + q)
        (a, b), c = (0.05 + root, 0.05 - root), 0.6

        def at_the_deepest(a, b, c):
            gamma = special.gamma
            return gamma(c) * gamma(0.5) / (gamma(c - a) * gamma(c - b)), gamma(c) * gamma(-0.5) / (gamma(a) * gamma(b))
        (a1, b1), (a2, b2) = at_the_deepest(a, b, c), at_the_deepest(a + 0.4, b + 0.4, c + 0.8)
        return -1.25 * (a1 * b2 + b1 * a2)


def inertia(mass, radius):
    return 0.4 * mass * radius**2


def integrated(pairs, slips, spins):
    """The law, step by step: velocities (along the blow, across) and spin that each of both has gained, as an array (pairs, 2, 3). `slips`:
    speed of the first across, beside the second. `spins`: of both (1/s). The first comes from the side of larger x."""
    n = len(pairs)
    names = ("shear_modulus", "radius", "stiffness", "damping_ratio", "friction", "mass", "speed", "duration")
    of = {name: np.array([getattr(p, name) for p in pairs]) for name in names}
    radii = np.array([[r if math.isfinite(r) else 0 for r in p.radii] for p in pairs])
    by_mass, by_inertia = (np.array([[1 / v for v in getattr(p, name)] for p in pairs]) for name in ("masses", "inertias"))
    damping = 2 * of["damping_ratio"] * np.sqrt(1.25 * of["stiffness"] * of["mass"])
    wall = np.array([not math.isfinite(p.radii[1]) for p in pairs])
    reach = radii.sum(axis=1)

    place, velocity = np.zeros((n, 2)), np.stack([-of["speed"], np.asarray(slips, float)], axis=1)  # of the first against the second
    place[:, 0] = reach
    spin = np.array(spins, float)
    slid, gained = np.zeros(n), np.zeros((n, 2, 2))
    start = spin.copy()

    def rates(place, velocity, spin, slid):
        distance = np.where(wall, place[:, 0], np.hypot(*place.T))
        normal = np.where(wall[:, None], [1.0, 0.0], place / distance[:, None])
        across = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
        depth = np.maximum(reach - distance, 0)
        arms = np.where(radii > 0, radii - depth[:, None] / 2, 0)
        closing = -(velocity * normal).sum(axis=1)
        slip = (velocity * across).sum(axis=1) - (arms * spin).sum(axis=1)
        push = of["stiffness"] * depth**1.5 + damping * depth**0.25 * closing
        hold = 8 * of["shear_modulus"] * np.sqrt(of["radius"] * depth)
        with np.errstate(divide="ignore", invalid="ignore"):
            limit = np.where(depth > 0, of["friction"] * np.abs(push) / hold, 0)
        stretched = np.clip(slid, -limit, limit)
        force = push[:, None] * normal - (hold * stretched)[:, None] * across
        turning = (hold * stretched)[:, None] * arms
        return velocity, force * by_mass.sum(axis=1)[:, None], turning * by_inertia, np.where(depth > 0, slip, 0), force, limit

    # finer towards both ends, where the law has roots of the time; and on beyond the end, which friction puts off a little
    times = np.sin(np.linspace(0, np.pi / 2, STEPS + 1))**2
    times = np.concatenate([times, 1 + 0.02 * times[1::20]])
    state = [place, velocity, spin, slid]
    for share in np.diff(times):
        h = share * of["duration"]
        wide = h[:, None]

        def at(part, k):
            return [s + part * (wide if s.ndim > 1 else h) * rate for s, rate in zip(state, k)]
        k1 = rates(*state)
        k2 = rates(*at(0.5, k1))
        k3 = rates(*at(0.5, k2))
        k4 = rates(*at(1, k3))
        mean = [(a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(k1, k2, k3, k4)]
        state = at(1, mean)
        gained[:, 0] += wide * mean[4] * by_mass[:, :1]
        gained[:, 1] -= wide * mean[4] * by_mass[:, 1:]
        limit = rates(*state)[5]
        state[3] = np.clip(state[3], -limit, limit)
    return np.concatenate([gained, (state[2] - start)[:, :, None]], axis=2)
