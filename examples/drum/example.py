"""Fills the drum once, turns it unculled and culled, and leaves the table, a plot and pictures in out/."""
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))
from solidcull_runs import cutaways, dumps, errors, examples, meshes, plots, tables  # noqa: E402
from solidcull_runs.measures import height_map  # noqa: E402

RADIUS, LENGTH, FACETS = 0.1, 0.06, 48     # m, m, number: the drum
DIAMETER = 0.005                           # m: mean of the granules
TIME_STEP, PERIOD = 5e-5, 12.0             # s: of LIGGGHTS, of one turn; as in material.in
METRICS = ("c_moving:mean", "c_flow:mean", "v_torque:mean", "v_load:mean")
CELL = 0.001                               # m, of the height map
SHOWN = 4                                  # moments in the picture


def write_drum(out):
    meshes.write_stl(out / "drum.stl", meshes.drum(RADIUS, LENGTH, FACETS))


def turned(steps):
    """The angle (radians) by which the drum turns in so many steps."""
    return 2 * np.pi * steps * TIME_STEP / PERIOD


def surface_angle(granules):
    """Slope of the surface (degrees): a straight line through the bed's height over the middle half of the drum's width."""
    height = height_map(granules, (-RADIUS / 2, 0), (RADIUS, LENGTH), CELL, ground=-np.inf)
    column, row = np.nonzero(np.isfinite(height))
    return float(np.degrees(np.arctan(-np.polyfit(column * CELL, height[column, row], 1)[0])))


def surface_angles(run, out):
    """Steps and surface angles of a run."""
    return np.array([(step, surface_angle(dict(zip(columns, rows.T))))
                     for step, columns, rows in dumps.snapshots(out / f"{run.name}.middle.dump")]).T


def displacements(run, out):
    """How far each granule has moved relative to the drum (m), by id."""
    start, end = dumps.read_final(out / f"{run.name}.start"), run.final
    start = start[np.isin(start["id"], end["id"])]
    angle = turned(run.steps())
    c, s = np.cos(angle), np.sin(angle)
    return np.sqrt((end["x"] - c * start["x"] - s * start["z"])**2 + (end["y"] - start["y"])**2 +
                   (end["z"] + s * start["x"] - c * start["z"])**2)


def bed_figures(run, out):
    """Metrics from the places of the granules: at the end all of them, for the surface those at hand."""
    run.angles = surface_angles(run, out)
    share = run.final["mass"] / run.final["mass"].sum()
    moved = displacements(run, out)
    return {"surface angle, mean": float(run.angles[1].mean()),
            "centre of mass x": float((share * run.final["x"]).sum()), "centre of mass z": float((share * run.final["z"]).sum()),
            "mean displacement": float(moved.mean()), "share displaced > d": float((moved > DIAMETER).mean())}


def text(result, runs):
    moving = result["metrics"]["c_moving:mean"]["mean"]
    return (f"{tables.explained(result)}\n\npassive share, which bounds the culling: "
            f"{1 - moving / result['ledger']['granules']:.1%} of the granules")


def plot(runs, file):
    figure, (top, middle, bottom) = plots.rows(3, (7, 8))

    def degrees(step):
        return np.degrees(turned(step - start))
    for style, run in plots.of_both(runs):
        start = run.series("c_moving")[0][0]
        top.plot(degrees(run.angles[0]), run.angles[1], **style)
        step, torque = (v[1:] for v in run.series("v_torque"))  # at the first step the mesh has no load yet
        middle.plot(degrees(step), -torque, **style)
        step, moving = run.series("c_moving")
        bottom.plot(degrees(step), moving, **style)
    plots.exterior(bottom, runs["culled"], degrees)
    top.set_ylabel("angle of the surface (degrees)")
    top.legend()
    middle.set_ylabel("torque on the drum (N m)")
    bottom.axhline(len(runs["unculled"][0].final), color="0.75", lw=3)
    bottom.set(xlabel="drum turned by (degrees)", ylabel="granules: all, exterior (tan), moving", ylim=(0, None))
    plots.save(figure, file)


def moments(out, steps, runs):
    start = runs["unculled"][0].series("c_moving")[0][0]
    for step in sorted({steps[round(k)] for k in np.linspace(0, len(steps) - 1, SHOWN)}):
        images = cutaways.cut_away_files(out, step, LENGTH / 2, (-RADIUS, LENGTH / 2, -RADIUS), (RADIUS, LENGTH, 0.8 * RADIUS))
        yield (f"turned by {np.degrees(turned(step - start)):.0f}°", *images)


DRUM = examples.Example(
    here=HERE, deck="turn.in", bed="fill.in", bed_takes="filling the drum with 8,600 granules: one to two minutes",
    sources=("material.in",), granules=8600, steps=20000, wanted=METRICS, figures=bed_figures, plot=plot, moments=moments, text=text,
    prepare=write_drum, files_every=2000, vdb_every=10000,
    few={"steps": 500}, few_bed={"granules": 500, "poursteps": 5000, "turnsteps": 300}, few_granules=500, few_steps=500,
    few_files_every=100, few_keywords="exterior sleep every 20 calm 1 speed 0.1")

if __name__ == "__main__":
    errors.command("drum", lambda: examples.main(DRUM))
