"""The points of a plot of run time against error: how a bed is run, from unculled to the freeze by hand."""
from dataclasses import dataclass


@dataclass(frozen=True)
class Point:
    name: str
    family: str               # one of FAMILIES
    keywords: str = ""        # of the fix
    absolute: float = None    # the first number of `tolerance`
    share: float = 0.0        # the second
    runs: int = 1             # of the first scene
    others: int = 3           # of each other scene
    default: bool = False     # its verdicts stand on the first page
    everywhere: bool = False  # run in every scene, not in the first alone


UNCULLED, SLEEP, LIVE, PAPER, BY_HAND, ALSO = "unculled", "sleep", "live", "paper's scheme", "frozen by hand", "other keywords"
FAMILIES = (UNCULLED, SLEEP, LIVE, PAPER, BY_HAND, ALSO)
DEFAULT = (3, 0)
# tolerances that are swept, absolute and share, beside the default
SWEPT = {SLEEP: ((1, 0), (10, 0), (30, 0), (3, 0.3)), LIVE: ((10, 0),)}


def tolerated(family, absolute, share=0.0, **how):
    return Point(f"{family} {absolute:g} {share:g}", family, f"exterior {family} tolerance {absolute:g} {share:g}", absolute, share, **how)


def points(also=()):
    """All points, in the order in which they are run. `also`: keywords of the fix that the user wants to see beside them."""
    first = {"runs": 5, "default": True, "everywhere": True}
    found = [Point(UNCULLED, UNCULLED, **first)]
    for family in (SLEEP, LIVE):
        found.append(tolerated(family, *DEFAULT, **first))
    found += [Point(keywords, ALSO, keywords, runs=3, everywhere=True) for keywords in also]
    for family, tolerances in SWEPT.items():
        found += [tolerated(family, *t) for t in tolerances]
    found.append(Point(PAPER, PAPER, "exterior live store none restore refill"))
    found.append(Point(BY_HAND, BY_HAND))
    return found


def runs_of(point, main=True):
    return point.runs if main else point.others
