"""What is compared of a bed: figures by name, of its granules' places alone. At rest a normal contact force is Hertz's of the overlap.
All but the floor's share and the coordination number of all are such that the size of the box does not matter."""
import numpy as np

from solidcull_runs import hertz
from solidcull_runs.beds_on_demand import measures

YOUNG, POISSON = 5e6, 0.3    # Pa; of material.in
STIFF = YOUNG / (2 * (1 - POISSON**2))
BANDS = 5                    # of the depth
THIRDS = 3
LAYER = 2.0                  # mean diameters: how far from a side a granule counts as near
SHARES = (10, 50, 90, 99)    # % of contacts that bear less


def on_sides(bed, sides):
    """Heights and normal forces of what presses on the four sides."""
    heights, forces = [], []
    for axis, side in zip("xy", sides):
        for distance in (bed[axis], side - bed[axis]):
            heights.append(bed["z"])
            forces.append(hertz.force(bed["radius"], bed["radius"] - distance, STIFF))
    return np.concatenate(heights), np.concatenate(forces)


def floor_load(bed):
    return float(hertz.force(bed["radius"], bed["radius"] - bed["z"], STIFF).sum())


def figures(bed, sides, depth, gravity, margin):
    """By name. `margin` (m): room that a side costs."""
    area, d = sides[0] * sides[1], 2 * bed["radius"].mean()
    weight = bed["mass"].sum() * gravity
    inside = (sides[0] - 2 * margin) * (sides[1] - 2 * margin)
    liquid = 2 * sum(sides) * weight / area * depth / 2  # N: what a liquid of that weight would press on the sides
    edges = np.linspace(0, depth, BANDS + 1)
    found = {f"solid fraction, {20 * k} to {20 * k + 20} % of the depth": float(phi)
             for k, phi in enumerate(measures.solid_fractions(bed, inside, edges))}
    distance = np.min([bed["x"], sides[0] - bed["x"], bed["y"], sides[1] - bed["y"]], axis=0)
    near = distance < LAYER * d
    inner = [s - 2 * LAYER * d for s in sides]
    low = near & (bed["z"] < 0.8 * depth)
    found["solid fraction near the sides"] = float((4 / 3 * np.pi * bed["radius"][low]**3).sum() / ((area - inner[0] * inner[1]) * 0.8 * depth))
    found["height of the surface"] = measures.height(bed, sides, d)
    pairs, force = hertz.contacts(bed, STIFF)
    found["coordination number"] = 2 * len(pairs) / len(bed)
    touches = np.bincount(pairs.ravel(), minlength=len(bed))
    found["coordination number near the sides"] = float(touches[near].mean())
    found["load on the floor, share of the weight"] = floor_load(bed) / weight
    height, load = on_sides(bed, sides)
    found["load on the sides, over that of a liquid"] = float(load.sum() / liquid)
    for k, name in enumerate(("lowest", "middle", "highest")):
        there = (height >= k * depth / THIRDS) & ((height < (k + 1) * depth / THIRDS) | (k == THIRDS - 1))
        found[f"load on the sides, {name} third"] = float(load[there].sum() / liquid)
    mean = force.mean()
    found["contact force, mean over the weight of a granule"] = float(mean / (weight / len(bed)))
    for share, value in zip(SHARES, np.percentile(force, SHARES)):
        found[f"contact force, {share} % of contacts bear less, over the mean"] = float(value / mean)
    return found


def margin_of(name):
    """Stated before the beds were compared; a share of the poured mean."""
    if name.startswith("solid fraction, 80"):
        return 0.03   # the surface is in it
    if name.startswith("solid fraction near"):
        return 0.02
    if name.startswith(("solid fraction", "height", "load on the floor")):
        return 0.01
    if name.startswith("coordination"):
        return 0.02
    if name.startswith("load on the sides"):
        return 0.10
    return 0.03 if "mean over" in name else 0.05
