"""How far culled runs are from a run without the fix, told without one: the same deck with half the limits beside it.

The limits are `tolerance` (both numbers) and `speed`. Half of them turn an error e into r e. So the difference D of the two is e (1 - r),
and e = D/(1 - r). Three things are not known:

- r. Where the error goes as limits^p, r = 2^-p. That is taken for half of all cases. Which granules sleep is also a matter of chance, and
  so is the sign of an error: half the limits may turn it round, r = -2^-p, or let it grow, r = 2^p, a quarter of cases each. p may be anywhere
  in EXPONENTS: the least stands for errors that the limits hardly change.
- D, but for the scatter of the runs: Student's t about what was measured.
- What chance does to all runs with the same limits alike. So the limits of each run are a little other ones, see VARIED.

The interval holds e in 90 of 100 cases if all this is so.
"""
import math
import re
import statistics
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from scipy import optimize, stats

from . import comparisons, decks, twins
from .engine import find_launcher
from .errors import RunError

KINDS = {"culled": 1, "halved": 0.5}  # share of the limits
DEFAULTS = {"tolerance": ("3", "0"), "speed": ("0.01",)}  # of fix solid/cull, where the deck gives none
EXPONENTS = (0.1, 1.5)
VARIED = (1, 1.2, 1 / 1.2, 1.1, 1 / 1.1, 1.15, 1 / 1.15, 1.05, 1 / 1.05, 1.25)  # the limits of each run, over those meant
LEVEL = 0.9
EACH = 4
HALVED = 2.0**-np.linspace(*EXPONENTS, 100)
FACTORS = np.concatenate([1 / (1 - r) for r in (HALVED, HALVED, -HALVED, 1 / HALVED)])  # e/D
MIDDLE = float(np.median(FACTORS))


@dataclass(frozen=True)
class Extrapolated:
    """A figure's error, as half the limits tell it."""
    difference: float  # of the culled runs' mean less that with half the limits
    scatter: float     # of single runs: their standard deviation
    error: float       # of the culled runs, about
    low: float         # it lies between these
    high: float


def interval(difference, standard_error, freedom, level=LEVEL):
    """Between which the error lies. `standard_error`: of the difference, with so many degrees of freedom."""
    tails = (1 - level) / 2, (1 + level) / 2
    if not standard_error:
        return tuple(float(x) for x in np.quantile(difference * FACTORS, tails))
    farthest = np.abs(FACTORS).max() * (abs(difference) + stats.t.isf(1e-6, freedom) * standard_error)

    def below(error):  # the chance that it is
        return float(stats.t.cdf((error - FACTORS * difference) / (np.abs(FACTORS) * standard_error), freedom).mean())
    return tuple(optimize.brentq(lambda e: below(e) - tail, -farthest, farthest, xtol=1e-9 * farthest) for tail in tails)


def extrapolate(whole, halved, alike=False):
    """Of a figure's value in each run with the whole and with half the limits, two or more of each. `alike`: runs of one number start
    alike and others do not, so that only differences of pairs count."""
    difference = statistics.fmean(whole) - statistics.fmean(halved)
    scatter = math.sqrt((statistics.variance(whole) + statistics.variance(halved)) / 2)
    if alike:
        pairs = [a - b for a, b in zip(whole, halved)]
        error, freedom = statistics.stdev(pairs) / math.sqrt(len(pairs)), len(pairs) - 1
    else:
        freedom = len(whole) + len(halved) - 2
        pooled = ((len(whole) - 1) * statistics.variance(whole) + (len(halved) - 1) * statistics.variance(halved)) / freedom
        error = math.sqrt(pooled * (1 / len(whole) + 1 / len(halved)))
    return Extrapolated(difference, scatter, MIDDLE * difference, *interval(difference, error, freedom))


def part_of(word, share, line):
    """A number of the fix line, or LIGGGHTS's formula for one, times a share."""
    formula = re.sub(r"\$\{(\w+)\}", r"v_\1", word)
    formula = re.sub(r"\$(\w)(?!\w)", r"v_\1", formula)
    if formula != word or word.startswith("$("):
        return f"$({share:.8g}*({formula.replace('$(', '(')}))"
    try:
        return f"{share * float(word):.8g}"
    except ValueError:
        raise RunError(f"`{word}` is no number, so it cannot be halved: {line.strip()}") from None


def keywords(lines, share):
    """What to add to the fix line of a deck (its lines) so that its limits are this share of what they are."""
    line = next(line for line in lines if decks.words_of(line)[3:4] == ["solid/cull"])
    words, made = decks.words_of(line), []
    for name, otherwise in DEFAULTS.items():
        last = max((k for k, word in enumerate(words) if word == name), default=None)
        values = otherwise if last is None else words[last + 1:last + 1 + len(otherwise)]
        if len(values) < len(otherwise):
            raise RunError(f"`{name}` lacks a number: {line.strip()}")
        made += [name, *(part_of(value, share, line) for value in values)]
    return " ".join(made)


def judge(runs, vary=None):
    """The figures of the runs by kind, as plain data."""
    result = {kind: comparisons.summary(runs[kind]) for kind in KINDS}
    result["ledger"] = comparisons.ledger([r.final for r in runs["culled"]], [r.final for r in runs["halved"]])
    result["metrics"] = {}
    for name in runs["culled"][0].metrics:
        values = {kind: [r.metrics[name] for r in runs[kind]] for kind in KINDS}
        result["metrics"][name] = {**values, "mean": statistics.fmean(values["culled"]), "halved_mean": statistics.fmean(values["halved"]),
                                   **asdict(extrapolate(values["culled"], values["halved"], alike=bool(vary)))}
    moved = len({tuple(r.metrics.values()) for r in runs["culled"]}) > 1
    result["no_scatter"] = bool(result["metrics"]) and not moved
    return result


def compare(deck, wanted=(), launcher=None, out=None, each=EACH, vary=None, variables=None, ranks=1, at_once=1, extra=None, say=lambda line: None):
    """Runs the deck with its limits and with half of them, `each` times, in turns; returns (result, runs by kind). The words are
    those of twins.compare()."""
    deck = Path(deck).resolve()
    lines = decks.read_deck(deck)
    fix = decks.cull_fix(lines, deck.name)
    decks.check_metrics(wanted, decks.make_deck(lines, fix, True, None, "-"))
    keywords(lines, 0.5)  # refuses what cannot be halved
    launcher = find_launcher(launcher)
    out = Path(out) if out else deck.with_name(deck.name + ".twin")
    if vary:
        decks.check_vary(*vary, each, lines)
    jobs = [twins.Job(deck, out, kind, k, {**(variables or {}), **({vary[0]: vary[1][k]} if vary else {})}, ranks, not vary, wanted, extra,
                      launcher, keywords(lines, share * VARIED[k]) if share * VARIED[k] != 1 else None)
            for k in range(each) for kind, share in KINDS.items()]
    done = twins.run_jobs(jobs, at_once, say)
    runs = {kind: [run for job, run in zip(jobs, done) if job.kind == kind] for kind in KINDS}
    return {"keywords": keywords(lines, 0.5), **judge(runs, vary)}, runs


# --- as text ---

def percent(part, whole, sign="+"):
    return f"{100 * part / abs(whole):{sign}.2f} %" if abs(part) < 100 * abs(whole) else f"{part:{sign}.3g}"


def table(result):
    """The comparison, and what its columns mean."""
    c, h, book = result["culled"], result["halved"], result["ledger"]
    runs = len(c["own_times"])
    lines = ["granules            not checked: a run did not reach the last line of the deck" if not book else
             f"granules            {book['granules']:,}; lost {book['lost']:,}, ids missing {book['ids_missing']:,}"]
    lines.append(f"half the limits     {result['keywords']}")
    lines.append(f"loop time           culled {c['own_time']:.1f} s, with half the limits {h['own_time']:.1f} s; {runs} runs of each")
    if "exterior" in c and "exterior" in h:
        lines.append(f"mean exterior       culled {c['exterior']:,.0f}, with half the limits {h['exterior']:,.0f}")
    if result["metrics"]:
        width = max(12, *map(len, result["metrics"]))
        lines += ["", f"{'metric':{width}} {'culled':>12} {'half limits':>12} {'difference':>11} {'scatter':>9} {'error about':>12} {'it lies between':>23}"]
        for name, m in result["metrics"].items():
            mean = m["mean"]
            between = f"{percent(m['low'], mean)} and {percent(m['high'], mean)}"
            lines.append(f"{name:{width}} {mean:12.6g} {m['halved_mean']:12.6g} {percent(m['difference'], mean):>11} {percent(m['scatter'], mean, ''):>9} "
                         f"{percent(m['error'], mean):>12} {between:>23}")
    if result["no_scatter"]:
        lines += ["", "runs of a kind are all alike: no granules were moved apart, or it made no difference; name a variable with --vary"]
    return "\n".join([*lines, "",
                      "difference   mean of the culled runs less mean of those with half the limits",
                      f"scatter      standard deviation of single runs, whose limits are {min(VARIED[:runs]):.2g} to {max(VARIED[:runs]):.2g} times those meant",
                      f"error        of the culled runs, told without one that is not: {MIDDLE:.2g} times the difference",
                      f"between      in {100 * LEVEL:.0f} of 100 cases, if half the limits leave {100 * min(HALVED):.0f} to {100 * max(HALVED):.0f} % of the error, or turn its sign, or let",
                      "             it grow as much. An error that half the limits leave as it is they do not show"])
