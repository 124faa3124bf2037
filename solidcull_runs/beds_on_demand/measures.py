"""What is measured of a bed's granules."""
import numpy as np

MIDDLE = (0.2, 0.7)  # of the height: where the solid fraction is that of the bulk


def height(granules, sides, diameter):
    """Mean height of the surface (m): of the highest granule in each square, a diameter wide."""
    n = [max(1, int(s / diameter)) for s in sides]
    cells = [np.clip((granules[axis] % side / side * k).astype(int), 0, k - 1) for axis, side, k in zip("xy", sides, n)]
    tops = np.full(n, -np.inf)
    np.maximum.at(tops, tuple(cells), granules["z"] + granules["radius"])
    return float(tops[np.isfinite(tops)].mean())


def volume_below(granules, z):
    """Of the parts of the spheres below z (m3)."""
    r = granules["radius"]
    h = np.clip(z - granules["z"] + r, 0, 2 * r)
    return float((np.pi * h * h * (r - h / 3)).sum())


def solid_fractions(granules, area, edges):
    """Between one height and the next (m)."""
    below = np.array([volume_below(granules, z) for z in edges])
    return np.diff(below) / (area * np.diff(edges))


def solid_fraction(granules, area, high):
    """Of the bulk of a bed that is so high (m)."""
    return float(solid_fractions(granules, area, [share * high for share in MIDDLE])[0])
