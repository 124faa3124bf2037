"""The rung of a column under its own weight: the load at each contact, and at the floor, awake, asleep and restored."""
import math

import numpy as np

import ladder_runs
from figures import Bars, number
from solidcull_runs import dumps, logs, meshes

GRANULES, FEW = 50, 10
DIAMETER, DENSITY, YOUNG, POISSON, GRAVITY = 0.002, 2500, 5e6, 0.3, 9.81
DT, SKIN = 2e-5, 0.0004
REST = 2000         # steps, asleep
SETTLE = 40         # times that a wave takes up and down
KINDS = {"without the line": None, "asleep": "exterior sleep", "store compact": "store compact"}
EXACT = 1e-9        # of a load: the overlap is a difference of places
ROUNDED = 1e-4      # with store compact: places are rounded to 1.5e-8 d, and the least overlap is 5e-4 d
FLOOR = 1e-7        # of the floor's load, which is printed with 8 digits
ASLEEP = 3          # weights: the tolerance


class Column:
    def __init__(self, granules):
        self.granules, radius = granules, DIAMETER / 2
        self.mass = DENSITY * math.pi * DIAMETER**3 / 6
        self.weight = self.mass * GRAVITY
        modulus = YOUNG / (2 * (1 - POISSON**2))
        self.stiffness = [4 / 3 * modulus * math.sqrt(r) for r in (radius, radius / 2)]  # at the floor, between two

    def stiffness_at(self, contacts):
        """From the floor on."""
        return np.where(np.arange(contacts) == 0, *self.stiffness)

    def due(self, granules):
        """Load at each contact, from the floor on (N)."""
        return (granules - np.arange(granules)) * self.weight

    def places(self, granules):
        depths = (self.due(granules) / self.stiffness_at(granules))**(2 / 3)
        return np.cumsum([DIAMETER / 2] + [DIAMETER] * (granules - 1)) - np.cumsum(depths)

    def loads(self, places):
        """Hertz's, of the depths."""
        gaps = np.diff(places, prepend=-DIAMETER / 2)
        return self.stiffness_at(len(places)) * (DIAMETER - gaps)**1.5

    def way_down(self):
        """Of a long wave (s)."""
        loads = self.due(self.granules)
        return float(np.sum(np.sqrt(self.mass * (loads / self.stiffness_at(self.granules))**(2 / 3) / (1.5 * loads))))

    def write(self, data, floor):
        places = self.places(self.granules)
        data.write_text(f"column\n\n{self.granules} atoms\n1 atom types\n\n-0.01 0.01 xlo xhi\n-0.01 0.01 ylo yhi\n"
                        f"-0.001 {places[-1] + 0.02:g} zlo zhi\n\nAtoms\n\n" + "".join(
                            f"{k + 1} 1 {DIAMETER:.17g} {DENSITY} 0 0 {z:.17g}\n" for k, z in enumerate(places)))
        meshes.write_stl(floor, meshes.grid((-0.01, -0.01, 0), (0.02, 0, 0), (0, 0.02, 0), 1, 1))


def loads_of(column, file):
    _, _, rows = next(dumps.snapshots(file))
    return column.loads(rows[np.argsort(rows[:, 0]), 1])


def run(column, kind, place):
    base = f"column-{kind.replace(' ', '-')}"
    data, floor, places = (place / name for name in ("column.data", "column.stl", base))
    column.write(data, floor)
    top = column.places(column.granules)[-1] + DIAMETER - (column.weight / column.stiffness[1])**(2 / 3)
    slow = math.pi / 2 / column.way_down()  # 1/s: the lowest tone
    text = ladder_runs.run("column.in", KINDS[kind] is not None, base, place, {
        "data": data, "floor": floor, "places": places, "young": YOUNG, "poisson": POISSON, "dt": DT, "skin": SKIN, "gravity": GRAVITY,
        "diameter": DIAMETER, "density": DENSITY, "rest": REST, "settle": round(SETTLE * column.way_down() / DT), "top": f"{top:.17g}",
        "more": column.granules + 1, "drag": 2 * column.mass * slow, "culling": KINDS[kind] or ""})
    tables = [t for t in logs.parse_log(text) if t.counted][:3]
    found = {}
    for name, table in zip(("asleep", "laden", "settled"), tables):
        rows = np.array(table.rows)
        found[name] = {"contacts": loads_of(column, f"{places}.{name}"), "floor": np.abs(rows[:, table.column("v_load")]),
                       "interior": rows[-1, table.column("f_cull[3]")] if table.column("f_cull[3]") else 0}
    return found


def figures(column, found):
    """How far contacts and floor are from what is due, after each of the three runs."""
    report = {}
    for phase, of in found.items():
        granules = column.granules + (phase != "asleep")
        due = column.due(granules)
        report[phase] = {"contacts": float(np.abs(of["contacts"] / due - 1).max()),
                         "contacts in weights": float(np.abs(of["contacts"] - due).max() / column.weight),
                         "floor": float(abs(of["floor"][-1] / due[0] - 1)), "granules": granules, "interior": int(of["interior"])}
    # in the row of its step 0 LIGGGHTS counts the load of a mesh twice
    report["asleep"]["floor, at any step"] = float(np.abs(found["asleep"]["floor"][1:] / (column.granules * column.weight) - 1).max())
    return report


def faults(kind, phases):
    bars = Bars(f"column, {kind}")
    asleep, laden, settled = (phases[phase] for phase in ("asleep", "laden", "settled"))
    bars.hold(asleep["contacts"], ROUNDED if kind == "store compact" else EXACT, "a contact's load differs by")
    bars.hold(asleep["floor, at any step"], FLOOR, "the floor's load differs by")
    bars.hold(settled["contacts"], EXACT, "restored and at rest, a contact's load differs by")
    bars.hold(settled["floor"], FLOOR, "restored and at rest, the floor's load differs by")
    if KINDS[kind]:
        bars.hold(laden["floor"], FLOOR, "with one more on top, the floor's load differs by")
        bars.hold(laden["contacts in weights"], ASLEEP, "with one more on top, a contact's load differs in weights by")
        for phase in (asleep, laden):
            bars.hold(phase["granules"] - phase["interior"], 2, "granules that are not stored:")
    return bars.missed


def climb(place, few):
    column = Column(FEW if few else GRANULES)
    report = {"granules": column.granules, "kinds": {kind: figures(column, run(column, kind, place)) for kind in KINDS}}
    return {**report, "wrong": [line for kind, phases in report["kinds"].items() for line in faults(kind, phases)]}


def page(report, page):
    page.heading(2, "A column under its own weight")
    page.text(f"{report['granules']} granules. Largest relative difference from (n - k) m g.")
    page.table(["run", "contacts, asleep", "floor", "one more on top: floor", "contacts (m g)", "restored, at rest: contacts", "floor"], [
        [kind, number(of["asleep"]["contacts"]), number(of["asleep"]["floor, at any step"]),
         number(of["laden"]["floor"]) if KINDS[kind] else "swings", f"{of['laden']['contacts in weights']:.2f}" if KINDS[kind] else "swings",
         number(of["settled"]["contacts"]), number(of["settled"]["floor"])] for kind, of in report["kinds"].items()])
