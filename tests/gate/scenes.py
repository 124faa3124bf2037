"""The short scenes of the gate, and running them: all of them in one LIGGGHTS, one after the other."""
import hashlib
import shutil
from pathlib import Path

import numpy as np

from solidcull_runs import meshes
from solidcull_runs.engine import Process
from solidcull_runs.errors import RunError

HERE = Path(__file__).resolve().parent
DECKS, BEDS = HERE / "decks", HERE / "beds"
SCENES = ("strike", "seam", "live", "fronts", "load", "blade", "tilt", "rain", "fall", "bar", "clumps")
MARK = "gate: scene "
NUDGE = 1e-14        # how far runs of an ensemble are from each other, of what is moved
BOX_LENGTH = 0.025   # m, along x
DENSITY = 2500       # kg/m^3

# file of granules: its bed, and the box (m)
BOX = (-0.0025, 0.0275, -0.0025, 0.02, -0.0025, 0.06)
DATA = {"bed.data": ("box", BOX),
        "seam.data": ("seam", (0.0, BOX_LENGTH, *BOX[2:])),
        "fall.data": ("box", (-0.03, 0.09, -0.03, 0.06, -0.0025, 0.06))}


def floor(low, high, rim=0.0025):
    """A half of the floor, from low to high along x (m)."""
    return meshes.stl_text("floor", meshes.grid((low, -rim, 0), (high - low, 0, 0), (0, 0.0175 + 2 * rim, 0), 1, 1))


MESHES = {"west.stl": floor(-0.0025, 0.0125), "east.stl": floor(0.0125, 0.0275),
          "wide_west.stl": floor(-0.0275, 0.0125, 0.0275), "wide_east.stl": floor(0.0125, 0.0525, 0.0275),
          "west_of_seam.stl": floor(0, 0.0125), "east_of_seam.stl": floor(0.0125, BOX_LENGTH),
          "blade.stl": meshes.stl_text("blade", meshes.block((0.006, 0.004, 0.0415), (0.0072, 0.0135, 0.055)))}


def data_text(file, member):
    """Granules for LIGGGHTS's read_data. Each member of an ensemble has its own rounding of their places; member 0 has none."""
    bed, box = DATA[file]
    rows = np.loadtxt(BEDS / f"{bed}.txt")
    places = rows[:, 2:]
    if member:
        places = places + NUDGE * BOX_LENGTH * np.random.default_rng([member, len(rows)]).uniform(-1, 1, places.shape)
    sides = "".join(f"{box[2 * d]} {box[2 * d + 1]} {axis}lo {axis}hi\n" for d, axis in enumerate("xyz"))
    granules = "".join(f"{row[0]:.0f} 1 {row[1]:.4g} {DENSITY} {x:.17g} {y:.17g} {z:.17g}\n" for row, (x, y, z) in zip(rows, places))
    return f"granules\n\n{len(rows)} atoms\n1 atom types\n\n{sides}\nAtoms\n\n{granules}"


def all_scenes():
    """One deck: the bed, then each scene."""
    parts = ["include bed.in\n"] + [f'clear\nprint "{MARK}{scene}"\nvariable scene string {scene}\ninclude {scene}.in\n' for scene in SCENES]
    return "".join(parts)


def recipe():
    """What the figures of a run hang on, as a hash."""
    texts = [f.read_text() for folder in (DECKS, BEDS) for f in sorted(folder.iterdir())]
    made = hashlib.sha256()
    for text in (*texts, *MESHES.values(), all_scenes(), repr(DATA), repr(NUDGE)):
        made.update(text.encode())
    return made.hexdigest()[:16]


def run(launcher, folder, member, ranks=1):
    """Runs all scenes in an empty folder; what was printed. RunError names the scene in which LIGGGHTS stopped."""
    folder = Path(folder)
    for file in DECKS.iterdir():
        shutil.copy(file, folder)
    for file, text in MESHES.items():
        (folder / file).write_text(text)
    for file in DATA:
        (folder / file).write_text(data_text(file, member))
    (folder / "all.in").write_text(all_scenes())
    nudge = NUDGE * np.random.default_rng([member, 0]).uniform(-1, 1) if member else 0.0
    process = Process(launcher, "all.in", folder, folder / "screen.txt", {"px": ranks, "nudge": repr(float(nudge))}, ranks)
    try:
        return process.wait()
    except RunError as e:
        printed = (folder / "screen.txt").read_text(errors="replace")
        begun = [line[len(MARK):] for line in printed.splitlines() if line.startswith(MARK)]
        raise SceneStopped(begun[-1] if begun else "bed", str(e).split(": ", 1)[-1].split(" (all of it")[0]) from None


class SceneStopped(RunError):
    """LIGGGHTS stopped in a scene."""

    def __init__(self, scene, why):
        super().__init__(f"{scene}: {why}")
        self.scene, self.why = scene, why
