"""Small decks as users write them, at random."""
import itertools
import math
import random

from decks import CullLine, Deck, Part
from more import MoreEvents

D = 0.003          # m: the largest diameter
MOST = 400         # granules
DENSITY = 2500     # kg/m^3
SEEDS = (15485863, 15485867, 32452843, 32452867, 49979687, 67867967)  # LIGGGHTS takes primes
BETWEEN = ("none", "harmless", "all")
FEW_RANKS = (1, 1, 2, 2, 3, 4)  # numbers to choose from, as often as they stand here
RANKS = 3 * FEW_RANKS + (5, 6, 7, 8)


def grids_of(n):
    """All grids of n ranks, and LIGGGHTS's own choice."""
    kept = {2: ["2 1 1", "1 2 1", "1 1 2"], 3: ["3 1 1", "1 3 1", "1 1 3"], 4: ["2 2 1", "2 1 2", "1 2 2", "4 1 1", "1 1 4"]}  # so that seeds keep their decks
    whole = [" ".join(map(str, grid)) for grid in itertools.product(range(1, n + 1), repeat=3) if math.prod(grid) == n]
    return [*([] if n == 1 else kept.get(n, whole)), "* * *"]


def region_in(rng, box, low, high):
    """A block that cuts the box somewhere."""
    axis = rng.randrange(3)
    sides = ["INF INF"] * 3
    at = rng.uniform(*((0.2 * box, 0.8 * box) if axis < 2 else (low, high)))
    sides[axis] = f"INF {at:.4f}" if rng.random() < 0.5 else f"{at:.4f} INF"
    return " ".join(sides)


class Grammar(MoreEvents):
    """Makes one deck. `more`: with the events of more.py; `library`: whether it goes by the C library, None for one deck of five. Traits: `loose` once chance may change how many granules there are, `leaves` where granules may leave,
    `driven` where the end is not at rest."""

    def __init__(self, seed, between="all", ranks=None, more=True, library=None, clumps=False):
        self.rng = random.Random(f"solidcull {seed}")
        self.rng_of_balance = random.Random(f"balance {seed}")  # its own, so that a deck is otherwise the same without it
        self.rng_of_audits = random.Random(f"audits {seed}")    # likewise
        self.seed, self.between, self.ranks, self.clumps = seed, between, ranks, clumps
        self.more = more and between == "all"
        self.library = self.more and (self.chance(0.2) if library is None else library)
        self.streaming = self.pair_changed = False
        self.traits, self.parts, self.files, self.names = set(), [], [], 0
        self.culling, self.balanced, self.checks, self.groups, self.exact_groups = False, False, 0, [], ["all"]
        self.meshes, self.inserting, self.held = [], None, []

    # --- helpers

    def chance(self, p):
        return self.rng.random() < p

    def say(self, *lines, culled=None, needed=False):
        self.parts.append(Part(list(lines), culled, needed))

    def name(self, what):
        self.names += 1
        return f"{what}{self.names}"

    # --- the head of a deck

    def deck(self):
        rng = self.rng
        self.side = rng.choice((4, 5, 5, 6, 6, 7))
        self.layers = rng.randint(5, max(5, min(11, MOST // self.side**2)))
        self.box = self.side * D
        self.top = 0.06 if self.side > 4 else 0.08
        self.room = self.box * (2 if self.chance(0.15) else 1)  # the bed may stand behind a wall within the box
        self.periodic = [self.room == self.box and self.chance(0.15), self.chance(0.15)]
        self.ranks_of = [self.pick_ranks()]
        self.slow = self.ranks_of[0][0] > 1  # where ranks share processors, each step waits for each rank
        self.how = rng.choice(("lattice",) * 4 + ("pack",) if self.slow else ("lattice", "lattice", "pack", "pack", "rate"))
        if self.clumps:
            self.how = rng.choice(("pack", "pack", "rate"))  # clumps come by insertion alone
        shut = rng.choice("ffmms" if self.how == "lattice" else "ffmm")  # LIGGGHTS wraps no box without granules
        self.boundary = ["p" if p else shut for p in self.periodic] + [rng.choice("ffm") if shut == "f" else shut]
        self.skin = rng.choice((0.0003, 0.0004, 0.0006, 0.001))
        self.dt = rng.choice((2e-5, 3e-5, 3e-5))
        self.poly = self.chance(0.5)
        self.model()
        self.head()
        if self.library:
            self.by_turns()
        self.physics()
        self.bed()
        self.events()
        if self.second_file:
            self.resume()
        self.end()
        self.files.append(self.parts)
        if self.library:
            self.traits.add("library")
        return Deck(self.seed, [r for r, _ in self.ranks_of], self.files, self.traits)

    def pick_ranks(self):
        n = self.rng.choice(self.ranks or RANKS)
        return n, self.rng.choice(grids_of(n))

    def model(self):
        rng = self.rng
        normal = rng.choice(("hertz", "hertz", "hooke"))
        tangential = rng.choice(("history", "history", "history", "no_history", "off"))
        rolling = rng.choice(("off", "off", "cdt", "epsd", "epsd2")) if tangential == "history" else "off"
        cohesion = rng.choice(("off", "off", "off", "sjkr", "sjkr2"))
        words = f"{normal} tangential {tangential}"
        words += f" cohesion {cohesion}" * (cohesion != "off") + f" rolling_friction {rolling}" * (rolling != "off")
        self.contact, self.damped = words, tangential == "history"

    def head(self, restart=None):
        grid = self.ranks_of[-1][1]
        room = f"block 0 {self.room:.4f} 0 {self.box:.4f} -0.0001 {self.top}"
        self.say("atom_style granular", "atom_modify map array" + " sort 0 0" * self.chance(0.1),
                 f"boundary {' '.join(self.boundary)}", "newton off", "communicate single vel yes", "units si", needed=True)
        self.say(f"processors {grid}")
        self.say(*([f"read_restart {restart}"] if restart else [f"region box {room} units box", "create_box 2 box"]),
                 f"neighbor {self.skin} bin", "neigh_modify delay 0", needed=True)

    def physics(self, again=False):
        if not again:
            rng = self.rng
            self.friction, self.restitution = rng.choice((0.2, 0.5, 0.8)), rng.choice((0.2, 0.3, 0.6))
            self.mesh_floor, self.tool = self.chance(0.35), self.rng.choice((None, None, None, "plate", "blade", "servo"))
            self.gravity = rng.choice(("0 0 -1", "0 0 -1", "0 0 -1", "0.05 0 -1", "0 0.3 -1"))
        two = lambda x: f"{x} {x}"          # noqa: E731
        four = lambda x: f"{x} {x} {x} {x}"  # noqa: E731
        self.say(f"fix m1 all property/global youngsModulus peratomtype {two('5.e6')}",
                 f"fix m2 all property/global poissonsRatio peratomtype {two(0.3)}",
                 f"fix m3 all property/global coefficientRestitution peratomtypepair 2 {four(self.restitution)}",
                 f"fix m4 all property/global coefficientFriction peratomtypepair 2 {four(self.friction)}",
                 "fix m5 all property/global characteristicVelocity scalar 2.", needed=True)
        if "rolling" in self.contact:
            self.say(f"fix m6 all property/global coefficientRollingFriction peratomtypepair 2 {four(0.2)}", needed=True)
            if "epsd" in self.contact:
                self.say(f"fix m7 all property/global coefficientRollingViscousDamping peratomtypepair 2 {four(0.3)}", needed=True)
        if "cohesion" in self.contact:
            self.say(f"fix m8 all property/global cohesionEnergyDensity peratomtypepair 2 {four(5000)}", needed=True)
        self.say(f"pair_style gran model {self.contact}", "pair_coeff * *", f"timestep {self.dt}", needed=True)
        self.say(f"fix grav all gravity 9.81 vector {self.gravity}")
        self.walls(again)

    def walls(self, again):
        wall = f"wall/gran model {self.contact}"
        for axis, reach in (("x", self.box), ("y", self.box)):
            if not self.periodic["xy".index(axis)]:
                for k, at in enumerate((0, reach)):
                    self.say(f"fix {axis}{k} all {wall} primitive type 1 {axis}plane {at:.4f}")
        if self.room > self.box:
            self.say(f"fix x2 all {wall} primitive type 1 xplane {self.room:.4f}", needed=True)
        self.say(f"fix lid all {wall} primitive type 1 zplane {self.top}")
        self.meshes = []
        if self.mesh_floor:
            self.say("fix floor all mesh/surface/stress file floor.stl type 1", needed=True)
            self.meshes.append("floor")
        else:
            self.say(f"fix z0 all {wall} primitive type 1 zplane 0", needed=True)
        if self.tool == "servo":
            self.say(f"fix tool all mesh/surface/stress/servo file plate.stl type 1 com {self.box / 2:.4f} {self.box / 2:.4f} {self.tool_height():.4f} "
                     f"ctrlPV force axis 0 0 -1 target_val {0.5 if self.side < 6 else 1.5} vel_max 0.5 kp 0.5", needed=True)
        elif self.tool:
            self.say(f"fix tool all mesh/surface file {self.tool}.stl type 1", needed=True)
        if self.tool:
            self.meshes.append("tool")
        if self.meshes:
            self.say(f"fix meshes all {wall} mesh n_meshes {len(self.meshes)} meshes {' '.join(self.meshes)}", needed=True)
        if self.more:
            self.local_contacts(again)

    def tool_height(self):
        return (self.layers + 2) * D

    # --- the bed

    def bed(self):
        rng = self.rng
        self.say("fix integrate all nve/sphere" if self.chance(0.9) else "fix integrate all nve/limit radius_ratio 0.5", needed=True)
        self.move_clumps()
        self.say("compute ke all ke", f"thermo {rng.choice((100, 500, 1000))}", "thermo_style custom step atoms ke c_ke",
                 f"thermo_modify lost {'error' if self.chance(0.8) and not self.clumps else 'ignore'} norm no")  # stock deletes broken clumps
        how = self.how
        early = self.chance(0.3)
        if early:
            self.cull()
        if how == "lattice":
            self.lattice()
            steps = rng.choice((0, 0, 20) if self.slow else (0, 0, 100, 400))
        else:
            self.insertion(how)
            steps = int(rng.choice((0.02,) if self.slow else (0.05, 0.1, 0.12, 0.12)) / self.dt)  # the fall takes 0.1 s
        damp = steps > 1000 and self.chance(0.7)
        if damp:
            self.say("fix damp all viscous 1e-3")
        if steps:
            self.say(f"run {steps}")
        if damp:
            self.say("unfix damp")
        if how == "rate" and self.chance(0.7):
            self.say("unfix ins")
            self.inserting = None
        if not early:
            self.cull()

    def sizes(self):
        return [D, D * self.rng.choice((0.5, 0.7, 0.8))] if self.poly else [D]

    def lattice(self):
        rng = self.rng
        space = rng.choice((1.0, 1.0, 1.0, 1.02, 1.2))
        high = self.layers * D * space
        self.say(f"lattice sc {D * space:.6f} origin 0.5 0.5 0.5", f"region fill block 0 {self.box:.4f} 0 {self.box:.4f} 0 {high:.5f} units box",
                 "create_atoms 1 region fill", f"set group all diameter {D} density {DENSITY}", needed=True)
        sizes = self.sizes()
        if len(sizes) > 1:
            self.say(f"set group all type/fraction 2 0.4 {rng.choice(SEEDS)}", f"set type 2 diameter {sizes[1]}")
        if self.chance(0.2):
            self.say(f"displace_atoms all random {0.02 * D:g} {0.02 * D:g} 0 {rng.choice(SEEDS)} units box")

    def move_clumps(self):
        if self.clumps:
            self.say("fix clumps all multisphere allow_group_and_set yes", needed=True)

    def templates(self):
        sizes = self.sizes()
        if self.clumps:
            self.clump_templates()
            return
        for k, size in enumerate(sizes):
            self.say(f"fix t{k} all particletemplate/sphere {(15485863, 15485867)[k]} atom_type {k + 1} density constant {DENSITY} "
                     f"radius constant {size / 2:g}", needed=True)
        shares = " ".join(f"t{k} {1 / len(sizes)}" for k in range(len(sizes)))
        self.say(f"fix dist all particledistribution/discrete 32452843 {len(sizes)} {shares}", needed=True)

    def clump_templates(self):
        """Of three spheres and of five in a row, some with single spheres among them."""
        spheres = {"t0": "3 ntry 100000 spheres 0 0 0 0.0008 0.0009 0 0 0.0007 0.0004 0.0008 0 0.0006",
                   "t1": "5 ntry 100000 spheres " + " ".join(f"{0.0006 * k:g} 0 0 0.0007" for k in range(-2, 3))}
        kinds = self.rng.choice((["t0"], ["t0"], ["t0", "t1"], ["t0", "t2"], ["t0", "t1", "t2"]))
        for k, t in enumerate(kinds):
            head = f"fix {t} all particletemplate/{{}} {SEEDS[k]} atom_type {1 + k % 2} density constant {DENSITY} "
            self.say(head.format("multisphere") + f"nspheres {spheres[t]} type {k + 1}" if t in spheres else
                     head.format("sphere") + f"radius constant {D / 3:g}", needed=True)
        shares = " ".join(f"{t} {1 / len(kinds)}" for t in kinds)
        self.say(f"fix dist all particledistribution/discrete 49979693 {len(kinds)} {shares}", needed=True)

    def insertion(self, how):
        rng = self.rng
        self.templates()
        n = min(MOST, self.side**2 * self.layers)
        self.say(f"region pour block 0 {self.box:.4f} 0 {self.box:.4f} 0.002 {self.top - 0.002:.4f} units box", needed=True)
        common = "distributiontemplate dist maxattempt 200"
        words = "overlapcheck yes all_in yes vel constant 0 0 -1 region pour"
        if self.clumps:
            words = words.replace("region", "orientation random region") + " ntry_mc 10000"
        if how == "pack":
            self.say(f"fix ins all insert/pack seed 32452867 {common} insert_every once {words} particles_in_region {n}", needed=True)
            if self.clumps and self.balanced and self.slow:  # each rank draws its own share of the kinds
                self.traits.add("loose")
        else:
            self.say(f"fix ins all insert/rate/region seed 32452867 {common} nparticles {n} particlerate {n * 50} "
                     f"insert_every {rng.choice((100, 300))} {words}", needed=True)
            self.traits.add("loose")
            self.inserting = "ins"

    # --- the fix line

    def keywords(self):
        rng, words = self.rng, []
        if rng.random() < 0.6:  # in the few steps of a deck much is to be culled, and woken
            words += [f"every {rng.choice((10, 10, 25))}", f"calm {rng.choice((1, 1, 2))}", f"speed {rng.choice((0.5, 0.5, 2))}",
                      f"tolerance {rng.choice(('30 0', '30 0', '300 0', '10 0.1'))}"]
            offers = [(0.7, ["exterior sleep", "exterior live depth 1", "exterior live depth 0.5 voxel 0.25", "exterior live depth 1.5"]), (0.15, ["carve 1 1", "carve 3 2"]),
                      (0.15, ["restore exact"]), (0.2, ["report full"]), (0.25, ["store compact"]), (0.05, ["bed 200 bed.*.vtp"]),
                      (0.05, ["mesh 200 mesh.*.stl"])]
            return words + [rng.choice(choices) for p, choices in offers if rng.random() < p]
        offers = [(0.7, ["exterior sleep", "exterior sleep", "exterior live"]), (0.6, ["every 10", "every 10", "every 20", "every 50"]),
                  (0.5, ["calm 1", "calm 2", "calm 3"]), (0.7, ["speed 0.05", "speed 0.5", "speed 0.5", "speed 0.002"]),
                  (0.5, ["tolerance 30 0", "tolerance 30 0", "tolerance 1 0", "tolerance 3 0.1", "tolerance 300 0"]), (0.4, ["depth 1", "depth 1.5", "depth 3"]),
                  (0.15, ["carve 1 1", "carve 3 2"]), (0.15, ["restore exact"]), (0.2, ["report full"]), (0.25, ["store compact"]),
                  (0.1, ["voxel 0.4"]), (0.05, ["bed 200 bed.*.vtp"]), (0.05, ["mesh 200 mesh.*.stl"])]
        for p, choices in offers:
            if rng.random() < p:
                words.append(rng.choice(choices))
        return words

    def balance(self):
        rng = self.rng_of_balance
        return [f"balance {rng.choice((10, 50, 100))} {rng.choice((1.05, 1.2, 2))}"] if rng.random() < 0.5 else []

    def audits(self):
        rng = self.rng_of_audits
        return [f"audit {rng.choice((20, 60, 200))} {rng.choice((1, 4, 20))}"] if rng.random() < 0.3 else []

    def cull(self):
        balance = self.balance()
        self.parts.append(CullLine([], needed=True, keywords=self.keywords() + balance + self.audits()))
        self.culling, self.balanced = True, bool(balance)

    # --- what happens then

    def events(self):
        self.second_file = self.chance(0.2)
        if self.chance(0.5) and self.tool in ("plate", "blade"):
            self.run()
        for _ in range(self.rng.randint(1, 5)):
            if self.between != "none":
                for _ in range(self.rng.randint(0, 4)):
                    self.event()
                    if self.more and self.chance(0.3):
                        self.another_event()
            self.run()
            self.ask_the_library()

    def ask_the_library(self):
        if self.library:
            for _ in range(self.rng.randint(0, 3)):
                self.by_turns()
                self.library_call()

    def run(self):
        if self.library:
            self.by_turns()
        steps = self.rng.choice((20, 50, 100, 150) if self.slow else (50, 100, 200, 400, 800))
        how = self.rng.random()
        if how < 0.1:
            self.say(f"run {steps} every {max(20, steps // 4)} \"print 'on the way'\"")
        elif how < 0.15:
            self.say(f"run {steps} every 50 NULL")
        elif how < 0.25 and self.parts[-1].lines[-1:] and self.parts[-1].lines[-1].startswith("run ") and self.between != "none":
            self.say(f"run {steps} pre no")
        else:
            self.say(f"run {steps}")

    def event(self):
        harmless = [self.talk, self.measure, self.run_nothing, self.lists, self.gravity_changes, self.wall_goes, self.tool_moves,
                    self.again, self.restart_file, self.hold, self.time_step, self.loop, self.mesh_region]
        deep = [self.group, self.group, self.set_values, self.velocities, self.displace, self.delete, self.create, self.push, self.check,
                self.check, self.pour_more, self.drive, self.integrate_some, self.write, self.ask, self.rare]
        self.rng.choice(harmless + (deep if self.between == "all" else []))()

    def talk(self):
        self.say(self.rng.choice(('print "hello"', "thermo 50", "variable s string hello", "variable q equal 2*3", "echo both",
                                  "thermo_style custom step atoms ke vol", "log log.more append")))

    def measure(self):
        ave, rng = self.name("ave"), self.rng
        self.say(*rng.choice(([f"fix {ave} all ave/time 10 5 100 c_ke file {ave}.txt"], [f"fix {ave} all print 50 'step'"],
                              [f"dump {ave} all custom 100 {ave}.*.dump id x y z"],
                              [f"compute {ave} all reduce sum fx fy fz", f"fix {ave} all ave/time 20 1 20 c_{ave}[3]"])))

    def run_nothing(self):
        self.say("run 0")

    def lists(self):
        self.say(self.rng.choice(("neigh_modify every 1 delay 5 check yes", "neigh_modify delay 0 every 10 check yes", "neighbor 0.0008 bin",
                                  "neighbor 0.0005 bin")))

    def time_step(self):
        self.say(f"timestep {self.dt / self.rng.choice((1, 2))}")

    def gravity_changes(self):
        self.say("unfix grav", f"fix grav all gravity {self.rng.choice((9.81, 12, 5, 0))} vector {self.rng.choice(('0 0 -1', '0.2 0 -1', '0 -0.5 -1'))}")
        self.traits.add("driven")

    def wall_goes(self):
        axis = self.rng.choice([a for a in range(2) if not self.periodic[a]] or [None])
        if axis is None:
            return
        wall = "xy"[axis] + str(self.rng.randrange(2))
        at = self.box if wall[1] == "1" else 0
        if wall == "x1" and self.room > self.box:
            if "open" not in self.traits:
                self.say("unfix x1")
                self.traits |= {"open", "driven"}
        elif not ("open" in self.traits and wall == "x1"):
            self.say(f"unfix {wall}", f"fix {wall} all wall/gran model {self.contact} primitive type 1 {wall[0]}plane {at:.4f}")

    def tool_moves(self):
        if self.tool not in ("plate", "blade"):
            return
        move = self.name("move")
        v = self.rng.choice(("linear 0 0 -0.2", "linear 0 0 0.2", "wiggle amplitude 0 0 0.001 period 0.02",
                             "linear 0.05 0 0", f"rotate origin {self.box / 2:.4f} {self.box / 2:.4f} 0 axis 0 0 1 period 0.5"))
        self.say(f"fix {move} all move/mesh mesh tool {v}", f"run {self.rng.choice((50, 100, 200))}", f"unfix {move}")
        self.traits.add("driven")

    def again(self):
        if self.culling:
            self.parts.append(Part([], ["unfix cull"]))
            if self.chance(0.3):
                self.say(f"run {self.rng.choice((0, 50))}")
            self.cull()

    def restart_file(self):
        self.say(self.rng.choice(("write_restart here.restart", "restart 100 one.restart two.restart")))

    def hold(self):
        """A group that is held: by id, so it is the same in both decks."""
        hold, group = self.name("hold"), self.name("held")
        first = self.rng.randrange(1, 60)
        self.say(f"group {group} id {first}:{first + self.rng.randrange(1, 40)}", f"fix {hold} {group} {self.rng.choice(('freeze', 'setforce 0 0 0'))}")
        if self.chance(0.5):
            self.say(f"run {self.rng.choice((50, 100))}", f"unfix {hold}")
        self.traits.add("driven")

    def loop(self):
        n, here = self.name("n"), self.name("here")
        self.say(f"variable {n} loop {self.rng.randint(2, 6)}", f"label {here}", f"run {self.rng.choice((0, 10, 30))}", f"next {n}",
                 f"jump SELF {here}")

    def mesh_region(self):
        if not self.culling:
            return
        r, g = self.name("solid"), self.name("g")
        self.parts.append(Part([], [f"region {r} interface/mesh cull", f"group {g} region {r}", f"variable {g} equal count({g})",
                                    f'print "in the mesh ${{{g}}}"', f"region {r} delete"]))

    # --- commands that see or change granules

    def group(self):
        rng, g = self.rng, self.name("g")
        how = rng.choice(("id", "type", "region", "subtract", "union"))
        if how == "id":
            self.say(f"group {g} id {rng.choice(('<', '>'))} {rng.randrange(20, 200)}")
        elif how == "type":
            self.say(f"group {g} type {rng.choice((1, 2))}")
        elif how == "region":
            r = self.name("r")
            self.say(f"region {r} block {region_in(rng, self.box, 0.002, self.layers * D)} units box", f"group {g} region {r}")
            self.groups.append(g)
            return
        else:
            others = rng.choice(self.exact_groups)
            self.say(f"group {g} {how} all {others}")
        self.groups.append(g)
        self.exact_groups.append(g)

    def some(self, exact=False):
        known = self.exact_groups if exact else self.groups + ["all"]
        return self.rng.choice(known)

    def set_values(self):
        rng = self.rng
        self.say(f"set group {self.some()} " + rng.choice(("density 2000", "density 3000", "type 2", f"diameter {0.9 * D:g}", "vx 0.1")))

    def velocities(self):
        self.say(f"velocity {self.some()} " + self.rng.choice(("set 0 0 0.3", "set 0 0 0", "set NULL 0.2 NULL", "zero linear",
                                                               f"ramp vx 0 0.2 z 0 {self.layers * D:.4f} units box")))
        self.traits.add("driven")

    def displace(self):
        self.say(f"displace_atoms {self.some()} " + self.rng.choice((f"move 0 0 {0.3 * D:g} units box",
                                                                     f"random {0.01 * D:g} {0.01 * D:g} {0.01 * D:g} 49979687 units box")))
        self.traits.add("driven")

    def delete(self):
        rng = self.rng
        compress = rng.choice(("", " compress no", " compress no", " compress yes"))
        if rng.random() < 0.4:
            r = self.name("r")
            self.say(f"region {r} block {region_in(rng, self.box, 0.5 * self.layers * D, self.layers * D)} units box",
                     f"delete_atoms region {r}{compress}")
            self.traits |= {"loose", "driven"}
        else:
            g = self.name("g")
            first = rng.randrange(1, 150)
            self.say(f"group {g} id {first}:{first + rng.randrange(1, 60)}", f"delete_atoms group {g}{compress}")
            self.traits |= {"driven"} | ({"loose"} if "compress yes" in compress or not compress else set())
        if "no" not in compress:
            self.traits.add("renumbered")

    def create(self):
        rng = self.rng
        g = self.name("g")
        x, y = (rng.uniform(0.3, 0.7) * self.box for _ in range(2))
        z = self.tool_height() + rng.uniform(1, 3) * D
        n = self.name("n")
        self.say(f"variable {n} equal count(all)", f"create_atoms 1 single {x:.5f} {y:.5f} {z:.5f} units box",
                 f"region {g} sphere {x:.5f} {y:.5f} {z:.5f} 1e-6 units box", f"group {g} region {g}",
                 f"set group {g} diameter {D} density {DENSITY}", f"velocity {g} set 0 0 {rng.choice((0, -0.5, -1.5))}")
        self.traits.add("driven")

    def push(self):
        push = self.name("push")
        group, force = self.some(), self.rng.choice((1e-4, -1e-4, 1e-3))
        self.say(f"fix {push} {group} addforce 0 0 {force}")
        if self.chance(0.6):
            self.say(f"run {self.rng.choice((50, 100))}", f"unfix {push}")
        elif force == 1e-3:
            self.traits.add("loose")  # three times the weight: granules are shot through the lid
        self.traits.add("driven")

    def drive(self):
        drive = self.name("drive")
        self.say(f"fix {drive} {self.some()} " + self.rng.choice(("momentum 50 linear 1 1 0", "ave/atom 10 5 50 vx vz", "viscous 1e-4", "drag 0 0 0 1e-4 1",
                                                                  "lineforce 0 0 1", "spring/self 1e-2", 
                                                                  "store/state 0 x y z", "aveforce 0 0 NULL", "move linear 0 0 0.01")))
        if self.chance(0.6):
            self.say(f"run {self.rng.choice((50, 100))}", f"unfix {drive}")
        self.traits.add("driven")

    def integrate_some(self):
        self.say("unfix integrate", f"fix integrate {self.some()} nve/sphere", f"run {self.rng.choice((20, 100))}", "unfix integrate",
                 "fix integrate all nve/sphere")
        self.traits.add("driven")

    def write(self):
        self.say(self.rng.choice((f"write_dump {self.some()} custom {self.name('dump')} id x y z", f"write_data {self.name('data')}",
                                  f"compute {self.name('rot')} all erotate/sphere")))

    def ask(self):
        v = self.name("v")
        words = self.rng.choice((f"xcm({self.some()},z)", f"ke({self.some()})", f"bound({self.some()},zmax)", "c_ke", "ke", "atoms", "vcm(all,z)", "gyration(all)"))
        self.say(f"variable {v} equal {words}", f'print "asked {words} ${{{v}}}"', f'if "${{{v}}} > 1" then "print yes" else "print no"')

    def rare(self):
        """What changes the box, or which granules there are."""
        words = self.rng.choice(("change_box all z final -0.0001 0.07 units box", "delete_atoms overlap 0.0005 all all compress no",
                                 "delete_atoms porosity fill 0.05 49979687 compress no", "reset_timestep 0",
                                 "minimize 1e-6 1e-6 10 10" if self.chance(0.2) else "reset_timestep 1000"))
        if self.streaming and "reset" in words or "fill" in words and self.how != "lattice":
            return
        self.say(words)
        if "delete" in words:
            self.traits |= {"loose", "driven"}

    def pour_more(self):
        if self.inserting or not any("particledistribution" in line for p in self.parts for line in p.lines) or self.second_file:
            return
        more = self.name("more")
        self.say(f"region {more} block 0 {self.box:.4f} 0 {self.box:.4f} {self.tool_height() + D:.4f} {self.top - 0.002:.4f} units box",
                 f"fix {more} all insert/pack seed 67867979 distributiontemplate dist maxattempt 100 insert_every once overlapcheck yes "
                 f"all_in yes vel constant 0 0 -0.5 region {more} particles_in_region {self.rng.choice((5, 20))}")
        self.traits |= {"loose", "driven"}

    def check(self):
        """What a deck reads between runs: exact where chance has no part in it."""
        rng = self.rng
        exact = "loose" not in self.traits and rng.random() < 0.8
        group = self.some(exact)
        what = rng.choice(("count", "count", "mass"))
        self.checks += 1
        kind = "exact" if exact and group in self.exact_groups else "loose"
        self.say(f"variable c{self.checks} equal {what}({group})", f'print "CHECK c{self.checks} {kind} ${{c{self.checks}}}"')

    # --- a second deck, and the end

    def resume(self):
        self.say("write_restart stop.restart", needed=True)
        self.files.append(self.parts)
        self.parts = []
        self.groups, self.exact_groups, self.meshes = [], ["all"], []
        self.ranks_of.append(self.pick_ranks())
        self.head("stop.restart")
        self.physics(again=True)
        self.say("fix integrate all nve/sphere", needed=True)
        self.move_clumps()
        if self.more:
            self.say("compute ke all ke", needed=True)
        self.say(f"thermo_modify lost {'ignore' if self.clumps else 'error'} norm no")
        if self.culling:
            self.cull()
        self.second_file = False
        self.inserting = None
        self.run()
        for _ in range(self.rng.randint(0, 2)):
            if self.between != "none":
                self.event()
            self.run()
            self.ask_the_library()

    def end(self):
        if self.culling and self.chance(0.85):
            self.parts.append(Part([], ["unfix cull"], True))
        elif self.culling and self.between != "all":
            self.traits.add("left")  # what is culled is in no dump
        self.say("run 0", 'write_dump all custom end.dump id type mass radius x y z vx vy vz modify format '
                 '"%d %d %.15g %.15g %.15g %.15g %.15g %.15g %.15g %.15g"', needed=True)
        if self.mesh_floor and not self.tool:
            self.say("variable w equal f_floor[3]", 'print "WEIGHT ${w}"')


def meshes(deck_box, room, height, layers):
    """STL files that decks name: text by file name."""
    def stl(triangles):
        rows = ["solid mesh"]
        for t in triangles:
            rows += ["facet normal 0 0 0", "outer loop", *(f"vertex {x:.6g} {y:.6g} {z:.6g}" for x, y, z in t), "endloop", "endfacet"]
        return "\n".join(rows + ["endsolid mesh"]) + "\n"

    def grid(corner, u, v, n):
        at = lambda i, j: tuple(c + a * i / n + b * j / n for c, a, b in zip(corner, u, v))  # noqa: E731
        return [t for i in range(n) for j in range(n)
                for t in ((at(i, j), at(i + 1, j), at(i + 1, j + 1)), (at(i, j), at(i + 1, j + 1), at(i, j + 1)))]

    b, out = deck_box, 0.0002
    return {"floor.stl": stl(grid((-out, -out, 0), (room + 2 * out, 0, 0), (0, b + 2 * out, 0), 3)),
            "high.stl": stl(grid((0.2 * b, 0.2 * b, height + 3 * D), (0.6 * b, 0, 0), (0, 0.6 * b, 0), 1)),
            "low.stl": stl(grid((0.2 * b, 0.2 * b, 0.3 * layers * D), (0.6 * b, 0, 0), (0, 0.6 * b, 0), 1)),
            "plate.stl": stl(grid((0.2 * b, 0.2 * b, height), (0.6 * b, 0, 0), (0, 0.6 * b, 0), 2)),
            "blade.stl": stl(grid((0.5 * b, 0.2 * b, height - 2 * D), (0, 0.6 * b, 0), (0, 0, 2 * D), 2))}


def make(seed, between="all", ranks=None, more=True, library=None, clumps=False):
    """The deck of a seed, and the meshes that it needs."""
    g = Grammar(seed, between, ranks, more, library, clumps)
    deck = g.deck()
    deck.meshes = meshes(g.box, g.room, g.tool_height(), g.layers)
    return deck
