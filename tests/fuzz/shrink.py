"""Leaves out of a deck what its failure does not need."""
import copy
import re

from decks import CullLine, Part


def shortened(deck):
    """Decks with a run, or all runs, of half the steps; with fewer ranks; with a keyword less."""
    for f, parts in enumerate(deck.files):
        for k, part in enumerate(parts):
            if isinstance(part, CullLine):
                for w in range(len(part.keywords)):
                    yield replaced(deck, f, k, CullLine([], needed=True, keywords=part.keywords[:w] + part.keywords[w + 1:]))
                continue
            for n, line in enumerate(part.lines):
                steps = re.match(r"run (\d+)(.*)", line)
                if steps and int(steps[1]) > 1:
                    for fewer in (0, int(steps[1]) // 2):
                        lines = part.lines[:n] + [f"run {fewer}"] + part.lines[n + 1:]
                        yield replaced(deck, f, k, Part(lines, part.culled, part.needed))
            if len(part.lines) > 1 and not part.needed:
                for n in range(len(part.lines)):
                    yield replaced(deck, f, k, Part(part.lines[:n] + part.lines[n + 1:], part.culled))
    for f, n in enumerate(deck.ranks):
        if n > 1:
            made = copy.copy(deck)
            made.ranks = deck.ranks[:f] + [n - 1] + deck.ranks[f + 1:]
            yield made


def replaced(deck, f, k, part):
    made = copy.copy(deck)
    made.files = [list(parts) for parts in deck.files]
    made.files[f][k] = part
    return made


def fewer_parts(deck, fails):
    """ddmin over the parts that may go."""
    size = max(1, sum(not p.needed for _, p in deck.parts()) // 2)
    while True:
        free = [p for _, p in deck.parts() if not p.needed]
        cut = False
        for at in range(max(0, len(free) - size), -size, -size):
            smaller = deck.without(free[max(0, at):at + size])
            if at + size > 0 and fails(smaller):
                deck, cut = smaller, True
                free = free[:max(0, at)] + free[at + size:]
        if size == 1 and not cut:
            return deck
        size = size if cut and size == 1 else max(1, size // 2)


def shrink(deck, fails, most=200):
    """The smallest deck found that fails still; `fails(deck)` runs it. At most so many runs."""
    runs = 0

    def counted(smaller):
        nonlocal runs
        runs += 1
        return runs <= most and fails(smaller)

    while True:
        before = runs
        deck = fewer_parts(deck, counted)
        changed, again = False, True
        while again and runs <= most:
            again = False
            for smaller in shortened(deck):
                if counted(smaller):
                    deck, changed, again = smaller, True, True
                    break
        if not changed or runs > most or runs == before:
            return deck
