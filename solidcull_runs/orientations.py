"""How granules are turned, told from the spins in the files of `bed N FILE spin`.

A spin is taken to change evenly from file to file. So a granule that rolls is turned as far as it rolled, and one that spins many
times between two files is turned by some angle. What lies in a solid body turns with that body. In the first file in which a granule
stands it is not turned.
"""
import numpy as np

from .errors import RunError


def times(first, second):
    """Quaternions w x y z, by rows: first the second turn, then the first one."""
    a, b = first[:, :1], second[:, :1]
    u, v = first[:, 1:], second[:, 1:]
    return np.hstack([a * b - (u * v).sum(axis=1, keepdims=True), a * v + b * u + np.cross(u, v)])


def by_vectors(turns):
    """Quaternions of turns about these vectors, by their lengths (rad)."""
    angle = np.linalg.norm(turns, axis=1, keepdims=True)
    return np.hstack([np.cos(angle / 2), turns * np.sinc(angle / (2 * np.pi)) / 2])


def angles(quaternions):
    """Euler angles (rad) about x, then y, then z, all of them fixed axes; as Blender and Houdini take them."""
    w, x, y, z = quaternions.T
    return np.column_stack([np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
                            np.arcsin(np.clip(2 * (w * y - x * z), -1, 1)),
                            np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))])


class Orientations:
    """Follows files in the order of their times."""

    def __init__(self):
        self.turned, self.spin, self.time = np.empty((0, 4)), np.empty((0, 3)), np.empty(0)  # by id, as in the last file that had it

    def follow(self, bed):
        """The quaternions w x y z of the granules of a file, in its order. bed: as vtp.read() gives it."""
        if "w" not in bed:
            raise RunError("the files of `bed` have no spins: write them with the word 'spin' behind the file")
        at = bed["id"]
        lacks = at.max(initial=0) + 1 - len(self.time)
        if lacks > 0:
            self.turned = np.vstack([self.turned, np.tile((1.0, 0, 0, 0), (lacks, 1))])
            self.spin = np.vstack([self.spin, np.zeros((lacks, 3))])
            self.time = np.append(self.time, np.full(lacks, np.nan))
        span = np.nan_to_num(bed["time"] - self.time[at])[:, None]
        self.turned[at] = times(by_vectors((self.spin[at] + bed["w"]) / 2 * span), self.turned[at])
        self.spin[at], self.time[at] = bed["w"], bed["time"]
        return self.turned[at]
