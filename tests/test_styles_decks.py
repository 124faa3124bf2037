"""Each fix and compute style of the tables but the refused has a small deck here, run by stock and with the line.

The bed: 343 granules of 3 mm at rest between walls, and a ball that strikes the right half of it after 210 steps. By then all that
may be is culled, so that at step 100 the ball is LIGGGHTS's only atom. What a row must show follows from its treatment:

  exact, integrates    the printed value is stock's; every granule ends within MARGIN diameters of its place in stock
  atoms_only           the printed value is that of atoms, and the whole-bed value that the page names is stock's
  contacts             the same values for exterior granules; the line says what is missing
  holds, drives, whole no granule of the group is culled at any step, the others are; value and places are stock's

Between two runs a formula has stock's value, whatever the treatment, or is refused where a fix has measured atoms only.

A style is one line of FIXES or COMPUTES: the lines of the deck that use it, a value, and what the row needs besides.
"""
import math
import re
import tempfile
import unittest
from pathlib import Path
from typing import NamedTuple

from test_messages import BLOCK, HERTZ, MATERIAL, Case, Run, deck
from test_styles import computes_in_code, fixes_in_code, named, styles_of_liggghts

DIAMETER = 0.003
STEPS = 400
MARGIN = 0.05  # diameters, from stock's place. The blow moves the ball by 1.2, its neighbours by up to 0.12
CLOSE = 0.05   # of the largest value of the run
CULL = "fix cull all solid/cull every 10 calm 1 tolerance 3 0 exterior sleep speed 0.05"
SETTLE = """\
fix damping all viscous 0.02
run 1500
unfix damping
velocity all set 0 0 0
set group all omegax 0 omegay 0 omegaz 0
run 500
create_atoms 1 single 0.0150 0.0105 0.0268 units box
group ball id 344
set group ball diameter 0.005 density 4000
velocity ball set 0 0 -1
"""
REGIONS = """\
region left block INF 0.012 INF INF INF INF units box
region right block 0.012 INF INF INF INF INF units box
group left region left
group right subtract all left
"""
WALL = "wall/gran model hertz tangential history"
AS_MESH = f"unfix z0\nfix m all mesh/surface file {{place}}/floor.stl type 1\nfix z0 all {WALL} mesh n_meshes 1 meshes m\n"
WALLS = "".join(f"fix {d}{k} all {WALL} primitive type 1 {d}plane {x}\n" for d, k, x in (
    ("x", 0, 0), ("x", 1, 0.021), ("y", 0, 0), ("y", 1, 0.021), ("z", 0, 0)))
NO_WALLS = "".join(f"unfix {name}\n" for name in ("x0", "x1", "y0", "y1", "z0"))
RIGHT_ALONE = "unfix integrate\nfix integrate right nve/sphere\n"
INSERTED = """\
fix t1 all particletemplate/sphere 15485863 atom_type 1 density constant 2500 radius constant 0.001
fix dist all particledistribution/discrete 32452843 1 t1 1
region above block 0.003 0.018 0.003 0.018 0.045 0.055 units box
"""
CLUMPS = ("fix clumps all multisphere allow_group_and_set yes\n" +
          INSERTED.replace("particletemplate/sphere 15485863 atom_type 1 density constant 2500 radius constant 0.001",
                           "particletemplate/multisphere 15485863 atom_type 1 density constant 2500 nspheres 3 ntry 100000 "
                           "spheres 0 0 0 0.001 0.001 0 0 0.001 0 0.001 0 0.0008 type 1"))
INSERTION = "seed 32452867 distributiontemplate dist maxattempt 200 overlapcheck yes all_in yes"
FEW_CLUMPS = (f"fix few all insert/pack {INSERTION} orientation random insert_every once vel constant 0 0 -0.1 region above "
              "ntry_mc 10000 particles_in_region 3\n")
STREAM = ("fix face all mesh/surface/planar file {place}/inlet.stl type 1\n"
          "fix x all insert/stream seed 32452867 distributiontemplate dist nparticles 5 particlerate 100000 "
          "overlapcheck yes all_in no vel constant 0 0 -0.5 insertion_face face extrude_length 0.01\n")
# seven layers of discs, for what LIGGGHTS has in two dimensions only
FLAT = f"""\
atom_style granular
atom_modify map array
dimension 2
boundary f f p
newton off
communicate single vel yes
units si
region box block 0 0.021 -0.001 0.06 -0.0015 0.0015 units box
create_box 1 box
neighbor 0.0004 bin
neigh_modify delay 0
{MATERIAL}
pair_style {HERTZ}
pair_coeff * *
timestep 2e-5
fix grav all gravity 9.81 vector 0 -1 0
fix x0 all {WALL} primitive type 1 xplane 0
fix x1 all {WALL} primitive type 1 xplane 0.021
fix y0 all {WALL} primitive type 1 yplane 0
lattice sq 0.003 origin 0.5 0.5 0
region fill block 0 0.021 0 0.021 -0.001 0.001 units box
create_atoms 1 region fill
set group all diameter 0.003 density 2500
fix integrate all nve/sphere
fix damping all viscous 0.02
run 1500
unfix damping
{REGIONS}"""
FLIES = "fix face all mesh/surface/planar file {place}/middle.stl type 1\nrun 0\ndelete_atoms group ball\nvelocity all set 0 0 0.8\n"


class Row(NamedTuple):
    lines: str               # what uses the style; {place}: a folder with meshes
    value: str = ""          # an equal-style variable, printed each 50 steps
    whole: str = ""          # what the page names for the whole bed
    later: str = ""          # lines after a first run of 100 steps, in which all but the ball is culled
    of_ball: bool = False    # the value is of the ball, an atom at all times
    group: str = "left"      # what must not be culled, where the style holds its group
    stored: int = 25         # interior granules that there must be at some step
    style: str = "granular"  # of atoms; or a contact model
    granules: int = 344      # in the end
    lost: str = "error"      # of thermo_modify
    ranks: int = 1


FIXES = {
    # exact
    "contacthistory": Row("", "bound(ball,zmin)"),  # `tangential history` makes it
    "contacthistory/mesh": Row(AS_MESH),
    "custom_property/global": Row("fix x all custom_property/global depth scalar 2"),
    "diam/max": Row(INSERTED + "fix x all diam/max"),
    "gravity": Row("fix side all gravity 0.5 vector 1 0 0"),
    "insert/pack": Row(INSERTED + f"fix x all insert/pack {INSERTION} insert_every once vel constant 0 0 -0.1 region above "
                       "particles_in_region 5", granules=349),
    "insert/rate/region": Row(INSERTED + f"fix x all insert/rate/region {INSERTION} nparticles 5 particlerate 100000 "
                              "insert_every 50 vel constant 0 0 -0.1 region above", granules=349),
    "insert/stream": Row(INSERTED + STREAM, granules=349),
    "massflow/mesh": Row(FLIES + "fix x all massflow/mesh mesh face count once vec_side 0 0 1", "f_x[2]", granules=343),
    "mesh/surface": Row(AS_MESH),
    "mesh/surface/planar": Row(AS_MESH.replace("mesh/surface", "mesh/surface/planar")),
    "move/mesh": Row(AS_MESH + "fix x all move/mesh mesh m linear 0 0 -0.02"),
    "move/mesh/file": Row(AS_MESH + "fix x all move/mesh/file mesh m linear 0 0 -0.02"),
    "move/mesh/gran": Row(AS_MESH + "fix x all move/mesh/gran mesh m linear 0 0 -0.02"),
    "neighlist/mesh": Row(AS_MESH),
    "particledistribution/discrete": Row(INSERTED),
    "particledistribution/discrete/massbased": Row(INSERTED.replace("discrete", "discrete/massbased")),
    "particledistribution/discrete/numberbased": Row(INSERTED.replace("discrete", "discrete/numberbased")),
    "particletemplate/multiplespheres": Row(INSERTED.replace(
        "sphere 15485863 atom_type 1 density constant 2500 radius constant 0.001",
        "multiplespheres 15485863 atom_type 1 density constant 2500 nspheres 2 ntry 100000 spheres 0 0 0 0.001 0.003 0 0 0.001")),
    "particletemplate/multisphere": Row(CLUMPS),
    "particletemplate/sphere": Row(INSERTED),
    "print": Row('fix x all print 50 "$(step)" file {place}/print'),
    "property/atom": Row("fix x all property/atom colour scalar yes no no 3\ncompute sum ball reduce sum f_x", "c_sum"),
    "property/atomtype": Row("fix x all property/atomtype colour peratomtype 3"),
    "property/atomtypepair": Row("fix x all property/atomtypepair colour peratomtypepair 1 3"),
    "property/global": Row("fix x all property/global colour scalar 3"),
    "region/variable": Row("fix x all region/variable n_regions 2 times 1 2 regions left right"),
    "store/state": Row("fix x all store/state 0 x y z\ncompute sum ball reduce sum f_x[3]", "c_sum"),
    "wall/gran": Row(f"fix lid all {WALL} primitive type 1 zplane 0.024", "bound(ball,zmin)"),
    "ave/correlate": Row("variable z equal bound(ball,zmin)\nfix x all ave/correlate 10 5 50 v_z ave running", "f_x[1][3]"),
    "ave/time": Row("variable z equal bound(ball,zmin)\nfix x all ave/time 10 5 50 v_z", "f_x"),
    # they move granules
    "multisphere": Row(CLUMPS + FEW_CLUMPS, granules=353),
    "nve/sphere": Row("", "vcm(ball,z)"),
    # they measure atoms only
    "ave/euler": Row("fix x all ave/euler nevery 50 cell_size_relative 4.5 parallel no"),
    "ave/euler/stress": Row("fix x all ave/euler/stress nevery 50 cell_size_relative 4.5 parallel no"),
    "ave/histo": Row("fix x all ave/histo 50 1 50 0 0.1 1 z mode vector", "f_x[1]", "f_x[1]+f_cull[3]"),
    "ave/spatial": Row("fix x all ave/spatial 50 1 50 z lower 0.1 density/number units box", "f_x[1][2]", "f_x[1][2]+f_cull[3]"),
    "check/timestep/gran": Row("fix x all check/timestep/gran 50 0.9 0.9 warn no", "f_x[1]"),
    "contactproperty/atom": Row("fix x all contactproperty/atom gaps 1 gap 0"),
    "contactproperty/atom/wall": Row("fix x all contactproperty/atom/wall gaps 1 gap 0 primitive z0"),
    "continuum/weighted": Row(NO_WALLS + "fix x all continuum/weighted kernel_radius 0.003 compute stress\n" + WALLS),
    "store/force": Row("fix x all store/force\ncompute sum ball reduce sum f_x[3]", "c_sum", of_ball=True),
    # they hold their group
    "aveforce": Row("fix x left aveforce NULL NULL -1e-4"),
    "enforce2d": Row("fix x left enforce2d", style="2d", granules=49, stored=4),
    "freeze": Row("fix x left freeze"),
    "lineforce": Row("fix x left lineforce 0 0 1"),
    "move": Row(RIGHT_ALONE + "fix x left move linear 0 0 0.1"),
    "nve/noforce": Row(RIGHT_ALONE + "fix x left nve/noforce"),
    "planeforce": Row("fix x left planeforce 0 1 0"),
    "setforce": Row("fix x left setforce 0 0 NULL"),
    # they act on each granule of their group
    "addforce": Row("fix x left addforce 1e-4 0 0"),
    "ave/atom": Row("fix x left ave/atom 1 50 50 z\ncompute most left reduce max f_x", "c_most"),
    "buoyancy": Row("fix x left buoyancy level 0.06 dim z density 1000"),
    "drag": Row("fix x left drag 0.01 0.01 0.05 1e-4 0.01"),
    "efield": Row("set group all charge 1\nfix x left efield 1e-4 0 0", style="hybrid granular charge"),
    "external": Row("fix x left external pf/array 1"),
    "fiber/spring/simple": Row("fix v all property/global characteristicVelocity scalar 2\n"
                               "fix x left fiber/spring/simple tether 0.01 0.01 0.05 0.1 0.01"),
    "massflow/mesh/sieve": Row(AS_MESH + "fix x left massflow/mesh/sieve mesh m count once vec_side 0 0 -1 sieveSize 0.001 "
                               "sieveSpacing 0.001 sieveStiffness 100 sieveDamping 0.1"),
    "momentum": Row("fix x left momentum 10 linear 1 1 1"),
    "nve": Row(RIGHT_ALONE + "fix x left nve"),
    "nve/limit": Row(RIGHT_ALONE + "fix x left nve/limit absolute 1e-5"),
    "property/atom/regiontracer/time": Row("fix x left property/atom/regiontracer/time add_region left check_region_every 10\n"
                                           "compute most left reduce max f_x[1]", "c_most"),
    "property/atom/tracer": Row("fix x left property/atom/tracer region_mark left mark_step 2050 check_mark_every 10", "f_x"),
    "property/atom/tracer/stream": Row(INSERTED + STREAM +
                                       "fix tr left property/atom/tracer/stream mark_step 2010 insert_stream x n_tracer 2 "
                                       "every once", granules=349),
    "spring": Row("fix x left spring tether 1 0.005 0.0105 0.02 0"),
    "spring/self": Row("fix x left spring/self 1"),
    "viscous": Row("fix x left viscous 0.01"),
    "wall/region": Row("region inner block -0.003 0.024 -0.003 0.024 -0.003 0.05 units box\n"
                       "fix x left wall/region inner harmonic 0.1 0 0.005"),
}
COMPUTES = {
    # exact
    "pe": Row("compute x all pe", "c_x"),
    "pe/atom": Row("compute a all pe/atom\ncompute x all reduce sum c_a", "c_x"),
    "slice": Row("compute a left com\ncompute x all slice 1 3 1 c_a", "c_x[2]"),
    # sums over atoms
    "displace/atom": Row("compute a all displace/atom\ncompute x ball reduce max c_a[4]", "c_x", of_ball=True),
    "erotate": Row("compute x all erotate", "c_x", "f_cull[28]"),
    "erotate/multisphere": Row(CLUMPS + FEW_CLUMPS + "compute x all erotate/multisphere", "c_x", granules=353),
    "erotate/sphere": Row("compute x all erotate/sphere", "c_x", "f_cull[28]"),
    "erotate/sphere/atom": Row("compute a all erotate/sphere/atom\ncompute x all reduce sum c_a", "c_x", "f_cull[28]"),
    "ke": Row("compute x all ke", "c_x", "f_cull[27]"),
    "ke/atom": Row("compute a all ke/atom\ncompute x all reduce sum c_a", "c_x", "f_cull[27]"),
    "ke/multisphere": Row(CLUMPS + FEW_CLUMPS + "compute x all ke/multisphere", "c_x", granules=353),
    "multisphere": Row(CLUMPS + FEW_CLUMPS + "compute a all multisphere property vcm\ncompute x all reduce min c_a[3]", "c_x",
                       granules=353),
    "property/atom": Row("compute a all property/atom mass\ncompute x all reduce sum c_a", "c_x", "c_x+f_cull[5]"),
    "reduce": Row("variable one atom 1\ncompute x all reduce sum v_one", "c_x", "c_x+f_cull[3]"),
    "reduce/region": Row("compute a all property/atom mass\ncompute x all reduce/region left sum c_a", "c_x"),
    # contacts within bodies are missing
    "centro/atom": Row("compute a all centro/atom 6\ncompute x ball reduce sum c_a", "c_x", of_ball=True),
    "cna/atom": Row("compute a all cna/atom 0.004\ncompute x ball reduce sum c_a", "c_x", of_ball=True),
    "contact/atom": Row("compute a all contact/atom\ncompute x ball reduce sum c_a", "c_x", of_ball=True),
    "contact/atom/gran": Row("compute a all contact/atom/gran\ncompute x all reduce sum c_a", "c_x"),
    "coord/atom": Row("compute a all coord/atom 0.0045\ncompute x all reduce sum c_a", "c_x"),
    "pair/gran/local": Row("compute a all pair/gran/local delta force\ncompute x all reduce max c_a[4]", "c_x"),
    "stress/atom": Row("compute a all stress/atom\ncompute x ball reduce sum c_a[3]", "c_x", of_ball=True),
    "wall/gran/local": Row(AS_MESH + "compute a all wall/gran/local force\ncompute x all reduce sum c_a[3]", "c_x"),
    # of the group as a whole
    "atom/molecule": Row("variable one atom 1\ncompute x left atom/molecule v_one", style="hybrid granular molecular"),
    "cluster/atom": Row("compute a left cluster/atom 0.0031\ncompute x left reduce max c_a", "c_x"),
    "com": Row("compute x left com", "c_x[3]"),
    "com/molecule": Row("compute x left com/molecule", "c_x[1][3]", style="hybrid granular molecular"),
    "gyration": Row("compute x left gyration", "c_x"),
    "gyration/molecule": Row("compute x left gyration/molecule", "c_x[1]", style="hybrid granular molecular"),
    "inertia/molecule": Row("compute x left inertia/molecule", "c_x[1][1]", style="hybrid granular molecular"),
    "msd": Row("compute x left msd", "sqrt(c_x[4])"),
    "msd/molecule": Row("compute x left msd/molecule", "sqrt(c_x[1][4])", style="hybrid granular molecular"),
    "nparticles/tracer/region": Row("fix tr left property/atom/tracer region_mark left mark_step 2050 check_mark_every 10\n"
                                    "compute x left nparticles/tracer/region region_count left tracer tr", "c_x[1]"),
    "pressure": Row("compute t all temp\ncompute x all pressure t", "c_x", group="all", stored=-1),
    "property/molecule": Row("compute x left property/molecule count", "c_x[1]", style="hybrid granular molecular"),
    "rdf": Row("compute x left rdf 10", "c_x[1][2]"),
    "temp": Row("compute x left temp", "sqrt(c_x)"),
}


# of pair_style gran: each with the same history, and the few steps that its stiffness allows
MODELS = ["model hooke", "model hertz", "model hooke/stiffness tangential history", "model hertz/stiffness tangential history",
          "model hooke/hysteresis tangential history", "model luding tangential history", "model luding tangential tan_luding",
          "model luding tangential tan_luding rolling_friction luding", "model thornton_ning tangential history",
          "model edinburgh tangential history", "model edinburgh/stiffness tangential history", "model hertz tangential no_history",
          "model hertz tangential history cohesion sjkr", "model hertz tangential history cohesion sjkr2",
          *(f"model hertz tangential history rolling_friction {r} surface default" for r in ("cdt", "epsd", "epsd2", "epsd3"))]
STIFF = ("thornton_ning", "model edinburgh tangential")  # they fly apart in stock with a step of 2e-5 s
REFUSED_MODELS = {"easo/capillary/viscous", "washino/capillary/viscous", "multicontact", "superquadric"}
CONSTANTS = {"coefficientRollingFriction": 0.1, "coefficientRollingViscousDamping": 0.1, "cohesionEnergyDensity": 1000, "kn": 2e3,
             "kt": 1e3, "gamman": 2e4, "gammat": 1e4, "coefficientMaxElasticStiffness": 2, "coefficientAdhesionStiffness": 0.01,
             "coefficientPlasticityDepth": 0.1, "coefficientRestitutionLog": -1.2, "UnloadingStiffness": 5, "LoadingStiffness": 2e3,
             "pullOffForce": 0, "surfaceEnergy": 0.1, "FrictionViscosity": 0.1, "FluidViscosity": 0.1, "coeffFrictionStiffness": 0.5,
             "coeffRollingStiffness": 0.5}
SCALARS = {"rollingStiffness": 1, "overlapExponent": 1.5, "adhesionExponent": 1.5, "characteristicVelocity": 1}
OF_MODELS = "".join([f"fix p{k} all property/global {c} peratomtypepair 1 {x}\n" for k, (c, x) in enumerate(CONSTANTS.items())] +
                    [f"fix s{k} all property/global {c} scalar {x}\n" for k, (c, x) in enumerate(SCALARS.items())] +
                    ["fix yield all property/global coefficientYieldRatio peratomtype 0.5\n"])
# what the page names for the whole bed, besides computes and fixes: a value of stock, and with the line
WHOLE_BED = {
    "count(all)": "f_cull[1]+f_cull[2]+f_cull[3]",
    "mass(all)": "f_cull[23]",
    "xcm(all,x)": "f_cull[24]",
    "xcm(all,y)": "f_cull[25]",
    "xcm(all,z)": "f_cull[26]",
    "vcm(all,z)*mass(all)": "vcm(all,z)*mass(all)+f_cull[15]",
}
# functions of variables and of thermo, evaluated between runs
FUNCTIONS = ["count(all)", "mass(all)", "xcm(all,z)", "vcm(all,z)", "fcm(all,z)", "bound(all,zmax)", "gyration(all)", "ke(all)", "angmom(all,x)",
             "torque(all,x)", "inertia(all,zz)", "omega(all,z)", "count(all,left)", "mass(left,right)", "z[100]", "vz[344]", "r[20]",
             "atoms", "fz[20]", "tqx[20]"]
NOT_IN_FORMULAS = ["gyration/molecule"]  # LIGGGHTS says that it is not current, however it was used
EQUAL = 1e-3  # of the largest value of the run, or of what is small beside the bed's weight and the ball's motion
SMALL = {"angmom(all,x)": 1e-9, "torque(all,x)": 1e-6, "omega(all,z)": 1e-3, "fz[20]": 3e-4, "tqx[20]": 5e-7,
         **{f"erotate{s}": 1e-12 for s in ("", "/sphere", "/sphere/atom")}}
LATER = ["fix x left addforce 5e-4 0 0", "fix x left setforce 0 0 NULL", "compute x left com",
         "unfix grav\nfix grav right gravity 9.81 vector 0 0 -1",
         "unfix integrate\nfix integrate right nve/sphere\nfix x left nve/noforce"]
LIQUID = "".join(f"fix l{k} all property/global {c} scalar {x}\n" for k, (c, x) in enumerate({
    "surfaceLiquidContentInitial": 1, "surfaceTension": 0.05, "fluidViscosity": 0.001, "minSeparationDistanceRatio": 1.01,
    "maxSeparationDistanceRatio": 1.1, "maxLiquidContent": 10, "lbVolumeFraction": 0.05}.items())) + \
    "fix angle all property/global contactAngle peratomtype 0.5\n"
REFUSED = {  # lines of a deck, and what solid/cull says
    "fix clumps all multisphere\ncompute x all multisphere/single id 1 property masstotal":
        "compute x (multisphere/single): is of one clump, which may be culled",
    "compute x all group/group all pair no": "compute x (group/group): LIGGGHTS's granular contacts do not support it",
}


class Told(NamedTuple):
    step: float
    value: float
    atoms: float
    whole: float = 0
    interior: float = 0
    body: float = 0  # largest number of a body that a granule of the group is in


def square(z, lo=-0.001, hi=0.022):
    """Two triangles; as the bed, a little larger."""
    a, b, c, d = (f"vertex {x} {y} {z}\n" for x, y in ((lo, lo), (hi, lo), (hi, hi), (lo, hi)))
    facet = "facet normal 0 0 1\nouter loop\n{}endloop\nendfacet\n"
    return "solid s\n" + facet.format(a + b + c) + facet.format(a + c + d) + "endsolid s\n"


def rows(table, treatments, *which):
    """Styles and their rows, of these treatments."""
    return [(style, row) for style, row in table.items() if treatment(treatments, style) in which]


def treatment(treatments, style):
    (found,) = [t for name, t in treatments.items() if named(name, style)]
    return found


class Decks(Case):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory(prefix="solidcull-styles-")
        cls.place = Path(cls.folder.name)
        (cls.place / "floor.stl").write_text(square(0))
        (cls.place / "middle.stl").write_text(square(0.0225))
        (cls.place / "inlet.stl").write_text(square(0.05, 0.003, 0.018))
        Run(BLOCK + SETTLE + f"write_restart {cls.place}/bed.restart\n")

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def bed(self, row):
        if row.style == "2d":
            return FLAT
        if row.style in MODELS:
            short = SETTLE.replace("run 1500", "run 300").replace("run 500\n", "") + REGIONS
            bed = (BLOCK + short).replace(MATERIAL, MATERIAL + OF_MODELS).replace("model hertz tangential history", row.style)
            return bed.replace("timestep 2e-5", "timestep 1e-6") if any(s in row.style for s in STIFF) else bed
        if row.style != "granular":
            return BLOCK.replace("atom_style granular", "atom_style " + row.style) + SETTLE + REGIONS
        head = BLOCK[:BLOCK.index("region box")] + f"read_restart {self.place}/bed.restart\nneighbor 0.0004 bin\nneigh_modify delay 0\n"
        return head + MATERIAL + f"pair_style {HERTZ}\npair_coeff * *\ntimestep 2e-5\nfix grav all gravity 9.81 vector 0 0 -1\n" + \
            WALLS + "fix integrate all nve/sphere\n" + REGIONS

    def run_of(self, row, culled):
        """Numbers printed each 50 steps, places in the end, and what was said."""
        columns = ["variable value equal " + (row.value or "0")]
        printed = ["v_value", "atoms"]
        if culled:
            columns += [CULL, "variable whole equal " + (row.whole or "0"), f"compute state {row.group} reduce max f_cull"]
            printed += ["v_whole", "f_cull[3]", "c_state"]
        if row.later:
            columns += ["run 100", row.later]
        end = self.place / "end"
        run = self.accepted("\n".join([
            self.bed(row) + row.lines.replace("{place}", str(self.place)), *columns, "thermo 50",
            "thermo_style custom step " + " ".join(printed), f"thermo_modify format float %.12g lost {row.lost} norm no", f"run {STEPS}",
            *(["unfix cull"] if culled else []), f"write_dump all custom {end} id x y z\n"]), ranks=row.ranks)
        told = [Told(*map(float, line.split())) for line in run.thermo()][-STEPS // 50 - 1:]
        self.assertEqual(len(told), STEPS // 50 + 1)
        places = {int(r[0]): list(map(float, r[1:])) for r in map(str.split, end.read_text().splitlines()[9:])}
        return told, places, run.log

    def ends_alike(self, row):
        """Runs both; what stock and the culled run told."""
        stock, places, _ = self.run_of(row, False)
        culled, also, log = self.run_of(row, True)
        self.assertEqual(len(places), row.granules)
        self.assertEqual(set(places), set(also))
        self.assertLess(max(math.dist(x, also[tag]) for tag, x in places.items()), MARGIN * DIAMETER)
        self.assertGreater(max(t.interior for t in culled), row.stored, "too little was stored: the row shows nothing")
        return stock, culled, log

    def same(self, stock, values):
        """Pairs of stock's value and another."""
        scale = max(abs(s.value) for s in stock)
        for s, value in zip(stock, values):
            self.assertLessEqual(abs(s.value - value), CLOSE * scale, f"{s}, {value}")

    def test_exact(self):
        for style, row in rows(FIXES, fixes_in_code(), "exact", "integrates") + rows(COMPUTES, computes_in_code(), "exact"):
            with self.subTest(style):
                stock, culled, _ = self.ends_alike(row)
                self.same(stock, [t.value for t in culled])

    def test_what_sees_atoms_only(self):
        for line, found in (("interior granules are missing in what these measure: ",
                             rows(FIXES, fixes_in_code(), "atoms_only") + rows(COMPUTES, computes_in_code(), "atoms_only")),
                            ("contacts inside solid bodies are missing in what these measure: ",
                             rows(COMPUTES, computes_in_code(), "contacts"))):
            for style, row in found:
                with self.subTest(style):
                    stock, culled, log = self.ends_alike(row)
                    self.assertRegex(log, f"(?m)^fix cull solid/cull: {line}.*\\({re.escape(style)}\\)")
                    if row.whole:
                        self.same(stock, [t.whole for t in culled])
                    complete = [(s, t.value) for s, t in zip(stock, culled) if t.interior == 0 or row.of_ball]
                    self.assertGreater(len(complete), 0)
                    self.same([s for s, _ in complete], [value for _, value in complete])

    def test_what_keeps_its_group_exterior(self):
        for style, row in rows(FIXES, fixes_in_code(), "holds", "drives") + rows(COMPUTES, computes_in_code(), "whole"):
            with self.subTest(style):
                stock, culled, log = self.ends_alike(row)
                self.same(stock, [t.value for t in culled])
                self.assertEqual({t.body for t in culled}, {0}, "a granule of the group was culled")
                if style not in fixes_in_code() or treatment(fixes_in_code(), style) == "drives":
                    self.assertRegex(log, f"(?m)^fix cull solid/cull: .*\\({re.escape(style)}\\) .*: granules of its group are not culled")

    def between_runs(self, row, culled):
        """The value in a formula after a run in which the bed went to sleep; what LIGGGHTS said."""
        run = Run("\n".join([
            self.bed(row) + row.lines.replace("{place}", str(self.place)), "variable value equal " + row.value, *([CULL] if culled else []),
            "thermo 50", "thermo_style custom step v_value " + ("f_cull[3]" if culled else "atoms"),
            f"thermo_modify format float %.12g lost {row.lost} norm no", "run 150", "print 'BETWEEN ${value}'\n"]), ranks=row.ranks)
        found = re.findall(r"(?m)^BETWEEN (\S+)$", run.screen + run.log)
        told = [line.split() for line in run.thermo()]
        return float(found[0]) if found else None, told, run.screen + run.log

    def test_in_a_formula_between_runs(self):
        functions = [(f, Row("", f)) for f in FUNCTIONS]
        refused = 0
        for style, row in [*FIXES.items(), *COMPUTES.items(), *functions]:
            if not row.value:
                continue
            with self.subTest(style):
                wanted, stock, _ = self.between_runs(row, False)
                value, told, said = self.between_runs(row, True)
                self.assertGreater(max(float(t[2]) for t in told), row.stored, "too little was stored: the row shows nothing")
                of_atoms = style in FIXES and treatment(fixes_in_code(), style) == "atoms_only"
                if of_atoms and re.search(r"\bf_x\b", row.value):
                    self.assertIsNone(value)
                    self.assertRegex(said, rf"reads fix x \({style}\), which has measured atoms only, without the granules")
                    refused += 1
                    continue
                if style in NOT_IN_FORMULAS:
                    self.assertEqual((wanted, value), (None, None))
                    continue
                self.assertIsNotNone(wanted, "stock does not take the formula")
                self.assertIsNotNone(value, said[-2000:])
                scale = max([abs(float(t[1])) for t in stock] + [abs(wanted), SMALL.get(style, 0)])
                self.assertLessEqual(abs(value - wanted), EQUAL * scale)
        self.assertEqual(refused, 3, "ave/histo, ave/spatial, check/timestep/gran")

    def test_values_for_the_whole_bed(self):
        for value, whole in WHOLE_BED.items():
            with self.subTest(value):
                stock, culled, _ = self.ends_alike(Row("", value, whole))
                self.same(stock, [t.whole for t in culled])

    def test_on_two_ranks(self):
        for row in (Row("", "xcm(all,z)", "f_cull[26]", ranks=2), Row("compute x all ke", "c_x", "f_cull[27]", ranks=2),
                    FIXES["massflow/mesh"]._replace(whole="f_x[2]", ranks=2),
                    Row("", "xcm(left,x)", "xcm(left,x)", later=LATER[0], stored=20, ranks=2)):
            with self.subTest(row.value):
                stock, culled, _ = self.ends_alike(row)
                self.same(stock, [t.whole for t in culled])

    def test_dumps_have_the_atoms_and_bed_files_have_all(self):
        run = Run(self.bed(Row("")) + f"{CULL} bed 50 {self.place}/all.*.vtp\ndump d all custom 50 {self.place}/d.* id f_cull\nthermo 50\n"
                  "thermo_style custom step atoms f_cull[1] f_cull[2] f_cull[3]\nthermo_modify lost error norm no\nrun 400\n")
        self.assertEqual(run.status, 0)
        told = [line.split() for line in run.thermo()]
        self.assertEqual(len(told), 9)
        for step, _, exterior, shell, interior in told[1:]:
            columns = [line.split() for line in (self.place / f"d.{step}").read_text().splitlines()[9:]]
            self.assertEqual(sum(float(body) == 0 for _, body in columns), float(exterior))
            self.assertEqual(sum(float(body) > 0 for _, body in columns), float(shell))
            self.assertIn('NumberOfPoints="344"', (self.place / f"all.{int(step):09d}.vtp").read_bytes().decode("latin-1"))

    def test_what_comes_between_two_runs(self):
        for later in LATER:
            with self.subTest(later):
                _, culled, _ = self.ends_alike(Row("", later=later, stored=20))
                self.assertEqual({t.body for t in culled}, {0}, "a granule of the group is still culled")

    def test_granules_that_a_mesh_deletes(self):
        """Before and after this fix in the same hook."""
        counts = "fix x all massflow/mesh mesh face count once vec_side 0 0 1 delete_atoms yes\nneigh_modify delay 0 every 5 check no"
        for row in (Row(FLIES + counts, "f_x[2]", granules=245, lost="ignore"),
                    Row(FLIES, later=counts, granules=245, lost="ignore")):
            with self.subTest(row.later):
                stock, culled, _ = self.ends_alike(row)
                self.same(stock, [t.value for t in culled])

    def test_contact_models(self):
        for model in MODELS:
            with self.subTest(model):
                self.ends_alike(Row("", style=model, stored=20))

    def test_refused_computes(self):
        for line, told in REFUSED.items():
            with self.subTest(line):
                self.refused_by_fix(deck(line, "fix cull all solid/cull", "run 0"), told + "; leave the compute or the fix out")

    def test_contact_models_with_liquid(self):
        for model in "easo/capillary/viscous", "washino/capillary/viscous":
            with self.subTest(model):
                text = deck("fix cull all solid/cull", "run 0", pair=f"{HERTZ} cohesion {model}").replace(MATERIAL, MATERIAL + LIQUID)
                self.refused_by_fix(text, f"the liquid of cohesion model {model} would be lost with the culled granules: use sjkr or sjkr2")

    def test_pair_styles_that_are_not_gran(self):
        for style in "gran_bubble", "bubble":
            with self.subTest(style):
                self.refused_by_fix(deck("fix cull all solid/cull", "run 0", pair=HERTZ.replace("gran", style)),
                                    f"pair_style '{style}' is not granular: use pair_style gran")

    def test_every_contact_model_has_a_deck_or_is_refused(self):
        for kind in "Normal", "Tangential", "Cohesion", "Rolling", "Surface":
            for model in styles_of_liggghts(f"{kind} models for pair gran:"):
                with self.subTest(model):
                    self.assertTrue(model in REFUSED_MODELS or any(model in words.split() for words in MODELS))

    def test_every_style_that_is_not_refused_has_a_deck(self):
        for kind, table, code in ("Fix styles", FIXES, fixes_in_code()), ("Compute styles:", COMPUTES, computes_in_code()):
            wanted = {s for s in styles_of_liggghts(kind) if treatment(code, s) != "refused"}
            self.assertEqual(set(table), wanted)


if __name__ == "__main__":
    unittest.main()
