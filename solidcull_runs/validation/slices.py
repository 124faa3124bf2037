"""What moves in a case: a slice of its bed, unculled and culled side by side, from snapshots."""
import numpy as np
from matplotlib.collections import EllipseCollection

from ..dumps import snapshots
from ..plots import STATES, plt, save


def busiest(file, diameter, steps):
    """Of the snapshots of an unculled run at these steps: the one with the most motion since the one before, its rows, and how far
    each granule had moved (mean diameters)."""
    best, before = None, None
    for step, columns, rows in snapshots(file):
        rows = rows[np.argsort(rows[:, 0])]
        if before is not None and len(before) == len(rows):
            way = np.linalg.norm(rows[:, 1:4] - before[:, 1:4], axis=1) / diameter
            count = int((way > 1e-2).sum())
            if step in steps and (best is None or count > best[0]):
                best = count, step, rows, way
        before = rows
    return best and best[1:]


def when_culled(file):
    """The snapshots of a culled run in which something is stored, by step; all where nothing ever is."""
    rows_of = {step: rows for step, _, rows in snapshots(file)}
    most = max(map(len, rows_of.values()))
    return {step: rows for step, rows in rows_of.items() if len(rows) < most} or rows_of


def last_seen(file, step, ids):
    """Where the granules were that are no atoms at the step: their last row up to it."""
    rows_of = {}
    for s, _, rows in snapshots(file):
        if s > step:
            break
        for row in rows[np.isin(rows[:, 0], ids)]:
            rows_of[int(row[0])] = row
    return np.array([rows_of[i] for i in ids if i in rows_of])


def discs(ax, rows, colours, axes):
    sizes = 2 * rows[:, 4]
    ax.add_collection(EllipseCollection(sizes, sizes, np.zeros(len(rows)), units="xy", offsets=rows[:, [1 + axes[0], 1 + axes[1]]],
                                        transOffset=ax.transData, facecolors=colours, edgecolors="0.3", linewidths=0.15))


def what_moves(unculled, culled, file, diameter, cut=(1, 0.5), largest=np.inf):
    """A slice of the bed when it moves most: how far granules moved in the unculled run, and what the culled run holds as what.
    `unculled`, `culled`: files of snapshots; `cut`: axis and share of the box; `largest`: radii above are drawn dark. False without
    snapshots."""
    if not (unculled.exists() and culled.exists()):
        return False
    stored = when_culled(culled)
    found = busiest(unculled, diameter, stored)
    if not found:
        return False
    step, rows, way = found
    axis, share = cut
    axes = [a for a in range(3) if a != axis]
    place = rows[:, 1 + axis]
    low, high = np.percentile(place, [1, 99])
    middle = low + share * (high - low)
    figure, panels = plt.subplots(1, 2, figsize=(10, 4.2))
    near = np.abs(place - middle) < np.maximum(0.75 * diameter, rows[:, 4])
    near = np.flatnonzero(near)[np.argsort(-np.abs(place[near] - middle))]
    shade = plt.get_cmap("viridis")(np.clip((np.log10(np.maximum(way, 1e-4)) + 4) / 4, 0, 1))
    shade[rows[:, 4] > largest] = (0.3, 0.3, 0.33, 1)
    discs(panels[0], rows[near], shade[near], axes)
    panels[0].set_title("unculled: way since the last snapshot, 1e-4 d (dark) to d (bright)", fontsize=8)
    then = stored[step]
    away = last_seen(culled, step, np.setdiff1d(rows[:, 0], then[:, 0]))
    state = np.concatenate([np.where(then[:, 5] > 0, 1, 0), np.full(len(away), 2)])
    both = np.vstack([then[:, :5], away[:, :5]]) if len(away) else then[:, :5]
    distance = np.abs(both[:, 1 + axis] - middle)
    near = np.flatnonzero(distance < np.maximum(0.75 * diameter, both[:, 4]))
    near = near[np.argsort(-distance[near])]
    shade = np.array([STATES[s][1] for s in state])
    shade[both[:, 4] > largest] = (0.3, 0.3, 0.33)
    discs(panels[1], both[near], shade[near], axes)
    panels[1].set_title("sleep: exterior tan, interface blue, interior green", fontsize=8)
    for ax in panels:
        ax.set(aspect="equal", xlim=np.percentile(rows[:, 1 + axes[0]], [0, 100]) + np.array([-1, 1]) * diameter,
               ylim=np.percentile(rows[:, 1 + axes[1]], [0, 100]) + np.array([-1, 1]) * diameter)
        ax.tick_params(labelsize=6)
    figure.suptitle(f"step {step:,}", fontsize=9)
    save(figure, file, dpi=110)
    return True
