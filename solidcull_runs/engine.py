"""Finding LIGGGHTS with the fix, and running decks with it."""
import hashlib
import os
import re
import shutil
import signal
import subprocess
import threading
import time
from pathlib import Path

from .errors import RunError

ROOT = Path(__file__).resolve().parents[1]
NAMED_BY = "SOLIDCULL_LAUNCHER"  # variable of the environment: another launcher than that of build/
POLL = 0.02                      # s between two looks at a process
COUNTED = ("instructions", "cycles")
PATIENCE = 5                     # s that a process is given to stop


def environment(ranks=1):
    """Open MPI as root, in a container or bare root, or without mpirun, says nothing and does its work. What the user has set stays."""
    given = re.findall(r"^export (.*?)(?: +#.*)?$", (ROOT / "scripts" / "mpi-env.sh").read_text(), re.M)
    env = dict(word.split("=", 1) for line in given for word in line.split())
    if ranks == 1:  # programs on one rank share a folder, and one that ends takes it from one that starts
        env["OMPI_MCA_orte_create_session_dirs"] = "0"
    return {**env, **os.environ}


def find_launcher(named=None):
    """The launcher that is named, in the call or by NAMED_BY; else that of build/, else the one on the PATH."""
    named = named or os.environ.get(NAMED_BY)
    built = ROOT / "build" / "liggghts-solidcull"
    found = shutil.which(named) if named else str(built) if os.access(built, os.X_OK) else shutil.which(built.name)
    if not found:
        raise RunError(f"no launcher at {named or built}: build it (cmake -S . -B build && cmake --build build) "
                       f"or name it with --launcher or {NAMED_BY}")
    return str(Path(found).absolute())


def hash_of_fix(launcher):
    """Of the library that holds the fix; of a launcher that holds it itself."""
    needs = subprocess.run(["ldd", launcher], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True).stdout
    files = re.findall(r"libsolidcull\S* => (/\S+)", needs) or [launcher]
    return hashlib.sha1(b"".join(Path(f).read_bytes() for f in files)).hexdigest()


def error_in(log):
    """The line of a log that says why LIGGGHTS stopped."""
    lines = [line.strip() for line in log.splitlines() if line.strip()]
    errors = [line for line in lines if line.startswith("ERROR")]
    return (errors or lines or ["it printed nothing"])[-1]


def ending(status):
    """How a process ended, in words."""
    if status < 0:
        return f"was killed by signal {-status} ({signal.Signals(-status).name})"
    return f"stopped with status {status}"


RUNNING = set()  # the processes at work


def stop_all():
    """Ends every process at work, whichever thread waits for it."""
    for process in list(RUNNING):
        process.stop()


class Process:
    """A LIGGGHTS at work on a deck. What it prints is in the file `log`; with `screen`, LIGGGHTS itself writes the log, which is
    then up to date wherever the deck says `flush yes`, and what it prints is in the file `screen`. With `count`, a file that perf
    writes, instructions and cycles are counted where the machine lets perf do it. With `core` it stays on that one."""

    def __init__(self, launcher, deck, folder, log, variables=None, ranks=1, screen=None, count=None, core=None):
        self.log, self.screen, self.count = Path(log), screen and Path(screen), count and Path(count)
        command = [launcher, "-in", str(deck), *(["-log", str(log), "-echo", "log"] if screen else ["-log", "none", "-echo", "screen"])]
        for name, value in (variables or {}).items():
            command += ["-var", name, str(value)]
        if ranks == 1 and shutil.which("stdbuf"):  # LIGGGHTS aborts without emptying its buffers: the line that says why would be lost
            command = ["stdbuf", "-oL", *command]
        if ranks > 1:
            command = ["mpirun", "--oversubscribe", "-np", str(ranks), *command]
        if count and shutil.which("perf"):
            command = ["perf", "stat", "-x", ",", "-e", ",".join(f"{event}:u" for event in COUNTED), "-o", str(count), *command]
        if core is not None and shutil.which("taskset"):
            command = ["taskset", "-c", str(core), *command]
        if shutil.which("setpriv"):  # a driver that is killed leaves no run behind
            command = ["setpriv", "--pdeathsig", "KILL", *command]
        self.wall = self.cpu = self.user = None  # s: from start to end, and of processors, once it has ended
        self.began = time.monotonic()
        with open(screen or log, "w") as f:
            self.child = subprocess.Popen(command, cwd=folder, env=environment(ranks), stdin=subprocess.DEVNULL, stdout=f,
                                          stderr=subprocess.STDOUT)
        RUNNING.add(self)
        self.waiter = threading.Thread(target=self.note_the_end, daemon=True)  # knows when, whatever this process is at
        self.waiter.start()

    def note_the_end(self):
        _, status, used = os.wait4(self.child.pid, 0)
        self.wall, self.cpu, self.user = time.monotonic() - self.began, used.ru_utime + used.ru_stime, used.ru_utime
        self.child.returncode = os.waitstatus_to_exitcode(status)
        RUNNING.discard(self)

    def ended(self):
        """Whether it has ended; then `wall` and `cpu` are known."""
        return not self.waiter.is_alive()

    def counted(self):
        """Instructions and cycles, once it has ended: {} where none were counted."""
        if not (self.count and self.count.exists()):
            return {}
        rows = [line.split(",") for line in self.count.read_text().splitlines()]
        return {event: float(row[0]) for row in rows for event in COUNTED if len(row) > 2 and row[2].startswith(event) and row[0].isdigit()}

    def text(self):
        """Its log, once it has ended well; RunError if it has not."""
        text = self.log.read_text(errors="replace") if self.log.exists() else ""
        if self.child.returncode:
            said = text + (self.screen.read_text(errors="replace") if self.screen else "")
            raise RunError(f"{self.log.stem}: LIGGGHTS {ending(self.child.returncode)}: {error_in(said)} (all of it: {self.log})")
        return text

    def wait(self, watch=None):
        """Waits for its end; its log. `watch(process)` is called again and again."""
        try:
            while not self.ended():
                if watch:
                    watch(self)
                time.sleep(POLL)
        finally:
            self.stop()
        return self.text()

    def stop(self):
        """Ends it if it runs."""
        if not self.ended():
            self.child.terminate()
            self.waiter.join(PATIENCE)
        if not self.ended():
            self.child.kill()
            self.waiter.join()


def run_liggghts(deck, folder, log, variables=None, ranks=1):
    """Runs a deck in a folder, everything that it prints in the file `log`; that text."""
    return Process(find_launcher(), deck, folder, log, variables, ranks).wait()
