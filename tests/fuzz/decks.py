"""A random deck as parts: what may be left out of it without making another kind of deck."""
import copy
from dataclasses import dataclass, field


@dataclass
class Part:
    """Lines that belong together; `culled`: what the deck with solid/cull says instead."""
    lines: list
    culled: list = None
    needed: bool = False

    def text(self, culled):
        return self.culled if culled and self.culled is not None else self.lines


@dataclass
class CullLine(Part):
    """The fix line, each keyword with its values a piece that may be left out."""
    keywords: list = field(default_factory=list)

    def text(self, culled):
        return [" ".join(["fix cull all solid/cull report full", *self.keywords])] if culled else []


@dataclass
class Deck:
    """One deck or two, the second of which reads what the first has written."""
    seed: int
    ranks: list                   # of each file
    files: list                   # of lists of Part
    traits: set = field(default_factory=set)
    meshes: dict = field(default_factory=dict)  # text of each STL file, by its name

    def text(self, file, culled):
        return "\n".join(line for part in self.files[file] for line in part.text(culled)) + "\n"

    def parts(self):
        return [(f, part) for f, parts in enumerate(self.files) for part in parts]

    def without(self, dropped):
        """The deck without these parts (by identity)."""
        made = copy.copy(self)
        made.files = [[p for p in parts if not any(p is d for d in dropped)] for parts in self.files]
        return made

    def up_to(self, line, more):
        """The deck that ends with the line that begins so, and with lines that follow it; None where there is none."""
        for f, parts in enumerate(self.files):
            for p, part in enumerate(parts):
                for n, there in enumerate(part.lines):
                    if there.startswith(line):
                        made = copy.copy(self)
                        made.files = [*self.files[:f], [*parts[:p], Part([*part.lines[:n + 1], *more])]]
                        return made
        return None
