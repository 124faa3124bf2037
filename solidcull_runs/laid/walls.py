"""The number of the walls of a deck, as the fix knows them: a restart file that has it holds what is pressed on these walls."""
import re
from pathlib import Path

import numpy as np

from .. import engine
from ..errors import RunError
from . import culled_files as files


def deck_without_bed(text, box, file):
    """The lines of a deck up to its fix line, with one granule in place of the restart file; it writes `file`. `box`: low and high
    along x, y and z (m), of LIGGGHTS's box."""
    head, found, _ = text.partition(" solid/cull")
    bounds, middle = " ".join(f"{b:.17g}" for b in box), " ".join(f"{(box[k] + box[k + 1]) / 2:.17g}" for k in (0, 2, 4))
    alone = (f"region whole block {bounds} units box\ncreate_box 1 whole\ncreate_atoms 1 single {middle} units box\n"
             f"set group all diameter {0.5 * min(box[k + 1] - box[k] for k in (0, 2, 4)):.6g} density 1000")
    lines, n = re.subn(r"(?m)^\s*read_restart\b.*$", alone, head.rpartition("\n")[0])
    if not found or n != 1:
        raise RunError("a deck whose walls are asked for has one line read_restart, and a fix solid/cull behind it")
    return f"{lines}\nfix cull all solid/cull\nrun 0\nwrite_restart {file}\n"


def number_of(text, box, launcher, folder, variables=None):
    """Of the walls of a deck, given as its text, that is run in `folder`."""
    folder = Path(folder)
    deck, log, file = (folder / f"walls.{suffix}" for suffix in ("in", "log", "restart"))
    deck.write_text(deck_without_bed(text, box, file.name))
    try:
        engine.Process(launcher, deck, folder, log, variables or {}).wait()
        data = file.read_bytes()
    finally:
        deck.unlink()
        file.unlink(missing_ok=True)
    log.unlink()
    start, count = files.state_places(data)
    high, low = np.frombuffer(data, "<f8", count, start)[files.STATE_WALLS:files.STATE_WALLS + 2]
    return int(high) << 32 | int(low)


def box_of(sides, beyond, top):
    """LIGGGHTS's box of a bed that is laid: so far beyond the sides, and up to `top` (m)."""
    return (-beyond, sides[0] + beyond, -beyond, sides[1] + beyond, -beyond, top)
