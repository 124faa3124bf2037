"""The user's material file: lines of a deck between `create_box` and the walls."""
import math
import re
from dataclasses import dataclass
from pathlib import Path

from ..errors import RunError

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
EXAMPLE = "see fix_solid_cull/solidcull_bed.md for one that does"


@dataclass(frozen=True)
class Material:
    file: str
    text: str
    timestep: float    # s
    gravity: float     # m/s2, along -z
    gravity_fix: str   # ID of its fix
    types: int         # of atoms; granules are of the first, walls of the last


def read_material(file):
    try:
        text = Path(file).read_text()
    except (OSError, UnicodeDecodeError) as e:
        raise RunError(f"material file {file} cannot be read ({getattr(e, 'strerror', None) or 'it is no text'}): name one with --material") from None
    lines = re.sub(r"#.*", "", text.replace("&\n", " "))

    def found(pattern, what):
        match = re.search(pattern, lines, re.M)
        if not match:
            raise RunError(f"material file {file} has no line `{what}`; {EXAMPLE}")
        return match
    found(r"^\s*pair_style\s+gran\b", "pair_style gran ...")
    found(r"^\s*variable\s+contact\s+string\s+\S", 'variable contact string "model ..."')
    timestep = float(found(rf"^\s*timestep\s+({NUMBER})\s*$", "timestep SECONDS")[1])
    gravity = found(r"^\s*fix\s+(\S+)\s+all\s+gravity\s+(\S+)\s+vector\s+(\S+)\s+(\S+)\s+(\S+)\s*$", "fix ID all gravity G vector 0 0 -1")
    young = found(rf"^\s*fix\s+\S+\s+all\s+property/global\s+youngsModulus\s+peratomtype((?:\s+{NUMBER})+)\s*$",
                  "fix ID all property/global youngsModulus peratomtype ...")
    try:
        g, x, y, z = (float(word) for word in gravity.groups()[1:])
    except ValueError:
        raise RunError(f"material file {file}: gravity `{' '.join(gravity.groups()[1:])}` is not four numbers; write them out") from None
    if not (g > 0 and z < 0 and x == y == 0 and math.isfinite(g)):
        raise RunError(f"material file {file}: gravity {g:g} along {x:g} {y:g} {z:g}; beds are made under gravity along 0 0 -1")
    if timestep <= 0:
        raise RunError(f"material file {file}: timestep {timestep:g}; it must be more than 0")
    return Material(str(file), text, timestep, g, gravity[1], len(young[1].split()))
