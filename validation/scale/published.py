#!/usr/bin/python3
"""What of the results of scale.py and tools.py is kept with the sources: results.json, the tables of RESULTS.md, and what README.md
shows.

    validation/scale/published.py       # makes tables, README's rows and plot anew, of results.json
"""
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
from solidcull_runs import errors, first_page, kept  # noqa: E402
from solidcull_runs.first_page import percent, times  # noqa: E402
from solidcull_runs.report import Page  # noqa: E402

STEPS = 8000        # of a strike
ALONE = 0.1         # cores that others kept busy: below, a run was alone
COUNTS = {1: "one", 2: "two", 3: "three", 4: "four", 5: "five"}


# --- records --------------------------------------------------------------------------------------------------------

def whole(value):
    return None if value is None else round(value)


def strike_records(report):
    """Of each size that was run with and without the line."""
    records = []
    for of_size in report.values():
        if not {"unculled", "culled"} <= set(of_size["kinds"]):
            continue
        unculled, culled, against = of_size["kinds"]["unculled"], of_size["kinds"]["culled"], of_size["against"]["culled"]
        off = []
        for name, m in against["metrics"].items():
            def share(part, mean=m["mean"]):
                return round(100 * part / abs(mean), 2)
            off.append({"figure": name.partition(" (")[0], "percent": share(m["error"]), "allowed": share(m["margin"]),
                        "scatter": share(m["spread"]) if len(m["unculled"]) > 1 else None})
        beside = [kind for kind in ("unculled", "culled") if any(busy >= ALONE for busy in of_size["kinds"][kind]["others_busy"])]
        records.append({"what": "strike", "granules": unculled["granules"] - 1, "pairs": min(len(unculled["runs"]), len(culled["runs"])),
                        "unculled_s": round(unculled["own_time"], 1), "culled_s": round(culled["own_time"], 1),
                        "over_exterior": round(against["over_exterior"], 1), "beside_others": beside, "off": off})
    return records


def asleep_records(report):
    """Of each size that was struck asleep."""
    found = (of_size["kinds"]["asleep"] for of_size in report.values() if "asleep" in of_size["kinds"])
    return [{"what": "asleep", "granules": s["granules"] - 1, "runs": len(s["runs"]), "loop_s": round(s["loop_time"], 1),
             "exterior": whole(s["exterior"]), "in_fix_s": round(s["seconds"], 1), "program_s": round(s["wall"], 1),
             "peak_gib": round(s["peak_mb"] / 1024, 2)} for s in found]


def tool_records(report):
    """Of each tool in each bed; `report`: by size and name, as tools.py has it."""
    return [{"what": "tool", "tool": name, "granules": c["bed"], "pairs": min(c["runs"]), "unculled_s": round(c["times"][0], 1),
             "culled_s": round(c["times"][1], 1), "movers": whole(c["movers"]), "exterior": whole(c["exterior"]),
             "interface": whole(c["interface"]), "restored": round(c["restored"], 1)} for (_, name), c in report.items()]


def merged(old, new):
    """The records with those of the same bed and kind replaced, and others added; beds in their order."""
    def key(record):
        return record["what"], record["granules"], record.get("tool", "")
    of_both = {key(r): r for r in [*old, *new]}
    kinds = {r["what"]: None for r in [*old, *new]}
    return [of_both[k] for kind in kinds for k in sorted((k for k in of_both if k[0] == kind), key=lambda k: k[1])]


# --- tables ---------------------------------------------------------------------------------------------------------

def beside(kinds):
    return {(): "none", ("unculled",): "LIGGGHTS's runs", ("culled",): "runs with the line"}.get(tuple(kinds), "both")


def seconds(value):
    return f"{value:,.1f} s" if value < 99.95 else f"{value:,.0f} s"


def of_kind(records, what):
    return [r for r in records if r["what"] == what]


def strikes(records):
    return ["bed", "LIGGGHTS", "with the line", "faster", "granules / mean exterior", "pairs of runs", "beside other work"], [
        [f"{r['granules']:,}", seconds(r["unculled_s"]), seconds(r["culled_s"]), f"{times(first_page.faster(r))} times", times(r["over_exterior"]),
         COUNTS[r["pairs"]], beside(r["beside_others"])] for r in of_kind(records, "strike")]


def off_of(figure):
    return percent(figure["percent"]) + (": **outside**" if figure["percent"] > figure["allowed"] else "")


def errors_of_strikes(records):
    beds = of_kind(records, "strike")
    head, rows = ["figure"], [[f["figure"]] for f in beds[0]["off"]]
    for bed in beds:
        noisy = any(f["scatter"] is not None for f in bed["off"])
        head += [f"{bed['granules']:,}"] + ["allowed"] * noisy
        for row, f in zip(rows, bed["off"]):
            row += [off_of(f)] + [percent(f["allowed"])] * noisy
    return head, rows


def asleep(records):
    def shown(value, form):
        return "-" if value is None else form.format(value)
    return ["granules", "loop", "million granule-steps a second", "mean exterior", "in the fix, the whole program",
            "whole program, reading the file in it", "most memory"], [
        [f"{r['granules']:,}", f"{r['loop_s']:.1f} s", f"{float(format(r['granules'] * STEPS / r['loop_s'] / 1e6, '.3g')):,.0f}", f"{r['exterior']:,}",
         f"{r['in_fix_s']:.0f} s", shown(r["program_s"], "{:.0f} s"), shown(r["peak_gib"], "{:.2f} GiB")] for r in of_kind(records, "asleep")]


def tools(records):
    return ["bed", "tool", "pairs of runs", "LIGGGHTS", "with the line", "faster", "who move", "exterior", "interface", "atoms / movers", "restored"], [
        [f"{r['granules']:,}", r["tool"], COUNTS[r["pairs"]], seconds(r["unculled_s"]), seconds(r["culled_s"]), f"{times(first_page.faster(r))} times", f"{r['movers']:,}",
         f"{r['exterior']:,}", f"{r['interface']:,}", times((r["exterior"] + r["interface"]) / r["movers"]), f"{r['restored']:.1f}"]
        for r in of_kind(records, "tool")]


TABLES = {"the strikes": strikes, "their errors": errors_of_strikes, "beds struck asleep": asleep, "tools": tools}


def mark(name):
    return f"<!-- made of results.json: {name} -->"


def page_text(file, records):
    """The text of RESULTS.md with the tables of these records."""
    text = file.read_text()
    for name, table in TABLES.items():
        page = Page()
        page.table(*table(records))
        text = kept.between_marks(file, mark(name), page.markdown(), text)
    return text


def write(root, records):
    """Writes results.json, RESULTS.md, the plot, and README's rows; all texts are there before the first is written."""
    results, page = root / first_page.SCALE, root / "validation" / "scale" / "RESULTS.md"
    texts = {root / "README.md": first_page.readme(root, kept.read(root / first_page.CASES), records), results: kept.text_of(records),
             page: page_text(page, records)}
    first_page.draw(records, root / first_page.PLOT)
    for file, text in texts.items():
        kept.write(file, text)


def refuse(lost, stale):
    """What is not fit to be kept."""
    if lost:
        raise errors.RunError("not published: a granule was lost")
    if stale:
        raise errors.RunError(f"not published: {', '.join(stale)} of other decks or another launcher; run them again")


def publish(new, root=first_page.ROOT):
    """Keeps these records beside those of other beds."""
    if not new:
        raise errors.RunError("nothing to publish: no bed was run as a published one is, with and without the line or asleep")
    write(root, merged(kept.read(root / first_page.SCALE), new))


def main():
    write(first_page.ROOT, kept.read(first_page.ROOT / first_page.SCALE))
    return 0


if __name__ == "__main__":
    errors.command("published", main)
