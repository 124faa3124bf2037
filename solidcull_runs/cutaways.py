"""Cut-away pictures of a bed and its interface mesh, from the .vtp files that `fix solid/cull` writes."""
import io

import numpy as np

from . import plots, vtp
from .plots import STATES

MESH = (0.72, 0.72, 0.72)
STRIKER = (0.30, 0.30, 0.33)
LIGHT = np.array([-0.35, -0.6, 0.72])  # towards the light, in (right, to the eye negative, up) of the picture

class Picture:
    """A parallel projection with a depth buffer: from the front, `turn` degrees to the side, `tilt` from above."""

    def __init__(self, low, high, pixels=700, turn=18, tilt=22):
        a, b = np.radians([turn, tilt])
        self.right = np.array([np.cos(a), np.sin(a), 0])
        self.up = np.array([-np.sin(a) * np.sin(b), np.cos(a) * np.sin(b), np.cos(b)])
        self.away = np.cross(self.up, self.right)
        corners = np.array(np.meshgrid(*zip(low, high))).reshape(3, -1).T
        u, v = corners @ self.right, corners @ self.up
        self.origin, self.scale = (u.min(), v.max()), pixels / (u.max() - u.min())
        shape = int(np.ceil((v.max() - v.min()) * self.scale)), pixels
        self.depth, self.image = np.full(shape, np.inf), np.ones(shape + (3,))

    def project(self, points):
        return np.column_stack([(points @ self.right - self.origin[0]) * self.scale,
                                (self.origin[1] - points @ self.up) * self.scale, points @ self.away * self.scale])

    def window(self, low, high):
        """Pixel ranges and pixel centres of a box, clipped to the picture."""
        h, w = self.depth.shape
        x0, y0 = max(int(low[0]), 0), max(int(low[1]), 0)
        x1, y1 = max(min(int(high[0]) + 1, w), x0), max(min(int(high[1]) + 1, h), y0)  # empty where the box lies outside
        return (slice(y0, y1), slice(x0, x1)), np.arange(x0, x1) + 0.5, np.arange(y0, y1)[:, None] + 0.5

    def put(self, box, mask, depth, shade, colour):
        near = mask & (depth < self.depth[box])
        self.depth[box][near] = np.broadcast_to(depth, near.shape)[near]
        self.image[box][near] = np.broadcast_to(shade, near.shape)[near][:, None] * np.asarray(colour)

    def spheres(self, centres, radii, colours):
        for (u, v, d), r, colour in zip(self.project(centres), radii * self.scale, colours):
            box, x, y = self.window((u - r, v - r), (u + r, v + r))
            nx, nz = (x - u) / r, (v - y) / r
            left = 1 - nx**2 - nz**2
            ny = -np.sqrt(np.maximum(left, 0))
            shade = 0.45 + 0.55 * np.maximum(nx * LIGHT[0] + ny * LIGHT[1] + nz * LIGHT[2], 0)
            self.put(box, left > 0, d + r * ny, shade, colour)

    def triangles(self, points, polys, colour):
        corners = self.project(points)[polys]
        for (a, b, c) in corners:
            (p, q) = (b - a), (c - a)
            twice = p[0] * q[1] - p[1] * q[0]
            if abs(twice) < 1e-12:
                continue
            box, x, y = self.window(np.minimum(np.minimum(a, b), c)[:2], np.maximum(np.maximum(a, b), c)[:2])
            s = ((x - a[0]) * q[1] - (y - a[1]) * q[0]) / twice
            t = ((y - a[1]) * p[0] - (x - a[0]) * p[1]) / twice
            n = np.cross(p, q)
            n /= np.linalg.norm(n)
            shade = 0.45 + 0.55 * abs(n[0] * LIGHT[0] + n[2] * LIGHT[1] - n[1] * LIGHT[2])
            self.put(box, (s >= 0) & (t >= 0) & (s + t <= 1), a[2] + s * p[2] + t * q[2], shade, colour)


def colours_of(bed):
    """The colour of each granule, by its state."""
    return np.array([STATES[int(s)][1] for s in bed["state"]])


def cut_away(bed, mesh, cut, low, high, pixels=700, striker_radius=np.inf):
    """Two images of one moment, the half with y < cut taken away: the granules by state, and the mesh with what is waking or
    larger than `striker_radius`."""
    x, r, state = bed["points"], bed["radius"].astype(float), bed["state"]
    big = r > striker_radius
    colours = colours_of(bed)
    colours[big] = STRIKER
    shown = big | (x[:, 1] >= cut)
    granules = Picture(low, high, pixels)
    granules.spheres(x[shown], r[shown], colours[shown])
    surface = Picture(low, high, pixels)
    shown &= big | (state == 3)
    surface.spheres(x[shown], r[shown], colours[shown])
    if mesh is not None and len(mesh.get("polys", ())):
        polys = mesh["polys"]
        surface.triangles(mesh["points"], polys[mesh["points"][polys][:, :, 1].mean(axis=1) >= cut], MESH)
    return granules.image, surface.image


def legend(figure, mesh=True):
    """The key of the colours, below the pictures."""
    from matplotlib.patches import Patch
    keys = [Patch(color=c, label=n) for n, c in STATES.values()] + mesh * [Patch(color=MESH, label="interface mesh")]
    figure.legend(handles=keys, loc="lower center", ncol=len(keys), frameon=False)


def film_strip(moments, file):
    """Writes one picture: a column for each of `moments` (title, granules image, mesh image)."""
    from PIL import Image
    figure, axes = plots.plt.subplots(2, len(moments), squeeze=False, figsize=(3.2 * len(moments), 5.4))
    for (top, bottom), (title, granules, mesh) in zip(axes.T, moments):
        top.imshow(granules)
        bottom.imshow(mesh)
        top.set_title(title)
    for ax in axes.flat:
        ax.axis("off")
    legend(figure)
    full = io.BytesIO()
    plots.save(figure, full, rect=(0, 0.05, 1, 1), dpi=110)
    Image.open(full).convert("RGB").quantize(200, Image.Quantize.MAXCOVERAGE).save(file, optimize=True)  # a third of the size


def cut_away_files(folder, step, cut, low, high, **how):
    """cut_away() of the files `bed.STEP.vtp` and `mesh.STEP.vtp`; None if there is no bed of that step."""
    bed, mesh = (vtp.file_at(folder / f"{kind}.*.vtp", step) for kind in ("bed", "mesh"))
    return cut_away(vtp.read(bed), vtp.read(mesh) if mesh else None, cut, low, high, **how) if bed else None
