"""Each fix and compute style of LIGGGHTS has its treatment beside solid/cull, and the page of styles says the same as the
code. The page names each style of every other kind too."""
import re
import shutil
import subprocess
import sys
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT))
from solidcull_runs import engine  # noqa: E402

CODE = ROOT / "fix_solid_cull" / "liggghts"
PAGE = ROOT / "fix_solid_cull" / "other_styles.md"
HELPERS = {"MINIMIZE", "READ_RESTART", "RESPA", "STORE"}  # LIGGGHTS's own: no line of a deck names them
# rows of the page's tables begin with these words; in the code they are called so
FIX_ROWS = {"exact": "exact", "move granules": "integrates", "measure": "atoms_only", "hold": "holds", "act on each": "drives",
            "refused": "refused"}
COMPUTE_ROWS = {"exact": "exact", "see atoms only": "atoms_only", "miss contacts": "contacts", "hold": "whole", "refused": "refused"}
COMMAND_ROWS = {"nothing": "nothing", "begin": "run", "keep": "state", "see the whole": "whole_bed", "restore all": "all_restored"}
# kinds of `liggghts -h` that the code has no table of, and the page's heading
OTHER_KINDS = {"Atom styles:": "Atom styles", "Integrate styles:": "Integrate styles", "Pair styles:": "Pair styles",
               "Normal models for pair gran:": "Pair styles", "Tangential models for pair gran:": "Pair styles",
               "Cohesion models for pair gran:": "Pair styles", "Rolling models for pair gran:": "Pair styles",
               "Surface models for pair gran:": "Pair styles", "Region styles:": "Region styles", "Dump styles:": "Dump styles"}


def table_in(file):
    return dict(re.findall(r'{"([^"]+)", (\w+), ', (CODE / file).read_text()))


def fixes_in_code():
    return table_in("fix_styles.cpp")


def computes_in_code():
    return table_in("compute_styles.cpp")


def commands_in_code():
    return dict(re.findall(r'{"([^"]+)", (\w+)}', (CODE / "command_styles.cpp").read_text()))


def section(heading):
    return PAGE.read_text().split(f"## {heading}\n")[1].split("\n## ")[0]


def in_page(heading, rows):
    treatments = {}
    first = section(heading).split("| beside")[1].split("\n\n")[0]
    for row in re.findall(r"^\| (?!---)([^|]+) \| ([^|]+) \|(?: [^|]*\|)?$", first.split("\n", 1)[1], re.M):
        (treatment,) = [t for begin, t in rows.items() if row[0].startswith(begin)]
        treatments.update({name: treatment for name in re.findall(r"`([^`]+)`", row[1])})
    return treatments


def styles_of_liggghts(kind):
    """As `liggghts -h` lists them, between two lines with a star."""
    told = subprocess.run(["liggghts", "-h"], text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False,
                          env=engine.environment()).stdout
    if "* " + kind not in told:
        raise AssertionError(f"liggghts -h lists no {kind} It said:\n{told[:2000]}")
    return set(told.split("* " + kind)[1].split("\n*")[0].split())


def named(name, style):
    return style.startswith(name[:-1]) if name.endswith("*") else style == name


class Styles(unittest.TestCase):
    def test_the_page_says_of_each_style_what_a_formula_between_runs_has(self):
        for heading in ("Fix styles", "Compute styles"):
            table = section(heading).split("| beside")[1].split("\n\n")[0].splitlines()[2:]
            said = {row.split("|")[1].split()[0].rstrip(":;,"): row.split("|")[3].strip() for row in table}
            self.assertEqual([begin for begin, value in said.items() if not value], ["refused"], heading)

    def test_the_page_says_what_the_code_does(self):
        self.assertEqual(in_page("Fix styles", FIX_ROWS), {n: t for n, t in fixes_in_code().items() if n not in HELPERS})
        self.assertEqual(in_page("Compute styles", COMPUTE_ROWS), computes_in_code())
        self.assertEqual(in_page("Command styles", COMMAND_ROWS), {n: t for n, t in commands_in_code().items() if n})

    @unittest.skipUnless(shutil.which("liggghts"), "no liggghts")
    def test_every_style_of_liggghts_is_in_its_table_once(self):
        for kind, table, least in (("Fix styles", fixes_in_code(), 90), ("Compute styles:", computes_in_code(), 43),
                                   ("Command styles", commands_in_code(), 15)):
            styles = styles_of_liggghts(kind)
            self.assertGreater(len(styles), least)
            for style in styles:
                with self.subTest(kind=kind, style=style):
                    self.assertEqual(len([name for name in table if named(name, style)]), 1)

    @unittest.skipUnless(shutil.which("liggghts"), "no liggghts")
    def test_the_page_names_every_other_style_of_liggghts(self):
        for kind, heading in OTHER_KINDS.items():
            names = re.findall(r"`([^`]+)`", section(heading))
            for style in styles_of_liggghts(kind):
                with self.subTest(kind=kind, style=style):
                    self.assertTrue(any(named(name, style) for name in names))


if __name__ == "__main__":
    unittest.main()
