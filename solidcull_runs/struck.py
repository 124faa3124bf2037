"""What is measured of a ball that strikes a bed, and what examples draw of it: its height and the exterior granules over time, and
some moments."""
import numpy as np

from . import cutaways, measures, plots
from .dumps import read_final

CELL = 5e-4  # m, of the height map


def bed_of(granules, striker_radius):
    """Without the ball: larger radii are that."""
    return granules[granules["radius"] < striker_radius]


def crater_of(box, striker_radius):
    """Figures of an example: what the strike did to the surface of a bed that is `box` wide (m), from the places of all granules."""
    def crater(run, out):
        start = read_final(out / f"{run.name}.start")
        return dict(zip(("crater volume", "heap volume"),
                        measures.crater(*(bed_of(g, striker_radius) for g in (start, run.final)), (box, box), CELL)))
    return crater


def metrics_of(run, box, striker_radius, energy):
    """Metrics of a validation case; energy: the column of the bed's kinetic energy."""
    depth, force, moving, floor = (run.series(c)[1] for c in ("v_depth", "v_force", energy, "v_floor"))
    before, after = (bed_of(g, striker_radius) for g in (run.start, run.final))
    lost, gained = measures.crater(before, after, (box, box), CELL)
    way = np.sqrt(sum((after[c] - before[c])**2 for c in "xyz"))
    return {"largest depth": depth.max(), "depth at the end": depth[-1], "peak force on the ball": force.max(),
            "mean kinetic energy": moving.mean(), "peak kinetic energy": moving.max(), "peak load on the floor": floor.max(),
            "load on the floor at the end": floor[-1], "sum of displacements": way.sum(), "crater": lost, "heap": gained}


def milliseconds_of(time_step):
    return lambda step: step * time_step * 1e3


def plot_of(time_step):
    milliseconds = milliseconds_of(time_step)

    def plot(runs, file):
        figure, (top, bottom) = plots.rows(2, (7, 6))
        for style, run in plots.of_both(runs):
            step, height = run.series("c_ballz")
            top.plot(milliseconds(step), height * 1e3, **style)
        top.set_ylabel("height of the ball's centre (mm)")
        top.legend()
        plots.exterior(bottom, runs["culled"], milliseconds)
        bottom.axhline(len(runs["unculled"][0].final), color="0.75", lw=4)
        bottom.set(xlabel="time (ms)", ylabel="exterior granules", ylim=(0, None))
        plots.save(figure, file)

    return plot


def moments_of(time_step, shown, cut, box, striker_radius):
    """shown: how many; cut: y of the plane that opens the bed; box: its edges (m); larger radii are the ball."""
    milliseconds = milliseconds_of(time_step)

    def moments(out, steps, runs):
        steps = steps[1:]  # before the first one nothing has been struck
        for step in sorted({steps[round(k) - 1] for k in np.geomspace(1, len(steps), shown)}):
            yield (f"{milliseconds(step):.0f} ms",
                   *cutaways.cut_away_files(out, step, cut, (0, 0, 0), box, striker_radius=striker_radius))

    return moments
