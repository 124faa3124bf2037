"""The pages for users: sentences of 25 words at most, a README of 90 lines at most, no dead links; and the counter itself."""
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "scripts"))
import check_words  # noqa: E402

TWENTY_FIVE = " ".join(["word"] * 24) + " end."
TWENTY_SIX = "One " + TWENTY_FIVE


class Pages(unittest.TestCase):
    def test_there_are_pages(self):
        names = {f.relative_to(ROOT).as_posix() for f in check_words.pages()}
        for name in ("README.md", "fix_solid_cull/fix_solid_cull.md", "region_interface_mesh/region_interface_mesh.md",
                     "benchmarks/README.md", "examples/impact/README.md", "validation/scale/README.md"):
            self.assertIn(name, names)

    def test_no_sentence_is_too_long_and_no_link_is_dead(self):
        for page in check_words.pages():
            with self.subTest(page=page.relative_to(ROOT).as_posix()):
                self.assertEqual([f"line {f.line}: {f.text}" for f in check_words.faults(page)], [])


class Counter(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def page(self, text, name="page.md"):
        file = self.folder / name
        file.write_text(text)
        return file

    def found(self, text, name="page.md"):
        return [(f.line, f.text.split(":")[0]) for f in check_words.faults(self.page(text, name), self.folder)]

    def counts(self, text):
        return [s.words for s in check_words.sentences(text)]

    def test_a_sentence_of_26_words_is_found_with_its_line(self):
        self.assertEqual(self.found(f"Short.\n\n{TWENTY_FIVE} {TWENTY_FIVE}\n"), [])
        self.assertEqual(self.found(f"Short.\n\n{TWENTY_FIVE} {TWENTY_SIX}\n"), [(3, "26 words, 25 at most")])
        self.assertEqual(check_words.main([str(self.page(TWENTY_SIX))]), 1)
        self.assertEqual(check_words.main([str(self.page(TWENTY_FIVE))]), 0)

    def test_a_sentence_goes_on_over_lines(self):
        self.assertEqual(self.found("One\n" + TWENTY_FIVE.replace("word word", "word\nword")), [(1, "26 words, 25 at most")])

    def test_stops_of_numbers_and_abbreviations_end_nothing(self):
        self.assertEqual(self.counts("It takes 2.5 s, e.g. here, see et al. there, and ... more. Next."), [12, 1])

    def test_what_has_no_letter_and_no_digit_is_no_word(self):
        self.assertEqual(self.counts("Less than 5 % - or 3 x 4."), [7])

    def test_a_code_span_is_one_word(self):
        self.assertEqual(self.counts("Put `fix cull all solid/cull. So | there` in."), [3])

    def test_each_list_item_stands_alone(self):
        self.assertEqual(self.counts("These hold:\n\n- one two\n- three\n  four five\n1. six\n"), [2, 2, 3, 1])
        self.assertEqual(self.found(f"- {TWENTY_SIX}\n"), [(1, "26 words, 25 at most")])
        self.assertEqual(self.found(f"- one\n\n    {TWENTY_SIX}\n"), [(3, "26 words, 25 at most")])

    def test_each_table_cell_stands_alone(self):
        self.assertEqual(self.counts("| a b | `c | d` |\n| --- | --: |\n| e f g. H | |\n"), [2, 1, 3, 1])
        self.assertEqual(self.found(f"| a | b |\n| --- | --- |\n| c | {TWENTY_SIX} |\n"), [(3, "26 words, 25 at most")])

    def test_headings_and_captions_stand_alone(self):
        self.assertEqual(self.counts("# One two\nThree.\n\n![Four five six](a.png)\n"), [2, 1, 3])

    def test_code_blocks_do_not_count(self):
        self.assertEqual(self.counts(f"One:\n\n    {TWENTY_SIX}\n\n```\n{TWENTY_SIX}\n```\n\nTwo.\n"), [1, 1])

    def test_the_address_of_a_link_does_not_count(self):
        self.assertEqual(self.counts("See [this page](https://example.org/a/b) now."), [4])

    def test_dead_links_and_pictures_are_found(self):
        self.page("# A heading: of `two`\n", "there.md")
        self.assertEqual(self.found("[a](there.md) [b](there.md#a-heading-of-two) [c](https://example.org) [d](.)\n"), [])
        self.assertEqual(self.found("One.\n[a](gone.md)\n![b](gone.png)\n[c](there.md#no-such)\n[d](#nor-this)\n"),
                         [(2, "leads nowhere"), (3, "leads nowhere"), (4, "no such heading"), (5, "no such heading")])
        self.assertEqual(self.found("`[a](gone.md)`\n\n    [b](gone.md)\n"), [])

    def test_a_readme_of_more_than_90_lines_is_found(self):
        self.assertEqual(self.found("Line.\n" * 90, "README.md"), [])
        self.assertEqual(self.found("Line.\n" * 91, "README.md"), [(91, "91 lines, 90 at most")])
        self.assertEqual(self.found("Line.\n" * 91, "other.md"), [])


if __name__ == "__main__":
    unittest.main()
