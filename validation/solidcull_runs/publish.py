"""What of a report is kept with the sources: results.json, RESULTS.md with the picture of its first page, and what other pages show."""
import shutil

from . import first_page, judgement, kept
from .errors import RunError
from .report import Page, metric_rows

BEGIN = "<!-- made by validation/run.sh --publish -->"
PICTURES = ("all.png",)  # of the first page


def of_one_case(result):
    """The table of a case's metrics at the defaults."""
    page = Page()
    page.table(*metric_rows(result, judgement.judge(result)))
    return page.markdown()


def publish(results, page, report_folder, root):
    """Writes results.json and RESULTS.md beside validation/run.sh, the README's table and the impact's; all or none."""
    for result in results:
        if not judgement.judge(result):
            raise RunError(f"{result['case']} has too few runs to publish; run it to its end first")
    records = [record for result in results for record in kept.records_of(result)]
    texts = {root / "README.md": first_page.readme(root, records, kept.read(root / first_page.SCALE)),
             root / first_page.CASES: kept.text_of(records), root / "validation" / "RESULTS.md": page.markdown(PICTURES)}
    impact = next((r for r in results if r["case"] == "impact"), None)
    if impact:
        file = root / "examples" / "impact" / "RESULTS.md"
        texts[file] = kept.between_marks(file, BEGIN, of_one_case(impact))
    for file, text in texts.items():
        kept.write(file, text)
    for name in PICTURES:
        shutil.copyfile(report_folder / name, root / "validation" / name)
