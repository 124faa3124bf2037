"""What of a report is kept with the sources: RESULTS.md with the picture of the first page, and the tables in pages for users."""
import re
import shutil
import statistics
from pathlib import Path

from . import judgement
from .equivalence import OTHER, SAME
from .errors import RunError
from .points import LIVE, SLEEP
from .report import Page, default_of, metric_rows, shown_error

BEGIN, END = "<!-- made by validation/run.sh --publish -->", "<!-- end -->"
PICTURES = ("all.png",)  # of the first page


def defaults(result, family):
    """The default point of a mode in each scene in which it was run."""
    found = [default_of(judgement.judge(result, scene), family) for scene in result["scenes"].values()]
    return [j for j in found if j]


def summary_row(result):
    """A case in the README's table: the time and speed-up of its main scene, the largest error of all."""
    scene = judgement.main_scene(result)
    if not judgement.judge(result):
        raise RunError(f"{result['case']} has too few runs to publish; run it to its end first")
    whole = statistics.median(r["seconds"] for r in judgement.unculled_of(scene)["runs"])
    cells = [f"[{result['case'].replace('_', ' ')}](validation/cases/{result['case']}/README.md)", f"{scene['granules']:,}", f"{whole:.0f} s"]
    for family in (SLEEP, LIVE):
        points = defaults(result, family)
        if not points:
            cells += ["-", "not run"]
            continue
        worst, word = max(points, key=lambda j: j.error), judgement.worst_of({j.word for j in points})
        error = f"{worst.error:.1f}" if word == SAME else shown_error(worst)
        cells += [f"{points[0].speed_up:.1f}", f"{error}, {'**outside**' if word == OTHER else word}"]
    return cells


def summary(results):
    """The README's table."""
    page = Page()
    page.table(["scene", "granules", "LIGGGHTS", "`sleep`: times faster", "largest error, in margins", "`live`: times faster", "largest error, in margins"],
               [summary_row(r) for r in results])
    return page.markdown()


def of_one_case(result):
    """The table of a case's metrics at the defaults."""
    page = Page()
    page.table(*metric_rows(result, judgement.judge(result)))
    return page.markdown()


def between_marks(file, table):
    """Puts a table between the marks of a page."""
    text = Path(file).read_text()
    found = re.search(rf"({re.escape(BEGIN)}\n).*?({re.escape(END)})", text, re.S)
    if not found:
        raise RunError(f"{file} has no lines '{BEGIN}' and '{END}' to put a table between")
    return text[:found.end(1)] + table + text[found.start(2):]


def publish(results, page, report_folder, root):
    """Writes RESULTS.md beside validation/run.sh, the README's table and the impact's."""
    pages = {root / "README.md": between_marks(root / "README.md", summary(results))}
    impact = next((r for r in results if r["case"] == "impact"), None)
    if impact:
        file = root / "examples" / "impact" / "RESULTS.md"
        pages[file] = between_marks(file, of_one_case(impact))
    pages[root / "validation" / "RESULTS.md"] = page.markdown(PICTURES)
    for file, text in pages.items():
        part = file.with_suffix(".part")
        part.write_text(text)
        part.rename(file)
    for name in PICTURES:
        shutil.copyfile(report_folder / name, root / "validation" / name)
