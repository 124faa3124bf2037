"""How far a mean may lie from what pairs of runs show, where pairs are added until it is known well enough.

To look again and again at a growing sample, and to stop when it pleases, makes more errors than one look. Repeated confidence intervals
(Jennison & Turnbull, J. R. Statist. Soc. B 51, 305, 1989) are so wide that all of them together hold the mean, but for SPENT on either
side. How much of it each look may spend goes by its share of all pairs, to a power (Lan & DeMets, Biometrika 70, 659, 1983; Kim &
DeMets, Biometrika 74, 149, 1987). Bounds are those of normal sums, and go to Student's t by their level (Jennison & Turnbull, Group
Sequential Methods, 2000, section 3.8).

SPENT is less than the 5 % that a verdict may err, for differences of pairs may be skewed, and t intervals of few pairs then err more.
"""
import functools
import math
import statistics

import numpy as np
from scipy import optimize, stats

LOOKS = (5, 8, 12, 16, 20, 25, 30)  # pairs of runs
SPENT = 0.0125
POWER = 3
GRID, FARTHEST = 400, 8             # points of a density; standard deviations below which nothing is


@functools.lru_cache
def levels():
    """By look, the chance that a lone interval errs on one side."""
    spent = np.diff([0.0, *(SPENT * (n / LOOKS[-1])**POWER for n in LOOKS)])
    bounds, x, density = [], None, None
    for k, (n, share) in enumerate(zip(LOOKS, spent)):
        if k == 0:
            bound = stats.norm.isf(share) * math.sqrt(n)
        else:  # of the sums that were below all bounds so far, `share` of all is above this one
            step, weight = math.sqrt(n - LOOKS[k - 1]), density * (x[1] - x[0])
            weight[[0, -1]] /= 2
            bound = optimize.brentq(lambda b: weight @ stats.norm.sf((b - x) / step) - share, 0, FARTHEST * math.sqrt(n))
        y = np.linspace(-FARTHEST * math.sqrt(n), bound, GRID)
        density = stats.norm.pdf(y / math.sqrt(n)) / math.sqrt(n) if k == 0 else stats.norm.pdf((y[:, None] - x) / step) @ weight / step
        x = y
        bounds.append(bound / math.sqrt(n))
    return tuple(float(level) for level in stats.norm.sf(bounds))


def next_look(pairs):
    """To how many pairs one goes on from these; None from the last look on."""
    return next((n for n in LOOKS if n > pairs), None)


@functools.lru_cache
def quantile(pairs):
    """Standard errors on either side. Where some of the runs of a look failed, the level is that of the look before."""
    level = levels()[max(0, sum(n <= pairs for n in LOOKS) - 1)]
    return float(stats.t.isf(level, pairs - 1))


def interval(differences):
    """Mean of two or more differences of pairs, and between what it lies."""
    mean = statistics.fmean(differences)
    half = quantile(len(differences)) * statistics.stdev(differences) / math.sqrt(len(differences))
    return mean, mean - half, mean + half
