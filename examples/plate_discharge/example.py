"""Fills the plate once, discharges it unculled and culled, and leaves the table, a plot and a picture in out/.

    examples/plate_discharge/example.py [--unculled N] [--culled N] [--fix KEYWORDS] [--steps N] [--few-steps]

A run that is in out/ already, of the same decks and variables, and, if culled, of the same library, is not made again: the
unculled one takes an hour.
"""
import argparse
import hashlib
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE.parents[1] / "validation")]
import pictures  # noqa: E402
import twin      # noqa: E402

OUT = HERE / "out"
LAUNCHER = os.environ.get("SOLIDCULL_LAUNCHER")  # default: as twin finds it
TIME_STEP, START, END = 1e-4, 0.75, 15.0         # s: of LIGGGHTS; when the walls vanish; of the benchmark
DIAMETER, PLATE = 0.01, 0.4                      # m: of the granules; height of the plate
SIDE = (0.15, 0.35)                              # m: |x| between which an angle of repose is measured
LATE = 10.0                                      # s: from here on angles are averaged
FILES = 5000                                     # steps between two looks at the whole heap
DISCHARGE_TIMES = (1.5, 2.0, 3.0, 5.0, 10.0, 15.0)  # s
METRICS = ("v_load",)                            # the plate's load (N)
FEW = "-few"                                     # in the names of what --few-steps leaves


# --- what a heap is like --------------------------------------------------------------------------------------------

def crest(x, y, low, high):
    """Centres of the highest granules in bands of a diameter's width between two x: (x, y) of each."""
    edges = np.linspace(low, high, round((high - low) / DIAMETER) + 1)
    band = np.digitize(x, edges) - 1
    tops = []
    for k in range(len(edges) - 1):
        of_band = np.flatnonzero(band == k)
        if len(of_band):
            tops.append(of_band[np.argmax(y[of_band])])
    return x[tops], y[tops]


def angles(x, y):
    """Angles of repose (degrees): of the heap on the plate and of the pile below, each the mean of left and right."""
    found = []
    for there, sign in ((y > PLATE, -1), (y < PLATE, 1)):
        sides = [crest(side * x[there], y[there], *SIDE) for side in (-1, 1)]
        found.append(np.mean([np.degrees(np.arctan(sign * np.polyfit(*s, 1)[0])) if len(s[0]) > 1 else np.nan for s in sides]))
    return found


def surface(x, y, above):
    """Highest granule's centre in each band of a diameter (m), over the plate or below it; nan where there is none."""
    there = (y > PLATE) == above
    edges = np.linspace(-0.5, 0.5, round(1 / DIAMETER) + 1)
    height = np.full(len(edges) - 1, -np.inf)
    np.maximum.at(height, np.clip(np.digitize(x[there], edges) - 1, 0, len(height) - 1), y[there])
    return np.where(np.isfinite(height), height, np.nan)


def snapshots(file):
    """Each snapshot of a dump: (step, rows)."""
    for part in file.read_text().split("ITEM: TIMESTEP\n")[1:]:
        head, _, rows = part.partition("ITEM: ATOMS ")
        columns, _, rows = rows.partition("\n")
        yield int(head.split()[0]), np.array(rows.split(), float).reshape(-1, len(columns.split()))


def history(run):
    """Times (s) and angles of both heaps, from files that hold every granule."""
    if run.counts:
        files = OUT / f"{run.name}.bed.*.vtp"
        places = [(step, pictures.read_vtp(pictures.file_at(files, step))["points"]) for step in pictures.steps_of(files)]
    else:
        places = list(snapshots(OUT / f"{run.name}.places"))
    return np.array([[step * TIME_STEP, *angles(at[:, 0], at[:, 1])] for step, at in places]).reshape(-1, 3).T


def discharge(run):
    """Times (s) and number of granules that have left the plate."""
    seen, rows = set(), []
    for step, ids in snapshots(OUT / f"{run.name}.seen"):
        seen.update(ids[:, 0].astype(int).tolist())
        rows.append((step * TIME_STEP, len(seen)))
    return np.array(rows).T


def heap(run):
    if run.final is None:
        raise twin.TwinError(f"{run.name} ended without writing its granules; see {OUT / (run.name + '.log')}")
    x, y = run.final["x"], run.final["y"]
    run.history, run.discharge = history(run), discharge(run)
    run.surfaces = [surface(x, y, above) for above in (True, False)]
    times = run.history[0]
    figures = dict(zip(("angle top, end (deg)", "angle bottom, end (deg)"), map(float, angles(x, y))))
    if (times >= LATE).any():
        top, bottom = run.history[1:, times >= LATE].mean(axis=1)
        figures |= {f"angle top, from {LATE:g} s (deg)": float(top), f"angle bottom, from {LATE:g} s (deg)": float(bottom)}
    figures |= {f"discharged at {t:g} s": float(np.interp(t, *run.discharge)) for t in DISCHARGE_TIMES if t <= run.discharge[0][-1]}
    figures["left on the plate"] = int((y > PLATE).sum())
    figures["granules outside"] = int(((abs(x) > 0.5) | (y < 0)).sum())
    return {k: v for k, v in figures.items() if np.isfinite(v)}


# --- runs -----------------------------------------------------------------------------------------------------------

def hash_of_fix():
    """Of the launcher and the library that holds the fix."""
    launcher = twin.find_launcher(LAUNCHER)
    needs = subprocess.run(["ldd", launcher], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True).stdout
    files = [launcher, *re.findall(r"libsolidcull\S* => (/\S+)", needs)]
    return hashlib.sha1(b"".join(Path(f).read_bytes() for f in files)).hexdigest()


def run_once(deck, name, variables, text, leaves, made_with=()):
    """Runs a deck, unless its log is there and was made of the same text and variables, and with the same; the log's text, and
    whether it ran. With --few-steps it always runs. `leaves`: the file that it writes last."""
    log, note = OUT / f"{name}.log", OUT / f"{name}.recipe"
    recipe = json.dumps([variables, text, (HERE / "material.in").read_text(), (HERE / "plate.stl").read_text(), *made_with])
    if FEW not in name and log.exists() and leaves.exists() and note.exists() and note.read_text() == recipe:
        return log.read_text(errors="replace"), False
    for old in (note, leaves, *OUT.glob(f"{name}.bed.*.vtp")):
        old.unlink(missing_ok=True)
    printed = twin.run_liggghts(twin.find_launcher(LAUNCHER), deck, HERE, log, variables)
    if not leaves.exists():
        raise twin.TwinError(f"{name} ended before its deck did; see {log}")
    note.write_text(recipe)
    return printed, True


def fill(few):
    """The restart file of the filled plate, at t = 0.75 s; and the time that its run took (s)."""
    name = f"filled{FEW if few else ''}"
    variables = {"restart": f"out/{name}.restart", **({"granules": 500, "steps": 5000} if few else {})}
    printed, _ = run_once(HERE / "fill.in", name, variables, (HERE / "fill.in").read_text(), HERE / variables["restart"])
    return variables["restart"], sum(t.loop_time or 0 for t in twin.parse_log(printed))


def discharge_run(kind, k, length, variables, keywords):
    """The k-th unculled or culled run (a twin.Run), its granules moved by 1e-5 d unless k is 0. `length`: in its files' names."""
    name = f"{kind}{length}-{k + 1}"
    base = OUT / name
    lines = twin.read_deck(HERE / "discharge.in")
    culled = kind == "culled"
    made = base.with_suffix(".in")
    text = "\n".join(twin.make_deck(lines, "cull", culled, twin.SEEDS[k - 1] if k else None, base)) + "\n"
    if culled:
        text = re.sub(r"^(fix\s+\S+\s+\S+\s+solid/cull.*)$", rf"\1 bed {FILES} out/{name}.bed.*.vtp", text, flags=re.M)
        variables = {**variables, **({"keywords": keywords} if keywords else {})}
    made.write_text(text)
    printed, new = run_once(made, name, {**variables, "twin": name}, text, base.with_suffix(".final"),
                            (hash_of_fix(),) if culled else ())
    tables = twin.parse_log(printed)
    run = twin.Run(name, tables, sum(t.loop_time or 0 for t in tables if t.counted))
    if culled:
        run.counts = twin.read_counts(base.with_suffix(".counts"))
    run.final = twin.read_final(base.with_suffix(".final"))
    run.metrics = {m: twin.metric_of(tables, m) for m in METRICS} | heap(run)
    print(f"  {name}: {run.loop_time:.1f} s{'' if new else ' (made before)'}", flush=True)
    return run


def frames_of(run):
    """Steps and seconds since the fix line, of each thermo row."""
    return run.series("cpu")


def plot(runs, file):
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    fig, axes = plt.subplots(3, 2, figsize=(11, 11))
    (profile, pile), (angle, below), (left, speed) = axes
    x = (np.arange(round(1 / DIAMETER)) + 0.5) * DIAMETER - 0.5
    for kind, colour, width in (("unculled", "0.7", 4), ("culled", "tab:blue", 1.3)):
        for k, run in enumerate(runs[kind]):
            label = None if k else kind
            for ax, height in zip((profile, pile), run.surfaces):
                ax.plot(x, height, color=colour, lw=width, label=label)
            for ax, values in zip((angle, below), run.history[1:]):
                ax.plot(run.history[0], values, color=colour, lw=width)
            left.plot(run.discharge[0], run.discharge[1], color=colour, lw=width)
            step, seconds = frames_of(run)
            speed.plot(step * TIME_STEP, seconds, color=colour, lw=width, label=label)
            if run.counts:
                right = speed.twinx()
                right.plot(run.counts["step"] * TIME_STEP, run.counts["exterior"], color=pictures.STATES[0][1], lw=1)
                right.set(ylabel="exterior granules (tan)", ylim=(0, None))
    profile.set(ylabel="heap on the plate (m)", xlabel="x (m)")
    pile.set(ylabel="pile below (m)", xlabel="x (m)")
    angle.set(ylabel="angle of repose, top (degrees)", xlabel="time (s)")
    below.set(ylabel="angle of repose, bottom (degrees)", xlabel="time (s)")
    left.set(ylabel="granules that left the plate", xlabel="time (s)")
    speed.set(ylabel="loop time so far (s)", xlabel="time (s)")
    profile.legend()
    fig.tight_layout()
    fig.savefig(file, dpi=120)
    plt.close(fig)


def draw(run, file, pixels=900):
    """The whole scene from the front, at four moments, by state; False without bed files."""
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.patches import Patch
    files = OUT / f"{run.name}.bed.*.vtp"
    steps = pictures.steps_of(files)
    if not steps:
        return False
    shown = sorted({steps[round(k)] for k in np.linspace(0, len(steps) - 1, 4)})
    fig, axes = plt.subplots(1, len(shown), squeeze=False, figsize=(4 * len(shown), 3.6))
    for ax, step in zip(axes[0], shown):
        bed = pictures.read_vtp(pictures.file_at(files, step))
        # pictures look along y with z up: here they look along -z with y up, at the front half cut away
        at = bed["points"][:, [0, 2, 1]] * (1, -1, 1)
        front = at[:, 1] > -0.1
        image = pictures.Picture((-0.5, -0.1, 0), (0.5, 0, 0.7), pixels, turn=0, tilt=0)
        colours = np.array([pictures.STATES[int(s)][1] for s in bed["state"]])
        image.spheres(at[front], bed["radius"][front].astype(float), colours[front])
        ax.imshow(image.image)
        ax.plot([0.05 * pixels, 0.95 * pixels], 2 * [(0.7 - PLATE) * pixels], color="0.3", lw=1.5)
        ax.set_title(f"{step * TIME_STEP:.1f} s")
        ax.axis("off")
    fig.legend(handles=[Patch(color=c, label=n) for n, c in pictures.STATES.values()], loc="lower center", ncol=4, frameon=False)
    fig.tight_layout(rect=(0, 0.08, 1, 1))
    fig.savefig(file, dpi=110)
    plt.close(fig)
    return True


def profile_text(runs):
    """Rms difference of the heaps' surfaces (m, every pair of a culled and an unculled run; every pair of unculled ones)."""
    def rms(a, b, k):
        return float(np.sqrt(np.nanmean((a.surfaces[k] - b.surfaces[k])**2)))

    lines = []
    for k, name in enumerate(("heap on the plate", "pile below")):
        if all(np.isnan(r.surfaces[k]).all() for r in runs["unculled"]):
            continue
        error = np.mean([rms(a, b, k) for a in runs["unculled"] for b in runs["culled"]])
        pairs = [rms(a, b, k) for i, a in enumerate(runs["unculled"]) for b in runs["unculled"][:i]]
        lines.append(f"surface of the {name}: culled from unculled {error / DIAMETER:.2f} d rms" +
                     (f", unculled among themselves {max(pairs) / DIAMETER:.2f} d" if pairs else ""))
    return "\n".join(lines)


def main(argv=None):
    p = argparse.ArgumentParser(prog="example.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--unculled", type=int, default=1, metavar="N", help="unculled runs (default 1: an hour each)")
    p.add_argument("--culled", type=int, default=1, metavar="N", help="culled runs (default 1; 0: unculled alone)")
    p.add_argument("--fix", metavar="KEYWORDS", default="exterior sleep tolerance 10 0", help='of the fix, in one word (default "exterior sleep tolerance 10 0")')
    p.add_argument("--steps", type=int, help="of the discharge (default 142500: to t = 15 s)")
    p.add_argument("--few-steps", action="store_true", help="500 granules, 3,100 steps: that the decks still run")
    a = p.parse_args(argv)
    OUT.mkdir(exist_ok=True)
    restart, fill_time = fill(a.few_steps)
    steps = a.steps or (3100 if a.few_steps else None)
    variables = {"restart": restart, **({"steps": steps} if steps else {}), **({"rows": 100} if a.few_steps else {})}
    length = FEW if a.few_steps else f"-{steps}" if steps else ""
    runs = {kind: [discharge_run(kind, k, length, variables, a.fix) for k in range(n)]
            for kind, n in (("unculled", a.unculled), ("culled", a.culled))}
    if not runs["culled"]:
        for run in runs["unculled"]:
            print(run.name, json.dumps(run.metrics, indent=1))
        return 0
    result = twin.judge(runs["unculled"], runs["culled"], 0.02)
    times = [result[kind]["loop_time"] + fill_time for kind in ("unculled", "culled")]
    text = (f"{twin.table(result)}\n\n{profile_text(runs)}\nwith the {START} s of filling, as the benchmark counts: "
            f"{times[0]:.0f} s against {times[1]:.0f} s, {times[0] / times[1]:.2f} times faster")
    result["with_filling"] = times
    (OUT / f"twin{length}.json").write_text(json.dumps(result, indent=1) + "\n")
    (OUT / f"table{length}.txt").write_text(text + "\n")
    plot(runs, OUT / f"profile{length}.png")
    drawn = draw(runs["culled"][0], OUT / f"side{length}.png")
    print(f"\n{text}\n\nplot: {OUT / f'profile{length}.png'}" + (f"\npicture: {OUT / f'side{length}.png'}" if drawn else ""))
    book = result["ledger"]
    return 1 if not book or book["lost"] or book["ids_missing"] else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except twin.TwinError as e:
        sys.exit(f"plate_discharge: {e}")
