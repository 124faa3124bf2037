"""Figures that are kept with the sources: records in a results file, one a line.

validation/results.json has a record for each case, scene and mode, by `validation/run.sh --publish`. validation/scale/results.json
has one for each bed and tool, by scale.py and tools.py with `--publish`.
"""
import json
import statistics
from pathlib import Path

from ..errors import RunError
from . import pages, sequential, verdicts
from .points import LIVE, SLEEP


def read(file):
    """The records of a results file; RunError where it is no such thing."""
    try:
        return json.loads(Path(file).read_text())
    except OSError as e:
        raise RunError(f"cannot read {file}: {e.strerror}; take it from the sources") from None
    except ValueError as e:
        raise RunError(f"{file} is no JSON ({e}); take it from the sources, or publish anew") from None


def text_of(records):
    return "[\n" + ",\n".join(json.dumps(r, ensure_ascii=False) for r in records) + "\n]\n"


def keep(folder, begin, text, records):
    """Records in results.json, and the text that is made of them in RESULTS.md, behind its line `begin`."""
    page = pages.between_marks(folder / "RESULTS.md", begin, text)
    pages.write(folder / "results.json", text_of(records))
    pages.write(folder / "RESULTS.md", page)


def figure_off(metric, verdict, unculled):
    """How far a figure is off by the line, and how far the first unculled runs lie apart: in per cent of their mean, and in margins.
    As many of them as the first look has, for more would lie farther apart."""
    values = list(verdicts.values_of(unculled, metric["name"]).values())
    first = values[:sequential.LOOKS[0]]
    mean = sum(values) / len(values)

    def percent(part):
        return round(100 * abs(part / mean), 2) if mean else None
    figure = {"figure": metric["name"], "percent": percent(verdict.difference), "margins": round(verdict.in_margins, 2),
              "scatter": percent(max(first) - min(first)), "verdict": verdict.word}
    if verdict.pairs:
        unit, scale = ("%", 100 / abs(mean)) if metric["relative"] and mean else (metric["unit"], 1)
        low, high, by = (float(f"{scale * x:.3g}") for x in (verdict.low, verdict.high, verdict.difference))
        reach = max(abs(verdict.low), abs(verdict.high)) / verdict.margin if verdict.margin else None
        figure |= {"pairs": verdict.pairs, "unit": unit, "low": low, "high": high, "by": by, "reach": reach and round(reach, 2)}
    return figure


def told(figure, show=None):
    """The verdict on a figure, in words. With pairs that were added until it was decided: within what the runs are equal, or by how
    much they differ; in per cent of the unculled mean, or in the figure's unit where its margin is. `show`: such a number as text."""
    show = show or (lambda number: f"{number:.2g} {figure['unit']}")
    if "pairs" not in figure:
        return figure["verdict"]
    if figure["verdict"] == verdicts.SAME:
        return f"equal within {show(max(abs(figure['low']), abs(figure['high'])))}"
    if figure["verdict"] == verdicts.OTHER:
        return f"differs by {show(abs(figure['by']))}"
    return f"not decided after {figure['pairs']} pairs: {figure['low']:+.2g} to {figure['high']:+.2g} {figure['unit']}"


def most_telling(record):
    """Of a record's figures that have its verdict, the one that is farthest off in margins, interval and all."""
    alike = [f for f in record["off"] if f["verdict"] == record["verdict"]]
    return max(alike, key=lambda f: f.get("reach") or f["margins"], default=record["off"][0])


def records_of(result):
    """A case's records: each scene in each mode, at the defaults. Times in s, of a core in the loop; `moving`: the granules over
    those that move; `off`: its figures, the farthest off in margins first. A mode that was not run has neither speed nor figures."""
    records = []
    for name, scene in result["scenes"].items():
        judged, unculled = verdicts.judge(result, scene), verdicts.unculled_of(scene)
        main = scene is verdicts.main_scene(result)
        moving = result["bound"]["N/N_moving"] if main and result["bound"] else None
        seconds = round(statistics.median(r["seconds"] for r in unculled["runs"]), 1) if unculled else None
        for mode in (SLEEP, LIVE):
            j = verdicts.default_of(judged, mode)
            record = {"case": result["case"], "scene": name, "main": main, "granules": scene["granules"], "moving": moving and float(f"{moving:.3g}"),
                      "unculled_s": seconds, "mode": mode, "faster": None, "verdict": None, "off": []}
            if j:
                off = [figure_off(m, j.verdicts[m["name"]], unculled) for m in result["metrics"]]
                off.sort(key=lambda f: f["figure"] != j.worst)
                record.update(faster=round(j.speed_up, 2), verdict=j.word, off=off)
            records.append(record)
    return records
