"""Beds, their restart files, and other files: made once, and kept as long as they are made of the same."""
import json
import os
from pathlib import Path

from .engine import run_liggghts

ENDS, END_WORDS = b"SDCULLE1", 9  # the end of a section of culled granules, see culling/store_section.h


def made(file, recipe, make, say=lambda line: print(line, flush=True)):
    """The file, made by `make(part)` unless it is there, made of the same recipe (a text). `part`: where to write it first."""
    file = Path(file)
    note = file.with_suffix(".recipe")
    if not (file.exists() and note.exists() and note.read_text() == recipe):
        say(f"  making {file.name}")
        file.parent.mkdir(parents=True, exist_ok=True)
        note.unlink(missing_ok=True)
        part = file.with_suffix(".part")
        make(part)
        part.rename(file)
        note.write_text(recipe)
    return file


def recipe_of(file):
    """The recipe of a file that was made."""
    return Path(file).with_suffix(".recipe").read_text()


def settled(file, deck, sources=(), variables=None, writes="restart", more="", ranks=1, **how):
    """A bed, settled by a deck in the deck's own folder. `sources`: files that the deck reads; `writes`: the deck's variable that
    names the restart file; `more`: what else the bed is made of."""
    deck, given = Path(deck), dict(variables or {})
    recipe = "\n".join([json.dumps(given, default=str), *(Path(f).read_text() for f in (deck, *sources)), more])

    def make(part):
        run_liggghts(deck, deck.parent, Path(file).with_suffix(".log"), {**given, writes: os.path.relpath(part, deck.parent)}, ranks)
    return made(file, recipe, make, **how)


def holds_culled(file):
    """Whether culled granules stand at the end of a restart file; False where it cannot be read."""
    try:
        return ENDS in Path(file).read_bytes()[-8 * END_WORDS:][:len(ENDS)]
    except OSError:
        return False
