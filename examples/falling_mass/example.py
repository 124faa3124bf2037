"""Makes the oval once, drops it unculled and culled, and leaves the paper's table, the error, a plot and pictures in out/."""
import itertools
import json
import re
import statistics
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE.parents[1] / "validation")]
import pictures  # noqa: E402
import twin      # noqa: E402

OUT = HERE / "out"
PER_FRAME = 400                      # time steps
FRAME_RATE = 24                      # 1/s
SHIFTS = (0, 2e-7, -2e-7)            # m: how far each granule is moved in each run, 1e-5 granule diameters
METRICS = ("f_load:max", "f_load")   # load on the floor, mean of a frame (N)
MARGIN = 0.02
WIDTH, CELL, RING = 4.0, 0.005, 0.04  # m: the floor, a cell of the height map, a ring of the profile
MOMENTS = {3: "in the air", 6: "hit", 12: "spreading", 63: "lying"}  # frame: name, as in Figure 5
SHOWN = (-0.75, -0.05, 0), (0.75, 0.45, 0.72)                       # m, the box in the pictures
PAPER = {"total time (s)": "13.6", "least frame time (s)": "52"}  # ratios


def make(launcher):
    """The oval, unless it is there and newer than the decks that make it."""
    oval = OUT / "oval.restart"
    if oval.exists() and all(oval.stat().st_mtime > (HERE / f).stat().st_mtime for f in ("make.in", "material.in")):
        return
    print("making the oval of 15,600 granules: about a minute, only the first time", flush=True)
    twin.run_liggghts(launcher, HERE / "make.in", HERE, OUT / "make.log", {"restart": "out/oval.part"})
    (OUT / "oval.part").rename(oval)


# --- the heap -------------------------------------------------------------------------------------------------------

def height_map(granules):
    """Height of the surface (m) over a grid of CELL, 0 where there is only floor."""
    n = round(WIDTH / CELL)
    height = np.zeros((n, n))
    reach = int(np.ceil(granules["radius"].max() / CELL))
    x, y = granules["x"] + WIDTH / 2, granules["y"] + WIDTH / 2
    i, j = (x / CELL).astype(int), (y / CELL).astype(int)
    for di, dj in itertools.product(range(-reach, reach + 1), repeat=2):
        left = granules["radius"]**2 - ((i + di + 0.5) * CELL - x)**2 - ((j + dj + 0.5) * CELL - y)**2
        k = (left > 0) & (i + di >= 0) & (i + di < n) & (j + dj >= 0) & (j + dj < n)
        np.maximum.at(height, (i[k] + di, j[k] + dj), granules["z"][k] + np.sqrt(left[k]))
    return height


def profile(height):
    """Mean height (m) of the rings around the axis of the fall, and their areas (m2)."""
    middles = (np.arange(len(height)) + 0.5) * CELL - WIDTH / 2
    ring = (np.hypot(middles[:, None], middles) / RING).astype(int).ravel()
    cells = np.bincount(ring)
    return np.bincount(ring, height.ravel()) / np.maximum(cells, 1), cells * CELL**2


def heap(run):
    """What the heap is like, from the places of all granules at the end; keeps the run's profile."""
    if run.final is None:
        raise twin.TwinError(f"{run.name} ended without writing its granules; see {OUT / (run.name + '.log')}")
    height = height_map(run.final)
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

    noise = max((between(p.profile, q.profile) for p, q in itertools.combinations(runs["unculled"], 2)), default=0.0)
    return {"error": between(a, b), "noise": noise, "margin": max(MARGIN, noise), "good": between(a, b) <= max(MARGIN, noise)}


# --- the frames -----------------------------------------------------------------------------------------------------

def frames(run):
    """Time (s) of each frame, and granules in LIGGGHTS (exterior and interface) at its end."""
    table = next((t for t in run.tables if t.counted and "CPU" in t.columns), None)
    if table is None or len(table.rows) < 2:
        raise twin.TwinError(f"{run.name} printed no frames; see {OUT / (run.name + '.log')}")
    rows = np.array(table.rows)
    return np.diff(rows[:, table.columns.index("CPU")]), rows[1:, table.columns.index("Atoms")]


def exterior(run):
    """Mean number of exterior granules in each frame; an unculled run has no other granules."""
    seconds, atoms = frames(run)
    if not run.counts:
        return atoms
    frame = np.ceil(run.counts["step"] / PER_FRAME).astype(int) - 1
    return np.array([run.counts["exterior"][frame == k].mean() for k in range(len(seconds))])


def paper_rows(runs):
    """The rows of the paper's Table 1: name, unculled, culled (medians of the runs)."""
    figures = {"total time (s)": lambda r: r.loop_time,
               "least frame time (s)": lambda r: frames(r)[0].min(),
               "mean frame time (s)": lambda r: frames(r)[0].mean(),
               "least granule count": lambda r: frames(r)[1].min()}
    return {name: [statistics.median(float(of(r)) for r in runs[kind]) for kind in ("unculled", "culled")]
            for name, of in figures.items()}


def bounds(runs):
    """N over N_exterior: in the mean of a run, and in its best frame."""
    n = len(runs["unculled"][0].final)
    counts = [exterior(r) for r in runs["culled"]]
    return (n / statistics.fmean(float(c.mean()) for c in counts), n / statistics.median(float(c.min()) for c in counts))


def text_of(rows, bound, error):
    lines = [f"{'':22}{'unculled':>10}{'culled':>10}{'ratio':>8}{'ratio in the paper':>20}"]
    for name, (a, b) in rows.items():
        form = ",.0f" if "count" in name else ".3f" if "frame" in name else ".1f"
        lines.append(f"{name:22}{a:>10{form}}{b:>10{form}}{a / b:>8.2f}{PAPER.get(name, '-'):>20}")
    lines.append(f"N / N_exterior        {bound[0]:.2f} in the mean, {bound[1]:.2f} in the best frame: "
                 "the speed-up that an engine of linear cost could give")
    lines.append(f"heap profile          error {100 * error['error']:.2f} %, noise floor {100 * error['noise']:.2f} %, margin "
                 f"{100 * error['margin']:.2f} %: {'good' if error['good'] else 'OUTSIDE'} (volume between profiles over the heap's)")
    return "\n".join(lines)


def plot(runs, file):
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    fig, (time, count, shape) = plt.subplots(3, 1, figsize=(7, 9))
    for kind, colour, width in (("unculled", "0.75", 4), ("culled", "tab:blue", 1.5)):
        of_runs = [frames(r) for r in runs[kind]]
        frame = np.arange(1, len(of_runs[0][0]) + 1)
        time.plot(frame, np.median([s for s, _ in of_runs], axis=0), color=colour, lw=width, label=f"{kind}, median of {len(of_runs)}")
        count.plot(frame, np.median([n for _, n in of_runs], axis=0), color=colour, lw=width, label=kind)
        for k, run in enumerate(runs[kind]):
            shape.plot((np.arange(len(run.profile)) + 0.5) * RING, run.profile, color=colour, lw=width, label=None if k else kind)
    count.plot(frame, np.median([exterior(r) for r in runs["culled"]], axis=0), color=pictures.STATES[0][1], lw=1.5,
               label="culled: exterior alone")
    time.set(ylabel="frame time (s)", ylim=(0, None))
    count.set(xlabel="frame", ylabel="granules in LIGGGHTS", ylim=(0, None))
    shape.set(xlabel="distance from the axis (m)", ylabel="height of the heap (m)", xlim=(0, 1.2))
    for ax in (time, count, shape):
        ax.legend()
    fig.tight_layout()
    fig.savefig(file, dpi=120)
    plt.close(fig)


# --- the pictures ---------------------------------------------------------------------------------------------------

def run_for_files(launcher):
    """One more culled run, not timed, that writes what ParaView opens and the pictures are drawn from."""
    every = 3 * PER_FRAME
    files = f" bed {every} out/bed.*.vtp mesh {every} out/mesh.*.vtp"
    deck = re.sub(r"^(fix\s+\S+\s+\S+\s+solid/cull.*)$", r"\1" + files, (HERE / "fall.in").read_text(), flags=re.M)
    (OUT / "files.in").write_text(deck)
    twin.run_liggghts(launcher, OUT / "files.in", HERE, OUT / "files.log", {})


def draw():
    """Cut-away pictures at MOMENTS; False when the fix has left no files to draw."""
    moments = []
    for frame, name in MOMENTS.items():
        step = frame * PER_FRAME
        bed, mesh = (pictures.file_at(OUT / f"{kind}.*.vtp", step) for kind in ("bed", "mesh"))
        if bed:
            images = pictures.cut_away(pictures.read_vtp(bed), pictures.read_vtp(mesh) if mesh else None, 0, *SHOWN)
            moments.append((f"{name}: frame {frame}, {frame / FRAME_RATE:.2f} s", *images))
    if moments:
        pictures.film_strip(moments, OUT / "cut-away.png")
    return len(moments) == len(MOMENTS)


def main():
    OUT.mkdir(exist_ok=True)
    launcher = twin.find_launcher()
    make(launcher)
    for old in [f for kind in ("bed.*.vtp", "mesh.*.vtp") for f in OUT.glob(kind)]:
        old.unlink()
    print("dropping the oval, unculled and culled in turns", flush=True)
    result, runs = twin.compare(HERE / "fall.in", METRICS, launcher, OUT, unculled=3, culled=3, vary=("dx", SHIFTS), margin=MARGIN,
                                extra=heap, say=lambda line: print("  " + line, flush=True))
    rows, bound, error = paper_rows(runs), bounds(runs), profile_error(runs)
    result.update(paper_rows=rows, n_over_exterior=bound, profile=error)
    (OUT / "twin.json").write_text(json.dumps(result, indent=1) + "\n")
    text = text_of(rows, bound, error) + "\n\n" + twin.table(result)
    (OUT / "table.txt").write_text(text + "\n")
    print(f"\n{text}\n", flush=True)
    plot(runs, OUT / "frames.png")
    run_for_files(launcher)
    drawn = draw()
    print(f"plot: {OUT / 'frames.png'}\n" + (f"pictures: {OUT / 'cut-away.png'}" if drawn else
          "pictures missing: the fix wrote no out/bed.*.vtp"))
    book = result["ledger"]
    return 1 if not drawn or not book or book["lost"] or book["ids_missing"] else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except twin.TwinError as e:
        sys.exit(f"falling_mass: {e}")
