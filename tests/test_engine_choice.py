"""The user's own LIGGGHTS: what engine.cmake refuses or finds out, on tiny libraries that look like LIGGGHTS; what the fix says to
an engine whose calls do not reach it; what scripts/prepare.sh asks of Debian."""
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT))
from solidcull_runs.engine import environment  # noqa: E402

ADAPTERS = ROOT / "fix_solid_cull" / "liggghts"
LAUNCHER = Path(os.environ.get("SOLIDCULL_LAUNCHER", ROOT / "build/liggghts-solidcull")).resolve()
DEBIAN = Path("/usr/include/liggghts/lammps.h")

HEADERS = ("lammps.h", "fix.h", "fix_contact_history.h", "fix_mesh_surface.h", "domain.h", "memory.h", "modify.h", "pair.h")
CLASSES = """\
#pragma once
#include <mpi.h>
#ifndef RANKS
#define RANKS MPI_Comm
#endif
namespace LAMMPS_NS {
#ifdef LAMMPS_SMALLSMALL
typedef int bigint;
#else
typedef long bigint;
#endif
#ifdef LAMMPS_BIGBIG
typedef long tagint;
#else
typedef int tagint;
#endif
struct LAMMPS { LAMMPS(int, char**, RANKS); };
struct Memory { void* smalloc(bigint, const char*); };
struct Fix {
  virtual ~Fix();
  virtual void pre_initial_integrate();
  virtual void pre_final_integrate();
};
struct Domain { virtual ~Domain(); void unmap(double*, tagint); };
struct Modify { virtual ~Modify(); };
struct Pair { virtual ~Pair(); };
}
"""
FUNCTIONS = """\
#include "lammps.h"
namespace LAMMPS_NS {
LAMMPS::LAMMPS(int, char**, RANKS) {}
void* Memory::smalloc(bigint, const char*) { return nullptr; }
Fix::~Fix() {}
void Fix::pre_initial_integrate() {}
void Fix::pre_final_integrate() {}
Domain::~Domain() {}
void Domain::unmap(double*, tagint) {}
Modify::~Modify() {}
Pair::~Pair() {}
#ifdef SUPERQUADRIC_ACTIVE_FLAG
struct AtomVecSuperquadric { virtual ~AtomVecSuperquadric(); };
AtomVecSuperquadric::~AtomVecSuperquadric() {}
#endif
}
"""
PROJECT = f"""\
cmake_minimum_required(VERSION 3.16)
project(choice LANGUAGES CXX)
include(GNUInstallDirs)
find_package(MPI REQUIRED COMPONENTS CXX)
# what was found holds for all configurations of this folder; CMake would compile two programs each time to see it again
set(MPI_CXX_WORKS TRUE CACHE INTERNAL "")
set(MPI_MPICXX_FOUND FALSE CACHE INTERNAL "")
include("{ADAPTERS}/engine.cmake")
get_target_property(flags liggghts INTERFACE_COMPILE_DEFINITIONS)
get_target_property(libraries liggghts INTERFACE_LINK_LIBRARIES)
message(STATUS "with ${{flags}} and ${{libraries}}")
"""


def interposed():
    return re.findall(r'"(_Z\w+)"', (ADAPTERS / "interposed.h").read_text())


def quietly(words, **more):
    words = [str(w) for w in words]
    return subprocess.run(words, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False, **more)


class FakeLibraries:
    """Each is made once, and named by what is special about it."""

    def __init__(self, folder):
        self.folder = folder
        self.headers = self.include("headers", CLASSES)
        calls = [f'extern "C" void f{k}() asm("{symbol}");\nvoid f{k}() {{}}\nvoid call{k}() {{ f{k}(); }}\n'
                 for k, symbol in enumerate(interposed())]
        (folder / "engine.cpp").write_text(FUNCTIONS + "".join(calls))

    def include(self, name, text):
        place = self.folder / name
        if not place.exists():
            place.mkdir()
            for header in HEADERS:
                (place / header).write_text(text if header in ("lammps.h", "fix.h") else '#include "lammps.h"\n')
        return place

    def compile(self, name, *flags, headers=None, pic=True):
        made = self.folder / f"{name}.o"
        if not made.exists():
            done = quietly(["mpicxx", "-w", "-fPIC" if pic else "-fno-pic", "-I", headers or self.headers, *flags, "-c",
                            self.folder / "engine.cpp", "-o", made])
            assert done.returncode == 0, done.stdout
        return made

    def shared(self, name, *flags, link=(), headers=None):
        made = self.folder / f"lib{name}.so"
        if not made.exists():
            done = quietly(["mpicxx", "-shared", *link, self.compile(name, *flags, headers=headers), "-o", made])
            assert done.returncode == 0, done.stdout
        return made

    def static(self, name, *flags, pic=True):
        made = self.folder / f"lib{name}.a"
        if not made.exists():
            quietly(["ar", "rcs", made, self.compile(name, *flags, pic=pic)])
        return made


@unittest.skipUnless(shutil.which("mpicxx") and shutil.which("cmake"), "no mpicxx or no cmake here")
class Configure(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.place = tempfile.TemporaryDirectory(prefix="solidcull-engine-")
        folder = Path(cls.place.name)
        (folder / "CMakeLists.txt").write_text(PROJECT)
        cls.fakes = FakeLibraries(folder)

    @classmethod
    def tearDownClass(cls):
        cls.place.cleanup()

    def configure(self, **named):
        folder = Path(self.place.name)
        words = [f"-DLIGGGHTS_{name.upper()}={value}" for name, value in named.items()]
        return quietly(["cmake", "-S", folder, "-B", folder / "build", "-ULIGGGHTS_*", *words])

    def refused(self, *parts, **named):
        done = self.configure(**named)
        lines = [line for line in done.stdout.splitlines() if "solidcull: " in line]
        self.assertNotEqual(done.returncode, 0, done.stdout)
        self.assertEqual(len(lines), 1, done.stdout)
        for part in parts:
            self.assertIn(str(part), lines[0])

    def accepted(self, **named):
        """The definitions and libraries of the target."""
        done = self.configure(**named)
        self.assertEqual(done.returncode, 0, done.stdout)
        return re.search(r"-- with (.*)", done.stdout)[1]

    # ------------------------------------------------------------------------------------------------ headers
    def test_a_folder_without_headers(self):
        self.refused("LIGGGHTS_INCLUDE_DIR is '/usr/include', which has no lammps.h", "its src",
                     library=self.fakes.shared("plain"), include_dir="/usr/include")

    def test_headers_of_lammps(self):
        place = self.fakes.include("lammps", CLASSES)
        (place / "fix_contact_history.h").unlink(missing_ok=True)
        self.refused("which has no fix_contact_history.h", library=self.fakes.shared("plain"), include_dir=place)

    def test_headers_of_pfm(self):
        pfm = re.sub(r"  virtual void pre_(initial|final)_integrate\(\);\n", "", CLASSES)
        self.refused("no Fix::pre_initial_integrate", "LIGGGHTS-PFM", "use LIGGGHTS-PUBLIC 3.8.0",
                     library=self.fakes.shared("plain"), include_dir=self.fakes.include("pfm", pfm))

    def test_headers_that_do_not_compile(self):
        place = self.fakes.include("broken", CLASSES + "struct Oops { Nothing n; };\n")
        self.refused("do not compile", "Nothing", library=self.fakes.shared("plain"), include_dir=place)

    def test_headers_of_another_version(self):
        newer = self.fakes.include("newer", CLASSES.replace("virtual ~Fix();", "virtual ~Fix();\n  virtual void new_hook() {}"))
        self.refused("do not belong together", "class Fix", "-DLIGGGHTS_INCLUDE_DIR",
                     library=self.fakes.shared("plain"), include_dir=newer)
        self.refused("do not belong together", "class Fix", "-DLIGGGHTS_INCLUDE_DIR",
                     library=self.fakes.shared("newer", headers=newer), include_dir=self.fakes.headers)
        lacks = self.fakes.include("lacks", CLASSES.replace("unmap(double*", "unmap(const double*"))
        self.refused("do not belong together", "Domain5unmap", library=self.fakes.shared("plain"), include_dir=lacks)

    def test_headers_are_looked_for_beside_the_library_only(self):
        lone = self.fakes.shared("plain")
        self.refused("LIGGGHTS_INCLUDE_DIR was not found", lone, library=lone)
        beside = self.fakes.headers / "libbeside.so"
        shutil.copy(lone, beside)
        self.assertIn(str(beside), self.accepted(library=beside))

    # ------------------------------------------------------------------------------------------------ library
    def test_a_library_that_is_not_there(self):
        self.refused("LIGGGHTS_LIBRARY is '/none/libliggghts.so', and there is no such file", "name",
                     library="/none/libliggghts.so", include_dir=self.fakes.headers)

    def test_a_file_that_is_no_library(self):
        self.refused("which is no library", library=self.fakes.folder / "CMakeLists.txt", include_dir=self.fakes.headers)

    def test_a_library_that_is_not_liggghts(self):
        other = self.fakes.folder / "libother.so"
        quietly(["mpicxx", "-shared", "-x", "c++", os.devnull, "-o", other])
        self.refused("shows no Modify::add_fix", library=other, include_dir=self.fakes.headers)

    def test_a_library_that_binds_its_own_calls(self):
        library = self.fakes.shared("symbolic", link=["-Wl,-Bsymbolic-functions"])
        self.refused(library, "another Modify::add_fix", "without -Bsymbolic", library=library, include_dir=self.fakes.headers)

    def test_another_mpi(self):
        self.refused("another MPI", "-DMPI_CXX_COMPILER",
                     library=self.fakes.shared("mpich", "-DRANKS=short"), include_dir=self.fakes.headers)

    # ------------------------------------------------------------------------------------------------ how it was built
    def test_a_plain_library_brings_no_definitions(self):
        library = self.fakes.shared("plain")
        told = self.accepted(library=library, include_dir=self.fakes.headers)
        self.assertTrue(told.startswith(f"flags-NOTFOUND and {library}"))

    def test_superquadrics_are_found(self):
        library = self.fakes.shared("superquadrics", "-DSUPERQUADRIC_ACTIVE_FLAG")
        told = self.accepted(library=library, include_dir=self.fakes.headers)
        self.assertTrue(told.startswith("SUPERQUADRIC_ACTIVE_FLAG;NONSPHERICAL_ACTIVE_FLAG and"))
        told = self.accepted(library=library, include_dir=self.fakes.headers, definitions="-DMINE -DSUPERQUADRIC_ACTIVE_FLAG")
        self.assertTrue(told.startswith("MINE;SUPERQUADRIC_ACTIVE_FLAG;NONSPHERICAL_ACTIVE_FLAG and"))

    def test_the_sizes_of_numbers_are_found(self):
        for flag in ("LAMMPS_BIGBIG", "LAMMPS_SMALLSMALL"):
            with self.subTest(flag=flag):
                library = self.fakes.shared(flag, f"-D{flag}")
                self.assertTrue(self.accepted(library=library, include_dir=self.fakes.headers).startswith(f"{flag} and"))

    def test_definitions_that_the_library_was_not_built_with(self):
        plain, big = self.fakes.shared("plain"), self.fakes.shared("LAMMPS_BIGBIG", "-DLAMMPS_BIGBIG")
        for library, flag in ((plain, "SUPERQUADRIC_ACTIVE_FLAG"), (plain, "NONSPHERICAL_ACTIVE_FLAG"), (plain, "LAMMPS_BIGBIG"),
                              (big, "LAMMPS_SMALLBIG")):
            with self.subTest(flag=flag):
                self.refused(f"LIGGGHTS_DEFINITIONS says {flag}", library, "leave it out",
                             library=library, include_dir=self.fakes.headers, definitions=f"-D{flag}")

    @unittest.skipUnless(DEBIAN.exists(), "no libliggghts-dev here")
    def test_debians_engine_is_found_and_needs_no_definitions(self):
        self.assertRegex(self.accepted(), r"^flags-NOTFOUND and /usr/lib/\S*libliggghts\.so;")

    # ------------------------------------------------------------------------------------------------ static
    def test_a_static_library_becomes_a_shared_one(self):
        told = self.accepted(library=self.fakes.static("plain"), include_dir=self.fakes.headers)
        self.assertIn("build/libsolidcull-liggghts.so", told)
        # so a call that stays within one of its object files goes where another library says
        folder = self.fakes.folder
        first = folder / "first.cpp"
        first.write_text(f'#include <cstdio>\nextern "C" void mine() asm("{interposed()[0]}");\n'
                         'void mine() { std::puts("here"); }\nvoid call0();\nint main() { call0(); }\n')
        done = quietly(["mpicxx", "-rdynamic", first, folder / "build/libsolidcull-liggghts.so", "-o", folder / "first"])
        self.assertEqual(done.returncode, 0, done.stdout)
        env = {**os.environ, "LD_LIBRARY_PATH": str(folder / "build")}
        self.assertEqual(quietly([folder / "first"], env=env).stdout, "here\n")

    def test_a_static_library_without_pic(self):
        library = self.fakes.static("fixed", pic=False)
        self.refused(library, "without -fPIC", "USE_FPIC", library=library, include_dir=self.fakes.headers)

    def test_a_static_library_that_needs_more(self):
        needy = self.fakes.folder / "needy.cpp"
        needy.write_text("void vtk_writes();\nvoid writes() { vtk_writes(); }\n")
        quietly(["mpicxx", "-fPIC", "-c", needy, "-o", self.fakes.folder / "needy.o"])
        library = self.fakes.folder / "libneedy.a"
        quietly(["ar", "rcs", library, self.fakes.compile("plain"), self.fakes.folder / "needy.o"])
        self.refused(library, "needs more libraries", "vtk_writes()", "-DLIGGGHTS_LINK_LIBRARIES",
                     library=library, include_dir=self.fakes.headers)
        more = self.fakes.folder / "libmore.so"
        (self.fakes.folder / "more.cpp").write_text("void vtk_writes() {}\n")
        quietly(["mpicxx", "-shared", "-fPIC", self.fakes.folder / "more.cpp", "-o", more])
        told = self.accepted(library=library, include_dir=self.fakes.headers, link_libraries=f"{more};m")
        self.assertIn("libsolidcull-liggghts.so", told)


LATE = """\
import ctypes, sys
engine = ctypes.CDLL(sys.argv[1], mode=ctypes.RTLD_GLOBAL)
plugin = ctypes.CDLL(sys.argv[2])
lammps = ctypes.c_void_p()
words = (ctypes.c_char_p * 5)(b"late", b"-log", b"log", b"-screen", b"screen")
engine.lammps_open_no_mpi(5, words, ctypes.byref(lammps))
plugin.solidcull_register(lammps)
for line in ("atom_style granular", "atom_modify map array", "newton off", "communicate single vel yes",
             "region box block 0 1 0 1 0 1", "create_box 1 box", "fix cull all solid/cull"):
    engine.lammps_command(lammps, line.encode())
"""


class RunTime(unittest.TestCase):
    def test_an_engine_that_was_loaded_before_is_refused(self):
        plugin = LAUNCHER.parent / "libsolidcull.so"
        if not plugin.exists():
            self.skipTest("no libsolidcull.so here")
        linked = quietly(["ldd", plugin]).stdout
        engine = re.search(r"(?:liggghts|lmp)\S* => (\S+)", linked)
        if not engine or "libasan" in linked:
            self.skipTest("the engine of this build cannot be loaded first")
        with tempfile.TemporaryDirectory(prefix="solidcull-") as folder:
            done = quietly([sys.executable, "-c", LATE, engine[1], plugin], cwd=folder, env=environment())
            self.assertNotEqual(done.returncode, 0, done.stdout)
            log = (Path(folder) / "log").read_text(errors="replace")
        self.assertIn("fix cull solid/cull: calls of Modify::add_fix of this LIGGGHTS (", log)
        self.assertIn("link or preload libsolidcull.so before LIGGGHTS is loaded", log)


class Prepare(unittest.TestCase):
    """scripts/prepare.sh on a machine that lacks every package, with programs that only write down how they were called."""
    STUB = '#!/bin/sh\necho "$(basename "$0") $*" >>"$CALLS"\n'

    def calls(self, *words, cache=None):
        with tempfile.TemporaryDirectory(prefix="solidcull-") as folder:
            place = Path(folder)
            for name, text in {"apt-get": self.STUB, "cmake": self.STUB, "mpicxx": self.STUB, "sudo": '#!/bin/sh\nexec "$@"\n',
                               "dpkg-query": "#!/bin/sh\nexit 1\n"}.items():
                (place / name).write_text(text)
                (place / name).chmod(0o755)
            (place / "build").mkdir()
            if cache:
                (place / "build" / "CMakeCache.txt").write_text(cache)
            env = {**os.environ, "PATH": f"{place}:{os.environ['PATH']}", "CALLS": str(place / "calls"),
                   "SOLIDCULL_BUILD": str(place / "build")}
            for name in ("SOLIDCULL_CMAKE", "SOLIDCULL_PACKAGES", "SOLIDCULL_ENGINE"):
                env.pop(name, None)
            done = quietly([ROOT / "scripts" / "prepare.sh", *words], env=env)
            self.assertEqual(done.returncode, 0, done.stdout)
            called = (place / "calls").read_text().splitlines()
        install = [c for c in called if c.startswith("apt-get") and " install " in c]
        configure = [c for c in called if c.startswith("cmake -S")]
        build = [c for c in called if c.startswith("cmake --build")]
        self.assertEqual([len(install), len(configure), len(build)], [1, 1, 1])
        return install[0].split(), configure[0].split(), build[0].split()

    def test_debians_engine_is_installed_where_no_other_is_named(self):
        install, configure, build = self.calls()
        self.assertTrue({"liggghts", "libliggghts-dev", "libopenmpi-dev"} <= set(install))
        self.assertFalse([w for w in configure if "LIGGGHTS" in w])
        self.assertNotIn("--target", build)

    def test_an_engine_that_is_named_is_passed_on_and_debians_is_not_installed(self):
        install, configure, build = self.calls("-DLIGGGHTS_LIBRARY=/home/me/src/libliggghts.so", "deck_tests")
        self.assertIn("-DLIGGGHTS_LIBRARY=/home/me/src/libliggghts.so", configure)
        self.assertEqual(build[-2:], ["--target", "deck_tests"])
        self.assertFalse({"liggghts", "libliggghts-dev", "libopenmpi-dev"} & set(install))
        self.assertIn("libopenvdb-dev", install)

    def test_an_engine_that_was_named_before_is_remembered(self):
        install, _, _ = self.calls(cache="LIGGGHTS_LIBRARY:FILEPATH=/home/me/src/libliggghts.so\n")
        self.assertNotIn("libliggghts-dev", install)
        install, _, _ = self.calls(cache="LIGGGHTS_LIBRARY:FILEPATH=/usr/lib/x86_64-linux-gnu/libliggghts.so\n")
        self.assertIn("libliggghts-dev", install)


if __name__ == "__main__":
    unittest.main()
