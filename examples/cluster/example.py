"""Settles the bed once and strikes it on two ranks, unculled and culled. Then runs job.sh, kills a rank, and runs job.sh again."""
import math
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))
from solidcull_runs import engine, errors, examples, kills, struck  # noqa: E402
from solidcull_runs.dumps import read_final  # noqa: E402

LENGTH, WIDTH, DEPTH, STRIKER = 0.15, 0.075, 0.062, 0.005  # m: of the bed, height shown, larger radii are the ball
TIME_STEP = 3e-5                           # s
APART = [k * 1e-5 for k in (0, 1, -1, 2, -2)]  # m: the ball's x in each pair of runs
METRICS = ("c_ballz", "c_ballz:min", "v_force:max", "c_bedke:mean", "v_floor:max")
RANKS = 2
SHOWN = 4                                  # moments in the picture
PATIENCE = 3600                            # s for a job


# --- the job, killed and started again ------------------------------------------------------------------------------

def job(folder, variables):
    """job.sh at work in a folder, by mpirun."""
    words = [word for name, value in variables.items() for word in ("-var", name, str(value))]
    env = {**engine.environment(RANKS), engine.NAMED_BY: engine.find_launcher(), "START": f"mpirun --oversubscribe -np {RANKS}"}
    with open(folder / "job.txt", "a") as said:
        return subprocess.Popen(["./job.sh", *words], cwd=folder, env=env, stdin=subprocess.DEVNULL, stdout=said, stderr=subprocess.STDOUT,
                                start_new_session=True)


def end_of(process, folder):
    """Waits for a job; its status. It leaves nothing behind."""
    try:
        return process.wait(PATIENCE)
    except subprocess.TimeoutExpired:
        raise errors.RunError(f"job.sh did not end; see {folder / 'job.txt'}") from None
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)


def killed_and_resumed(example, variables, runs, few):
    """Runs the job as a user does, in a folder of its own: it is killed once it has written a restart file, and submitted again."""
    folder = example.folder(few) / "job"
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "out").mkdir(parents=True)
    for file in ("job.sh", example.deck, *example.sources):
        shutil.copy(HERE / file, folder)
    shutil.copy(HERE / variables["restart"], folder / "out" / "bed.restart")
    own = {name: value for name, value in variables.items() if name not in ("restart", "folder")}
    files, program = folder / "out" / "strike.*.restart", Path(engine.find_launcher()).name
    print(f"job.sh on {RANKS} ranks, one of which is killed", flush=True)
    first = job(folder, own)
    written = kills.wait_for(lambda: kills.newest(files) or first.poll() is not None, PATIENCE)
    ranks = kills.ranks_of(first.pid, program)
    if not written or len(ranks) != RANKS or not kills.kill(ranks[-1]):
        raise errors.RunError(f"job.sh ended before a rank could be killed; see {folder / 'job.txt'}")
    status, left = end_of(first, folder), kills.newest(files)
    if not status or not left:
        raise errors.RunError(f"job.sh, a rank of which was killed, ended with status {status} and left {left}")
    if end_of(job(folder, own), folder):
        raise errors.RunError(f"job.sh failed when it was to go on; see {folder / 'job.txt'}")
    end, straight = read_final(folder / "out" / "strike.end"), runs["culled"][0].final
    whole = np.array_equal(end["id"], straight["id"]) and np.array_equal(end["mass"], straight["mass"])
    ball = [float(granules["z"][granules["radius"] > STRIKER][0]) for granules in (end, straight)]
    apart = abs(ball[0] - ball[1])
    well = bool(whole and math.isfinite(apart))
    for name in ("files", *(run.name for of_kind in runs.values() for run in of_kind)):
        for file in kills.steps_of(example.folder(few) / f"{name}.*.restart").values():
            file.unlink()  # of the runs that are compared: no one goes on from them
    return (f"killed, and gone on from {left.name}: {len(end)} granules of {len(straight)}, ids and masses {'the same' if whole else 'NOT THE SAME'}; "
            f"the ball ends {apart * 1e3:.3f} mm from where it ends without the stop"), well


CLUSTER = examples.Example(
    here=HERE, deck="strike.in", bed="settle.in", bed_takes="settling 40,000 granules: two to three minutes",
    sources=("bed.in", "floor.stl"), granules=40001, steps=8000, wanted=METRICS, figures=lambda run, out: {},
    plot=struck.plot_of(TIME_STEP), moments=struck.moments_of(TIME_STEP, SHOWN, WIDTH / 2, (LENGTH, WIDTH, DEPTH), STRIKER),
    ranks=RANKS, after=killed_and_resumed, files_every=400, vary=("dx", APART), runs=1,
    few={"L": 0.1, "W": 0.02, "bed_granules": 1800, "steps": 700, "every": 200, "drop": 0.024},
    few_bed={"L": 0.1, "W": 0.02, "bed_granules": 1800, "dampsteps": 1000, "freesteps": 50},
    few_granules=1801, few_steps=700, few_files_every=100, few_keywords="every 20")

if __name__ == "__main__":
    errors.command("cluster", lambda: examples.main(CLUSTER))
