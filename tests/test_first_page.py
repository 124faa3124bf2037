"""Every number of README.md is one of a results file, or stands in a short list of what is no result. Pages and plot are made of
those files, and faults that are planted are found.
"""
import contextlib
import json
import math
import os
import re
import shutil
import statistics
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.dont_write_bytecode = True
sys.path[:0] = [str(ROOT), str(ROOT / "validation" / "scale")]
import published  # noqa: E402
import scale  # noqa: E402
import tools  # noqa: E402
from solidcull_runs.validation import case_results, case_runs, first_page, kept_figures, pages, report  # noqa: E402
from solidcull_runs.errors import RunError  # noqa: E402

README = (ROOT / "README.md").read_text()
NUMBER = re.compile(r"\d+(?:[.,/]\d+)*|\b(?:two|three|four|five|six|seven|eight|nine|ten|eleven|twelve|twenty|hundred|thousand|million|half|third|"
                    r"quarter|fifth|tenth|twice|thrice)\b", re.I)
NO_RESULT = {  # text of README.md, and why its numbers are no results
    r"LIGGGHTS 3\.8\.0, as Debian 12 ships it": "versions",
    r"On Debian 12,": "a version",
    r"cut open at four moments, and the": "what the picture shows",
    r"cut open at four moments\.": "what the picture shows",
    r"Try it: two commands": "the two below",
    r"five runs with and five without the line": "what the command does",
    r"100% tests passed": "what ctest prints",
    r"three times without the line and once with it": "what the command does",
    r"\| 0\.2\.0, see CHANGELOG": "a version",
    r"GPL-2\.0-or-later": "a name",
}
WORDS = "zero one two three four five six seven eight nine ten eleven twelve".split()
LITTLE, SMALL = 5, 1.5  # granules over movers from which on, and times faster above which, README.md speaks of a gain


# --- what the results files say, written as README.md writes it -------------------------------------------------------

def count(value):
    return format(value, ",")


def tens(value):
    """Two figures of what is below ten, whole numbers above."""
    text = f"{value:.1f}"
    return text if len(text) < 4 else f"{value:.0f}"


class Results:
    """The results files that README.md rests on."""

    def __init__(self, root=ROOT):
        self.cases = json.loads((root / "validation" / "results.json").read_text())
        self.scale = json.loads((root / "validation" / "scale" / "results.json").read_text())
        self.no_harm = (root / "validation" / "no_harm" / "RESULTS.md").read_text()

    def case(self, name, mode="sleep", scene=None):
        found, = (r for r in self.cases if (r["case"], r["mode"]) == (name, mode) and (r["main"] if scene is None else r["scene"] == scene))
        return found

    def off(self, case, figure, scene=None, key="percent"):
        found, = (f for f in self.case(case, scene=scene)["off"] if f["figure"] == figure)
        if key == "percent" and "pairs" in found and found["verdict"] == "equivalent":  # equal within so much
            return tens(max(abs(found["low"]), abs(found["high"])))
        return tens(found[key])

    def of(self, what, granules, tool=None):
        found, = (r for r in self.scale if (r["what"], r["granules"], r.get("tool")) == (what, granules, tool))
        return found

    def strike_off(self, figure):
        found, = (f for f in self.of("strike", 1280000)["off"] if f["figure"] == figure)
        return tens(found["percent"])

    def tool_gain(self, tool, granules=160000):
        r = self.of("tool", granules, tool)
        return r["unculled_s"] / r["culled_s"]

    def gains(self):
        """Granules over those that move, and how much faster, of all scenes where both were measured."""
        found = [(r["moving"], r["faster"]) for r in self.cases if r["mode"] == "sleep" and r["main"]]
        return found + [(r["granules"] / r["movers"], r["unculled_s"] / r["culled_s"]) for r in self.scale if r["what"] == "tool"]

    def harms(self):
        """Scenes, and least and largest median, of no_harm's table."""
        rows = [line.strip(" |").split("|") for line in self.no_harm.splitlines() if re.match(r"\| `\w+` \|", line)]
        medians = [re.match(r"\s*([\d.]+)", cell)[1] for row in rows for cell in row[1:]]
        return WORDS[len(rows)], min(medians, key=float), max(medians, key=float)


def of_row(case, *figures):
    """Numbers of a case's row: granules, seconds, how much faster, and what the figures are off."""
    def numbers(r):
        main = r.case(case)
        return [count(main["granules"]), count(round(main["unculled_s"])), tens(main["faster"]), *(figure(r) for figure in figures)]
    return numbers


def share(r):
    return [f"1/{statistics.median(n / gain for n, gain in r.gains() if n >= LITTLE):.0f}", str(LITTLE)]


def spread(r):
    many, few = ([g for g in r.gains() if (g[0] >= LITTLE) == wanted] for wanted in (True, False))
    over = [n / gain for n, gain in many]
    return [f"1/{math.ceil(max(over))}", f"1/{math.floor(min(over))}", str(len(many)), str(LITTLE), str(len(few)),
            str(sum(gain < SMALL for _, gain in few)), str(SMALL)]


def pour(r):
    bed = r.of("tool", 160000, "pour")
    dragged = [r.tool_gain(tool) for tool in ("blade", "block", "wheel")]
    return [str(tools.TOOLS["pour"][0]["poured"]), count(bed["granules"]), tens(bed["granules"] / bed["movers"]), tens(r.tool_gain("pour")),
            tens(min(dragged)), tens(max(dragged))]


def movers(r):
    where = {case_results.MOVED, tools.MOVED / tools.DIAMETER}
    assert len({round(w, 9) for w in where}) == 1, where
    return [f"1/{1 / case_results.MOVED:.0f}", str(case_runs.FRAMES)]


def blade(r):
    depths = [c["scene"] for c in r.cases if (c["case"], c["mode"]) == ("blade_drag", "sleep")]
    lifts = [number for depth in depths[1:] for number in (depth.split()[0], r.off("blade_drag", "lift", depth))]
    return [depths[0].split()[0], *of_row("blade_drag")(r), r.off("blade_drag", "plunge work"), *lifts, r.off("blade_drag", "plunge work", key="scatter")]


def strike(r):
    record = r.of("strike", 1280000)
    return [count(record["granules"]), count(round(record["unculled_s"])), tens(record["unculled_s"] / record["culled_s"]),
            *map(r.strike_off, ("floor load, largest rise", "crater volume", "heap volume"))]


RULES = {  # text of README.md whose groups are numbers; what they are
    r"strikes a bed of ([\d,]+) granules": lambda r: [count(r.case("impact")["granules"] - 1)],  # the ball is one of them
    r"about (1/\d+) of that; below (\d+) it is mostly small": share,
    r"A silo empties: ([\d.]+)\. It gained ([\d.]+) times": lambda r: [tens(r.case("silo")[k]) for k in ("moving", "faster")],
    r"A heap is fed on its top: ([\d.]+)\. It gained ([\d.]+) times": lambda r: [tens(r.case("fed_heap")[k]) for k in ("moving", "faster")],
    r"(\d+) granules are poured on a bed of ([\d,]+): (\d+)\. It gained ([\d.]+) times\. A blade, a block and a wheel in that bed gained "
    r"([\d.]+) to ([\d.]+) times": pour,
    r"gains were (1/\d+) to (1/\d+) of that number, in (\d+) scenes where it was (\d+) or more\. Of (\d+) others, (\d+) gained less than "
    r"([\d.]+) times": spread,
    r"more than (1/\d+) of a diameter in some (\d+) steps": movers,
    r"(\w+) such scenes ran ([\d.]+) to ([\d.]+) times as fast": lambda r: r.harms(),
    r"gravity switched off and on had ([\d.]+) with `exterior live`, a tilted box ([\d.]+)":
        lambda r: [f"{r.case('gravity_switch', 'live')['faster']:.2f}", f"{r.case('tilt')['faster']:.2f}"],
    r"\| heap, fed on its top \| ([\d,]+) \| ([\d,]+) s \| ([\d.]+) \| height at the centre (?:equal within )?([\d.]+) % \| ([\d.]+) % \|":
        of_row("fed_heap", lambda r: r.off("fed_heap", "height at the centre"), lambda r: r.off("fed_heap", "height at the centre", key="scatter")),
    r"\| large ball goes into a bed \| ([\d,]+) \| ([\d,]+) s \| ([\d.]+) \| depth (?:equal within )?([\d.]+) % \| ([\d.]+) % \|":
        of_row("penetration", lambda r: r.off("penetration", "depth"), lambda r: r.off("penetration", "depth", key="scatter")),
    r"\| impact in a large bed \| ([\d,]+) \| ([\d,]+) s \| ([\d.]+) \| \*\*floor load, largest rise ([\d.]+) %; crater volume ([\d.]+) %; heap volume "
    r"([\d.]+) %\*\* \| not known \|":
        strike,
    r"\| blade dragged through a bed, (\d+) mm \| ([\d,]+) \| ([\d,]+) s \| ([\d.]+) \| \*\*plunge work (?:differs by )?([\d.]+) %; (\d+) mm: lift (?:differs by )?([\d.]+) %; "
    r"(\d+) mm: lift (?:differs by )?([\d.]+) %\*\* \| ([\d.]+) % \|":
        blade,
    r"\| silo that empties, slit of (\d+) mm \| ([\d,]+) \| ([\d,]+) s \| ([\d.]+): no gain \| mass flow (?:equal within )?([\d.]+) % \| ([\d.]+) % \|":
        lambda r: [r.case("silo")["scene"].split()[2], *of_row("silo")(r), r.off("silo", "mass flow"), r.off("silo", "mass flow", key="scatter")],
    r"All (\d+) cases": lambda r: [str(len({c["case"] for c in r.cases}))],
    r"sends ([\d.]+) % too much to the floor": lambda r: [r.off("point_load", "floor's centre")],
}


# --- the comparison ---------------------------------------------------------------------------------------------------

def flat(text):
    """A page as it is read: links by their words, one line a paragraph or row."""
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", re.sub(r"<!--.*?-->\n", "", text))
    return re.sub(r"(?<=\S)\n *(?=[^\s|#-])", " ", text)


def compared(text, results):
    """Places of the numbers that are right, and lines about what is wrong."""
    right, wrong = [], []
    for pattern, numbers in RULES.items():
        found = list(re.finditer(pattern, text))
        if len(found) != 1:
            wrong.append(f"{len(found)} places have the words of the rule '{pattern}'")
            continue
        due = numbers(results)
        if len(due) != found[0].re.groups:
            wrong.append(f"{len(due)} numbers for the rule '{pattern}'")
        for k, value in enumerate(due, 1):
            right.append(found[0].span(k))
            if found[0][k].lower() != value.lower():
                wrong.append(f"'{found[0][0]}': {found[0][k]} is {value} in the results")
    for pattern in NO_RESULT:
        found = re.search(pattern, text)
        if found:
            right.append(found.span())
        else:
            wrong.append(f"nothing is '{pattern}': no result that is not there")
    return right, wrong


def faults(text, results):
    """What README.md has that the results do not say."""
    text = flat(text)
    right, wrong = compared(text, results)
    for m in NUMBER.finditer(text):
        if not any(begin <= m.start() and m.end() <= end for begin, end in right):
            wrong.append(f"no rule has the number '{m[0]}' of '{text[max(0, m.start() - 40):m.end() + 20]}'")
    return wrong


class FirstPage(unittest.TestCase):
    def setUp(self):
        self.results = Results()

    def test_each_number_is_one_of_the_results(self):
        self.assertEqual(faults(README, self.results), [])

    def test_words_that_a_newcomer_does_not_have(self):
        self.assertEqual(re.findall(r"margin|decided|unculled", README), [])

    def test_what_is_too_far_off_is_told(self):
        """A row in bold names all that is beyond what its page allows, and no row that is not has such a figure."""
        rows = {re.match(r"\| \[([^\]]+)", line)[1]: line for line in README.splitlines() if line.startswith("| [") and line.count("|") == 7}
        self.assertEqual(len(rows), 5)
        self.assertEqual({name for name, row in rows.items() if "**" in row}, {"impact in a large bed", "blade dragged through a bed"})
        beyond = {name: sum(map(first_page.is_beyond, (f for r in self.results.cases if (r["case"], r["mode"]) == (name, "sleep") for f in r["off"])))
                  for name in ("fed_heap", "penetration", "blade_drag", "silo")}
        self.assertEqual(beyond, {"fed_heap": 0, "penetration": 0, "blade_drag": 3, "silo": 0})
        self.assertEqual(sum(f["percent"] > f["allowed"] for f in self.results.of("strike", 1280000)["off"]), 3)

    def test_the_rows_are_those_of_the_results_files(self):
        self.assertEqual(first_page.readme(ROOT, self.results.cases, self.results.scale), README)


class PlantedFaults(unittest.TestCase):
    """The comparison finds what is wrong."""

    def setUp(self):
        self.results = Results()

    @staticmethod
    def other(number):
        """Another number of the same look."""
        if number.lower() in WORDS:
            return WORDS[(WORDS.index(number.lower()) + 1) % len(WORDS)]
        return number[:-1] + str((int(number[-1]) + 1) % 10)

    def test_each_number_that_is_changed_is_found(self):
        text, changed = flat(README), 0
        for m in list(NUMBER.finditer(text)):
            planted = text[:m.start()] + self.other(m[0]) + text[m.end():]
            with self.subTest(number=m[0], at=text[max(0, m.start() - 30):m.end() + 10]):
                self.assertNotEqual(faults(planted, self.results), [])
            changed += 1
        self.assertGreater(changed, 60)

    def test_a_new_number_is_found(self):
        for sentence in ("It is 99 times faster.", "It gains a tenth.", "Twelve of them moved.", "It costs 0.5 % more."):
            found = faults(README + f"\n{sentence}\n", self.results)
            self.assertEqual(len(found), 1, sentence)
            self.assertIn("no rule has the number", found[0])

    def test_a_sentence_that_goes_is_found(self):
        self.assertIn("0 places have the words of the rule", faults(README.replace("A silo empties: ", "It empties: "), self.results)[0])
        self.assertIn("nothing is", "\n".join(faults(README.replace("Debian 12", "Debian"), self.results)))

    def test_results_that_change_are_found(self):
        """Each figure that README.md shows, changed in the results."""
        def of_case(name, key, mode="sleep"):
            return lambda r: r.case(name, mode).__setitem__(key, 1.37 * r.case(name, mode)[key])

        def of_scale(key, *which):
            return lambda r: r.of(*which).__setitem__(key, 1.37 * r.of(*which)[key])

        def off(record, k, key):
            record["off"][k][key] = 1.37 * record["off"][k][key] + 0.1
        changes = [of_case(name, key) for name in ("fed_heap", "penetration", "blade_drag", "silo") for key in ("faster", "unculled_s")]
        changes += [of_case("tilt", "faster"), of_case("gravity_switch", "faster", "live"), of_case("silo", "moving"), of_case("fed_heap", "moving")]
        changes += [of_scale("unculled_s", "strike", 1280000), of_scale("culled_s", "strike", 1280000), of_scale("movers", "tool", 160000, "pour"),
                    of_scale("culled_s", "tool", 160000, "block"), of_scale("culled_s", "tool", 160000, "pour")]
        changes += [lambda r, k=k: off(r.of("strike", 1280000), k, "percent") for k in (3, 6, 7)]
        changes += [lambda r, name=name, key=key: off(r.case(name), 0, key) for name in ("fed_heap", "penetration", "blade_drag", "silo")
                    for key in ("percent", "scatter")]
        changes += [lambda r, scene=scene: off(r.case("blade_drag", scene=scene), 0, "percent") for scene in ("25 mm", "50 mm")]
        changes.append(lambda r: setattr(r, "no_harm", r.no_harm.replace("0.988", "0.888")))
        changes.append(lambda r: setattr(r, "no_harm", r.no_harm + "| `new` | 1.0 | 1.0 | 1.0 | 1.0 | 1.0 | 1.0 |\n"))
        for k, change in enumerate(changes):
            with self.subTest(change=k):
                results = Results()
                change(results)
                self.assertNotEqual(faults(README, results), [])


class Pages(unittest.TestCase):
    """What else is made of the results files."""

    def setUp(self):
        self.results = Results()
        self.folder = Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, self.folder)

    def test_tables_of_scale(self):
        file = ROOT / "validation" / "scale" / "RESULTS.md"
        self.assertEqual(published.page_text(file, self.results.scale), file.read_text())

    def test_first_tables_of_the_cases(self):
        text = (ROOT / "validation" / "RESULTS.md").read_text()
        titles = {case: next(h for h in re.findall(r"^## (.*)$", text, re.M) if pages.anchor(h) == anchor)
                  for case, anchor in re.findall(r"^\| \[(\w+)\]\(#([^)]*)\)", text, re.M)}
        self.assertEqual(len(titles), 20)
        for head, rows in ((report.OVERVIEW, report.overview_rows(self.results.cases, titles)), (report.OUTSIDE, report.outside_rows(self.results.cases, titles))):
            page = pages.Page()
            page.table(head, rows)
            self.assertIn("\n\n" + page.markdown() + "\n", text)

    def test_figures_of_the_main_scenes(self):
        """Each case's own table in RESULTS.md says what results.json does: how far a figure is off, and its verdict."""
        text, compared_figures = (ROOT / "validation" / "RESULTS.md").read_text(), 0
        sections = dict(re.findall(r"^## (.*?)\n(.*?)(?=^## |\Z)", text, re.M | re.S))
        anchors = dict(re.findall(r"^\| \[(\w+)\]\(#([^)]*)\)", text, re.M))
        by_anchor = {pages.anchor(title): body for title, body in sections.items()}
        for r in (r for r in self.results.cases if r["main"]):
            rows = {re.sub(r" \([^()]*\)$", "", cells[0]): cells for cells in (
                line.strip("| ").split(" | ") for line in by_anchor[anchors[r["case"]]].splitlines()) if len(cells) == 10 and re.search(r"\d to ", cells[2])}
            self.assertEqual(set(rows), {f["figure"] for f in r["off"]})
            column = 4 if r["mode"] == "sleep" else 7
            for f in r["off"]:
                cells = rows[f["figure"]]
                mean, culled = float(cells[1]), float(cells[column])
                with self.subTest(case=r["case"], mode=r["mode"], figure=f["figure"]):
                    self.assertEqual(f["verdict"], cells[column + 2])
                    self.assertAlmostEqual(f["percent"], 100 * abs(culled - mean) / abs(mean), delta=0.12)  # the page has four figures
                compared_figures += 1
        self.assertGreater(compared_figures, 150)

    def test_the_plot(self):
        from PIL import Image

        def mark_of(file):
            with Image.open(file) as picture:
                return picture.info["Description"]
        shown = mark_of(ROOT / first_page.PLOT)
        self.assertEqual(shown, first_page.mark_of(self.results.scale), "the plot is of other figures: validation/scale/published.py")
        self.assertIn(f"]({first_page.PLOT})", README)
        file = self.folder / "times.png"
        texts = [t.get_text() for t in first_page.draw(self.results.scale, file).findobj(lambda a: hasattr(a, "get_text"))]
        for record in (self.results.of("strike", n) for n in (20000, 160000, 1280000)):
            for key in ("unculled_s", "culled_s"):
                value = record[key]
                self.assertIn(f"{tens(value) if value < 10 else count(round(value))} s", texts)
            self.assertIn(f"{tens(record['unculled_s'] / record['culled_s'])} times", texts)
        largest = self.results.of("asleep", 10240000)
        self.assertIn(f"{largest['loop_s']:.0f} s", texts)
        self.assertTrue(any(f"{largest['program_s']:.0f} s with reading it" in t for t in texts), texts)
        self.assertEqual(mark_of(file), shown)
        largest["loop_s"] *= 2
        self.assertNotEqual(first_page.mark_of(self.results.scale), shown)


class Publishing(unittest.TestCase):
    """Figures of scale.py and tools.py go from their reports into results file, pages and plot."""

    def setUp(self):
        self.root = Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, self.root)
        for name in ("README.md", first_page.CASES, first_page.SCALE, "validation/scale/RESULTS.md"):
            (self.root / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, self.root / name)

    @staticmethod
    def run_of(kind, seconds, depth, granules=1280001, others_busy=0.0):
        run = {"name": f"impact-1.28M-{kind}-1", "stale": False, "loop_time": seconds, "wall": seconds + 10, "cpu": seconds + 10, "others_busy": others_busy,
               "memory": [[1, 1, 1]], "peak_mb": 2048, "steps": 8000, "granules": granules, "ids": "", "metrics": {"depth, end (m)": depth}}
        return run if kind == "unculled" else {**run, "exterior": 12800.0, "interface": 1.0, "interior": 1.0, "seconds": 4.0, "parts": {}, "said": []}

    def report(self, unculled=(1.0,), culled=(1.03,)):
        runs = {"unculled": [self.run_of("unculled", 5000.0, d, others_busy=0.9) for d in unculled], "culled": [self.run_of("culled", 50.0, d) for d in culled]}
        return {"1.28M": {"kinds": {kind: scale.summary(of) for kind, of in runs.items()}, "against": {"culled": scale.compared(runs, "culled")}}}

    def test_records_of_strikes(self):
        record, = published.strike_records(self.report())
        self.assertEqual(record, {"what": "strike", "granules": 1280000, "pairs": 1, "unculled_s": 5000.0, "culled_s": 50.0, "over_exterior": 100.0,
                                  "beside_others": ["unculled"], "off": [{"figure": "depth, end", "percent": 3.0, "allowed": 2.0, "scatter": None}]})
        record, = published.strike_records(self.report((1.0, 1.04), (1.05, 1.03)))
        self.assertEqual(record["off"], [{"figure": "depth, end", "percent": 1.96, "allowed": 3.92, "scatter": 3.92}])
        report = self.report()
        del report["1.28M"]["kinds"]["unculled"]
        self.assertEqual(published.strike_records(report), [])

    def test_records_of_beds_struck_asleep(self):
        asleep = scale.summary([self.run_of("asleep", seconds, 1.0, 10240001) for seconds in (40.0, 44.0, 41.0)])
        record, = published.asleep_records({"10.24M": {"kinds": {"asleep": asleep}, "against": {}}})
        self.assertEqual(record, {"what": "asleep", "granules": 10240000, "runs": 3, "loop_s": 41.0, "exterior": 12800, "in_fix_s": 4.0, "program_s": 51.0,
                                  "peak_gib": 2.0})

    def test_records_of_tools(self):
        def run(seconds, **more):
            return {"name": "x", "stale": False, "loop_time": seconds, "wall": 1, "cpu": 1, "granules": 160000, "steps": 1000, "ids": "", "metrics": {}, **more}
        of = tools.compared([run(300.0, movers=1000.4)], [run(20.0, exterior=3000.0, interface=1000.0, interior=1, restored=32000.0)])
        record, = published.tool_records({("160k", "blade"): {"bed": 160000, **of}})
        self.assertEqual(record, {"what": "tool", "tool": "blade", "granules": 160000, "pairs": 1, "unculled_s": 300.0, "culled_s": 20.0, "movers": 1000,
                                  "exterior": 3000, "interface": 1000, "restored": 2.0})

    def test_all_that_is_made_of_them_follows(self):
        old = kept_figures.read(self.root / first_page.SCALE)
        published.publish(published.strike_records(self.report()), self.root)
        new = kept_figures.read(self.root / first_page.SCALE)
        self.assertEqual([r for r in old if r not in new], [r for r in old if (r["what"], r["granules"]) == ("strike", 1280000)])
        self.assertEqual([(r["what"], r["granules"]) for r in new], [(r["what"], r["granules"]) for r in old])
        self.assertRegex((self.root / "README.md").read_text(), r"\| 1,280,000 \| 5,000 s \| 100 \| \*\*depth, end 3\.0 %\*\* \| not known \|")
        self.assertIn("| 1,280,000 | 5,000 s | 50.0 s | 100 times | 100 | one | LIGGGHTS's runs |", (self.root / "validation/scale/RESULTS.md").read_text())
        self.assertTrue((self.root / first_page.PLOT).stat().st_size > 5000)

    def test_what_is_not_fit_is_refused(self):
        def refused(text, function, *args):
            with self.assertRaises(RunError) as caught:
                function(*args)
            self.assertIn(text, str(caught.exception))
            self.assertNotIn("\n", str(caught.exception))
        refused("a granule was lost", published.refuse, True, [])
        refused("impact-20k-culled-1 of other decks", published.refuse, False, ["impact-20k-culled-1"])
        published.refuse(False, [])
        refused("nothing to publish", published.publish, [], self.root)
        before = {file: file.read_bytes() for file in self.root.rglob("*") if file.is_file()}
        (self.root / "README.md").write_text("no marks\n")
        before[self.root / "README.md"] = b"no marks\n"
        refused("has no lines '<!-- made of", published.publish, published.strike_records(self.report()), self.root)
        self.assertEqual({file: file.read_bytes() for file in self.root.rglob("*") if file.is_file()}, before)
        (self.root / first_page.SCALE).write_text("[")
        refused("is no JSON", kept_figures.read, self.root / first_page.SCALE)
        refused("cannot read", kept_figures.read, self.root / "nowhere.json")
        refused("have 0 records with", first_page.rows, [], [])

    def test_the_commands_refuse_what_is_no_published_run(self):
        for script, words in ((scale, ["--publish", "--idle"]), (scale, ["--publish", "--few-steps"]), (scale, ["--publish", "--culling", "calm 3"]),
                              (tools, ["--publish", "--few-steps"])):
            with self.assertRaises(SystemExit) as caught, open(os.devnull, "w") as nowhere, contextlib.redirect_stderr(nowhere):
                script.main(words)
            self.assertEqual(caught.exception.code, 2)


if __name__ == "__main__":
    unittest.main()
