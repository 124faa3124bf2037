"""The files that the user gets: the restart file, a deck to start from, its floor, and a note. All are whole, or not there."""
import shutil
import time
from pathlib import Path

from ..laid.floors import write_floor
from .plan import LEAST
from .pieces import Pieces

HERE = Path(__file__).resolve().parent


def deck(plan, floor=None):
    """The deck that reads the bed and runs. `floor`: the file of its floor, where it does not have its own name yet."""
    w = plan.wanted
    text = (HERE / "start.in").read_text().replace("BED.floor.stl", floor or "BED.floor.stl")
    for word, value in (("BED", w.out.stem), ("SKIN", plan.common()["skin"]), ("TYPES", str(w.material.types)),
                        ("LENGTH", f"{w.length:.12g}"), ("WIDTH", f"{w.width:.12g}"), ("MATERIAL", w.material.text)):
        text = text.replace(word, value)
    return text


def note(facts):
    return "".join(f"{name:32} {f'{value:.6g}' if isinstance(value, float) else value}\n" for name, value in facts.items())


def laid_bed(pieces, count, bed_floor, part, say):
    """Lays the bed, writes it to `part`. Returns what is told of it."""
    plan = pieces.plan
    tile, facts = pieces.poured("tile", count, plan.period)
    base, floor = pieces.rested(tile, facts)
    asleep, dozed = pieces.asleep(base, plan.base_sides(), floor)
    say(f"  laying {plan.copies[0]} x {plan.copies[1]} tiles")
    began = time.process_time()
    granules = pieces.laid(asleep, floor, bed_floor, part, deck(plan, bed_floor.name))
    weight, small = (n * facts["mass"] * plan.g for n in (plan.copies[0] * plan.copies[1], LEAST * LEAST))
    # a metre of its sides bears what one of the small bed bears
    by_sides = (small - dozed["floor load"]) * (plan.wanted.length + plan.wanted.width) / sum(plan.base_sides())
    return {"granules": granules, **heights(facts), "weight (N)": weight, "load on the floor (N)": weight - by_sides,
            "made": f"of {plan.copies[0]} x {plan.copies[1]} tiles, {plan.period[0]:.5g} x {plan.period[1]:.5g} m, of {count} granules",
            "laying, on a core (s)": round(time.process_time() - began, 1)}


def poured_bed(pieces, count, bed_floor, part):
    """The same of a bed that is poured whole."""
    sides = pieces.plan.wanted.length, pieces.plan.wanted.width
    bed, facts = pieces.poured("box", count, sides, walls=True)
    asleep, dozed = pieces.asleep(bed, sides, bed_floor)
    shutil.copyfile(asleep, part)
    return {"granules": count, **heights(facts), "weight (N)": facts["mass"] * pieces.plan.g, "load on the floor (N)": dozed["floor load"],
            "made": "poured as a whole"}


def heights(facts):
    return {"mean height of the surface (m)": facts["height"], "solid fraction of the bulk": facts["solid fraction"]}


def make(plan, folder, launcher, say):
    """Makes the bed and its files; returns what the note says."""
    began = time.monotonic()
    w, pieces = plan.wanted, Pieces(folder, plan, launcher, say)
    count = pieces.count()
    bed_floor, part = pieces.folder / "floor.stl", pieces.folder / "bed.part"
    write_floor(bed_floor, (w.length, w.width), plan.beyond, pieces.element)
    told = laid_bed(pieces, count, bed_floor, part, say) if plan.laid else poured_bed(pieces, count, bed_floor, part)
    told.update({"box (m)": f"{w.length:.12g} x {w.width:.12g}, LIGGGHTS's box {plan.top:.4g} high", "seed": w.seed,
                 "seconds": round(time.monotonic() - began)})
    for file, text in ((w.out.with_suffix(".in"), deck(plan)), (w.out.with_suffix(".txt"), note(told))):
        fresh = pieces.folder / f"{file.name}.part"
        fresh.write_text(text)
        fresh.replace(file)
    bed_floor.replace(w.out.with_suffix(".floor.stl"))
    part.replace(w.out)
    return told
