"""Settles the bed once, strikes it unculled and culled, and leaves the table, a plot and pictures in out/."""
import json
import re
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE.parents[1] / "validation")]
import pictures  # noqa: E402
import twin      # noqa: E402

OUT = HERE / "out"
BOX, DEPTH, STRIKER = 0.075, 0.062, 0.005  # m: width of the bed, height shown, larger radii are the ball
TIME_STEP = 3e-5                           # s
SHIFTS = (0, 2.6e-8, -2.6e-8)              # m: the ball's x in each run, 1e-5 granule diameters apart
METRICS = ("v_depth", "v_depth:max", "v_force:max", "c_bedke:max", "c_bedke:mean", "v_floor:max", "v_floor", "c_path")
CELL = 0.0005                              # m, of the height map


def settle(launcher):
    """The settled bed, unless it is there and newer than the decks that make it."""
    bed = OUT / "bed.restart"
    if bed.exists() and all(bed.stat().st_mtime > (HERE / f).stat().st_mtime for f in ("settle.in", "bed.in", "floor.stl")):
        return
    print("settling 20,000 granules: one to two minutes, only the first time", flush=True)
    twin.run_liggghts(launcher, HERE / "settle.in", HERE, OUT / "settle.log", {"restart": "out/bed.part"})
    (OUT / "bed.part").rename(bed)


def surface(granules):
    """Height of the bed's surface (m) over a grid of CELL."""
    granules = granules[granules["radius"] < STRIKER]
    n = round(BOX / CELL)
    height = np.zeros((n, n))
    reach = int(np.ceil(granules["radius"].max() / CELL))
    i, j = (granules["x"] / CELL).astype(int), (granules["y"] / CELL).astype(int)
    for di in range(-reach, reach + 1):
        for dj in range(-reach, reach + 1):
            x, y = (i + di + 0.5) * CELL, (j + dj + 0.5) * CELL
            left = granules["radius"]**2 - (x - granules["x"])**2 - (y - granules["y"])**2
            k = (left > 0) & (i + di >= 0) & (i + di < n) & (j + dj >= 0) & (j + dj < n)
            np.maximum.at(height, (i[k] + di, j[k] + dj), granules["z"][k] + np.sqrt(left[k]))
    return height


def crater(run):
    """What the strike did to the surface, from the places of all granules at the end."""
    if run.final is None:
        raise twin.TwinError(f"{run.name} ended without writing its granules; see {OUT / (run.name + '.log')}")
    change = surface(run.final) - surface(twin.read_final(OUT / "start.dump"))
    return {"crater volume": float(-change[change < 0].sum() * CELL**2),
            "heap volume": float(change[change > 0].sum() * CELL**2)}


def plot(runs, file):
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    fig, (top, bottom) = plt.subplots(2, 1, sharex=True, figsize=(7, 6))
    for kind, colour, width in (("unculled", "0.75", 4), ("culled", "tab:blue", 1)):
        for k, run in enumerate(runs[kind]):
            step, height = run.series("c_ballz")
            top.plot(step * TIME_STEP * 1e3, height * 1e3, color=colour, lw=width, label=None if k else f"{kind}, {len(runs[kind])} runs")
    top.set_ylabel("height of the ball's centre (mm)")
    top.legend()
    for run in runs["culled"]:
        if run.counts:
            bottom.plot(run.counts["step"] * TIME_STEP * 1e3, run.counts["exterior"], color=pictures.STATES[0][1], lw=1.2)
    bottom.axhline(len(runs["unculled"][0].final), color="0.75", lw=4)
    bottom.set(xlabel="time (ms)", ylabel="exterior granules", ylim=(0, None))
    fig.tight_layout()
    fig.savefig(file, dpi=120)
    plt.close(fig)


def run_for_files(launcher):
    """One more culled run, not timed, that writes what ParaView opens and the pictures are drawn from."""
    files = " bed 400 out/bed.*.vtp mesh 400 out/mesh.*.vtp mesh 4000 out/mesh.*.vdb"
    deck = re.sub(r"^(fix\s+\S+\s+\S+\s+solid/cull.*)$", r"\1" + files, (HERE / "impact.in").read_text(), flags=re.M)
    (OUT / "files.in").write_text(deck)
    twin.run_liggghts(launcher, OUT / "files.in", HERE, OUT / "files.log", {})


def draw(count=4):
    """Cut-away pictures at a few times; False when the fix has left no files to draw."""
    steps = pictures.steps_of(OUT / "bed.*.vtp")
    if not steps:
        return False
    moments = []
    for step in sorted({steps[round(k) - 1] for k in np.geomspace(1, len(steps), count)}):
        mesh = pictures.file_at(OUT / "mesh.*.vtp", step)
        images = pictures.cut_away(pictures.read_vtp(OUT / f"bed.{step}.vtp"), pictures.read_vtp(mesh) if mesh else None,
                                   BOX / 2, (0, 0, 0), (BOX, BOX, DEPTH), striker_radius=STRIKER)
        moments.append((f"{step * TIME_STEP * 1e3:.0f} ms", *images))
    pictures.film_strip(moments, OUT / "cut-away.png")
    return True


def main():
    OUT.mkdir(exist_ok=True)
    launcher = twin.find_launcher()
    settle(launcher)
    for old in [f for kind in ("bed.*.vtp", "mesh.*.vtp", "mesh.*.vdb") for f in OUT.glob(kind)]:
        old.unlink()
    print("striking the bed, unculled and culled in turns", flush=True)
    result, runs = twin.compare(HERE / "impact.in", METRICS, launcher, OUT, unculled=3, culled=3, vary=("dx", SHIFTS),
                                extra=crater, say=lambda line: print("  " + line, flush=True))
    (OUT / "twin.json").write_text(json.dumps(result, indent=1) + "\n")
    text = twin.table(result)
    (OUT / "table.txt").write_text(text + "\n")
    plot(runs, OUT / "impact.png")
    run_for_files(launcher)
    drawn = draw()
    print(f"\n{text}\n\nplot: {OUT / 'impact.png'}" + (f"\npictures: {OUT / 'cut-away.png'}" if drawn else
          "\nno pictures: the fix wrote no out/bed.*.vtp"))
    book = result["ledger"]
    return 1 if not drawn or book["lost"] or book["ids_missing"] else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except twin.TwinError as e:
        sys.exit(f"impact: {e}")
