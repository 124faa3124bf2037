"""Makes the oval once, drops it unculled and culled, and leaves the paper's table, the error, a plot and pictures in out/."""
import statistics
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))
from solidcull_runs import cutaways, errors, examples, plots, tables  # noqa: E402
from solidcull_runs.comparisons import MARGIN, apart  # noqa: E402
from solidcull_runs.measures import height_map  # noqa: E402

FRAME_RATE = 24                      # 1/s
SHIFTS = (0, 2e-7, -2e-7)            # m: how far each granule is moved in each pair of runs, 1e-5 granule diameters
METRICS = ("f_load:max", "f_load")   # load on the floor, mean of a frame (N)
WIDTH, CELL, RING = 4.0, 0.005, 0.04  # m: the floor, a cell of the height map, a ring of the profile
MOMENTS = {3: "in the air", 6: "hit", 12: "spreading", 63: "lying"}  # frame: name, as in Figure 5
SHOWN = (-0.75, -0.05, 0), (0.75, 0.45, 0.72)                       # m, the box in the pictures
PAPER = {"total time (s)": "13.6", "least frame time (s)": "52"}  # ratios


# --- the heap -------------------------------------------------------------------------------------------------------

def profile(height):
    """Mean height (m) of the rings around the axis of the fall, and their areas (m2)."""
    middles = (np.arange(len(height)) + 0.5) * CELL - WIDTH / 2
    ring = (np.hypot(middles[:, None], middles) / RING).astype(int).ravel()
    cells = np.bincount(ring)
    return np.bincount(ring, height.ravel()) / np.maximum(cells, 1), cells * CELL**2


def heap(run, out):
    """What the heap is like, from the places of all granules at the end; keeps the run's profile."""
    height = height_map(run.final, (-WIDTH / 2, -WIDTH / 2), (WIDTH, WIDTH), CELL)
    run.profile, run.areas = profile(height)
    distance = np.hypot(run.final["x"], run.final["y"])
    order = np.argsort(distance)
    mass = np.cumsum(run.final["mass"][order])
    return {"heap radius": float(distance[order][np.searchsorted(mass, 0.9 * mass[-1])]),
            "heap height": float(run.profile[0]),
            "heap volume": float(height.sum() * CELL**2)}


def profile_error(runs):
    """Volume between the mean culled and the mean unculled profile, and the largest between two unculled ones; both over the heap's."""
    areas = runs["unculled"][0].areas
    a, b = (np.mean([r.profile for r in runs[kind]], axis=0) for kind in ("unculled", "culled"))

    def between(p, q):
        return float((np.abs(p - q) * areas).sum() / (a * areas).sum())

    error, noise = between(a, b), apart([r.profile for r in runs["unculled"]], [b], between)[1]
    return {"error": error, "noise": noise, "margin": max(MARGIN, noise), "good": error <= max(MARGIN, noise)}


# --- the frames -----------------------------------------------------------------------------------------------------

def frames(run):
    """Time (s) of each frame, and granules in LIGGGHTS (exterior and interface) at its end."""
    table = next((t for t in run.tables if t.counted and "CPU" in t.columns), None)
    if table is None or len(table.rows) < 2:
        raise errors.RunError(f"{run.name} printed no frames")
    rows = np.array(table.rows)
    return np.diff(rows[:, table.columns.index("CPU")]), rows[1:, table.columns.index("Atoms")]


def exterior(run):
    """Mean number of exterior granules in each frame; an unculled run has no other granules."""
    seconds, atoms = frames(run)
    if not run.counts:
        return atoms
    frame = np.ceil(run.counts["step"] * len(seconds) / run.steps()).astype(int) - 1
    return np.array([run.counts["exterior"][frame == k].mean() for k in range(len(seconds))])


def paper_rows(runs):
    """The rows of the paper's Table 1: name, unculled, culled (medians of the runs)."""
    figures = {"total time (s)": lambda r: r.own_time,
               "least frame time (s)": lambda r: frames(r)[0].min(),
               "mean frame time (s)": lambda r: frames(r)[0].mean(),
               "least granule count": lambda r: frames(r)[1].min()}
    return {name: [statistics.median(float(of(r)) for r in runs[kind]) for kind in ("unculled", "culled")]
            for name, of in figures.items()}


def bounds(runs):
    """N over N_exterior: in the mean of a run, and in its best frame; infinite where nothing is exterior."""
    n = len(runs["unculled"][0].final)
    counts = [exterior(r) for r in runs["culled"]]
    means = statistics.fmean(float(c.mean()) for c in counts), statistics.median(float(c.min()) for c in counts)
    return [n / mean if mean else np.inf for mean in means]


def text(result, runs):
    rows, bound, error = paper_rows(runs), bounds(runs), profile_error(runs)
    result.update(paper_rows=rows, n_over_exterior=bound, profile=error)
    lines = [f"{'':22}{'unculled':>10}{'culled':>10}{'ratio':>8}{'ratio in the paper':>20}"]
    for name, (a, b) in rows.items():
        form = ",.0f" if "count" in name else ".3f" if "frame" in name else ".1f"
        ratio = a / b if b else np.inf
        lines.append(f"{name:22}{a:>10{form}}{b:>10{form}}{ratio:>8.2f}{PAPER.get(name, '-'):>20}")
    lines.append(f"N / N_exterior        {bound[0]:.2f} in the mean, {bound[1]:.2f} in the best frame: "
                 "the speed-up that an engine of linear cost could give")
    lines.append(f"heap profile          error {100 * error['error']:.2f} %, noise floor {100 * error['noise']:.2f} %, margin "
                 f"{100 * error['margin']:.2f} %: {'good' if error['good'] else 'OUTSIDE'} (volume between profiles over the heap's)")
    return "\n".join([*lines, "", tables.explained(result)])


def plot(runs, file):
    figure, (time, count, shape) = plots.plt.subplots(3, 1, figsize=(7, 9))
    for style, run in plots.of_both(runs):
        seconds, atoms = frames(run)
        frame = np.arange(1, len(seconds) + 1)
        time.plot(frame, seconds, **style)
        count.plot(frame, atoms, **style)
        shape.plot((np.arange(len(run.profile)) + 0.5) * RING, run.profile, **style)
    count.plot(frame, np.median([exterior(r) for r in runs["culled"]], axis=0), color=plots.STATES[0][1], lw=1.5,
               label="culled: exterior alone")
    time.set(ylabel="frame time (s)", ylim=(0, None))
    count.set(xlabel="frame", ylabel="granules in LIGGGHTS", ylim=(0, None))
    shape.set(xlabel="distance from the axis (m)", ylabel="height of the heap (m)", xlim=(0, 1.2))
    for ax in (time, count, shape):
        ax.legend()
    plots.save(figure, file)


def moments(out, steps, runs):
    """The moments of Figure 5; with few steps, the last that there is."""
    run = runs["culled"][0]
    in_frame = run.steps() // len(frames(run)[0])
    named = {frame * in_frame: name for frame, name in MOMENTS.items()} if in_frame * max(MOMENTS) <= steps[-1] else {steps[-1]: "the last"}
    for step, name in named.items():
        frame = step // in_frame
        images = cutaways.cut_away_files(out, step, 0, *SHOWN)
        yield (f"{name}: frame {frame}, {frame / FRAME_RATE:.2f} s", *(images or (None,)))


FALLING_MASS = examples.Example(
    here=HERE, deck="fall.in", bed="make.in", bed_takes="making the oval of 15,600 granules: about a minute",
    sources=("material.in",), granules=15600, steps=25200, wanted=METRICS, figures=heap, plot=plot, moments=moments, text=text,
    files_every=400, vary=("dx", SHIFTS),
    few={"frames": 2, "perframe": 200}, few_bed={"granules": 500, "pullsteps": 2000, "dampsteps": 300, "fadesteps": 300, "reststeps": 100},
    few_granules=500, few_steps=400, few_files_every=100)

if __name__ == "__main__":
    errors.command("falling_mass", lambda: examples.main(FALLING_MASS))
