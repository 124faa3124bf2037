"""The files that a run leaves: the fix's counts, snapshots of granules, loads on mesh elements."""
import re
from pathlib import Path

import numpy as np

from .errors import RunError

COUNTS = ("exterior", "interface", "interior", "bodies", "stored_mass", "culled", "restored", "carves",
          "largest_excess", "seconds", "mass_error", "restore_energy")  # f_ID[1..12]


def text_of(file):
    try:
        return Path(file).read_text()
    except OSError as e:
        raise RunError(f"cannot read {file}: {e.strerror}; the run did not write it") from None


def read_counts(file):
    """COUNTS and "step" by name, each an array; None when the run was too short for a row."""
    rows = np.loadtxt(text_of(file).splitlines(), ndmin=2)
    return dict(zip(("step",) + COUNTS, rows.T)) if rows.size else None


def read_final(file):
    """The last snapshot of a dump `id mass radius x y z` as a structured array sorted by id."""
    *_, (_, columns, rows) = snapshots(file)
    kinds = [(c, int if c == "id" else float) for c in columns]
    granules = np.empty(len(rows), kinds)
    for c, values in zip(columns, rows.T):
        granules[c] = values
    return np.sort(granules, order="id")


def snapshots(file):
    """Each snapshot of a dump: step, names of the columns, rows."""
    parts = text_of(file).split("ITEM: TIMESTEP\n")[1:]
    if not parts:
        raise RunError(f"{file} holds no snapshot")
    for part in parts:
        head, _, rows = part.partition("ITEM: ATOMS ")
        columns, _, rows = rows.partition("\n")
        columns = columns.split()
        yield int(head.split()[0]), columns, np.array(rows.split(), float).reshape(-1, len(columns))


def element_forces(file):
    """Force (N) on each element of a mesh, from a dump `stresscomponents area`: (elements, 3)."""
    _, _, cells = text_of(file).partition("CELL_DATA")
    words = cells.split()
    n = int(words[0])
    at = words.index("stress") + 4  # name, components, tuples, type, values
    stress = np.array(words[at:at + 3 * n], float).reshape(n, 3)
    at = words.index("area") + 4
    return stress * np.array(words[at:at + n], float)[:, None]


def element_normal_loads(file):
    """Normal load (N) on each element of a mesh, by its number, from a dump `id stress`: every triangle has its own three points
    there, in its own order."""
    text = text_of(file)

    def values(heading):
        return np.array(re.search(heading + r"[^\n]*\n([-+.\deE\s]+)", text)[1].split(), dtype=float)
    corner = values("POINTS").reshape(-1, 3, 3)
    area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1) / 2
    return (values("normal_stress_average") * area)[np.argsort(values("meshid"))]
