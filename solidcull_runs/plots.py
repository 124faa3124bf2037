"""Curves of unculled and culled runs, or of culled ones and those with half the limits."""
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

# the paper's colours, by the value of the point array `state`
STATES = {0: ("exterior", (0.85, 0.73, 0.55)), 1: ("interface", (0.25, 0.45, 0.80)), 2: ("interior", (0.33, 0.62, 0.33)),
          3: ("waking", (0.95, 0.55, 0.10))}
STYLES = (("unculled", "0.75", 4), ("halved", "0.75", 4), ("culled", "tab:blue", 1.3))  # kind, colour, width of the line


def of_both(runs):
    """Kind's label (for its first run alone), style of the line and run, for each run."""
    for kind, colour, width in STYLES:
        n = len(runs.get(kind, ()))
        for k, run in enumerate(runs.get(kind, ())):
            yield {"label": f"{kind}, {n} run{'s' if n > 1 else ''}" if k == 0 else None, "color": colour, "lw": width}, run


def rows(n, size):
    """A figure of n curves one above the other, with one axis of steps or time."""
    figure, axes = plt.subplots(n, 1, sharex=True, squeeze=False, figsize=size)
    return figure, axes[:, 0]


def save(figure, file, rect=(0, 0, 1, 1), dpi=120):
    figure.tight_layout(rect=rect)
    figure.savefig(file, dpi=dpi)
    plt.close(figure)


def columns(runs, names, file):
    """Thermo columns against the step, and the exterior granules of the culled runs."""
    names = list(dict.fromkeys(names))
    figure, axes = rows(len(names) + 1, (8, 2.4 * (len(names) + 1)))
    for ax, name in zip(axes, names):
        for style, run in of_both(runs):
            ax.plot(*run.series(name), **style)
        ax.set_ylabel(name)
    axes[0].legend()
    exterior(axes[-1], runs["culled"])
    axes[-1].set(ylabel="exterior granules", xlabel="step")
    save(figure, file)


def exterior(ax, runs, x=lambda step: step):
    """The exterior granules of culled runs, in their colour; `x`: what stands on the axis, of a step."""
    for run in runs:
        if run.counts:
            ax.plot(x(run.counts["step"]), run.counts["exterior"], color=STATES[0][1], lw=1)
