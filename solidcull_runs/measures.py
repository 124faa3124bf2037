"""What is measured of a run: the surface of its bed, from the places of the granules; sums over all granules, from thermo columns."""
import itertools

import numpy as np

STORED = {"x": "f_cull[20]", "y": "f_cull[21]", "z": "f_cull[22]"}


def height_map(granules, low, size, cell, ground=0.0):
    """Height of the surface (m) over a grid of cells that begins at `low` (x, y) and is `size` wide; `ground` where no granule is."""
    shape = round(size[0] / cell), round(size[1] / cell)
    height = np.full(shape, float(ground))
    x, y, z, r = granules["x"] - low[0], granules["y"] - low[1], granules["z"], granules["radius"]
    reach = int(np.ceil(r.max() / cell))
    i, j = np.floor(x / cell).astype(int), np.floor(y / cell).astype(int)
    for di, dj in itertools.product(range(-reach, reach + 1), repeat=2):
        left = r**2 - ((i + di + 0.5) * cell - x)**2 - ((j + dj + 0.5) * cell - y)**2
        k = (left > 0) & (i + di >= 0) & (i + di < shape[0]) & (j + dj >= 0) & (j + dj < shape[1])
        np.maximum.at(height, (i[k] + di, j[k] + dj), z[k] + np.sqrt(left[k]))
    return height


def crater(before, after, size, cell, within=np.inf):
    """What the surface of a bed has lost and gained (m3), as far as `within` (m) from the middle."""
    change = (height_map(after, (0, 0), size, cell) - height_map(before, (0, 0), size, cell)) * cell**2
    x, y = ((np.arange(n) + 0.5) * cell - width / 2 for n, width in zip(change.shape, size))
    change = change[np.hypot(x[:, None], y) < within]
    return float(-change[change < 0].sum()), float(change[change > 0].sum())


def rms(a, b):
    """Root mean square of the difference of two maps, where both have a value."""
    return float(np.sqrt(np.nanmean((a - b)**2)))


def centre_height(granules):
    """Height of the centre of mass (m)."""
    return float(np.average(granules["z"], weights=granules["mass"]))


def outside(granules, size, floor=0.0):
    """Granules whose centre is behind a wall: x from 0 to size[0], y from 0 to size[1], z above the floor."""
    x, y, z = granules["x"], granules["y"], granules["z"]
    return int(((x < 0) | (x > size[0]) | (y < 0) | (y > size[1]) | (z < floor)).sum())


# --- from thermo columns: what LIGGGHTS sees, and what the fix says of the granules in its store ---

def series(run, *names):
    """Columns without their first row: where a run was before, LIGGGHTS counts the loads on meshes twice there."""
    found = [run.series(name)[1][1:] for name in names]
    return found[0] if len(found) == 1 else found


def time(run):
    """Time since the fix line (s), without the first row too."""
    t = run.series("time")[1]
    return t[1:] - t[0]


def kinetic_energy(run):
    """Of all granules (J), of the columns c_ke and f_cull[19]."""
    return series(run, "c_ke") + (series(run, "f_cull[19]") if run.counts else 0)


def centre(run, axis):
    """A coordinate of the centre of mass of all granules (m), of the columns v_mass, v_AXIS, f_cull[5] and f_cull[20..22]."""
    at = series(run, f"v_{axis}")
    if not run.counts:
        return at
    mass, stored = series(run, "v_mass", "f_cull[5]")
    return (mass * at + stored * series(run, STORED[axis])) / (mass + stored)
