"""Figures of many runs, one file for each run, so that a long series can be stopped and goes on."""
import json
import tempfile
from pathlib import Path

import numpy as np

import figures
import scenes
from solidcull_runs.engine import hash_of_fix
from solidcull_runs.errors import RunError


def figures_of(launcher, member, ranks=1):
    """All figures of a run."""
    with tempfile.TemporaryDirectory() as folder:
        printed = scenes.run(launcher, folder, member, ranks)
        return figures.of_run(printed, folder)


def of_members(launcher, members, folder, say=print, ranks=1):
    """Figures of the first member, and the numbers of all: (members, figures). Runs those that are not in the folder yet."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    recipe = f"{scenes.recipe()}-{hash_of_fix(launcher)[:16]}-{ranks}"
    first, rows = None, []
    for n, member in enumerate(members):
        file = folder / f"{recipe}-{member}.json"
        if not file.exists():
            say(f"run {n + 1} of {len(members)}")
            found = [[f.scene, f.when, f.what, f.value, f.unit] for f in figures_of(launcher, member, ranks)]
            part = file.with_suffix(".part")
            part.write_text(json.dumps(found))
            part.rename(file)
        found = [figures.Figure(*row) for row in json.loads(file.read_text())]
        first = first or found
        if [f.name for f in found] != [f.name for f in first]:
            raise RunError(f"run {member} has other figures than run {members[0]}: rows came at other steps")
        rows.append([f.value for f in found])
    return first, np.array(rows)
