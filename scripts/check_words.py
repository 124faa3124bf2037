#!/usr/bin/python3
"""Counts the words of the pages for users, and follows their links.

    scripts/check_words.py [FILE.md ...]        default: README.md and all pages for users

A sentence has 25 words at most, README.md 90 lines, and every relative link or image leads to a file that is there (and a
`#heading` to a heading). Paragraphs are cut into sentences; a heading, a list item, a table cell and a picture's caption each
stand alone. Blocks of code and of `$$` formulas do not count; a `code span` is one word, and so is a `$formula$`. Prints file, line and text of each fault. Exit: 0 none, 1 some.
"""
import argparse
import re
import sys
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
PAGES = ("README.md", "ARCHITECTURE.md", "CHANGELOG.md", "CONTRIBUTING.md", "tests/golden/README.md", "tests/fuzz/README.md", "tests/gate/README.md", "fix_solid_cull/**/*.md", "region_interface_mesh/*.md", "benchmarks/README.md", "examples/**/*.md",
         "validation/**/*.md")
MADE = {"out", "build", "report"}  # folders of what runs leave
MOST_WORDS = 25
MOST_LINES = {"README.md": 90}  # of the file in the root
ABBREVIATIONS = {"e.g.", "i.e.", "al.", "cf.", "vs.", "approx.", "eq.", "fig.", "no.", "resp."}

FENCE = re.compile(r"\s*(```|~~~|\$\$\s*$)")
ITEM = re.compile(r"\s*(?:[-*+]|\d+[.)])\s+")
HEADING = re.compile(r"#{1,6}\s+")
TABLE_RULE = re.compile(r"\s*\|?[\s:|-]+\|?\s*$")
IMAGE = re.compile(r"!\[([^\]]*)\]\(([^)\s]+)[^)]*\)")
LINK = re.compile(r"\[([^\]]*)\]\(([^)\s]+)[^)]*\)")
CODE = re.compile(r"(`+)(.+?)\1")
FORMULA = re.compile(r"\$[^$]+\$")
CELL_EDGE = re.compile(r"(?<!\\)\|")
HIDDEN = {c: chr(0xE000 + c) for c in range(128) if not chr(c).isalnum()}  # of code, in characters that mean nothing
SHOWN = {ord(h): chr(c) for c, h in HIDDEN.items()}


class Fault(NamedTuple):
    file: Path
    line: int
    text: str


class Sentence(NamedTuple):
    line: int  # on which it begins
    text: str
    words: int


def hide_code(line):
    """The line with each code span and formula as one word, so that a stop or a bar in it is none of the text's."""
    return FORMULA.sub(lambda m: m[0].translate(HIDDEN), CODE.sub(lambda m: m[0].translate(HIDDEN), line))


def pieces(text):
    """Paragraphs, list items, headings, table cells and captions, each as a list of (line, text); code blocks left out."""
    current, fenced, indented, blank, in_list = [], False, False, True, False

    def close():
        nonlocal current
        done, current = current, []
        return [done] if done else []

    for number, raw in enumerate(text.splitlines(), 1):
        if FENCE.match(raw):
            fenced = not fenced
            yield from close()
            continue
        if fenced:
            continue
        indented = raw.startswith(("    ", "\t")) and (blank or indented) and not in_list
        if indented and raw.strip():
            yield from close()
            blank = False
            continue
        line = hide_code(re.sub(r"^\s*>\s?", "", raw))
        blank = not line.strip()
        if blank:
            yield from close()
            continue
        for alt, _ in IMAGE.findall(line):
            yield [(number, alt)]
        line = LINK.sub(r"\1", IMAGE.sub("", line))
        if HEADING.match(line):
            in_list = False
            yield from close()
            yield [(number, HEADING.sub("", line))]
        elif line.lstrip().startswith("|"):
            in_list = False
            yield from close()
            if not TABLE_RULE.match(line):
                for cell in CELL_EDGE.split(line.strip().strip("|")):
                    yield [(number, cell)]
        elif ITEM.match(line):
            in_list = True
            yield from close()
            current = [(number, ITEM.sub("", line))]
        else:
            if not current and not raw.startswith(" "):
                in_list = False
            current.append((number, line))
    yield from close()


def sentences(text):
    """Every sentence of a page; what has no letter and no digit is no word."""
    for piece in pieces(text):
        tokens = []
        for number, token in [(number, token) for number, line in piece for token in line.split()] + [(0, None)]:
            if token:
                tokens.append((number, token))
                bare = token.rstrip(")\"'*_]”’")
                if bare[-1:] not in tuple(".!?") or bare.endswith("...") or bare.lstrip("([").lower() in ABBREVIATIONS:
                    continue
            words = sum(bool(re.search(r"\w", t)) for _, t in tokens)
            if words:
                yield Sentence(tokens[0][0], " ".join(t for _, t in tokens).translate(SHOWN), words)
            tokens = []


def slug(heading):
    """The name by which a link finds a heading, as GitHub makes it."""
    return re.sub(r"\s", "-", re.sub(r"[^\w\s-]", "", heading.replace("`", "").strip().lower()))


def outside_code(text):
    """Numbered lines that are not in a block of code or formulas, code spans taken out."""
    fenced = False
    for number, line in enumerate(text.splitlines(), 1):
        if FENCE.match(line):
            fenced = not fenced
        elif not fenced and not line.startswith("    "):
            yield number, CODE.sub("", line)


def headings(file):
    return {slug(line.lstrip("#")) for line in file.read_text().splitlines() if HEADING.match(line)}


def long_sentences(file):
    for s in sentences(file.read_text()):
        if s.words > MOST_WORDS:
            yield Fault(file, s.line, f"{s.words} words, {MOST_WORDS} at most: {s.text}")


def dead_links(file):
    for number, line in outside_code(file.read_text()):
        for _, target in LINK.findall(line):
            if re.match(r"[a-z]+:", target):
                continue
            name, _, heading = target.partition("#")
            found = file.parent / name if name else file
            if not found.exists():
                yield Fault(file, number, f"leads nowhere: {target}")
            elif heading and found.suffix == ".md" and heading not in headings(found):
                yield Fault(file, number, f"no such heading: {target}")


def too_many_lines(file, root):
    most = MOST_LINES.get(file.name) if file.resolve().parent == root.resolve() else None
    count = len(file.read_text().splitlines())
    if most and count > most:
        yield Fault(file, count, f"{count} lines, {most} at most")


def faults(file, root=ROOT):
    return [*too_many_lines(file, root), *long_sentences(file), *dead_links(file)]


def pages(root=ROOT):
    found = {f for pattern in PAGES for f in root.glob(pattern)}
    return sorted(f for f in found if not MADE & set(f.relative_to(root).parts) and ".twin" not in str(f))


def longest(file):
    return max((s.words for s in sentences(file.read_text())), default=0)


def main(argv=None):
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("files", nargs="*", type=Path, metavar="FILE.md")
    files = p.parse_args(argv).files or pages()
    found = []
    for file in files:
        here = faults(file)
        found += here
        print(f"{file}: {len(file.read_text().splitlines())} lines, longest sentence {longest(file)} words"
              + (f", {len(here)} faults" if here else ""))
    for f in found:
        print(f"{f.file}:{f.line}: {f.text}", file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
