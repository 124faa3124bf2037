"""Coarse-grained fields of a bed: solid fraction, momentum, stress; and their distance.

Each granule's quantity is spread by a Gaussian of width `WIDTH` mean diameters (Goldhirsch 2010), on a grid of the same spacing.
"""
import numpy as np
from scipy import ndimage

WIDTH = 1.5  # mean diameters
FIELDS = ("solid fraction", "velocity", "stress")


def box_of(granules, reach):
    """Low and high corner of the places, with a margin."""
    x = np.column_stack([granules[c] for c in "xyz"])
    return x.min(axis=0) - reach, x.max(axis=0) + reach


def coarse(granules, values, low, high, width):
    """Density (per m3) of each column of `values` on the grid: (columns, nx, ny, nz)."""
    shape = np.maximum(1, np.ceil((high - low) / width).astype(int))
    x = np.column_stack([granules[c] for c in "xyz"])
    fields = [np.histogramdd(x, bins=shape, range=list(zip(low, low + shape * width)), weights=v)[0] for v in np.atleast_2d(values)]
    return np.array([ndimage.gaussian_filter(f, 1.0, mode="constant") for f in fields]) / width**3


def fields(granules, low, high, width):
    """Solid fraction, momentum density over the mean density of the solid (m/s), and the contact stress (Pa), in this order, each
    (components, nx, ny, nz). Granules as in `dumps.read_final`, with vx vy vz and the columns of compute stress/atom."""
    volume = 4 / 3 * np.pi * granules["radius"]**3
    density = granules["mass"].sum() / volume.sum()
    found = [coarse(granules, volume, low, high, width)]
    found.append(coarse(granules, [granules["mass"] * granules[c] for c in ("vx", "vy", "vz")], low, high, width) / density)
    # LIGGGHTS gives minus the virial of a granule (Pa m3)
    found.append(coarse(granules, [-granules[f"c_twin_stress[{k}]"] for k in range(1, 7)], low, high, width))
    return found


def distance(a, b):
    """Relative L2 distance of a field from b."""
    size = np.sqrt((b**2).sum())
    return float(np.sqrt(((a - b)**2).sum()) / size) if size > 0 else 0.0


def distances(finals, references):
    """By field, the mean relative L2 distance of the beds `finals` from the mean of `references`; and of each reference from the mean
    of the others: the noise."""
    everything = [*finals, *references]
    width = WIDTH * 2 * float(np.mean(references[0]["radius"]))
    corners = [box_of(g, 3 * width) for g in everything]
    low, high = np.min([c[0] for c in corners], axis=0), np.max([c[1] for c in corners], axis=0)
    of_references = [fields(g, low, high, width) for g in references]
    of_finals = [fields(g, low, high, width) for g in finals]
    found = {}
    for k, name in enumerate(FIELDS):
        mean = np.mean([f[k] for f in of_references], axis=0)
        n = len(of_references)
        noise = [distance(f[k], (n * mean - f[k]) / (n - 1)) for f in of_references] if n > 1 else [0.0]
        error = [distance(f[k], mean) for f in of_finals]
        found[name] = {"error": float(np.mean(error)), "noise": float(np.mean(noise))}
    return found
