#!/usr/bin/python3
"""What of the results of scaling.py is kept with the sources: results.json, the tables of RESULTS.md, and the picture of the model.

    validation/scaling/published.py       # makes tables and picture anew, of results.json
"""
import json
import math
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))
sys.path.insert(0, str(HERE))
import model  # noqa: E402
from solidcull_runs import errors, plots  # noqa: E402
from solidcull_runs.validation import kept_figures, pages  # noqa: E402

RESULTS, PAGE, PICTURE = HERE / "results.json", HERE / "RESULTS.md", HERE / "model.png"
SCALE = HERE.parent / "scale" / "results.json"  # beds of up to 10,240,000 granules, asleep: what a stored one costs
STRIKE_STEPS = 8000
SHOWN_RANKS = (1, 10, 100, 1000)
BILLION = 1e9

TEMPLATE = """\
# scaling: as counted, timed and estimated

[The page](README.md) says how it is run, and what each thing counted is.

## Collectives

Calls in which all ranks wait for one another, of the rank with most.

{collectives}
## Messages to single ranks

{messages}
## How evenly the work lies

{shares}
## A blow in a corner

Work of the rank with most over the mean of all ranks, in each step.

{corner}
## Times

LIGGGHTS's loop, medians of runs in turns.

{times}
Of the blade, which goes along x: beside ranks along x one has what lies before it, and what it has left behind sleeps. Along y each
has half of what it moves.

## Up to 1,000 ranks

![A step of 1,000,000,000 granules against the number of ranks: the whole, its work dotted, and where it bends](model.png)

{model}
Of that work: the share of work in a step on 1,000 ranks. Bend: from there on, messages and collectives take longer than the work.

It is made of these:

{constants}"""


def of(records, what, **how):
    return [r for r in records if r["what"] == what and all(r[k] == v for k, v in how.items())]


def size(value):
    """Bytes, as they are said."""
    for unit, many in (("MB", 1e6), ("kB", 1e3)):
        if value >= many:
            return f"{value / many:.3g} {unit}"
    return f"{value:.0f} B"


def number(value):
    return "-" if math.isnan(value) else f"{value:.3g}"


# --- tables of what was counted -------------------------------------------------------------------------------------

def collectives(records):
    """How often all ranks wait for one another."""
    head = ["scene", "ranks", "a step", "a look adds", "a build adds", "mean of all steps", "LIGGGHTS, mean", "largest", "given to a rank in a step"]
    rows = []
    for r in of(records, "counts"):
        if r["ranks"] > 1:
            of_fix, of_engine = r["plug-in"], r["liggghts"]
            c = of_fix["collectives"]
            rows.append([f"{r['scene']}, {r['way']}", r["ranks"], *(number(c[k]) for k in ("step", "look", "build", "all")),
                         number(of_engine["collectives"]["all"]), size(of_fix["largest collective"]["all"]), size(of_fix["gathered"]["all"])])
    return head, rows


def messages(records):
    """To single ranks."""
    head = ["scene", "ranks", "messages a step", "partners, most", "received in a step, mean", "of the rank with most", "LIGGGHTS: messages", "partners, most", "received, mean"]
    rows = []
    for r in of(records, "counts"):
        if r["ranks"] > 1:
            of_fix, of_engine = r["plug-in"], r["liggghts"]
            rows.append([f"{r['scene']}, {r['way']}", r["ranks"], number(of_fix["messages"]["mean"]), of_fix["partners"]["most"], size(of_fix["received"]["mean"]),
                         size(of_fix["received"]["most"]), number(of_engine["messages"]["mean"]), of_engine["partners"]["most"], size(of_engine["received"]["mean"])])
    return head, rows


def shares(records):
    """How evenly the work lies on the ranks."""
    head = ["scene", "ranks", "granules", "exterior", "interface", "atoms of a rank, mean", "of the rank with most", "most / mean"]
    return head, [[f"{r['scene']}, {r['way']}", r["ranks"], f"{r['granules']:,}", f"{r['exterior']:,.0f}", f"{r['interface']:,.0f}", f"{r['atoms']['mean']:,.0f}",
                   f"{r['atoms']['most']:,.0f}", f"{r['atoms']['most'] / r['atoms']['mean']:.2f}"] for r in of(records, "counts")]


def corner(records):
    """Where cuts stay, and where `balance` moves them."""
    head = ["granules", "ranks", "cuts stay: mean", "largest", "cuts move: times", "mean after the first", "largest after it"]
    return head, [[f"{r['granules']:,}", r["ranks"], f"{r['still']['mean']:.2f}", f"{r['still']['most']:.2f}", r["moved"]["moves"], f"{r['moved']['mean']:.2f}",
                   f"{r['moved']['most']:.2f}"] for r in of(records, "balance")]


def median(values):
    ordered = sorted(values)
    return ordered[len(ordered) // 2] if len(ordered) % 2 else sum(ordered[len(ordered) // 2 - 1:][:2]) / 2


def times(records):
    """Of LIGGGHTS's loop."""
    head = ["scene", "ranks along", "granules", "runs", "LIGGGHTS, 1 rank", "2 ranks", "faster", "with the line, 1 rank", "2 ranks", "faster", "2 ranks, `balance`"]
    rows = []
    for r in of(records, "times"):
        t = {kind: median(values) for kind, values in r["seconds"].items()}
        rows.append([r["scene"], r["cut"], f"{r['granules']:,}", r["runs"], *(cell for kind in ("unculled", "culled") for cell in (
            f"{t[kind + ' 1']:.2f} s", f"{t[kind + ' 2']:.2f} s", f"{t[kind + ' 1'] / t[kind + ' 2']:.2f} times")), f"{t['balanced 2']:.2f} s"])
    return head, rows


# --- the model ------------------------------------------------------------------------------------------------------

def stored_cost():
    """Seconds that a stored granule costs a step, of two beds whose exterior granules are as many."""
    beds = sorted(of(kept_figures.read(SCALE), "asleep"), key=lambda r: r["granules"])
    small, large = beds[-2:]
    return max(0.0, large["loop_s"] - small["loop_s"]) / (large["granules"] - small["granules"]) / STRIKE_STEPS


def constants(records):
    """None where counts or times are missing."""
    counted, timed = [r for r in of(records, "counts", way="weak") if r["ranks"] > 1], of(records, "times", scene="impact")
    if not counted or not timed:
        return None
    t, widest = timed[0], counted[-1]
    alone, culled = median(t["seconds"]["unculled 1"]), median(t["seconds"]["culled 1"])
    exterior = alone / t["steps"] / t["granules"]
    interface = max(0.0, culled / t["steps"] - exterior * t["exterior"]) / t["interface"] if t["interface"] else 0.0
    who = ("plug-in", "liggghts")
    return model.Constants(exterior, interface, stored_cost(), tuple(widest[w]["collectives"]["all"] for w in who),
                           model.line_through([(r["ranks"], r["plug-in"]["gathered"]["all"]) for r in counted]),
                           tuple(widest[w]["messages"]["mean"] for w in who), tuple(widest[w]["sent"]["mean"] for w in who), widest["atoms"]["mean"])


def scenes(records):
    """What the model is asked for. The impact is that of ../scale on its largest beds, its interface granules half as many."""
    strong = [r for r in of(records, "counts", way="strong", scene="impact") if r["ranks"] > 1]
    uneven = strong[-1]["atoms"]["most"] / strong[-1]["atoms"]["mean"] if strong else 1.0
    each = 1e-2 * BILLION
    return [model.Scene("LIGGGHTS alone", BILLION, BILLION, 0, culled=False),
            model.Scene("1/100 exterior, evenly", BILLION, each, 0.5 * each),
            model.Scene(f"1/100 exterior, {uneven:.1f} times the mean on one rank", BILLION, each, 0.5 * each, uneven=uneven),
            model.Scene("one impact: 7,000 exterior, evenly", BILLION, 7e3, 3.5e3),
            model.Scene("one impact where four ranks meet", BILLION, 7e3, 3.5e3, places=4)]


def duration(seconds):
    return f"{seconds:.3g} s" if seconds >= 1 else f"{1e3 * seconds:.3g} ms"


def predicted(records):
    """Seconds of a step of 1e9 granules."""
    head = ["1,000,000,000 granules", *(f"{ranks:,} rank{'s' * (ranks > 1)}" for ranks in SHOWN_RANKS), "of that work", "bend"]
    known, rows = constants(records), []
    for scene in scenes(records) if known else []:
        end = model.parts(scene, SHOWN_RANKS[-1], known)
        at = model.bend(scene, known)
        rows.append([scene.name, *(duration(model.seconds(scene, ranks, known)) for ranks in SHOWN_RANKS), f"{end['work'] / sum(end.values()):.0%}",
                     f"{at:,} ranks" if at else f"beyond {model.MOST_RANKS:,}"])
    return head, rows


def measured(records):
    """The numbers that the model is made of."""
    known = constants(records)
    rows = [] if not known else [
        ["work of an exterior granule, a step", f"{1e9 * known.exterior:.0f} ns", "LIGGGHTS alone on one rank"],
        ["work of an interface granule, a step", f"{1e9 * known.interface:.0f} ns", "the impact with the line on one rank; the fix's own time is in it"],
        ["work of a stored granule, a step", f"{1e9 * known.stored:.2g} ns", "[scale](../scale/RESULTS.md): the two largest beds"],
        ["collectives a step: the fix, LIGGGHTS", ", ".join(map(number, known.collectives)), "weak impact, most ranks"],
        ["bytes that they give to each rank in a step", f"{known.gathered[0]:.0f} + {known.gathered[1]:.3g} x ranks", "weak impact, a line through all"],
        ["messages a step: the fix, LIGGGHTS", ", ".join(map(number, known.messages)), "weak impact, most ranks"],
        ["bytes of these", ", ".join(map(size, known.sent)), f"the same, at {known.sent_by:,.0f} atoms a rank; as the square root of that"],
        ["latency of a message; of a collective", f"{1e6 * model.LATENCY:.0f} µs; that times log2(ranks)", "assumed"],
        ["bandwidth of a rank", f"{model.BANDWIDTH / 1e9:.0f} GB/s", "assumed"]]
    return ["what", "value", "of"], rows


TABLES = {"collectives": collectives, "messages": messages, "shares": shares, "corner": corner, "times": times, "constants": measured, "model": predicted}


def table(name, records):
    page = pages.Page()
    page.table(*TABLES[name](records))
    return page.markdown()


def text_of(records):
    """All tables that have rows, to be printed."""
    return "\n".join(f"{name}\n\n{table(name, records)}" for name, rows_of in TABLES.items() if rows_of(records)[1])


def draw(records, file):
    """Time of a step against ranks, and where it bends."""
    known = constants(records)
    if not known:
        return
    figure, (top,) = plots.rows(1, (7, 4.5))
    ranks = [2**k for k in range(int(math.log2(model.MOST_RANKS)) + 1)]
    for scene in scenes(records):
        line, = top.plot(ranks, [model.seconds(scene, p, known) for p in ranks], label=scene.name)
        top.plot(ranks, [model.parts(scene, p, known)["work"] for p in ranks], color=line.get_color(), lw=0.8, ls=":")
        if (at := model.bend(scene, known)):
            top.plot([at], [model.seconds(scene, at, known)], "o", color=line.get_color())
    top.set(xscale="log", yscale="log", xlabel="ranks", ylabel="a step of 1e9 granules (s)")
    top.legend(fontsize=8, frameon=False)
    plots.save(figure, file)


def mark(name):
    return f"<!-- made of results.json: {name} -->"


def write(records):
    """Writes results.json, RESULTS.md and the picture; all texts are there before the first is written."""
    if not constants(records):
        raise errors.RunError("not published: counts on more than one rank, and times, are both needed")
    text = PAGE.read_text() if PAGE.exists() else TEMPLATE.format(**{name: f"{mark(name)}\n{pages.END}\n" for name in TABLES})
    for name in TABLES:
        text = pages.between_marks(PAGE, mark(name), table(name, records), text)
    draw(records, PICTURE)
    for file, content in ((RESULTS, kept_figures.text_of(records)), (PAGE, text)):
        pages.write(file, content)


def main():
    if not RESULTS.exists():
        raise errors.RunError(f"no {RESULTS.name} yet: scaling.py --publish makes it")
    write(json.loads(RESULTS.read_text()))
    return 0


if __name__ == "__main__":
    errors.command("published", main)
