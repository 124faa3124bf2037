"""Triangles of simple shapes, and STL files of them."""
import numpy as np


def stl_text(name, triangles):
    """Triangles as STL text."""
    return f"solid {name}\n" + "".join(
        "facet normal 0 0 0\nouter loop\n" + "".join("vertex {:.9g} {:.9g} {:.9g}\n".format(*v) for v in t) + "endloop\nendfacet\n"
        for t in triangles) + f"endsolid {name}\n"


def write_stl(file, triangles):
    """Leaves a file alone that holds them, so that what is made of it is not older."""
    text = stl_text(file.stem, triangles)
    if not file.exists() or file.read_text() != text:
        file.write_text(text)


def grid(corner, side_u, side_v, n_u, n_v):
    """Triangles of a parallelogram, n_u x n_v cells of two, in rows along v."""
    corner, u, v = (np.array(a, float) for a in (corner, side_u, side_v))
    triangles = []
    for i in range(n_u):
        for j in range(n_v):
            a, b, c, d = (corner + u * (i + di) / n_u + v * (j + dj) / n_v for di, dj in ((0, 0), (1, 0), (1, 1), (0, 1)))
            triangles += [(a, b, c), (a, c, d)]
    return triangles


def block(low, high):
    """Triangles of a closed box."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    x, y, z = (x1 - x0, 0, 0), (0, y1 - y0, 0), (0, 0, z1 - z0)
    return [t for corner, u, v in ((low, y, x), (low, x, z), (low, z, y), ((x0, y0, z1), x, y), ((x1, y0, z0), y, z), ((x0, y1, z0), z, x))
            for t in grid(corner, u, v, 1, 1)]


def drum(radius, length, facets):
    """Triangles of a closed drum: axis y from 0 to its length, corners at its radius; each end cap in strips from rim to rim."""
    angle = 2 * np.pi * np.arange(facets) / facets
    rim = [[(radius * np.cos(a), y, radius * np.sin(a)) for a in angle] for y in (0.0, length)]
    triangles = []
    for k in range(facets):
        n = (k + 1) % facets
        triangles += [(rim[0][k], rim[0][n], rim[1][n]), (rim[0][k], rim[1][n], rim[1][k])]
    zigzag = [0] + [k for n in range(1, facets // 2) for k in (n, facets - n)] + [facets // 2]
    for corners in zip(zigzag, zigzag[1:], zigzag[2:]):
        triangles += [[cap[k] for k in corners] for cap in rim]
    return triangles
