"""How a culled result is judged beside an unculled one: by two one-sided tests, and how error falls with tolerance."""
import math
import statistics
from dataclasses import dataclass

import numpy as np
from scipy import stats

LEVEL = 0.05  # of each of the two tests
SAME, OTHER, OPEN = "equivalent", "outside", "not decided"


@dataclass(frozen=True)
class Verdict:
    word: str          # SAME, OTHER or OPEN
    difference: float  # mean of the culled less mean of the unculled runs
    low: float         # the difference lies between these, by LEVEL on either side
    high: float
    margin: float

    @property
    def in_margins(self):
        return abs(self.difference) / self.margin if self.margin > 0 else math.inf


def judged(unculled, culled, margin):
    """Two one-sided t tests of unequal variances (Schuirmann 1987, Welch 1947). SAME: the difference is smaller than the margin, and
    chance is not the reason. OTHER: it is larger, and chance is not the reason. OPEN: the runs scatter too much to tell."""
    n, m = len(unculled), len(culled)
    if n < 2 or m < 1:
        raise ValueError(f"{n} unculled and {m} culled runs cannot be judged")
    difference = statistics.fmean(culled) - statistics.fmean(unculled)
    a = statistics.variance(unculled) / n
    # a lone culled run scatters as an unculled one
    b = statistics.variance(culled) / m if m > 1 else statistics.variance(unculled)
    error = math.sqrt(a + b)
    if error == 0:
        half = 0.0
    else:
        freedom = (a + b)**2 / (a**2 / (n - 1) + b**2 / max(m - 1, 1)) if m > 1 else n - 1
        half = float(stats.t.ppf(1 - LEVEL, freedom)) * error
    low, high = difference - half, difference + half
    word = SAME if -margin < low and high < margin else OTHER if low > margin or high < -margin else OPEN
    return Verdict(word, difference, low, high, margin)


def noise(unculled):
    """The scatter of the unculled runs: the mean distance of one from the mean of the others."""
    return statistics.fmean(abs(x - (sum(unculled) - x) / (len(unculled) - 1)) for x in unculled)


def order(tolerances, errors, floor):
    """The exponent p of error ~ tolerance^p, of the points above the noise floor; None with fewer than two of them."""
    above = [(t, e) for t, e in zip(tolerances, errors) if t > 0 and e > floor]
    if len({t for t, _ in above}) < 2:
        return None
    t, e = np.log(np.array(above)).T
    return float(np.polyfit(t, e, 1)[0])
