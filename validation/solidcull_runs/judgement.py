"""What the results of a case mean: the verdict on each metric at each point, its error in margins, what it costs."""
import statistics
from dataclasses import dataclass

from . import equivalence
from .points import UNCULLED

WORST_FIRST = (equivalence.OTHER, equivalence.OPEN, equivalence.SAME)


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
    of_unculled: float  # that over the unculled runs' median
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


def verdict(metric, unculled, culled):
    mean = statistics.fmean(unculled.values())
    allowed = metric["margin"] * abs(mean) if metric["relative"] else metric["margin"]
    return equivalence.judged(unculled, culled, allowed)


def judge(result, scene=None):
    """Every point of the scene (the main one) that was run, but the unculled one, by name; {} without two unculled runs."""
    scene = scene or main_scene(result)
    unculled = unculled_of(scene)
    if not unculled or len(unculled["runs"]) < 2:
        return {}
    whole = statistics.median(r["seconds"] for r in unculled["runs"])
    judged = {}
    for name, entry in scene["points"].items():
        if entry is unculled:
            continue
        seconds = statistics.median(r["seconds"] for r in entry["runs"])

        def mean(count, entry=entry):
            there = [r["counts"][count] for r in entry["runs"] if count in r["counts"]]
            return statistics.fmean(there) if there else None
        judged[name] = Judged(name, entry["family"], entry["absolute"], entry["share"], entry["default"], len(entry["runs"]), seconds,
                              seconds / whole, mean("exterior"), mean("interface"), mean("restored"),
                              {m["name"]: verdict(m, values_of(unculled, m["name"]), values_of(entry, m["name"])) for m in result["metrics"]})
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
        allowed = m["margin"] * abs(statistics.fmean(values)) if m["relative"] else m["margin"]
        found.append(equivalence.noise(values) / allowed if allowed else 0.0)
    return max(found)


def orders(result, judged):
    """How the error in margins falls with the absolute tolerance: (family, metric) -> exponent, of metrics above the noise."""
    unculled = unculled_of(main_scene(result))
    found = {}
    for family in {j.family for j in judged.values() if j.absolute}:
        of_family = [j for j in judged.values() if j.family == family and j.absolute and not j.share]
        for m in result["metrics"]:
            p = equivalence.order([j.absolute for j in of_family], [abs(j.verdicts[m["name"]].difference) for j in of_family],
                                  equivalence.noise(list(values_of(unculled, m["name"]).values())))
            if p is not None:
                found[family, m["name"]] = p
    return found
