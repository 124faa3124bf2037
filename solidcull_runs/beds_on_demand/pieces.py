"""The pieces that a bed is laid of, each made once and kept: the same call goes on from those that are there."""
import json
import re
import time
from pathlib import Path

from .. import beds, decks, engine, logs
from ..dumps import read_final
from ..errors import RunError
from ..laid import beds as laid_beds
from ..laid import tiles
from ..laid.floors import Floor, write_floor
from ..laid.sources import Source
from ..laid.walls import box_of, number_of
from . import measures
from .plan import LEAST

HERE = Path(__file__).resolve().parent
ALL = (LEAST, LEAST)


class Pieces:
    """In the folder `folder`, of a Plan."""

    def __init__(self, folder, plan, launcher, say):
        self.folder, self.plan, self.say = Path(folder), plan, say
        self.folder.mkdir(exist_ok=True)
        (self.folder / "material.in").write_text(plan.wanted.material.text)
        (self.folder / "sizes.in").write_text(plan.sizes_deck())
        self.launcher = launcher
        self.cores = 0.0  # s that LIGGGHTS had a core
        self.element = max(plan.period) / 2 if plan.laid else max(plan.wanted.length, plan.wanted.width) / 6

    def recipe(self, deck, variables, *more):
        text = decks.without_comments((HERE / deck).read_text().splitlines())
        return "\n".join([json.dumps(variables), text, self.plan.wanted.material.text, self.plan.sizes_deck(), *more])

    def run(self, deck, name, variables):
        process = engine.Process(self.launcher, HERE / deck, self.folder, self.folder / f"{name}.log", variables)
        text = process.wait()
        self.cores += process.cpu
        return text

    def made(self, name, recipe, make):
        """The piece `name`.restart, and what make(part) said of it, kept beside it."""
        facts = self.folder / f"{name}.json"

        def make_and_note(part):
            began, cores = time.monotonic(), self.cores + time.process_time()
            found = make(part)
            spent = {"seconds": time.monotonic() - began, "on a core": self.cores + time.process_time() - cores}
            facts.write_text(json.dumps({**found, **{name: round(s, 1) for name, s in spent.items()}}) + "\n")
        file = beds.made(self.folder / f"{name}.restart", recipe, make_and_note, say=self.say)
        return file, json.loads(facts.read_text())

    def poured(self, name, granules, sides, walls=False):
        """What pour.in makes. Facts: granules, height, solid fraction, mass, and what a metre of a side would bear."""
        variables = self.plan.pour(granules, sides, walls)

        def make(part):
            dump = self.folder / f"{name}.dump"
            text = self.run("pour.in", name, {**variables, "restart": part, "dump": dump})
            last = logs.parse_log(text)[-1]
            row = dict(zip(last.columns, last.rows[-1]))
            if row["Atoms"] != granules:
                raise RunError(f"{name}: {row['Atoms']:.0f} of {granules} granules were poured (log: {self.folder / name}.log); "
                               "a smaller timestep may help")
            bed = read_final(dump)
            high = measures.height(bed, sides, self.plan.d)
            return {"granules": granules, "height": high, "solid fraction": measures.solid_fraction(bed, sides[0] * sides[1], high),
                    "mass": float(bed["mass"].sum()), "pushes": [row["pushx"], row["pushy"]]}
        return self.made(name, self.recipe("pour.in", variables), make)

    def count(self):
        """Granules of a tile, or of the box."""
        plan, asked = self.plan, self.plan.wanted.granules
        if asked:
            return max(1, round(asked / (plan.copies[0] * plan.copies[1]))) if plan.laid else asked
        _, pilot = self.poured("pilot", plan.pilot_granules(), [plan.pilot_edge()] * 2)
        return plan.granules_on(plan.area(), pilot["height"])

    def rested(self, tile, facts):
        """The tile, LEAST times LEAST of it, settled at four sides; its floor."""
        plan, sides = self.plan, self.plan.base_sides()
        floor = self.folder / "base.floor.stl"
        variables = plan.rest(sides, facts["pushes"])

        def make(part):
            write_floor(floor, sides, plan.beyond, self.element)
            laid = self.folder / "tiles.part"
            tiles.lay(tiles.Bed(tile, (1, 1), plan.period, 0, True), laid, ALL, plan.period, plan.margin, plan.top, plan.beyond)
            text = self.run("rest.in", "base", {**variables, "tiles": laid.name, "floor": floor.name, "restart": part.name})
            laid.unlink()
            said = re.findall(r"^the sides bear (\S+) N, and are to bear (\S+) N", text, re.M)[-1]
            return {"sides bear (N)": float(said[0]), "are to bear (N)": float(said[1])}
        file, _ = self.made("base", self.recipe("rest.in", variables, beds.recipe_of(tile)), make)
        return file, floor

    def asleep(self, bed, sides, floor):
        """The culled restart file of a bed, with no granule awake. Facts: what its floor bears."""
        variables = self.plan.doze(sides)

        def make(part):
            text = self.run("doze.in", "asleep", {**variables, "bed": bed.name, "floor": floor.name, "restart": part.name})
            awake = float(re.findall(r"^awake at the end: (\S+)", text, re.M)[-1])
            if awake:
                raise RunError(f"the bed does not come to rest: {awake:.0f} granules are awake after {variables['rounds']} rounds of "
                               f"{variables['dozesteps']} steps; take a smaller timestep or more friction (log: {self.folder / 'asleep.log'})")
            last = [t for t in logs.parse_log(text) if "onfloor" in t.columns][-1]
            return {"floor load": last.rows[-1][last.columns.index("onfloor")]}
        return self.made("asleep", self.recipe("doze.in", variables, beds.recipe_of(bed), engine.hash_of_fix(self.launcher)), make)

    def laid(self, asleep, floor, new_floor, part, deck):
        """Writes the culled file of all tiles, for the walls of a deck in the folder; how many granules it holds."""
        plan = self.plan
        source = Source(asleep, ALL, plan.period, plan.margin, Floor(floor))
        walls = number_of(deck, box_of(source.sides(plan.copies), 2 * source.radius, plan.top), self.launcher, self.folder)
        return laid_beds.lay(source, part, plan.copies, Floor(new_floor), plan.top, walls=walls)
