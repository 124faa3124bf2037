"""Runs a deck with and without solid/cull, and says what is wrong with the former."""
import os
import re
import shutil
import signal
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from solidcull_runs.engine import environment  # noqa: E402

D = 0.003            # m: the largest diameter of a deck
TIME_LIMIT = 120     # s for one file of a deck
AT_REST = 0.02       # m/s: below this mean speed, the end of a run is at rest
HEIGHT = 0.5         # d: mean heights of two runs at rest may differ by so much
WEIGHT = 0.1         # of the weight: loads on the floor of two runs at rest
SLACK = (5, 0.05)    # granules and share: counts that hang on chance
CONTACTS = 0.25      # share: numbers of contacts of two runs
RESTORED = {"contacts": 0.0, "load": 0.1}  # share: of the same granules; forces hang on speeds, which a set-up takes half a step later
LOADS = (1e-9, 0.7)  # and share: sums of stresses (J) or of overlaps (m) over contacts
DRIVER = Path(__file__).resolve().parent / "driver.py"

# the plug-in may refuse these; anything else that it refuses is to be looked at
REFUSALS = [r"minimize would move atoms only"]
CRASH = re.compile(r"terminate called|Segmentation fault|internal error|Signal: |\*\*\* Process received|AddressSanitizer|runtime error:"
                   r"|LeakSanitizer|corrupted|double free|Assertion")


@dataclass
class End:
    """How a deck ended, what it printed, and the granules at its end by tag."""
    status: int = 0
    late: bool = False
    text: str = ""
    errors: list = field(default_factory=list)
    granules: dict = None
    checks: dict = field(default_factory=dict)
    weight: float = None
    created: int = 0
    deleted: int = 0
    culled: int = 0

    def crashed(self):
        crash = CRASH.search(self.text)
        return crash[0] if crash else f"signal {-self.status if self.status < 0 else self.status - 128}" \
            if self.status < 0 or 128 < self.status < 160 else None


def run_file(command, folder, env):
    """Status, whether it was late, and what it printed; again where MPI itself does not start, on a busy machine."""
    for _ in range(3):
        status, late, out = run_once(command, folder, env)
        if not status or (Path(folder) / command[command.index("-log") + 1]).exists():
            break
    return status, late, out


def run_once(command, folder, env):
    child = subprocess.Popen(command, cwd=folder, env=env, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                             start_new_session=True)
    try:
        out, _ = child.communicate(timeout=TIME_LIMIT)
        return child.returncode, False, out.decode(errors="replace")
    except subprocess.TimeoutExpired:
        os.killpg(child.pid, signal.SIGTERM)
        try:
            out, _ = child.communicate(timeout=5)
        except subprocess.TimeoutExpired:
            os.killpg(child.pid, signal.SIGKILL)
            out, _ = child.communicate()
        return child.returncode, True, out.decode(errors="replace")


def run(deck, culled, program, folder, ranks=None):
    """The end of a deck; its files stay in `folder`."""
    folder = Path(folder)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name, text in deck.meshes.items():
        (folder / name).write_text(text)
    end = End()
    for f in range(len(deck.files)):
        (folder / f"deck{f}.in").write_text(deck.text(f, culled))
        n = ranks or deck.ranks[f]
        files, env = ["-log", f"log{f}", "-screen", f"screen{f}"], {**environment(n), **({"SOLIDCULL_CHECK": "1"} if culled else {})}
        command = [str(program), "-in", f"deck{f}.in", *files]
        if "library" in deck.traits:
            command = ["env", *preloaded(program, culled), sys.executable, str(DRIVER), f"deck{f}.in", *files]
        end.status, end.late, out = run_file((["mpirun", "-np", str(n)] if n > 1 else []) + command, folder, env)
        (folder / f"output{f}").write_text(out)
        log = folder / f"log{f}"
        screen = folder / f"screen{f}"
        shown = screen.read_text(errors="replace") if screen.exists() else ""
        end.text += out + (log.read_text(errors="replace") if log.exists() else "")
        end.errors += list(dict.fromkeys(re.sub(r" \(\S+:\d+\)$", "", line) for line in (shown + "\n" + out).splitlines() if line.startswith("ERROR")))
        read(end, shown)
        read_library(end, folder)
        if end.status or end.late:
            return end
    dump = folder / "end.dump"
    if dump.exists():
        rows = [line.split() for line in dump.read_text().split("ITEM: ATOMS")[1].splitlines()[1:]]
        end.granules = {}
        for row in rows:
            end.granules.setdefault(int(row[0]), []).append((int(row[1]), *map(float, row[2:])))
    return end


def preloaded(program, culled):
    """Words of the environment by which a program that embeds LIGGGHTS has the fix; sanitizers that it needs come first."""
    if not culled:
        return []
    library = Path(program).with_name("libsolidcull.so")
    needs = subprocess.run(["ldd", library], stdout=subprocess.PIPE, text=True).stdout
    return [f"LD_PRELOAD={':'.join([*re.findall(r'=> (/[^ ]*lib[at]san[^ ]*)', needs), str(library)])}", "ASAN_OPTIONS=detect_leaks=0"]


def read_library(end, folder):
    """What each rank got by the C library."""
    for file in sorted(folder.glob("library.[0-9]*")):
        for line in file.read_text().splitlines():
            name, kind, value, how = line.split()
            before = end.checks.get(name, (kind, 0.0))[1] if how == "sum" else 0.0
            end.checks[name] = (kind, before + float(value))
        file.unlink()


def read(end, shown):
    """What the deck printed, and LIGGGHTS about atoms that it made and deleted."""
    for name, kind, value in re.findall(r"^CHECK (\w+) (\w+) (\S+)$", shown, re.M):
        end.checks[name] = (kind, float(value))
    for value in re.findall(r"^WEIGHT (\S+)$", shown, re.M):
        end.weight = float(value)
    end.created += sum(map(int, re.findall(r"^Created (\d+) atoms", shown, re.M)))
    totals = {}
    for name, total in re.findall(r"INFO: Particle insertion (\w+): inserted .*\s.*a total of (\d+) particle", shown):
        totals[name] = int(total)
    end.created += sum(totals.values())
    end.culled += sum(map(int, re.findall(r"^fix cull solid/cull: .*; culled (\d+)", shown, re.M)))
    end.deleted += sum(map(int, re.findall(r"^Deleted (\d+) atoms", shown, re.M)))


@dataclass
class Verdict:
    """`kind`: "good", "unjudged" (stock fails too), "refused" (as it should), or what is wrong."""
    kind: str
    text: str = ""
    culled: int = 0  # granules, at times

    def fails(self):
        return self.kind not in ("good", "unjudged", "refused")


def apart(a, b):
    return abs(a - b) > max(SLACK[0], SLACK[1] * max(a, b))


def differs(kind, got, value):
    """Whether a number that a deck read is another than in stock: `exact`; `loose`, a count that hangs on chance; `contacts`, their number;
    `load`, a sum over them."""
    if kind == "exact":
        return not abs(got - value) <= 1e-9 * abs(value)
    if kind == "loose":
        return value > 1 and apart(got, value)
    slack, share = LOADS if kind == "load" else (SLACK[0], CONTACTS)
    return not abs(got - value) <= max(slack, share * max(abs(got), abs(value)))


def says_so_restored(deck, name, program, folder):
    """Whether a sum over contacts that our run printed is that of its bed when all is restored right there."""
    for kind, share in RESTORED.items():
        line = f'print "CHECK {name} {kind} '
        short = deck.up_to(line, ["unfix cull", "run 0", f'print "CHECK {name}_restored {kind} ${{{name}}}"'])
        if short:
            end = run(short, True, program, folder)
            if end.late or not all(n in end.checks for n in (name, f"{name}_restored")):
                return False
            (_, told), (_, restored) = end.checks[name], end.checks[f"{name}_restored"]
            return abs(told - restored) <= max(LOADS[0], share * max(abs(told), abs(restored)))
    return False


def whole(end):
    """Count, mass and mean height of the granules at the end, and their mean speed."""
    rows = [row for group in end.granules.values() for row in group]
    mass = sum(r[1] for r in rows)
    speed = sum((r[6]**2 + r[7]**2 + r[8]**2)**0.5 for r in rows) / max(1, len(rows))
    return len(rows), mass, sum(r[1] * r[5] for r in rows) / mass if mass else 0.0, speed


def judge_end(deck, stock, mine):
    """What the granules at the end say; None where all is well."""
    n, mass, height, speed = whole(mine)
    m, mass0, height0, speed0 = whole(stock)
    twice = [tag for tag, rows in mine.granules.items() if len(rows) > 1]
    if twice and not any(len(rows) > 1 for rows in stock.granules.values()):
        return Verdict("tags", f"granules {twice[:5]} are there more than once")
    if "left" in deck.traits:
        return None
    due, due0 = mine.created - mine.deleted, stock.created - stock.deleted
    if len(deck.files) == 1 and due0 == m and due != n:
        return Verdict("lost", f"{mine.created} made, {mine.deleted} deleted, {n} at the end; stock loses none")
    if "loose" in deck.traits:
        return Verdict("count", f"{n} granules at the end, stock {m}") if apart(n, m) else None
    if n != m:
        return Verdict("count", f"{n} granules at the end, stock {m}")
    if "renumbered" not in deck.traits:
        if set(mine.granules) != set(stock.granules):
            return Verdict("tags", f"tags {sorted(set(mine.granules) ^ set(stock.granules))[:8]} in one run only")
        for tag, rows in mine.granules.items():
            if rows[0][:3] != stock.granules[tag][0][:3] and "by place" not in deck.traits:
                return Verdict("values", f"granule {tag} has type, mass, radius {rows[0][:3]}, stock {stock.granules[tag][0][:3]}")
    if "by place" not in deck.traits and abs(mass - mass0) > 1e-9 * mass0:
        return Verdict("mass", f"{mass:.12g} kg at the end, stock {mass0:.12g}")
    if max(speed, speed0) < AT_REST:
        if abs(height - height0) > HEIGHT * D:
            return Verdict("height", f"mean height {height / D:.3f} d, stock {height0 / D:.3f} d")
        if mine.weight is not None and stock.weight is not None and "driven" not in deck.traits:
            bears_it = abs(abs(stock.weight) - 9.81 * mass0) < WEIGHT * 9.81 * mass0  # and nothing else, as sides or a lid
            if bears_it and abs(mine.weight - stock.weight) > WEIGHT * 9.81 * mass:
                return Verdict("weight", f"floor bears {mine.weight:.6g} N, stock {stock.weight:.6g} N, weight {9.81 * mass:.6g} N")
    return None


def judge(deck, stock, mine):
    crash = mine.crashed()
    if crash and not stock.crashed():
        return Verdict("crash", crash + "; " + "; ".join(mine.errors)[:300])
    if mine.late and not stock.late:
        return Verdict("hang", f"not ended after {TIME_LIMIT} s")
    own = [e for e in mine.errors if "solid/cull" in e or "interface/mesh" in e]
    if own:
        if len(set(own)) != 1 or not re.match(r"ERROR( on proc \d+)?: (fix cull solid/cull|region interface/mesh): \S", own[0]):
            return Verdict("message", " | ".join(own))
        return Verdict("refused" if any(re.search(r, own[0]) for r in REFUSALS) else "refusal", own[0])
    if stock.status or stock.late:
        return Verdict("unjudged", "; ".join(stock.errors)[:200] or f"stock: status {stock.status}")
    if mine.status or mine.granules is None:
        return Verdict("error", "; ".join(mine.errors)[:300] or f"status {mine.status}, without a word: {mine.text[-300:]}")
    for name, (kind, value) in stock.checks.items():
        got = mine.checks.get(name, (kind, float("nan")))[1]
        if differs(kind, got, value):
            return Verdict("check", f"{name} ({kind}) is {got:.12g}, stock {value:.12g}")
    return judge_end(deck, stock, mine) or Verdict("good")
