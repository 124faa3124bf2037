"""The .deb: what it holds and says; that decks run from it and programs build against it, unpacked in a folder; and, as root on a
machine that has no solidcull, that apt-get installs it and leaves nothing behind when it removes it."""
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
sys.path[:0] = [str(ROOT), str(ROOT / "scripts"), str(ROOT / "tests")]
import check_words  # noqa: E402
from solidcull_runs import engine  # noqa: E402
from test_messages import BLOCK, CULL_BLOCK, VERSION  # noqa: E402

BUILD = Path(os.environ.get("SOLIDCULL_LAUNCHER", ROOT / "build/liggghts-solidcull")).resolve().parent
FEW = [word for name, value in {"L": 0.02, "bed_granules": 900, "dampsteps": 1000, "freesteps": 50, "steps": 700}.items()
       for word in ("-var", name, str(value))]
LEFT_OUT = re.compile(r"^  left out      = [1-9]\d* \(", re.M)


def told(words, **more):
    done = subprocess.run([str(w) for w in words], text=True, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          check=False, timeout=300, **more)
    if done.returncode != 0:
        raise AssertionError(f"{' '.join(map(str, words))} ended with {done.returncode}:\n{done.stdout[-3000:]}")
    return done.stdout


def may_install():
    """As root, beside no other one, and where apt has all that the package depends on."""
    if os.geteuid() != 0 or not shutil.which("apt-get"):
        return False
    return subprocess.run(["dpkg-query", "-W", "solidcull"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False).returncode != 0


class Version(unittest.TestCase):
    def test_all_files_name_the_same_one(self):
        first, date = re.search(r"^## (\S+) - (\S+)$", (ROOT / "CHANGELOG.md").read_text(), re.M).groups()
        cited = dict(re.findall(r"^([\w-]+): (.*)$", (ROOT / "CITATION.cff").read_text(), re.M))
        self.assertEqual((first, cited["version"], cited["date-released"]), (VERSION, VERSION, f'"{date}"'))


@unittest.skipUnless((BUILD / "CPackConfig.cmake").exists(), "this build makes no .deb: it is for another LIGGGHTS than Debian's")
class Package(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = Path(cls.enterClassContext(tempfile.TemporaryDirectory(prefix="solidcull-")))
        told(["cpack", "--config", BUILD / "CPackConfig.cmake", "-B", cls.folder / "made"], cwd=BUILD)
        cls.deb, = (cls.folder / "made").glob("*.deb")
        cls.root = cls.folder / "root"
        told(["dpkg-deb", "-x", cls.deb, cls.root])
        cls.files = {p.relative_to(cls.root).as_posix() for p in cls.root.rglob("*") if not p.is_dir()}

    def run_impact(self, program, doc, folder):
        """The impact of the examples in small, as the man page says."""
        shutil.copytree(doc / "examples/impact", folder)
        (folder / "out").mkdir()
        env = engine.environment(1)
        told([program, "-in", "settle.in", *FEW, "-log", "none"], cwd=folder, env=env)
        screen = told([program, "-in", "impact.in", *FEW, "-log", "none"], cwd=folder, env=env)
        self.assertIn(f"fix cull solid/cull: version {VERSION}\n", screen)
        self.assertRegex(screen, LEFT_OUT, "granules that were culled")
        last = re.findall(r"^\s*700\s+(\d+)\s+\S+\s+\S+\s*$", screen, re.M)  # step, atoms, two more: after unfix
        self.assertEqual(last, ["901"], screen[-2000:])

    def build_and_run(self, *where):
        """The program of tests/package; returns what it says of the tiny bed."""
        build = Path(tempfile.mkdtemp(dir=self.folder))
        told(["cmake", "-S", ROOT / "tests/package", "-B", build, f"-DWANTED={VERSION}", *where])
        told(["cmake", "--build", build])
        (build / "deck.in").write_text(BLOCK + CULL_BLOCK + "\nrun 400\n")
        return told([build / "embeds", "deck.in"], cwd=build, env=engine.environment(1))

    def test_what_it_says(self):
        said = dict(re.findall(r"^ ?([\w-]+): (.*)$", told(["dpkg-deb", "-f", self.deb]), re.M))
        arch = told(["dpkg", "--print-architecture"]).strip()
        self.assertEqual(self.deb.name, f"solidcull_{VERSION}_{arch}.deb")
        self.assertEqual((said["Package"], said["Version"], said["Architecture"], said["Section"]), ("solidcull", VERSION, arch, "science"))
        self.assertTrue(said["Maintainer"] and said["Description"])
        needed = {word.split()[0] for word in said["Depends"].split(",")}
        for name in ("liggghts", "libliggghts3", "libc6", "libstdc++6", "libtbb12"):
            self.assertIn(name, needed)
        self.assertTrue(any(n.startswith("libopenvdb") for n in needed) and any(n.startswith("libopenmpi") for n in needed), needed)
        self.assertFalse({n for n in needed if n.endswith("-dev")})

    def test_what_it_holds(self):
        doc = "usr/share/doc/solidcull/"
        for name in ("usr/bin/liggghts-solidcull", "usr/lib/libsolidcull.so", "usr/include/solidcull.h", "usr/share/man/man1/liggghts-solidcull.1",
                     "usr/lib/cmake/solidcull/solidcull-config.cmake", doc + "README.md", doc + "CHANGELOG.md", doc + "copyright",
                     "usr/bin/solidcull-bed", "usr/share/man/man1/solidcull-bed.1", "usr/share/solidcull/solidcull_runs/beds_on_demand/pour.in",
                     doc + "examples/impact/impact.in", doc + "examples/impact/floor.stl"):
            self.assertIn(name, self.files)
        for page in ROOT.glob("fix_solid_cull/*.md"):
            self.assertIn(doc + "fix_solid_cull/" + page.name, self.files)
        places = ("usr/bin/", "usr/lib/libsolidcull.so", "usr/lib/cmake/solidcull/", "usr/include/solidcull.h", "usr/share/man/man1/",
                  "usr/share/solidcull/", doc)
        self.assertEqual([f for f in self.files if not f.startswith(places)], [])
        for line in told(["dpkg-deb", "-c", self.deb]).splitlines():
            self.assertRegex(line, r"^(drwxr-xr-x|-rwxr-xr-x|-rw-r--r--) root/root ")

    def test_nothing_of_the_build_is_in_it(self):
        for name in self.files:
            self.assertNotIn(str(BUILD).encode(), (self.root / name).read_bytes(), name)

    def test_links_of_its_pages_lead_somewhere(self):
        for page in (self.root / "usr/share/doc/solidcull").rglob("*.md"):
            # sources are not in it
            dead = [f.text for f in check_words.dead_links(page) if not re.search(r"\.(py|h|cpp)$", f.text)]
            self.assertEqual(dead, [], page)

    def test_man_pages(self):
        for name in ("liggghts-solidcull.1", "solidcull-bed.1"):
            page = self.root / "usr/share/man/man1" / name
            text = page.read_text()
            self.assertIn(f'"solidcull {VERSION}"', text)
            self.assertNotIn("@", text)
            if shutil.which("man"):
                self.assertEqual(subprocess.run(["man", "-l", "--warnings", page], env={**os.environ, "LC_ALL": "C.UTF-8", "MANROFFSEQ": ""},
                                                stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, check=True).stderr, b"")

    def test_it_runs_where_it_is_unpacked(self):
        self.assertEqual(told([self.root / "usr/bin/liggghts-solidcull", "-version"]), f"solidcull {VERSION}\n")
        self.run_impact(self.root / "usr/bin/liggghts-solidcull", self.root / "usr/share/doc/solidcull", self.folder / "unpacked")

    def test_solidcull_bed_runs_where_it_is_unpacked(self):
        env = {**engine.environment(1), engine.NAMED_BY: str(self.root / "usr/bin/liggghts-solidcull"), "PYTHONDONTWRITEBYTECODE": "1"}
        said = told([self.root / "usr/bin/solidcull-bed", "--box", "0.024", "0.024", "--granules", "500", "--sizes", "0.0012:0.5,0.0014:0.5", "--density", "2500",
                     "--material", ROOT / "validation/beds/material.in", self.folder / "bed.restart"], env=env)
        self.assertIn("bed.restart: 500 granules", said)

    def test_programs_build_against_it(self):
        self.check_program(f"-Dsolidcull_DIR={self.root}/usr/lib/cmake/solidcull")

    def check_program(self, *where):
        self.assertRegex(self.build_and_run(*where), r"^343 granules, [1-9]\d* interior$")
        self.assertRegex(self.build_and_run("-DCMAKE_CXX_FLAGS=-DWITH_HEADER", *where),
                         rf"^343 granules, [1-9]\d* interior, solidcull {re.escape(VERSION)}$")

    def test_a_program_that_wants_a_later_version_is_refused(self):
        with self.assertRaisesRegex(AssertionError, f"version: {re.escape(VERSION)}"):
            told(["cmake", "-S", ROOT / "tests/package", "-B", self.folder / "later", "-DWANTED=99",
                  f"-Dsolidcull_DIR={self.root}/usr/lib/cmake/solidcull"])

    def test_a_program_without_the_engines_headers_is_refused_in_one_line(self):
        with self.assertRaisesRegex(AssertionError, "LIGGGHTS was not found: install libliggghts-dev, or name"):
            told(["cmake", "-S", ROOT / "tests/package", "-B", self.folder / "headless", "-DWANTED=" + VERSION,
                  "-DCMAKE_IGNORE_PATH=/usr/include/liggghts", f"-Dsolidcull_DIR={self.root}/usr/lib/cmake/solidcull"])

    @unittest.skipUnless(may_install(), "not root, or a solidcull is installed: it stays as it is")
    def test_apt_installs_it_and_leaves_nothing_behind(self):
        apt = ["apt-get", "-q", "-y", "-o", "DPkg::Lock::Timeout=300", "--no-install-recommends"]
        env = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
        self.addCleanup(subprocess.run, ["dpkg", "--purge", "solidcull"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)
        told([*apt, "install", self.deb], env=env)
        self.assertEqual(told(["/usr/bin/liggghts-solidcull", "-version"]), f"solidcull {VERSION}\n")
        installed = {f for f in self.files if Path("/", f).exists()}
        self.assertEqual(installed, self.files)
        self.run_impact("liggghts-solidcull", Path("/usr/share/doc/solidcull"), self.folder / "installed")
        self.check_program()
        told([*apt, "remove", "solidcull"], env=env)
        self.assertEqual([f for f in self.files if Path("/", f).exists()], [])
        for folder in ("/usr/share/doc/solidcull", "/usr/lib/cmake/solidcull"):
            self.assertFalse(Path(folder).exists(), folder)
        self.assertFalse(subprocess.run(["dpkg-query", "-W", "solidcull"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, check=False).stdout)


if __name__ == "__main__":
    unittest.main()
