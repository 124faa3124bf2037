"""One deck, made culled and unculled: lines of text in, lines of text out."""
import re
from pathlib import Path

from .dumps import COUNTS
from .errors import RunError
from .logs import FROM_HERE, THERMO_WORDS, TO_HERE, reducer_of

SAMPLE_EVERY = 10  # steps between two rows of COUNTS
SHIFT = 1e-5       # granule diameters, between two unculled runs
SEEDS = (15485863, 15485867, 32452843, 32452867, 49979687, 49979693, 67867967, 67867979, 86028121, 86028157)
CULL_LINE = re.compile(r"^(fix\s+\S+\s+\S+\s+solid/cull.*)$", re.M)


def read_deck(path):
    """Logical lines of a deck (`&` joined); a file that it includes is put in place when it holds the fix line or thermo columns."""
    try:
        text = Path(path).read_text()
    except OSError as e:
        raise RunError(f"cannot read the deck {path}: {e.strerror}") from None
    lines = []
    for line in re.sub(r"&[ \t]*\n", " ", text).splitlines():
        included = re.match(r"\s*include\s+(\S+)", line)
        file = Path(path).parent / included[1] if included else None
        if file and file.is_file() and re.search("solid/cull|thermo_style", file.read_text()):
            lines += read_deck(file)
        else:
            lines.append(line)
    return lines


def words_of(line):
    """The words of a line, without its comment."""
    return re.sub(r"(^|\s)#.*", "", line).split()


def without_comments(lines):
    """A deck as text, without comments, empty lines and spaces: what its results depend on."""
    return "\n".join(" ".join(words) for words in map(words_of, lines) if words)


def with_keywords(text, keywords):
    """A deck whose solid/cull line has more keywords."""
    made, lines = CULL_LINE.subn(lambda line: f"{line[1]} {keywords}", text)
    if lines != 1:
        raise RunError(f"a deck with {lines} solid/cull lines cannot be given the keywords: {keywords}")
    return made


def cull_fix(lines, deck="the deck"):
    """The ID of the solid/cull fix."""
    ids = [w[1] for w in map(words_of, lines) if w[:1] == ["fix"] and w[3:4] == ["solid/cull"]]
    if not ids:
        raise RunError(f"{deck} has no `fix ID group solid/cull` line; add one, it is what twin takes out and puts back")
    if len(ids) > 1:
        raise RunError(f"{deck} has {len(ids)} solid/cull lines; twin compares one")
    return ids[0]


class Dependents:
    """What in a deck hangs on the solid/cull fix: followed line by line, through variables, computes, fixes and regions."""

    MAKERS = {"variable": ("v_", "variable {} delete"), "compute": ("c_", "uncompute {}"), "fix": ("f_", "unfix {}"),
              "dump": ("", "undump {}"), "region": ("", "region {} delete"), "group": ("", None)}
    ENDERS = {"unfix": "fix", "fix_modify": "fix", "uncompute": "compute", "undump": "dump", "dump_modify": "dump"}

    def __init__(self, fix_id):
        self.made = [("fix", fix_id)]

    def names(self, word):
        """Whether this word refers to something that hangs on the fix."""
        for kind, name in self.made:
            prefix = self.MAKERS[kind][0]
            n = re.escape(name)
            if prefix and re.search(rf"(?<!\w){prefix}{n}(?!\w)", word):
                return True
            if kind == "variable" and (f"${{{name}}}" in word or len(name) == 1 and f"${name}" in word):
                return True
            if kind in ("region", "group") and word == name:
                return True
        return False

    def touches(self, w):
        """Whether a command (its words) hangs on the fix; what it makes then does too."""
        kind = self.ENDERS.get(w[0])
        if kind:
            return (kind, w[1]) in self.made
        hangs = any(map(self.names, w[1:])) or w[0] == "region" and w[2:3] == ["interface/mesh"]
        if hangs and w[0] in self.MAKERS and (w[0], w[1]) not in self.made:
            self.made.append((w[0], w[1]))
        return hangs

    def undo(self, ended):
        """Commands that take away, last first, all but the fix itself and what the deck has ended itself."""
        return [self.MAKERS[kind][1].format(name) for kind, name in reversed(self.made[1:])
                if self.MAKERS[kind][1] and (kind, name) not in ended]


def end_of_deck(final):
    """Lines behind the deck's last: every granule's mass and place, for the ledger."""
    return [f'write_dump all custom "{final}" id mass radius x y z modify format "%d %.15g %.15g %.15g %.15g %.15g"']


def make_deck(lines, fix_id, culled, shift_seed, base):
    """The deck of one run, as lines. `base`: path without suffix for what this run writes."""
    hangs = Dependents(fix_id)
    ended, counting, shifted, out = set(), False, False, []
    for number, line in enumerate(lines, 1):
        w = words_of(line)
        if w[:1] == ["fix"] and w[3:4] == ["solid/cull"]:
            out += [f'print "{FROM_HERE}"'] + ([line, counts_line(fix_id, base)] if culled else [f"# {line}"])
            counting = True
            continue
        if w[:1] == ["run"] and counting and not shifted:
            out += shift_lines(shift_seed)
            shifted = True
        if not w or not hangs.touches(w):
            out.append(line)
            continue
        if w[0] in ("unfix", "uncompute", "undump"):
            ended.add((hangs.ENDERS[w[0]], w[1]))
        if culled:
            out += ["unfix twin_counts"] * (w[:2] == ["unfix", fix_id]) + [line]
        elif w[0] == "thermo_style" or w[0] == "dump" and w[3:4] == ["custom"]:
            out.append(" ".join(x for x in w if not hangs.names(x)))
        elif w[0] in hangs.MAKERS or w[0] in hangs.ENDERS or w[0] == "print":
            out.append(f"# {line}")
        else:
            raise RunError(f"line {number} hangs on the solid/cull fix and cannot be left out: {' '.join(w)}")
    out.append(f'print "{TO_HERE}"')
    if ("fix", fix_id) not in ended:
        out.append("thermo_style one")
        if culled:
            out += ["unfix twin_counts"] + hangs.undo(ended) + [f"unfix {fix_id}"]
        out.append("run 0")
    return out + end_of_deck(f"{base}.final")


def check_metrics(metrics, lines):
    """Refuses, before hours of running, a metric that the unculled deck (its lines) will not print."""
    for metric in metrics:
        reducer_of(metric)
    styles = [words_of(line)[1:] for line in lines if words_of(line)[:1] == ["thermo_style"]]
    hidden = any(words_of(line)[:1] == ["include"] and "$" in line for line in lines)
    if hidden or any(s[:1] != ["custom"] for s in styles[:-1]) or len(styles) < 2:  # the last one may be end_of_deck's
        return
    columns = list(dict.fromkeys(c for s in styles if s[:1] == ["custom"] for c in s[1:]))
    bare = [re.sub(r"^[cfv]_", "", c) for c in columns] + [THERMO_WORDS.get(c) for c in columns]
    for name in (m.split(":")[0] for m in metrics):
        if name not in columns and name not in bare:
            raise RunError(f"{name} is not among the thermo columns of the deck without the fix: {', '.join(columns)}")


def counts_line(fix_id, base):
    columns = " ".join(f"f_{fix_id}[{k}]" for k in range(1, len(COUNTS) + 1))
    return f'fix twin_counts all ave/time {SAMPLE_EVERY} 1 {SAMPLE_EVERY} {columns} file "{base}.counts"'


def shift_lines(seed):
    """Moves every granule by up to SHIFT of its diameter; nothing without a seed."""
    if not seed:
        return []
    lines = []
    for k, axis in enumerate("xyz"):
        lines += [f"variable twin_{axis} atom {axis}+{2 * SHIFT:g}*r*random(-1,1,{seed + k})",
                  f"set group all {axis} v_twin_{axis}"]
    return lines
