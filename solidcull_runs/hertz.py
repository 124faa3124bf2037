"""Normal forces of contacts at rest, as Hertz has them of the overlaps: of places alone."""
import numpy as np
from scipy.spatial import cKDTree


def force(radius, overlap, modulus=1.0):
    """On a sphere, or two of this effective radius (m); `modulus`: the effective one (Pa). N."""
    overlap = np.maximum(overlap, 0)
    return 4 / 3 * modulus * np.sqrt(radius * overlap) * overlap


def contacts(granules, modulus=1.0):
    """Both granules of each contact, and its normal force (N)."""
    place = np.column_stack([granules[c] for c in "xyz"])
    pairs = cKDTree(place).query_pairs(2.05 * granules["radius"].max(), output_type="ndarray")
    one, other = granules["radius"][pairs].T
    overlap = one + other - np.linalg.norm(place[pairs[:, 0]] - place[pairs[:, 1]], axis=1)
    touch = overlap > 0
    return pairs[touch], force((one * other / (one + other))[touch], overlap[touch], modulus)
