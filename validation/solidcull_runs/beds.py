"""What is made once and kept as long as it is made of the same: beds, and files that scripts write."""
import json
import os
from pathlib import Path

from .engine import run_liggghts


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


def settled(file, deck, sources=(), variables=None, writes="restart", more="", **how):
    """A bed, settled by a deck in the deck's own folder. `sources`: files that the deck reads; `writes`: the deck's variable that
    names the restart file; `more`: what else the bed is made of."""
    deck, given = Path(deck), dict(variables or {})
    recipe = "\n".join([json.dumps(given, default=str), *(Path(f).read_text() for f in (deck, *sources)), more])

    def make(part):
        run_liggghts(deck, deck.parent, Path(file).with_suffix(".log"), {**given, writes: os.path.relpath(part, deck.parent)})
    return made(file, recipe, make, **how)


def write_if_new(file, text):
    """Writes a file unless it holds the text, so that what is made of it is not older."""
    if not file.exists() or file.read_text() != text:
        file.write_text(text)
