"""What a user reads: each refusal by its text, in tiny decks through the launcher; and that the plug-in changes nothing unasked."""
import contextlib
import os
import pty
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT))
from solidcull_runs import engine  # noqa: E402

VERSION = re.search(r"VERSION (\d+\.\d+\.\d+)", (ROOT / "CMakeLists.txt").read_text()).group(1)  # cmake_minimum_required has two numbers
LAUNCHER = Path(os.environ.get("SOLIDCULL_LAUNCHER", ROOT / "build/liggghts-solidcull")).resolve()
LIBRARY = LAUNCHER.parent / "libsolidcull.so"
STOCK = shutil.which("liggghts")
TIME_LIMIT = 60  # s for one deck

HERTZ = "gran model hertz tangential history"
MATERIAL = """\
fix m1 all property/global youngsModulus peratomtype 5.e6
fix m2 all property/global poissonsRatio peratomtype 0.3
fix m3 all property/global coefficientRestitution peratomtypepair 1 0.3
fix m4 all property/global coefficientFriction peratomtypepair 1 0.5
"""
FIX = "fix cull all solid/cull"


def deck(*lines, style="granular", newton="off", box="block 0 0.012 0 0.012 -0.001 0.04", pair=HERTZ, granules=True):
    """Granules of 3 mm, one above the other in a small box; `lines` come last."""
    head = f"""\
atom_style {style}
atom_modify map array
boundary f f f
newton {newton}
communicate single vel yes
units si
region box {box} units box
create_box 1 box
neighbor 0.0004 bin
neigh_modify delay 0
"""
    body = MATERIAL + f"""\
pair_style {pair}
pair_coeff * *
timestep 2e-5
fix grav all gravity 9.81 vector 0 0 -1
fix floor all wall/gran model hertz tangential history primitive type 1 zplane 0
create_atoms 1 single 0.006 0.006 0.0015 units box
create_atoms 1 single 0.006 0.006 0.0045 units box
set group all diameter 0.003 density 2500
fix integrate all nve/sphere
thermo_modify lost error norm no
"""
    return head + (body if granules else "") + "\n".join(lines) + "\n"


# 343 granules of 3 mm that fill their box: its sides are walls, so three of four layers are soon culled
BLOCK = deck(
    *[f"fix {d}{k} all wall/gran model hertz tangential history primitive type 1 {d}plane {x}"
      for d in "xy" for k, x in enumerate((0, 0.021))],
    "delete_atoms group all",
    "lattice sc 0.003 origin 0.5 0.5 0.5",
    "region fill block 0 0.021 0 0.021 0 0.021 units box",
    "create_atoms 1 region fill",
    "set group all diameter 0.003 density 2500",
    box="block 0 0.021 0 0.021 -0.001 0.06")
CULL_BLOCK = FIX + " every 10 calm 1 exterior live depth 1 speed 0.5 tolerance 30 0"

POUR = deck(
    *[f"fix {d}{k} all wall/gran model hertz tangential history primitive type 1 {d}plane {x}"
      for d in "xy" for k, x in enumerate((0, 0.024))],
    "delete_atoms group all",
    "fix t1 all particletemplate/sphere 15485863 atom_type 1 density constant 2500 radius constant 0.0014",
    "fix t2 all particletemplate/sphere 15485867 atom_type 1 density constant 2500 radius constant 0.0016",
    "fix dist all particledistribution/discrete 32452843 2 t1 0.5 t2 0.5",
    "region pour block 0 0.024 0 0.024 0.002 0.058 units box",
    "fix ins all insert/pack seed 32452867 distributiontemplate dist maxattempt 200 insert_every once overlapcheck yes all_in yes "
    "vel constant 0 0 -0.3 region pour particles_in_region 500",
    box="block 0 0.024 0 0.024 -0.001 0.06")


def engine_of(program):
    """LIGGGHTS's library, as the loader finds it for a program."""
    told = subprocess.run(["ldd", program], text=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, check=False).stdout
    return re.findall(r"^\s*\S*(?:liggghts|lmp)\S* => (\S+)", told, re.M)


class Run:
    """A deck, run in a folder of its own."""

    def __init__(self, text, program=None, ranks=1, preload=None, unset=(), **variables):
        with tempfile.TemporaryDirectory(prefix="solidcull-") as folder:
            place = Path(folder)
            (place / "deck.in").write_text(text)
            # not `-screen none`: the stock engine's insertion fixes write to a screen that is not there
            words = [str(program or LAUNCHER), "-in", "deck.in", "-log", "log", "-screen", "screen"]
            if ranks > 1:
                words = ["mpirun", "-np", str(ranks)] + words
            env = {**engine.environment(ranks), **({"LD_PRELOAD": str(preload)} if preload else {}), **variables}
            for name in unset:
                env.pop(name, None)
            done = subprocess.run(words, cwd=place, env=env, timeout=TIME_LIMIT, text=True, stdout=subprocess.PIPE,
                                  stderr=subprocess.STDOUT, check=False)
            self.status = done.returncode
            self.output = done.stdout
            self.screen, self.log = self.text_of(place / "screen"), self.text_of(place / "log")
            self.files = sorted(p.name for p in place.iterdir())

    @staticmethod
    def text_of(file):
        # below one in five errors the stock engine writes a "tip of the day" from memory that it has freed: no UTF-8
        return file.read_text(errors="replace") if file.exists() else ""

    @staticmethod
    def errors(text):
        return [re.sub(r" \(\S+:\d+\)$", "", line) for line in text.splitlines() if line.startswith("ERROR")]

    def thermo(self):
        """Lines of numbers only: step by step output, to the last digit."""
        return [line for line in self.log.splitlines() if re.fullmatch(r"\s*-?\d[-+.\deE\s]*", line) and len(line.split()) > 2]


@unittest.skipUnless(LAUNCHER.exists(), f"no {LAUNCHER}: build it, or name it in SOLIDCULL_LAUNCHER")
class Case(unittest.TestCase):
    maxDiff = None

    def refused(self, text, line, **how):
        run = Run(text, **how)
        told = f"screen:\n{run.screen[-2000:]}\noutput:\n{run.output[-2000:]}"
        self.assertEqual(run.errors(run.screen), ["ERROR: " + line], told)
        self.assertEqual(run.errors(run.log), ["ERROR: " + line])
        self.assertNotEqual(run.status, 0, told)
        return run

    def refused_by_fix(self, text, line, fix="cull", **how):
        return self.refused(text, f"fix {fix} solid/cull: {line}", **how)

    def accepted(self, text, **how):
        run = Run(text, **how)
        self.assertEqual(run.errors(run.screen + run.output), [], run.screen[-2000:])
        self.assertEqual(run.status, 0, run.screen[-2000:] + run.output[-2000:])
        return run


class DeckRefusals(Case):
    def test_the_tiny_deck_itself_is_accepted(self):
        self.accepted(deck(FIX, "run 20"))

    def test_newton_on(self):
        self.refused_by_fix(deck(FIX, newton="on", granules=False), "newton is on: put 'newton off' at the top of the deck")

    def test_atom_style_without_granules(self):
        for style in ("atomic", "ellipsoid"):
            self.refused_by_fix(deck(FIX, style=style, granules=False),
                                f"atom style '{style}' has no granules: use atom_style granular")

    def test_triclinic_box(self):
        self.refused_by_fix(deck(FIX, granules=False, box="prism 0 0.02 0 0.02 0 0.04 0.002 0 0"),
                            "the box is triclinic: use an orthogonal one")

    def test_second_solid_cull(self):
        self.refused_by_fix(deck(FIX, "fix again all solid/cull"),
                            "fix cull is a solid/cull already: give one fix a group that holds all granules", fix="again")

    def test_no_group_left(self):
        groups = [f"group g{k} id 1" for k in range(31)]
        self.refused_by_fix(deck(*groups, FIX), "all 32 groups are taken and interface granules need one: delete a group")

    def test_pair_style_not_granular(self):
        self.refused_by_fix(deck(FIX, "run 0", pair="soft 0.003").replace("pair_coeff * *", "pair_coeff * * 1.0"),
                            "pair_style 'soft' is not granular: use pair_style gran")

    def test_no_pair_style(self):
        self.refused_by_fix(deck(FIX, "run 0", pair="none").replace("pair_coeff * *\n", ""),
                            "pair_style 'none' is not granular: use pair_style gran")

    def test_compact_store_far_from_the_origin(self):
        far = deck(FIX + " store compact", "run 0", box="block 200 200.012 0 0.012 -0.001 0.04").replace("single 0.006", "single 200.006")
        self.refused_by_fix(far, "store compact keeps places up to 98.3 m from the origin, and the box reaches 200 m: "
                                 "move the origin to the granules, or use store exact")
        self.accepted(far.replace(" store compact", ""))

    def test_sites_far_from_the_origin(self):
        far = deck(FIX + " store none restore refill", "run 0", box="block 200 200.012 0 0.012 -0.001 0.04")
        self.refused_by_fix(far.replace("single 0.006", "single 200.006"),
                            "store none has sites up to 46.33 m from the origin, and the box reaches 200 m: "
                            "move the origin to the granules, or use store exact")

    def test_run_style(self):
        self.refused_by_fix(deck(FIX, "run_style respa 2 2", "run 0"), "run_style 'respa' is not supported: use run_style verlet")


class MissedPhysics(Case):
    """Fixes whose physics the culled granules would miss: refused whichever of the two lines comes first."""

    def missed(self, lines, name, why, **how):
        line = f"fix {name}: {why}; leave one of the two fixes out"
        self.refused_by_fix(deck(*lines, FIX, "run 0", **how), line)
        self.refused_by_fix(deck(FIX, *lines, "run 0", **how), line)

    def test_heat_conduction(self):
        self.missed(["fix h1 all property/global thermalConductivity peratomtype 5.",
                     "fix h2 all property/global thermalCapacity peratomtype 10.",
                     "fix heat all heat/gran/conduction initial_temperature 300."],
                    "heat heat/gran/conduction", "heat conduction would miss the culled granules")

    def test_cfd_coupling(self):
        self.missed(["fix cfd all couple/cfd couple_every 10 file ./"], "cfd couple/cfd", "a coupled solver would miss the culled granules")

    def test_sph(self):
        # in the other order the engine stops first: it has no SPH without its own pair style
        self.refused_by_fix(deck(FIX, "fix sph all sph/density/continuity sphkernel cubicspline", "run 0"),
                            "fix sph sph/density/continuity: SPH would miss the culled granules; leave one of the two fixes out")

    def test_growing_radii(self):
        self.missed(["variable d equal 0.003", "fix grow all adapt 1 atom diameter v_d"],
                    "grow adapt", "radii that change (fix adapt) would leave the culled granules behind")

    def test_multisphere(self):
        self.missed(["fix clumps all multisphere/nointegration"], "clumps multisphere/nointegration",
                    "clumps that break, or that another program moves, would miss those that are culled")

    def test_rigid(self):
        self.missed(["fix clump all rigid single"], "clump rigid", "rigid clumps of granules are not supported yet")

    def test_box_that_changes_its_size(self):
        run = self.refused_by_fix(
            deck(FIX, "fix pull all deform 1 z final 0 0.05 units box", "run 0").replace("boundary f f f", "boundary f f p"),
            "fix pull deform: it changes the size of the box, and a culled bed cannot follow; leave one of the two fixes out")
        self.assertEqual(run.errors(run.output), [])

    def test_renumbered_granules(self):
        insert = POUR.replace("particles_in_region 500", "particles_in_region 20").replace("all_in yes", "all_in yes compress_tags yes")
        self.refused_by_fix(insert + FIX + "\nrun 0\n", "fix ins insert/pack: compress_tags would renumber granules that are "
                            "culled; say 'compress_tags no'")


class KeywordRefusals(Case):
    STEPS = "a whole number of steps, 1 or more"
    DEPTH = "a number of mean diameters, 0 to 50"
    EXTERIOR = "'live' or 'sleep'"
    SPEED = "a fraction of sqrt(g d), more than 0"
    LOOKS = "a whole number of looks, 1 or more"
    TOLERANCE = "two numbers A R, 0 or more and not both 0"
    CARVE = "two numbers C CAP: radius in mean diameters, more than 0; growth, 1 or more"
    VOXEL = "a size in mean diameters, 0.1 to 2"
    STORE = "'exact', 'compact' or 'none'"
    FILE = STEPS + ", and a file name"
    MESH = "a file name that ends with .vdb, .stl or .vtp"
    BED = "a file name that ends with .vtp or .vdb"
    LEAST = "a whole number of granules, 1 or more, behind 'least'"
    # words after `solid/cull`: keyword that is named, its value (None: missing), what to give
    AUDIT = "two whole numbers N K: steps from one audit to the next, patches that each wakes"
    BALANCE = "a whole number of steps, 1 or more, and the largest work of a rank over the mean, more than 1"
    WRONG = {
        "every 1.5": ("every", "1.5", STEPS), "every 0": ("every", "0", STEPS), "every": ("every", None, STEPS),
        "depth deep": ("depth", "deep", DEPTH), "depth -1": ("depth", "-1", DEPTH), "depth 51": ("depth", "51", DEPTH),
        "depth": ("depth", None, DEPTH),
        "exterior awake": ("exterior", "awake", EXTERIOR), "exterior": ("exterior", None, EXTERIOR),
        "speed fast": ("speed", "fast", SPEED), "speed -1": ("speed", "-1", SPEED), "speed": ("speed", None, SPEED),
        "calm 2.5": ("calm", "2.5", LOOKS), "calm 0": ("calm", "0", LOOKS), "calm": ("calm", None, LOOKS),
        "tolerance x 0": ("tolerance", "x", TOLERANCE), "tolerance 3 -1": ("tolerance", "-1", TOLERANCE),
        "tolerance 0 0": ("tolerance", "0 0", TOLERANCE), "tolerance 3": ("tolerance", None, TOLERANCE),
        "carve x 4": ("carve", "x", CARVE), "carve 2 0.5": ("carve", "0.5", CARVE), "carve 2": ("carve", None, CARVE),
        "store some": ("store", "some", STORE), "store": ("store", None, STORE),
        "restore new": ("restore", "new", "'exact' or 'refill'"), "restore": ("restore", None, "'exact' or 'refill'"),
        "reasons all": ("reasons", "all", "'yes' or 'no'"), "reasons": ("reasons", None, "'yes' or 'no'"),
        "report all": ("report", "all", "'short' or 'full'"), "report": ("report", None, "'short' or 'full'"),
        "voxel fine": ("voxel", "fine", VOXEL), "voxel 0.05": ("voxel", "0.05", VOXEL), "voxel": ("voxel", None, VOXEL),
        "mesh x a.stl": ("mesh", "x", FILE), "mesh 10 a.obj": ("mesh", "a.obj", MESH), "mesh 10": ("mesh", None, MESH),
        "mesh 10 a.vtp least 0": ("mesh", "0", LEAST), "mesh 10 a.vtp skin least": ("mesh", None, LEAST), "mesh 10 a.vtp least all": ("mesh", "all", LEAST),
        "audit 0 4": ("audit", "0", AUDIT), "audit 100 few": ("audit", "few", AUDIT), "audit 100": ("audit", None, AUDIT),
        "balance 0 1.1": ("balance", "0", BALANCE), "balance 50 1": ("balance", "1", BALANCE), "balance 50": ("balance", None, BALANCE),
        "bed 0 a.vtp": ("bed", "0", FILE), "bed 10 a.stl": ("bed", "a.stl", BED), "bed": ("bed", None, FILE),
    }
    KEYWORDS = "audit, balance, bed, calm, carve, depth, every, exterior, mesh, reasons, report, restore, speed, store, tolerance, voxel"

    def test_wrong_type_range_and_missing_values(self):
        for words, (keyword, value, wanted) in self.WRONG.items():
            with self.subTest(words):
                what = "ends too early" if value is None else f"has the value '{value}'"
                self.refused_by_fix(deck(f"{FIX} {words}", granules=False), f"keyword '{keyword}' {what}: give {wanted}")

    def test_keywords_that_are_no_more(self):
        for words, why in (("motion fixed", "bodies that walls hold stand still by themselves"),
                           ("walls surface", "walls that stand still always count as cover")):
            with self.subTest(words):
                self.refused_by_fix(deck(f"{FIX} {words}", granules=False),
                                    f"keyword '{words.split()[0]}' is no more: leave it and its value out; {why}")

    def test_no_cover_below_a_live_surface(self):
        for words in ("exterior live depth 0", "depth 0 exterior live"):
            with self.subTest(words):
                self.refused_by_fix(deck(f"{FIX} {words}", granules=False),
                                    "keyword 'depth' has the value '0' and 'exterior' the value 'live': give a cover of more than 0, "
                                    "or say 'exterior sleep'")

    def test_store_none_and_restore_refill_go_together(self):
        self.refused_by_fix(deck(FIX + " store none", granules=False),
                            "keyword 'store' has the value 'none' and 'restore' the value 'exact': say 'restore refill', or store "
                            "granules")
        self.refused_by_fix(deck(FIX + " restore refill", granules=False),
                            "keyword 'restore' has the value 'refill' and 'store' keeps granules: say 'store none', or 'restore exact'")
        self.accepted(deck(FIX + " store none restore refill", "run 0"))

    def test_each_keyword_is_tested(self):
        self.assertEqual(", ".join(sorted({k for k, _, _ in self.WRONG.values()})), self.KEYWORDS)

    def test_unknown_keyword(self):
        self.refused_by_fix(deck(FIX + " detph 2", granules=False), f"unknown keyword 'detph': choose from {self.KEYWORDS}")

    def test_unknown_word_behind_a_file(self):
        for words, name in (("bed 10 a.vtp sen", "sen"), ("bed 10 a.vtp surface", "surface"), ("bed 10 a.vtp seen b.vtp", "b.vtp")):
            with self.subTest(words):
                self.refused_by_fix(deck(f"{FIX} {words}", granules=False),
                                    f"unknown keyword '{name}': choose from {self.KEYWORDS}; behind the file of 'bed' may stand 'seen' or 'spin'")
        self.refused_by_fix(deck(f"{FIX} mesh 10 a.vtp seen", granules=False),
                            f"unknown keyword 'seen': choose from {self.KEYWORDS}; behind the file of 'mesh' may stand 'surface', 'skin' or 'least K'")

    def test_a_name_for_each_rank_where_all_write_one_file(self):
        for keyword, ending in (("mesh", ".vtp"), ("mesh", ".stl"), ("bed", ".vtp")):
            with self.subTest(keyword + ending):
                self.refused_by_fix(deck(f"{FIX} {keyword} 10 a_%{ending}", granules=False),
                                    f"keyword '{keyword}' has the value 'a_%{ending}': give a name without '%': all ranks write one {ending}")

    def test_voxel_too_coarse_for_depth(self):
        self.refused_by_fix(deck(FIX + " exterior live depth 1.5 voxel 2", granules=False),
                            "voxel 2.0 is too coarse for depth 1.5: choose voxel <= depth/2")


class FileRefusals(Case):
    REASON = "No such file or directory; write it elsewhere, or leave the keyword out"

    def test_bed_file_in_a_missing_folder(self):
        self.refused_by_fix(deck(FIX + " bed 10 missing/bed.*.vtp", "run 20"),
                            f"keyword 'bed': cannot write missing/bed.*.vtp: {self.REASON}")

    def test_mesh_file_in_a_missing_folder(self):
        for ending in ("stl", "vtp", "vdb"):
            self.refused_by_fix(deck(f"{FIX} mesh 10 missing/mesh.*.{ending}", "run 20"),
                                f"keyword 'mesh': cannot write missing/mesh.*.{ending}: {self.REASON}")

    def test_all_ranks_stop_with_one_line(self):
        run = self.refused_by_fix(deck(FIX + " bed 10 missing/bed.vtp", "run 20"),
                                  f"keyword 'bed': cannot write missing/bed.vtp: {self.REASON}", ranks=2)
        self.assertNotIn("Segmentation", run.output)

    def test_before_the_first_step(self):
        run = self.refused_by_fix(deck(FIX + " bed 1000 missing/bed.*.vtp", "thermo 1", "run 2000"),
                                  f"keyword 'bed': cannot write missing/bed.*.vtp: {self.REASON}")
        self.assertNotIn("Step", run.log)

    def test_a_restart_file_that_is_not_there_is_named(self):
        text = "atom_style granular\nread_restart nowhere.restart\n"
        for ranks in (1, 2):
            run = Run(text, ranks=ranks)
            self.assertEqual(run.errors(run.screen), ["ERROR on proc 0: Cannot open restart file nowhere.restart"])
            self.assertNotEqual(run.status, 0)

    def test_files_that_can_be_written_are(self):
        run = self.accepted(BLOCK + CULL_BLOCK + " bed 100 bed.*.vtp mesh 100 mesh.*.vdb\nrun 200\n")
        for step in ("000000000", "000000100", "000000200"):
            self.assertIn(f"bed.{step}.vtp", run.files)
            self.assertIn(f"mesh.{step}.vdb", run.files)
        self.assertIn("bed.vtp.series", run.files)
        self.assertEqual([f for f in run.files if f.endswith(".part")], [])

    def test_a_run_begins_with_a_file_where_it_is_due_as_with_a_dump(self):
        outputs = " bed 100 bed.*.vtp\ndump d all custom 100 dump.* id\n"
        run = self.accepted(BLOCK + CULL_BLOCK + outputs + "run 0\nrun 100\nrun 50\nrun 50\nreset_timestep 300\nrun 0\n")
        written = {end: {int(f.split(".")[1]) for f in run.files if f.startswith(end) and not f.endswith(".series")} for end in ("bed.", "dump.")}
        self.assertEqual(written["bed."], {0, 100, 200, 300})
        self.assertEqual(written["bed."], written["dump."])

    def test_a_file_that_is_written_over_is_told_once(self):
        run = self.accepted(BLOCK + CULL_BLOCK + " bed 100 bed.vtp mesh 100 mesh.*.vdb\nrun 200\nrun 100\n")
        told = "keyword 'bed': bed.vtp has no '*' for the step in its name, and holds the last state only"
        self.assertEqual(run.log.count(told), 1)
        self.assertEqual(run.log.count("holds the last state only"), 1)


class RegionRefusals(Case):
    @staticmethod
    def line(name):
        return (f"region interface/mesh: '{name}' is no fix solid/cull: define the fix before the region, and delete the region "
                "before the fix")

    def test_unknown_fix(self):
        self.refused(deck(FIX, "region solid interface/mesh cul"), self.line("cul"))

    def test_fix_of_another_style(self):
        self.refused(deck(FIX, "region solid interface/mesh grav"), self.line("grav"))

    def test_fix_that_was_deleted(self):
        self.refused(deck(FIX, "region solid interface/mesh cull", "unfix cull", "group inner region solid"), self.line("cull"))

    # asked once in a time step already, the engine asks for no new shape in that step
    ASKED = (BLOCK + CULL_BLOCK + "\nregion solid interface/mesh cull\nvariable n equal count(all,solid)\nrun 200\n"
             'print "first $n"\nunfix cull\n')

    def test_fix_that_was_deleted_after_a_question(self):
        run = self.refused(self.ASKED + 'print "then $n"\n', self.line("cull"))
        self.assertGreater(int(re.search(r"^first (\d+)$", run.log, re.M).group(1)), 0)

    def test_fix_that_was_deleted_and_made_anew(self):
        run = self.accepted(self.ASKED + CULL_BLOCK + '\nprint "then $n"\nrun 200\nprint "last $n"\n')
        first, then, last = (int(re.search(rf"^{word} (\d+)$", run.log, re.M).group(1)) for word in ("first", "then", "last"))
        self.assertEqual(then, 0, "the new fix has culled nothing yet")
        self.assertGreater(first, 0)
        self.assertGreater(last, 0)

    def test_no_fix_named(self):
        self.refused(deck(FIX, "region solid interface/mesh"), "region interface/mesh: give the ID of a fix solid/cull")

    def test_move_and_rotate(self):
        for words in ("move v_x NULL NULL", "rotate v_x 0 0 0 0 0 1"):
            self.refused(deck(FIX, "variable x equal 0", f"region solid interface/mesh cull {words}"),
                         "region interface/mesh: it moves with its bodies, and the keywords move and rotate would do nothing: "
                         "leave them out")

    REGIONS = ("region solid interface/mesh cull", "region half block INF INF INF INF INF 0.01 units box",
               "region both intersect 2 half solid", "region one union 2 solid half", "region nested union 2 one half")

    @staticmethod
    def unknown_elsewhere(who, region):
        return (f"region interface/mesh: each rank knows it for its own granules, and it follows them: {who} cannot use "
                f"'{region}'; give a region of another style")

    def test_fixes_that_ask_for_points_of_other_ranks(self):
        distribution = ("fix t1 all particletemplate/sphere 15485863 atom_type 1 density constant 2500 radius constant 0.0014",
                        "fix dist all particledistribution/discrete 32452843 1 t1 1")
        insert = "seed 32452867 distributiontemplate dist insert_every once particles_in_region 5 region"
        for region in ("solid", "both", "one", "nested"):
            self.refused(deck(FIX, *self.REGIONS, *distribution, f"fix ins all insert/pack {insert} {region}"),
                         self.unknown_elsewhere("fix ins insert/pack", region))
        rate = insert.replace("insert_every once", "insert_every 10 nparticles 10 particlerate 100")
        for style, words in {"insert/rate/region": f"{rate} solid",
                             "region/variable": "3 half solid half",
                             "mesh/surface": "file floor.stl type 1 region solid",
                             "ave/euler": "nevery 1 cell_size_relative 3 parallel yes basevolume_region solid"}.items():
            self.refused(deck(FIX, *self.REGIONS, *distribution, f"fix ins all {style} {words}"),
                         self.unknown_elsewhere(f"fix ins {style}", "solid"))

    def test_what_keeps_its_group_out_of_solid_bodies(self):
        for region in ("solid", "nested"):
            for line in (f"fix x all addforce 0 0 1e-4 region {region}", f"fix x all setforce NULL NULL 0 region {region}",
                         f"fix x all aveforce NULL NULL 0 region {region}",
                         f"fix x all buoyancy level 0.06 dim z density 1000 region {region}",
                         f"fix x all wall/region {region} harmonic 0.1 0 0.005",
                         f"fix x all property/atom/tracer region_mark {region} mark_step 20 check_mark_every 10",
                         f"fix x all property/atom/regiontracer/time add_region {region} check_region_every 10",
                         f"compute x all nparticles/tracer/region region_count {region} tracer tr"):
                kind, _, _, style = line.split()[:4]
                self.refused(deck(FIX, *self.REGIONS, line),
                             f"region interface/mesh: granules of the group of {kind} x {style} are not culled, so none of them would be in "
                             f"'{region}'; give a region of another style, or a group")
        self.accepted(deck(FIX, *self.REGIONS, "fix x all addforce 0 0 1e-6 region half", "run 1"))

    def test_random_places_on_several_ranks(self):
        lines = deck(FIX, *self.REGIONS, "create_atoms 1 random 5 12345 both")
        self.refused(lines, self.unknown_elsewhere("create_atoms random on several ranks", "both"), ranks=2)

    def test_a_region_that_takes_the_place_of_one_made_of_meshes(self):
        self.accepted(deck(FIX, *self.REGIONS, "region nested delete", "region other block 0 0.012 0 0.012 0.01 0.03 units box",
                           "fix t1 all particletemplate/sphere 15485863 atom_type 1 density constant 2500 radius constant 0.0014",
                           "fix dist all particledistribution/discrete 32452843 1 t1 1",
                           "fix ins all insert/pack seed 32452867 distributiontemplate dist insert_every once "
                           "particles_in_region 2 region other", "run 1"))

    def test_reuse_of_a_name(self):
        self.refused(deck(FIX, "region box interface/mesh cull"), "Reuse of region ID")

    def test_the_region_holds_the_culled_granules(self):
        run = self.accepted(BLOCK + CULL_BLOCK + "\nregion solid interface/mesh cull\nregion free interface/mesh cull side out\n"
                            "run 200\ngroup inner region solid\ngroup outer region free\nvariable i equal count(inner)\n"
                            "variable o equal count(outer)\nvariable s equal f_cull[2]\nvariable a equal atoms\n"
                            'print "counts ${i} ${o} ${s} ${a}"\n')
        inner, outer, shell, atoms = map(float, re.search(r"^counts (.*)$", run.log, re.M).group(1).split())
        self.assertEqual(atoms, 343)  # between runs the deck sees the whole bed
        self.assertGreater(shell, 0)
        self.assertGreater(inner, shell)  # interior granules are in it too
        self.assertEqual(inner + outer, atoms)


class ContactModelChanges(Case):
    """Histories are kept as numbers of one contact model."""
    PLAIN = "gran model hertz tangential no_history"

    def test_restart_with_another_contact_model(self):
        with tempfile.TemporaryDirectory(prefix="solidcull-") as folder:
            file = Path(folder) / "stop.restart"
            self.accepted(BLOCK + f"{CULL_BLOCK}\nrun 200\nwrite_restart {file}\n")
            head = BLOCK[:BLOCK.index("region box")] + f"read_restart {file}\nneighbor 0.0004 bin\nneigh_modify delay 0\n"
            rest = MATERIAL + f"pair_style {self.PLAIN}\npair_coeff * *\ntimestep 2e-5\nfix grav all gravity 9.81 vector 0 0 -1\n"
            self.refused_by_fix(head + rest + f"fix integrate all nve/sphere\n{CULL_BLOCK}\nrun 0\n",
                                "the restart file holds contact histories of 3 numbers and this deck's contact model has 0: use the "
                                "contact model that the file was written with")

    def test_another_contact_model_between_runs_restores_all(self):
        smooth = BLOCK.replace(HERTZ, "gran model hertz tangential off")
        for before, model in ((smooth, self.PLAIN), (BLOCK, self.PLAIN), (BLOCK.replace(HERTZ, self.PLAIN), HERTZ)):
            run = self.accepted(before + f"{CULL_BLOCK}\nrun 200\npair_style {model}\npair_coeff * *\nrun 10\n")
            self.assertIn("fix cull solid/cull: 'pair_style' may change which granules there are: all are exterior now", run.log)


class Breakdowns(Case):
    """Motions that are no numbers any more: one line with tag and step, where the stock engine goes on or crashes."""
    PUSH = "variable push equal {}\ngroup one id {}\nfix push one addforce v_push 0 0\n"
    NOT_A_NUMBER, INFINITE = "exp(1000)-exp(1000)", "exp(1000)"

    def broken(self, lines, of, cull=CULL_BLOCK, before="run 200\n", **how):
        run = Run(BLOCK + cull + "\n" + before + lines + "run 200\n", **how)
        told = f"screen:\n{run.screen[-1500:]}\noutput:\n{run.output[-1500:]}"
        errors = [line for line in run.output.splitlines() if line.startswith("ERROR")]
        self.assertEqual(len(errors), 1, told)
        self.assertRegex(errors[0], r"^ERROR: fix cull solid/cull: on rank \d at step \d+: the (place|velocity|spin|load) of granule " +
                         of + r" is no number \([-+.\w ]+\): take a smaller timestep, and create no granule inside another$", told)
        self.assertNotIn("Signal", run.output)
        self.assertNotEqual(run.status, 0)

    def test_two_granules_in_one_place(self):
        lines = "create_atoms 1 single 0.0105 0.0105 0.0195 units box\n" * 2 + "set group all diameter 0.003 density 2500\n"
        for exterior in ("live depth 1", "sleep"):
            self.broken(lines, "34[45]", CULL_BLOCK.replace("live depth 1", exterior))

    def test_a_force_that_is_no_number(self):
        for exterior in ("live depth 1", "sleep"):
            for force in (self.NOT_A_NUMBER, self.INFINITE):
                for ranks in (1, 2):
                    self.broken(self.PUSH.format(force, 5), "5", CULL_BLOCK.replace("live depth 1", exterior), ranks=ranks)

    def test_before_anything_is_culled(self):
        self.broken(self.PUSH.format(self.NOT_A_NUMBER, 340), "340", before="")

    def test_a_force_that_throws_a_granule_out_of_the_box(self):
        for exterior in ("live depth 1", "sleep"):
            run = Run(BLOCK + CULL_BLOCK.replace("live depth 1", exterior) + "\nrun 200\n" + self.PUSH.format("1e300", 340) + "run 200\n")
            told = run.errors(run.output) or run.errors(run.screen)
            self.assertEqual(len(told), 1, run.output[-1500:])
            self.assertRegex(told[0], "^ERROR: (Lost atoms|fix cull solid/cull: .* of granule .* is no number)")

    def lost(self, lines, cull, ranks):
        """What is thrown out of the box is lost, and nothing else happens."""
        text = BLOCK + "\n" + cull + "\nrun 200\n" + lines
        run = self.accepted(text.replace("lost error", "lost ignore") + "run 200\n", ranks=ranks)
        self.assertNotIn("internal error", run.output)
        return text

    def test_a_time_step_far_too_large(self):
        for exterior in ("live depth 1", "sleep"):
            for ranks in (1, 2):
                for dt in ("1e-2", "1"):
                    text = self.lost(f"timestep {dt}\n", CULL_BLOCK.replace("live depth 1", exterior), ranks)
                    stopped = Run(text + "thermo 10\nrun 200\n", ranks=ranks)
                    self.assertEqual(len(stopped.errors(stopped.screen)), 1, stopped.output[-1500:])
                    self.assertRegex(stopped.errors(stopped.screen)[0], "^ERROR: Lost atoms: original ")

    def test_granules_created_one_in_another(self):
        lines = "create_atoms 1 single 0.0105 0.0105 0.0201 units box\nset group all diameter 0.003 density 2500\n"
        for exterior in ("live depth 1", "sleep"):
            for ranks in (1, 2):
                self.lost(lines, CULL_BLOCK.replace("live depth 1", exterior), ranks)


@unittest.skipUnless(shutil.which("c++"), "no C++ compiler here")
class NothingAfterAnError(Case):
    """Where `rand` says so, the stock engine prints random characters after an error: one in five. Here `rand` always says so."""

    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory(prefix="solidcull-")
        cls.addClassCleanup(folder.cleanup)
        cls.dice = Path(folder.name) / "libdice.so"
        subprocess.run(["c++", "-shared", "-fPIC", "-x", "c++", "-", "-o", cls.dice], input='extern "C" int rand() { return 0; }\n',
                       text=True, check=True)

    def both(self, text, program=None, plugin=None):
        """What screen and log end with, from the error on."""
        run = Run(text, program=program, preload=f"{plugin}:{self.dice}" if plugin else self.dice)
        self.assertNotEqual(run.status, 0, run.output[-2000:])
        return ["".join(told.partition("ERROR: ")[1:]) for told in (run.screen, run.log)]

    def one_line(self, text, error, **how):
        for told in self.both(text, **how):
            self.assertRegex(told, rf"\AERROR: {error} \(\S+:\d+\)\n\Z")

    @staticmethod
    def all_of(reader):
        told = b""
        with contextlib.closing(os.fdopen(reader, "rb", buffering=0)) as terminal, contextlib.suppress(OSError):  # which is its end
            while more := terminal.read(4096):
                told += more
        return told

    def test_an_error_of_the_line(self):
        self.one_line(deck(FIX + " depth 99"), "fix cull solid/cull: keyword 'depth' has the value '99': .*")
        self.one_line(deck("region solid interface/mesh gone"), "region interface/mesh: 'gone' is no fix solid/cull: .*")

    def test_errors_of_liggghts(self):
        for line, error in (("no_such_command", "Unknown command: no_such_command"),
                            ("fix side all wall/gran model hertz primitive type 1 xplane 0 oops", r"Fix wall/gran \(id side\): .*"),
                            ("compute near all coord/atom", r"Compute coord/atom \(id near\): .*")):
            with self.subTest(line):
                self.one_line(deck(line), error)
                self.one_line(deck(FIX, line), error)

    @unittest.skipUnless(STOCK and engine_of(STOCK) == engine_of(LAUNCHER), "no stock liggghts here with the library of this build")
    def test_the_stock_engine_has_the_second_line_and_with_the_library_has_not(self):
        for told in self.both(deck("no_such_command"), program=STOCK):
            self.assertGreater(told.count("\n"), 1, told)
        self.one_line(deck("no_such_command"), "Unknown command: no_such_command", program=STOCK, plugin=LIBRARY)

    def test_errors_of_one_rank_and_of_the_command_line(self):
        for words, error in ((("-in", "deck.in"), "ERROR on proc 0: Cannot open input script gone"), (("-oops",), "ERROR: Invalid command-line"),
                             (("-reorder", "custom", "gone"), "ERROR on proc 0: Cannot open -reorder file")):
            with self.subTest(error), tempfile.TemporaryDirectory(prefix="solidcull-") as folder:
                (Path(folder) / "deck.in").write_text("include gone\n")
                env = {**engine.environment(1), "LD_PRELOAD": str(self.dice)}
                # what goes to a file is lost when a rank ends all
                reader, terminal = pty.openpty()
                done = subprocess.run([LAUNCHER, *words], cwd=folder, env=env, timeout=TIME_LIMIT, stdout=terminal,
                                      stderr=subprocess.DEVNULL, check=False)
                os.close(terminal)
                told = self.all_of(reader).decode(errors="replace").replace("\r", "")
                self.assertNotEqual(done.returncode, 0, told)
                self.assertRegex(told, rf"(?m)^{error}.*\(\S+:\d+\)\n\Z")


class FixLineAgain(Case):
    def test_a_fix_of_the_same_name_finds_all_granules(self):
        for ranks in (1, 2):
            with self.subTest(ranks=ranks):
                run = self.accepted(BLOCK + f"{CULL_BLOCK}\nrun 200\nvariable i equal f_cull[3]\nprint \"stored ${{i}}\"\n{CULL_BLOCK}\nrun 20\n"
                                    "unfix cull\nrun 0\nvariable n equal atoms\nprint \"atoms ${n}\"\n", ranks=ranks)
                stored, atoms = (int(re.search(rf"^{word} (\d+)$", run.screen, re.M)[1]) for word in ("stored", "atoms"))
                self.assertGreater(stored, 0)
                self.assertEqual(atoms, 343)


class MostIsDeleted(Case):
    def test_what_the_deck_deletes_is_not_lost(self):
        for keywords in ("", " exterior sleep"):
            with self.subTest(keywords):
                run = self.accepted(BLOCK + f"{CULL_BLOCK}{keywords}\nrun 200\ngroup gone id > 20\ndelete_atoms group gone compress no\nrun 50\n"
                                    "unfix cull\nrun 0\nvariable n equal atoms\nprint \"atoms ${n}\"\n")
                self.assertIn("atoms 20\n", run.screen)


class BoxThatFollows(Case):
    """Its borders between ranks move with it, and granules of a body that lie on them change ranks."""
    STICKY = "gran model hertz tangential off cohesion sjkr"
    # columns of small and large granules that nothing holds, one of them on the border between two ranks
    LOOSE = deck("delete_atoms group all", "lattice sc 0.003 origin 0.5 0.5 0.5", "region fill block 0 0.021 0 0.021 0 0.015 units box",
                 "create_atoms 1 region fill", "set group all diameter 0.003 density 2500", "set group all type/fraction 2 0.4 67867967",
                 "set type 2 diameter 0.0015", FIX, "run 0", "run 50", box="block 0 0.021 0 0.021 -0.0001 0.06", pair=STICKY)
    for one, two in (("boundary f f f", "boundary s p s"), ("create_box 1", "create_box 2"), ("timestep 2e-5", "timestep 3e-5"),
                     ("neighbor 0.0004", "neighbor 0.0003"), ("peratomtype 5.e6", "peratomtype 5.e6 5.e6"), ("peratomtype 0.3", "peratomtype 0.3 0.3"),
                     ("peratomtypepair 1 0.3", "peratomtypepair 2 0.3 0.3 0.3 0.3"), ("peratomtypepair 1 0.5", "peratomtypepair 2 0.5 0.5 0.5 0.5"),
                     ("wall/gran model hertz tangential history", "wall/gran model hertz tangential off cohesion sjkr"),
                     ("pair_style", "fix m5 all property/global cohesionEnergyDensity peratomtypepair 2 5000 5000 5000 5000\npair_style"),
                     ("fix grav all gravity 9.81 vector 0 0 -1\n", "")):
        LOOSE = LOOSE.replace(one, two)

    def test_runs_and_restart_files_on_several_ranks(self):
        for ranks in (2, 3):
            with self.subTest(ranks=ranks):
                run = self.accepted(self.LOOSE + "write_restart stop.restart\nrun 50\nunfix cull\nrun 0\nvariable n equal atoms\n"
                                    "print \"atoms ${n}\"\n", ranks=ranks)
                self.assertRegex(run.screen, r"  left out      = [1-9]")
                self.assertIn("atoms 245\n", run.screen)


class OneRankWithoutMpirun(Case):
    """Open MPI starts a daemon for such a run, which fails on a machine that is busy; the launcher asks for none."""
    NO_DAEMON = "OMPI_MCA_ess_singleton_isolated"
    TINY = deck(FIX, "run 1")

    def started(self, **how):
        # a folder that has no daemon stands for a machine that cannot start one
        return Run(self.TINY, OPAL_BINDIR="/nowhere", **how)

    def test_the_launcher_needs_no_daemon(self):
        run = self.started(unset=[self.NO_DAEMON])
        self.assertEqual(run.status, 0, run.output[-2000:])
        self.assertIn("Loop time", run.log)

    def test_what_the_user_has_set_stays(self):
        run = self.started(**{self.NO_DAEMON: "0"})
        self.assertNotEqual(run.status, 0, "with Open MPI, this is a run that needs the daemon")
        self.assertIn("orte_init failed", run.output)

    def test_under_mpirun_nothing_is_changed(self):
        self.assertEqual(Run(self.TINY, ranks=2, unset=[self.NO_DAEMON]).status, 0)


class NoHarm(Case):
    """A deck that does not ask for the fix runs as if the plug-in were not there."""
    THERMO = ("compute rot all erotate/sphere\nthermo_style custom step atoms ke c_rot vol\nthermo_modify format float %.17g\n"
              "thermo 50\nrun 1500\n")

    @unittest.skipUnless(STOCK, "no stock liggghts here")
    def test_without_the_fix_output_is_the_same_to_the_last_digit(self):
        text = POUR + self.THERMO
        stock = self.accepted(text, program=STOCK).thermo()
        self.assertGreaterEqual(len(stock), 31)
        self.assertEqual(stock[-1].split()[:2], ["1500", "500"])
        self.assertRegex(stock[-1].split()[2], r"\d\.\d{14}")
        self.assertEqual(self.accepted(text).thermo(), stock)
        self.assertEqual(self.accepted(text, program=STOCK, preload=LIBRARY).thermo(), stock)

    @unittest.skipUnless(STOCK and engine_of(STOCK) == engine_of(LAUNCHER), "no stock liggghts here with the library of this build")
    def test_the_preloaded_library_runs_a_deck_with_the_fix(self):
        text = BLOCK + CULL_BLOCK + "\nregion solid interface/mesh cull\nthermo_style custom step atoms ke f_cull[1] f_cull[3]\n" \
            "thermo_modify format float %.17g\nthermo 50\nrun 400\nunfix cull\nthermo_style custom step atoms ke\nrun 0\n"
        # the region needs its fix: deleted before it
        text = text.replace("unfix cull", "region solid delete\nunfix cull")
        mine = self.accepted(text)
        self.assertGreater(float(mine.thermo()[-2].split()[4]), 0, "nothing was culled")
        self.assertEqual(mine.thermo()[-1].split()[1], "343")
        self.assertEqual(self.accepted(text, program=STOCK, preload=LIBRARY).thermo(), mine.thermo())

    def test_the_fix_says_its_version_once(self):
        run = self.accepted(deck(FIX, "run 1", "run 1"))
        for text in (run.log, run.screen):
            self.assertEqual(re.findall(r"^fix cull solid/cull: version .*$", text, re.M), [f"fix cull solid/cull: version {VERSION}"])

    def test_the_launcher_says_its_version_without_a_deck(self):
        for word in ("-version", "--version", "-v"):
            done = subprocess.run([LAUNCHER, word], text=True, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                  timeout=TIME_LIMIT, check=False)
            self.assertEqual((done.returncode, done.stdout), (0, f"solidcull {VERSION}\n"))

    BLOCK_OF_A_RUN = re.compile(r"^fix cull solid/cull: (\d+) steps, (\d+) granules((?:\n  [a-z -]+ = .*)+)$", re.M)
    COUNTERS = re.compile(r"^fix cull solid/cull: (\d+) exterior, \d+ interface, \d+ interior granules in \d+ bodies; culled \d+, restored \d+, "
                          r"carves \d+; mass error \S+ kg, energy added \S+ J; \d+ culled again, \d+ had moved$", re.M)
    SECONDS = re.compile(r"^fix cull solid/cull: \S+ s in the fix since it was made: load ", re.M)

    def test_each_run_ends_with_a_short_block(self):
        run = self.accepted(BLOCK + CULL_BLOCK + "\nthermo_style custom step f_cull[31] f_cull[32] f_cull[33] f_cull[34]\n"
                            "run 200\nrun 300\nrun 0\n")
        for text in (run.log, run.screen):
            blocks = [(int(steps), int(granules), dict(re.findall(r"^  (\S.*?) += (.*)$", lines, re.M)))
                      for steps, granules, lines in self.BLOCK_OF_A_RUN.findall(text)]
            self.assertEqual([b[:2] for b in blocks], [(200, 343), (300, 343)], "none after a run of no step")
            self.assertEqual((self.COUNTERS.findall(text), self.SECONDS.findall(text)), ([], []))
        rows = [[float(x) for x in row.split()] for row in run.thermo()]
        ends = [next(r for r in reversed(rows) if r[0] == step) for step in (0, 200, 500)]
        for before, after, (steps, granules, told) in zip(ends, ends[1:], blocks):
            exterior, interface, interior, times = (b - a for a, b in zip(before[1:], after[1:]))
            self.assertEqual(exterior + interface + interior, steps * granules)
            for name, counted in (("exterior", exterior), ("interface", interface), ("left out", interior)):
                mean, share = re.match(r"(\d+) \((\S+) %\)", told[name]).groups()
                self.assertAlmostEqual(float(mean), counted / steps, delta=0.51)
                self.assertAlmostEqual(float(share), 100 * counted / steps / granules, delta=0.051)
            computed, saved = map(float, re.match(r"(\S+) computed, (\S+) saved", told["granule-steps"]).groups())
            self.assertAlmostEqual(computed / (exterior + interface), 1, delta=0.006)
            self.assertAlmostEqual(saved / interior, 1, delta=0.006)
            self.assertRegex(told["time"], r"^\S+ s, of it \S+ s in the fix$", "too few granules to say how much less work it was")
            self.assertEqual(times, 0)

    def test_a_run_on_two_ranks_counts_all_granules(self):
        run = self.accepted(BLOCK + CULL_BLOCK + "\nthermo_style custom step f_cull[31] f_cull[32] f_cull[33]\nrun 200\n", ranks=2)
        told = self.BLOCK_OF_A_RUN.search(run.log)
        self.assertEqual(told.groups()[:2], ("200", "343"))
        counted = [float(x) for x in run.thermo()[-1].split()[1:]]
        self.assertEqual(sum(counted), 200 * 343)
        self.assertGreater(counted[2], 0)
        self.assertIn(f"  left out      = {counted[2] / 200:.0f} (", told[3])

    def test_per_atom_reasons(self):
        for ranks in (1, 2):
            with tempfile.TemporaryDirectory(prefix="solidcull-") as place:
                run = self.accepted(BLOCK + CULL_BLOCK + " reasons yes\n"
                                    f"dump d all custom 100 {place}/*.dump id f_cull[1] f_cull[2] f_cull[3]\nrun 200\n"
                                    "create_atoms 1 single 0.0105 0.0105 0.026 units box\ngroup ball id 344\n"
                                    "set group ball diameter 0.003 density 2500\nvelocity ball set 0 0 -4 units box\nrun 100\n"
                                    f"write_dump all custom {place}/whole id f_cull[1] f_cull[2] f_cull[3]\n", ranks=ranks)
                rows = {name: np.loadtxt(Path(place, name), skiprows=9) for name in ("0.dump", "200.dump", "300.dump", "whole")}
            exterior = {name: r[r[:, 1] == 0] for name, r in rows.items()}
            for name, r in rows.items():
                self.assertEqual(abs(r[r[:, 1] != 0, 2:]).max(initial=0), 0, "what is asleep has no reason to be awake")
                self.assertTrue(((exterior[name][:, 2] >= 1) & (exterior[name][:, 2] <= 8)).all())
            self.assertEqual(len(rows["whole"]), 344)
            self.assertGreater(len(rows["200.dump"]), len(exterior["200.dump"]))
            self.assertEqual(exterior["0.dump"][:, 3].max(), 0, "none has been culled")
            ball = exterior["300.dump"][exterior["300.dump"][:, 0] == 344]
            self.assertEqual((len(ball), ball[0, 3]), (1, 0))
            self.assertIn(1, exterior["300.dump"][:, 3], "the ball has struck")
            woken = re.findall(r"^  woken by      = loads that changed \d+ %.*, of (\d+)$", run.log, re.M)
            self.assertGreaterEqual(sum(map(int, woken)), (exterior["300.dump"][:, 3] == 1).sum())

    def test_all_counters_follow_where_they_are_asked_for(self):
        run = self.accepted(BLOCK + CULL_BLOCK + " report full\nrun 200\nrun 0\n")
        self.assertEqual(len(self.BLOCK_OF_A_RUN.findall(run.log)), 1)
        self.assertEqual(len(self.COUNTERS.findall(run.log)), 2)
        self.assertEqual(len(self.SECONDS.findall(run.log)), 2)


class CommandPages(unittest.TestCase):
    HEADINGS = ["Syntax", "Examples", "Description", "Restart and output info", "Restrictions", "Related", "Default"]

    def test_headings_are_lammps_s(self):
        around = {"fix_solid_cull": (["Glossary"], ["Appendix"]), "region_interface_mesh": ([], [])}
        for page, (before, after) in around.items():
            text = (ROOT / page / f"{page}.md").read_text()
            self.assertEqual(re.findall(r"^## (.*)$", text, re.M), before + self.HEADINGS + after, page)

    def test_links_lead_somewhere(self):
        for page in ("fix_solid_cull", "region_interface_mesh"):
            file = ROOT / page / f"{page}.md"
            for link in re.findall(r"\]\(([^)#]+)\)", file.read_text()):
                self.assertTrue((file.parent / link).exists(), f"{page}.md: {link}")


if __name__ == "__main__":
    unittest.main()
