"""The rung of impacts: what is compared, how near it must be, and the tables."""
import dataclasses

import numpy as np

import contact_law
import impacts
from chung_ooi import COLUMN, TESTS
from figures import Bars, number
from impacts import FREE, LOCKED, STATES

STEPS, FINE = 100, 400   # time steps in the shortest contact of a test
FEW_BLOWS = (0, -1)      # with --few-steps; and what is then done for some tests alone
FEW = {"fine": ("1", "3", "5", "no slip"), "keen": ("1", "4", "7"), "heavy": ("5",)}
SAME = 1e-12             # of the speed of the blow
SAME_BODY = 1e-11        # of it: a body turns by its own integrator
LAW_MARGIN = {STEPS: 0.02, FINE: 0.005}  # of the speed of the blow
SHRINKS = 0.6            # from STEPS to FINE; a scheme of first order gives a quarter
ROUNDING = 1e-6          # where the law itself is no better known
MARGINS = {  # of closed forms, at FINE steps
    "force": 1e-8,       # at the depth that LIGGGHTS has, which is a difference of places
    "largest force": 1e-4, "depth": 1e-4, "duration": 1e-4, "rebound": 1e-4,
    "damped depth": 0.01, "damped duration": 0.01, "damped rebound": 0.01,  # LIGGGHTS damps by a velocity half a step old
    "sliding": 1e-6, "turning": 1e-6,
    "no slip": 0.01,     # the closed form takes the depth for nothing beside the radius
}


def shortened(test):
    blows = tuple(test.blows[k] for k in FEW_BLOWS)
    return dataclasses.replace(test, blows=blows, watched=tuple(range(len(blows))) if test.watched else ())


def off(test, scene, gained, due):
    """By how much each station's gains differ, as a share of the blow's speed; spins as speeds of the surface."""
    radii = np.array([[1, 1, test.radius], [1, 1, test.radius if test.wall else test.other_radius]])
    return np.abs((gained - due) * radii).max(axis=(1, 2)) / [test.scale(s.blow) for s in scene.stations]


def by_law(tests):
    """What each blow of each test gives to both by the law, the target alone and as a body; all in one go, for that takes seconds."""
    blows = [(name, blow, granules) for granules in (1, COLUMN) for name, test in tests.items() for blow in test.blows]
    gained = contact_law.integrated([tests[name].pair(b, granules) for name, b, granules in blows], [b.across for _, b, _ in blows],
                                    [(b.spin, b.other_spin) for _, b, _ in blows])
    return dict(zip(blows, gained))


def of_state(scene, values, states):
    return max(float(v) for s, v in zip(scene.stations, values) if s.state in states)


def one(name, test, law, place, few):
    """A test's figures; of each pair the first is at STEPS, the second at FINE, if that is done."""
    def done(what):
        return not few or name in FEW[what]

    def run(kind, states, steps=STEPS):
        scene = impacts.run(test, kind, states, steps, place, name)
        return scene, *scene.gained()

    def due(scene, granules=1):
        return np.array([law[name, s.blow, granules] for s in scene.stations])
    without, alone, _ = run("unculled", STATES)
    by_steps = [(without, alone)] + ([run("unculled", ("exterior",), FINE)[:2]] if done("fine") else [])
    found = {"blows": len(test.blows), "law": [off(test, scene, gained, due(scene)).max() for scene, gained in by_steps],
             "closed": [closed_forms(test, scene, gained) for scene, gained in by_steps]}
    momenta = []

    def kept(scene, momentum):
        if not test.wall:
            momenta.extend(np.abs(momentum).max(axis=1) / [test.mass(s.blow) * test.scale(s.blow) for s in scene.stations])
    for kind, states in (("culled", STATES), ("keen", LOCKED))[:2 if done("keen") else 1]:
        scene, gained, momentum = run(kind, states)
        twin = alone[[k for k, s in enumerate(without.stations) if s.state in states]]
        differs = off(test, scene, gained, twin)
        if kind == "culled":
            found["free"] = of_state(scene, differs, FREE)
        found[kind] = of_state(scene, differs, LOCKED)
        allowed = [test.lost(s.blow, scene.dt, kind) for s in scene.stations]
        found[f"{kind} allowed"] = of_state(scene, allowed, LOCKED)
        found[f"{kind} share"] = max(float(d / a) for s, d, a in zip(scene.stations, differs, allowed) if s.state in LOCKED)
        kept(scene, momentum)
    scene, gained, momentum = run("held", ("interface",))
    kept(scene, momentum)
    found["held law"] = off(test, scene, gained, due(scene, COLUMN)).max()
    if done("heavy") and all(b.restitution == 1 for b in test.blows):  # LIGGGHTS damps by the masses of granules
        heavy, heavily, _ = run("heavy", ("exterior",))
        found["held heavy"] = off(test, scene, gained, heavily).max()
    if momenta:
        found["momentum"] = max(momenta)
    return found


def closed_forms(test, scene, gained):
    """Largest relative differences from closed forms, by what they are of."""
    found = {}

    def note(what, value, due):
        found[what] = max(found.get(what, 0.0), abs(value / due - 1))
    for s, rows in scene.followed().items():
        pair, touching = test.pair(s.blow), rows[:, 1] > 0
        damped = "damped " if s.blow.restitution < 1 else ""
        first, last = np.flatnonzero(touching)[[0, -1]]
        step, depth, force = rows.T

        def crossing(a, b):
            return step[a] + depth[a] / (depth[a] - depth[b])
        note(damped + "depth", depth.max(), pair.largest_depth)
        note(damped + "duration", (crossing(last, last + 1) - crossing(first - 1, first)) * scene.dt, pair.duration)
        if s.blow.restitution == 1:
            deep = touching & (depth > 0.05 * pair.largest_depth)
            found["force"] = max(found.get("force", 0.0), float(np.abs(force[deep] / (pair.stiffness * depth[deep]**1.5) - 1).max()))
            note("largest force", force.max(), pair.largest_force)
    for s, (of_target, _) in zip(scene.stations, gained):
        b, pair = s.blow, test.pair(s.blow)
        damped = "damped " if b.restitution < 1 else ""
        if b.across == 0 and b.spin == 0 and b.other_spin == 0:
            note(damped + "rebound", of_target[0] * test.mass(b) / pair.mass / b.speed - 1, pair.rebound)
        if not test.wall or b.restitution < 1:
            continue
        slip = test.slip(b)
        if b.friction > 1:
            note("no slip", (slip + of_target[1] - test.radius * of_target[2]) / slip, pair.no_slip)
        elif slips_throughout(pair, slip):
            impulse, nearer = pair.sliding()
            note("sliding", of_target[1], -impulse / test.mass(b))
            note("turning", of_target[2], (impulse * test.radius - nearer) / pair.inertias[0])
    return found


def slips_throughout(pair, slip):
    """Without damping: from the first, and still at the end."""
    return slip / pair.speed > max(pair.friction * pair.modulus / (6 * pair.shear_modulus), 7 * pair.friction) * 1.01


def faults(name, found):
    bars = Bars(f"test {name}")
    hold = bars.hold
    hold(found["free"], SAME, "exterior or restored, differs from the run without the line by")
    hold(found["culled share"], 1, "interface or fetched, default tolerance: difference over what the tolerance may take")
    hold(found["law"][0], LAW_MARGIN[STEPS], f"LIGGGHTS differs from the law at {STEPS} steps by")
    for finer in found["law"][1:]:
        hold(finer, LAW_MARGIN[FINE], f"LIGGGHTS differs from the law at {FINE} steps by")
        hold(finer, max(ROUNDING, SHRINKS * found["law"][0]), f"LIGGGHTS at {FINE} steps is not nearer to the law than at {STEPS}:")
    hold(found["held law"], LAW_MARGIN[STEPS], "a body that is struck differs from the law by")
    for what, bar, says in (("keen share", 1, "interface or fetched, wakes at once: difference over what the first step may take"),
                            ("held heavy", SAME_BODY, "a body that is struck differs from a sphere of its mass by"),
                            ("momentum", SAME_BODY, "momentum changes by")):
        if what in found:
            hold(found[what], bar, says)
    for finer in found["closed"][1:]:
        for what, value in finer.items():
            hold(value, MARGINS[what], f"{what} differs from its closed form by")
    return bars.missed


def climb(place, few):
    report = {"tests": {}, "wrong": []}
    tests = {name: shortened(test) if few else test for name, test in TESTS.items()}
    law = by_law(tests)
    for name, test in tests.items():
        found = one(name, test, law, place, few)
        report["tests"][name] = found
        report["wrong"] += faults(name, found)
    return report


def page(report, page):
    tests = {name: (TESTS[name], of) for name, of in report["tests"].items()}
    page.heading(2, "Impacts")
    page.text("Largest differences over all blows of a test, as shares of the speed of the blow. Spins count as speeds of the surface.")
    page.heading(3, "LIGGGHTS alone")
    page.table(["test", "what", "blows", f"from the law, {STEPS} steps in the shortest contact", f"{FINE} steps"], [
        [name, test.title, of["blows"], *at_both(of["law"])] for name, (test, of) in tests.items()])
    page.heading(3, "With the line, from the run without it")
    page.text(f"{STEPS} steps. Beside a difference stands what it may be: the impulse that the body takes until the target wakes.")
    page.table(["test", "exterior, restored", "interface, fetched, woken at once", "may be", "the same, default tolerance", "may be"], [
        [name, number(of["free"]), *(number(of[what]) if what in of else "-" for what in ("keen", "keen allowed")), number(of["culled"]),
         bound(of["culled allowed"])]
        for name, (_, of) in tests.items()])
    page.heading(3, "A target that does not wake")
    page.text("From the law, and from LIGGGHTS without the line, for a sphere of five times the mass. LIGGGHTS damps by the masses of "
              "granules, so the second is for tests without damping. The last column is the change of the momentum of all.")
    page.table(["test", "from the law", "from LIGGGHTS", "momentum"], [
        [name, number(of["held law"]), *(number(of[what]) if what in of else "-" for what in ("held heavy", "momentum"))]
        for name, (_, of) in tests.items()])
    page.heading(2, "Closed forms")
    page.text("LIGGGHTS without the line, largest relative difference over the blows that have the closed form.")
    page.table(["test", "closed form of", f"{STEPS} steps", f"{FINE} steps"], [
        [name, what, *at_both([at[what] for at in of["closed"]])] for name, (_, of) in tests.items() for what in of["closed"][0]])


def at_both(values):
    """Of STEPS and of FINE, if that was done."""
    return ([number(value) for value in values] + ["-"])[:2]


def bound(value):
    """One that says less than that the blow is lost as a whole."""
    return number(value) if value < 1 else "no bound"
