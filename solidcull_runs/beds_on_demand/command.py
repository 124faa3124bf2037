"""Makes a bed at rest in a box, already culled, and a deck that starts from it.

    solidcull-bed --box 0.60 0.60 --depth 0.05 --sizes 0.0012:0.5,0.0014:0.5 --density 2500 --material material.in bed.restart

Writes bed.restart, bed.in (a deck that runs at once), bed.floor.stl and bed.txt (what was made). A tile, periodic in x and y, is poured.
Nine of it settle between four sides. The bed is laid of copies of their corners, edges and middle, so its time hardly grows with
its size. A box that is smaller than three tiles a side is poured as a whole.

Pieces are kept in bed.pieces/. The same command goes on from them after a kill; delete the folder when the bed is made.
Boxes with four flat sides, a flat floor and an open top are made, and no other shape. Units are SI. Exit: 0 made, 2 not, as a line says.
"""
import argparse
import sys
from pathlib import Path

from .. import engine, errors
from .handed_over import make
from .material import read_material
from .plan import TILE, Plan
from .wanted import Wanted, read_sizes, refuse

NAME = "solidcull-bed"


class Parser(argparse.ArgumentParser):
    def error(self, message):
        raise errors.RunError(f"{message}; `{NAME} --help` lists the options")


def parser():
    p = Parser(prog=NAME, description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("out", metavar="BED.restart", type=Path)
    p.add_argument("--box", nargs=2, metavar=("LENGTH", "WIDTH"), help="m: between the sides, along x and y")
    how_much = p.add_mutually_exclusive_group(required=True)
    how_much.add_argument("--depth", type=float, metavar="H", help="m: mean height of the surface")
    how_much.add_argument("--granules", type=int, metavar="N", help="as near to it as equal tiles allow")
    p.add_argument("--sizes", required=True, metavar="R:SHARE,...", help="radii in m and their shares by number")
    p.add_argument("--density", type=float, required=True, help="kg/m3")
    p.add_argument("--material", required=True, metavar="FILE", help="lines of a deck: pair_style, properties, timestep, gravity, variable contact")
    p.add_argument("--seed", type=int, default=1, help="another one gives another bed (default 1)")
    p.add_argument("--top", type=float, metavar="Z", help="m: height of LIGGGHTS's box (default: 4 depths)")
    p.add_argument("--tile", type=float, default=TILE, metavar="D", help=f"least edge of a tile, in largest diameters (default {TILE})")
    p.add_argument("--launcher", help=f"default: {engine.NAMED_BY}, else build/liggghts-solidcull, else the one on the PATH")
    return p


def sides_of(words):
    """Length and width; RunError where they are no numbers, as an STL file is none."""
    if words is None:
        raise errors.RunError("--box is missing: give length and width of the box in m, such as --box 0.6 0.6")
    try:
        return [float(word) for word in words]
    except ValueError:
        raise errors.RunError(f"--box {' '.join(words)}: give two lengths in m. Containers of other shapes, such as STL files, are not made: pour "
                              "into them with the line `fix cull all solid/cull` in the deck") from None


def main(argv=None):
    words = parser().parse_args(argv)
    length, width = sides_of(words.box)
    wanted = Wanted(words.out, length, width, words.depth, words.granules, read_sizes(words.sizes), words.density,
                    read_material(words.material), words.tile, words.top, words.seed)
    refuse(wanted)
    plan = Plan(wanted)
    if not plan.laid:
        print(f"  the box is smaller than 3 tiles a side ({plan.least_box:.3g} m): it is poured as a whole", flush=True)
    told = make(plan, words.out.absolute().with_suffix(".pieces"), engine.find_launcher(words.launcher),
                lambda line: print(line, flush=True))
    print(f"{words.out}: {told['granules']:,} granules, {told['seconds']} s; start with {words.out.with_suffix('.in')}")
    return 0


if __name__ == "__main__":
    sys.exit(errors.command(NAME, main))
