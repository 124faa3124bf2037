"""How culled runs are judged beside unculled ones, in pairs, by two one-sided tests; and what that makes of the results of a case:
the verdict on each metric at each point, its error in margins, what it costs, how the error falls with the tolerance."""
import math
import statistics
from dataclasses import dataclass

import numpy as np
from scipy import stats

from . import sequential
from .points import UNCULLED

LEVEL = 0.05  # of each of the two tests
SAME, OTHER, OPEN = "equivalent", "outside", "not decided"
WORST_FIRST = (OTHER, OPEN, SAME)


@dataclass(frozen=True)
class Verdict:
    word: str          # SAME, OTHER or OPEN
    difference: float  # culled less unculled, mean of the pairs
    low: float         # the difference lies between these, by LEVEL on either side
    high: float
    margin: float
    pairs: int = None  # of how many pairs, where pairs were added until it was decided

    @property
    def in_margins(self):
        return abs(self.difference) / self.margin if self.margin > 0 else math.inf


def word_of(low, high, margin):
    return SAME if -margin < low and high < margin else OTHER if low > margin or high < -margin else OPEN


def two_one_sided_tests(unculled, culled, margin):
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
    return Verdict(word_of(low, high, margin), difference, low, high, margin)


def in_looks(unculled, culled, margin_of):
    """The same verdicts where pairs are added until there is one (see sequential.py): that of the first look that decides, else that of
    all pairs, OPEN. `margin_of(mean)`: of the unculled runs. In all looks together, a metric at its margin's edge is called SAME or
    OTHER by chance in less than LEVEL of cases."""
    numbers = sorted(set(unculled) & set(culled))
    if len(numbers) < 2:
        raise ValueError(f"{len(numbers)} pairs cannot be judged")
    looks = [n for n in sequential.LOOKS if n < len(numbers)] + [len(numbers)]
    for n in looks:
        taken = numbers[:n]
        margin = margin_of(statistics.fmean(unculled[k] for k in taken))
        difference, low, high = sequential.interval([culled[k] - unculled[k] for k in taken])
        word = word_of(low, high, margin)
        if word != OPEN and n >= sequential.LOOKS[0]:
            break
    else:
        word = OPEN
    return Verdict(word, difference, low, high, margin, n)


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


# --- of the results of a case ---

def worst_of(words):
    """The worst of some verdicts; None of none."""
    return next((w for w in WORST_FIRST if w in words), None)


@dataclass(frozen=True)
class Judged:
    """A point of the main scene beside the unculled runs."""
    name: str
    family: str
    absolute: float
    share: float
    default: bool
    runs: int
    seconds: float      # median, of the loop, on a core
    of_unculled: float  # that over the unculled run's of the same number, median: the two ran one after the other, on one machine
    exterior: float     # mean; None where the fix counted nothing
    interface: float
    restored: float
    verdicts: dict      # by metric

    @property
    def speed_up(self):
        return 1 / self.of_unculled

    @property
    def worst(self):
        """The metric with the largest error in margins."""
        return max(self.verdicts, key=lambda name: self.verdicts[name].in_margins)

    @property
    def error(self):
        """The largest error, in margins."""
        return self.verdicts[self.worst].in_margins

    @property
    def word(self):
        """Of the metrics' verdicts the worst: all are equivalent, or one is outside, or one is not decided."""
        return worst_of({v.word for v in self.verdicts.values()})


def main_scene(result):
    return next(iter(result["scenes"].values()))


def values_of(entry, metric):
    """The value of each run, by its number."""
    return {run["k"]: run["values"][metric] for run in entry["runs"]}


def unculled_of(scene):
    return next((entry for entry in scene["points"].values() if entry["family"] == UNCULLED), None)


def of_same_number(runs, others, figure):
    """The median of a figure of a run over that of the other of the same number."""
    by_number = {r["k"]: figure(r) for r in others}
    return statistics.median(figure(r) / by_number[r["k"]] for r in runs if r["k"] in by_number)


def allowed(metric, mean):
    """Its margin, where the unculled runs have this mean."""
    return metric["margin"] * abs(mean) if metric["relative"] else metric["margin"]


def verdict(metric, unculled, culled, added=False):
    """On a metric. `added`: pairs were added until it was decided."""
    if added:
        return in_looks(unculled, culled, lambda mean: allowed(metric, mean))
    return two_one_sided_tests(unculled, culled, allowed(metric, statistics.fmean(unculled.values())))


def over_scenes(result, metric, family):
    """On the mean of all scenes of a case at the defaults, each in its own margins; None where a scene or the metric has no margin there.
    What the line does to a figure is in each of them, and chance is another one in each. The interval is as sure as that of the scene
    with the fewest pairs."""
    means, squares, fewest = [], [], sequential.LOOKS[-1]
    for scene in result["scenes"].values():
        unculled, culled = unculled_of(scene), next((e for e in scene["points"].values() if e["default"] and e["family"] == family), None)
        if not unculled or not culled:
            return None
        with_it, without = values_of(culled, metric["name"]), values_of(unculled, metric["name"])
        numbers = sorted(set(with_it) & set(without))
        margin = allowed(metric, statistics.fmean(without[k] for k in numbers)) if numbers else 0
        if len(numbers) < sequential.LOOKS[0] or not margin:
            return None
        off = [(with_it[k] - without[k]) / margin for k in numbers]
        means.append(statistics.fmean(off))
        squares.append(statistics.variance(off) / len(off))
        fewest = min(fewest, len(off))
    mean, half = statistics.fmean(means), sequential.quantile(fewest) * math.sqrt(sum(squares)) / len(squares)
    low, high = mean - half, mean + half
    return Verdict(word_of(low, high, 1), mean, low, high, 1)


def judge(result, scene=None):
    """Every point of the scene (the main one) that was run, but the unculled one, by name; {} without two unculled runs."""
    scene = scene or main_scene(result)
    unculled = unculled_of(scene)
    if not unculled or len(unculled["runs"]) < 2:
        return {}
    judged = {}
    for name, entry in scene["points"].items():
        if entry is unculled:
            continue
        seconds = statistics.median(r["seconds"] for r in entry["runs"])

        def mean(count, entry=entry):
            there = [r["counts"][count] for r in entry["runs"] if count in r["counts"]]
            return statistics.fmean(there) if there else None
        added = result.get("decided", False) and entry["default"] and len(entry["runs"]) > 1
        judged[name] = Judged(name, entry["family"], entry["absolute"], entry["share"], entry["default"], len(entry["runs"]), seconds,
                              of_same_number(entry["runs"], unculled["runs"], lambda r: r["seconds"]), mean("exterior"), mean("interface"), mean("restored"),
                              {m["name"]: verdict(m, values_of(unculled, m["name"]), values_of(entry, m["name"]), added) for m in result["metrics"]})
    return judged


def default_of(judged, family):
    """The default point of a mode, if it was run."""
    return next((j for j in judged.values() if j.default and j.family == family), None)


def noise_of(result):
    """The scatter of the unculled runs in margins: the largest of any metric."""
    unculled = unculled_of(main_scene(result))
    if not unculled or len(unculled["runs"]) < 2:
        return None
    found = []
    for m in result["metrics"]:
        values = list(values_of(unculled, m["name"]).values())
        margin = allowed(m, statistics.fmean(values))
        found.append(noise(values) / margin if margin else 0.0)
    return max(found)


def orders(result, judged):
    """How the error in margins falls with the absolute tolerance: (family, metric) -> exponent, of metrics above the noise."""
    unculled = unculled_of(main_scene(result))
    found = {}
    for family in {j.family for j in judged.values() if j.absolute}:
        of_family = [j for j in judged.values() if j.family == family and j.absolute and not j.share]
        for m in result["metrics"]:
            p = order([j.absolute for j in of_family], [abs(j.verdicts[m["name"]].difference) for j in of_family],
                                  noise(list(values_of(unculled, m["name"]).values())))
            if p is not None:
                found[family, m["name"]] = p
    return found
