"""Fills the plate once, discharges it unculled and culled, and leaves the table, a plot and a picture in out/.

    examples/plate_discharge/example.py [--unculled N] [--culled N] [--fix KEYWORDS] [--steps N] [--few-steps]

A run that is in out/ already, of the same decks and variables, and, if culled, of the same library, is not made again: the
unculled one takes an hour.
"""
import argparse
import json
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))
from solidcull_runs import beds, comparisons, cutaways, dumps, engine, errors, few_steps, logs, plots, tables, twins, vtp  # noqa: E402
from solidcull_runs.measures import rms  # noqa: E402

TIME_STEP, START = 1e-4, 0.75                    # s: of LIGGGHTS; when the walls vanish
DIAMETER, PLATE = 0.01, 0.4                      # m: of the granules; height of the plate
SIDE = (0.15, 0.35)                              # m: |x| between which an angle of repose is measured
LATE = 10.0                                      # s: from here on angles are averaged
GRANULES, STEPS, FILES = 52000, 142500, 5000     # of the deck; steps between two looks at the whole heap
DISCHARGE_TIMES = (1.5, 2.0, 3.0, 5.0, 10.0, 15.0)  # s
METRICS = ("v_load",)                            # the plate's load (N)
FEW = {"granules": 500, "fill": 12000, "steps": 3100, "rows": 100, "keywords": "every 20 calm 1 speed 0.1"}


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


def history(run, out):
    """Times (s) and angles of both heaps, from files that hold every granule."""
    if run.counts:
        files = out / f"{run.name}.bed.*.vtp"
        places = [(step, vtp.read(vtp.file_at(files, step))["points"]) for step in vtp.steps_of(files)]
    else:
        places = [(step, at) for step, _, at in dumps.snapshots(out / f"{run.name}.places")]
    return np.array([[step * TIME_STEP, *angles(at[:, 0], at[:, 1])] for step, at in places]).reshape(-1, 3).T


def discharge(run, out):
    """Times (s) and number of granules that have left the plate."""
    seen, rows = set(), []
    for step, _, ids in dumps.snapshots(out / f"{run.name}.seen"):
        seen.update(ids[:, 0].astype(int).tolist())
        rows.append((step * TIME_STEP, len(seen)))
    return np.array(rows).T


def heap(run, out):
    x, y = run.final["x"], run.final["y"]
    run.history, run.discharge = history(run, out), discharge(run, out)
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

def fill(out, few):
    """The restart file of the filled plate, at t = 0.75 s; and the time that its run took (s)."""
    bed = beds.settled(out / "bed.restart", HERE / "fill.in", [HERE / "material.in", HERE / "plate.stl"],
                       {"granules": FEW["granules"], "steps": FEW["fill"]} if few else {})
    return bed, sum(t.loop_time or 0 for t in logs.parse_log(bed.with_suffix(".log").read_text(errors="replace")))


def job(kind, k, length, variables, keywords, out, made_with, few):
    """The k-th unculled or culled run, its granules moved by 1e-5 d unless k is 0. `length`: in its files' names."""
    name = f"{kind}{length}-{k + 1}"
    files = f"bed {FILES} {out.relative_to(HERE)}/{name}.bed.*.vtp" + (f" {FEW['keywords']}" if few else "")
    culled = kind == "culled"
    made = (twins.Job if few else twins.KeptJob)
    how = {} if few else {"made_with": made_with + (engine.hash_of_fix(engine.find_launcher()) if culled else "")}
    return made(HERE / "discharge.in", out, kind, k, {**variables, **({"keywords": keywords} if culled and keywords else {})}, wanted=METRICS,
                extra=lambda run: heap(run, out), name=name, keywords=files, **how)


# --- results --------------------------------------------------------------------------------------------------------

def plot(runs, file):
    figure, axes = plots.plt.subplots(3, 2, figsize=(11, 11))
    (profile, pile), (angle, below), (left, speed) = axes
    x = (np.arange(round(1 / DIAMETER)) + 0.5) * DIAMETER - 0.5
    right = speed.twinx()
    for style, run in plots.of_both(runs):
        for ax, height in zip((profile, pile), run.surfaces):
            ax.plot(x, height, **style)
        for ax, values in zip((angle, below), run.history[1:]):
            ax.plot(run.history[0], values, **style)
        left.plot(*run.discharge, **style)
        step, seconds = run.series("cpu")
        speed.plot(step * TIME_STEP, seconds, **style)
    plots.exterior(right, runs["culled"], lambda step: step * TIME_STEP)
    right.set(ylabel="exterior granules (tan)", ylim=(0, None))
    profile.set(ylabel="heap on the plate (m)", xlabel="x (m)")
    pile.set(ylabel="pile below (m)", xlabel="x (m)")
    angle.set(ylabel="angle of repose, top (degrees)", xlabel="time (s)")
    below.set(ylabel="angle of repose, bottom (degrees)", xlabel="time (s)")
    left.set(ylabel="granules that left the plate", xlabel="time (s)")
    speed.set(ylabel="loop time so far (s)", xlabel="time (s)")
    profile.legend()
    plots.save(figure, file)


def draw(run, out, file, pixels=900):
    """The whole scene from the front, at four moments, by state; False without bed files."""
    files = out / f"{run.name}.bed.*.vtp"
    steps = vtp.steps_of(files)
    if not steps:
        return False
    shown = sorted({steps[round(k)] for k in np.linspace(0, len(steps) - 1, 4)})
    figure, axes = plots.plt.subplots(1, len(shown), squeeze=False, figsize=(4 * len(shown), 3.6))
    for ax, step in zip(axes[0], shown):
        bed = vtp.read(vtp.file_at(files, step))
        # pictures look along y with z up: here they look along -z with y up, at the front half cut away
        at = bed["points"][:, [0, 2, 1]] * (1, -1, 1)
        front = at[:, 1] > -0.1
        image = cutaways.Picture((-0.5, -0.1, 0), (0.5, 0, 0.7), pixels, turn=0, tilt=0)
        image.spheres(at[front], bed["radius"][front].astype(float), cutaways.colours_of(bed)[front])
        ax.imshow(image.image)
        ax.plot([0.05 * pixels, 0.95 * pixels], 2 * [(0.7 - PLATE) * pixels], color="0.3", lw=1.5)
        ax.set_title(f"{step * TIME_STEP:.1f} s")
        ax.axis("off")
    cutaways.legend(figure, mesh=False)
    plots.save(figure, file, rect=(0, 0.08, 1, 1), dpi=110)
    return True


def profile_text(runs):
    """Rms difference of the heaps' surfaces (m, every pair of a culled and an unculled run; every pair of unculled ones)."""
    lines = []
    for k, name in enumerate(("heap on the plate", "pile below")):
        of = {kind: [r.surfaces[k] for r in runs[kind]] for kind in twins.KINDS}
        if all(np.isnan(surface).all() for surface in of["unculled"]):
            continue
        error, noise = comparisons.apart(of["unculled"], of["culled"], rms)
        lines.append(f"surface of the {name}: culled from unculled {error / DIAMETER:.2f} d rms" +
                     (f", unculled among themselves {noise / DIAMETER:.2f} d" if noise else ""))
    return "\n".join(lines)


def main(argv=None):
    p = argparse.ArgumentParser(prog="example.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--unculled", type=int, default=1, metavar="N", help="unculled runs (default 1: an hour each)")
    p.add_argument("--culled", type=int, default=1, metavar="N", help="culled runs (default 1; 0: unculled alone)")
    p.add_argument("--fix", metavar="KEYWORDS", default="exterior sleep tolerance 10 0", help='of the fix, in one word (default "exterior sleep tolerance 10 0")')
    p.add_argument("--steps", type=int, help=f"of the discharge (default {STEPS}: to t = 15 s)")
    p.add_argument("--few-steps", action="store_true", help=f"{FEW['granules']} granules, {FEW['steps']:,} steps: that the decks still run")
    a = p.parse_args(argv)
    few = a.few_steps
    out = HERE / "out" / "few" if few else HERE / "out"
    bed, fill_time = fill(out, few)
    steps, granules = (FEW["steps"], FEW["granules"]) if few else (a.steps or STEPS, GRANULES)
    variables = {"restart": bed.relative_to(HERE), "folder": out.relative_to(HERE), "steps": steps, **({"rows": FEW["rows"]} if few else {})}
    length = f"-{a.steps}" if a.steps and not few else ""
    jobs = [job(kind, k, length, variables, a.fix, out, beds.recipe_of(bed), few) for kind, k in twins.in_turns(a.unculled, a.culled)]
    done = twins.run_jobs(jobs, say=lambda line: print("  " + line, flush=True), steps=steps)
    runs = {kind: [run for j, run in zip(jobs, done) if j.kind == kind] for kind in twins.KINDS}
    if not runs["culled"]:
        for run in runs["unculled"]:
            print(run.name, json.dumps(run.metrics, indent=1))
        return 0
    if few:
        few_steps.check(runs, granules, steps)
    result = comparisons.judge(runs["unculled"], runs["culled"], granules=granules)
    times = [result[kind]["own_time"] + fill_time for kind in twins.KINDS]
    text = (f"{tables.explained(result)}\n\n{profile_text(runs)}\nwith the {START} s of filling, as the benchmark counts: "
            f"{times[0]:.0f} s against {times[1]:.0f} s, {times[0] / times[1]:.2f} times faster")
    result["with_filling"] = times
    (out / f"twin{length}.json").write_text(json.dumps(result, indent=1) + "\n")
    (out / f"table{length}.txt").write_text(text + "\n")
    plot(runs, out / f"plot{length}.png")
    drawn = draw(runs["culled"][0], out, out / f"side{length}.png")
    print(f"\n{text}\n\nplot: {out / f'plot{length}.png'}\n" + (f"picture: {out / f'side{length}.png'}" if drawn else "no picture: the fix wrote no files"))
    return 1 if not drawn or comparisons.is_lost(result["ledger"]) else 0


if __name__ == "__main__":
    errors.command("plate_discharge", main)
