"""The figures of a run of all scenes: a name, a number, and what one granule makes of it."""
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenes import MARK, SCENES
from solidcull_runs.dumps import snapshots, text_of
from solidcull_runs.errors import RunError

# of a granule of the beds, in SI units: below a part in 10^9 of this, and of the figure itself, all is rounding
DIAMETER, MASS, GRAVITY = 0.0026, 2.3e-5, 9.81
SPEED = (GRAVITY * DIAMETER) ** 0.5
UNIT = {"": 1.0, "kg": MASS, "m": DIAMETER, "m/s": SPEED, "rad/s": SPEED / DIAMETER, "kg m/s": MASS * SPEED,
        "kg m^2/s": MASS * SPEED * DIAMETER, "J": MASS * GRAVITY * DIAMETER, "N": MASS * GRAVITY, "N m": MASS * GRAVITY * DIAMETER,
        "N^2": (MASS * GRAVITY) ** 2, "kg m": MASS * DIAMETER}
AXES = ("x", "y", "z")


def along(name, unit):
    return [(f"{name} {axis}", unit) for axis in AXES]


# columns of the rows that a run prints
COLUMNS = {"cull[1]": ("exterior granules", ""), "cull[2]": ("interface granules", ""), "cull[4]": ("bodies", ""),
           "cull[5]": ("stored mass", "kg"), "cull[6]": ("granules culled", ""), "cull[7]": ("granules restored", ""),
           "cull[8]": ("carves", ""), "cull[9]": ("largest load change over tolerance", ""), "cull[12]": ("energy added", "J"),
           "cull[19]": ("kinetic energy of interior", "J"), "cull[27]": ("kinetic energy", "J"), "cull[28]": ("energy of spins", "J"),
           "cull[30]": ("culled again, moved", ""), "cull[31]": ("exterior granule-steps", "")}
COLUMNS |= {f"cull[{13 + k}]": what for k, what in enumerate(along("momentum of interior,", "kg m/s") + along("angular momentum of interior,", "kg m^2/s"))}
COLUMNS |= {f"cull[{24 + k}]": what for k, what in enumerate(along("centre of mass,", "m"))}
for mesh in ("west", "east", "blade"):
    COLUMNS |= {f"{mesh}[{k + 1}]": what for k, what in enumerate(along(f"force on {mesh},", "N") + along(f"torque on {mesh},", "N m"))}


@dataclass
class Figure:
    scene: str
    when: str
    what: str
    value: float
    unit: str

    @property
    def name(self):
        return f"{self.scene} | {self.when} | {self.what}"


def rows_of(printed):
    """{scene: [(step, {column: number})]} of the rows that were printed while granules were culled, each step once: LIGGGHTS
    counts mesh loads twice in the row that a run begins with."""
    rows, scene, columns = {}, None, None
    for line in printed.splitlines():
        words = line.split()
        if line.startswith(MARK):
            scene = line[len(MARK):]
        elif words[:1] == ["Step"]:
            columns, first = (words, True) if "cull[1]" in words else (None, False)
        elif line.startswith("Loop time"):
            columns = None
        elif scene and columns and len(words) == len(columns) and words[0].isdigit():
            if not first:
                rows.setdefault(scene, []).append((int(words[0]), {c: float(w) for c, w in zip(columns[2:], words[2:])}))
            first = False
    return rows


def pattern(ids):
    """A number between -1 and 1 for each granule, by its tag: a sum with it sees what any one of them does."""
    return np.cos(2.399963 * ids)


def of_granules(file):
    """Sums over all granules of a dump: (what, value, unit)."""
    _, columns, rows = next(snapshots(file))
    g = dict(zip(columns, rows[np.argsort(rows[:, columns.index("id")])].T))
    m, sign = g["mass"], pattern(g["id"])
    place, velocity, spin, force = (np.array([g[c] for c in group]) for group in
                                    (("x", "y", "z"), ("vx", "vy", "vz"), ("omegax", "omegay", "omegaz"), ("fx", "fy", "fz")))
    found = [("granules", len(m), ""), ("mass", m.sum(), "kg"), ("kinetic energy", 0.5 * (m * velocity**2).sum(), "J"),
             ("energy of spins", 0.2 * (m * (g["radius"] * spin) ** 2).sum(), "J"),
             ("sum of forces", np.linalg.norm(force, axis=0).sum(), "N")]
    for d, axis in enumerate(AXES):
        found += [(f"momentum, {axis}", (m * velocity[d]).sum(), "kg m/s"), (f"pattern of places, {axis}", (sign * place[d]).sum(), "m"),
                  (f"pattern of velocities, {axis}", (sign * velocity[d]).sum(), "m/s"),
                  (f"pattern of spins, {axis}", (sign * spin[d]).sum(), "rad/s"), (f"pattern of forces, {axis}", (sign * force[d]).sum(), "N")]
    turning = (m * np.cross(place.T, velocity.T).T).sum(1)
    return found + [(f"angular momentum, {axis}", turning[d], "kg m^2/s") for d, axis in enumerate(AXES)]


def of_contacts(file):
    """Of the forces of all contacts of a dump: how many, how large, how unequal."""
    rows = np.array(text_of(file).split("ITEM: ENTRIES", 1)[1].partition("\n")[2].split(), float).reshape(-1, 6)
    normal, tangential = np.linalg.norm(rows[:, :3], axis=1), np.linalg.norm(rows[:, 3:], axis=1)
    return [("contacts that bear", np.count_nonzero(normal), ""), ("normal forces", normal.sum(), "N"),
            ("squares of normal forces", (normal**2).sum(), "N^2"), ("tangential forces", tangential.sum(), "N"),
            ("squares of tangential forces", (tangential**2).sum(), "N^2")]


def of_run(printed, folder):
    """All figures of a run, in a fixed order."""
    rows, found = rows_of(printed), []
    for scene in SCENES:
        if scene not in rows:
            raise RunError(f"{scene}: nothing was printed while granules were culled")
        for step, row in rows[scene]:
            found += [Figure(scene, f"step {step}", COLUMNS[c][0], value, COLUMNS[c][1]) for c, value in row.items() if c in COLUMNS]
        for when, file, measure in (("restored", "restored", of_granules), ("restored", "contacts", of_contacts),
                                    ("later", "later", of_granules)):
            found += [Figure(scene, when, what, float(value), unit) for what, value, unit in measure(Path(folder) / f"{scene}.{file}")]
    return found
