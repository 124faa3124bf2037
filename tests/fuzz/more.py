"""What decks do besides: streams with a late start, numbers of contacts in formulas, another contact model between runs, loops of short runs,
calls of the C library."""
from decks import Part

D = 0.003  # m: the largest diameter
ASKS = ("natoms", "world", "masses", "compute", "each", "formula", "gathered", "gathered", "scattered")


class MoreEvents:
    """Events of a grammar.Grammar."""

    def another_event(self):
        self.rng.choice((self.stream, self.contacts, self.contacts, self.pair_changes, self.short_runs, self.short_runs))()

    # --- streams

    def stream(self):
        """Granules that stream through a face, over the bed or buried in it, some steps later."""
        if self.second_file or self.streaming or self.inserting:
            return
        rng = self.rng
        if not any("particledistribution" in line for p in self.parts for line in p.lines):
            self.templates()
        self.streaming, s = True, self.name("stream")
        height = "high" if rng.random() < 0.5 else "low"
        self.say(f"fix {s}face all mesh/surface/planar file {height}.stl type 1", f"variable {s} equal $(step+{rng.choice((5, 30, 100))})",
                 f"fix {s} all insert/stream seed 67867967 distributiontemplate dist nparticles {rng.choice((20, 60))} particlerate 20000 start ${{{s}}} "
                 f"overlapcheck yes all_in {rng.choice(('yes', 'no'))} vel constant 0 0 -0.3 insertion_face {s}face extrude_length {rng.choice((2, 3)) * D:g}")
        self.traits |= {"loose", "driven"}

    # --- contacts

    def local_contacts(self, again):
        """Lists of contacts, which LIGGGHTS takes before the first run alone, and after no restart; with walls, of meshes."""
        self.local = None
        if not again:
            self.local = self.rng.choice((None, None, "pair/gran/local", "wall/gran/local" if self.meshes else "pair/gran/local"))
        if self.local:
            self.say(f"compute local all {self.local} contactArea delta", "compute overlap all reduce sum c_local[2]")  # a force has the sign of the order of a pair

    def contacts(self):
        """A sum over contacts that the deck prints at the end of a run, and goes by."""
        rng, c = self.rng, self.name("sum")
        stress = "stress/atom pair" if self.clumps else "stress/atom virial"  # what holds clumps together is in no virial between runs
        how = rng.choice(("contact/atom", stress, self.local))
        if not how:  # no such list
            return
        lines, kind, what = {"contact/atom": ([f"compute {c}a all contact/atom", f"compute {c} all reduce sum c_{c}a"], "contacts", f"c_{c}"),
                             stress: ([f"compute {c}a all {stress}", f"compute {c} all reduce sum c_{c}a[1] c_{c}a[2] c_{c}a[3]"], "load", f"c_{c}[3]")}.get(how, ([], "load", "c_overlap"))
        column = f"v_{c}" if rng.random() < 0.5 else what
        self.say(*lines, f"variable {c} equal {what}", f"thermo_style custom step atoms ke c_ke {column}", f"run {rng.choice((20, 50, 100))}",
                 f'print "CHECK {c} {kind} ${{{c}}}"', f'if "${{{c}}} > 100" then "print much" else "print little"', "thermo_style custom step atoms ke c_ke")

    # --- another contact model

    def pair_changes(self):
        """The granules' own; walls keep theirs."""
        if self.second_file or "cohesion" in self.contact or self.pair_changed:
            return
        self.pair_changed = True
        normal, tangential = self.rng.choice(("hertz", "hooke")), self.rng.choice(("history", "no_history", "off"))
        self.say(f"pair_style gran model {normal} tangential {tangential}", "pair_coeff * *")

    # --- short runs

    def short_runs(self):
        rng, n, here = self.rng, self.name("n"), self.name("here")
        times, steps = rng.randint(3, 6 if self.slow else 12), rng.choice((1, 5, 20, 20))
        asked = rng.choice(("ke", "count(all)", "bound(all,zmax)", "xcm(all,z)", "c_ke"))
        between = rng.choice(([], [f'print "now ${{{n}v}}"'], [f'if "${{{n}v}} > 1" then "print more" else "print less"']))
        # a formula of a compute takes what the run before has printed
        how = rng.choice(("", "", " post no", " pre no post no" if not between else " post no"))
        first = [f"run {steps}"] if " pre no" in how else []
        self.say(*first, f"variable {n}v equal {asked}", f"variable {n} loop {times}", f"label {here}", f"run {steps}{how}", *between, f"next {n}", f"jump SELF {here}")

    # --- a program

    def by_turns(self):
        """From here on the deck goes by the other way."""
        self.say(f"#library by {self.rng.choice(('file', 'commands'))}")

    def library_call(self):
        rng = self.rng
        what = rng.choice(ASKS + ("fix",) * self.mesh_floor)
        self.checks += 1
        kind = "loose" if "loose" in self.traits else "exact"
        words = {"formula": [rng.choice(("count(all)", "mass(all)"))], "gathered": [rng.choice(("x", "x", "v", "radius", "type"))], "fix": ["floor", str(rng.choice((1, 3)))]}.get(what, [])
        lines = []
        if what == "compute":
            lines = [] if any("compute lib_mass" in line for p in self.parts for line in p.lines) else ["compute lib_mass all property/atom mass"]
        if what == "scattered":
            first = rng.randrange(1, 150)
            words = [*rng.choice((("x", "2"), ("v", "2"), ("v", "0"))), str(first), str(first + rng.randrange(0, 40))]
            words.append(f"{0.3 * D:g}" if words[0] == "x" else rng.choice(("0.3", "-0.2")))
            self.traits.add("driven")
        self.parts.append(Part([*lines, " ".join(["#library", what, f"l{self.checks}", kind, *words])]))
