"""drive_library.py FIX-LINE|stock: a program that drives LIGGGHTS through its C library, as its Python module does (ctypes looks the
functions up in libliggghts.so). Each rank prints what it finds, in one line of JSON, to found.RANK.

FIX-LINE needs LD_PRELOAD=libsolidcull.so; with the word stock the same program drives LIGGGHTS alone. ORDER in the environment:
which function is asked first, as the first one finds the bed asleep."""
import ctypes
import json
import os
import sys

STEPS_TO_REST = 20000
GRANULES = 800
BED = f"""\
atom_style granular
atom_modify map array
boundary f f f
newton off
communicate single vel yes
units si
processors * * 1
region box block -.024 .024 -.024 .024 0 .25 units box
create_box 1 box
neighbor 0.0005 bin
neigh_modify delay 0
fix m1 all property/global youngsModulus peratomtype 5e6
fix m2 all property/global poissonsRatio peratomtype 0.3
fix m3 all property/global coefficientRestitution peratomtypepair 1 0.3
fix m4 all property/global coefficientFriction peratomtypepair 1 0.5
pair_style gran model hertz tangential history
pair_coeff * *
timestep 4e-5
fix grav all gravity 9.81 vector 0 0 -1
fix zw all wall/gran model hertz tangential history primitive type 1 zplane 0.0
fix x1 all wall/gran model hertz tangential history primitive type 1 xplane -0.024
fix x2 all wall/gran model hertz tangential history primitive type 1 xplane 0.024
fix y1 all wall/gran model hertz tangential history primitive type 1 yplane -0.024
fix y2 all wall/gran model hertz tangential history primitive type 1 yplane 0.024
fix pts1 all particletemplate/sphere 15485863 atom_type 1 density constant 2500 radius constant 0.003
fix pdd all particledistribution/discrete 49979687 1 pts1 1.0
region fill block -.021 .021 -.021 .021 0.003 .24 units box
fix ins all insert/pack seed 86028157 distributiontemplate pdd vel constant 0 0 -0.5 insert_every once overlapcheck yes &
all_in yes particles_in_region {GRANULES} region fill
fix integr all nve/sphere
fix mark all property/atom mark scalar yes no no 2.5
compute top all reduce max z
compute st all stress/atom virial
compute sum all reduce sum c_st[3]
compute k all ke/atom
variable n equal count(all)
variable high atom z>0.01
thermo 100000
thermo_style custom step atoms c_top c_sum
thermo_modify lost ignore norm no
"""

lib = ctypes.CDLL("libliggghts.so.3", ctypes.RTLD_GLOBAL)
POINTERS = {"lammps_extract_global": ctypes.c_void_p, "lammps_extract_atom": ctypes.c_void_p,
            "lammps_extract_compute": ctypes.c_void_p, "lammps_extract_fix": ctypes.c_void_p,
            "lammps_extract_variable": ctypes.c_void_p}
for name, result in POINTERS.items():
    getattr(lib, name).restype = result
handle = ctypes.c_void_p()
double = ctypes.POINTER(ctypes.c_double)
rows = ctypes.POINTER(double)


def command(line):
    lib.lammps_command(handle, line.encode())


def owned():
    return ctypes.cast(lib.lammps_extract_global(handle, b"nlocal"), ctypes.POINTER(ctypes.c_int))[0]


def tags():
    pointer = ctypes.cast(lib.lammps_extract_atom(handle, b"id"), ctypes.POINTER(ctypes.c_int))
    return [pointer[i] for i in range(owned())]


def gathered(what, count):
    data = (ctypes.c_double * (count * lib.lammps_get_natoms(handle)))()
    lib.lammps_gather_atoms(handle, what.encode(), 1, count, data)
    return list(data)


def scalar(pointer):
    return ctypes.cast(pointer, double)[0]


def of_each(pointer):
    pointer = ctypes.cast(pointer, double)
    return dict(zip(tags(), [pointer[i] for i in range(owned())]))


def extract_atom():
    x = ctypes.cast(lib.lammps_extract_atom(handle, b"x"), rows)
    f = ctypes.cast(lib.lammps_extract_atom(handle, b"f"), rows)
    numbers = [[x[i][d] for d in range(3)] + [f[i][d] for d in range(3)] for i in range(owned())]
    return dict(zip(tags(), numbers))


ASK = {
    "natoms": lambda: lib.lammps_get_natoms(handle),
    "global": lambda: [owned(), scalar(lib.lammps_extract_global(handle, b"dt"))],
    "atom": extract_atom,
    "compute": lambda: [scalar(lib.lammps_extract_compute(handle, b"top", 0, 0)),
                        scalar(lib.lammps_extract_compute(handle, b"sum", 0, 0))],
    "compute_each": lambda: of_each(lib.lammps_extract_compute(handle, b"k", 1, 1)),
    "fix": lambda: of_each(lib.lammps_extract_fix(handle, b"mark", 1, 1, 0, 0)),
    "variable": lambda: scalar(lib.lammps_extract_variable(handle, b"n", None)),
    "variable_each": lambda: of_each(lib.lammps_extract_variable(handle, b"high", b"all")),
    "gather": lambda: [gathered("x", 3), gathered("radius", 1), gathered("f", 3)],
}


def main():
    line = sys.argv[1]
    words = [b"program", b"-log", b"none", b"-screen", b"screen"]
    lib.lammps_open_no_mpi(len(words), (ctypes.c_char_p * len(words))(*words), ctypes.byref(handle))
    if line == "stock":  # the bed at rest, for both
        for one in BED.replace("&\n", "").splitlines():
            command(one)
        command("fix damping all viscous 0.02")
        command(f"run {STEPS_TO_REST}")
        for _ in range(10):
            command("velocity all set 0 0 0")
            command("set group all omegax 0 omegay 0 omegaz 0")
            command("run 700")
        command("unfix damping")
        command("unfix ins")
        command("write_restart rest.restart")
        command("clear")
    setup = BED.replace("&\n", "").splitlines()
    start = [i for i, one in enumerate(setup) if one.startswith("region box")][0]
    for one in setup[:start] + ["read_restart rest.restart"] + setup[start + 2:]:
        if not one.startswith("fix ins"):
            command(one)
    if line != "stock":
        command(line)
    command("run 100")  # the last look chooses, the next set-up culls: nothing has moved since
    command("run 0")
    found = {}
    if line != "stock":
        found["stored"] = scalar(lib.lammps_extract_fix(handle, b"cull", 0, 1, 2, 0))
    first = os.environ.get("ORDER", "natoms")
    for name in [first] + [n for n in ASK if n != first]:
        found[name] = ASK[name]()
    x = gathered("x", 3)
    lift = (ctypes.c_double * len(x))(*[v + (0.01 if k % 3 == 2 else 0) for k, v in enumerate(x)])
    lib.lammps_scatter_atoms(handle, b"x", 1, 3, lift)
    command("variable top equal bound(all,zmax)")
    found["lifted"] = scalar(lib.lammps_extract_variable(handle, b"top", None))
    command("run 40")
    found["fallen"] = gathered("x", 3)
    if line != "stock":
        found["stored_then"] = scalar(lib.lammps_extract_fix(handle, b"cull", 0, 1, 2, 0))
    rank = os.environ.get("OMPI_COMM_WORLD_RANK", "0")
    with open(f"found.{rank}", "w", encoding="utf-8") as out:
        json.dump(found, out)
    lib.lammps_close(handle)
    lib.MPI_Finalize()


main()
