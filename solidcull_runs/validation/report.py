"""The validation report, made of results alone: Markdown with pictures, and one HTML page that holds all. And what of it is kept with
the sources: results.json, RESULTS.md with the picture of its overview, and what other pages show."""
import itertools
import shutil
from pathlib import Path

from ..errors import RunError
from . import first_page, forecasts, kept_figures, pages, report_plots, sequential, verdicts
from .cases import FULL, PRODUCTION
from .points import BY_HAND, LIVE, PAPER, SLEEP

BEGIN = "<!-- made by validation/run.sh --publish -->"
PICTURES = ("all.png",)  # of the overview, kept with the sources
PUBLISHED = {FULL: "validation", PRODUCTION: "validation/production"}  # where


def figure_of(value):
    return "-" if value is None else f"{value:.3g}"


def linked(record, title):
    return f"[{record['case']}](#{pages.anchor(title)})" + f", {record['scene']}" * bool(record["scene"])


def overview_row(records, title):
    """A scene in the table of the overview, of its records (see kept_figures.py), one a mode."""
    scene = records[0]
    seconds = scene["unculled_s"]
    cells = [linked(scene, title), f"{scene['granules']:,}", "-" if seconds is None else f"{seconds:.0f} s",
             figure_of(scene["moving"])]
    for record in records:
        if record["faster"] is None:
            cells += ["-", "-", "not run"]
            continue
        worst = record["off"][0]
        cells += [f"{record['faster']:.2f}", f"{worst['margins']:.2f} ({worst['figure']})", verdict_of(record)]
    return cells


def verdict_of(record):
    """In words. Where pairs were added, that of the figure that says most, and the pairs that the last figure took."""
    figure = kept_figures.most_telling(record)
    if "pairs" not in figure:
        return record["verdict"]
    return f"{kept_figures.told(figure)} ({figure['figure']}); {max(f['pairs'] for f in record['off'])} pairs"


def overview_rows(records, titles):
    """The table of the overview: a row for each scene. `titles`: of the cases, by name."""
    scenes = itertools.groupby(records, key=lambda r: (r["case"], r["scene"]))
    return [overview_row(list(of_scene), titles[case]) for (case, _), of_scene in scenes]


def outside_rows(records, titles):
    """What is outside, in per cent."""
    return [[linked(r, titles[r["case"]]), f"`{r['mode']}`", f["figure"], "-" if f["percent"] is None else f"{f['percent']:.2g} %", f"{f['margins']:.2f}"]
            for r in records for f in r["off"] if f["verdict"] == verdicts.OTHER]


OVERVIEW = ["case", "granules", "LIGGGHTS", "N/N_moving", "`sleep`: times faster", "largest error, in margins", "verdict",
            "`live`: times faster", "largest error, in margins", "verdict"]

OUTSIDE = ["case", "mode", "figure", "off by", "in margins"]


def overview(page, results, folder, how):
    page.heading(1, "solidcull: run time against error")
    page.text(how)
    page.text("Each case is run unculled at least five times. Its tool, ball or wall starts a little farther each time: by 10 µm, or where "
              "granules are 10 mm wide by 100 µm. Culled runs start from the same restart file. An error is what a culled run differs from the unculled one that starts alike, mean of all pairs. It is given in margins, "
              "which each case's README has fixed before. The verdict is that of two one-sided tests at 5 %: `equivalent`, "
              "`outside`, or `not decided` where the runs scatter too much to tell. Time is that of a core in LIGGGHTS's loop.")
    if any(r.get("decided") for r in results):
        page.text(f"At the defaults, pairs of runs were added until each metric was decided, {sequential.LOOKS[-1]} at most. *Equal within x %* says that the "
                  "difference is smaller than the margin, and than x % of the unculled mean. *Differs by x %* says that it is larger than the margin. "
                  f"Looks were taken after {', '.join(map(str, sequential.LOOKS))} pairs. In all of them together, either is said by chance in less than 5 %.")
    records, titles = [record for r in results for record in kept_figures.records_of(r)], {r["case"]: r["title"] for r in results}
    page.table(OVERVIEW, overview_rows(records, titles))
    outside = outside_rows(records, titles)
    if outside:
        page.text("What is outside:")
        page.table(OUTSIDE, outside)
    thrown = sum(r["lost_refilled"] for r in results)
    page.text(f"Granules lost, in all culled runs: {sum(r['lost'] for r in results)}" +
              (f"; by the paper's scheme, whose new packings throw some out of the box: {thrown}" if thrown else "") +
              f". Runs that failed: {sum(len(r['failed']) for r in results)}.")
    report_plots.all_cases(results, folder / "all.png")
    page.picture(folder / "all.png", "run time against error, all cases")
    page.text("Large marks: the defaults. Small marks: other tolerances. Left is faster, low is closer to LIGGGHTS; the dotted lines are the "
              "unculled time and the margin. N/N_moving: all granules over those that move by more than d/100 between two snapshots, "
              "the bound of any such method.")


def metric_rows(result, judged):
    """Head and rows of the table of a case's metrics: unculled, and at the defaults."""
    unculled = verdicts.unculled_of(verdicts.main_scene(result))
    defaults = [j for j in (verdicts.default_of(judged, SLEEP), verdicts.default_of(judged, LIVE)) if j]
    added, rows = any(v.pairs for j in defaults for v in j.verdicts.values()), []
    for m in result["metrics"]:
        values = list(verdicts.values_of(unculled, m["name"]).values())
        mean = sum(values) / len(values)
        row = [f"{m['name']} ({m['unit']})", f"{mean:.4g}", f"{min(values):.4g} to {max(values):.4g}",
               f"{100 * m['margin']:g} %" if m["relative"] else f"{m['margin']:g}"]
        for j in defaults:
            v = j.verdicts[m["name"]]
            row += [f"{mean + v.difference:.4g}", f"{v.low:+.2g} to {v.high:+.2g}", kept_figures.told(kept_figures.figure_off(m, v, unculled))]
            row += [v.pairs] * added
        rows.append(row)
    head = ["metric", "unculled", "least to largest", "margin"]
    for j in defaults:
        head += [f"`{j.family}`", "difference lies in", "verdict"] + ["pairs"] * added
    return head, rows


def over_scenes(result):
    """Of the figures that as many pairs as there may be did not decide in some scene, and that are outside in none: the verdict on the
    mean of all scenes."""
    if not result.get("decided") or len(result["scenes"]) < 2:
        return []
    judged, rows = [verdicts.judge(result, scene) for scene in result["scenes"].values()], []
    for m in result["metrics"]:
        for family in (SLEEP, LIVE):
            of_scenes = [j.verdicts[m["name"]] for j in (verdicts.default_of(of, family) for of in judged) if j]
            is_open = verdicts.worst_of({v.word for v in of_scenes}) == verdicts.OPEN
            if not is_open or min(v.pairs or 0 for v in of_scenes if v.word == verdicts.OPEN) < sequential.LOOKS[-1]:
                continue
            v = verdicts.over_scenes(result, m, family)
            if v:
                rows.append([m["name"], f"`{family}`", f"{v.low:+.2f} to {v.high:+.2f}", v.word])
    return rows


def case_section(page, result, folder, runs_folder):
    judged = verdicts.judge(result)
    name = result["case"]
    page.heading(2, result["title"])
    page.text(f"**Claim.** {result['claim']}")
    page.text(f"**Reference.** {result['reference']}")
    if result["failed"]:
        page.table(["run that failed", "why"], [[f["run"], f["why"].replace("|", "/")] for f in result["failed"]])
    if not judged:
        page.text("There are too few runs to judge.")
        return
    picture = runs_folder and Path(runs_folder) / name / "what_moves.png"
    if picture and picture.exists():
        shutil.copyfile(picture, folder / f"{name}-moves.png")
        page.picture(folder / f"{name}-moves.png", f"{name}: what moves")
    page.table(*metric_rows(result, judged))
    if report_plots.curves(result, folder / f"{name}-curves.png"):
        page.picture(folder / f"{name}-curves.png", f"{name}: metrics against time")
    report_plots.case_plots(result, judged, folder / f"{name}-error.png")
    page.picture(folder / f"{name}-error.png", f"{name}: run time against error, and error against tolerance")
    page.table(["point", "runs", "time over unculled", "exterior", "interface", "restored", "largest error, in margins", "of"],
               [[j.name, j.runs, f"{j.of_unculled:.3f}", *(
                   "-" if c is None else f"{c:,.0f}" for c in (j.exterior, j.interface, j.restored)), f"{j.error:.2f}", j.worst]
                for j in judged.values()])
    found = verdicts.orders(result, judged)
    if found:
        page.table(["error ~ tolerance^p", "metric", "p"], [[f"`{family}`", metric, f"{p:.2f}"] for (family, metric), p in sorted(found.items())])
    if result["fields"]:
        page.table(["field at the end, relative L2", *(f"{f}: error / noise" for f in next(iter(result["fields"].values())))],
                   [[point, *(f"{d['error']:.3f} / {d['noise']:.3f}" for d in of.values())] for point, of in result["fields"].items()])
    for scene, of in list(result["scenes"].items())[1:]:
        others = verdicts.judge(result, of)
        if others:
            page.table([f"scene {scene}", "times faster", "largest error, in margins", "of", "verdict"],
                       [[f"`{j.name}`", f"{j.speed_up:.2f}", f"{j.error:.2f}", j.worst, j.word] for j in others.values()])
            if result.get("decided"):
                page.table(*metric_rows({**result, "scenes": {scene: of}}, others))
    rows = over_scenes(result)
    if rows:
        page.text("What is not decided in a scene, on the mean of all of them, each in its own margins:")
        page.table(["metric", "mode", "difference lies in, in margins", "verdict"], rows)
    if result["laws"]:
        families = ["unculled", SLEEP, LIVE]
        page.table(["law", "known", *families], [[law["what"], law["known"], *(figure_of(law["values"].get(f)) for f in families)] for law in result["laws"]])


def paid(results):
    """Where another way is left of and below ours: points of the paper's scheme or of the freeze by hand that are both faster and closer
    than every point of ours."""
    rows = []
    for result in results:
        judged = verdicts.judge(result)
        ours = [j for j in judged.values() if j.family in (SLEEP, LIVE)]
        for j in judged.values():
            if j.family in (PAPER, BY_HAND):
                better = [o for o in ours if o.of_unculled <= j.of_unculled and o.error <= max(j.error, verdicts.noise_of(result))]
                rows.append([result["case"], j.family, f"{j.of_unculled:.3f}", f"{j.error:.2f}",
                             f"{better[0].name}: {better[0].of_unculled:.3f}, {better[0].error:.2f}" if better else "**none**"])
    return rows


def forecast_section(page, results):
    """What the fix forecast of runs at the defaults, beside what came."""
    made = [(result, f) for result in results for f in forecasts.forecasts_of(result)]
    if not made:
        return
    page.heading(2, "Forecast and what came")
    near = sum(f.is_near for _, f in made)
    page.text(f"From its first looks the fix says how many times less work a run will be with the line. Of {len(made)} forecasts {near} are within {100 * (forecasts.NEAR - 1):.0f} %. "
              "Each is that of the loop which takes LIGGGHTS the longest, of those in which there was one. Medians of the runs at the defaults. Where it said nothing, nothing stands here.")
    page.table(["case", "mode", "forecast", "came", "forecast over what came"],
               [[f"[{result['case']}](#{pages.anchor(result['title'])})" + f", {f.scene}" * bool(f.scene), f"`{f.mode}`", f"{f.said:.2f}", f"{f.came:.2f}",
                 f"{f.said / f.came:.2f}" if f.is_near else f"**{f.said / f.came:.2f}**"] for result, f in made])


def page_of(results, part, runs_folder, how):
    """The report, its pictures in the folder `part`."""
    page = pages.Page()
    overview(page, results, part, how)
    rows = paid(results)
    if rows:
        page.heading(2, "Beside other ways to save the time")
        page.text("For each point of the paper's scheme and of the freeze by hand: a point of ours that is no slower and no less close.")
        page.table(["case", "way", "time over unculled", "largest error, in margins", "ours"], rows)
    forecast_section(page, results)
    for result in results:
        case_section(page, result, part, runs_folder)
    return page


def write(results, folder, runs_folder=None, how=""):
    """Writes README.md, its pictures and report.html; whole or not at all. The page."""
    if not results:
        raise RunError("no case has results to report")
    folder = Path(folder)
    part = folder.with_name(folder.name + ".part")
    shutil.rmtree(part, ignore_errors=True)
    part.mkdir(parents=True)
    page = page_of(results, part, runs_folder, how)
    (part / "README.md").write_text(page.markdown())
    (part / "report.html").write_text(page.html("solidcull: run time against error"))
    shutil.rmtree(folder, ignore_errors=True)
    part.rename(folder)
    return page


# --- what is kept with the sources ---

def of_one_case(result):
    """The table of a case's metrics at the defaults."""
    page = pages.Page()
    page.table(*metric_rows(result, verdicts.judge(result)))
    return page.markdown()


def publish(results, page, report_folder, root, size=FULL):
    """Writes results.json and RESULTS.md where those of the size are kept, and of FULL the README's table and the impact's; all or none."""
    for result in results:
        if not verdicts.judge(result):
            raise RunError(f"{result['case']} has too few runs to publish; run it to its end first")
    records = [record for result in results for record in kept_figures.records_of(result)]
    folder = root / PUBLISHED[size]
    texts = {folder / "results.json": kept_figures.text_of(records), folder / "RESULTS.md": page.markdown(PICTURES)}
    if size == FULL:
        texts[root / "README.md"] = first_page.readme(root, records, kept_figures.read(root / first_page.SCALE))
    impact = next((r for r in results if r["case"] == "impact"), None)
    if impact and size == FULL:
        file = root / "examples" / "impact" / "RESULTS.md"
        texts[file] = pages.between_marks(file, BEGIN, of_one_case(impact))
    folder.mkdir(parents=True, exist_ok=True)
    for file, text in texts.items():
        pages.write(file, text)
    for name in PICTURES:
        shutil.copyfile(report_folder / name, folder / name)
