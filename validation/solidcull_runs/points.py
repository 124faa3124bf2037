"""The points of a plot of run time against error: how a bed is run, from unculled to the freeze by hand."""
from dataclasses import dataclass


@dataclass(frozen=True)
class Point:
    name: str
    family: str               # UNCULLED, SLEEP, LIVE, PAPER or BY_HAND
    keywords: str = ""        # of the fix
    absolute: float = None    # the first number of `tolerance`
    share: float = 0.0        # the second
    runs: tuple = (1, 2)      # in the quick and in the full size, of the first scene
    others: tuple = (3, 5)    # likewise of the other scenes
    default: bool = False     # run in every scene, and judged


UNCULLED, SLEEP, LIVE, PAPER, BY_HAND = "unculled", "sleep", "live", "paper's scheme", "frozen by hand"
FAMILIES = (UNCULLED, SLEEP, LIVE, PAPER, BY_HAND)
DEFAULT = (3, 0)
ABSOLUTE = {"quick": (1, 10, 30), "full": (0.3, 1, 10, 30, 100)}
SHARES = {"quick": (0.3,), "full": (0.1, 0.3, 1)}


def tolerated(family, absolute, share=0.0, **how):
    return Point(f"{family} {absolute:g} {share:g}", family, f"exterior {family} tolerance {absolute:g} {share:g}", absolute, share, **how)


def points(size):
    """All points of a size, in the order in which they are run."""
    found = [Point(UNCULLED, UNCULLED, runs=(5, 5), default=True)]
    for family in (SLEEP, LIVE):
        found.append(tolerated(family, *DEFAULT, runs=(5, 5), default=True))
    for family in (SLEEP, LIVE):
        found += [tolerated(family, a) for a in ABSOLUTE[size]]
        found += [tolerated(family, DEFAULT[0], s) for s in SHARES[size]]
    found.append(Point(PAPER, PAPER, "exterior live store none restore refill"))
    found.append(Point(BY_HAND, BY_HAND))
    return found


def runs_of(point, size, main=True):
    return (point.runs if main else point.others)[size == "full"]
