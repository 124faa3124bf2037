"""Fills the drum once, turns it unculled and culled, and leaves the table, a plot and pictures in out/."""
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
RADIUS, LENGTH, FACETS = 0.1, 0.06, 48     # m, m, number: the drum
DIAMETER = 0.005                           # m: mean of the granules
TIME_STEP, PERIOD = 5e-5, 12.0             # s: of LIGGGHTS, of one turn; as in material.in
METRICS = ("c_moving:mean", "c_flow:mean", "v_torque:mean", "v_load:mean")
CELL = 0.001                               # m, of the height map
FILE_STEPS = 20000                         # of the run that writes files


def drum_stl():
    """The drum as STL text: axis y from 0 to LENGTH, corners at RADIUS; each end cap in strips from rim to rim."""
    angle = 2 * np.pi * np.arange(FACETS) / FACETS
    rim = [[(RADIUS * np.cos(a), y, RADIUS * np.sin(a)) for a in angle] for y in (0.0, LENGTH)]
    triangles = []
    for k in range(FACETS):
        n = (k + 1) % FACETS
        triangles += [(rim[0][k], rim[0][n], rim[1][n]), (rim[0][k], rim[1][n], rim[1][k])]
    zigzag = [0] + [k for n in range(1, FACETS // 2) for k in (n, FACETS - n)] + [FACETS // 2]
    for corners in zip(zigzag, zigzag[1:], zigzag[2:]):
        triangles += [[cap[k] for k in corners] for cap in rim]
    facets = ("facet normal 0 0 0\nouter loop\n" + "".join("vertex {:.9g} {:.9g} {:.9g}\n".format(*v) for v in t) +
              "endloop\nendfacet\n" for t in triangles)
    return "solid drum\n" + "".join(facets) + "endsolid drum\n"


def fill(launcher):
    """The filled drum, unless it is there and newer than what makes it."""
    bed, drum = OUT / "bed.restart", OUT / "drum.stl"
    if not drum.exists() or drum.read_text() != drum_stl():
        drum.write_text(drum_stl())
    if bed.exists() and all(bed.stat().st_mtime > f.stat().st_mtime for f in (HERE / "fill.in", HERE / "material.in", drum)):
        return
    print("filling the drum with 8,600 granules: one to two minutes, only the first time", flush=True)
    twin.run_liggghts(launcher, HERE / "fill.in", HERE, OUT / "fill.log", {"restart": "out/bed.part"})
    (OUT / "bed.part").rename(bed)


def turned(steps):
    """The angle (radians) by which the drum turns in so many steps."""
    return 2 * np.pi * steps * TIME_STEP / PERIOD


def frames(file):
    """Each snapshot of a dump `x y z radius`: (step, rows)."""
    for part in Path(file).read_text().split("ITEM: TIMESTEP\n")[1:]:
        head, _, rows = part.partition("ITEM: ATOMS x y z radius")
        yield int(head.split()[0]), np.array(rows.split(), float).reshape(-1, 4)


def surface_angle(granules):
    """Slope of the surface (degrees): a straight line through the bed's height over the middle half of the drum's width."""
    x, y, z, r = granules.T
    columns, rows = round(RADIUS / CELL), round(LENGTH / CELL)
    height = np.full((columns, rows), -np.inf)
    reach = int(np.ceil(r.max() / CELL))
    i, j = np.floor((x + RADIUS / 2) / CELL).astype(int), np.floor(y / CELL).astype(int)
    for di in range(-reach, reach + 1):
        for dj in range(-reach, reach + 1):
            left = r**2 - ((i + di + 0.5) * CELL - RADIUS / 2 - x)**2 - ((j + dj + 0.5) * CELL - y)**2
            k = (left > 0) & (i + di >= 0) & (i + di < columns) & (j + dj >= 0) & (j + dj < rows)
            np.maximum.at(height, (i[k] + di, j[k] + dj), z[k] + np.sqrt(left[k]))
    column, row = np.nonzero(np.isfinite(height))
    return float(np.degrees(np.arctan(-np.polyfit(column * CELL, height[column, row], 1)[0])))


def surface_angles(run):
    """Steps and surface angles of a run."""
    found = [(step, surface_angle(granules)) for step, granules in frames(OUT / f"{run.name}.middle.dump")]
    return np.array(found).T


def displacements(run):
    """How far each granule has moved relative to the drum (m), by id."""
    start, end = twin.read_final(OUT / "start.dump"), run.final
    start = start[np.isin(start["id"], end["id"])]
    steps, _ = run.series("c_moving")
    c, s = np.cos(turned(steps[-1] - steps[0])), np.sin(turned(steps[-1] - steps[0]))
    return np.sqrt((end["x"] - c * start["x"] - s * start["z"])**2 + (end["y"] - start["y"])**2 +
                   (end["z"] + s * start["x"] - c * start["z"])**2)


def bed_figures(run):
    """Metrics from the places of the granules: at the end all of them, for the surface those at hand."""
    if run.final is None:
        raise twin.TwinError(f"{run.name} ended without writing its granules; see {OUT / (run.name + '.log')}")
    share = run.final["mass"] / run.final["mass"].sum()
    moved = displacements(run)
    return {"surface angle, mean": float(surface_angles(run)[1].mean()),
            "centre of mass x": float((share * run.final["x"]).sum()), "centre of mass z": float((share * run.final["z"]).sum()),
            "mean displacement": float(moved.mean()), "share displaced > d": float((moved > DIAMETER).mean())}


def plot(runs, file):
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    fig, (top, middle, bottom) = plt.subplots(3, 1, sharex=True, figsize=(7, 8))
    granules = len(runs["unculled"][0].final)
    for kind, colour, width in (("unculled", "0.75", 3), ("culled", "tab:blue", 1)):
        for k, run in enumerate(runs[kind]):
            start = run.series("c_moving")[0][0]
            step, angle = surface_angles(run)
            top.plot(np.degrees(turned(step - start)), angle, color=colour, lw=width, label=None if k else f"{kind}, {len(runs[kind])} runs")
            step, torque = (v[1:] for v in run.series("v_torque"))  # at the first step the mesh has no load yet
            middle.plot(np.degrees(turned(step - start)), -torque, color=colour, lw=width)
            step, moving = run.series("c_moving")
            bottom.plot(np.degrees(turned(step - start)), moving, color=colour, lw=width)
            if run.counts:
                bottom.plot(np.degrees(turned(run.counts["step"] - start)), run.counts["exterior"], color=pictures.STATES[0][1], lw=1.2)
    top.set_ylabel("angle of the surface (degrees)")
    top.legend()
    middle.set_ylabel("torque on the drum (N m)")
    bottom.axhline(granules, color="0.75", lw=3)
    bottom.set(xlabel="drum turned by (degrees)", ylabel="granules: all, exterior (tan), moving", ylim=(0, None))
    fig.tight_layout()
    fig.savefig(file, dpi=120)
    plt.close(fig)


def run_for_files(launcher):
    """One more culled run, not timed, that writes what ParaView opens and the pictures are drawn from."""
    files = " bed 2000 out/bed.*.vtp mesh 2000 out/mesh.*.vtp mesh 10000 out/mesh.*.vdb"
    deck = re.sub(r"^(fix\s+\S+\s+\S+\s+solid/cull.*)$", r"\1" + files, (HERE / "turn.in").read_text(), flags=re.M)
    (OUT / "files.in").write_text(deck)
    twin.run_liggghts(launcher, OUT / "files.in", HERE, OUT / "files.log", {"steps": FILE_STEPS, "twin": "files"})


def draw(start, count=4):
    """Cut-away pictures at a few times; False when the fix has left no files to draw. `start`: the step of the first."""
    steps = pictures.steps_of(OUT / "bed.*.vtp")
    if not steps:
        return False
    moments = []
    for step in sorted({steps[round(k)] for k in np.linspace(0, len(steps) - 1, count)}):
        mesh = pictures.file_at(OUT / "mesh.*.vtp", step)
        images = pictures.cut_away(pictures.read_vtp(OUT / f"bed.{step}.vtp"), pictures.read_vtp(mesh) if mesh else None,
                                   LENGTH / 2, (-RADIUS, LENGTH / 2, -RADIUS), (RADIUS, LENGTH, 0.8 * RADIUS))
        moments.append((f"turned by {np.degrees(turned(step - start)):.0f}°", *images))
    pictures.film_strip(moments, OUT / "cut-away.png")
    return True


def main():
    OUT.mkdir(exist_ok=True)
    launcher = twin.find_launcher()
    fill(launcher)
    for old in [f for kind in ("bed.*.vtp", "mesh.*.vtp", "mesh.*.vdb") for f in OUT.glob(kind)]:
        old.unlink()
    print("turning the drum, unculled and culled in turns", flush=True)
    result, runs = twin.compare(HERE / "turn.in", METRICS, launcher, OUT, unculled=3, culled=3, extra=bed_figures,
                                say=lambda line: print("  " + line, flush=True))
    (OUT / "twin.json").write_text(json.dumps(result, indent=1) + "\n")
    book, moving = result["ledger"], result["metrics"]["c_moving:mean"]["mean"]
    text = f"{twin.table(result)}\n\npassive share, which bounds the culling: {1 - moving / book['granules']:.1%} of the granules"
    (OUT / "table.txt").write_text(text + "\n")
    plot(runs, OUT / "drum.png")
    run_for_files(launcher)
    drawn = draw(runs["unculled"][0].series("c_moving")[0][0])
    print(f"\n{text}\n\nplot: {OUT / 'drum.png'}" + (f"\npictures: {OUT / 'cut-away.png'}" if drawn else
          "\nno pictures: the fix wrote no out/bed.*.vtp"))
    return 1 if not drawn or book["lost"] or book["ids_missing"] else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except twin.TwinError as e:
        sys.exit(f"drum: {e}")
