"""theory.md and the code name each other: every section that is cited is there, every place that the page names is in the code, every
equation has its place, and every section with equations is cited by code. And the checks themselves, on pages and code with faults."""
import re
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "scripts"))
import check_words  # noqa: E402

PAGE = Path("fix_solid_cull/theory.md")
FOLDERS = ("fix_solid_cull", "region_interface_mesh", "tests", "scripts", "benchmarks", "examples", "validation", "solidcull_runs")
CODE = {".h", ".cpp"}
TEXT = CODE | {".md", ".py", ".cmake", ".txt", ".sh", ".in"}
CITED = re.compile(r"theory\.md#([\w-]+)")
TAG = re.compile(r"\\tag\{(\w+)\}")
EQUATION = re.compile(r"\b[A-HJ-Z]\d+\b")  # as the text names it; I1 to I10 are invariants
OTHER_DOCUMENT = re.compile(r"\bDESIGN\s+section|\bthe design('s)?\s+section", re.IGNORECASE)
NOT_BEFORE_A_DEFINITION = re.compile(r"\b(return|else|throw|new|case)\b|[=.?!(]|->")


def files(root, suffixes):
    """What the project says, by its path; not what builds and runs leave, nor this file, which has faults in it."""
    found = [f for f in root.glob("*.md")] + [f for name in FOLDERS for f in (root / name).rglob("*")]
    for f in sorted(found):
        path = f.relative_to(root)
        if f.is_file() and f.suffix in suffixes and not check_words.MADE & set(path.parts) and f.name != Path(__file__).name:
            yield path, f.read_text(errors="replace")


def scope_of(name, text):
    """The lines of a class or struct of this name, up to the brace that ends it; nothing if it is not defined here."""
    lines = text.splitlines()
    for at, line in enumerate(lines):
        head = re.match(rf"(\s*)(?:class|struct)\s+(?:\w+::)*{name}\b(?!.*;\s*$)", line)
        if head:
            end = next((k for k in range(at + 1, len(lines)) if re.match(rf"{head[1]}}}", lines[k])), len(lines))
            return lines[at + 1:end]
    return None


def defines(lines, name):
    """Whether a function of this name is defined or declared in these lines, and not only called."""
    for line in lines:
        for found in re.finditer(rf"(?<![\w:~]){re.escape(name)}\s*\(", line):
            before = line[:found.start()]
            if not NOT_BEFORE_A_DEFINITION.search(before) and not before.lstrip().startswith("//") and \
                    (before.strip() or "::" in name):
                return True
    return False


def is_in(text, name):
    """A function `f`, `Class::f`, a test `Suite.name` or a Python function: whether the text of this file has it."""
    if "." in name:
        suite, test = name.split(".")
        return re.search(rf"^TEST(?:_F|_P)?\({suite},\s*{test}\)", text, re.MULTILINE) is not None
    if re.search(rf"^\s*def {name}\(", text, re.MULTILINE):
        return True
    if "::" not in name:
        return defines(text.splitlines(), name)
    scopes, function = name.rsplit("::", 1)
    if defines(text.splitlines(), name):
        return True
    inside = scope_of(scopes.rsplit("::", 1)[-1], text)
    if inside is None:
        return False
    constructor = function == scopes.rsplit("::", 1)[-1]
    return defines([f"explicit {line}" for line in inside] if constructor else inside, function)


class Section:
    def __init__(self, heading):
        self.anchor = check_words.slug(heading)
        self.tags, self.bare, self.rows = [], 0, []  # bare: formulas without a tag; rows: (line, first cell, file, functions)


def sections(text):
    """Sections of the second level."""
    found, block, fenced, columns = [], None, False, []
    for number, line in enumerate(text.splitlines(), 1):
        if line.startswith("```"):
            fenced = not fenced
        if fenced:
            continue
        if line.strip() == "$$":
            if block is not None and found:
                found[-1].tags += TAG.findall(block)
                found[-1].bare += not TAG.search(block)
            block = "" if block is None else None
        elif block is not None:
            block += line + "\n"
        elif line.startswith("## "):
            found.append(Section(line[3:]))
        elif line.startswith("|") and found:
            cells = [c.strip() for c in line.strip().strip("|").split("|")]
            if not columns:
                columns = cells
            elif columns[1:2] == ["file"] and not set(line) <= set("|- :"):
                found[-1].rows.append((number, cells[0], cells[1].strip("`"), re.findall(r"`([^`]+)`", cells[2])))
        if not line.startswith("|"):
            columns = []
    return found


def faults(root):
    page = root / PAGE
    parts = sections(page.read_text())
    known = check_words.headings(page)
    cited_by_code, found = set(), []
    for path, text in files(root, TEXT):
        for number, line in enumerate(text.splitlines(), 1):
            for anchor in CITED.findall(line):
                if anchor not in known:
                    found.append(f"{path}:{number}: theory.md has no section #{anchor}")
                if path.suffix in CODE:
                    cited_by_code.add(anchor)
            if OTHER_DOCUMENT.search(line):
                found.append(f"{path}:{number}: names a section of a document that is not here")
    for s in parts:
        if s.bare:
            found.append(f"{PAGE}: #{s.anchor} has a formula without a number")
        if s.tags and s.anchor not in cited_by_code:
            found.append(f"{PAGE}: no code cites #{s.anchor}, which has equations")
        placed = {tag for _, first, _, _ in s.rows for tag in first.replace(",", " ").split()}
        for tag in s.tags:
            if tag not in placed:
                found.append(f"{PAGE}: the table of #{s.anchor} does not say where {tag} is computed")
        for number, _, file, names in s.rows:
            place = page.parent / file
            if not place.is_file():
                found.append(f"{PAGE}:{number}: there is no file {file}")
                continue
            if not names:
                found.append(f"{PAGE}:{number}: names no function in {file}")
            text = place.read_text()
            found += [f"{PAGE}:{number}: {file} has no {name}" for name in names if not is_in(text, name)]
    tags = [tag for s in parts for tag in s.tags]
    for number, line in check_words.outside_code(page.read_text()):
        found += [f"{PAGE}:{number}: there is no equation {tag}" for tag in EQUATION.findall(check_words.FORMULA.sub("", line))
                  if tag not in tags]
    found += [f"{PAGE}: two equations are called {tag}" for tag in sorted({t for t in tags if tags.count(t) > 1})]
    return found


class Theory(unittest.TestCase):
    def test_the_page_and_the_code_agree(self):
        self.assertEqual(faults(ROOT), [])

    def test_there_is_something_to_check(self):
        parts = sections((ROOT / PAGE).read_text())
        self.assertGreater(sum(len(s.tags) for s in parts), 60)
        self.assertGreater(sum(len(names) for s in parts for _, _, _, names in s.rows), 120)
        self.assertGreater(sum(len(CITED.findall(text)) for _, text in files(ROOT, CODE)), 30)


class Faults(unittest.TestCase):
    """A small project without faults, into which one is planted at a time."""
    GOOD = """# Theory

## Wake-up

The load is

$$
|P| > t \\tag{W1}
$$

| equation | file | function |
| --- | --- | --- |
| W1 | `laws/law.h` | `Law::tolerance`, `Law::Law`, `free_one` |
| W1 | `laws/law.cpp` | `Law::excess`, `rows_of` |

## Words

None.

| what | file | test |
| --- | --- | --- |
| W1 | `../tests/test_law.cpp` | `Law.wakes` |
| W1 | `../tests/test_law.py` | `test_law` |
"""
    HEADER = """// The law (theory.md#wake-up).
class Other;
class Law {
 public:
  Law(double a) : a_(a) {}
  double tolerance(double m) const { return a_ * least(m); }
  double excess(double load) const;
};
struct Next {
  void after() { tolerances(1); }
};
inline double free_one(double x) { return x; }
"""
    SOURCE = """#include "law.h"
double Law::excess(double load) const { return load / other(load); }
std::vector<int> rows_of(
    int n) { return {}; }
"""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = Path(folder.name)
        self.write("fix_solid_cull/theory.md", self.GOOD)
        self.write("fix_solid_cull/page.md", "See [it](theory.md#wake-up).\n")
        self.write("fix_solid_cull/laws/law.h", self.HEADER)
        self.write("fix_solid_cull/laws/law.cpp", self.SOURCE)
        self.write("tests/test_law.cpp", "TEST(Law, wakes) {}\n")
        self.write("tests/test_law.py", "class A:\n    def test_law(self):\n        pass\n")

    def write(self, path, text):
        file = self.root / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)

    def change(self, path, old, new):
        text = (self.root / path).read_text()
        self.assertIn(old, text)
        self.write(path, text.replace(old, new))

    def expect(self, *said):
        found = faults(self.root)
        self.assertEqual(len(found), len(said), found)
        for text, fault in zip(said, found):
            self.assertIn(text, fault)

    def test_none(self):
        self.expect()

    def test_a_section_that_is_cited_and_not_there(self):
        self.change("fix_solid_cull/laws/law.cpp", '#include "law.h"', "// theory.md#gone")
        self.expect("law.cpp:1: theory.md has no section #gone")

    def test_the_same_on_a_page_and_in_a_test(self):
        self.change("fix_solid_cull/page.md", "#wake-up", "#wakes")
        self.change("tests/test_law.cpp", "{}", "{}  // theory.md#wakes")
        self.expect("page.md:1", "test_law.cpp:1")

    def test_a_section_that_was_given_another_name(self):
        self.change("fix_solid_cull/theory.md", "## Wake-up", "## Waking")
        self.expect("law.h:1", "page.md:1", "no code cites #waking")

    def test_a_section_with_equations_that_only_a_page_cites(self):
        self.change("fix_solid_cull/laws/law.h", " (theory.md#wake-up)", "")
        self.expect("no code cites #wake-up")

    def test_a_file_that_has_gone(self):
        (self.root / "fix_solid_cull/laws/law.cpp").unlink()
        self.expect("theory.md:14: there is no file laws/law.cpp")

    def test_a_function_that_has_another_name(self):
        self.change("fix_solid_cull/laws/law.h", "double tolerance(", "double limit(")
        self.expect("theory.md:13: laws/law.h has no Law::tolerance")

    def test_a_function_of_another_class(self):
        self.change("fix_solid_cull/theory.md", "`Law::tolerance`", "`Law::after`")
        self.expect("laws/law.h has no Law::after")

    def test_a_class_that_is_only_named(self):
        self.change("fix_solid_cull/theory.md", "`Law::tolerance`", "`Other::tolerance`")
        self.expect("laws/law.h has no Other::tolerance")

    def test_a_function_that_is_only_called(self):
        self.change("fix_solid_cull/theory.md", "`Law::excess`", "`other`")
        self.expect("laws/law.cpp has no other")
        self.change("fix_solid_cull/theory.md", "`other`", "`rows_of`")
        self.change("fix_solid_cull/theory.md", "`free_one`", "`tolerances`")
        self.expect("laws/law.h has no tolerances")

    def test_a_function_that_a_comment_alone_names(self):
        self.change("fix_solid_cull/laws/law.cpp", "double Law::excess(", "// as Law::excess(x)\ndouble Law::more(")
        self.expect("laws/law.cpp has no Law::excess")

    def test_tests_that_have_gone(self):
        self.write("tests/test_law.cpp", "TEST(Law, sleeps) {}\n")
        self.write("tests/test_law.py", "test_law()\n")
        self.expect("has no Law.wakes", "has no test_law")

    def test_an_equation_without_a_place(self):
        self.change("fix_solid_cull/theory.md", "\\tag{W1}\n$$\n", "\\tag{W1}\n$$\n\n$$\nx = y \\tag{W2}\n$$\n")
        self.expect("does not say where W2 is computed")

    def test_a_formula_without_a_number_and_one_number_twice(self):
        self.change("fix_solid_cull/theory.md", "\\tag{W1}\n$$\n", "\\tag{W1}\n$$\n\n$$\nx = y\n$$\n\n$$\nx = y \\tag{W1}\n$$\n")
        self.expect("has a formula without a number", "two equations are called W1")

    def test_an_equation_that_is_named_and_not_there(self):
        self.change("fix_solid_cull/theory.md", "The load is", "As W1 and I1 say, and W3, the load is `X9`")
        self.expect("theory.md:5: there is no equation W3")

    def test_a_row_without_a_function(self):
        self.change("fix_solid_cull/theory.md", "`Law::excess`, `rows_of`", "in several places")
        self.expect("names no function in laws/law.cpp")

    def test_a_document_that_is_not_here(self):
        self.change("fix_solid_cull/laws/law.h", "// The law", "// The law (DESIGN section 8)")
        self.change("fix_solid_cull/page.md", "See", "The design's section 3. See")
        self.expect("law.h:1: names a section of a document", "page.md:1: names a section of a document")


if __name__ == "__main__":
    unittest.main()
