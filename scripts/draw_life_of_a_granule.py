#!/usr/bin/python3
"""Draws fix_solid_cull/life_of_a_granule.png, the picture at the head of the command page.

    scripts/draw_life_of_a_granule.py [FILE.png]

Above: a bed that a ball has struck, cut open. Below: the three places of a granule, and what moves it between them.
"""
import io
import sys
from pathlib import Path

import matplotlib
matplotlib.use("Agg")
import matplotlib.pyplot as plt                                         # noqa: E402
import numpy as np                                                      # noqa: E402
from matplotlib.collections import EllipseCollection                    # noqa: E402
from matplotlib.patches import Circle, FancyArrowPatch, FancyBboxPatch  # noqa: E402
from PIL import Image                                                   # noqa: E402

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
from solidcull_runs import cutaways, plots  # noqa: E402

EXTERIOR, INTERFACE, INTERIOR, WAKING = (plots.STATES[s][1] for s in (0, 1, 2, 3))
MESH, BALL, INK = (0.45, 0.45, 0.45), cutaways.STRIKER, "0.15"
WAKING_INK = (0.72, 0.36, 0.0)                 # dark enough to be read
WIDTH, BED_HEIGHT, HEIGHT = 100.0, 22.0, 62.0  # of the page, in its own units
RADIUS = 1.15                                  # of a granule, mean
STRUCK = np.array([50.0, 23.6])                # the ball's centre
BALL_RADIUS, CRATER, COVER = 4.6, 12.5, 3.4    # ball; what it keeps awake; the cover of the rest


def bed(seed=3):
    """Places and radii of granules in a bed of two sizes: a lattice, slightly shaken."""
    rng = np.random.default_rng(seed)
    step = 2.06 * RADIUS
    rows = [(x + (k % 2) * step / 2, y) for k, y in enumerate(np.arange(RADIUS, BED_HEIGHT, step * 0.87))
            for x in np.arange(RADIUS, WIDTH - RADIUS - step / 2, step)]
    places = np.array(rows) + rng.uniform(-0.09, 0.09, (len(rows), 2))
    radii = RADIUS * rng.choice([0.94, 1.04], len(rows))
    return places, radii, np.hypot(*(places - STRUCK).T) > BALL_RADIUS + 1.05 * radii


def states(places):
    """The state of each granule: the bowl under the ball and the cover are exterior, the next layer and the walls interface."""
    near_ball = np.hypot(*(places - STRUCK).T)
    top = BED_HEIGHT - COVER
    exterior = (near_ball < CRATER) | (places[:, 1] > top)
    layer = 2.4 * RADIUS
    shell = (near_ball < CRATER + layer) | (places[:, 1] > top - layer) | (places[:, 1] < 1.5 * RADIUS) | \
        (places[:, 0] < 2.2 * RADIUS) | (places[:, 0] > WIDTH - 3.4 * RADIUS)
    state = np.where(exterior, 0, np.where(shell, 1, 2))
    waking = (state == 1) & (near_ball < CRATER + layer) & (np.abs(places[:, 0] - STRUCK[0] - 4.5) < 2.6)
    return np.where(waking, 3, state)


def draw_bed(ax, bottom):
    places, radii, there = bed()
    state = states(places)
    solid = there & (state > 0)
    x, y = np.meshgrid(np.linspace(-1.5, WIDTH + 1.5, 620), np.linspace(-1.5, BED_HEIGHT + 2, 150))
    distance = np.min([np.hypot(x - p[0], y - p[1]) - r for p, r in zip(places[solid], radii[solid])], axis=0)
    ax.contourf(x, y + bottom, distance, [-99, 0.34], colors=[(0.86, 0.86, 0.86)], zorder=1)
    ax.contour(x, y + bottom, distance, [0.34], colors=[MESH], linewidths=2.2, zorder=2)
    colours = [plots.STATES[s][1] for s in state[there]]
    ax.add_collection(EllipseCollection(2 * radii[there], 2 * radii[there], 0, units="xy", offsets=places[there] + [0, bottom],
                                        transOffset=ax.transData, facecolors=colours, edgecolors=(0, 0, 0, 0.45),
                                        linewidths=0.5, zorder=3))
    ax.plot([-0.8, -0.8, 98.9, 98.9], np.array([BED_HEIGHT + 1, -0.9, -0.9, BED_HEIGHT + 1]) + bottom, color=INK, lw=1.6, zorder=1)
    ax.add_patch(Circle(STRUCK + [0, bottom], BALL_RADIUS, color=BALL, zorder=4))

    def label(text, at, to, **how):
        ax.annotate(text, xy=(to[0], to[1] + bottom), xytext=(at[0], at[1] + bottom), fontsize=9.5, color=INK, va="center",
                    arrowprops={"arrowstyle": "-", "color": INK, "lw": 0.9, "shrinkA": 1, "shrinkB": 0}, zorder=6, **how)

    label("exterior", (13, 27), (13, 21.2), ha="center")
    label("interface", (25, 27), (25, 17), ha="center")
    label("interior", (75, 27), (75, 8), ha="center")
    label("interface mesh", (89, 27), (89, 18.9), ha="center")
    label("waking", (63, 27), (55, 10.2), ha="left")


def box(ax, middle, colour, name, lines, size):
    ax.add_patch(FancyBboxPatch(middle - size / 2, *size, boxstyle="round,pad=0,rounding_size=1.4", facecolor=colour,
                                edgecolor=INK, lw=1.1, zorder=3))
    dark = colour in (INTERFACE, INTERIOR)
    ax.text(middle[0], middle[1] + 3.1, name, ha="center", va="center", fontsize=13, weight="bold",
            color="white" if dark else INK, zorder=4)
    ax.text(middle[0], middle[1] - 1.9, lines, ha="center", va="center", fontsize=9.5, color="white" if dark else INK, zorder=4,
            linespacing=1.35)


def arrow(ax, start, end, colour=INK):
    ax.add_patch(FancyArrowPatch(start, end, arrowstyle="-|>", mutation_scale=15, lw=2.2, color=colour, zorder=5,
                                 shrinkA=0, shrinkB=0))


def draw_states(ax):
    size, y = np.array([19.0, 12.5]), 17.5
    left, middle, right = (np.array([x, y]) for x in (10.5, 50.0, 89.5))
    # one solid body around interface and interior
    ax.add_patch(FancyBboxPatch((37.4, 8.3), 62.1, 21.4, boxstyle="round,pad=0,rounding_size=2", facecolor=(0.94, 0.94, 0.94),
                                edgecolor=MESH, lw=2.2, zorder=1))
    ax.text(69.75, 27.6, "solid body: one rigid body, inside its interface mesh", ha="center", va="center", fontsize=9.5,
            color="0.35", zorder=2)
    box(ax, left, EXTERIOR, "exterior", "free:\nLIGGGHTS integrates it", size)
    box(ax, middle, INTERFACE, "interface", "locked to a solid body,\nstill an atom in LIGGGHTS", size)
    box(ax, right, INTERIOR, "interior", "in the granule store,\nno atom in LIGGGHTS", size)

    def text(x, y, what, why, colour=INK):
        for line, words, weight in ((1, what, "bold"), (0, why, "normal")):
            ax.text(x, y + 1.75 * line, words, ha="center", va="center", fontsize=9.5, weight=weight, color=colour, zorder=6)

    up, down = y + 2.4, y - 2.4
    arrow(ax, (20.4, up), (40.1, up))
    text(28.7, up + 1.4, "locked", "calm for K looks")
    arrow(ax, (59.9, up), (79.6, up))
    text(69.75, up + 1.4, "stored", "nothing exterior near")
    arrow(ax, (79.6, down), (59.9, down))
    text(69.75, down - 3.2, "fetched back", "something comes near")
    arrow(ax, (40.1, down), (20.4, down), WAKING)
    text(28.7, down - 3.2, "restored", "it wakes, see below", WAKING_INK)
    # out of the store at once
    ax.plot([89.5, 89.5], [11.1, 4.9], color=WAKING, lw=2.2, zorder=5, solid_capstyle="butt")
    ax.plot([89.7, 10.5], [4.9, 4.9], color=WAKING, lw=2.2, zorder=5, solid_capstyle="butt")
    arrow(ax, (10.5, 4.9), (10.5, 11.1), WAKING)
    for height, words in ((6.2, "carved out: a ball is cut out of the body around each waking granule"),
                          (2.2, "It wakes when: its load changes by more than the tolerance  ·  its cover or wall has gone  ·  "
                           "its body is shaken or tilted")):
        ax.text(50, height, words, ha="center", va="center", fontsize=9.5, color=WAKING_INK, zorder=6)


def main(file):
    fig = plt.figure(figsize=(10, 10 * HEIGHT / 102))
    ax = fig.add_axes([0, 0, 1, 1])
    ax.set(xlim=(-1, WIDTH + 1), ylim=(0, HEIGHT), aspect="equal")
    ax.axis("off")
    draw_bed(ax, HEIGHT - 29.5)
    draw_states(ax)
    image = io.BytesIO()
    fig.savefig(image, dpi=110)
    plt.close(fig)
    # a few colours are enough: a third of the bytes
    Image.open(image).convert("RGB").quantize(96, dither=Image.Dither.NONE).save(file, optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "fix_solid_cull" / "life_of_a_granule.png")
