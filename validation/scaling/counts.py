"""Runs a deck with count_messages.cpp before MPI, and reads what it has counted."""
import bisect
import re
import shutil
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))
from solidcull_runs import engine  # noqa: E402
from solidcull_runs.errors import RunError  # noqa: E402

SOURCE = HERE / "count_messages.cpp"
COMPILE = ["mpicxx", "-std=c++17", "-O2", "-Wall", "-shared", "-fPIC"]
WHO = ("plug-in", "liggghts")
COLUMNS = ("collectives", "gathered", "largest", "messages", "sent", "partners", "probes", "file_reads", "read")  # of a step, as written


def build(out):
    """The counter as a library; made anew where its source is newer."""
    library = out / "libcount_messages.so"
    if not library.exists() or library.stat().st_mtime < SOURCE.stat().st_mtime:
        out.mkdir(parents=True, exist_ok=True)
        if not shutil.which(COMPILE[0]):
            raise RunError("no mpicxx: install libopenmpi-dev, or what your MPI calls its compiler")
        done = subprocess.run([*COMPILE, "-o", str(library), str(SOURCE), "-ldl"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        if done.returncode:
            raise RunError(f"{SOURCE.name} does not compile: {done.stdout[-500:]}")
    return library


def counted(deck, folder, ranks, variables, counter, limit=600):
    """Runs a deck under the counter; the counts. `folder`: where it runs."""
    for old in folder.glob("messages.*"):
        old.unlink()
    preload = ["-x", f"LD_PRELOAD={counter}", "-x", f"COUNT_MESSAGES={folder / 'messages'}"]
    command = ["mpirun", "--oversubscribe", "-np", str(ranks), *preload, engine.find_launcher(), "-in", str(deck), "-log", "log", "-screen", "screen"]
    for name, value in variables.items():
        command += ["-var", name, str(value)]
    try:
        done = subprocess.run(command, cwd=folder, env=engine.environment(max(2, ranks)), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True, timeout=limit)
    except subprocess.TimeoutExpired:
        raise RunError(f"{Path(deck).name} on {ranks} ranks did not end in {limit} s") from None
    log = (folder / "log").read_text(errors="replace") if (folder / "log").exists() else ""
    if done.returncode:
        raise RunError(f"{Path(deck).name} on {ranks} ranks failed: {engine.error_in(log + done.stdout)}")
    return Counts(folder / "messages", ranks)


class Counts:
    """What was counted on each rank. `steps[who][column]`: an array of ranks x steps; `number` and `builds` of each step."""

    def __init__(self, base, ranks):
        self.ranks, self.sent, self.sites = ranks, {who: [] for who in WHO}, []
        tables = []
        for rank in range(ranks):
            rows = []
            for word, *rest in (line.split() for line in Path(f"{base}.{rank}").read_text().splitlines()):
                if word == "step" and rest[0] != "0":
                    rows.append([float(x) for x in rest if x not in ("builds", *WHO)])
                elif word == "sent":
                    self.sent[rest[0]].append([float(x) for x in rest[1:]])
                elif word == "site" and rank == 0:
                    self.sites.append((rest[0], int(rest[1]), float(rest[2]), float(rest[3]), [int(x, 16) for x in rest[4:] if x != "0"]))
            tables.append(rows)
        if not tables[0] or len({len(rows) for rows in tables}) != 1:
            raise RunError(f"{base}.*: no steps were counted on some rank; does the launcher of this run load LIGGGHTS as a library?")
        table = np.array(tables)
        self.number, self.builds = table[0, :, 0].astype(int), table[0, :, 1]
        self.steps = {who: {name: table[:, :, 2 + k + len(COLUMNS) * w] for k, name in enumerate(COLUMNS)}
                      for w, who in enumerate(reversed(WHO))}

    def kinds(self, every, after=0):
        """Which steps after that one are of which kind: names and masks. A look comes every so many steps."""
        counted, build, look = self.number > after, self.builds > 0, self.number % every == 0
        return {"step": counted & ~build & ~look, "look": counted & ~build & look, "build": counted & build & ~look}

    def summary(self, every, after=0):
        """Of each of the two: how often what happens at a plain step, and what a look and a build add to it; what ranks send and get.
        Collectives are those of the rank with most; messages and their bytes are a mean over ranks, and the most of any rank."""
        kinds, all_of_them = self.kinds(every, after), self.number > after
        made = {"ranks": self.ranks, "steps": int(all_of_them.sum()), "builds": int((self.builds[all_of_them] > 0).sum()),
                "looks": int((self.number[all_of_them] % every == 0).sum())}
        for who in WHO:
            of = self.steps[who]

            def mean(column, kind, of_ranks=np.max, of=of):
                return float(of_ranks(of[column][:, kinds[kind]].mean(1))) if kinds[kind].any() else float("nan")
            row = {}
            for column in ("collectives", "gathered"):
                plain = mean(column, "step")
                row[column] = {"step": plain, **{kind: mean(column, kind) - plain for kind in ("look", "build")},
                               "all": float(of[column][:, all_of_them].mean(1).max())}
            row["largest collective"] = {"all": float(of["largest"][:, all_of_them].max()), "step": float(of["largest"][:, kinds["step"]].max(initial=0))}
            for column in ("messages", "sent", "probes"):
                whole = of[column][:, all_of_them].mean(1)
                row[column] = {"mean": float(whole.mean()), "most": float(whole.max()), "step": mean(column, "step", np.mean),
                               "look": mean(column, "look", np.mean) - mean(column, "step", np.mean),
                               "build": mean(column, "build", np.mean) - mean(column, "step", np.mean)}
            row["partners"] = {"mean": float(of["partners"][:, all_of_them].max(1).mean()), "most": int(of["partners"][:, all_of_them].max())}
            got = np.array(self.sent[who]).sum(0) / all_of_them.sum()
            row["received"] = {"mean": float(got.mean()), "most": float(got.max())}  # bytes a step, of the last run
            row["file reads"] = int(of["file_reads"].sum())
            made[who] = row
        return made

    def by_caller(self, library, depth=3):
        """Calls of the plug-in on rank 0 by the functions that they come from, most calls first: (call, functions, calls, bytes, largest)."""
        names = Names(library)
        rows = defaultdict(lambda: [0, 0.0, 0.0])
        for call, calls, held, largest, places in self.sites:
            if places:
                row = rows[call, " < ".join(dict.fromkeys(names.of(place - 1) for place in places[:depth + 2] if not names.is_port(place - 1)))]
                row[0], row[1], row[2] = row[0] + calls, row[1] + held, max(row[2], largest)
        return [(call, where, *row) for (call, where), row in sorted(rows.items(), key=lambda item: -item[1][0])]


class Names:
    """Functions of a library by place."""

    def __init__(self, library):
        told = subprocess.run(["nm", "-C", "--defined-only", str(library)], stdout=subprocess.PIPE, text=True, check=True).stdout
        rows = [line.split(" ", 2) for line in told.splitlines()]
        self.known = sorted((int(place, 16), name) for place, kind, name in (row for row in rows if len(row) == 3) if kind in "tTwWV")
        self.places = [place for place, _ in self.known]

    def of(self, place):
        at = bisect.bisect_right(self.places, place) - 1
        name = self.known[at][1] if at >= 0 else hex(place)
        return re.sub(r"\(.*|<.*>", "", name.replace("(anonymous namespace)::", "").replace("solidcull::", ""))

    def is_port(self, place):
        """Whether it belongs to what hands messages on, and tells nothing of who asked."""
        return self.of(place).startswith(("EngineRanks", "Ranks::", "RowType"))


def library_of(launcher):
    """The library that holds the fix."""
    beside = Path(launcher).resolve().parent / "libsolidcull.so"
    return beside if beside.exists() else Path(launcher)
