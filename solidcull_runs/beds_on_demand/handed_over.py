"""The files that the user gets: the restart file, a deck to start from, its floor, and a note. All are whole, or not there."""
import shutil
import time
from pathlib import Path

from ..laid.floors import write_floor
from .plan import LEAST
from .pieces import Pieces

HERE = Path(__file__).resolve().parent


def deck(plan):
    """The deck that reads the bed and runs."""
    w = plan.wanted
    text = (HERE / "start.in").read_text()
    for word, value in (("BED", w.out.stem), ("SKIN", plan.common()["skin"]), ("TYPES", str(w.material.types)),
                        ("LENGTH", f"{w.length:.12g}"), ("WIDTH", f"{w.width:.12g}"), ("MATERIAL", w.material.text)):
        text = text.replace(word, value)
    return text


def note(plan, facts):
    return "".join(f"{name:32} {value}\n" for name, value in facts.items())


def floor_load(plan, tile, dozed):
    """Of the bed that is laid (N): its sides bear on each metre what those of the small bed bear."""
    g, w = plan.g, plan.wanted
    small = LEAST * LEAST * tile["mass"] * g
    by_sides = (small - dozed["floor load"]) / sum(plan.base_sides()) * (w.length + w.width)
    return plan.copies[0] * plan.copies[1] * tile["mass"] * g - by_sides


def make(plan, folder, launcher, say):
    """Makes the bed and its files; returns the facts of the note."""
    began = time.monotonic()
    w, pieces = plan.wanted, Pieces(folder, plan, launcher, say)
    count = pieces.count()
    bed_floor, part = pieces.folder / "floor.stl", pieces.folder / "bed.part"
    write_floor(bed_floor, (w.length, w.width), plan.beyond, pieces.element)
    if plan.laid:
        tile, facts = pieces.poured("tile", count, plan.period)
        base, floor = pieces.rested(tile, facts)
        asleep, dozed = pieces.asleep(base, plan.base_sides(), floor)
        say(f"  laying {plan.copies[0]} x {plan.copies[1]} tiles")
        laying = time.process_time()
        granules = pieces.laid(asleep, floor, bed_floor, part)
        load, weight = floor_load(plan, facts, dozed), plan.copies[0] * plan.copies[1] * facts["mass"] * plan.g
    else:
        bed, facts = pieces.poured("box", count, (w.length, w.width), walls=True)
        asleep, dozed = pieces.asleep(bed, (w.length, w.width), bed_floor)
        shutil.copyfile(asleep, part)
        granules, load, weight = count, dozed["floor load"], facts["mass"] * plan.g
    told = {"granules": granules, "box (m)": f"{w.length:g} x {w.width:g}, LIGGGHTS's box {plan.top:.4g} high",
            "mean height of the surface (m)": f"{facts['height']:.4g}", "solid fraction of the bulk": f"{facts['solid fraction']:.4f}",
            "weight (N)": f"{weight:.6g}", "load on the floor (N)": f"{load:.6g}{', computed of the bed of 3 x 3 tiles' if plan.laid else ''}",
            "made": f"of {plan.copies[0]} x {plan.copies[1]} tiles, {plan.period[0]:.5g} x {plan.period[1]:.5g} m, of {count} granules"
            if plan.laid else "poured as a whole", "seed": w.seed, "seconds": f"{time.monotonic() - began:.0f}"}
    texts = {w.out.with_suffix(".in"): deck(plan), w.out.with_suffix(".txt"): note(plan, told)}
    for file, text in texts.items():
        fresh = pieces.folder / f"{file.name}.part"
        fresh.write_text(text)
        fresh.replace(file)
    if plan.laid:
        told["laying, on a core (s)"] = round(time.process_time() - laying, 1)
    bed_floor.replace(w.out.with_suffix(".floor.stl"))
    part.replace(w.out)
    return told
