"""The points of a plot of run time against error: how a bed is run, from unculled to the freeze by hand."""
from dataclasses import dataclass


@dataclass(frozen=True)
class Point:
    name: str
    family: str               # UNCULLED, SLEEP, LIVE, PAPER or BY_HAND
    keywords: str = ""        # of the fix
    absolute: float = None    # the first number of `tolerance`
    share: float = 0.0        # the second
    runs: int = 1             # of the first scene
    others: int = 3           # of each other scene
    default: bool = False     # run in every scene, and judged


UNCULLED, SLEEP, LIVE, PAPER, BY_HAND = "unculled", "sleep", "live", "paper's scheme", "frozen by hand"
FAMILIES = (UNCULLED, SLEEP, LIVE, PAPER, BY_HAND)
DEFAULT = (3, 0)
# tolerances that are swept, absolute and share, beside the default
SWEPT = {SLEEP: ((1, 0), (10, 0), (30, 0), (3, 0.3)), LIVE: ((10, 0),)}


def tolerated(family, absolute, share=0.0, **how):
    return Point(f"{family} {absolute:g} {share:g}", family, f"exterior {family} tolerance {absolute:g} {share:g}", absolute, share, **how)


def points():
    """All points, in the order in which they are run."""
    found = [Point(UNCULLED, UNCULLED, runs=5, default=True)]
    for family in (SLEEP, LIVE):
        found.append(tolerated(family, *DEFAULT, runs=5, default=True))
    for family, tolerances in SWEPT.items():
        found += [tolerated(family, *t) for t in tolerances]
    found.append(Point(PAPER, PAPER, "exterior live store none restore refill"))
    found.append(Point(BY_HAND, BY_HAND))
    return found


def runs_of(point, main=True):
    return point.runs if main else point.others
