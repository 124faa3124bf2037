"""A job on several ranks that is killed: its ranks, and the newest restart file that it left."""
import os
import re
import signal
import time
from pathlib import Path


def below(pid):
    """The processes that a process has started, and those that these have."""
    try:
        of_each = [(Path(f"/proc/{pid}/task") / thread / "children").read_text().split() for thread in os.listdir(f"/proc/{pid}/task")]
    except OSError:  # it has ended
        return []
    children = [int(child) for of_one in of_each for child in of_one]
    return [found for child in children for found in (child, *below(child))]


def is_running(pid, program):
    """Whether a process, which may have ended, runs that program."""
    try:
        return Path(os.readlink(f"/proc/{pid}/exe")).name == program
    except OSError:
        return False


def ranks_of(pid, program):
    """The ranks that a process, as mpirun, has started."""
    return [child for child in below(pid) if is_running(child, program)]


def kill(pid):
    """Kills a process without warning; False if it has ended before."""
    try:
        os.kill(pid, signal.SIGKILL)
    except ProcessLookupError:
        return False
    return True


def wait_for(condition, at_most, every=0.01):
    """Waits until it holds; whether it does."""
    end = time.monotonic() + at_most
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(every)
    return True


def steps_of(pattern):
    """Restart files by step: {step: file}. `pattern`: a path with one * where the step stands. As LIGGGHTS, it takes no file whose name
    begins with anything else."""
    pattern = Path(pattern)
    name = re.compile(re.escape(pattern.name).replace(r"\*", r"(\d+)"))
    found = ((name.fullmatch(f.name), f) for f in (pattern.parent.iterdir() if pattern.parent.is_dir() else ()))
    return {int(m[1]): f for m, f in found if m}


def newest(pattern):
    """The file of the largest step, or None."""
    files = steps_of(pattern)
    return files[max(files)] if files else None
