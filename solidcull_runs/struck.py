"""What examples draw of a ball that strikes a bed: its height and the exterior granules over time, and some moments."""
import numpy as np

from . import cutaways, plots


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
