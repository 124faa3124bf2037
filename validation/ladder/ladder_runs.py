"""A deck of this folder, with its solid/cull line or without."""
from pathlib import Path

from solidcull_runs import decks, engine

HERE = Path(__file__).resolve().parent


def run(deck, with_the_line, base, place, variables):
    """What it printed. `base`: name without suffix of what the run writes in the folder `place`."""
    lines = decks.make_deck(decks.read_deck(HERE / deck), "cull", with_the_line, None, place / base)
    made = place / f"{base}.in"
    made.write_text("\n".join(line for line in lines if "twin_counts" not in line) + "\n")
    return engine.run_liggghts(made, place, place / f"{base}.log", variables)
