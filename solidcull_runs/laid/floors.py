"""A floor as a grid of triangles, and which of them a granule stands on."""
from pathlib import Path

import numpy as np

from ..meshes import grid, stl_text
from .columns import WORDS
from .culled_files import CulledFileError


class Floor:
    """A regular grid of triangles, two a square: which element a place is on."""

    def __init__(self, file):
        corners = np.array([line.split()[1:] for line in Path(file).read_text().splitlines() if line.split()[:1] == ["vertex"]], dtype=float)
        self.triangles = corners.reshape(-1, 3, 3)[:, :, :2]
        xs, ys = (np.unique(self.triangles[:, :, d].round(9)) for d in (0, 1))
        self.low, self.step = np.array([xs[0], ys[0]]), np.array([xs[1] - xs[0], ys[1] - ys[0]])
        self.n = len(xs) - 1, len(ys) - 1
        if len(self.triangles) != 2 * self.n[0] * self.n[1]:
            raise CulledFileError(f"{file} is no grid of triangles, two a square")

    def element(self, place):
        """For rows of places."""
        cell = np.clip(((place[:, :2] - self.low) / self.step).astype(int), 0, np.array(self.n) - 1)
        first = 2 * (cell[:, 0] * self.n[1] + cell[:, 1])
        a, b, c = (self.triangles[first, k] for k in range(3))
        def side(p, q):
            return (q[:, 0] - p[:, 0]) * (place[:, 1] - p[:, 1]) - (q[:, 1] - p[:, 1]) * (place[:, 0] - p[:, 0])
        one, two, three = side(a, b), side(b, c), side(c, a)
        inside = ((one >= 0) & (two >= 0) & (three >= 0)) | ((one <= 0) & (two <= 0) & (three <= 0))
        return np.where(inside, first, first + 1)


def write_floor(file, sides, beyond, element):
    """A regular grid of triangles, in rows along y, two a square: element 2 (i ny + j) is the lower right one. It reaches `beyond` the
    sides (m); a square's edge is about `element` (m)."""
    size = [s + 2 * beyond for s in sides]
    n = [max(1, round(s / element)) for s in size]
    Path(file).write_text(stl_text("floor", grid((-beyond, -beyond, 0), (size[0], 0, 0), (0, size[1], 0), *n)))


def elements(old, place_then, place_now, floor_then, floor_now):
    """Numbers of floor elements, as words, of contacts of a column; and how many of `old` are not those below their granules."""
    known = old.astype(np.int64)
    under = floor_then.element(place_then)
    now = floor_now.element(place_now)
    return np.where(known == under, now, (now + 1) % len(floor_now.triangles)).astype(WORDS), int((known != under).sum())
