"""How culled runs are judged beside unculled ones, in pairs: by two one-sided tests, and how error falls with tolerance."""
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
    difference: float  # culled less unculled, mean of the pairs
    low: float         # the difference lies between these, by LEVEL on either side
    high: float
    margin: float

    @property
    def in_margins(self):
        return abs(self.difference) / self.margin if self.margin > 0 else math.inf


def judged(unculled, culled, margin):
    """Two one-sided t tests on pairs of runs (Schuirmann 1987). `unculled`, `culled`: the value of each run by its number; runs of one
    number start alike, so what their start does to a figure is in neither. SAME: the difference is smaller than the margin, and
    chance is not the reason. OTHER: it is larger, and chance is not the reason. OPEN: the runs scatter too much to tell."""
    pairs = [culled[k] - unculled[k] for k in sorted(culled) if k in unculled]
    if len(unculled) < 2 or not pairs:
        raise ValueError(f"{len(unculled)} unculled runs and {len(pairs)} pairs cannot be judged")
    difference = statistics.fmean(pairs)
    if len(pairs) > 1:
        error, freedom = statistics.stdev(pairs) / math.sqrt(len(pairs)), len(pairs) - 1
    else:  # a lone pair scatters as two unculled runs
        error, freedom = statistics.stdev(unculled.values()) * math.sqrt(2), len(unculled) - 1
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
