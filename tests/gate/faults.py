#!/usr/bin/python3
"""Plants each fault of faults/ into a build, and asks the gate: does it catch it? Half an hour of one core.

    faults.py [NAME ...]          the faults; without a name all of them
    faults.py --flags [NAME ...]  the sources as they are, compiled with other flags: the gate must let them pass
    faults.py --table             only writes what was found so far into README.md

The file with the fault is compiled alone, as the build in build/ compiles it. It becomes a library that the loader takes first, so
the functions of that file are the faulty ones. What came of it is kept in build-faults/, and it goes on where it stopped.
Exit: 0 all caught, or all passed; 1 not all; 2 no verdict.
"""
import argparse
import json
import re
import shlex
import stat
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[1])]
import gate  # noqa: E402
import scenes  # noqa: E402
from solidcull_runs.engine import ROOT, find_launcher  # noqa: E402
from solidcull_runs.errors import RunError, command  # noqa: E402

PATCHES = HERE / "faults"
QUICK = "-O1"  # for a fault's file: takes less time to compile, and is itself another rounding
# the alignment of Eigen stays that of the rest of the build
FLAGS = {"native": "-O3 -march=native -ffp-contract=fast -DEIGEN_MAX_ALIGN_BYTES=16", "order": "-O2 -fassociative-math -fno-signed-zeros -fno-trapping-math",
         "O1": "-O1"}
PHYSICS = ("fix_solid_cull/laws/", "fix_solid_cull/solid/")  # what --flags compiles anew: bodies, their sums, frozen loads, laws


class Fault:
    """What a file of faults/ says: a line of what it is, then a patch of one file."""

    def __init__(self, file):
        self.name = file.stem
        self.what, *lines = file.read_text().splitlines()
        self.path, self.changes = None, []  # of text: (before, after)
        for line in lines:
            if line.startswith("+++ "):
                self.path = line[4:].strip().removeprefix("b/")
            elif line.startswith("@@"):
                self.changes.append(([], []))
            elif self.changes:
                for side, marks in enumerate((" -", " +")):
                    if line[:1] in marks:
                        self.changes[-1][side].append(line[1:] + "\n")

    def planted_in(self, text):
        """A file's text with the fault."""
        for before, after in (("".join(b), "".join(a)) for b, a in self.changes):
            if text.count(before) != 1:
                raise RunError(f"fault {self.name} does not fit {self.path} any more: mend tests/gate/faults/{self.name}.patch")
            text = text.replace(before, after)
        return text


def faults():
    """All of them, by name."""
    return {f.stem: Fault(f) for f in sorted(PATCHES.glob("*.patch"))}


# --- compiling --------------------------------------------------------------------------------------------------------

def run(words, folder):
    done = subprocess.run(words, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if done.returncode:
        errors = [line for line in done.stdout.splitlines() if " error: " in line] or done.stdout.splitlines() or ["it said nothing"]
        raise RunError(f"{Path(words[0]).name} failed: {errors[0]}")


class Compiler:
    """Compiles files of the sources as a build does, see its compile_commands.json."""

    def __init__(self, launcher):
        self.launcher = Path(launcher)
        self.list = self.launcher.parent / "compile_commands.json"
        try:
            self.entries = json.loads(self.list.read_text())
        except (OSError, ValueError):
            raise RunError(f"{self.list} does not say how files are compiled: name the launcher of a build, after cmake --build") from None

    def entries_of(self, path):
        """Those that compile this file of the sources, or some of this folder: alone, or several as one."""
        def names(entry):
            file = Path(entry["file"])
            return [file, *map(Path, re.findall(r'#include "(.+)"', file.read_text()) if "Unity" in file.parts else [])]
        where = (ROOT / path).as_posix() + ("/" if path.endswith("/") else "")
        return [e for e in self.entries if any(n.as_posix() == where or path.endswith("/") and n.as_posix().startswith(where) for n in names(e))]

    def object_of(self, entry, source, to, flags):
        words = shlex.split(entry["command"])
        words[words.index("-o") + 1], words[words.index("-c") + 1] = str(to), str(source)
        run([*words, *flags.split()], entry["directory"])
        return to

    def library(self, objects, folder):
        """A launcher with these objects in front: its path."""
        library, launcher = folder / "planted.so", folder / "launcher"
        run(["c++", "-shared", "-o", str(library), *map(str, objects)], folder)
        launcher.write_text(f'#!/bin/sh\nLD_PRELOAD="{library}${{LD_PRELOAD:+:$LD_PRELOAD}}" exec "{self.launcher}" "$@"\n')
        launcher.chmod(launcher.stat().st_mode | stat.S_IXUSR)
        return launcher

    def with_fault(self, fault, folder):
        folder.mkdir(parents=True, exist_ok=True)
        source = folder / Path(fault.path).name
        source.write_text(fault.planted_in((ROOT / fault.path).read_text()))
        entry, *_ = self.entries_of(fault.path) or [None]
        if not entry:
            raise RunError(f"{self.list} does not name {fault.path}: build again")
        return self.library([self.object_of(entry, source, folder / "planted.o", QUICK)], folder)

    def with_flags(self, flags, folder):
        folder.mkdir(parents=True, exist_ok=True)
        entries = [e for path in PHYSICS for e in self.entries_of(path)]
        entries = [e for k, e in enumerate(entries) if e not in entries[:k]]
        return self.library([self.object_of(e, e["file"], folder / f"{k}.o", flags) for k, e in enumerate(entries)], folder)


# --- what the gate sees -----------------------------------------------------------------------------------------------

def caught_by(lines):
    """The figure that differs most, in short; why there was none, where a run stopped."""
    figure = next((line.strip().partition(" (")[0] for line in lines if line.startswith("  ")), None)
    return figure or lines[0].partition(": ")[2][:120]


def observed(name, what, folder, launcher):
    """What the gate sees of a build: as it was kept, if the scenes are still the same, else seen now by runs of `launcher()`."""
    file = folder / "seen" / f"{name}.json"
    if file.exists():
        seen = json.loads(file.read_text())
        if seen["recipe"] == scenes.recipe():
            return seen
    seen = {"what": what, **gate.observe(str(launcher()))}
    file.parent.mkdir(exist_ok=True)
    part = file.with_suffix(".part")
    part.write_text(json.dumps(seen))
    part.rename(file)
    return seen


def results_of(folder, kept):
    """{name: (what it is, same results, lines)} of all builds seen so far."""
    found = {}
    for file in sorted((folder / "seen").glob("*.json")):
        seen = json.loads(file.read_text())
        if seen["recipe"] == scenes.recipe():
            found[file.stem] = (seen["what"], *gate.verdict(kept, seen))
    return found


def table(folder):
    found = results_of(folder, gate.read_kept())
    faulty = {n: r for n, r in found.items() if not n.startswith("flags-")}
    lines = ["| fault | what it is | caught | by |", "| --- | --- | --- | --- |"]
    for name, (what, same, said) in faulty.items():
        lines.append(f"| {name} | {what.rstrip('.')} | {'**no**' if same else 'yes'} | {'' if same else caught_by(said)} |")
    lines += ["", f"{sum(not same for _, same, _ in faulty.values())} of {len(faulty)} are caught.", "",
              "| build | flags | the gate says |", "| --- | --- | --- |"]
    for name, (what, same, said) in found.items():
        if name.startswith("flags-"):
            lines.append(f"| {name[6:]} | `{what}` | {'same results' if same else 'differs: ' + caught_by(said)} |")
    page = HERE / "README.md"
    text, made = re.subn(r"(?s)(<!-- made by faults.py -->\n).*?(<!-- end -->)",
                         lambda m: m[1] + "\n".join(lines) + "\n" + m[2], page.read_text())
    if made != 1:
        raise RunError(f"{page} has no place for the table")
    page.write_text(text)


# --- the command ------------------------------------------------------------------------------------------------------

def chosen(named, known, what):
    for name in named:
        if name not in known:
            raise RunError(f"{what} {name} is not there; there are: {', '.join(known)}")
    return named or list(known)


def see(names, flags, launcher, folder):
    """Lets the gate see each fault, or each set of flags, where it has not before; their names."""
    known = {f"flags-{n}": words for n, words in FLAGS.items()} if flags else {n: f.what for n, f in faults().items()}
    names = chosen([f"flags-{n}" if flags else n for n in names], known, "build" if flags else "fault")
    for name in names:
        def built():
            compiler, made = Compiler(launcher), folder / name
            return compiler.with_flags(FLAGS[name[6:]], made) if flags else compiler.with_fault(faults()[name], made)
        observed(name, known[name], folder, built)
        print(f"{name}: seen", flush=True)
    return names


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--flags", action="store_true", help="builds with other flags instead of faults")
    parser.add_argument("--table", action="store_true", help="write what was found so far into README.md")
    parser.add_argument("--launcher", help="of a build; else that of SOLIDCULL_LAUNCHER, of build/, or on the PATH")
    parser.add_argument("--folder", type=Path, default=ROOT / "build-faults", help="where it works")
    args = parser.parse_args()
    folder = args.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    if args.table:
        table(folder)
        return 0
    names, kept = see(args.names, args.flags, find_launcher(args.launcher), folder), gate.read_kept()
    found = results_of(folder, kept)
    right = 0
    for name in names:
        _, same, lines = found[name]
        print(f"{name}: {lines[0] if same else 'differs: ' + caught_by(lines)}")
        right += same if args.flags else not same
    print(f"{right} of {len(names)} {'pass' if args.flags else 'are caught'}")
    return 0 if right == len(names) else 1


if __name__ == "__main__":
    command("faults", main)
