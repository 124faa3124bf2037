"""What README.md shows of results: five rows and a plot, made of results files alone (see kept_figures.py).

    python3 -m solidcull_runs.validation.first_page      # in the folder of the project: makes both anew
"""
import hashlib
import json

from ..engine import ROOT
from ..errors import RunError, command
from ..plots import plt
from . import kept_figures, pages, verdicts
from .points import SLEEP

CASES, SCALE, PLOT = "validation/results.json", "validation/scale/results.json", "validation/scale/times.png"
BEGIN = f"<!-- made of {CASES} and {SCALE} -->"
STRUCK = 1280000  # granules of the bed that the row of the strike is of
ROWS = (("fed_heap", "heap, fed on its top"), ("penetration", "large ball goes into a bed"), (None, "impact in a large bed"),
        ("blade_drag", "blade dragged through a bed"), ("silo", "silo that empties"))
NO_GAIN = 1.2     # times faster: no more than this is none
HEAD = ["scene", "granules", "LIGGGHTS", "times faster", "off by", "runs without the line differ by"]
BLUE, RED = "#0072B2", "#D55E00"  # of Okabe and Ito: told apart by all eyes


def percent(value):
    return f"{value:.1f} %" if value < 9.95 else f"{value:.0f} %"


def times(value):
    return f"{value:.1f}" if value < 9.95 else f"{value:.0f}"


def seconds(value):
    return f"{value:,.1f} s" if value < 9.95 else f"{value:,.0f} s"


def gain(value):
    return times(value) + (": no gain" if float(times(value)) <= NO_GAIN else "")


def of(records, **wanted):
    """The one record with these values."""
    found = [r for r in records if all(r.get(key) == value for key, value in wanted.items())]
    if len(found) != 1:
        raise RunError(f"the results files have {len(found)} records with {wanted}, and one is shown in README.md; publish it again")
    return found[0]


def most_off(record):
    """The figure of a record that is farthest off in per cent."""
    return max((f for f in record["off"] if f["percent"] is not None), key=lambda f: f["percent"])


def named(figure):
    """A figure and how far it is off; where pairs were added until that was decided, within what it is equal or by how much it differs."""
    if "pairs" not in figure:
        return f"{figure['figure']} {percent(figure['percent'])}"
    told = kept_figures.told(figure, percent if figure["unit"] == "%" else None)
    return f"{figure['figure']} {told.rpartition(': ')[2]}"


def is_beyond(figure):
    """Whether it is off by more than its page allows; where pairs were added, whether that may be."""
    return figure["verdict"] != verdicts.SAME if "pairs" in figure else figure["margins"] > 1


def off_by(main, others):
    """What is farther off than its page allows, in all scenes; else what is farthest off in the main one. And the figure of the main
    scene that is told of first."""
    beyond = [f for f in main["off"] if is_beyond(f)]
    told = [named(f) for f in beyond] + [f"{record['scene']}: {named(f)}" for record in others for f in record["off"]
                                         if is_beyond(f) and f["percent"] is not None]
    first = beyond[0] if beyond else most_off(main)
    return (f"**{'; '.join(told)}**" if told else named(first)), first


def case_row(records, case, title):
    main = of(records, case=case, mode=SLEEP, main=True)
    if main["faster"] is None:
        raise RunError(f"{case} was not run with `exterior {SLEEP}`, and README.md has a row of it; run it and publish again")
    off, first = off_by(main, [r for r in records if r["case"] == case and r["mode"] == SLEEP and not r["main"]])
    of_scene = f", {main['scene']}" if main["scene"] else ""
    return [f"[{title}](validation/cases/{case}/README.md){of_scene}", f"{main['granules']:,}", seconds(main["unculled_s"]), gain(main["faster"]), off,
            percent(first["scatter"])]


def strike_row(records, title):
    strike = of(records, what="strike", granules=STRUCK)
    beyond = [f for f in strike["off"] if f["percent"] > f["allowed"]]
    off = f"**{'; '.join(map(named, beyond))}**" if beyond else named(most_off(strike))
    scatter = (beyond[0] if beyond else most_off(strike))["scatter"]
    return [f"[{title}](validation/scale/RESULTS.md)", f"{STRUCK:,}", seconds(strike["unculled_s"]), gain(faster(strike)), off,
            "not known" if scatter is None else percent(scatter)]


def faster(record):
    return record["unculled_s"] / record["culled_s"]


def rows(cases, scale):
    return [case_row(cases, case, title) if case else strike_row(scale, title) for case, title in ROWS]


def readme(root, cases, scale):
    """The text of README.md with the rows of these records."""
    page = pages.Page()
    page.table(HEAD, rows(cases, scale))
    return pages.between_marks(root / "README.md", BEGIN, page.markdown())


def drawn(scale):
    """The records that the plot shows: the strikes, smallest bed first, and the largest bed that was struck asleep."""
    return sorted((r for r in scale if r["what"] == "strike"), key=lambda r: r["granules"]), \
        max((r for r in scale if r["what"] == "asleep"), key=lambda r: r["granules"])


def mark_of(scale):
    """Stands in the picture, so that a picture of other figures is told from it."""
    return hashlib.sha1(json.dumps(drawn(scale), sort_keys=True).encode()).hexdigest()


def draw(scale, file):
    """Run time against the number of granules, with and without the line. The figure, closed."""
    strikes, asleep = drawn(scale)
    sizes = [r["granules"] for r in strikes]
    figure, ax = plt.subplots(figsize=(8.4, 4.6))
    middle = (sizes[-2] * sizes[-1])**0.5
    for colour, mark, name, key, up in ((RED, "o", "LIGGGHTS", "unculled_s", 1), (BLUE, "s", "with the line", "culled_s", -1)):
        ax.loglog(sizes, [r[key] for r in strikes], mark + "-", color=colour, lw=2, ms=7)
        for r in strikes:
            ax.annotate(seconds(r[key]), (r["granules"], r[key]), xytext=(0, 10 * up), textcoords="offset points", ha="center",
                        va="bottom" if up > 0 else "top", color=colour, fontsize=11)
        ax.annotate(name, (middle, (strikes[-2][key] * strikes[-1][key])**0.5), xytext=(-8 * up, 10 * up), textcoords="offset points",
                    ha="right" if up > 0 else "center", va="bottom" if up > 0 else "top", color=colour, fontsize=12, fontweight="bold")
    for r in strikes:
        ax.annotate("", (r["granules"], r["culled_s"] * 1.17), (r["granules"], r["unculled_s"] / 1.17), arrowprops={"arrowstyle": "-|>", "color": "0.45", "lw": 1})
        ax.annotate(f"{times(faster(r))} times", (r["granules"], (r["culled_s"] * r["unculled_s"])**0.5), xytext=(6, 0), textcoords="offset points",
                    va="center", color="0.25", fontsize=11, fontweight="bold")
    apart = (sizes[-1] * asleep["granules"])**0.5
    ax.axvspan(apart, asleep["granules"] * 4, color="0.94", lw=0)
    ax.plot([asleep["granules"]], [asleep["loop_s"]], "s", color=BLUE, mfc="white", mew=2, ms=8)
    ax.annotate(seconds(asleep["loop_s"]), (asleep["granules"], asleep["loop_s"]), xytext=(0, -10), textcoords="offset points", ha="center", va="top",
                color=BLUE, fontsize=11)
    ax.annotate(f"begun asleep,\nfrom a culled file:\n{seconds(asleep['program_s'])} with reading it.\nLIGGGHTS alone\nwas not run", (asleep["granules"], asleep["loop_s"]),
                xytext=(0, 14), textcoords="offset points", ha="center", va="bottom", color="0.25", fontsize=10)
    ticks = [*sizes, asleep["granules"]]
    ax.set_xticks(ticks, [f"{n:,}" for n in ticks])
    ax.set_xticks([], minor=True)
    ax.set_yticks([10, 100, 1000, 10000], ["10 s", "100 s", "1,000 s", "10,000 s"])
    ax.set(xlabel="granules in the bed", ylabel="time of 8,000 steps on one core", xlim=(sizes[0] / 2, asleep["granules"] * 3),
           ylim=(min(r["culled_s"] for r in strikes) / 2, 2.2 * max(r["unculled_s"] for r in strikes)))
    ax.grid(axis="y", color="0.88", lw=0.8)
    ax.set_axisbelow(True)
    for edge in ("top", "right"):
        ax.spines[edge].set_visible(False)
    figure.tight_layout()
    figure.savefig(file, dpi=120, metadata={"Description": mark_of(scale)})
    plt.close(figure)
    return figure


def write(root, cases, scale):
    """Writes the README's rows and the plot."""
    text = readme(root, cases, scale)
    draw(scale, root / PLOT)
    pages.write(root / "README.md", text)


def main():
    write(ROOT, kept_figures.read(ROOT / CASES), kept_figures.read(ROOT / SCALE))
    return 0


if __name__ == "__main__":
    command("first_page", main)
