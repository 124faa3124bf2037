"""What the fix forecast of runs at the defaults, beside what came."""
import statistics
from dataclasses import dataclass

from . import verdicts
from .points import LIVE, SLEEP

NEAR = 1.3  # times: so near is near


@dataclass(frozen=True)
class Forecast:
    scene: str
    mode: str
    said: float  # times less work than without the line, median of the runs that said so
    came: float  # times less time of the same loop, median of the pairs of runs

    @property
    def is_near(self):
        return 1 / NEAR <= self.said / self.came <= NEAR


def with_loop(runs, k, what):
    return [r for r in runs if len(r.get("loops") or ()) > k and r["loops"][k][what] is not None]


def in_loop(runs, k, what):
    return [r["loops"][k][what] for r in with_loop(runs, k, what)]


def forecasts_of(result):
    """Of each scene and mode of a case in which one was made: that of the loop which takes LIGGGHTS the longest."""
    found = []
    for name, scene in result["scenes"].items():
        unculled = (verdicts.unculled_of(scene) or {"runs": []})["runs"]
        for entry in scene["points"].values():
            if not entry["default"] or entry["family"] not in (SLEEP, LIVE):
                continue
            runs = entry["runs"]
            loops = [(statistics.median(in_loop(unculled, k, "seconds")), k) for k in range(max((len(r.get("loops") or ()) for r in runs), default=0))
                     if in_loop(runs, k, "forecast") and in_loop(unculled, k, "seconds")]
            if loops:
                k = max(loops)[1]
                came = verdicts.of_same_number(with_loop(unculled, k, "seconds"), with_loop(runs, k, "seconds"), lambda r, k=k: r["loops"][k]["seconds"])
                found.append(Forecast(name, entry["family"], statistics.median(in_loop(runs, k, "forecast")), came))
    return found
