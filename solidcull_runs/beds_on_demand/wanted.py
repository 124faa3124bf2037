"""What the user asks for."""
import math
from dataclasses import dataclass
from pathlib import Path

from ..errors import RunError
from .material import Material

MOST_TO_ONE = 4.0  # largest radius over the smallest one


@dataclass(frozen=True)
class Wanted:
    out: Path        # the restart file
    length: float    # m
    width: float
    depth: float     # m, or None
    granules: int    # or None
    sizes: tuple     # (radius in m, share by number), ...
    density: float   # kg/m3
    material: Material
    tile: float      # least edge of a tile, in largest diameters
    top: float       # m: of LIGGGHTS's box, or None
    seed: int

    @property
    def largest(self):
        """Radius (m)."""
        return max(r for r, _ in self.sizes)

    @property
    def diameter(self):
        """Mean by number (m)."""
        return 2 * sum(r * share for r, share in self.sizes)

    @property
    def volume(self):
        """Of a granule, mean (m3)."""
        return 4 / 3 * math.pi * sum(r**3 * share for r, share in self.sizes)


def read_sizes(text):
    """`0.0012:0.5,0.0014:0.5`: radii (m) and their shares by number, as shares of 1."""
    try:
        pairs = [[float(x) for x in part.split(":")] for part in text.split(",")]
        pairs = [(p[0], p[1] if len(p) > 1 else 1.0) for p in pairs if len(p) <= 2]
    except (ValueError, IndexError):
        pairs = []
    if len(pairs) != len(text.split(",")):
        raise RunError(f"--sizes {text}: write radius:share,radius:share,... with radii in m, such as 0.0012:0.5,0.0014:0.5")
    if not all(math.isfinite(x) and x > 0 for pair in pairs for x in pair):
        raise RunError(f"--sizes {text}: radii and shares must be more than 0")
    radii = [r for r, _ in pairs]
    if len(set(radii)) != len(radii):
        raise RunError(f"--sizes {text}: a radius stands there twice; give it one share")
    if max(radii) > MOST_TO_ONE * min(radii):
        raise RunError(f"--sizes {text}: the largest radius is more than {MOST_TO_ONE:g} times the smallest one; leave the finest out")
    whole = sum(share for _, share in pairs)
    return tuple(sorted((r, share / whole) for r, share in pairs))


def refuse(wanted):
    """Raises RunError at the first wrong value."""
    w = wanted

    def above_zero(option, value, unit=""):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise RunError(f"{option} {value:g}: it must be more than 0{unit}")
    if w.out.suffix != ".restart":
        raise RunError(f"{w.out}: the file's name must end with .restart")
    if not w.out.absolute().parent.is_dir():
        raise RunError(f"{w.out}: there is no folder {w.out.parent}; make it first")
    if any(c in w.out.name for c in " \t$&#\"'"):
        raise RunError(f"{w.out}: decks cannot read a file with such a name; leave out blanks, quotes and $ & #")
    above_zero("--box", w.length, " m")
    above_zero("--box", w.width, " m")
    above_zero("--depth", w.depth, " m")
    above_zero("--granules", w.granules)
    above_zero("--density", w.density, " kg/m3")
    above_zero("--tile", w.tile)
    if w.tile < 8:
        raise RunError(f"--tile {w.tile:g}: a tile of fewer than 8 diameters repeats its own order; 27 is the default")
    if not 1 <= w.seed <= 1000000:
        raise RunError(f"--seed {w.seed}: it must be 1 to 1000000")
    least = min(w.length, w.width)
    if least < 8 * 2 * w.largest:
        raise RunError(f"--box {w.length:g} {w.width:g}: {least:g} m is narrower than 8 of the largest diameters ({16 * w.largest:g} m)")
    depth = w.depth or w.granules * w.volume / (0.58 * w.length * w.width)
    if depth < 4 * 2 * w.largest:
        raise RunError(f"{'--depth' if w.depth else '--granules'} {w.depth or w.granules:g}: the bed would be {depth:.3g} m deep, and must be "
                       f"4 of the largest diameters at least ({8 * w.largest:.3g} m)")
    if w.top is not None and w.top < depth + 4 * w.largest:
        raise RunError(f"--top {w.top:g}: it must be above the bed, {depth + 4 * w.largest:.3g} m at least")
