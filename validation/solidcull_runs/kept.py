"""Figures that are kept with the sources: records in a results file, one a line, and the parts of pages that are made of them.

validation/results.json has a record for each case, scene and mode, by `validation/run.sh --publish`. validation/scale/results.json
has one for each bed and tool, by scale.py and tools.py with `--publish`.
"""
import json
import re
import statistics
from pathlib import Path

from . import judgement
from .errors import RunError
from .points import LIVE, SLEEP

END = "<!-- end -->"


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


def write(file, text):
    """Whole or not at all."""
    part = Path(file).with_suffix(".part")
    part.write_text(text)
    part.rename(file)


def between_marks(file, begin, table, text=None):
    """The text of a page with a table between its lines `begin` and END. `text`: the page's, if not that of the file."""
    text = Path(file).read_text() if text is None else text
    found = re.search(rf"({re.escape(begin)}\n).*?({re.escape(END)})", text, re.S)
    if not found:
        raise RunError(f"{file} has no lines '{begin}' and '{END}' to put a table between")
    return text[:found.end(1)] + table + text[found.start(2):]


def figure_off(metric, verdict, unculled):
    """How far a figure is off by the line, and how far the unculled runs lie apart: in per cent of their mean, and in margins."""
    values = list(judgement.values_of(unculled, metric["name"]).values())
    mean = sum(values) / len(values)

    def percent(part):
        return round(100 * abs(part / mean), 2) if mean else None
    return {"figure": metric["name"], "percent": percent(verdict.difference), "margins": round(verdict.in_margins, 2),
            "scatter": percent(max(values) - min(values)), "verdict": verdict.word}


def records_of(result):
    """A case's records: each scene in each mode, at the defaults. Times in s, of a core in the loop; `moving`: the granules over
    those that move; `off`: its figures, the farthest off in margins first. A mode that was not run has neither speed nor figures."""
    records = []
    for name, scene in result["scenes"].items():
        judged, unculled = judgement.judge(result, scene), judgement.unculled_of(scene)
        main = scene is judgement.main_scene(result)
        moving = result["bound"]["N/N_moving"] if main and result["bound"] else None
        seconds = round(statistics.median(r["seconds"] for r in unculled["runs"]), 1) if unculled else None
        for mode in (SLEEP, LIVE):
            j = judgement.default_of(judged, mode)
            record = {"case": result["case"], "scene": name, "main": main, "granules": scene["granules"], "moving": moving and float(f"{moving:.3g}"),
                      "unculled_s": seconds, "mode": mode, "faster": None, "verdict": None, "off": []}
            if j:
                off = [figure_off(m, j.verdicts[m["name"]], unculled) for m in result["metrics"]]
                off.sort(key=lambda f: f["figure"] != j.worst)
                record.update(faster=round(j.speed_up, 2), verdict=j.word, off=off)
            records.append(record)
    return records
