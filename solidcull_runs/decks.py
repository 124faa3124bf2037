"""One deck, made culled and unculled: lines of text in, lines of text out."""
import re
from pathlib import Path

from .dumps import COUNTS
from .errors import RunError
from .logs import FROM_HERE, THERMO_WORDS, TO_HERE, reducer_of

SAMPLE_EVERY = 10  # steps between two rows of COUNTS
SEEDS = (15485863, 15485867, 32452843, 32452867, 49979687, 49979693, 67867967, 67867979, 86028121, 86028157)
ENDS_BEFORE = "twin: compared up to line "
SETTING_UP = {"fix", "fix_modify", "compute", "compute_modify", "thermo", "thermo_style", "thermo_modify", "dump", "dump_modify", "region",
              "variable", "timestep", "neighbor", "neigh_modify", "restart"}  # commands that ask for no granule
CULL_LINE = re.compile(r"^([ \t]*fix[ \t]+\S+[ \t]+\S+[ \t]+solid/cull(?=\s|$)[^#\n]*?)([ \t]*#.*)?$", re.M)  # and its comment


def read_deck(path):
    """Logical lines of a deck (`&` joined); a file that it includes is put in place when it holds the fix line, thermo columns or a run."""
    try:
        text = Path(path).read_text()
    except OSError as e:
        raise RunError(f"cannot read the deck {path}: {e.strerror}") from None
    lines = []
    for line in re.sub(r"&[ \t]*\n", " ", text).splitlines():
        included = re.match(r"\s*include\s+(\S+)", line)
        file = Path(path).parent / included[1] if included else None
        if file and file.is_file() and re.search(r"solid/cull|thermo_style|^\s*run\s", file.read_text(), re.M):
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
    made, lines = CULL_LINE.subn(lambda line: f"{line[1]} {keywords}{line[2] or ''}", text)
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
            if kind in ("region", "group") and (word == name or re.search(rf"(?<=[(,]){n}(?=[,)])", word)):
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


def make_deck(lines, fix_id, culled, shift, base, restored=False):
    """The deck of one run, as lines. `shift`: a shifts.Shift, or None. `base`: path without suffix for what this run writes. `restored`:
    the deck begins with a file that holds culled granules, so every run takes them up with the fix line, an unculled one then ends it."""
    hangs = Dependents(fix_id)
    ended, counting, waiting, ran, out = set(), False, False, False, []
    for number, line in enumerate(lines, 1):
        w = words_of(line)
        if w[:1] == ["fix"] and w[3:4] == ["solid/cull"]:
            out += [f'print "{FROM_HERE}"', line if culled or restored else f"# {line}"]
            out += [counts_line(fix_id, base)] * culled + (shift.begin() if shift else [])
            counting, waiting = True, restored
            continue
        if waiting and w and w[0] not in SETTING_UP:
            out += ["run 0"] + [f"unfix {fix_id}"] * (not culled)
            waiting = False
        hanging = bool(w) and hangs.touches(w)
        if w[:1] == ["run"] and counting and not hanging:
            out += shift.before(w, line) if shift else [line]
            ran = True
            continue
        if not hanging:
            out.append(line)
            continue
        kept_out = w[0] in ("thermo_style", "print") or w[0] in hangs.MAKERS or w[0] in hangs.ENDERS
        if not kept_out and not ran:
            raise RunError(f"line {number} hangs on the solid/cull fix and cannot be left out: {' '.join(w)}")
        if not kept_out:
            out.append(f'print "{ENDS_BEFORE}{number}"')
            break
        if w[0] in ("unfix", "uncompute", "undump"):
            ended.add((hangs.ENDERS[w[0]], w[1]))
        if culled:
            out += ["unfix twin_counts"] * (w[:2] == ["unfix", fix_id]) + [line]
        elif w[0] == "thermo_style" or w[0] == "dump" and w[3:4] == ["custom"]:
            out.append(" ".join(x for x in w if not hangs.names(x)))
        else:
            out.append(f"# {line}")
    out.append(f'print "{TO_HERE}"')
    if ("fix", fix_id) not in ended:
        out.append("thermo_style one")
        if culled:
            out += ["unfix twin_counts"] + hangs.undo(ended) + [f"unfix {fix_id}"]
        out.append("run 0")
    return out + end_of_deck(f"{base}.final")


def ends_before(lines):
    """The first line of a deck of make_deck's that hangs on the fix and has no meaning without it: its number, or None."""
    found = [re.match(f'print "{ENDS_BEFORE}(\\d+)"', line) for line in lines]
    return next((int(m[1]) for m in found if m), None)


def value_of(word, lines, variables):
    """A word of a deck with the values of its variables put in; None where LIGGGHTS alone can tell."""
    known = {w[1]: w[3] for w in map(words_of, lines) if w[:1] == ["variable"] and w[2:3] in (["index"], ["string"]) and len(w) > 3} | variables
    made = re.sub(r"\$\{(\w+)\}|\$(\w)", lambda m: str(known.get(m[1] or m[2], m[0])), word)
    return None if re.search(r"[$*%]", made) else made


def restart_of(lines, fix_id, variables):
    """The file that the deck reads before its fix line, or None."""
    for w in map(words_of, lines):
        if w[:1] == ["read_restart"] and len(w) > 1:
            return value_of(w[1], lines, variables)
        if w[:2] == ["fix", fix_id]:
            break
    return None


def check_vary(name, values, runs, lines):
    """Refuses a variable that takes no value from outside, or has too few of them."""
    if len(values) < runs:
        raise RunError(f"--vary {name} has {len(values)} values for {runs} runs")
    made = next((w for w in map(words_of, lines) if w[:2] == ["variable", name]), None)
    if made and made[2:3] != ["index"]:
        raise RunError(f"--vary {name}: only a variable of style index takes a value from outside; write `variable {name} index ...` "
                       f"in place of `{' '.join(made)}`")
    uses = rf"\$\{{{name}\}}|\bv_{name}\b" + (rf"|\${name}" if len(name) == 1 else "")
    if not any(re.search(uses, line) or words_of(line)[:1] in (["include"], ["jump"]) for line in lines):
        raise RunError(f"--vary {name}: the deck does not use it; write ${{{name}}} where the value is to stand")


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
