#!/usr/bin/python3
"""Runs a deck as a program that embeds LIGGGHTS: half of it by lammps_file, half by lammps_command, and asks the C library on the way.

    driver.py DECK -log FILE -screen FILE        with LD_PRELOAD=build/libsolidcull.so, or without for stock LIGGGHTS

Lines `#library ...` of the deck say how it goes on (`by file`, `by commands`) and what is asked. What each rank got stands in
`library.RANK`, one line each: name, kind (see judge.py), value, and whether the ranks' values are to be summed.
"""
import ctypes
import sys
from pathlib import Path

DUMPED = {"x": ("x y z", ctypes.c_double, 3), "v": ("vx vy vz", ctypes.c_double, 3), "radius": ("radius", ctypes.c_double, 1), "type": ("type", ctypes.c_int, 1)}
PROPERTY = "lib_mass"  # a compute of the masses of all granules


def pieces(lines):
    """A deck in pieces: (how, lines), how being `file`, `command` or `ask`. A loop goes in one file, for it jumps within it."""
    how, waiting, loop = "file", [], []
    for line in lines:
        if line.startswith("#library by "):
            if waiting:
                yield "file", waiting
            how, waiting = {"file": "file", "commands": "command"}[line.split()[2]], []
        elif line.startswith("#library "):
            if waiting:
                yield "file", waiting
            waiting = []
            yield "ask", [line.split(None, 1)[1]]
        elif how == "file":
            waiting.append(line)
        elif loop or line.startswith("label "):
            loop.append(line)
            if line.startswith("jump "):
                yield "file", loop
                loop = []
        elif line.strip():
            yield "command", [line]
    if waiting:
        yield "file", waiting


class Ranks:
    """Open MPI's, of a library that is loaded."""

    def __init__(self, lib):
        self.lib, (self.world, self.number, self.largest) = lib, [ctypes.c_void_p(ctypes.addressof(ctypes.c_char.in_dll(lib, name))) for name in
                                                                  ("ompi_mpi_comm_world", "ompi_mpi_int", "ompi_mpi_op_max")]

    def me(self):
        rank = ctypes.c_int()
        self.lib.MPI_Comm_rank(self.world, ctypes.byref(rank))
        return rank.value

    def most(self, value):
        mine, most = ctypes.c_int(value), ctypes.c_int()
        self.lib.MPI_Allreduce(ctypes.byref(mine), ctypes.byref(most), 1, self.number, self.largest, self.world)
        return most.value


class Engine:
    """LIGGGHTS by its C library, and what is asked of it."""

    def __init__(self, arguments):
        # a library that is preloaded comes first: functions are looked up in the program, not in LIGGGHTS
        ctypes.CDLL("libliggghts.so.3", ctypes.RTLD_GLOBAL)
        self.lib = ctypes.CDLL(None)
        for name in ("extract_global", "extract_atom", "extract_compute", "extract_fix", "extract_variable"):
            getattr(self.lib, f"lammps_{name}").restype = ctypes.c_void_p
        self.it = ctypes.c_void_p()
        words = (ctypes.c_char_p * (len(arguments) + 1))(b"driver", *(a.encode() for a in arguments))
        self.lib.lammps_open_no_mpi(len(words), words, ctypes.byref(self.it))
        self.ranks = Ranks(self.lib)
        self.rank = self.ranks.me()
        self.out = open(f"library.{self.rank}", "w")
        self.files = 0

    def close(self):
        self.out.close()
        self.lib.lammps_close(self.it)
        self.lib.MPI_Finalize()

    def file(self, lines):
        self.files += 1
        name = f"piece{self.files}.in"
        if self.rank == 0:
            Path(name).write_text("\n".join(lines) + "\n")
        self.lib.lammps_file(self.it, name.encode())

    def command(self, line):
        self.lib.lammps_command(self.it, line.encode())

    def say(self, name, kind, value, how="once"):
        print(name, kind, repr(value), how, file=self.out, flush=True)

    # --- the library's functions

    def number(self, name, kind=ctypes.c_double):
        return ctypes.cast(self.lib.lammps_extract_global(self.it, name.encode()), ctypes.POINTER(kind))[0]

    def granules(self):
        return self.lib.lammps_get_natoms(self.it)

    def here(self):
        return self.number("nlocal", ctypes.c_int)

    def column(self, name, kind=ctypes.c_double):
        return ctypes.cast(self.lib.lammps_extract_atom(self.it, name.encode()), ctypes.POINTER(kind))

    def variable(self, formula):
        """Of an equal-style formula."""
        self.command(f"variable lib_v equal {formula}")
        found = self.lib.lammps_extract_variable(self.it, b"lib_v", None)
        return ctypes.cast(found, ctypes.POINTER(ctypes.c_double))[0]

    def are_numbered(self):
        """Whether all tags from 1 are there: else gather_atoms says nothing, and on more ranks than one waits for ever."""
        tags = self.column("id", ctypes.c_int)
        return self.ranks.most(max((tags[i] for i in range(self.here())), default=0)) == self.granules() > 0

    def gather(self, name):
        _, kind, width = DUMPED[name]
        values = (kind * (width * self.granules()))()
        self.lib.lammps_gather_atoms(self.it, name.encode(), int(kind is ctypes.c_double), width, values)
        return values

    def scatter(self, name, values):
        _, kind, width = DUMPED[name]
        self.lib.lammps_scatter_atoms(self.it, name.encode(), int(kind is ctypes.c_double), width, values)

    def dumped(self, name):
        """The same as a dump says it, by tag; rank 0."""
        columns, _, width = DUMPED[name]
        form = " ".join(["%d"] + (["%d"] if name == "type" else ["%.17g"] * width))
        self.command(f'write_dump all custom library.dump id {columns} modify format "{form}"')
        if self.rank != 0:
            return {}
        rows = [line.split() for line in Path("library.dump").read_text().split("ITEM: ATOMS")[1].splitlines()[1:]]
        return {int(row[0]): [float(w) for w in row[1:]] for row in rows}

    # --- what a deck may ask, each with the name and the kind of its answer

    def natoms(self, name, kind):
        self.say(name, kind, self.granules())

    def world(self, name, kind):
        self.say(name + "dt", "exact", self.number("dt"))
        self.say(name + "step", "exact", self.number("ntimestep", ctypes.c_int64))
        self.say(name + "here", kind, self.here(), "sum")

    def masses(self, name, kind):
        mass, tags = self.column("rmass"), self.column("id", ctypes.c_int)
        self.say(name, kind, sum(mass[i] for i in range(self.here())), "sum")
        self.say(name + "tags", kind, sum(tags[i] > 0 for i in range(self.here())), "sum")

    def compute(self, name, kind):
        found = self.lib.lammps_extract_compute(self.it, PROPERTY.encode(), 1, 1)
        values = ctypes.cast(found, ctypes.POINTER(ctypes.c_double))
        self.say(name, kind, sum(values[i] for i in range(self.here())) if found else 0.0, "sum")
        energy = ctypes.cast(self.lib.lammps_extract_compute(self.it, b"ke", 0, 0), ctypes.POINTER(ctypes.c_double))[0]
        also = self.variable("ke(all)")
        self.say(name + "ke", "exact", int(abs(energy - also) > 1e-9 * abs(also)))

    def fix(self, name, kind, fix, component):
        found = self.lib.lammps_extract_fix(self.it, fix.encode(), 0, 1, int(component) - 1, 0)
        load, also = ctypes.cast(found, ctypes.POINTER(ctypes.c_double))[0], self.variable(f"f_{fix}[{component}]")
        self.say(name, "exact", int(abs(load - also) > 1e-9 * abs(also)))

    def formula(self, name, kind, formula):
        self.say(name, kind, self.variable(formula))

    def each(self, name, kind):
        """An atom-style variable, summed up."""
        self.command("variable lib_a atom mass")
        values = ctypes.cast(self.lib.lammps_extract_variable(self.it, b"lib_a", b"all"), ctypes.POINTER(ctypes.c_double))
        self.say(name, kind, sum(values[i] for i in range(self.here())), "sum")

    def gathered(self, name, kind, what):
        """How many granules gather_atoms says otherwise than a dump, to the bit."""
        if not self.are_numbered():
            return
        _, _, width = DUMPED[what]
        got, there = self.gather(what), self.dumped(what)
        self.say(name + "n", kind, len(got) // width)
        if self.rank == 0:
            self.say(name, "exact", sum(list(got[width * (tag - 1):width * tag]) != row for tag, row in there.items()) + abs(len(there) - len(got) // width))

    def scattered(self, name, kind, what, component, first, last, by):
        """Granules first to last are moved, or kicked, by so much; how many have not what was given, read in both ways."""
        if not self.are_numbered():
            return
        width = DUMPED[what][2]
        values = self.gather(what)
        for tag in range(int(first), min(int(last), self.granules()) + 1):
            values[width * (tag - 1) + int(component)] += float(by)
        self.scatter(what, values)
        again, there = self.gather(what), self.dumped(what)
        if self.rank == 0:
            self.say(name, "exact", sum(a != b for a, b in zip(values, again)))
            self.say(name + "dump", "exact", sum(list(values[width * (tag - 1):width * tag]) != row for tag, row in there.items()))

    def ask(self, line):
        what, *words = line.split()
        getattr(self, what)(*words)


def main(argv):
    engine = Engine(argv[1:])
    for how, lines in pieces(Path(argv[0]).read_text().splitlines()):
        if how == "file":
            engine.file(lines)
        else:
            getattr(engine, how)(lines[0])
    engine.close()


if __name__ == "__main__":
    main(sys.argv[1:])
