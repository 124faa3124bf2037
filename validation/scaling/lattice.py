"""A bed that is at rest as it is made: a cubic lattice of granules, pressed together by their weight. So a bed of any size needs no
settling, and is asleep after the first looks. Blades and balls come with it."""
import math
import sys
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from solidcull_runs import meshes  # noqa: E402

RADIUS, DENSITY, YOUNG, POISSON, GRAVITY = 0.0012, 2500.0, 5e6, 0.3, 9.81  # m, kg/m^3, Pa, 1, m/s^2: as bed.in has them
BALL, BALL_DENSITY = 0.003, 4000.0  # m: its radius; kg/m^3
SQUEEZE = 1e-4                      # of a diameter: overlap of granules side by side
AROUND, ABOVE = 0.001, 0.03         # m: from the walls to the sides of the box, from the bed to its top
FLOOR = 8                           # squares of the floor along an edge


def overlap(force, radius):
    """Of two granules (radius: half of theirs) or of one and a wall, of Hertz's law (m)."""
    return (3 * force / (4 * YOUNG / (2 * (1 - POISSON**2)) * math.sqrt(radius)))**(2 / 3)


@dataclass
class Lattice:
    cells: tuple   # granules along x, y, z
    balls: tuple = (0, 0)  # along x and y, above the bed
    gap: float = 0.0       # m: between balls and bed
    corner: bool = False   # a ball is two diameters from each of two walls, instead of in the middle

    def __post_init__(self):
        nz, diameter = self.cells[2], 2 * RADIUS
        weight = DENSITY * 4 / 3 * math.pi * RADIUS**3 * GRAVITY
        side = SQUEEZE * diameter
        self.apart, self.edge = diameter - side, RADIUS - side * 0.5**(1 / 3)  # m: between granules, from a wall to the first
        self.heights = [RADIUS - overlap(nz * weight, RADIUS)]
        for k in range(1, nz):
            self.heights.append(self.heights[-1] + diameter - overlap((nz - k) * weight, RADIUS / 2))
        self.length, self.width = (2 * self.edge + (n - 1) * self.apart for n in self.cells[:2])
        self.top = self.heights[-1] + RADIUS

    @property
    def granules(self):
        return math.prod(self.cells)

    def rows(self):
        """Diameter, density and place of each granule, then of each ball."""
        nx, ny, _ = self.cells
        for z in self.heights:
            for i in range(nx):
                for j in range(ny):
                    yield 2 * RADIUS, DENSITY, self.edge + i * self.apart, self.edge + j * self.apart, z
        bx, by = self.balls
        for i in range(bx):
            for j in range(by):
                x, y = (4 * BALL,) * 2 if self.corner else ((i + 0.5) * self.length / bx, (j + 0.5) * self.width / by)
                yield 2 * BALL, BALL_DENSITY, x, y, self.top + self.gap + BALL

    def write(self, folder):
        """Writes bed.data, floor.stl and blade.stl; the variables that bed.in takes."""
        with open(folder / "bed.data", "w") as f:
            f.write(f"a bed at rest\n\n{self.granules + math.prod(self.balls)} atoms\n1 atom types\n\n"
                    f"{-AROUND} {self.length + AROUND:.12g} xlo xhi\n{-AROUND} {self.width + AROUND:.12g} ylo yhi\n"
                    f"{-AROUND} {self.top + ABOVE:.12g} zlo zhi\n\nAtoms\n\n")
            for n, (diameter, density, x, y, z) in enumerate(self.rows(), 1):
                f.write(f"{n} 1 {diameter:.6g} {density:.6g} {x:.16g} {y:.16g} {z:.16g}\n")
        out = 0.9 * AROUND
        meshes.write_stl(folder / "floor.stl", meshes.grid((-out, -out, 0), (self.length + 2 * out, 0, 0), (0, self.width + 2 * out, 0), FLOOR, FLOOR))
        meshes.write_stl(folder / "blade.stl", meshes.grid((self.length / 2, self.width / 4, self.top + 0.0003), (0, self.width / 2, 0), (0, 0, 0.01), 2, 2))
        return {"Lx": f"{self.length:.16g}", "Ly": f"{self.width:.16g}", "granules": self.granules}
