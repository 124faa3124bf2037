"""scripts/measure_house.py finds what several owners write, and nothing of that in this project; the picture of the house is true."""
import subprocess
import sys
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "scripts"))
sys.dont_write_bytecode = True
import draw_architecture  # noqa: E402
import measure_house  # noqa: E402
from shared_state import House  # noqa: E402

STATE = """
struct Row { int count = 0; double load = 0; bool near : 1; };
using Rows = FlatMap<Row>;
"""
FIRST = "class First {\n public:\n  void work(int);\n  explicit First(Rows& rows) : rows_(rows) {}\n private:\n  Rows& rows_;\n};\n"


def written_by(**sources):
    """struct -> its writers, in a house of these files (`_h` and `_cpp` for the suffix) and the two above."""
    files = {Path(name.replace("_", ".")): text for name, text in {"state_h": STATE, "first_h": FIRST, **sources}.items()}
    files = {path: measure_house.without_comments(text) for path, text in files.items()}
    house = House(files, list(files), measure_house.classes, measure_house.functions_of)
    return {struct: sorted({w.owner for w in writes}) for struct, writes in house.shared()}, house.unknown


class SharedState(unittest.TestCase):
    first = "void First::work(int k) {\n  rows_[k].count = 1;\n}\n"

    def test_this_project(self):
        done = subprocess.run([sys.executable, ROOT / "scripts/measure_house.py"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stdout[-3000:] + done.stderr)

    def test_the_picture_shows_classes_that_are_there(self):
        for folder, _, _, rows in draw_architecture.FLOORS:
            headers = "".join(f.read_text() for f in (ROOT / "fix_solid_cull" / folder).rglob("*.h"))
            for name in (name for row in rows for name in row):
                with self.subTest(name):
                    self.assertRegex(headers, rf"\b(class|struct) {name}\b[^;]*\{{")

    def test_one_owner(self):
        self.assertEqual(written_by(first_cpp=self.first), ({}, []))

    def test_written_through_a_parameter(self):
        for write in ("rows[k].load += 2;", "++rows[k].count;", "rows[k] = {1, 2};", "rows.erase(k);", "rows = Rows();",
                      "auto& r = rows[k];\n  r.near = true;", "Row* r = rows.find(k);\n  r->count = 3;",
                      "if (Row* r = rows.find(k)) r->count--;", "for (Row& r : rows) r.load = 0;",
                      "rows.for_each([&](int, Row& r) { r.load = 0; });"):
            with self.subTest(write):
                second = f"void second(Rows& rows, int k) {{\n  {write}\n}}\n"
                self.assertEqual(written_by(first_cpp=self.first, second_cpp=second), ({"Row": ["first", "second"]}, []))

    def test_read_or_copied(self):
        for use in ("const Row& r = rows[k];\n  const double twice = 2 * r.load;", "Row r = rows[k];\n  r.load = 1;", "Row r;\n  r.count = 1;",
                    "auto r = rows[k];\n  r.count = 1;", "std::vector<Row> all;\n  all.push_back({});\n  all[0].load = 1;",
                    "if (rows[k].count == 1) return;"):
            with self.subTest(use):
                second = f"void second(const Rows& rows, int k) {{\n  {use}\n}}\n"
                self.assertEqual(written_by(first_cpp=self.first, second_cpp=second), ({}, []))

    def test_each_class_has_rows_of_its_own(self):
        own = "class {0} {{\n public:\n  void work(int);\n private:\n  Rows rows_;\n}};\n"
        work = "void {0}::work(int k) {{\n  rows_[k].count = 1;\n}}\n"
        files = {}
        for name in ("Third", "Fourth"):
            files |= {f"{name.lower()}_h": own.format(name), f"{name.lower()}_cpp": work.format(name)}
        self.assertEqual(written_by(**files), ({}, []))
        self.assertEqual(written_by(first_cpp=self.first, **files)[0], {"Row": ["first", "fourth", "third"]})

    def test_several_files_of_one_class_are_one_owner(self):
        self.assertEqual(written_by(first_cpp=self.first, firstlook_cpp="void First::look() {\n  rows_[1].load = 1;\n}\n"), ({}, []))

    def test_through_a_struct_of_parts(self):
        parts = "struct Parts { Rows& rows; int others = 0; };\n"
        second = "void second(const Parts& p) {\n  p.rows.clear();\n}\n"
        # a reference in a const struct leads to what is not const
        third = "void third(Parts& p) {\n  p.rows[1].count = 2;\n}\n"
        self.assertEqual(written_by(parts_h=parts, first_cpp=self.first, third_cpp=third)[0], {"Row": ["first", "third"]})
        self.assertEqual(written_by(parts_h=parts, first_cpp=self.first, second_cpp=second)[0], {"Row": ["first", "second"]})


if __name__ == "__main__":
    unittest.main()
