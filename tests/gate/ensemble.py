"""What runs that differ by rounding alone have in common, and whether other runs are like them (after the UF-ECT of CESM).

Each figure is measured in its scatter over the ensemble. Principal components describe how figures scatter together. A run is
outside in a component where its score lies beyond what the ensemble spans, and in a figure where what the components leave of it
is too far out. Runs differ where most of them are outside in the same SEVERAL components or figures.
"""
import itertools
import json
from dataclasses import dataclass

import numpy as np

from solidcull_runs.errors import RunError

ROUNDING = 1e-9      # of a figure and of what a granule makes of it: below, nothing is a result
EXPLAINED = 0.95     # of the variance of the figures that scatter, by the components kept
MOST_COMPONENTS = 20
WIDER = 0.5          # of its width: by so much what an ensemble spans is widened on either side
LARGEST_REST = 5.0   # scatters that the components may leave of a figure, on top of twice what they leave in the ensemble
SEVERAL = 3          # components and figures outside, from which a run is outside
LEAST = 1e-2         # a loading below this is none


@dataclass
class Ensemble:
    names: list
    units: list
    mean: np.ndarray
    scatter: np.ndarray
    loadings: np.ndarray   # components x figures
    low: np.ndarray        # of the scores
    high: np.ndarray
    rest: np.ndarray       # largest rest of each figure
    about: dict            # when, of what, and because of what it was made

    def scaled(self, rows):
        return (np.atleast_2d(rows) - self.mean) / self.scatter

    def outside(self, rows):
        """Of each run and each component, then each figure: whether it is outside."""
        z = self.scaled(rows)
        scores = z @ self.loadings.T
        rest = np.abs(z - scores @ self.loadings)
        return np.hstack([(scores < self.low) | (scores > self.high), rest > LARGEST_REST + 2 * self.rest])

    def differ(self, rows):
        """Whether runs differ from the ensemble: two of three, or the same share of more, are outside in the same SEVERAL."""
        out = self.outside(rows)
        return np.count_nonzero(3 * out.sum(0) >= 2 * len(out)) >= SEVERAL

    def far(self, rows):
        """How far each figure is from the mean, in its scatter: the median of the runs."""
        return np.median(self.scaled(rows), axis=0)


def floor(mean, granule):
    """The least scatter of figures: `granule` is what a granule makes of each."""
    return ROUNDING * (np.abs(mean) + granule)


def made_of(names, units, granule, rows, about=None):
    """The ensemble of runs (rows), one column a figure."""
    rows = np.asarray(rows, float)
    mean = rows.mean(0)
    scatter = np.hypot(rows.std(0), floor(mean, granule))
    z = (rows - mean) / scatter
    _, singular, loadings = np.linalg.svd(z, full_matrices=False)
    share = np.cumsum(singular**2) / np.sum(singular**2)
    kept = loadings[:min(int(np.searchsorted(share, EXPLAINED)) + 1, MOST_COMPONENTS)]
    kept = np.where(np.abs(kept) < LEAST, 0.0, np.round(kept, 4))
    scores = z @ kept.T
    wider = WIDER * (scores.max(0) - scores.min(0))
    return Ensemble(names, units, mean, scatter, kept, scores.min(0) - wider, scores.max(0) + wider,
                    np.abs(z - scores @ kept).max(0), about or {})


# --- false alarms -----------------------------------------------------------------------------------------------------

def false_alarms(names, units, granule, rows, parts=8, most=20000):
    """By counting: each part of the runs is left out in turn, and judged by the ensemble of the others. Two shares: of runs
    alone that are outside, and of three runs each that are said to differ."""
    rows = np.asarray(rows, float)
    alone = wrong = threes = 0
    for part in range(parts):
        left_out = np.arange(len(rows)) % parts == part
        out = made_of(names, units, granule, rows[~left_out]).outside(rows[left_out])
        alone += np.count_nonzero(out.sum(1) >= SEVERAL)
        some = out[:, out.any(0)].astype(np.int8)
        for three in itertools.islice(itertools.combinations(range(len(some)), 3), most):
            threes += 1
            wrong += np.count_nonzero(some[list(three)].sum(0) >= 2) >= SEVERAL
    return alone / len(rows), wrong / threes


def left_out_one_by_one(names, units, granule, rows):
    """The share of runs that are outside an ensemble of all others."""
    rows = np.asarray(rows, float)
    every = np.arange(len(rows))
    return np.mean([made_of(names, units, granule, rows[every != k]).outside(rows[k]).sum() >= SEVERAL for k in every])


# --- the file ---------------------------------------------------------------------------------------------------------

def text_of(ensemble):
    """As text: a heading for each scene and row, then a line for each figure."""
    e = ensemble
    head = {"about": e.about, "low": [float(f"{x:.6g}") for x in e.low], "high": [float(f"{x:.6g}") for x in e.high]}
    lines, heading = [json.dumps(head)], None
    for j, name in enumerate(e.names):
        where, _, what = name.rpartition(" | ")
        if where != heading:
            heading = where
            lines.append(f"[{where}]")
        loadings = {str(k): float(f"{x:.4g}") for k, x in enumerate(e.loadings[:, j]) if x}
        numbers = f"{e.mean[j]:.13g} {e.scatter[j]:.3g} {e.rest[j]:.3g}"
        lines.append(f"{what} | {e.units[j]} | {numbers}" + (f" | {json.dumps(loadings, separators=(',', ':'))}" if loadings else ""))
    return "\n".join(lines) + "\n"


def of_text(text, file="the ensemble"):
    """What text_of() has written."""
    try:
        first, *lines = text.splitlines()
        head = json.loads(first)
        names, rows, heading = [], [], None
        for line in lines:
            if line.startswith("["):
                heading = line[1:-1]
                continue
            if heading is None:
                raise ValueError(f"no heading above {line}")
            rows.append(line.split(" | "))
            names.append(f"{heading} | {rows[-1][0]}")
        loadings = np.zeros((len(head["low"]), len(rows)))
        for j, row in enumerate(rows):
            for k, x in (json.loads(row[3]) if len(row) > 3 else {}).items():
                loadings[int(k), j] = x
        numbers = np.array([row[2].split() for row in rows], float)
        return Ensemble(names, [row[1] for row in rows], numbers[:, 0], numbers[:, 1], loadings,
                        np.array(head["low"]), np.array(head["high"]), numbers[:, 2], head["about"])
    except (ValueError, KeyError, IndexError) as e:
        raise RunError(f"{file} is no ensemble of the gate ({e}); take it from the repository again, or make it: gate.py make") from None
