"""Each fix style of LIGGGHTS has its treatment beside solid/cull, and the command page says the same as the code."""
import re
import shutil
import subprocess
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
CODE = ROOT / "fix_solid_cull" / "liggghts" / "fix_styles.cpp"
PAGE = ROOT / "fix_solid_cull" / "fix_solid_cull.md"
HELPERS = {"MINIMIZE", "READ_RESTART", "RESPA", "STORE"}  # LIGGGHTS's own: no line of a deck names them
ROWS = {"exact": "exact", "integrates": "move granules", "atoms_only": "measure", "holds": "hold", "drives": "act on each",
        "refused": "refused"}


def in_code():
    return dict(re.findall(r'{"([^"]+)", (\w+), ', CODE.read_text()))


def in_page():
    text = PAGE.read_text().split("### Other fixes")[1].split("###")[0]
    treatments = {}
    for row in re.findall(r"^\| (?!beside|---)([^|]+) \| ([^|]+) \|$", text, re.M):
        (treatment,) = [t for t, begin in ROWS.items() if row[0].startswith(begin)]
        treatments.update({name: treatment for name in re.findall(r"`([^`]+)`", row[1])})
    return treatments


def styles_of_liggghts():
    told = subprocess.run(["liggghts", "-h"], text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False).stdout
    return set(told.split("* Fix styles")[1].split("* Compute styles")[0].split())


def named(name, style):
    return style.startswith(name[:-1]) if name.endswith("*") else style == name


class FixStyles(unittest.TestCase):
    def test_the_page_says_what_the_code_does(self):
        self.assertEqual(in_page(), {name: t for name, t in in_code().items() if name not in HELPERS})

    @unittest.skipUnless(shutil.which("liggghts"), "no liggghts")
    def test_every_style_of_liggghts_is_in_the_table_once(self):
        styles = styles_of_liggghts()
        self.assertGreater(len(styles), 90)
        for style in styles:
            with self.subTest(style=style):
                self.assertEqual(len([name for name in in_code() if named(name, style)]), 1)


if __name__ == "__main__":
    unittest.main()
