"""The validation report, made of results alone: Markdown with pictures, and one HTML page that holds all."""
import base64
import html
import itertools
import json
import re
import shutil
from pathlib import Path

from . import figures, judgement, kept
from .equivalence import OTHER
from .errors import RunError
from .points import BY_HAND, LIVE, PAPER, SLEEP

WANTED = {"case", "title", "claim", "reference", "size", "metrics", "scenes", "failed", "bound", "fields", "laws", "lost", "lost_refilled"}


def read_result(file):
    """The results of a case; RunError where the file is no such thing."""
    try:
        result = json.loads(Path(file).read_text())
    except OSError as e:
        raise RunError(f"cannot read {file}: {e.strerror}; run the case first") from None
    except ValueError as e:
        raise RunError(f"{file} is no JSON ({e}); delete it and run the case again") from None
    if not isinstance(result, dict) or WANTED - set(result):
        raise RunError(f"{file} is not the result of a case; delete it and run the case again")
    names = {m["name"] for m in result["metrics"]}
    for scene in result["scenes"].values():
        for point, entry in scene["points"].items():
            for run in entry["runs"]:
                if set(run["values"]) != names:
                    raise RunError(f"{file}: {point} has values of {', '.join(sorted(run['values']))}, the case measures "
                                   f"{', '.join(sorted(names))}; run the case again")
    return result


def anchor(title):
    """The name that Markdown gives a heading."""
    return re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-")


class Page:
    """Blocks of text, tables and pictures, written as Markdown and as HTML."""

    def __init__(self):
        self.blocks = []

    def heading(self, level, text):
        self.blocks.append(("heading", level, text))

    def text(self, text):
        self.blocks.append(("text", text))

    def table(self, head, rows):
        self.blocks.append(("table", head, [[str(c) for c in row] for row in rows]))

    def picture(self, file, what):
        self.blocks.append(("picture", file, what))

    def markdown(self, pictures=None):
        """`pictures`: the names of those that are shown; all if not said."""
        out = []
        for kind, *b in self.blocks:
            if kind == "heading":
                out.append("#" * b[0] + " " + b[1])
            elif kind == "text":
                out.append(b[0])
            elif kind == "picture":
                if pictures is None or b[0].name in pictures:
                    out.append(f"![{b[1]}]({b[0].name})")
            else:
                out.append("\n".join("| " + " | ".join(cells) + " |" for cells in [b[0], ["---"] * len(b[0]), *b[1]]))
        return "\n\n".join(out) + "\n"

    def html(self, title):
        def marked(text):
            text = html.escape(text)
            text = re.sub(r"`([^`]+)`", r"<code>\1</code>", text)
            text = re.sub(r"\[([^]]+)\]\((#[^)]+)\)", r'<a href="\2">\1</a>', text)
            return re.sub(r"\*\*([^*]+)\*\*", r"<b>\1</b>", text)
        out = [f"<!doctype html><html lang=en><meta charset=utf-8><title>{html.escape(title)}</title><style>body{{font:15px/1.5 sans-serif;"
               "max-width:70em;margin:2em auto;padding:0 1em}table{border-collapse:collapse;margin:1em 0}td,th{border:1px solid #ccc;"
               "padding:.2em .6em;text-align:left}img{max-width:100%}</style>"]
        for kind, *b in self.blocks:
            if kind == "heading":
                out.append(f'<h{b[0]} id="{anchor(b[1])}">{marked(b[1])}</h{b[0]}>')
            elif kind == "text":
                out.append(f"<p>{marked(b[0])}</p>")
            elif kind == "picture":
                data = base64.b64encode(b[0].read_bytes()).decode()
                out.append(f'<p><img alt="{html.escape(b[1])}" src="data:image/png;base64,{data}"></p>')
            else:
                rows = "".join("<tr>" + "".join(f"<td>{marked(c)}</td>" for c in row) + "</tr>" for row in b[1])
                out.append("<table><tr>" + "".join(f"<th>{marked(c)}</th>" for c in b[0]) + f"</tr>{rows}</table>")
        return "\n".join(out) + "\n"


def figure_of(value, digits=3):
    return "-" if value is None else f"{value:.{digits}g}"


def linked(record, title):
    return f"[{record['case']}](#{anchor(title)})" + f", {record['scene']}" * bool(record["scene"])


def first_row(records, title):
    """A scene in the table of the first page, of its records (see kept.py), one a mode."""
    scene = records[0]
    seconds = scene["unculled_s"]
    cells = [linked(scene, title), f"{scene['granules']:,}", "-" if seconds is None else f"{seconds:.0f} s",
             figure_of(scene["moving"])]
    for record in records:
        if record["faster"] is None:
            cells += ["-", "-", "not run"]
            continue
        worst = record["off"][0]
        cells += [f"{record['faster']:.2f}", f"{worst['margins']:.2f} ({worst['figure']})", record["verdict"]]
    return cells


def first_rows(records, titles):
    """The table of the first page: a row for each scene. `titles`: of the cases, by name."""
    scenes = itertools.groupby(records, key=lambda r: (r["case"], r["scene"]))
    return [first_row(list(of_scene), titles[case]) for (case, _), of_scene in scenes]


def outside_rows(records, titles):
    """What is outside, in per cent."""
    return [[linked(r, titles[r["case"]]), f"`{r['mode']}`", f["figure"], "-" if f["percent"] is None else f"{f['percent']:.2g} %", f"{f['margins']:.2f}"]
            for r in records for f in r["off"] if f["verdict"] == OTHER]


FIRST = ["case", "granules", "LIGGGHTS", "N/N_moving", "`sleep`: times faster", "largest error, in margins", "verdict",
         "`live`: times faster", "largest error, in margins", "verdict"]

OUTSIDE = ["case", "mode", "figure", "off by", "in margins"]


def first_page(page, results, folder, how):
    page.heading(1, "solidcull: run time against error")
    page.text(how)
    page.text("Each case is run unculled at least five times. Its tool, ball or wall starts a little farther each time: by 10 µm, or where "
              "granules are 10 mm wide by 100 µm. Culled runs start from the same restart file. An error is what a culled run differs from the unculled one that starts alike, mean of all pairs. It is given in margins, "
              "which each case's README has fixed before. The verdict is that of two one-sided tests at 5 %: `equivalent`, "
              "`outside`, or `not decided` where the runs scatter too much to tell. Time is that of a core in LIGGGHTS's loop.")
    records, titles = [record for r in results for record in kept.records_of(r)], {r["case"]: r["title"] for r in results}
    page.table(FIRST, first_rows(records, titles))
    outside = outside_rows(records, titles)
    if outside:
        page.text("What is outside:")
        page.table(OUTSIDE, outside)
    thrown = sum(r["lost_refilled"] for r in results)
    page.text(f"Granules lost, in all culled runs: {sum(r['lost'] for r in results)}" +
              (f"; by the paper's scheme, whose new packings throw some out of the box: {thrown}" if thrown else "") +
              f". Runs that failed: {sum(len(r['failed']) for r in results)}.")
    figures.all_cases(results, folder / "all.png")
    page.picture(folder / "all.png", "run time against error, all cases")
    page.text("Large marks: the defaults. Small marks: other tolerances. Left is faster, low is closer to LIGGGHTS; the dotted lines are the "
              "unculled time and the margin. N/N_moving: all granules over those that move by more than d/100 between two snapshots, "
              "the bound of any such method.")


def metric_rows(result, judged):
    """Head and rows of the table of a case's metrics: unculled, and at the defaults."""
    unculled = judgement.unculled_of(judgement.main_scene(result))
    defaults = [j for j in (judgement.default_of(judged, SLEEP), judgement.default_of(judged, LIVE)) if j]
    rows = []
    for m in result["metrics"]:
        values = list(judgement.values_of(unculled, m["name"]).values())
        mean = sum(values) / len(values)
        row = [f"{m['name']} ({m['unit']})", f"{mean:.4g}", f"{min(values):.4g} to {max(values):.4g}",
               f"{100 * m['margin']:g} %" if m["relative"] else f"{m['margin']:g}"]
        for j in defaults:
            v = j.verdicts[m["name"]]
            row += [f"{mean + v.difference:.4g}", f"{v.low:+.2g} to {v.high:+.2g}", v.word]
        rows.append(row)
    head = ["metric", "unculled", "least to largest", "margin"]
    for j in defaults:
        head += [f"`{j.family}`", "difference lies in", "verdict"]
    return head, rows


def case_section(page, result, folder, runs_folder):
    judged = judgement.judge(result)
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
    if figures.curves(result, folder / f"{name}-curves.png"):
        page.picture(folder / f"{name}-curves.png", f"{name}: metrics against time")
    figures.case_plots(result, judged, folder / f"{name}-error.png")
    page.picture(folder / f"{name}-error.png", f"{name}: run time against error, and error against tolerance")
    page.table(["point", "runs", "time over unculled", "exterior", "interface", "restored", "largest error, in margins", "of"],
               [[j.name, j.runs, f"{j.of_unculled:.3f}", *(
                   "-" if c is None else f"{c:,.0f}" for c in (j.exterior, j.interface, j.restored)), f"{j.error:.2f}", j.worst]
                for j in judged.values()])
    found = judgement.orders(result, judged)
    if found:
        page.table(["error ~ tolerance^p", "metric", "p"], [[f"`{family}`", metric, f"{p:.2f}"] for (family, metric), p in sorted(found.items())])
    if result["fields"]:
        page.table(["field at the end, relative L2", *(f"{f}: error / noise" for f in next(iter(result["fields"].values())))],
                   [[point, *(f"{d['error']:.3f} / {d['noise']:.3f}" for d in of.values())] for point, of in result["fields"].items()])
    for scene, of in list(result["scenes"].items())[1:]:
        others = judgement.judge(result, of)
        if others:
            page.table([f"scene {scene}", "times faster", "largest error, in margins", "of", "verdict"],
                       [[f"`{j.name}`", f"{j.speed_up:.2f}", f"{j.error:.2f}", j.worst, j.word] for j in others.values()])
    if result["laws"]:
        families = ["unculled", SLEEP, LIVE]
        page.table(["law", "known", *families], [[law["what"], law["known"], *(figure_of(law["values"].get(f)) for f in families)] for law in result["laws"]])


def paid(results):
    """Where another way is left of and below ours: points of the paper's scheme or of the freeze by hand that are both faster and closer
    than every point of ours."""
    rows = []
    for result in results:
        judged = judgement.judge(result)
        ours = [j for j in judged.values() if j.family in (SLEEP, LIVE)]
        for j in judged.values():
            if j.family in (PAPER, BY_HAND):
                better = [o for o in ours if o.of_unculled <= j.of_unculled and o.error <= max(j.error, judgement.noise_of(result))]
                rows.append([result["case"], j.family, f"{j.of_unculled:.3f}", f"{j.error:.2f}",
                             f"{better[0].name}: {better[0].of_unculled:.3f}, {better[0].error:.2f}" if better else "**none**"])
    return rows


def page_of(results, part, runs_folder, how):
    """The report, its pictures in the folder `part`."""
    page = Page()
    first_page(page, results, part, how)
    rows = paid(results)
    if rows:
        page.heading(2, "Beside other ways to save the time")
        page.text("For each point of the paper's scheme and of the freeze by hand: a point of ours that is no slower and no less close.")
        page.table(["case", "way", "time over unculled", "largest error, in margins", "ours"], rows)
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
