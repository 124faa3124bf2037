"""How a bed is made: tiles, numbers of granules, and the variables of the decks. Lengths in m, times in s.

Times of the recipe are in units of sqrt(d/g) or of a fall through the height of the pour, so that it is the same for all granules.
"""
import math

from .wanted import Wanted

LEAST = 3            # tiles a side
TILE = 27            # least edge of a tile, in largest diameters
MARGIN = 0.2         # largest diameters: a side stands as far outside of the tiles. So much room a side costs a poured bed
LITTLE = 0.3         # of gravity, while the sides come to their places
MOST = 0.995         # of gravity, until the sides have their friction
ENOUGH = 1.05         # of what the tile bore across: the load goes down by so much more while the bed comes to rest
PRESS = 0.008        # mean diameters: how much farther the sides go in each time
PRESSES = 20
PILOT = 10           # largest diameters: edge of the tile that tells how high granules stand
GUESS = 0.58         # solid fraction, for the pilot
POURED_OVER = 3.6    # depths: height of the pour


def prime_above(n):
    n += 1 + n % 2
    while any(n % k == 0 for k in range(3, math.isqrt(n) + 1, 2)):
        n += 2
    return n


class Plan:
    """Of a bed that is wanted. `laid`: of tiles; else its box is poured as a whole."""

    def __init__(self, wanted: Wanted):
        self.wanted = w = wanted
        self.d, self.g, self.dt = w.diameter, w.material.gravity, w.material.timestep
        self.depth = w.depth or w.granules * w.volume / (GUESS * w.length * w.width)
        self.margin = MARGIN * 2 * w.largest
        edge = max(w.tile * 2 * w.largest, self.depth)
        inside = [side - 2 * self.margin for side in (w.length, w.width)]
        self.copies = tuple(int(side / edge + 1e-9) for side in inside)
        self.laid = min(self.copies) >= LEAST
        self.least_box = LEAST * edge + 2 * self.margin
        self.period = tuple(round(side / n, 12) for side, n in zip(inside, self.copies)) if self.laid else None
        self.top = w.top or 4 * self.depth
        self.beyond = 2 * w.largest  # how far LIGGGHTS's box and the floor reach out of the sides

    def steps(self, time):
        return max(20, round(time / self.dt))

    def common(self):
        """Variables of all decks."""
        w = self.wanted
        mass = min(4 / 3 * math.pi * r**3 * w.density for r, _ in w.sizes)
        unit = math.sqrt(self.d / self.g)
        return {"types": w.material.types, "skin": f"{0.15 * self.d:.6g}", "damping": f"{mass / (0.55 * unit):.6g}"}

    def pour(self, granules, sides, walls):
        """Of pour.in: a tile of these edges, or a box between walls."""
        w, r = self.wanted, self.wanted.largest
        height = max(POURED_OVER * self.depth, 12 * r)
        fall = math.sqrt(2 * height / self.g)
        return {**self.common(), "walls": int(walls), "allin": "yes" if walls else "no", "L": sides[0], "W": sides[1],
                "low": -self.beyond if walls else 0, "right": sides[0] + (self.beyond if walls else 0),
                "back": sides[1] + (self.beyond if walls else 0), "below": -self.beyond, "top": f"{height + 10 * r:.6g}",
                "pourlow": r, "pourtop": f"{height + r:.6g}", "fall": f"{1.9 * math.sqrt(self.g * self.d):.6g}",
                "wideskin": f"{0.38 * self.d:.6g}", "granules": granules, "seed": prime_above(100000 + 1009 * w.seed),
                "poursteps": self.steps(0.95 * fall), "dampsteps": self.steps(1.41 * fall), "freesteps": self.steps(0.95 * fall)}

    def sizes_deck(self):
        """Fixes of the sizes, for pour.in."""
        w = self.wanted
        seeds = [prime_above(500000 + 1009 * w.seed + 7919 * k) for k in range(len(w.sizes) + 1)]
        lines = [f"fix size{k} all particletemplate/sphere {seeds[k]} atom_type 1 density constant {w.density:.9g} radius constant {r:.9g}"
                 for k, (r, _) in enumerate(w.sizes)]
        shares = " ".join(f"size{k} {share:.9g}" for k, (_, share) in enumerate(w.sizes))
        return "\n".join([*lines, f"fix sizes all particledistribution/discrete/numberbased {seeds[-1]} {len(w.sizes)} {shares}"]) + "\n"

    def pilot_edge(self):
        return PILOT * 2 * self.wanted.largest

    def pilot_granules(self):
        return max(50, round(GUESS * self.depth * self.pilot_edge()**2 / self.wanted.volume))

    def granules_on(self, area, pilot_height):
        """That stand as high as is wanted on so much floor, where the pilot's stand `pilot_height`."""
        return round(self.pilot_granules() * area / self.pilot_edge()**2 * self.depth / pilot_height)

    def area(self):
        """Of a tile, or of a whole box without what its sides cost (m2)."""
        return self.period[0] * self.period[1] if self.laid else \
            (self.wanted.length - 2 * self.margin) * (self.wanted.width - 2 * self.margin)

    def base_sides(self):
        """Of the bed of LEAST x LEAST tiles."""
        return [LEAST * p + 2 * self.margin for p in self.period]

    def rest(self, sides, pushes):
        """Of rest.in; `pushes` (N/m): what a metre of a side across x and y is to bear."""
        unit = math.sqrt(self.d / self.g)
        return {**self.common(), "L": f"{sides[0]:.12g}", "W": f"{sides[1]:.12g}", "gravity": self.wanted.material.gravity_fix, "g": self.g,
                "little": f"{LITTLE * self.g:.6g}",
                "most": f"{MOST * self.g:.6g}", "gap": f"{self.wanted.largest - self.margin:.9g}", "press": f"{PRESS * self.d:.6g}",
                "presses": PRESSES, "across": f"{ENOUGH * MOST * 2 * (sides[1] * pushes[0] + sides[0] * pushes[1]):.9g}",
                "pushsteps": self.steps(0.15 * unit), "settlesteps": self.steps(unit), "presssteps": self.steps(0.37 * unit), "gripsteps": self.steps(1.5 * unit)}

    def doze(self, sides):
        return {**self.common(), "L": f"{sides[0]:.12g}", "W": f"{sides[1]:.12g}", "dozesteps": self.steps(2.0 * math.sqrt(self.d / self.g)),
                "rounds": 20}
